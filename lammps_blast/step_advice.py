"""Advice on the time step of a case: what has to be resolved in time, and how long it takes.

Each process that a step must resolve is a :class:`TimeScale`. Interactions are judged at the
deepest overlap to be expected: two particles that meet head on at the speed of the launch or of a
collapse under the near field of all pairs, and at least `ADMISSIBLE_STRAIN`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from lammps_blast import interactions, theory
from lammps_blast.case import WHOLE_STEPS_TOLERANCE, Bond, Case, Contact
from lammps_blast.pairs import (
    PairKinds,
    elastic_law,
    near_field_law,
    near_field_sources,
    pair_kinds,
)
from lammps_blast.particles import Particles
from lammps_blast.spheroid import drag_law
from lammps_blast.theory import Floats

# An overlap of a tenth of the distance of the centres: beyond it no contact law is meant to hold.
ADMISSIBLE_STRAIN = 0.1

# Steps that a time scale must hold at least.
# With fifty a half swing velocity-Verlet gets periods right to 0.02 %; below 1.6 it is unstable.
STEPS_PER_HALF_SWING = 50
# Kicks take the velocity of the last half step: of damping in a tenth of its time they make five
# per cent too much, in more than its time they turn the motion round.
STEPS_PER_DAMPING = 10
# Regularised friction takes the part (step/time)^2 off the slip in a step: a ninth.
STEPS_PER_STICK = 3
# Equal particles that meet head on are first seen at a strain of no more than a tenth.
STEPS_PER_CROSSING = 10
# The paper has 628 steps a gyration; with fewer than this, velocity-Verlet is off in the picture.
STEPS_PER_GYRATION = 20
# With a radian a step what other forces do between exact turns is off by a twelfth; with half a
# turn it vanishes, with a whole one it resonates.
STEPS_PER_EXACT_GYRATION = 6
# Drag and drift are split in a step; at this part of the time of slowing paths are off by 1e-3.
STEPS_PER_SLOWING = 10

# The particles of whose neighbours the near field is summed for an estimate.
SAMPLED_PARTICLES = 16
# Of the volume of a dense cloud, random close packing.
DENSE_FRACTION = 0.64
# Of the mass of a solid sphere that is pushed at its edge (I = 2/5 m R^2).
TURNING_PART = 2.0 / 7.0
# Digits of a step that reads well, and how much shorter than it may be it is made for that.
ROUND_STEPS = (5.0, 2.5, 2.0, 1.0)
SHORTEST_ROUND_STEP = 0.25
# Stiffness and area may be largest before the greatest depth, where a sphere is being swallowed.
DEPTHS = np.linspace(0.1, 1.0, 10)[:, None]


@dataclass(frozen=True)
class TimeScale:
    """A process that the time step has to resolve.

    Attributes
    ----------
    name
        Such as `contact`.
    seconds
        How long it takes.
    reason
        What happens in this time and what a step too long does, to follow "the 0.1 s".
    steps
        How many steps it must hold at least.
    """

    name: str
    seconds: float
    reason: str
    steps: float

    @property
    def longest_step(self) -> float:
        """The longest step in s that resolves it."""
        return self.seconds / self.steps


def time_scales(case: Case, particles: Particles) -> list[TimeScale]:
    """Return what the step of a case has to resolve; what takes forever is left out.

    Parameters
    ----------
    case
        Its interactions, medium and fields.
    particles
        Before the pulse.
    """
    # Absurd magnitudes overflow, and without a force a time is infinite.
    with np.errstate(all="ignore"):
        scales = [*_drag_scales(case, particles), *_gyration_scales(case, particles)]
        if case.interacts and len(particles) > 1:
            scales += _interaction_scales(case, particles)
    return [scale for scale in scales if 0.0 < scale.seconds < np.inf]


def advised_step(case: Case, particles: Particles) -> tuple[float, TimeScale] | None:
    """Return a step in s that resolves all time scales, and the scale that limits it.

    The step is round where it can be. One of constant length divides the duration, and where it can
    the intervals of output, into whole steps. None where nothing limits the step.
    """
    scales = time_scales(case, particles)
    if not scales:
        return None
    limiting = min(scales, key=lambda scale: scale.longest_step)
    return _fitting_step(case, limiting.longest_step), limiting


def step_key(case: Case) -> str:
    """Return the key of a case that says how long a step may be."""
    return "time.implicit.max_step" if case.time.integrator == "implicit" else "time.step"


def step_warnings(case: Case, particles: Particles) -> Iterator[str]:
    """Yield what is wrong with the step of a case, before it runs."""
    step, key = case.time.longest_step, step_key(case)
    scales = sorted(time_scales(case, particles), key=lambda scale: scale.longest_step)
    unresolved = [s for s in scales if step > s.longest_step * (1.0 + WHOLE_STEPS_TOLERANCE)]
    if not unresolved:
        return
    worst, *others = unresolved
    also = f"; also too long for: {', '.join(scale.name for scale in others)}" if others else ""
    yield (
        f"{key} is {step / worst.seconds:.2g} times the {worst.seconds:.2g} s {worst.reason}; "
        f"take {_part(worst.steps)} of that time or less, such as {key}: "
        f"{_fitting_step(case, worst.longest_step):.9g}{also}"
    )


def _part(steps: float) -> str:
    return "a tenth" if steps == 10 else f"1/{steps:g}"


def _fitting_step(case: Case, longest: float) -> float:
    """Return the longest round step up to a limit that divides what it should divide.

    Steps that adapt are cut where they have to be.
    """
    duration = case.time.duration
    intervals = [time for time in (case.output.interval, case.output.restart_interval) if time]
    longest = min(longest, duration, *intervals)
    decade = 10.0 ** math.floor(math.log10(longest))
    steps = (digit * decade / down for down in (1.0, 10.0) for digit in ROUND_STEPS)
    shortest = SHORTEST_ROUND_STEP * longest
    rounded = [step for step in steps if shortest <= step <= longest]
    if case.time.integrator == "implicit":
        return float(f"{rounded[0]:.12g}")
    for lengths in ((duration, *intervals), (duration,)):
        for step in (longest, *rounded):
            if all(_divides(step, length) for length in lengths):
                return float(f"{step:.12g}")
    return duration / math.ceil(duration / longest)


def _divides(step: float, length: float) -> bool:
    steps = length / step
    return abs(steps - round(steps)) <= WHOLE_STEPS_TOLERANCE * steps


def launch_speed(case: Case, particles: Particles) -> float:
    """Return the speed in m/s that no particle exceeds right after the pulse (eq. 3.4).

    It is that relative to the mean velocity, which all share.
    """
    own = particles.velocity - particles.velocity.mean(axis=0)
    return _pulse_speed(case, particles) + float(np.linalg.norm(own, axis=1).max())


def largest_velocity(case: Case, particles: Particles) -> float:
    """Return the speed in m/s that no particle exceeds right after the pulse, drift included."""
    return _pulse_speed(case, particles) + float(np.linalg.norm(particles.velocity, axis=1).max())


def expected_speed(case: Case, particles: Particles) -> float:
    """Return the speed in m/s at which particles are expected to meet others.

    That of the launch, or what the near field of all pairs gives to a cloud that it draws together.
    """
    return max(launch_speed(case, particles), _collapse_speed(case, particles))


def _collapse_speed(case: Case, particles: Particles) -> float:
    """Return sqrt(2 dU/M) in m/s, where dU is set free as the cloud shrinks to a dense one."""
    field = case.near_field
    if field is None or field.cutoff != "all":
        return 0.0
    law = near_field_law(field)
    sources = near_field_sources(
        case, particles.radius, particles.mass, particles.charge, particles.sign
    )
    centre = particles.position.mean(axis=0)
    width = float(np.linalg.norm(particles.position - centre, axis=1).max())
    dense = float(np.sum(particles.radius**3) / DENSE_FRACTION) ** (1 / 3)
    shrinking = min(1.0, dense / width) if width > 0.0 else 1.0
    places = _sample(len(particles))
    released = 0.0
    for index in places:
        distance = np.linalg.norm(particles.position - particles.position[index], axis=1)
        others = distance > 0.0
        touch = particles.radius[others] + particles.radius[index]
        before = np.maximum(distance[others], touch)
        product = sources[index] * sources[others]
        after = np.maximum(shrinking * before, touch)
        energies = (interactions.near_field_energy(d, product, law).sum() for d in (before, after))
        released += float(next(energies) - next(energies))
    # Each pair is seen from both of its particles.
    per_particle = 0.5 * released / len(places)
    return math.sqrt(2.0 * max(per_particle, 0.0) / float(particles.mass.mean()))


def _sample(count: int) -> Any:
    """Return the indices of a few particles out of many, evenly spaced."""
    return np.unique(np.linspace(0, count - 1, SAMPLED_PARTICLES).round().astype(int))


def _pulse_speed(case: Case, particles: Particles) -> float:
    if case.blast is None:
        return 0.0
    return float(theory.pulse_speed(case.blast.energy, particles.mass.sum()))


def _interaction_scales(case: Case, particles: Particles) -> Iterator[TimeScale]:
    sources = near_field_sources(
        case, particles.radius, particles.mass, particles.charge, particles.sign
    )
    pairs = pair_kinds(particles.radius, particles.mass, sources)
    speed = expected_speed(case, particles)
    yield from contact_scales(case, pairs, speed)
    yield from _near_field_scales(case, particles, sources, pairs)
    if case.contact:
        yield from _crossing_scales(particles, speed)


def expected_strain(case: Case, pairs: PairKinds, speed: float) -> Floats:
    """Return the strain that pairs reach that meet head on, each at a speed in m/s; (P,).

    From the balance of energy, with neither damping nor bond; at most one half. It needs `contact`.
    """
    assert case.contact is not None
    energy = 0.5 * pairs.effective_mass * (2.0 * speed) ** 2
    return elastic_law(case.contact, pairs).strain_at_energy(energy)


def contact_scales(case: Case, pairs: PairKinds, speed: float) -> Iterator[TimeScale]:
    """Yield the time scales of contact, friction and bonds.

    Parameters
    ----------
    pairs
        The kinds of pairs among which the shortest times are looked for.
    speed
        At which particles are expected to meet others, m/s.
    """
    contact = case.contact
    if contact is None:
        return
    strain = np.maximum(expected_strain(case, pairs, speed), ADMISSIBLE_STRAIN)
    stiffness = elastic_law(contact, pairs).stiffness(strain * DEPTHS).max(axis=0)
    area = pairs.lens_area(strain * DEPTHS).max(axis=0)
    yield _swing("contact", pairs.effective_mass, stiffness, strain, "two particles in contact")
    yield from _damping_scales(contact, pairs, area)
    if contact.is_stock:
        yield from _stock_friction_scales(contact, pairs, strain, stiffness)
        return
    # A solid sphere turns as its edge is pushed: only a part of its mass resists.
    slipping = pairs.effective_mass * (TURNING_PART if contact.rotation else 1.0)
    if contact.friction:
        yield _stick("friction", slipping, contact.friction.stiffness * area)
    if case.bond:
        yield from _bond_scales(case.bond, pairs, strain)
        yield _stick("bond friction", slipping, case.bond.tangential_stiffness * area)


def _swing(name: str, mass: Floats, stiffness: Floats, strain: Floats, what: str) -> TimeScale:
    """Return the shortest half period pi sqrt(m/k) of some oscillators."""
    seconds = np.pi * np.sqrt(mass / np.maximum(stiffness, 0.0))
    shortest = int(np.argmin(seconds))
    reason = f"of half a swing of {what} at a strain of {strain[shortest]:.2g}"
    ending = "their bounce comes out wrong, or grows without limit"
    return TimeScale(name, float(seconds[shortest]), f"{reason}: {ending}", STEPS_PER_HALF_SWING)


def _damping_scales(contact: Contact, pairs: PairKinds, area: Floats) -> Iterator[TimeScale]:
    if contact.damping == 0.0:
        return
    coefficient = contact.damping * (1.0 if contact.is_stock else area)
    yield TimeScale(
        "dissipation",
        float(np.min(pairs.effective_mass / coefficient)),
        "in which dissipation stops two particles in contact: it may drive them instead",
        STEPS_PER_DAMPING,
    )


def _stock_friction_scales(
    contact: Contact, pairs: PairKinds, strain: Floats, stiffness: Floats
) -> Iterator[TimeScale]:
    if contact.friction is None:
        return
    spring: Any = contact.friction.stiffness
    if spring is None:
        # Mindlin's 8 G* a beside Hertz's 2 E* a.
        poisson = contact.poisson_ratio or 0.0
        spring = 2.0 * (1.0 - poisson) / (2.0 - poisson) * stiffness
    mass = TURNING_PART * pairs.effective_mass
    yield _swing("friction", mass, spring, strain, "the slip of two particles in contact")


def _stick(name: str, mass: Floats, spring: Floats) -> TimeScale:
    """Return the time sqrt(m/(K A)): a step dt takes (dt/time)^2 off the slip (eq. 7.12, 7.17)."""
    seconds = np.sqrt(mass / spring)
    reason = f"of a step whose {name} reverses the slip: particles in contact shiver"
    return TimeScale(name, float(seconds.min()), reason, STEPS_PER_STICK)


def _bond_scales(bond: Bond, pairs: PairKinds, strain: Floats) -> Iterator[TimeScale]:
    distance = pairs.reach * (1.0 - strain * DEPTHS)
    stiffness = interactions.contact_stiffness(
        distance, pairs.radius_i, pairs.radius_j, bond.stiffness, bond.exponent
    ).max(axis=0)
    yield _swing("bond", pairs.effective_mass, stiffness, strain, "two bonded particles")


def _near_field_scales(
    case: Case, particles: Particles, sources: Floats, pairs: PairKinds
) -> Iterator[TimeScale]:
    if case.near_field is None:
        return
    law = near_field_law(case.near_field)
    touch = pairs.reach
    where = "at touch"
    if case.contact is None:
        closest = closest_distance(particles.position)
        touch, where = np.full_like(touch, closest), f"at {closest:.2g} m, the closest of the start"
    gradient = np.abs(interactions.near_field_gradient(touch, pairs.source_product, law))
    pair = float(np.min(np.pi * np.sqrt(pairs.effective_mass / gradient)))
    ending = "their orbits come out wrong, or gain energy"
    yield TimeScale(
        "near field",
        pair,
        f"of half a swing of two particles in their near field {where}: {ending}",
        STEPS_PER_HALF_SWING,
    )
    yield TimeScale(
        "near field of all",
        _near_field_swing(particles, sources, law),
        f"of half a swing of a particle in the near field of all others at the start: {ending}",
        STEPS_PER_HALF_SWING,
    )


def closest_distance(position: Floats) -> float:
    """Return the smallest distance in m of two of some points, (N, 3) in m."""
    distance, _ = cKDTree(position).query(position, k=2)
    return float(distance[:, 1].min())


def _near_field_swing(
    particles: Particles, sources: Floats, law: interactions.NearFieldLaw
) -> float:
    """Return pi sqrt(m / sum of |dF/dd| over all others) in s, the shortest of some particles."""
    shortest = np.inf
    for index in _sample(len(particles)):
        distance = np.linalg.norm(particles.position - particles.position[index], axis=1)
        near = (distance < law.cutoff) & (distance > 0.0)
        product = sources[index] * sources[near]
        gradient = np.abs(interactions.near_field_gradient(distance[near], product, law)).sum()
        if gradient > 0.0:
            shortest = min(shortest, np.pi * float(np.sqrt(particles.mass[index] / gradient)))
    return shortest


def _crossing_scales(particles: Particles, speed: float) -> Iterator[TimeScale]:
    if speed > 0.0:
        yield TimeScale(
            "crossing",
            float(particles.radius.min()) / speed,
            "in which the fastest particle crosses the radius of the smallest: collisions are "
            "missed, or begin too deep",
            STEPS_PER_CROSSING,
        )


def _gyration_scales(case: Case, particles: Particles) -> Iterator[TimeScale]:
    """The integrator `lorentz` turns velocities exactly, but other forces act between its turns."""
    integrator, steps = case.time.integrator, STEPS_PER_GYRATION
    if integrator == "verlet":
        reason = "which verlet has to resolve: circles come out wrong and grow"
    elif integrator == "implicit":
        reason = "which implicit has to resolve: circles come out late"
    elif case.interacts or np.cross(case.fields.electric, case.fields.magnetic).any():
        reason = "between other forces: drifts come out wrong, or grow with one step a turn"
        steps = STEPS_PER_EXACT_GYRATION
    else:
        return
    omega = theory.cyclotron_frequency(particles.charge_per_mass, case.fields.magnetic)
    period = float(np.min(theory.cyclotron_period(omega)))
    yield TimeScale("gyration", period, f"of a gyration, {reason}", steps)


def _drag_scales(case: Case, particles: Particles) -> Iterator[TimeScale]:
    medium = case.medium
    relative = np.linalg.norm(particles.velocity - medium.velocity, axis=1)
    relative = _pulse_speed(case, particles) + relative
    resistance = theory.drag_resistance(relative, particles.radius, drag_law(medium))
    slowing = float(np.max(resistance / particles.mass))
    if slowing > 0.0:
        reason = "in which drag slows a particle: paths come out wrong"
        yield TimeScale("drag", 1.0 / slowing, reason, STEPS_PER_SLOWING)
