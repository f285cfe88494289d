"""What a restart file says of itself: lines of notes behind all that LAMMPS wrote, and a seal.

The command `blast_write_restart` of the plugin writes them and `blast_read_restart` goes by them.
"""

from __future__ import annotations

import re
import zlib
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from lammps_blast.input_files import regular_files_only

_SEAL = re.compile(
    rb"sealed by lammps-blast: ([0-9a-f]{16}) ([0-9a-f]{8})\nLammpS RestartT\0\Z", re.S
)
_SEAL_BYTES = 24 + 16 + 1 + 8 + 1 + 16
_BUFFER_BYTES = 2**20


@dataclass(frozen=True)
class RestartNotes:
    """The notes of one restart file.

    Attributes
    ----------
    file
        The restart file.
    step
        Step of LAMMPS that it was written at.
    timestep
        Length of a step of LAMMPS, s.
    outputs
        How many bytes each file held that the run adds to, by name, relative to the run folder.
    """

    file: Path
    step: int
    timestep: float
    outputs: dict[str, int]

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.step * self.timestep

    def fits_outputs(self, folder: Path) -> bool:
        """Tell whether a run folder still has all that the files held then."""
        return all(
            max(_size(folder / name), _size(folder / f"{name}.kept")) >= size
            for name, size in self.outputs.items()
        )

    def is_outgrown(self, folder: Path) -> bool:
        """Tell whether a file of the run folder has grown since, or was put aside to grow."""
        return any(
            _size(folder / name) > size or (folder / f"{name}.kept").exists()
            for name, size in self.outputs.items()
        )


def newest_restart(folder: Path, names: Iterable[str]) -> RestartNotes | None:
    """Return the notes of the newest restart file to go on from, as :func:`look_at_restarts`."""
    return look_at_restarts(folder, names)[0]


def look_at_restarts(folder: Path, names: Iterable[str]) -> tuple[RestartNotes | None, list[str]]:
    """Return the notes of the newest restart file to go on from, and why others that exist are not.

    Parameters
    ----------
    folder
        The run folder.
    names
        Restart files, relative to it.
    """
    usable, reasons = [], []
    for name in names:
        notes = read_restart_notes(folder / name)
        if notes is None:
            if (folder / name).exists():
                reasons.append(f"{folder / name} is damaged, or not whole")
        elif notes.fits_outputs(folder):
            usable.append(notes)
        else:
            reasons.append(f"{folder / name} goes with longer output files than there are")
    return max(usable, key=lambda notes: notes.step, default=None), reasons


def read_restart_notes(file: Path) -> RestartNotes | None:
    """Return the notes of a restart file; None if there is none, or it is not what was sealed."""
    try:
        with open(file, "rb", opener=regular_files_only) as stream:
            return _notes(file, stream)
    except (OSError, OverflowError, ValueError, KeyError, IndexError):
        return None


def _notes(file: Path, stream: BinaryIO) -> RestartNotes | None:
    position = file.stat().st_size - _SEAL_BYTES
    if position < 0:
        return None
    stream.seek(position)
    seal = _SEAL.match(stream.read(_SEAL_BYTES))
    if seal is None or _checksum(stream, position) != int(seal[2], 16):
        return None
    begin = int(seal[1], 16)
    stream.seek(begin)
    text = stream.read(position - begin).decode("utf-8", errors="replace")
    if not text.startswith("\nstep "):
        return None
    lines = text.splitlines()
    pairs = [line.split(" ", 1) for line in lines if " " in line]
    values = dict(reversed(pairs))
    outputs = [words.split(" ", 1) for keyword, words in pairs if keyword == "output"]
    return RestartNotes(
        file=file,
        step=int(values["step"]),
        timestep=float(values["clock"].split()[2]),
        outputs={name: int(size) for size, name in outputs},
    )


def _size(file: Path) -> int:
    """Return the size of a file, bytes; that of none is below zero."""
    return file.stat().st_size if file.is_file() else -1


def _checksum(stream: BinaryIO, count: int) -> int:
    stream.seek(0)
    checksum = 0
    while count > 0 and (piece := stream.read(min(count, _BUFFER_BYTES))):
        checksum = zlib.crc32(piece, checksum)
        count -= len(piece)
    return checksum
