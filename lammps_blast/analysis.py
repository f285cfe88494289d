"""Envelopes, speeds and energies of a cloud, as MDAnalysis analyses.

Each class is an :class:`MDAnalysis.analysis.base.AnalysisBase` and works on any Universe that
:func:`lammps_blast.trajectory.open_universe` opens. They take one frame at a time, so memory does
not grow with the length of a trajectory, except for a few numbers a frame.
"""

from __future__ import annotations

import csv
import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from MDAnalysis import Universe
from MDAnalysis.analysis.base import AnalysisBase
from MDAnalysis.coordinates.timestep import Timestep

from lammps_blast import theory
from lammps_blast.case import Case
from lammps_blast.deck import ENERGY_ACCOUNTS
from lammps_blast.spheroid import EQUAL_TOLERANCE, SpheroidTheory, spheroid_theory

# Particles on the theoretical envelope are not outside it because of rounding.
ENVELOPE_TOLERANCE = 1e-9
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
    """What a trajectory says of its particles once and for all; arrays of shape (N,), SI units.

    A dump without masses gives each particle the same, of one kilogram, with a warning.
    """

    mass: np.ndarray
    radius: np.ndarray | None
    charge: np.ndarray | None

    @classmethod
    def of(cls, universe: Universe) -> Cloud:
        """Read masses, radii and charges from the first frame of a Universe."""
        first = universe.trajectory[0].data
        if "mass" not in first:
            warnings.warn(
                "the dump has no column `mass`: each particle counts as 1 kg", stacklevel=3
            )
        return cls(
            mass=first.get("mass", np.ones(universe.atoms.n_atoms)),
            radius=first.get("radius"),
            charge=first.get("q"),
        )

    @property
    def turning_sense(self) -> np.ndarray:
        """Return +1 or -1 for each particle (N,): opposite charges turn in opposite senses."""
        if self.charge is None:
            return np.ones(len(self.mass))
        return np.where(self.charge < 0.0, -1.0, 1.0)


def expected_spheroid(case: Case, universe: Universe) -> SpheroidTheory | str:
    """Return the spheroid theorem for the cloud of a Universe, or the reason why it does not hold.

    The first frame must be the state right after the pulse.
    """
    cloud = Cloud.of(universe)
    first = universe.trajectory[0].data
    if missing := {"velocity", "mass", "radius", "q"} - set(first):
        return f"the dump lacks {', '.join(sorted(missing))}"
    if case.blast is None:
        return "the case has no blast"
    if universe.trajectory[0].time != 0.0:
        return "the trajectory does not begin with the pulse, at time 0"
    return spheroid_theory(
        case,
        radius=cloud.radius,
        mass=cloud.mass,
        charge_per_mass=cloud.charge / cloud.mass,
        speed=launch_speed(universe),
    )


def launch_speed(universe: Universe) -> float | None:
    """Return the speed that all particles share in the first frame (m/s); None if they do not.

    The trajectory is asked, not the case: a deck may have been run with another energy.
    """
    velocity = universe.trajectory[0].data.get("velocity")
    if velocity is None:
        return None
    speeds = np.linalg.norm(velocity, axis=1)
    return float(speeds.mean()) if np.ptp(speeds) <= EQUAL_TOLERANCE * speeds.max() else None


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
        self, universe: Universe, axis: Sequence[float], expected: SpheroidTheory | None = None
    ) -> None:
        super().__init__(universe.trajectory)
        self._universe = universe
        self._frame_axes = _frame_about(axis)
        self._expected = expected

    @property
    def axis(self) -> np.ndarray:
        """Unit vector along B, shape (3,)."""
        return self._frame_axes[2]

    def _prepare(self) -> None:
        cloud = Cloud.of(self._universe)
        launch = self._universe.trajectory[0].data["position"]
        self._weights = cloud.mass / cloud.mass.sum()
        self._launch = launch
        self._launch_centre = theory.centre_of_mass(launch, cloud.mass)
        self._launch_offset = (launch - self._launch_centre) @ self._frame_axes.T
        distance = np.linalg.norm(self._launch_offset, axis=1)
        # A particle at the centre has no launch direction of its own and leaves the fit alone.
        self._fitted = ~theory.on_centre_of_mass(launch, cloud.mass)
        self._direction = self._launch_offset / np.where(distance > 0.0, distance, 1.0)[:, None]
        self._sense = cloud.turning_sense
        self.results.launch_radius = float(distance.max())

        frames = self.n_frames
        for name in ENVELOPE_LENGTHS:
            self.results[name] = np.full(frames, np.nan)
        self.results.centre = np.full((frames, 3), np.nan)
        self.results.fraction_outside = np.zeros(frames) if self._expected else None

    def _single_frame(self) -> None:
        frame, results = self._frame_index, self.results
        displacement = (self._ts.data["position"] - self._launch) @ self._frame_axes.T
        fit = _fit_launch_map(displacement, self._direction, self._sense, self._fitted)
        shift = fit.shift(self._sense)
        about_centre = self._launch_offset + displacement - shift
        along = np.abs(about_centre[:, 2])
        across = np.hypot(about_centre[:, 0], about_centre[:, 1])

        results.centre[frame] = self._launch_centre + (self._weights @ shift) @ self._frame_axes
        parallel, perpendicular = theory.spheroid_semi_axes(
            results.launch_radius, fit.parallel, fit.perpendicular
        )
        results.semi_axis_parallel[frame] = parallel
        results.semi_axis_perpendicular[frame] = perpendicular
        results.fit_residual[frame] = fit.largest_residual
        results.fit_residual_rms[frame] = fit.rms_residual
        results.extent_parallel[frame] = along.max()
        results.extent_perpendicular[frame] = across.max()
        results.blast_radius[frame] = np.hypot(along, across).max()
        if self._expected:
            a, b = self._expected.semi_axes(results.launch_radius, np.array(self._ts.time))
            outside = np.hypot(along * b, across * a) > a * b * (1.0 + ENVELOPE_TOLERANCE)
            results.fraction_outside[frame] = outside.mean()

    def _conclude(self) -> None:
        self.results.times = self.times


@dataclass(frozen=True)
class _LaunchMap:
    """One linear map of launch directions, fitted, with the shift of each sense of turning."""

    parallel: float
    perpendicular: complex
    shift_of_sense: dict[float, np.ndarray]
    largest_residual: float
    rms_residual: float

    def shift(self, sense: np.ndarray) -> np.ndarray:
        """Return the shift of every particle, shape (N, 3)."""
        positive, negative = (self.shift_of_sense.get(s, np.zeros(3)) for s in (1.0, -1.0))
        return np.where(sense[:, None] > 0.0, positive, negative)


def _fit_launch_map(
    displacement: np.ndarray, direction: np.ndarray, sense: np.ndarray, fitted: np.ndarray
) -> _LaunchMap:
    """Fit displacement = shift + map(direction), with the turn mirrored for the sense -1."""
    turned, moved = _mirrored(direction, sense), _mirrored(displacement, sense)
    means = {
        s: (turned[chosen].mean(axis=0), moved[chosen].mean(axis=0))
        for s in (1.0, -1.0)
        if (chosen := fitted & (sense == s)).any()
    }
    turned, moved = turned[fitted], moved[fitted]
    positive = sense[fitted] > 0.0
    for s, (turned_mean, moved_mean) in means.items():
        chosen = positive if s > 0.0 else ~positive
        turned[chosen] -= turned_mean
        moved[chosen] -= moved_mean

    parallel = _slope(moved[:, 2], turned[:, 2])
    perpendicular = _slope(_complex(moved), _complex(turned))
    # Where directions leave a slope open, as those of a ring or a line do, they have no part of it.
    known = np.nan_to_num(parallel), np.nan_to_num(perpendicular)
    distance = np.linalg.norm(moved - _mapped(turned, *known), axis=1)
    shifts = {}
    if np.isfinite(parallel) or np.isfinite(perpendicular):
        shifts = {
            s: _mirrored(moved_mean - _mapped(turned_mean, *known), np.array(s))
            for s, (turned_mean, moved_mean) in means.items()
        }
    return _LaunchMap(
        float(parallel.real),
        complex(perpendicular),
        shifts,
        float(distance.max(initial=0.0)),
        float(np.sqrt(np.mean(distance**2))) if len(distance) else 0.0,
    )


def _mirrored(vectors: np.ndarray, sense: np.ndarray) -> np.ndarray:
    """Return vectors (..., 3) with their second component turned round for the sense -1."""
    mirrored = np.array(vectors, dtype=float)
    mirrored[..., 1] *= sense
    return mirrored


def _complex(vectors: np.ndarray) -> np.ndarray:
    return vectors[..., 0] + 1j * vectors[..., 1]


def _mapped(direction: np.ndarray, parallel: float, perpendicular: complex) -> np.ndarray:
    across = perpendicular * _complex(direction)
    return np.stack([across.real, across.imag, parallel.real * direction[..., 2]], axis=-1)


def _slope(values: np.ndarray, arguments: np.ndarray) -> complex:
    """Return the least-squares slope of a line through the origin, NaN where there is none.

    Arguments are parts of unit vectors; those of rounding size count as none.
    """
    square = np.vdot(arguments, arguments).real
    enough = square > 1e-18 * len(arguments)
    return np.vdot(arguments, values) / square if enough else complex(np.nan)


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

    def __init__(self, universe: Universe, tracked: Sequence[int] = ()) -> None:
        super().__init__(universe.trajectory)
        if "velocity" not in universe.trajectory[0].data:
            raise AnalysisError("the dump has no velocities (columns `vx vy vz`)")
        self._universe = universe
        self._tracked = list(tracked)

    def _prepare(self) -> None:
        mass = Cloud.of(self._universe).mass
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

    def __init__(self, universe: Universe) -> None:
        super().__init__(universe.trajectory)
        if "velocity" not in universe.trajectory[0].data:
            raise AnalysisError("the dump has no velocities (columns `vx vy vz`)")
        self._universe = universe

    def _prepare(self) -> None:
        self._cloud = Cloud.of(self._universe)
        self.results.kinetic = np.zeros(self.n_frames)
        self.results.rotational = np.zeros(self.n_frames)

    def _single_frame(self) -> None:
        frame, cloud = self._frame_index, self._cloud
        self.results.kinetic[frame] = _half_square(cloud.mass, self._ts.data["velocity"])
        spin = self._ts.data.get("angular_velocity")
        if spin is not None and cloud.radius is not None:
            inertia = theory.moment_of_inertia(cloud.mass, cloud.radius)
            self.results.rotational[frame] = _half_square(inertia, spin)

    def _conclude(self) -> None:
        self.results.times = self.times


def _half_square(weight: np.ndarray, vectors: np.ndarray) -> float:
    return float(0.5 * np.einsum("i,ij,ij->", weight, vectors, vectors))


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
        return cls(*table.T[: len(own)])


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
        complete, _, cut = path.read_text(encoding="ascii").rpartition("\n")
        if cut:
            warnings.warn(f"{path}: the last line was cut short and is left out", stacklevel=3)
        rows = list(csv.reader(complete.splitlines()))
        table = np.array(rows[1:], dtype=float).reshape(-1, len(rows[0]))
    except (OSError, ValueError, IndexError, UnicodeDecodeError, csv.Error) as error:
        raise AnalysisError(f"{path}: not {what} ({error})") from error
    if len(table) == 0:
        raise AnalysisError(f"{path}: not {what} (it has no rows)")
    return tuple(rows[0]), table
