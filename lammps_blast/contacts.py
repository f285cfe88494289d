"""Which spheres touch, and with what force: contact networks from dumps of contacts or geometry.

A run with `output.contacts` leaves `contacts.lammpsdump`, a LAMMPS ``dump local`` with a row for
each pair in contact: :class:`ContactFrames` reads it frame by frame, :class:`Contacts` is the
analysis. Without that file the same analysis finds the overlapping pairs in positions and radii,
and knows strains, but no forces.

>>> from lammps_blast.contacts import ContactFrames, Contacts
>>> from lammps_blast.trajectory import open_universe
>>> universe = open_universe("runs/contact_blast")  # doctest: +SKIP
>>> recorded = ContactFrames("runs/contact_blast/contacts.lammpsdump")  # doctest: +SKIP
>>> print(Contacts(universe, recorded).run().results.coordination)  # doctest: +SKIP
"""

from __future__ import annotations

import mmap
import os
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from MDAnalysis import Universe
from MDAnalysis.analysis.base import AnalysisBase

from lammps_blast.analysis import AnalysisError, Cloud
from lammps_blast.input_files import regular_files_only
from lammps_blast.neighbours import close_pairs
from lammps_blast.trajectory import TrajectoryError

HEADER = re.compile(
    rb"(?:ITEM: UNITS\s*\n[^\n]*\n)?"
    rb"(?:ITEM: TIME\s*\n(?P<time>[^\n]*)\n)?"
    rb"ITEM: TIMESTEP\s*\n(?P<step>[^\n]*)\n"
    rb"ITEM: NUMBER OF ENTRIES\s*\n(?P<count>[^\n]*)\n"
    rb"ITEM: BOX BOUNDS[^\n]*\n(?:[^\n]*\n){3}"
    rb"ITEM: ENTRIES(?P<columns>[^\n]*)\n"
)
HEADINGS = (b"ITEM: UNITS", b"ITEM: TIME", b"ITEM: NUMBER OF ENTRIES", b"ITEM: BOX BOUNDS")
ITEM_START = b"ITEM: "
MAX_HEADER = 4096  # bytes
IDS = ("id1", "id2")
FORCES = (
    "normal_force",
    "damping_force",
    "friction_force",
    "bond_force",
    "bond_friction_force",
)

CONTACT_NUMBERS = (
    "contacts",
    "coordination",
    "largest_strain",
    "mean_normal_force",
    "largest_normal_force",
    "bonded_fraction",
)

FORCE_BINS = (5, 40)  # fewest and most


def known_radii(cloud: Cloud) -> np.ndarray:
    """Return the radii (N,) of a cloud's particles, m.

    Raises
    ------
    AnalysisError
        If the dump has none.
    """
    if cloud.radius is None:
        raise AnalysisError("the dump has no radii (column `radius` or `diameter`)")
    return cloud.radius


@dataclass(frozen=True)
class ContactFrame:
    """The rows of one frame of `contacts.lammpsdump`; C contacts, forces in N.

    Attributes
    ----------
    time
        In s; None if the dump was written without times.
    step
        Number of the time step.
    ids : (C, 2)
        Ids of the particles, as in the trajectory's column `id`.
    strain : (C,)
        Overlap over the sum of the radii (minus eq. 7.6).
    normal_force : (C,) or None
        Elastic repulsion, not negative.
    damping_force : (C,) or None
        Along the line of centres, positive where it pushes apart.
    friction_force, bond_friction_force : (C,) or None
        Magnitudes across the line of centres.
    bond_force : (C,) or None
        Attraction of an active bond, zero where there is none.
    """

    time: float | None
    step: int
    ids: np.ndarray
    strain: np.ndarray
    normal_force: np.ndarray | None = None
    damping_force: np.ndarray | None = None
    friction_force: np.ndarray | None = None
    bond_force: np.ndarray | None = None
    bond_friction_force: np.ndarray | None = None


class ContactFrames:
    """The frames of `contacts.lammpsdump`, in order, or one by its time step.

    Opening finds the frames; rows are read when a frame is asked for, so memory does not grow with
    the length of a run.

    >>> import tempfile
    >>> from pathlib import Path
    >>> path = Path(tempfile.mkdtemp()) / "contacts.lammpsdump"
    >>> _ = path.write_text('''ITEM: TIME
    ... 0.01
    ... ITEM: TIMESTEP
    ... 100
    ... ITEM: NUMBER OF ENTRIES
    ... 1
    ... ITEM: BOX BOUNDS ss ss ss
    ... -1 1
    ... -1 1
    ... -1 1
    ... ITEM: ENTRIES id1 id2 strain normal_force
    ... 17 243 0.0012 5.1
    ... ''')
    >>> for frame in ContactFrames(path):
    ...     print(frame.time, frame.ids.tolist(), frame.normal_force)
    0.01 [[17, 243]] [5.1]

    Parameters
    ----------
    path
        The file.

    Raises
    ------
    TrajectoryError
        If it cannot be read, is not a dump of contacts, or is damaged; damaged rows are found when
        their frame is read.

    Warns
    -----
    UserWarning
        If the last frame was cut off; it is left out.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self.path = Path(path)
        try:
            with open(self.path, "rb", opener=regular_files_only) as file:
                if os.fstat(file.fileno()).st_size == 0:
                    raise TrajectoryError(f"{self.path}: the file is empty")
                with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as buffer:
                    self._extents, cut = _scan(buffer, self.path)
        except OSError as error:
            raise TrajectoryError(f"{self.path}: cannot be read: {error.strerror}") from error
        if cut:
            warnings.warn(
                f"{self.path}: the last frame was cut off and is left out;"
                f" {len(self._extents)} remain",
                stacklevel=2,
            )

    def __len__(self) -> int:
        """Return the number of frames."""
        return len(self._extents)

    def __iter__(self) -> Iterator[ContactFrame]:
        """Read frame after frame."""
        return map(self.at_step, self._extents)

    @property
    def steps(self) -> list[int]:
        """Time steps of the frames, in order."""
        return list(self._extents)

    def at_step(self, step: int) -> ContactFrame | None:
        """Return the frame of a time step; None if there is none.

        Raises
        ------
        TrajectoryError
            If its rows are damaged.
        """
        if step not in self._extents:
            return None
        start, stop = self._extents[step]
        try:
            with open(self.path, "rb", opener=regular_files_only) as file:
                file.seek(start)
                raw = file.read(stop - start)
        except OSError as error:
            raise TrajectoryError(f"{self.path}: cannot be read: {error.strerror}") from error
        try:
            return _frame(raw)
        except ValueError as error:
            raise TrajectoryError(f"{self.path}: step {step}: damaged: {error}") from None


def _scan(buffer: mmap.mmap, path: Path) -> tuple[dict[int, tuple[int, int]], bool]:
    """Return where the frame of each step begins and ends, and whether the last one was cut."""
    extents: dict[int, tuple[int, int]] = {}
    start = 0
    while start < len(buffer):
        header = HEADER.match(buffer, start)
        if header is None and _is_cut_header(buffer[start : start + MAX_HEADER]):
            return extents, True
        if header is None and start == 0:
            raise TrajectoryError(f"{path}: not a LAMMPS dump of contacts")
        if header is None:
            raise TrajectoryError(f"{path}: frame {len(extents)}: damaged header")
        try:
            step, count = int(header["step"]), int(header["count"])
        except ValueError:
            raise TrajectoryError(f"{path}: frame {len(extents)}: damaged header") from None
        stop = buffer.find(b"ITEM:", header.end())
        if stop < 0:
            stop = buffer.rfind(b"\n", header.end() - 1) + 1
            if buffer[header.end() : stop].count(b"\n") < count:
                return extents, True
        extents[step] = start, stop
        start = stop
    return extents, False


def _is_cut_header(rest: bytes) -> bool:
    """Tell whether a file that ends with `rest` ends within a header."""
    headings = [line for line in rest.split(b"\n")[:-1] if line.startswith(b"ITEM:")]
    return (
        len(rest) < MAX_HEADER
        and ITEM_START.startswith(rest[: len(ITEM_START)])
        and all(heading.startswith(HEADINGS) for heading in headings)
    )


def _frame(raw: bytes) -> ContactFrame:
    """Read a frame; ValueError says what is wrong with it."""
    header = HEADER.match(raw)
    if header is None:
        raise ValueError("the file has changed since it was opened")
    columns = header["columns"].decode("ascii", "replace").split()
    if missing := [name for name in (*IDS, "strain") if name not in columns]:
        raise ValueError(f"no column {', '.join(missing)} among {' '.join(columns)!r}")
    rows = raw[header.end() :].splitlines()
    if len(rows) != int(header["count"]):
        raise ValueError(f"{int(header['count'])} contacts announced, {len(rows)} lines found")
    table = np.array([row.split() for row in rows], dtype=float).reshape(-1, len(columns))
    column = dict(zip(columns, table.T, strict=True))
    ids = np.stack([column[name] for name in IDS], axis=1)
    if not np.array_equal(ids, np.floor(ids)):
        raise ValueError("an id that is not an integer")
    return ContactFrame(
        time=None if header["time"] is None else float(header["time"]),
        step=int(header["step"]),
        ids=ids.astype(np.int64),
        strain=column["strain"],
        **{name: column.get(name) for name in FORCES},
    )


@dataclass(frozen=True)
class ContactNetwork:
    """The contacts of one frame of a trajectory; C of them, strains as in :class:`ContactFrame`.

    `frame` and `time` (s) are the trajectory's; `pairs` (C, 2) are indices of particles, not ids;
    `normal_force` (C,) in N and `bonded` (C,) are None where they are unknown.
    """

    frame: int
    time: float
    pairs: np.ndarray
    strain: np.ndarray
    normal_force: np.ndarray | None = None
    bonded: np.ndarray | None = None

    def __len__(self) -> int:
        """Return the number of contacts."""
        return len(self.pairs)


class Contacts(AnalysisBase):
    """Contacts against time, and the contact network of two frames.

    Parameters
    ----------
    universe
        With radii.
    recorded
        Contacts that the run wrote. Without them, pairs are in contact where spheres overlap;
        forces are then unknown.
    cloud
        The first frame, where it has been read already.

    Attributes
    ----------
    results.times : (T,) s
    results.contacts : (T,)
        Number of pairs in contact; NaN, as everything of that frame, where `recorded` lacks it.
    results.coordination : (T,)
        Mean number of contacts a particle.
    results.largest_strain : (T,)
        Largest overlap over the sum of the radii; zero without contacts.
    results.mean_normal_force, results.largest_normal_force : (T,) N, or None if forces are unknown
        Elastic repulsion; the mean of no contact is NaN.
    results.bonded_fraction : (T,) or None
        Share of the contacts that hold an active bond; NaN without contacts.
    results.last, results.fullest : ContactNetwork or None
        Of the last frame whose contacts are known, and of the first with most contacts.

    Raises
    ------
    AnalysisError
        If the dump has no radii and no contacts are given, or has no ids to know them by.
    """

    def __init__(
        self,
        universe: Universe,
        recorded: ContactFrames | None = None,
        cloud: Cloud | None = None,
    ) -> None:
        super().__init__(universe.trajectory)
        self.recorded = recorded
        cloud = cloud or Cloud.of(universe)
        if recorded is None:
            self._radius = known_radii(cloud)
        elif cloud.ids is None:
            raise AnalysisError("the dump has no ids (column `id`), which contacts refer to")

    def _prepare(self) -> None:
        self.results.contacts = np.full(self.n_frames, np.nan)
        self.results.coordination = np.full(self.n_frames, np.nan)
        self.results.largest_strain = np.full(self.n_frames, np.nan)
        self.results.mean_normal_force = None
        self.results.largest_normal_force = None
        self.results.bonded_fraction = None
        self.results.last = self.results.fullest = None

    def _single_frame(self) -> None:
        frame, results, network = self._frame_index, self.results, self._network()
        if network is None:
            return
        count = len(network)
        results.contacts[frame] = count
        results.coordination[frame] = 2.0 * count / len(self._ts.data["position"])
        results.largest_strain[frame] = np.max(network.strain, initial=0.0)
        if network.normal_force is not None:
            mean = network.normal_force.mean() if count else np.nan
            self._keep("mean_normal_force", mean)
            self._keep("largest_normal_force", np.max(network.normal_force, initial=0.0))
        if network.bonded is not None:
            self._keep("bonded_fraction", network.bonded.mean() if count else np.nan)
        results.last = network
        if results.fullest is None or count > len(results.fullest):
            results.fullest = network

    def _keep(self, name: str, value: float) -> None:
        """Keep a number of this frame that not every run has."""
        if self.results[name] is None:
            self.results[name] = np.full(self.n_frames, np.nan)
        self.results[name][self._frame_index] = value

    def _network(self) -> ContactNetwork | None:
        data, frame, time = self._ts.data, int(self._ts.frame), float(self._ts.time)
        if self.recorded is None:
            pairs, closeness = close_pairs(data["position"], self._radius)
            return ContactNetwork(frame, time, pairs, 1.0 - closeness)
        rows = self.recorded.at_step(int(data["step"]))
        if rows is None:
            return None
        pairs = np.searchsorted(data["id"], rows.ids)
        known = pairs < len(data["id"])
        known[known] = data["id"][pairs[known]] == rows.ids[known]
        if not known.all():
            raise TrajectoryError(
                f"{self.recorded.path}: step {rows.step}: no particle has the id"
                f" {rows.ids[~known][0]}"
            )
        bonded = None if rows.bond_force is None else rows.bond_force > 0.0
        return ContactNetwork(frame, time, pairs, rows.strain, rows.normal_force, bonded)

    def _conclude(self) -> None:
        self.results.times = self.times


def distribution_about_mean(values: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Return the probability density of values over their mean, such as forces in a packing.

    Parameters
    ----------
    values : (C,)
        Not negative.

    Returns
    -------
    edges : (K + 1,)
        Of bins of equal width, in means.
    density : (K,)
        Its integral over the bins is one.

    None without a positive mean.
    """
    mean = values.mean() if len(values) else 0.0
    if not 0.0 < mean < np.inf:
        return None
    scaled = values / mean
    bins = int(np.clip(np.sqrt(len(values)), *FORCE_BINS))
    density, edges = np.histogram(scaled, bins, range=(0.0, scaled.max()), density=True)
    return edges, density
