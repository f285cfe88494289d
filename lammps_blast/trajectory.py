"""Read LAMMPS ``dump custom`` trajectories, text or binary, inside MDAnalysis.

MDAnalysis's own reader of LAMMPS dumps moves every frame so that the low corner of the box is the
origin (MDAnalysis issue #4148), which makes particles jump when the box is shrink-wrapped, and it
assumes Å and ps. :class:`BlastDumpReader` leaves positions where they are and every number in the
unit in which LAMMPS wrote it (SI with ``units si``: m, s, kg, C).

>>> from lammps_blast.trajectory import open_universe
>>> universe = open_universe("runs/magnetic_blast")  # doctest: +SKIP
>>> for ts in universe.trajectory[::10]:  # doctest: +SKIP
...     print(ts.time, ts.data["position"].mean(axis=0))

What a frame holds (N particles, sorted by id; doubles, fresh arrays every frame):

==================================  ======  ====================================================
``ts.data`` key                     shape   from the columns
==================================  ======  ====================================================
``position``                        (N, 3)  ``x y z``, else ``xu yu zu``, else the scaled
                                            ``xs ys zs`` or ``xsu ysu zsu``, unscaled by the box
``velocity``                        (N, 3)  ``vx vy vz``
``angular_velocity``                (N, 3)  ``omegax omegay omegaz``
``force``                           (N, 3)  ``fx fy fz``
``torque``                          (N, 3)  ``tqx tqy tqz``
``radius``                          (N,)    ``radius``, else half of ``diameter``
``id``                              (N,)    ``id``, int64, the same read-only array every frame
any other column, by its own name   (N,)    that column
``box``                             (3, 2)  low and high bound of the box along x, y, z
``time``, ``step``                  scalar  simulated time in s, number of the time step
==================================  ======  ====================================================

A key is absent when its columns are. Our binary trajectories hold ``type``, ``mass``, ``radius``
and ``q`` once, in a dump of their own, `constants.lammpsbin`. Any dump that lacks these columns is
given them by the ids of its atoms where that file lies beside it, in the same read-only arrays
every frame.

``ts.positions``, ``ts.velocities`` and ``ts.forces`` hold the same values in float32, as everywhere
in MDAnalysis. ``ts.dimensions`` is the box; MDAnalysis takes every box for periodic, so pass
``periodic=False`` to selections (``box=None`` to distance functions) for a cloud in a
shrink-wrapped box.

Without an ``id`` column the particles are taken in the order written, with a warning; a frame
written by several MPI ranks is then an error, because its order means nothing. The columns
``element`` and ``typelabel``, which hold text, are left out; any other text is an error.
"""

from __future__ import annotations

import io
import mmap
import os
import re
import struct
import warnings
from array import array
from collections.abc import Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np
from MDAnalysis import Universe
from MDAnalysis.coordinates.base import ReaderBase
from MDAnalysis.coordinates.timestep import Timestep
from MDAnalysis.core import topologyattrs
from MDAnalysis.core.topology import Topology
from MDAnalysis.lib.util import store_init_arguments
from MDAnalysis.topology.base import TopologyReaderBase

from lammps_blast.deck import (
    BINARY_CONSTANTS,
    BINARY_TRAJECTORY,
    CONSTANT_COLUMNS,
    TEXT_TRAJECTORY,
)
from lammps_blast.input_files import regular_files_only
from lammps_blast.text_columns import read_text_columns

FORMATS = ["BLASTDUMP", "LAMMPSBIN"]  # the second makes MDAnalysis know the file by its suffix

POSITIONS = (("x", "y", "z"), ("xu", "yu", "zu"), ("xs", "ys", "zs"), ("xsu", "ysu", "zsu"))
VECTORS = {
    "velocity": ("vx", "vy", "vz"),
    "angular_velocity": ("omegax", "omegay", "omegaz"),
    "force": ("fx", "fy", "fz"),
    "torque": ("tqx", "tqy", "tqz"),
}
TEXT_COLUMNS = frozenset({"element", "typelabel"})

MAGIC = (b"DUMPCUSTOM", b"DUMPATOM")
MAX_LINE = 1 << 16  # bytes; no header line is longer, whatever a damaged file says
NEXT_ITEM = re.compile(b"ITEM:")  # finds several times faster than a memory map's own method
# Frames of a binary dump after which all others may be taken for as long as the last of them: the
# first may differ, by its columns or by naming the units.
FRAMES_TO_COMPARE = 3
MAX_STEP = 2**63 - 1
MAX_ID = 2**53  # a binary dump stores ids as doubles

Buffer = mmap.mmap | bytes


class TrajectoryError(ValueError):
    """A trajectory that cannot be used; the message is one line that says why."""


class _CutError(Exception):
    """The file ends before the frame does."""


def open_universe(path: str | os.PathLike[str], timestep: float | None = None) -> Universe:
    """Open the trajectory of a run as an MDAnalysis Universe.

    Parameters
    ----------
    path
        A run folder (holding ``trajectory.lammpstrj`` or ``trajectory.lammpsbin``) or a dump file.
    timestep
        Length of a LAMMPS step in s; needed only for a dump without times, whose time is then
        step number times ``timestep`` (wrong if the run changed its step).

    Returns
    -------
    MDAnalysis.Universe
        N atoms in one residue, with ids and, where the dump has them, types, masses, radii and
        charges of the first frame. Masses that are absent are not guessed.

    Raises
    ------
    TrajectoryError
        No such file, no trajectory in the folder, not a dump, damaged, no positions, no times.

    """
    reader = BlastDumpReader(find_trajectory(path), timestep=timestep)
    # Universe(topology, file) would read the first frame for each of the two.
    universe = Universe(_topology(reader.n_atoms, reader.ts.data), to_guess=())
    universe.trajectory = reader
    return universe


def find_trajectory(path: str | os.PathLike[str]) -> Path:
    """Return the dump file that a run folder holds; a path that is a file is returned as it is.

    Raises TrajectoryError if there is no such path, no trajectory in the folder, or two.
    """
    path = Path(path)
    if not path.exists():
        raise TrajectoryError(f"{path}: no such file or folder")
    if not path.is_dir():
        return path
    found = [path / n for n in (TEXT_TRAJECTORY, BINARY_TRAJECTORY) if (path / n).is_file()]
    if not found:
        raise TrajectoryError(f"{path}: holds neither {TEXT_TRAJECTORY} nor {BINARY_TRAJECTORY}")
    if len(found) > 1:
        raise TrajectoryError(
            f"{path}: holds both {TEXT_TRAJECTORY} and {BINARY_TRAJECTORY}; name the one to read"
        )
    return found[0]


@dataclass(frozen=True, slots=True)
class _Header:
    """What stands before the atoms of a frame; ``body`` is the offset at which they begin."""

    step: int
    time: float | None
    units: str
    n_atoms: int
    box: np.ndarray
    columns: tuple[str, ...]
    n_chunks: int
    body: int


@dataclass(frozen=True, slots=True)
class _Columns:
    """Where the quantities stand in the (N, number of numeric columns) table of a frame.

    ``position`` is empty where there are none.
    """

    written: tuple[str, ...]
    numeric: list[int]
    position: list[int]
    scaled: bool
    vectors: dict[str, list[int]]
    scalars: dict[str, int]

    @classmethod
    def from_names(cls, written: tuple[str, ...]) -> _Columns:
        numeric = [i for i, name in enumerate(written) if name not in TEXT_COLUMNS]
        index = {written[i]: place for place, i in enumerate(numeric)}
        names = next((p for p in POSITIONS if index.keys() >= set(p)), ("",))
        vectors = {
            key: [index[c] for c in parts]
            for key, parts in VECTORS.items()
            if index.keys() >= set(parts)
        }
        position = [index[c] for c in names if c]
        taken = set(position).union(*vectors.values())
        scalars = {name: i for name, i in index.items() if i not in taken}
        return cls(written, numeric, position, names[0].startswith("xs"), vectors, scalars)

    def split(self, table: np.ndarray, box: np.ndarray) -> dict[str, np.ndarray]:
        """The columns of a table by quantity, positions unscaled with the (3, 2) box."""
        # Of large clouds, take() is twice as fast as indexing.
        data = {key: table.take(places, axis=1) for key, places in self.vectors.items()}
        data |= {key: table[:, place].copy() for key, place in self.scalars.items()}
        if self.position:
            data["position"] = table.take(self.position, axis=1)
        if self.scaled:
            data["position"] = box[:, 0] + data["position"] * (box[:, 1] - box[:, 0])
        if "diameter" in data and "radius" not in data:
            data["radius"] = 0.5 * data["diameter"]
        return data


class _Format(Protocol):
    """How one of the two formats is read; offsets are counted from the start of the buffer.

    ``_CutError`` is raised where the buffer ends too early, TrajectoryError where it is damaged.
    """

    @staticmethod
    def header(buffer: Buffer, start: int) -> _Header: ...

    @staticmethod
    def end(buffer: Buffer, header: _Header) -> int:
        """Offset at which the frame ends; its atoms need not be checked, but must be all there."""

    @staticmethod
    def table(frame: bytes, header: _Header, columns: _Columns) -> np.ndarray:
        """The atoms as a float64 array of shape (n_atoms, numeric columns), in file order."""


class _Text:
    """``ITEM:`` sections, one line an atom."""

    @staticmethod
    def header(buffer: Buffer, start: int) -> _Header:
        lines = _lines(buffer, start)
        line, _ = next(lines)
        units, time = "", None
        if line == b"ITEM: UNITS":
            units = next(lines)[0].decode("ascii", "replace")
            line, _ = next(lines)
        if line == b"ITEM: TIME":
            time = _number(next(lines)[0], float, "a time")
            line, _ = next(lines)
        _expect(line, b"ITEM: TIMESTEP")
        step = _number(next(lines)[0], int, "a time step")
        _expect(next(lines)[0], b"ITEM: NUMBER OF ATOMS")
        n_atoms = _number(next(lines)[0], int, "a number of atoms")
        line, _ = next(lines)
        _expect(line[:16], b"ITEM: BOX BOUNDS")
        if b"xy" in line or b"abc" in line:
            raise TrajectoryError("the box is triclinic; only orthogonal boxes can be read")
        box = np.array([_bounds(next(lines)[0]) for _ in range(3)])
        line, body = next(lines)
        _expect(line[:11], b"ITEM: ATOMS")
        columns = tuple(line[11:].decode("ascii", "replace").split())
        return _Header(step, time, units, n_atoms, box, columns, 1, body)

    @staticmethod
    def end(buffer: Buffer, header: _Header) -> int:
        if following := NEXT_ITEM.search(buffer, header.body):
            return following.start()
        if _count_lines(buffer, header.body) < header.n_atoms:
            raise _CutError
        return buffer.rfind(b"\n", header.body) + 1

    @staticmethod
    def table(frame: bytes, header: _Header, columns: _Columns) -> np.ndarray:
        n_lines = frame.count(b"\n", header.body)
        if n_lines != header.n_atoms:
            raise TrajectoryError(f"{header.n_atoms} atoms announced, {n_lines} lines found")
        if len(columns.numeric) < len(columns.written):
            return _parse_lines(frame[header.body : -1], columns)
        shape = header.n_atoms, len(columns.written)
        if (table := read_text_columns(frame, header.body, shape)) is not None:
            return table
        lines = io.BytesIO(frame)
        lines.seek(header.body)
        try:
            table = np.loadtxt(lines, comments=None, encoding="latin1", ndmin=2)
        except ValueError:
            return _parse_lines(frame[header.body : -1], columns)
        if table.shape == shape:
            return table
        return _parse_lines(frame[header.body : -1], columns)  # blank lines are no error to numpy


def _count_lines(buffer: Buffer, start: int) -> int:
    """Count line ends from an offset on, without a copy of what may be all of a large file."""
    pieces = range(start, len(buffer), MAX_LINE)
    return sum(buffer[at : at + MAX_LINE].count(b"\n") for at in pieces)


def _parse_lines(body: bytes, columns: _Columns) -> np.ndarray:
    """The numeric columns of atom lines; slow, strict, and with messages that name the line."""
    rows = []
    for number, line in enumerate(body.split(b"\n"), start=1):
        fields = line.split()
        if len(fields) != len(columns.written):
            raise TrajectoryError(
                f"atom line {number} has {len(fields)} values for {len(columns.written)} columns"
            )
        try:
            rows.append([float(fields[i]) for i in columns.numeric])
        except ValueError:
            raise TrajectoryError(f"atom line {number} is not all numbers: {_show(line)}") from None
    return np.array(rows)


def _lines(buffer: Buffer, start: int) -> Iterator[tuple[bytes, int]]:
    """Lines without their ends, each with the offset of the next line."""
    while True:
        stop = buffer.find(b"\n", start, start + MAX_LINE)
        if stop < 0 and len(buffer) - start > MAX_LINE:
            raise TrajectoryError("a header line has no end")
        if stop < 0:
            raise _CutError
        yield buffer[start:stop].strip(), stop + 1
        start = stop + 1


def _expect(line: bytes, wanted: bytes) -> None:
    if line != wanted:
        raise TrajectoryError(f"damaged header: {wanted.decode()!r} expected, {_show(line)} found")


def _number(text: bytes, kind: type, what: str) -> Any:
    try:
        return kind(text)
    except ValueError:
        raise TrajectoryError(f"damaged header: {what} expected, {_show(text)} found") from None


def _bounds(line: bytes) -> list[float]:
    parts = line.split()
    if len(parts) != 2:
        raise TrajectoryError(f"damaged header: two box bounds expected, {_show(line)} found")
    return [_number(part, float, "a box bound") for part in parts]


def _show(text: bytes) -> str:
    short = text[:40].decode("ascii", "replace")
    return repr(short + "..." if len(text) > 40 else short)


class _Binary:
    """LAMMPS's native binary format (``DUMPCUSTOM``), revision 2 and later."""

    BEGIN = struct.Struct("<q")
    SHAPE = struct.Struct("<iiqqi6i6d")  # byte order, revision, step, atoms, triclinic, ...
    INT = struct.Struct("<i")
    DOUBLE = struct.Struct("<d")

    @classmethod
    def header(cls, buffer: Buffer, start: int) -> _Header:
        at = _Cursor(buffer, start)
        (length,) = at.take(cls.BEGIN)
        if -length not in map(len, MAGIC) or at.text(-length).encode() not in MAGIC:
            raise TrajectoryError("damaged header: no DUMPCUSTOM mark")
        byte_order, revision, step, n_atoms, triclinic, *rest = at.take(cls.SHAPE)
        if byte_order != 1:
            raise TrajectoryError("damaged header: bad byte-order mark")
        if revision < 2:
            raise TrajectoryError(
                "this binary dump does not name its columns (LAMMPS before 2021); write it as text"
            )
        if triclinic:
            raise TrajectoryError("the box is triclinic; only orthogonal boxes can be read")
        (n_columns,) = at.take(cls.INT)
        units = at.text(*at.take(cls.INT))
        timed = at.text(1) != "\0"
        time = at.take(cls.DOUBLE)[0] if timed else None
        columns = tuple(at.text(*at.take(cls.INT)).split())
        if len(columns) != n_columns:
            raise TrajectoryError(
                f"damaged header: {n_columns} columns announced, {len(columns)} named"
            )
        (n_chunks,) = at.take(cls.INT)
        box = np.array(rest[6:]).reshape(3, 2)
        return _Header(step, time, units, n_atoms, box, columns, n_chunks, at.offset)

    @classmethod
    def end(cls, buffer: Buffer, header: _Header) -> int:
        return cls._chunks(buffer, header)[-1][1]

    @classmethod
    def table(cls, frame: bytes, header: _Header, columns: _Columns) -> np.ndarray:
        chunks = [(a, b) for a, b in cls._chunks(frame, header) if a < b]
        if len(chunks) > 1 and "id" not in columns.scalars:
            raise TrajectoryError(
                "written by several MPI ranks without an id column: the order of the atoms is "
                "unknown; add id to the dump's columns"
            )
        parts = [np.frombuffer(frame, "<f8", (b - a) // 8, offset=a) for a, b in chunks]
        numbers = parts[0] if len(parts) == 1 else np.concatenate(parts)
        table = numbers.reshape(header.n_atoms, len(header.columns))
        if len(columns.numeric) < len(columns.written):
            return table[:, columns.numeric]
        return table

    @classmethod
    def _chunks(cls, buffer: Buffer, header: _Header) -> list[tuple[int, int]]:
        """First and last offset of each rank's doubles."""
        at = _Cursor(buffer, header.body)
        missing = header.n_atoms * len(header.columns)
        chunks = []
        for _ in range(header.n_chunks):
            (n,) = at.take(cls.INT)
            if n < 0 or n % len(header.columns) or n > missing:
                raise TrajectoryError(f"damaged: a chunk of {n} numbers where {missing} remain")
            start = at.offset
            at.skip(8 * n)
            missing -= n
            chunks.append((start, at.offset))
        if missing:
            raise TrajectoryError(f"damaged: {missing} numbers fewer than announced")
        return chunks


class _Cursor:
    """Takes typed values from a buffer, never past its end."""

    def __init__(self, buffer: Buffer, offset: int) -> None:
        self.buffer = buffer
        self.offset = offset

    def skip(self, size: int) -> int:
        """Move on by ``size`` bytes and return the offset moved from."""
        if size < 0:
            raise TrajectoryError("damaged header: a negative length")
        start = self.offset
        if start + size > len(self.buffer):
            raise _CutError
        self.offset = start + size
        return start

    def take(self, layout: struct.Struct) -> tuple:
        return layout.unpack_from(self.buffer, self.skip(layout.size))

    def text(self, size: int) -> str:
        if size > MAX_LINE:
            raise TrajectoryError(f"damaged header: a text of {size} bytes")
        start = self.skip(size)
        return self.buffer[start : self.offset].decode("ascii", "replace")


def _recognise(buffer: Buffer) -> type[_Format]:
    if buffer[:5] == b"ITEM:":
        return _Text
    mark = bytes(buffer[:18])
    for magic in MAGIC:
        if mark.startswith(struct.pack("<q", -len(magic)) + magic):
            return _Binary
        if mark.startswith(struct.pack(">q", -len(magic)) + magic):
            raise TrajectoryError("written on a machine of the other byte order; write it as text")
    raise TrajectoryError("not a LAMMPS dump (neither text nor binary)")


@dataclass
class _Dump:
    """An indexed dump: frame i lies between ``offsets[i]`` and ``offsets[i + 1]``.

    ``constants`` (N,) are what a file beside it says of columns that it lacks. ``unread`` is the
    first frame, until it is asked for: it has to be read for its ids.
    """

    path: str
    format: type[_Format]
    first: _Header
    columns: _Columns
    offsets: array
    cut: bool
    untimed: int | None
    ids: np.ndarray | None = None
    constants: dict[str, np.ndarray] = field(default_factory=dict)
    unread: tuple[_Header, np.ndarray] | None = None

    @property
    def n_frames(self) -> int:
        return len(self.offsets) - 1

    @classmethod
    def open(cls, path: str, limit: int | None = None) -> _Dump:
        """Scan a dump that must have positions, and find its constants."""
        dump = cls.scan(path, limit)
        if not dump.columns.position:
            wanted = ", ".join(" ".join(p) for p in POSITIONS)
            raise TrajectoryError(
                f"{path}: no position columns (one of: {wanted}) among the columns"
                f" {' '.join(dump.first.columns)!r}"
            )
        dump.constants = _constants_beside(dump)
        return dump

    @classmethod
    def scan(cls, path: str, limit: int | None = None) -> _Dump:
        """Find the first ``limit`` frames (all, if None) without reading their atoms."""
        with _located(path), open(path, "rb", opener=regular_files_only) as file:
            if os.fstat(file.fileno()).st_size == 0:
                raise TrajectoryError("the file is empty")
            with closing(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)) as buffer:
                dump = cls._scan(path, buffer, limit)
        with _open(path) as file:
            dump._read_first(file)
        return dump

    @classmethod
    def _scan(cls, path: str, buffer: mmap.mmap, limit: int | None) -> _Dump:
        kind = _recognise(buffer)
        offsets = array("q", [0])
        headers: list[_Header] = []
        cut, untimed = False, None
        while offsets[-1] < len(buffer) and len(offsets) - 1 != limit:
            frame = len(offsets) - 1
            try:
                with _located(f"frame {frame}"):
                    header = kind.header(buffer, offsets[-1])
                    _check_same(header, headers[0] if headers else header)
                    offsets.append(kind.end(buffer, header))
                _forget(buffer, *offsets[-2:])
            except _CutError:
                cut = True
                break
            if header.time is None and untimed is None:
                untimed = frame
            if frame < FRAMES_TO_COMPARE:
                headers.append(header)
            if frame + 1 == FRAMES_TO_COMPARE and limit is None and kind is _Binary:
                offsets.extend(_equal_frames(buffer, offsets, headers))
        if not headers:
            raise TrajectoryError("the file ends before its first frame does")
        columns = _Columns.from_names(headers[0].columns)
        return cls(path, kind, headers[0], columns, offsets, cut, untimed)

    def _read_first(self, file: BinaryIO) -> None:
        header, table = self._parse(file, 0)
        if "id" in self.columns.scalars:
            ids = np.sort(table[:, self.columns.scalars["id"]])
            with _located(f"{self.path}: frame 0"):
                if not np.all((np.abs(ids) < MAX_ID) & (ids == np.floor(ids))):
                    raise TrajectoryError("damaged: an id that is not an integer")
                twice = ids[1:][np.diff(ids) == 0]
                if len(twice):
                    raise TrajectoryError(f"id {int(twice[0])} occurs more than once")
            self.ids = ids.astype(np.int64)
            self.ids.flags.writeable = False
        self.unread = header, self._sorted(0, table)

    def header(self, file: BinaryIO, frame: int) -> _Header:
        """The header of a frame; its ``body`` offset is counted from the frame's start."""
        size = self.offsets[frame + 1] - self.offsets[frame]
        with _located(f"{self.path}: frame {frame}"):
            return self.format.header(self._bytes(file, frame, min(size, 16 * MAX_LINE)), 0)

    def read(self, file: BinaryIO, frame: int) -> tuple[_Header, dict[str, np.ndarray]]:
        """The header of a frame and its quantities, sorted by id."""
        if frame == 0 and self.unread is not None:
            (header, table), self.unread = self.unread, None
        else:
            header, table = self._parse(file, frame)
            table = self._sorted(frame, table)
        data = self.constants | self.columns.split(table, header.box)
        return header, data if self.ids is None else data | {"id": self.ids}

    def _sorted(self, frame: int, table: np.ndarray) -> np.ndarray:
        if self.ids is None:
            return table
        place = self.columns.scalars["id"]
        if np.array_equal(table[:, place], self.ids):
            return table
        table = table[np.argsort(table[:, place], kind="stable")]
        if not np.array_equal(table[:, place], self.ids):
            raise TrajectoryError(
                f"{self.path}: frame {frame}: the ids of the atoms are not those of frame 0"
            )
        return table

    def _parse(self, file: BinaryIO, frame: int) -> tuple[_Header, np.ndarray]:
        with _located(f"{self.path}: frame {frame}"):
            raw = self._bytes(file, frame, self.offsets[frame + 1] - self.offsets[frame])
            header = self.format.header(raw, 0)
            _check_same(header, self.first)
            return header, self.format.table(raw, header, self.columns)

    def _bytes(self, file: BinaryIO, frame: int, size: int) -> bytes:
        file.seek(self.offsets[frame])
        raw = file.read(size)
        if len(raw) < size:
            raise TrajectoryError("the file has become shorter since it was opened")
        return raw


def _forget(buffer: mmap.mmap, start: int, end: int) -> None:
    """Give back the memory of a part of a file that has been looked through.

    It could be taken away at any time, but until then counts as memory of the process.
    """
    if hasattr(mmap, "MADV_DONTNEED"):
        page = start - start % mmap.PAGESIZE
        buffer.madvise(mmap.MADV_DONTNEED, page, end - page)


def _constants_beside(dump: _Dump) -> dict[str, np.ndarray]:
    """What a file of constants beside a dump says of its atoms where the dump itself does not."""
    beside = Path(dump.path).with_name(BINARY_CONSTANTS)
    missing = set(CONSTANT_COLUMNS.split()) - dump.columns.scalars.keys()
    if not missing or dump.ids is None or not beside.is_file():
        return {}
    source = _Dump.scan(str(beside), limit=1)
    with _open(source.path) as file:
        _, data = source.read(file, 0)
    ids = np.arange(0) if source.ids is None else source.ids
    place = np.searchsorted(ids, dump.ids)
    if not np.array_equal(ids[place[place < len(ids)]], dump.ids):
        warnings.warn(f"{beside}: does not know all atoms of {dump.path}, not used", stacklevel=6)
        return {}
    constants = {name: data[name][place] for name in missing & data.keys()}
    for values in constants.values():
        values.flags.writeable = False
    return constants


def _equal_frames(buffer: Buffer, offsets: Sequence[int], headers: Sequence[_Header]) -> range:
    """The ends of the other frames of a binary dump, where all are as long as the last one read.

    They are if the rest of the file is a whole number of frames, the last of these is one of the
    same kind, and their number is what the steps of the first and the last say it is. Else none.
    """
    before, known = headers[-2:]
    start, end = offsets[-2:]
    count, rest = divmod(len(buffer) - end, end - start)
    if rest or not count:
        return range(0)
    try:
        last = _Binary.header(buffer, len(buffer) - (end - start))
        whole = _Binary.end(buffer, last) == len(buffer)
    except (_CutError, TrajectoryError):
        return range(0)
    alike = last.columns == known.columns and last.n_atoms == known.n_atoms
    timed = (last.time is None) == (known.time is None)
    evenly = last.step - known.step == count * (known.step - before.step)
    if not (whole and alike and timed and evenly):
        return range(0)
    return range(2 * end - start, len(buffer) + 1, end - start)


def _check_same(header: _Header, first: _Header) -> None:
    if not header.columns:
        raise TrajectoryError("damaged header: no columns")
    if abs(header.step) > MAX_STEP:
        raise TrajectoryError("damaged header: a time step beyond what LAMMPS can count")
    if header.n_atoms <= 0:
        raise TrajectoryError(f"{header.n_atoms} atoms")
    if header.time is not None and not np.isfinite(header.time):
        raise TrajectoryError(f"damaged header: {header.time} is no time")
    if None not in (header.time, first.time) and header.time < first.time:
        raise TrajectoryError(
            f"damaged header: a time of {header.time:g} s is before that of frame 0, "
            f"{first.time:g} s"
        )
    if header.n_atoms != first.n_atoms:
        raise TrajectoryError(
            f"{header.n_atoms} atoms, but {first.n_atoms} in frame 0; "
            "a trajectory needs the same atoms in every frame"
        )
    if header.columns != first.columns:
        raise TrajectoryError(
            f"columns {' '.join(header.columns)!r}, but {' '.join(first.columns)!r} in frame 0"
        )


@contextmanager
def _located(place: str) -> Iterator[None]:
    """Put the place before the message of an error, and make an unreadable file one of ours."""
    try:
        yield
    except TrajectoryError as error:
        raise TrajectoryError(f"{place}: {error}") from None
    except OSError as error:
        raise TrajectoryError(f"{place}: cannot be read: {error.strerror or error}") from error


def _open(path: str) -> BinaryIO:
    with _located(path):
        return open(path, "rb", opener=regular_files_only)


class BlastDumpReader(ReaderBase):
    """MDAnalysis reader of LAMMPS ``dump custom`` files, text or binary, in the units written.

    Registered as ``BLASTDUMP``. The module's docstring says what a frame holds. Any frame is one
    seek away. To open a text dump, or a binary one whose frames are not equally long, is to look
    through it once for where frames begin; of a binary dump with frames of one length and evenly
    spaced steps, four headers are read. Kept are 8 bytes a frame, the ids, and constants.

    Parameters
    ----------
    filename : str or Path
        The dump file; whether it is text or binary is seen from its content.
    timestep : float, optional
        Length of a LAMMPS step in s, for a dump without times.

    Raises
    ------
    TrajectoryError
        The file is missing, empty, damaged, not a dump, has no positions or no times, or the atoms
        or columns change from frame to frame. A last frame that was cut off is only a warning.

    """

    format = FORMATS

    @store_init_arguments
    def __init__(self, filename: str | Path, timestep: float | None = None, **kwargs: Any) -> None:
        super().__init__(filename, **kwargs)
        self._timestep = _checked_timestep(timestep)
        self._dump = _Dump.open(self.filename)
        self.n_atoms: int = self._dump.first.n_atoms
        self.n_frames: int = self._dump.n_frames
        self._check_times()
        self._warn()
        self._file = _open(self.filename)
        self._ts_kwargs.setdefault("dt", self._spacing())
        self._reopen()
        self._read_next_timestep()

    @classmethod
    def parse_n_atoms(cls, filename: str | Path, **kwargs: Any) -> int:
        """Number of atoms in the dump's first frame."""
        return _Dump.open(str(filename), limit=1).first.n_atoms

    def close(self) -> None:
        """Close the file; reading on opens it again."""
        file = self.__dict__.pop("_file", None)
        if file is not None:
            file.close()

    def _reopen(self) -> None:
        self.close()
        self._file = _open(self.filename)
        self.ts = Timestep(
            self.n_atoms,
            velocities="velocity" in self._dump.columns.vectors,
            forces="force" in self._dump.columns.vectors,
            **self._ts_kwargs,
        )
        self.ts.frame = -1

    def _read_next_timestep(self, ts: Timestep | None = None) -> Timestep:
        frame = self.ts.frame + 1
        if frame >= self.n_frames:
            raise EOFError
        return self._read_frame(frame)

    def _read_frame(self, frame: int) -> Timestep:
        if not hasattr(self, "_file"):
            self._file = _open(self.filename)
        ts = self.ts
        # A diverged run may hold numbers that float32 cannot; they become inf, which is no error.
        with np.errstate(all="ignore"):
            header, data = self._dump.read(self._file, frame)
            ts.data.update(data)
            ts.positions = ts.data["position"]
            if "velocity" in ts.data:
                ts.velocities = ts.data["velocity"]
            if "force" in ts.data:
                ts.forces = ts.data["force"]
            ts.dimensions = np.append(header.box[:, 1] - header.box[:, 0], [90.0, 90.0, 90.0])
        ts.data |= {"box": header.box, "step": header.step, "time": self._time(header, frame)}
        ts.frame = frame
        return ts

    def _time(self, header: _Header, frame: int) -> float:
        if header.time is not None:
            return header.time
        if self._timestep is None:
            raise self._no_time(frame)
        return header.step * self._timestep

    def _spacing(self) -> float:
        if self.n_frames < 2:
            return 0.0
        start, stop = (self._time(self._dump.header(self._file, i), i) for i in (0, 1))
        return stop - start

    def _check_times(self) -> None:
        if self._timestep is None and self._dump.untimed is not None:
            raise self._no_time(self._dump.untimed)

    def _no_time(self, frame: int) -> TrajectoryError:
        return TrajectoryError(
            f"{self.filename}: frame {frame} has no time; give the length of a step in seconds, as"
            " `--timestep 1e-4` or open_universe(path, timestep=1e-4), or write dumps with"
            " 'dump_modify ... time yes'"
        )

    def _warn(self) -> None:
        name, units = self.filename, self._dump.first.units
        if self._dump.cut:
            warnings.warn(
                f"{name}: the last frame was cut off and is left out; {self.n_frames} remain",
                stacklevel=4,
            )
        if units not in ("", "si"):
            warnings.warn(
                f"{name}: written in LAMMPS units {units!r}; numbers are passed on as they are",
                stacklevel=4,
            )
        if self._dump.ids is None:
            warnings.warn(
                f"{name}: no id column; atoms are taken in the order written", stacklevel=4
            )

    def __getstate__(self) -> dict[str, Any]:
        return {key: value for key, value in self.__dict__.items() if key != "_file"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__ = state
        self._file = _open(self.filename)


def _checked_timestep(timestep: float | None) -> float | None:
    if timestep is not None and not 0.0 < timestep < np.inf:
        raise TrajectoryError(f"timestep must be a positive number of seconds, not {timestep}")
    return timestep


class BlastDumpParser(TopologyReaderBase):
    """MDAnalysis topology of a LAMMPS dump: ids, types, masses, radii, charges of its first frame.

    All atoms are in one residue and one segment. Attributes without a column are left out.
    """

    format = FORMATS

    def parse(self, **kwargs: Any) -> Topology:
        """Return the Topology; raises TrajectoryError as :class:`BlastDumpReader` does."""
        dump = _Dump.open(str(self.filename), limit=1)
        with _open(dump.path) as file:
            _, data = dump.read(file, 0)
        return _topology(dump.first.n_atoms, data)


def _topology(n_atoms: int, data: dict[str, Any]) -> Topology:
    """The topology of atoms with the quantities `data` of their first frame."""
    ids = data.get("id", np.arange(1, n_atoms + 1))
    attrs = [
        topologyattrs.Atomids(ids.copy()),
        topologyattrs.Resids(np.array([1])),
        topologyattrs.Resnums(np.array([1])),
        topologyattrs.Segids(np.array(["SYSTEM"], dtype=object)),
    ]
    if "type" in data:
        kinds, kind = np.unique(data["type"], return_inverse=True)
        names = np.array([f"{t:g}" for t in kinds], dtype=object)
        attrs.append(topologyattrs.Atomtypes(names[kind]))
    for name, attr in (
        ("mass", topologyattrs.Masses),
        ("radius", topologyattrs.Radii),
        ("q", topologyattrs.Charges),
    ):
        if name in data:
            attrs.append(attr(data[name].copy()))
    return Topology(n_atoms, 1, 1, attrs=attrs)
