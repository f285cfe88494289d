"""The same work by others: Euler steps in numpy, PlasmaPy's Boris push, pair sums in numba."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from benchmarks.section_6 import MAGNETIC, MEDIUM_DENSITY, PULSE_ENERGY, STEP, VISCOSITY
from lammps_blast import theory
from lammps_blast.interactions import NearFieldLaw
from lammps_blast.particles import Particles

try:
    import numba
    from numba import prange
except ImportError:
    numba = None

STEPS = 500  # the peers take the same time every step: a few hundred tell it
WARM_UP_STEPS = 20


@dataclass(frozen=True)
class StepTimer:
    """Times STEPS calls of a function that makes one step."""

    start: Callable[[], Callable[[], None]]
    particle_count: int

    def __call__(self) -> float:
        """Return ns per particle-step, from the start of the blast each time."""
        step = self.start()
        for _ in range(WARM_UP_STEPS):
            step()
        started = time.perf_counter()
        for _ in range(STEPS):
            step()
        return 1e9 * (time.perf_counter() - started) / (self.particle_count * STEPS)


def launch_velocity(particles: Particles) -> theory.Floats:
    """Velocities right after the pulse, shape (N, 3), m/s."""
    speed = theory.pulse_speed(PULSE_ENERGY, particles.mass.sum())
    return speed * theory.launch_directions(particles.position, particles.mass)


class TunedEuler:
    """Eq. 6.2 with Chow's drag, as numpy does it best.

    A row a component, so that every operation runs over contiguous memory; no array is made after
    the start; v x B for all particles is one product of matrices; where all particles are on a
    branch of Chow's fit with one C_D, as here throughout, no power is taken.
    """

    def __init__(self, particles: Particles) -> None:
        count = len(particles)
        self.position = np.ascontiguousarray(particles.position.T)
        self.velocity = np.ascontiguousarray(launch_velocity(particles).T)
        # v x B = cross_magnetic v
        self._cross_magnetic = -np.cross(MAGNETIC, np.eye(3)).T
        self._magnetic_gain = STEP * particles.charge_per_mass
        area = np.pi * particles.radius**2
        self._drag_gain = STEP * 0.5 * MEDIUM_DENSITY * area / particles.mass
        self._reynolds_per_speed = 2.0 * particles.radius * MEDIUM_DENSITY / VISCOSITY
        self._speed, self._reynolds = np.empty(count), np.empty(count)
        self._increment, self._scratch = np.empty((3, count)), np.empty((3, count))

    def step(self) -> None:
        """Advance velocities and positions by one step."""
        position, velocity = self.position, self.velocity
        increment, scratch = self._increment, self._scratch
        np.dot(self._cross_magnetic, velocity, out=increment)
        increment *= self._magnetic_gain
        np.multiply(velocity, self._drag_factor(), out=scratch)
        increment -= scratch
        np.multiply(velocity, STEP, out=scratch)
        position += scratch
        velocity += increment

    def _drag_factor(self) -> theory.Floats:
        speed = self._speed
        np.einsum("ij,ij->j", self.velocity, self.velocity, out=speed)
        np.sqrt(speed, out=speed)
        np.multiply(speed, self._reynolds_per_speed, out=self._reynolds)
        speed *= self._drag_gain
        speed *= self._drag_coefficient()
        return speed

    def _drag_coefficient(self) -> theory.Floats | float:
        low, high = self._reynolds.min(), self._reynolds.max()
        if low > 400.0 and high <= 3.0e5:
            return 0.5
        return theory.chow_drag_coefficient(self._reynolds)


def tuned_euler(particles: Particles) -> StepTimer:
    """Return the timer of the tuned numpy scheme."""
    return StepTimer(lambda: TunedEuler(particles).step, len(particles))


class PlainEuler:
    """Eq. 6.2 with Chow's drag as one writes it down: a row a particle, np.cross, np.piecewise."""

    def __init__(self, particles: Particles) -> None:
        self.position, self.velocity = particles.position.copy(), launch_velocity(particles)
        self._mass, self._charge = particles.mass[:, None], particles.charge[:, None]
        self._radius = particles.radius

    def step(self) -> None:
        """Advance velocities and positions by one step."""
        speed = np.linalg.norm(self.velocity, axis=1)
        coefficient = self._drag_coefficient(
            2.0 * self._radius * MEDIUM_DENSITY * speed / VISCOSITY
        )
        drag = -0.5 * MEDIUM_DENSITY * np.pi * self._radius**2 * coefficient * speed
        force = drag[:, None] * self.velocity + self._charge * np.cross(self.velocity, MAGNETIC)
        self.position += STEP * self.velocity
        self.velocity += STEP / self._mass * force

    def _drag_coefficient(self, reynolds: theory.Floats) -> theory.Floats:
        return np.piecewise(
            reynolds,
            [
                reynolds <= 1.0,
                (reynolds > 1.0) & (reynolds <= 400.0),
                (reynolds > 400.0) & (reynolds <= 3.0e5),
                (reynolds > 3.0e5) & (reynolds <= 2.0e6),
            ],
            [
                lambda re: 24.0 / re,
                lambda re: 24.0 / re**0.646,
                0.5,
                lambda re: 0.000366 * re**0.4275,
                0.18,
            ],
        )


def plain_euler(particles: Particles) -> StepTimer:
    """Return the timer of the plain numpy scheme."""
    return StepTimer(lambda: PlainEuler(particles).step, len(particles))


class BorisPush:
    """PlasmaPy's non-relativistic Boris integrator in a uniform B.

    One field and one charge and mass for all particles: numpy's broadcasting then does the least
    work that its public function allows.
    """

    def __init__(self, particles: Particles) -> None:
        from plasmapy.simulation.particle_integrators import BorisIntegrator

        self._push = BorisIntegrator.push
        self.position, self.velocity = particles.position.copy(), launch_velocity(particles)
        self._magnetic, self._electric = np.array([MAGNETIC]), np.zeros((1, 3))
        self._charge, self._mass = float(particles.charge[0]), float(particles.mass[0])

    def step(self) -> None:
        """Advance velocities and positions by one step."""
        self.position, self.velocity = self._push(
            self.position,
            self.velocity,
            self._magnetic,
            self._electric,
            self._charge,
            self._mass,
            STEP,
        )


def plasmapy_boris(particles: Particles) -> StepTimer | None:
    """Return the timer of PlasmaPy's scheme, None where PlasmaPy is not installed."""
    try:
        import plasmapy.simulation.particle_integrators  # noqa: F401
    except ImportError:
        return None
    return StepTimer(lambda: BorisPush(particles).step, len(particles))


@dataclass(frozen=True)
class NumbaAllPairs:
    """Near-field forces (eq. 7.23, exponents 1 and 2, scaled by mass) by compiled plain loops.

    Attributes
    ----------
    force
        Compiled `pair_sum` or `row_sums`.
    """

    force: Callable[..., Any]
    particles: Particles
    law: NearFieldLaw
    evaluations: int = 10

    def forces(self) -> theory.Floats:
        """Forces in N, (N, 3)."""
        # A row a component, which the compiler can take several particles of at a time.
        position = np.ascontiguousarray(self.particles.position.T)
        forces = np.zeros_like(position)
        strengths = self.law.attraction, self.law.repulsion
        self.force(*position, self.particles.mass, *strengths, *forces)
        return forces.T

    def __call__(self) -> float:
        """Return ns a pair; compiling, and a first call, do not count."""
        self.forces()
        started = time.perf_counter()
        for _ in range(self.evaluations):
            self.forces()
        count = len(self.particles)
        pairs = count * (count - 1) // 2
        return 1e9 * (time.perf_counter() - started) / (pairs * self.evaluations)


def pair_sum(x, y, z, mass, attraction, repulsion, fx, fy, fz):  # numba infers the types
    """Add forces pair by pair, each pair once."""
    for i in range(len(mass)):
        own_x = own_y = own_z = 0.0
        for j in range(i + 1, len(mass)):
            dx, dy, dz = x[j] - x[i], y[j] - y[i], z[j] - z[i]
            inverse_square = 1.0 / (dx * dx + dy * dy + dz * dz)
            # alpha_1 / d - alpha_2 / d^2, and 1 / d more for the unit vector
            bare = attraction - repulsion * np.sqrt(inverse_square)
            pull = mass[i] * mass[j] * bare * inverse_square
            own_x, own_y, own_z = own_x + pull * dx, own_y + pull * dy, own_z + pull * dz
            fx[j] -= pull * dx
            fy[j] -= pull * dy
            fz[j] -= pull * dz
        fx[i] += own_x
        fy[i] += own_y
        fz[i] += own_z


def row_sums(x, y, z, mass, attraction, repulsion, fx, fy, fz):  # numba infers the types
    """Set forces particle by particle, each pair twice, so that threads do not meet."""
    for i in prange(len(mass)):
        own_x = own_y = own_z = 0.0
        for j in range(len(mass)):
            dx, dy, dz = x[j] - x[i], y[j] - y[i], z[j] - z[i]
            square = dx * dx + dy * dy + dz * dz
            inverse_square = 1.0 / square if square > 0.0 else 0.0
            bare = attraction - repulsion * np.sqrt(inverse_square)
            pull = mass[i] * mass[j] * bare * inverse_square
            own_x, own_y, own_z = own_x + pull * dx, own_y + pull * dy, own_z + pull * dz
        fx[i], fy[i], fz[i] = own_x, own_y, own_z


PAIRS, ROWS, ROWS_ON_THREADS = "each pair once", "each pair twice", "each pair twice, threads"


def numba_all_pairs(particles: Particles, law: NearFieldLaw, loop: str) -> NumbaAllPairs | None:
    """Return the timer, in ns a pair, of numba's loops over all pairs; None without numba.

    Parameters
    ----------
    particles
        Their masses are the sources.
    law
        Its strengths are used; the exponents are 1 and 2, and there is no cutoff.
    loop
        PAIRS or ROWS, on one core, or ROWS_ON_THREADS, on as many as numba takes. A row of pairs
        writes to one particle only, so that the compiler can take several at a time.

    Raises
    ------
    ValueError
        If the law has other exponents, or a cutoff.
    """
    if (law.attraction_exponent, law.repulsion_exponent, law.cutoff) != (1.0, 2.0, np.inf):
        raise ValueError("numba's loops are written for the exponents 1 and 2, without a cutoff")
    if numba is None:
        return None
    plain = pair_sum if loop == PAIRS else row_sums
    compiled = numba.njit(fastmath=True, parallel=loop == ROWS_ON_THREADS)(plain)
    return NumbaAllPairs(compiled, particles, law)
