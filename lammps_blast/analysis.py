"""Envelopes, speeds and energies of a cloud, as MDAnalysis analyses.

Each class is an :class:`MDAnalysis.analysis.base.AnalysisBase` and works on any Universe that
:func:`lammps_blast.trajectory.open_universe` opens. They take one frame at a time, so memory does
not grow with the length of a trajectory, except for a few numbers a frame. What the first frame
says, they read by themselves, or take from a :class:`Cloud` that has been read for all of them.
"""

from __future__ import annotations

import csv
import warnings
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from MDAnalysis import Universe
from MDAnalysis.analysis.base import AnalysisBase
from MDAnalysis.coordinates.timestep import Timestep

from lammps_blast import theory
from lammps_blast.case import Case
from lammps_blast.deck import BINARY_CONSTANTS, ENERGY_ACCOUNTS
from lammps_blast.input_files import lines_of_numbers, regular_files_only
from lammps_blast.spheroid import EQUAL_TOLERANCE, SpheroidTheory, spheroid_theory

# Particles on the theoretical envelope are not outside it because of rounding.
ENVELOPE_TOLERANCE = 1e-9
# Particles that an envelope is fitted to at a time: three vectors of each fit into the cache.
BLOCK = 8192
# What an envelope is measured by, each a length against time.
ENVELOPE_LENGTHS = (
    "semi_axis_parallel",
    "semi_axis_perpendicular",
    "fit_residual",
    "fit_residual_rms",
    "extent_parallel",
    "extent_perpendicular",
    "blast_radius",
)


class AnalysisError(ValueError):
    """A trajectory that lacks what an analysis needs; the message is one line that says what."""


@dataclass(frozen=True)
class Cloud:
    """What the first frame of a trajectory says of a cloud; N particles, SI units.

    Attributes
    ----------
    mass : (N,)
        A dump without masses gives each particle the same, of one kilogram, with a warning.
    radius, charge : (N,) or None
    ids : (N,) or None
    position : (N, 3)
    velocity : (N, 3) or None
    time : float
    has_mass : bool
        Whether the dump has masses.
    """

    mass: np.ndarray
    radius: np.ndarray | None
    charge: np.ndarray | None
    ids: np.ndarray | None
    position: np.ndarray
    velocity: np.ndarray | None
    time: float
    has_mass: bool

    @classmethod
    def of(cls, universe: Universe) -> Cloud:
        """Read the first frame of a Universe."""
        return cls.of_frame(universe.trajectory[0])

    @classmethod
    def of_frame(cls, ts: Timestep) -> Cloud:
        """Take a frame that has been read."""
        first = ts.data
        if "mass" not in first:
            warnings.warn(
                "the dump has no column `mass`: each particle counts as 1 kg. A binary trajectory"
                f" has its masses in {BINARY_CONSTANTS}, which must lie beside it.",
                stacklevel=3,
            )
        return cls(
            mass=first.get("mass", np.ones(len(first["position"]))),
            radius=first.get("radius"),
            charge=first.get("q"),
            ids=first.get("id"),
            position=first["position"],
            velocity=first.get("velocity"),
            time=float(first["time"]),
            has_mass="mass" in first,
        )

    @property
    def turning_sense(self) -> np.ndarray:
        """Return +1 or -1 for each particle (N,): opposite charges turn in opposite senses."""
        if self.charge is None:
            return np.ones(len(self.mass))
        return np.where(self.charge < 0.0, -1.0, 1.0)

    @property
    def launch_speed(self) -> float | None:
        """Return the speed that all particles share (m/s); None if they do not.

        The trajectory is asked, not the case: a deck may have been run with another energy.
        """
        if self.velocity is None:
            return None
        speeds = np.linalg.norm(self.velocity, axis=1)
        return float(speeds.mean()) if np.ptp(speeds) <= EQUAL_TOLERANCE * speeds.max() else None


def expected_spheroid(case: Case, cloud: Cloud) -> SpheroidTheory | str:
    """Return the spheroid theorem for a cloud, or the reason why it does not hold.

    The first frame must be the state right after the pulse.
    """
    has = {
        "velocity": cloud.velocity is not None,
        "mass": cloud.has_mass,
        "radius": cloud.radius is not None,
        "q": cloud.charge is not None,
    }
    if missing := [name for name in sorted(has) if not has[name]]:
        return f"the dump lacks {', '.join(missing)}"
    if case.blast is None:
        return "the case has no blast"
    if cloud.time != 0.0:
        return "the trajectory does not begin with the pulse, at time 0"
    return spheroid_theory(
        case,
        radius=cloud.radius,
        mass=cloud.mass,
        charge_per_mass=cloud.charge / cloud.mass,
        speed=cloud.launch_speed,
    )


class Envelope(AnalysisBase):
    """The blast envelope: a spheroid about the direction of B, measured three ways.

    Parameters
    ----------
    universe
        Its first frame is the state right after the pulse.
    axis
        Direction of B, shape (3,), any length.
    expected
        The theorem's prediction, to count the particles outside it.
    cloud
        The first frame, where it has been read already.

    Attributes
    ----------
    results.times : (T,) s
    results.centre : (T, 3) m
        Centre of the spheroid: the launch centre, moved as the cloud as a whole was moved.
    results.semi_axis_parallel, results.semi_axis_perpendicular : (T,) m
        Of the spheroid that the sphere of launch points has become: least-squares fit of one linear
        map of the launch directions, the same for all particles, to their displacements.
    results.fit_residual, results.fit_residual_rms : (T,) m
        Largest and root-mean-square distance between a particle and where that map puts it.
    results.extent_parallel, results.extent_perpendicular : (T,) m
        Of the outermost particle centres along and across B.
    results.blast_radius : (T,) m
        Distance of the outermost particle centre.
    results.fraction_outside : (T,) or None
        Share of particle centres outside the expected spheroid.
    results.launch_radius : float, m
        Radius of the smallest sphere about the launch centre that holds all particle centres.

    Raises
    ------
    AnalysisError
        If `axis` has no direction.
    """

    def __init__(
        self,
        universe: Universe,
        axis: Sequence[float],
        expected: SpheroidTheory | None = None,
        cloud: Cloud | None = None,
    ) -> None:
        super().__init__(universe.trajectory)
        self._frame_axes = _frame_about(axis)
        self._expected = expected
        self._cloud = cloud or Cloud.of(universe)

    @property
    def axis(self) -> np.ndarray:
        """Unit vector along B, shape (3,)."""
        return self._frame_axes[2]

    def _prepare(self) -> None:
        cloud = self._cloud
        self._launch_centre = theory.centre_of_mass(cloud.position, cloud.mass)
        self._map = _LaunchMap(cloud, self._launch_centre, self._frame_axes)
        self.results.launch_radius = self._map.launch_radius
        frames = self.n_frames
        for name in ENVELOPE_LENGTHS:
            self.results[name] = np.full(frames, np.nan)
        self.results.centre = np.full((frames, 3), np.nan)
        self.results.fraction_outside = np.zeros(frames) if self._expected else None

    def _single_frame(self) -> None:
        frame, results = self._frame_index, self.results
        fit = self._map.fit(self._ts.data["position"])
        expected = None
        if self._expected:
            expected = self._expected.semi_axes(results.launch_radius, np.array(self._ts.time))
        extent = self._map.extent(fit, expected)

        results.centre[frame] = self._launch_centre + fit.mean_shift @ self._frame_axes
        parallel, perpendicular = theory.spheroid_semi_axes(
            results.launch_radius, fit.parallel, fit.perpendicular
        )
        results.semi_axis_parallel[frame] = parallel
        results.semi_axis_perpendicular[frame] = perpendicular
        results.fit_residual[frame] = extent.largest_residual
        results.fit_residual_rms[frame] = extent.rms_residual
        results.extent_parallel[frame] = extent.parallel
        results.extent_perpendicular[frame] = extent.perpendicular
        results.blast_radius[frame] = extent.radius
        if self._expected:
            results.fraction_outside[frame] = extent.fraction_outside

    def _conclude(self) -> None:
        self.results.times = self.times


@dataclass(frozen=True)
class _Fit:
    """A linear map of launch directions to displacements, about the axis.

    Attributes
    ----------
    parallel, perpendicular
        The map along and, as a complex number, across the axis, m; NaN where directions leave it
        open, as those of a ring or a line do.
    matrix : (3, 3)
        The same, with zero in place of NaN; directions are rows.
    mean : (2, 3)
        Mean displacement of the particles of each sense of turning, m.
    shift : (2, 3)
        What the particles of each sense are displaced by beside the map, m.
    mean_shift : (3,)
        That of the cloud, weighted by mass, not mirrored.
    """

    parallel: float
    perpendicular: complex
    matrix: np.ndarray
    mean: np.ndarray
    shift: np.ndarray
    mean_shift: np.ndarray


@dataclass(frozen=True)
class _Extent:
    """How far particles are from where a fit puts them, and from the centre of the cloud; m."""

    largest_residual: float
    parallel: float
    perpendicular: float
    radius: float
    rms_residual: float
    fraction_outside: float


class _LaunchMap:
    """Fits displacements = shift + map(launch direction), the same map for all particles.

    Vectors stand in the frame about the axis. Those of particles with negative sense of turning are
    mirrored, by their second component, so that all turn alike; each sense has a shift of its own.
    A large cloud is worked through in blocks that stay in the processor's cache.
    """

    def __init__(self, cloud: Cloud, centre: np.ndarray, frame_axes: np.ndarray) -> None:
        count = len(cloud.mass)
        self._launch, self._frame_axes = cloud.position, frame_axes
        self._sense = cloud.turning_sense
        self._offset = self._seen(cloud.position - centre, self._sense)
        distance = np.linalg.norm(self._offset, axis=1)
        self.launch_radius = float(distance.max())
        # A particle at the centre has no launch direction of its own and leaves the fit alone.
        fitted = ~theory.on_centre_of_mass(cloud.position, cloud.mass)
        self._senses = np.stack([self._sense > 0.0, self._sense < 0.0]).astype(float)
        self._member = self._senses * fitted
        self._count = self._member.sum(axis=1)
        self._share = self._senses @ (cloud.mass / cloud.mass.sum())

        direction = self._offset / np.where(distance > 0.0, distance, 1.0)[:, None]
        self._mean_direction = self._mean(self._member @ direction)
        direction -= self._member.T @ self._mean_direction
        direction[~fitted] = 0.0
        self._direction = direction
        self._square = np.sum(direction**2, axis=0)
        self._moved = np.empty((count, 3))

    def _seen(self, vectors: np.ndarray, sense: np.ndarray) -> np.ndarray:
        seen = vectors @ self._frame_axes.T
        seen[:, 1] *= sense
        return seen

    def _mean(self, total: np.ndarray) -> np.ndarray:
        return total / np.maximum(self._count, 1.0)[:, None]

    def _blocks(self) -> Iterator[slice]:
        for start in range(0, len(self._moved), BLOCK):
            yield slice(start, start + BLOCK)

    def fit(self, position: np.ndarray) -> _Fit:
        """Fit the map to positions (N, 3) in m, by least squares."""
        total = np.zeros((2, 3))
        for block in self._blocks():
            displacement = position[block] - self._launch[block]
            self._moved[block] = self._seen(displacement, self._sense[block])
            total += self._member[:, block] @ self._moved[block]
        mean = self._mean(total)
        # Directions as columns, displacements about their means as rows.
        moment = np.zeros((3, 3))
        for block in self._blocks():
            about_mean = self._moved[block] - self._member[:, block].T @ mean
            moment += self._direction[block].T @ about_mean
        parallel = self._slope(moment[2, 2], self._square[2])
        perpendicular = self._slope(
            complex(moment[0, 0] + moment[1, 1], moment[0, 1] - moment[1, 0]),
            self._square[0] + self._square[1],
        )
        along, turned = np.nan_to_num(parallel).real, np.nan_to_num(perpendicular)
        matrix = np.array(
            [
                [turned.real, turned.imag, 0.0],
                [-turned.imag, turned.real, 0.0],
                [0.0, 0.0, along],
            ]
        )
        shift = np.zeros((2, 3))
        if np.isfinite(parallel) or np.isfinite(perpendicular):
            shift = (mean - self._mean_direction @ matrix) * (self._count > 0.0)[:, None]
        mean_shift = self._share @ (shift * [[1.0, 1.0, 1.0], [1.0, -1.0, 1.0]])
        return _Fit(float(parallel.real), complex(perpendicular), matrix, mean, shift, mean_shift)

    def _slope(self, product: complex, square: float) -> complex:
        """Return the least-squares slope of a line through the origin, NaN where there is none.

        Directions are parts of unit vectors; those of rounding size count as none.
        """
        enough = square > 1e-18 * self._count.sum()
        return complex(product) / square if enough else complex(np.nan)

    def extent(self, fit: _Fit, expected: tuple[float, float] | None) -> _Extent:
        """Measure the positions of the last fit, and count those beyond expected semi-axes (m)."""
        largest = np.zeros(4)  # squares
        squares, outside = 0.0, 0
        for block in self._blocks():
            moved, member = self._moved[block], self._member[:, block].T
            residual = moved - member @ fit.mean - self._direction[block] @ fit.matrix
            square = np.einsum("ij,ij->i", residual, residual) * member.sum(axis=1)
            about_centre = self._offset[block] + moved - self._senses[:, block].T @ fit.shift
            along = about_centre[:, 2] ** 2
            across = np.einsum("ij,ij->i", about_centre[:, :2], about_centre[:, :2])
            lengths = square, along, across, along + across
            largest = np.maximum(largest, [length.max() for length in lengths])
            squares += square.sum()
            if expected is not None:
                a, b = expected
                limit = (a * b * (1.0 + ENVELOPE_TOLERANCE)) ** 2
                outside += np.count_nonzero(along * b**2 + across * a**2 > limit)
        return _Extent(
            *map(float, np.sqrt(largest)),
            float(np.sqrt(squares / max(self._count.sum(), 1.0))),
            outside / len(self._moved),
        )


def _frame_about(axis: Sequence[float]) -> np.ndarray:
    """Return a right-handed orthonormal frame, one vector a row, the third one along `axis`."""
    direction = np.asarray(axis, dtype=float)
    largest = np.abs(direction).max(initial=0.0)
    if direction.shape != (3,) or not 0.0 < largest < np.inf:
        given = " ".join(map(str, direction.tolist()))
        raise AnalysisError(f"the axis of an envelope must be a direction, not {given}")
    third = direction / largest / np.linalg.norm(direction / largest)
    first = np.cross(np.eye(3)[np.argmin(np.abs(third))], third)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third])


class Speeds(AnalysisBase):
    """Speeds of a cloud, and the velocities of a few of its particles, against time.

    Parameters
    ----------
    universe
        With velocities.
    tracked
        Indices of the particles whose velocities are kept.
    cloud
        The first frame, where it has been read already.

    Attributes
    ----------
    results.times : (T,) s
    results.mean, results.rms, results.smallest, results.largest : (T,) m/s
    results.mean_velocity : (T, 3) m/s, of the centre of mass
    results.tracked_velocity : (T, len(tracked), 3) m/s

    Raises
    ------
    AnalysisError
        If the dump has no velocities.
    """

    def __init__(
        self, universe: Universe, tracked: Sequence[int] = (), cloud: Cloud | None = None
    ) -> None:
        super().__init__(universe.trajectory)
        self._cloud = _moving(cloud or Cloud.of(universe))
        self._tracked = list(tracked)

    def _prepare(self) -> None:
        mass = self._cloud.mass
        self._weights = mass / mass.sum()
        for name in ("mean", "rms", "smallest", "largest"):
            self.results[name] = np.zeros(self.n_frames)
        self.results.mean_velocity = np.zeros((self.n_frames, 3))
        self.results.tracked_velocity = np.zeros((self.n_frames, len(self._tracked), 3))

    def _single_frame(self) -> None:
        frame, results = self._frame_index, self.results
        velocity = self._ts.data["velocity"]
        speed = np.linalg.norm(velocity, axis=1)
        results.mean[frame] = speed.mean()
        results.rms[frame] = np.sqrt(np.mean(speed**2))
        results.smallest[frame], results.largest[frame] = speed.min(), speed.max()
        results.mean_velocity[frame] = self._weights @ velocity
        results.tracked_velocity[frame] = velocity[self._tracked]

    def _conclude(self) -> None:
        self.results.times = self.times


class KineticEnergy(AnalysisBase):
    """Kinetic energy of translation and rotation against time, from the trajectory alone.

    Parameters
    ----------
    universe
        With velocities.
    cloud
        The first frame, where it has been read already.

    Attributes
    ----------
    results.times : (T,) s
    results.kinetic, results.rotational : (T,) J
        Rotational energy is that of homogeneous spheres, zero without angular velocities.

    Raises
    ------
    AnalysisError
        If the dump has no velocities.
    """

    def __init__(self, universe: Universe, cloud: Cloud | None = None) -> None:
        super().__init__(universe.trajectory)
        self._cloud = _moving(cloud or Cloud.of(universe))

    def _prepare(self) -> None:
        mass, radius = self._cloud.mass, self._cloud.radius
        self._inertia = None if radius is None else theory.moment_of_inertia(mass, radius)
        self.results.kinetic = np.zeros(self.n_frames)
        self.results.rotational = np.zeros(self.n_frames)

    def _single_frame(self) -> None:
        frame, data = self._frame_index, self._ts.data
        self.results.kinetic[frame] = _half_square(self._cloud.mass, data["velocity"])
        spin = data.get("angular_velocity")
        if spin is not None and self._inertia is not None:
            self.results.rotational[frame] = _half_square(self._inertia, spin)

    def _conclude(self) -> None:
        self.results.times = self.times


def _moving(cloud: Cloud) -> Cloud:
    """Return a cloud that has velocities; AnalysisError if it has none."""
    if cloud.velocity is None:
        raise AnalysisError("the dump has no velocities (columns `vx vy vz`)")
    return cloud


def _half_square(weight: np.ndarray, vectors: np.ndarray) -> float:
    return float(0.5 * np.einsum("i,ij,ij->", weight, vectors, vectors))


class FrameSteps(AnalysisBase):
    """Numbers of LAMMPS's time steps at which frames were written: `results.steps` (T,)."""

    def __init__(self, universe: Universe) -> None:
        super().__init__(universe.trajectory)

    def _prepare(self) -> None:
        self.results.steps = np.zeros(self.n_frames, dtype=np.int64)

    def _single_frame(self) -> None:
        self.results.steps[self._frame_index] = self._ts.data["step"]


class Together(AnalysisBase):
    """Runs several analyses of this module in one pass over a trajectory."""

    def __init__(self, *analyses: AnalysisBase) -> None:
        super().__init__(analyses[0]._trajectory)
        self._analyses = analyses

    def _prepare(self) -> None:
        for analysis in self._analyses:
            analysis.n_frames, analysis.start, analysis.stop = self.n_frames, self.start, self.stop
            analysis.frames, analysis.times = self.frames, self.times
            analysis._prepare()

    def _single_frame(self) -> None:
        ts: Timestep = self._ts
        for analysis in self._analyses:
            analysis._frame_index, analysis._ts = self._frame_index, ts
            analysis._single_frame()

    def _conclude(self) -> None:
        for analysis in self._analyses:
            analysis._conclude()


@dataclass(frozen=True)
class EnergyLedger:
    """The energy ledger of a run (`energy.csv`), each account an array of shape (T,) in joules.

    Works and losses are cumulative since the pulse. Physics has no magnetic work; what stands in
    that column is an error of the time integration. Stock contact laws keep no potential and no
    channels: all that their forces took is in `contact_loss`, what springs hold included.
    """

    times: np.ndarray
    kinetic: np.ndarray
    rotational: np.ndarray
    contact_energy: np.ndarray
    bond_energy: np.ndarray
    near_field_energy: np.ndarray
    electric_work: np.ndarray
    drag_loss: np.ndarray
    magnetic_work: np.ndarray
    contact_loss: np.ndarray
    friction_loss: np.ndarray
    bond_friction_loss: np.ndarray
    bond_formation_loss: np.ndarray

    @property
    def launch_energy(self) -> float:
        """Kinetic energy right after the pulse, J."""
        return float(self.kinetic[0] + self.rotational[0])

    @property
    def potential(self) -> np.ndarray:
        """Energy held by contacts, bonds and the near field (T,), J."""
        return self.contact_energy + self.bond_energy + self.near_field_energy

    @property
    def interaction_loss(self) -> np.ndarray:
        """Energy lost between particles (T,), J."""
        lost = self.contact_loss + self.friction_loss
        return lost + self.bond_friction_loss + self.bond_formation_loss

    @property
    def turnover(self) -> float:
        """Largest amount of energy in any account, J: what an error of the ledger is a part of."""
        accounts = (
            self.kinetic,
            self.rotational,
            self.electric_work,
            self.drag_loss,
            self.potential - self.potential[0],
            self.interaction_loss,
        )
        return float(max(np.abs(account).max() for account in accounts))

    @property
    def residual(self) -> np.ndarray:
        """What the other accounts leave of the energy at launch (T,), J; zero if all is right."""
        present = self.kinetic + self.rotational + self.potential
        gained = self.electric_work - self.drag_loss - self.interaction_loss
        return self.launch_energy + self.potential[0] + gained - present

    @classmethod
    def read(cls, path: Path) -> EnergyLedger:
        """Read `energy.csv`; columns behind those of the ledger are left to others.

        Raises
        ------
        AnalysisError
            If the file is missing or is not such a table.

        Warns
        -----
        UserWarning
            If the last line was cut short.
        """
        names, table = read_table(path, "an energy table")
        own = ("time", *ENERGY_ACCOUNTS)
        if names[: len(own)] != own:
            raise AnalysisError(f"{path}: not an energy table of this version")
        ledger = cls(*table.T[: len(own)])
        if not (np.isfinite(ledger.times) & (ledger.times >= 0.0)).all():
            raise AnalysisError(f"{path}: damaged: a time that is negative or no number")
        return ledger


def read_table(path: Path, what: str) -> tuple[tuple[str, ...], np.ndarray]:
    """Read a table of numbers that a deck left behind: names of columns, and rows (T, columns).

    Parameters
    ----------
    what
        What the file should be, for messages.

    Raises
    ------
    AnalysisError
        If the file is missing, has no rows, or is not a table of numbers.

    Warns
    -----
    UserWarning
        If the last line was cut short, as when a run was killed; it is left out.
    """
    try:
        with open(path, encoding="ascii", opener=regular_files_only) as file:
            names, values, cut = _read_rows(lines_of_numbers(file))
    except OSError as error:
        raise AnalysisError(f"{path}: not {what} ({error.strerror})") from error
    except (ValueError, csv.Error) as error:
        raise AnalysisError(f"{path}: not {what} ({error})") from error
    if cut:
        warnings.warn(f"{path}: the last line was cut short and is left out", stacklevel=3)
    if not values:
        raise AnalysisError(f"{path}: not {what} (it has no rows)")
    return names, np.frombuffer(values).reshape(-1, len(names))


def _read_rows(lines: Iterator[str]) -> tuple[tuple[str, ...], array, bool]:
    """Return names, the numbers of all rows on end, and whether the last line has no end."""
    names: tuple[str, ...] = ()
    values = array("d")
    for number, line in enumerate(lines, start=1):
        if not line.endswith("\n"):
            return names, values, True
        row = next(csv.reader([line], strict=True), [])
        if number == 1:
            names = tuple(row)
        elif len(row) != len(names):
            raise ValueError(f"line {number} has {len(row)} values for {len(names)} columns")
        else:
            values.extend(map(float, row))
    return names, values, False
