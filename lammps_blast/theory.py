"""Closed forms for a blast of charged particles, and the command that prints them for a case.

The model is that of T.I. Zohdi, Comput. Methods Appl. Mech. Engrg. 308 (2016) 47-72; `eq. 4.10`
in a docstring is its equation 4.10. Everything is in SI units and works on plain numbers and on
numpy arrays, with numpy's broadcasting. Nothing here runs a simulation: these are the answers
that simulations are checked against, so each one also holds in its limits (no field, no drag,
time zero), where the printed formula is 0/0.

The spheroid theorem is not in the paper. Equal particles that leave one centre with one speed,
in a uniform magnetic field and with a drag that depends on speed alone, share one speed history
s(t), and the field only turns their velocities. The displacement is therefore one linear map of
the launch direction, and a sphere of launch points is an exact spheroid at every time:

    d_parallel(t) = integral of s over [0, t],  d_perpendicular(t) = integral of s exp(-i omega t)

    python -m lammps_blast.theory case.yaml [--json]
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats: TypeAlias = NDArray[np.float64]
Complexes: TypeAlias = NDArray[np.complex128]

# Chow's fit, eq. 4.2: up to and including Reynolds number `limit`, C_D = factor / Re**power.
# It jumps at 3e5, as the measurements do.
CHOW_LIMITS = np.array([1.0, 400.0, 3.0e5, 2.0e6])
CHOW_FACTORS = np.array([24.0, 24.0, 0.5, 0.000366, 0.18])
CHOW_POWERS = np.array([1.0, 0.646, 0.0, -0.4275, 0.0])

# From this |z| on, the divergent series of exp(z) E_a(z) on the imaginary axis is exact to
# rounding when it is cut at its smallest term, which is about exp(-|z|).
ASYMPTOTIC_PHASE = 40.0
ASYMPTOTIC_TERMS = 36
GAUSS_NODES, GAUSS_WEIGHTS = np.polynomial.legendre.leggauss(40)

# A centre of mass is known to rounding only: particles nearer to it than this part of the cloud's
# radius and of its distance from the origin sit on it.
CENTRE_TOLERANCE = 1e-12


def _expm1_ratio(x: ArrayLike) -> Any:
    """(exp(x) - 1)/x, one at x = 0; real or complex x."""
    x = np.asarray(x) + 0.0
    return np.divide(np.expm1(x), x, out=np.ones_like(x), where=x != 0)[()]


def _log1p_ratio(x: ArrayLike) -> Any:
    """ln(1 + x)/x, one at x = 0."""
    x = np.asarray(x, dtype=float)
    return np.divide(np.log1p(x), x, out=np.ones_like(x), where=x != 0)[()]


def _sine_ratio(angle: Floats) -> Floats:
    """sin(a)/a."""
    return np.sinc(angle / np.pi)


def _sine_defect_ratio(angle: Floats) -> Floats:
    """(a - sin a)/a^3: its series where the difference would cancel."""
    square = np.minimum(angle**2, 1.0)
    series = np.zeros_like(square)
    for k in range(10, 0, -1):
        series = (1.0 - square * series) / ((2 * k) * (2 * k + 1))
    large = np.where(np.abs(angle) > 1.0, angle, 1.0)
    return np.where(np.abs(angle) > 1.0, (large - np.sin(large)) / large**3, series)


def _ratio(numerator: ArrayLike, denominator: ArrayLike) -> Any:
    """The quotient; a positive number over zero is infinite, without a warning."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.divide(numerator, denominator)


def cyclotron_frequency(charge_per_mass: ArrayLike, magnetic: ArrayLike) -> Any:
    """Signed cyclotron frequency omega = q |B| / m in rad/s (eq. 2.5).

    A positive one turns the velocity by -omega t about B.

    Parameters
    ----------
    charge_per_mass
        q/m in C/kg, any shape.
    magnetic
        B in T, shape (..., 3).
    """
    return np.asarray(charge_per_mass, dtype=float) * np.linalg.norm(magnetic, axis=-1)


def cyclotron_radius(speed: ArrayLike, cyclotron_frequency: ArrayLike) -> Any:
    """Cyclotron radius R = v m / |q B| in m (eq. 2.6); infinite without a field.

    Parameters
    ----------
    speed
        The speed across the field in m/s.
    cyclotron_frequency
        omega in rad/s, either sign.
    """
    return _ratio(speed, np.abs(cyclotron_frequency))


def cyclotron_period(cyclotron_frequency: ArrayLike) -> Any:
    """Cyclotron period T = 2 pi / |omega| in s (eq. 2.10); infinite without a field."""
    return _ratio(2.0 * np.pi, np.abs(cyclotron_frequency))


def trapezoid_gyration_gain(phi: ArrayLike, angle: ArrayLike) -> Any:
    """Factor that a step of the phi-trapezoid (eq. 8.1) puts on the energy of a gyration.

    Its rule turns and stretches the velocity across B by (1 + i (1 - phi) a) / (1 - i phi a), where
    `angle` is a = omega dt, in rad. One half alone keeps the energy.
    """
    phi, square = np.asarray(phi), np.square(angle)
    return (1.0 + (1.0 - phi) ** 2 * square) / (1.0 + phi**2 * square)


def lorentz_orbit(
    time: ArrayLike,
    position: ArrayLike,
    velocity: ArrayLike,
    charge_per_mass: ArrayLike,
    electric: ArrayLike,
    magnetic: ArrayLike,
) -> tuple[Floats, Floats]:
    """Exact motion in uniform fields of any directions, without drag (eq. 2.1; 2.5 and 2.7).

    Gyration, E x B drift and acceleration along B in one formula that holds unchanged for
    B = 0, E = 0, no charge and time zero.

    Parameters
    ----------
    time
        s; a number, or an array that broadcasts against position[..., 0]: shape (T, 1)
        with N particles gives results of shape (T, N, 3).
    position
        r(0) in m, shape (..., 3).
    velocity
        v(0) in m/s, shape (..., 3).
    charge_per_mass
        q/m in C/kg, a number or shape (N,).
    electric
        E in V/m, shape (3,) or (..., 3).
    magnetic
        B in T, shape (3,) or (..., 3).

    Returns
    -------
    tuple of ndarray
        Position in m and velocity in m/s at the time, shape (..., 3).
    """
    t = np.asarray(time, dtype=float)[..., None]
    charge = np.asarray(charge_per_mass, dtype=float)[..., None]
    axis = _unit(np.asarray(magnetic, dtype=float))
    omega = charge * np.linalg.norm(magnetic, axis=-1)[..., None]
    v_along, v_across = _split(np.asarray(velocity, dtype=float), axis)
    a_along, a_across = _split(charge * np.asarray(electric, dtype=float), axis)
    v_turned, a_turned = (np.cross(axis, across) for across in (v_across, a_across))

    angle = omega * t
    # The integrals over [0, t] of cos and sin, and the integrals of those: t and t^2 times
    # functions of the angle that are finite at zero, so that nothing is divided by omega.
    sine = _sine_ratio(angle) * t
    versine = 0.5 * angle * _sine_ratio(0.5 * angle) ** 2 * t
    sine_2 = 0.5 * _sine_ratio(0.5 * angle) ** 2 * t**2
    versine_2 = angle * _sine_defect_ratio(angle) * t**2

    gyrating = np.cos(angle) * v_across - np.sin(angle) * v_turned
    new_velocity = v_along + a_along * t + gyrating + sine * a_across - versine * a_turned
    displacement = v_along * t + 0.5 * a_along * t**2 + sine * v_across - versine * v_turned
    displacement = displacement + sine_2 * a_across - versine_2 * a_turned
    return np.asarray(position, dtype=float) + displacement, new_velocity


def _unit(vector: Floats) -> Floats:
    """The unit vector, or zero for a zero vector (then everything counts as across it)."""
    length = np.linalg.norm(vector, axis=-1, keepdims=True)
    return np.divide(vector, length, out=np.zeros_like(vector), where=length > 0)


def _split(vector: Floats, axis: Floats) -> tuple[Floats, Floats]:
    """The parts of a vector along and across a unit axis."""
    along = np.sum(vector * axis, axis=-1, keepdims=True) * axis
    return along, vector - along


def sphere_mass(radius: ArrayLike, density: ArrayLike) -> Any:
    """Mass of a solid sphere, m = rho 4/3 pi R^3, in kg.

    Parameters
    ----------
    radius
        R in m.
    density
        rho in kg/m3.
    """
    return np.asarray(density) * (4.0 / 3.0 * np.pi) * np.asarray(radius, dtype=float) ** 3


def moment_of_inertia(mass: ArrayLike, radius: ArrayLike) -> Any:
    """I = 2/5 m R^2 of a homogeneous sphere in kg m2 (eq. 7.8).

    Parameters
    ----------
    mass
        m in kg.
    radius
        R in m.
    """
    return 0.4 * np.asarray(mass) * np.asarray(radius) ** 2


def pulse_speed(energy: ArrayLike, total_mass: ArrayLike) -> Any:
    """Speed that a blast gives to every particle, |dv| = sqrt(2 W / M), in m/s (eq. 3.4).

    Parameters
    ----------
    energy
        W in J.
    total_mass
        M in kg, the sum over the particles.
    """
    return np.sqrt(2.0 * np.asarray(energy) / np.asarray(total_mass))


def centre_of_mass(position: ArrayLike, mass: ArrayLike) -> Floats:
    """Centre of mass r_c = sum m_i r_i / sum m_i in m, shape (3,) (eq. 3.2).

    Parameters
    ----------
    position
        r_i in m, shape (N, 3).
    mass
        m_i in kg, shape (N,).
    """
    return np.average(np.asarray(position, dtype=float), axis=0, weights=np.asarray(mass))


def launch_directions(position: ArrayLike, mass: ArrayLike) -> Floats:
    """Unit vectors n_i = (r_i - r_c)/|r_i - r_c|, shape (N, 3) (eq. 3.1).

    Parameters
    ----------
    position
        r_i in m, shape (N, 3).
    mass
        m_i in kg, shape (N,).

    Raises
    ------
    ValueError
        A particle sits on the centre of mass, where no formula gives a direction.
    """
    at_centre = np.flatnonzero(on_centre_of_mass(position, mass))
    if at_centre.size:
        raise ValueError(
            f"particle {at_centre[0]} (counted from 0) sits on the centre of mass: "
            "its launch direction is drawn at random in a run, and no formula gives it"
        )
    return _unit(np.asarray(position, dtype=float) - centre_of_mass(position, mass))


def on_centre_of_mass(position: ArrayLike, mass: ArrayLike) -> NDArray[np.bool_]:
    """Which particles sit on the centre of mass, up to the rounding with which it is known, (N,).

    Parameters
    ----------
    position
        r_i in m, shape (N, 3).
    mass
        m_i in kg, shape (N,).
    """
    centre = centre_of_mass(position, mass)
    distance = np.linalg.norm(np.asarray(position, dtype=float) - centre, axis=1)
    return distance <= CENTRE_TOLERANCE * (np.linalg.norm(centre) + distance.max())


DragKind: TypeAlias = Literal["none", "constant", "chow", "stokes"]


@dataclass(frozen=True)
class DragLaw:
    """A medium and the law by which it drags a sphere.

    Attributes
    ----------
    kind
        `none`; `constant`: eq. 3.6 with a fixed C_D; `chow`: eq. 3.6 with eq. 4.2;
        `stokes`: eq. 4.13.
    density
        Of the medium, rho_a in kg/m3 (constant, chow).
    viscosity
        Of the medium, mu_f in Pa s (chow, stokes).
    coefficient
        C_D (constant only).

    Raises
    ------
    ValueError
        Unknown kind, a negative or infinite quantity, `constant` without a
        coefficient.
    """

    kind: DragKind = "none"
    density: float = 0.0
    viscosity: float = 0.0
    coefficient: float | None = None

    def __post_init__(self) -> None:
        if self.kind not in ("none", "constant", "chow", "stokes"):
            raise ValueError(f"drag kind {self.kind!r} is not none, constant, chow or stokes")
        if self.kind == "constant" and self.coefficient is None:
            raise ValueError("constant drag needs a coefficient")
        for name in ("density", "viscosity", "coefficient"):
            value = getattr(self, name)
            if value is not None and not 0.0 <= value < np.inf:
                raise ValueError(f"{name} of the drag law is {value}: it must be finite and >= 0")


def reynolds_number(
    relative_speed: ArrayLike, radius: ArrayLike, medium_density: ArrayLike, viscosity: ArrayLike
) -> Any:
    """Reynolds number of a sphere, Re = 2 R rho_a |v_f - v| / mu_f (section 4.2).

    Zero at zero speed; infinite without viscosity.

    Parameters
    ----------
    relative_speed
        |v_f - v| in m/s.
    radius
        R in m.
    medium_density
        rho_a in kg/m3.
    viscosity
        mu_f in Pa s.
    """
    inertia = 2.0 * np.asarray(radius) * np.asarray(medium_density) * np.asarray(relative_speed)
    return np.where(inertia == 0.0, 0.0, _ratio(inertia, viscosity))[()]


def chow_drag_coefficient(reynolds: ArrayLike) -> Any:
    """Chow's piecewise fit of the drag coefficient of a sphere (eq. 4.2).

    Each piece includes its upper limit, and the jump at Re = 3e5 is kept. Infinite at Re = 0,
    where the force is nevertheless zero.

    Parameters
    ----------
    reynolds
        Re >= 0, any shape.
    """
    reynolds = np.asarray(reynolds, dtype=float)
    piece = np.searchsorted(CHOW_LIMITS, reynolds, side="left")
    # The two outer powers are exactly 1 and 0, so both limits, 0 and infinity, come out right.
    with np.errstate(divide="ignore"):
        return (CHOW_FACTORS[piece] * reynolds ** -CHOW_POWERS[piece])[()]


def drag_coefficient(relative_speed: ArrayLike, radius: ArrayLike, drag: DragLaw) -> Any:
    """The C_D with which eq. 3.6 gives this law's force.

    Zero for no drag; for Stokes drag it is 24/Re, infinite at zero speed (eq. 4.14).

    Parameters
    ----------
    relative_speed
        |v_f - v| in m/s.
    radius
        R in m.
    """
    shape = np.broadcast_shapes(np.shape(relative_speed), np.shape(radius))
    if drag.kind in ("none", "constant"):
        return np.full(shape, drag.coefficient if drag.kind == "constant" else 0.0)[()]
    reynolds = reynolds_number(relative_speed, radius, drag.density, drag.viscosity)
    return chow_drag_coefficient(reynolds) if drag.kind == "chow" else _ratio(24.0, reynolds)


def drag_force(
    velocity: ArrayLike,
    radius: ArrayLike,
    drag: DragLaw,
    medium_velocity: ArrayLike = (0.0, 0.0, 0.0),
) -> Floats:
    """Drag force F = 1/2 rho_a C_D |v_f - v| (v_f - v) pi R^2 in N (eq. 3.6), or eq. 4.13.

    Exactly zero at zero relative velocity.

    Parameters
    ----------
    velocity
        v in m/s, shape (..., 3).
    radius
        R in m, a number or shape (...).
    medium_velocity
        v_f in m/s, shape (3,) or (..., 3).

    Returns
    -------
    ndarray
        Shape (..., 3).
    """
    relative = np.asarray(medium_velocity, dtype=float) - np.asarray(velocity, dtype=float)
    speed = np.linalg.norm(relative, axis=-1)
    return drag_resistance(speed, radius, drag)[..., None] * relative


def drag_resistance(relative_speed: ArrayLike, radius: ArrayLike, drag: DragLaw) -> Floats:
    """Drag force per relative speed, |F|/|v_f - v|, in kg/s (eq. 3.6, 4.13); finite at rest.

    Parameters
    ----------
    relative_speed
        |v_f - v| in m/s.
    radius
        R in m.
    """
    speed, radius = np.broadcast_arrays(*(np.asarray(a, float) for a in (relative_speed, radius)))
    stokes = 6.0 * np.pi * drag.viscosity * radius
    if drag.kind == "stokes":
        return stokes
    coefficient = drag_coefficient(speed, radius, drag)
    # Chow's first piece is Stokes drag. Taken as such, it needs no infinite C_D at rest.
    reynolds = reynolds_number(speed, radius, drag.density, drag.viscosity)
    creeping = (reynolds <= CHOW_LIMITS[0]) & (drag.kind == "chow")
    finite = np.where(creeping, 0.0, coefficient)
    quadratic = 0.5 * drag.density * finite * np.pi * radius**2 * speed
    return np.where(creeping, stokes, quadratic)


def stokes_drag_force(
    velocity: ArrayLike,
    radius: ArrayLike,
    viscosity: float,
    medium_velocity: ArrayLike = (0.0, 0.0, 0.0),
) -> Floats:
    """Stokes drag F = 6 pi mu_f R (v_f - v) in N, shape (..., 3) (eq. 4.13).

    Parameters
    ----------
    velocity
        v in m/s, shape (..., 3).
    radius
        R in m, a number or shape (...).
    viscosity
        mu_f in Pa s.
    medium_velocity
        v_f in m/s, shape (3,) or (..., 3).
    """
    return drag_force(velocity, radius, DragLaw("stokes", viscosity=viscosity), medium_velocity)


def stokes_to_quadratic_ratio(
    relative_speed: ArrayLike,
    radius: ArrayLike,
    medium_density: ArrayLike,
    viscosity: ArrayLike,
    drag_coefficient: ArrayLike,
) -> Any:
    """|F_Stokes|/|F| = 12 mu_f / (rho_a C_D R |v_f - v|) (eq. 4.14); infinite at rest.

    Parameters
    ----------
    relative_speed
        |v_f - v| in m/s.
    radius
        R in m.
    medium_density
        rho_a in kg/m3.
    viscosity
        mu_f in Pa s.
    drag_coefficient
        C_D of the quadratic law.
    """
    inertia = np.asarray(medium_density) * np.asarray(radius) * np.asarray(relative_speed)
    return _ratio(12.0 * np.asarray(viscosity), np.asarray(drag_coefficient) * inertia)


def drag_constant(
    drag_coefficient: ArrayLike, medium_density: ArrayLike, radius: ArrayLike, density: ArrayLike
) -> Any:
    """K = 3 C_D rho_a / (8 rho R) in 1/m (eq. 4.3): dv/dt = -K v^2, and 1/K is a length.

    Parameters
    ----------
    drag_coefficient
        C_D.
    medium_density
        rho_a in kg/m3.
    radius
        R in m.
    density
        rho of the particle in kg/m3.
    """
    medium = np.asarray(drag_coefficient) * np.asarray(medium_density)
    return 3.0 * medium / (8.0 * np.asarray(density) * np.asarray(radius))


def quadratic_speed(time: ArrayLike, speed: ArrayLike, drag_constant: ArrayLike) -> Any:
    """Speed after a time with a constant C_D, v = v0/(1 + K v0 t), in m/s (eq. 4.10).

    Parameters
    ----------
    time
        t in s.
    speed
        v0 in m/s.
    drag_constant
        K in 1/m.
    """
    speed = np.asarray(speed, dtype=float)
    return speed / (1.0 + np.asarray(drag_constant) * speed * np.asarray(time))


def quadratic_distance(time: ArrayLike, speed: ArrayLike, drag_constant: ArrayLike) -> Any:
    """Distance in a time with a constant C_D, s = ln(1 + K v0 t)/K, in m (eq. 4.11).

    v0 t for K = 0. Arguments as for `quadratic_speed`.
    """
    free = np.asarray(speed) * np.asarray(time, dtype=float)
    return free * _log1p_ratio(np.asarray(drag_constant) * free)


def quadratic_speed_at_distance(
    distance: ArrayLike, speed: ArrayLike, drag_constant: ArrayLike
) -> Any:
    """Speed after a distance with a constant C_D, v = v0 exp(-K s), in m/s (eq. 4.7).

    Parameters
    ----------
    distance
        s in m.
    speed
        v0 in m/s.
    drag_constant
        K in 1/m.
    """
    return np.asarray(speed) * np.exp(-np.asarray(drag_constant) * np.asarray(distance))


def quadratic_time(distance: ArrayLike, speed: ArrayLike, drag_constant: ArrayLike) -> Any:
    """Time to travel a distance with a constant C_D, t = (exp(K s) - 1)/(K v0), in s (eq. 4.12).

    s/v0 for K = 0. Arguments as for `quadratic_speed_at_distance`.
    """
    stretch = _expm1_ratio(np.asarray(drag_constant) * np.asarray(distance, dtype=float))
    return _ratio(distance, speed) * stretch


def stokes_time(radius: ArrayLike, density: ArrayLike, viscosity: ArrayLike) -> Any:
    """Relaxation time tau = m/c = 2 R^2 rho / (9 mu_f) in s (eq. A.4); infinite if inviscid.

    Parameters
    ----------
    radius
        R in m.
    density
        rho of the particle in kg/m3.
    viscosity
        mu_f in Pa s.
    """
    return _ratio(2.0 * np.asarray(radius) ** 2 * np.asarray(density), 9.0 * np.asarray(viscosity))


def stokes_speed(time: ArrayLike, speed: ArrayLike, stokes_time: ArrayLike) -> Any:
    """Speed after a time with Stokes drag, v = v0 exp(-t/tau), in m/s (eq. A.5).

    Parameters
    ----------
    time
        t in s.
    speed
        v0 in m/s.
    stokes_time
        tau in s.
    """
    return np.asarray(speed) * np.exp(-np.asarray(time) / np.asarray(stokes_time))


def stokes_distance(time: ArrayLike, speed: ArrayLike, stokes_time: ArrayLike) -> Any:
    """Distance in a time with Stokes drag, s = v0 tau (1 - exp(-t/tau)), in m (eq. A.6).

    v0 t for an infinite tau. Arguments as for `stokes_speed`.
    """
    free = np.asarray(speed) * np.asarray(time, dtype=float)
    return free * _expm1_ratio(-np.asarray(time) / np.asarray(stokes_time, dtype=float))


def stokes_terminal_radius(speed: ArrayLike, stokes_time: ArrayLike) -> Any:
    """Distance to rest with Stokes drag, R_inf = v0 tau, in m (eq. A.12).

    Parameters
    ----------
    speed
        v0 = sqrt(2 W / M) in m/s.
    stokes_time
        tau in s.
    """
    return np.asarray(speed) * np.asarray(stokes_time)


def stokes_radius_fraction(time: ArrayLike, stokes_time: ArrayLike) -> Any:
    """Blast radius over its final value, R(t)/R_inf = 1 - exp(-t/tau) (eq. A.13).

    Parameters
    ----------
    time
        t in s.
    stokes_time
        tau in s.
    """
    return -np.expm1(-np.asarray(time) / np.asarray(stokes_time, dtype=float))


def stokes_travel_time(distance: ArrayLike, speed: ArrayLike, stokes_time: ArrayLike) -> Any:
    """Time to travel R* with Stokes drag, t = -tau ln((R_inf - R*)/R_inf), in s (eq. A.14).

    R*/v0 for an infinite tau; infinite for an R* that is never reached.

    Parameters
    ----------
    distance
        R* in m.
    speed
        v0 in m/s.
    stokes_time
        tau in s.
    """
    fraction = _ratio(distance, stokes_terminal_radius(speed, stokes_time))
    stretch = np.where(fraction < 1.0, _log1p_ratio(-np.where(fraction < 1.0, fraction, 0)), np.inf)
    return (_ratio(distance, speed) * stretch)[()]


def force_ratio(
    velocity: ArrayLike,
    *,
    charge_per_mass: ArrayLike,
    radius: ArrayLike,
    density: ArrayLike,
    electric: ArrayLike,
    magnetic: ArrayLike,
    medium_density: ArrayLike,
    drag_coefficient: ArrayLike,
    medium_velocity: ArrayLike = (0.0, 0.0, 0.0),
) -> Any:
    """lambda(v) = |q (E + v x B)| / |F_drag| (eq. 5.4), shape (...).

    Infinite where there is no drag; undefined (nan) where both forces vanish.

    Parameters
    ----------
    velocity
        v in m/s, shape (..., 3).
    charge_per_mass
        q/m in C/kg.
    radius
        R in m.
    density
        rho_p of the particle in kg/m3.
    electric
        E in V/m, shape (3,) or (..., 3).
    magnetic
        B in T, shape (3,) or (..., 3).
    medium_density
        rho_f in kg/m3.
    drag_coefficient
        C_D.
    medium_velocity
        v_f in m/s, shape (3,) or (..., 3).
    """
    velocity = np.asarray(velocity, dtype=float)
    field = np.linalg.norm(np.asarray(electric) + np.cross(velocity, np.asarray(magnetic)), axis=-1)
    relative_speed = np.linalg.norm(np.asarray(medium_velocity) - velocity, axis=-1)
    parity = parity_electric_field(
        relative_speed,
        charge_per_mass=charge_per_mass,
        radius=radius,
        density=density,
        medium_density=medium_density,
        drag_coefficient=drag_coefficient,
    )
    return _ratio(field, parity)


def force_ratio_bound(
    speed: ArrayLike,
    *,
    charge_per_mass: ArrayLike,
    radius: ArrayLike,
    density: ArrayLike,
    electric: ArrayLike,
    magnetic: ArrayLike,
    medium_density: ArrayLike,
    drag_coefficient: ArrayLike,
    relative_speed: ArrayLike | None = None,
) -> Any:
    """Upper bound of `force_ratio`, with |E| + |v| |B| in place of |E + v x B| (eq. 5.5).

    Parameters
    ----------
    speed
        |v| in m/s.
    relative_speed
        |v_f - v| in m/s; by default |v|, a medium at rest.

    The other arguments are as for `force_ratio`.
    """
    fields = [np.linalg.norm(field, axis=-1) for field in (electric, magnetic)]
    parity = parity_electric_field(
        speed if relative_speed is None else relative_speed,
        charge_per_mass=charge_per_mass,
        radius=radius,
        density=density,
        medium_density=medium_density,
        drag_coefficient=drag_coefficient,
    )
    return _ratio(fields[0] + np.asarray(speed) * fields[1], parity)


def parity_electric_field(
    relative_speed: ArrayLike,
    *,
    charge_per_mass: ArrayLike,
    radius: ArrayLike,
    density: ArrayLike,
    medium_density: ArrayLike,
    drag_coefficient: ArrayLike,
) -> Any:
    """|E| that alone equals the drag, in V/m (eq. 5.7).

    3 C_D rho_f |v_f - v|^2 / (8 |q/m| rho_p R), with `drag_constant` for its first factors.
    Infinite for an uncharged particle.

    Parameters
    ----------
    relative_speed
        |v_f - v| in m/s.
    charge_per_mass
        q/m in C/kg.
    radius
        R in m.
    density
        rho_p of the particle in kg/m3.
    medium_density
        rho_f in kg/m3.
    drag_coefficient
        C_D.
    """
    deceleration = drag_constant(drag_coefficient, medium_density, radius, density)
    deceleration = deceleration * np.asarray(relative_speed) ** 2
    return _ratio(deceleration, np.abs(charge_per_mass))


def parity_magnetic_field(
    speed: ArrayLike,
    *,
    charge_per_mass: ArrayLike,
    radius: ArrayLike,
    density: ArrayLike,
    medium_density: ArrayLike,
    drag_coefficient: ArrayLike,
    relative_speed: ArrayLike | None = None,
) -> Any:
    """Smallest |B| that alone can equal the drag, the field of eq. 5.7 over |v|, in T (eq. 5.8).

    Parameters
    ----------
    speed
        |v| in m/s.
    relative_speed
        |v_f - v| in m/s; by default |v|, a medium at rest.

    The other arguments are as for `parity_electric_field`.
    """
    parity = parity_electric_field(
        speed if relative_speed is None else relative_speed,
        charge_per_mass=charge_per_mass,
        radius=radius,
        density=density,
        medium_density=medium_density,
        drag_coefficient=drag_coefficient,
    )
    return _ratio(parity, speed)


@dataclass(frozen=True)
class SlowingPhase:
    """A stretch of time in which dv/dt = -rate * speed * (v/speed)^exponent.

    Every law here is one such phase, but for Chow's, which is one a piece of eq. 4.2: within a
    piece C_D is a power of the speed, and the speed only falls.

    Attributes
    ----------
    start
        Time at which the phase begins, s.
    speed
        At its start, m/s.
    rate
        -(dv/dt)/v at its start, 1/s.
    exponent
        1 for Stokes drag, 2 for a constant C_D.
    duration
        s; infinite for the last phase.
    """

    start: float
    speed: float
    rate: float
    exponent: float
    duration: float = np.inf

    def speed_after(self, elapsed: Floats) -> Floats:
        """Speed at a time since the start of the phase, m/s (eq. 4.10, A.5)."""
        if self.exponent == 1.0:
            return self.speed * np.exp(-self.rate * elapsed)
        growth = self.exponent - 1.0
        return self.speed * np.exp(-np.log1p(growth * self.rate * elapsed) / growth)

    def path_after(self, elapsed: Floats) -> Floats:
        """Distance covered since the start of the phase, m (eq. 4.11, A.6)."""
        if self.exponent == 1.0:
            return self.speed * elapsed * _expm1_ratio(-self.rate * elapsed)
        growth = (self.exponent - 1.0) * self.rate * elapsed
        log_fall = np.log1p(growth) / (self.exponent - 1.0)
        shape = _expm1_ratio((self.exponent - 2.0) * log_fall)
        return self.speed * elapsed * _log1p_ratio(growth) * shape

    def turned_path_after(self, elapsed: Floats, omega: float) -> Complexes:
        """Integral of speed * exp(-i omega t) since the start of the phase, m."""
        if self.exponent == 1.0:
            decay = self.rate + 1j * omega
            return self.speed * elapsed * _expm1_ratio(-decay * elapsed)
        growth = self.exponent - 1.0
        return self.speed * _turned_decay(elapsed, growth * self.rate, 1.0 / growth, omega)


def speed_history(
    times: ArrayLike, speed: float, *, radius: float, mass: float, drag: DragLaw
) -> Floats:
    """Speed s(t) of a particle under drag alone, in m/s (eq. 4.10, A.5; piecewise for Chow).

    A magnetic field does not change it.

    Parameters
    ----------
    times
        s, any shape.
    speed
        At time zero, m/s.
    radius
        R in m.
    mass
        m in kg.
    drag
        The law; the medium is at rest.

    Raises
    ------
    ValueError
        A negative time or speed, a radius or mass that is not positive.
    """
    times = _checked_times(times)
    history = np.full(times.shape, float(speed))
    for phase in slowing_phases(speed, radius=radius, mass=mass, drag=drag):
        elapsed = np.maximum(times - phase.start, 0.0)
        history = np.where(times >= phase.start, phase.speed_after(elapsed), history)
    return history


def launch_displacement(
    times: ArrayLike,
    speed: float,
    cyclotron_frequency: float,
    *,
    radius: float,
    mass: float,
    drag: DragLaw,
) -> tuple[Floats, Complexes]:
    """The two numbers of the spheroid theorem (see the module's text), exact for every law.

    A particle launched along the unit vector n moves by d_parallel (n.b) b plus the part of n
    normal to b = B/|B|, scaled by |d_perpendicular| and turned about b by its argument. With a
    constant C_D, kappa = omega/(K v0) and U = 1 + K v0 t, this is
    d_perpendicular = exp(i kappa) [E_1(i kappa) - E_1(i kappa U)] / K.

    Parameters
    ----------
    times
        s, any shape.
    speed
        v0 at launch, m/s.
    cyclotron_frequency
        omega in rad/s, either sign, or zero.
    radius
        R of the particle in m.
    mass
        m of the particle in kg.
    drag
        The law; the medium is at rest.

    Returns
    -------
    tuple of ndarray
        d_parallel in m, real, and d_perpendicular in m, complex; both of the shape of times.

    Raises
    ------
    ValueError
        A negative time or speed, a radius or mass that is not positive.
    """
    times = _checked_times(times)
    parallel = np.zeros(times.shape)
    perpendicular = np.zeros(times.shape, dtype=complex)
    omega = abs(float(cyclotron_frequency))
    for phase in slowing_phases(speed, radius=radius, mass=mass, drag=drag):
        elapsed = np.clip(times - phase.start, 0.0, phase.duration)
        parallel += phase.path_after(elapsed)
        turn = np.exp(-1j * omega * phase.start)
        perpendicular += turn * phase.turned_path_after(elapsed, omega)
    return parallel, perpendicular if cyclotron_frequency >= 0 else perpendicular.conj()


def terminal_displacement(
    speed: float, cyclotron_frequency: float, *, radius: float, mass: float, drag: DragLaw
) -> tuple[float, complex]:
    """`launch_displacement` in the limit of infinite time, in m.

    For Stokes drag v0 tau and v0 / (1/tau + i omega); Chow's law ends in Stokes drag, so it has
    a limit as well.

    Raises
    ------
    ValueError
        A law under which the particle never comes to rest within a finite distance.
    """
    *_, last = slowing_phases(speed, radius=radius, mass=mass, drag=drag)
    if last.exponent != 1.0 or last.rate == 0.0:
        raise ValueError(f"{drag.kind} drag: the particle travels without limit")
    parallel, perpendicular = launch_displacement(
        last.start, speed, cyclotron_frequency, radius=radius, mass=mass, drag=drag
    )
    turn = np.exp(-1j * cyclotron_frequency * last.start)
    rest = turn * last.speed / (last.rate + 1j * cyclotron_frequency)
    return float(parallel + last.speed / last.rate), complex(perpendicular + rest)


def spheroid_semi_axes(
    launch_radius: ArrayLike, d_parallel: ArrayLike, d_perpendicular: ArrayLike
) -> tuple[Any, Any]:
    """Semi-axes along and across B of the spheroid that a sphere of launch points becomes, m.

    a_parallel = R0 + d_parallel and a_perpendicular = |R0 + d_perpendicular|.

    Parameters
    ----------
    launch_radius
        R0 in m, of the sphere of launch points about the centre of mass.
    d_parallel
        m, from `launch_displacement`.
    d_perpendicular
        m, complex, from `launch_displacement`.
    """
    radius = np.asarray(launch_radius, dtype=float)
    return radius + np.asarray(d_parallel), np.abs(radius + np.asarray(d_perpendicular))


def terminal_spheroid(
    launch_radius: float,
    speed: float,
    cyclotron_frequency: float,
    *,
    radius: float,
    mass: float,
    drag: DragLaw,
) -> tuple[float, float]:
    """Semi-axes along and across B, in m, of the spheroid in which everything comes to rest.

    From a point (R0 = 0) under Stokes drag its aspect ratio is sqrt(1 + omega^2 tau^2).

    Raises
    ------
    ValueError
        As `terminal_displacement`: there is none for no drag and for a constant C_D.
    """
    displacement = terminal_displacement(
        speed, cyclotron_frequency, radius=radius, mass=mass, drag=drag
    )
    parallel, perpendicular = spheroid_semi_axes(launch_radius, *displacement)
    return float(parallel), float(perpendicular)


def slowing_phases(
    speed: float, *, radius: float, mass: float, drag: DragLaw
) -> tuple[SlowingPhase, ...]:
    """The stretches of power-law slowing that make up the motion under drag alone.

    Parameters
    ----------
    speed
        At launch, m/s.
    radius
        R in m.
    mass
        m in kg.
    drag
        The law; the medium is at rest.

    Raises
    ------
    ValueError
        A negative speed, a radius or mass that is not positive.
    """
    if not 0.0 <= speed < np.inf:
        raise ValueError(f"speed {speed} m/s: it must be finite and >= 0")
    if not (0.0 < radius < np.inf and 0.0 < mass < np.inf):
        raise ValueError(f"radius {radius} m and mass {mass} kg must be finite and > 0")
    if drag.kind == "chow":
        return tuple(_chow_phases(float(speed), radius, mass, drag))
    rate = float(drag_resistance(speed, radius, drag)) / mass
    # A constant C_D without a rate (no medium, no speed) is free flight.
    exponent = 2.0 if drag.kind == "constant" and rate > 0.0 else 1.0
    return (SlowingPhase(0.0, float(speed), rate, exponent),)


def _chow_phases(speed: float, radius: float, mass: float, drag: DragLaw) -> Iterator[SlowingPhase]:
    """One phase a piece of eq. 4.2, from the launch down to Stokes drag."""
    reynolds = float(reynolds_number(speed, radius, drag.density, drag.viscosity))
    start = 0.0
    for piece in range(int(np.searchsorted(CHOW_LIMITS, reynolds)), 0, -1):
        exponent = 2.0 - CHOW_POWERS[piece]
        # Reynolds number is proportional to speed: the piece's lower limit is a speed.
        slowest = float(CHOW_LIMITS[piece - 1]) * drag.viscosity / (2.0 * radius * drag.density)
        coefficient = CHOW_FACTORS[piece] * reynolds ** -CHOW_POWERS[piece]
        rate = 0.5 * drag.density * coefficient * np.pi * radius**2 * speed / mass
        with np.errstate(divide="ignore"):
            log_fall = np.log(np.divide(speed, slowest))
        duration = np.expm1((exponent - 1.0) * log_fall) / ((exponent - 1.0) * rate)
        yield SlowingPhase(start, speed, float(rate), float(exponent), float(duration))
        if np.isinf(duration):
            return
        start, speed, reynolds = start + float(duration), slowest, float(CHOW_LIMITS[piece - 1])
    rate = 6.0 * np.pi * drag.viscosity * radius / mass
    yield SlowingPhase(start, speed, rate, 1.0)


def _checked_times(times: ArrayLike) -> Floats:
    times = np.asarray(times, dtype=float)
    if not (np.isfinite(times) & (times >= 0.0)).all():
        raise ValueError("times must be finite and >= 0")
    return times


def _turned_decay(elapsed: Floats, rate: float, power: float, omega: float) -> Complexes:
    """Integral over [0, t] of (1 + rate t)^-power exp(-i omega t) dt, for omega >= 0, in s.

    In closed form it is a difference of two exponential integrals E_power. That difference
    cancels after a small angle, and library E_1s lose digits at large arguments. So: quadrature
    for as long as the phase is small, and from there on the difference of two asymptotic tails,
    each exact to rounding. With a large angle behind it the difference costs no digits.
    """
    angle = omega * elapsed
    near = angle <= ASYMPTOTIC_PHASE
    # Where the tail's argument omega (1/rate + t) reaches the asymptotic range.
    first = max(0.0, ASYMPTOTIC_PHASE / omega - 1.0 / rate) if omega > 0.0 else 0.0
    integral = _turned_decay_quadrature(np.where(near, elapsed, first), rate, power, omega)
    if near.all():
        return integral
    tail = _turned_decay_tail(np.array(first), rate, power, omega) * np.exp(-1j * omega * first)
    far = np.where(near, first, elapsed)
    tails = tail - np.exp(-1j * omega * far) * _turned_decay_tail(far, rate, power, omega)
    return np.where(near, integral, integral + tails)


def _turned_decay_tail(start: Floats, rate: float, power: float, omega: float) -> Complexes:
    """The same integral over [start, infinity), its phase counted from the start, in s.

    The asymptotic series of exp(z) z E_power(z): sum of (-1)^n power (power+1) ... / z^n.
    """
    growth = 1.0 + rate * start
    step = 1j * rate / (omega * growth)  # -1/z, with z = i omega growth / rate
    series = np.ones(np.shape(start), dtype=complex)
    for n in range(ASYMPTOTIC_TERMS, 0, -1):
        series = 1.0 + (power + n - 1.0) * step * series
    return np.asarray(growth**-power * series / (1j * omega), dtype=complex)


def _turned_decay_quadrature(elapsed: Floats, rate: float, power: float, omega: float) -> Complexes:
    """The same integral over [0, t] by Gauss-Legendre panels, for phases up to about 40 rad.

    The panels grow in proportion to 1 + rate t, at most twofold, so that forty nodes a panel
    resolve both the decay (its singularity stays outside) and the turning.
    """
    log_growth = np.log1p(rate * elapsed)
    panels = max(2, int(np.ceil(log_growth.max(initial=0.0) / np.log(2.0))))
    integral = np.zeros(elapsed.shape, dtype=complex)
    left = np.zeros_like(elapsed)
    for panel in range(1, panels + 1):
        share = panel / panels
        # elapsed * expm1(share x)/expm1(x), without dividing zero by zero
        stretch = _expm1_ratio(share * log_growth) / _expm1_ratio(log_growth)
        right = elapsed * share * stretch if panel < panels else elapsed
        half = 0.5 * (right - left)
        t = (left + half)[..., None] + half[..., None] * GAUSS_NODES
        values = np.exp(-power * np.log1p(rate * t) - 1j * omega * t)
        integral += half * (values @ GAUSS_WEIGHTS)
        left = right
    return integral


def main(argv: Sequence[str] | None = None) -> int:
    """`python -m lammps_blast.theory case.yaml [--json]`: print a case's derived numbers.

    Returns
    -------
    int
        The exit status: 0, or 2 for a case that is invalid (its message is on stderr).
    """
    # Imported here: the closed forms above are of use without case files.
    from lammps_blast.case import CaseError, load_case
    from lammps_blast.command_line import DONE, INVALID, tell
    from lammps_blast.derived_numbers import derive_numbers

    parser = argparse.ArgumentParser(
        prog="python -m lammps_blast.theory",
        description="Print what theory says about a case, without running it.",
    )
    parser.add_argument("case", help="case file (YAML)")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    arguments = parser.parse_args(argv)
    try:
        numbers = derive_numbers(load_case(arguments.case))
    except CaseError as error:
        tell(error, sys.stderr)
        return INVALID
    if arguments.json:
        print(numbers.to_json())
    else:
        numbers.print_table()
    return DONE


if __name__ == "__main__":
    sys.exit(main())
