"""Whether the spheroid theorem holds for a cloud, and what it then says.

The closed forms are in `theory`; this is where a case and its particles are held against the
theorem's conditions, once for predictions before a run and for checks after it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lammps_blast import theory
from lammps_blast.case import Case, Medium
from lammps_blast.theory import ArrayLike, Complexes, DragLaw, Floats

# Quantities that the theorem wants equal are taken so up to the rounding of a dump.
EQUAL_TOLERANCE = 1e-9


@dataclass(frozen=True)
class SpheroidTheory:
    """The spheroid theorem for one cloud launched from rest.

    Attributes
    ----------
    speed
        At launch, m/s.
    cyclotron_frequency
        Magnitude, rad/s; opposite charges turn in opposite senses but fill the same spheroid.
    radius, mass
        Of one particle, m and kg.
    drag
        The law; a medium that moves, or a uniform force, under a linear law only moves the whole
        spheroid.
    """

    speed: float
    cyclotron_frequency: float
    radius: float
    mass: float
    drag: DragLaw

    def displacement(self, times: ArrayLike) -> tuple[Floats, Complexes]:
        """Return d_parallel and complex d_perpendicular (m) at `times` (s)."""
        return theory.launch_displacement(
            times,
            self.speed,
            self.cyclotron_frequency,
            radius=self.radius,
            mass=self.mass,
            drag=self.drag,
        )

    def semi_axes(self, launch_radius: float, times: ArrayLike) -> tuple[Floats, Floats]:
        """Return the semi-axes along and across B (m) at `times` (s)."""
        return theory.spheroid_semi_axes(launch_radius, *self.displacement(times))

    def terminal_semi_axes(self, launch_radius: float) -> tuple[float, float]:
        """Return the semi-axes along and across B (m) after infinite time.

        Raises
        ------
        ValueError
            If the particles travel without limit.
        """
        return theory.terminal_spheroid(
            launch_radius,
            self.speed,
            self.cyclotron_frequency,
            radius=self.radius,
            mass=self.mass,
            drag=self.drag,
        )

    def speeds(self, times: ArrayLike) -> Floats:
        """Return the speed that all particles share (m/s) at `times` (s), without E and wind."""
        return theory.speed_history(
            times, self.speed, radius=self.radius, mass=self.mass, drag=self.drag
        )


def drag_law(medium: Medium) -> DragLaw:
    """Return the drag law of a case's medium, as the closed forms want it."""
    return DragLaw(medium.drag, medium.density, medium.viscosity, medium.drag_coefficient)


def spheroid_theory(
    case: Case,
    *,
    radius: Floats,
    mass: Floats,
    charge_per_mass: Floats,
    speed: float | None,
) -> SpheroidTheory | str:
    """Return the theorem for a cloud, or the reason why it does not hold there.

    It needs particles that do not interact, launched from rest with one charge-to-mass ratio up to
    its sign; with drag also one size and mass; and with drag that is not linear in the speed no
    electric field and a medium at rest.

    Parameters
    ----------
    case
        Fields and medium.
    radius, mass, charge_per_mass
        (N,) in m, kg, C/kg; one value may stand for equal particles.
    speed
        That all particles share right after the pulse, m/s; None where they do not.
    """
    if case.interacts:
        return "the particles interact"
    medium, electric = case.medium, any(case.fields.electric)
    strength = np.abs(charge_per_mass)
    pushed, dragged = electric and bool(strength.any()), medium.drag != "none"
    linear = medium.drag in ("none", "stokes")
    if speed is None:
        return "the particles move before the pulse"
    if not 0.0 < speed < np.inf:
        return "the pulse speed is beyond the range of floating-point numbers"
    if (any(case.fields.magnetic) or pushed) and not _equal(strength):
        return "the particles differ in charge per mass"
    if dragged and not (_equal(radius) and _equal(mass)):
        return "the particles differ in size or density, so drag parts them"
    if pushed and not linear:
        return "an electric field acts together with drag that is not linear in the speed"
    if any(medium.velocity) and not linear:
        return "the medium moves and its drag is not linear in the speed"
    return SpheroidTheory(
        speed=speed,
        cyclotron_frequency=float(
            theory.cyclotron_frequency(strength.flat[0], case.fields.magnetic)
        ),
        radius=float(radius.flat[0]),
        mass=float(mass.flat[0]),
        drag=drag_law(medium),
    )


def _equal(values: Floats) -> bool:
    return bool(np.ptp(values) <= EQUAL_TOLERANCE * np.abs(values).max())
