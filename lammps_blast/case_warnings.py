"""What there is to say of a case before it runs: errors that need its particles, and warnings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lammps_blast import interactions, theory
from lammps_blast.case import (
    WHOLE_STEPS_TOLERANCE,
    Bond,
    Case,
    CaseError,
    Contact,
    Implicit,
    NearField,
)
from lammps_blast.interactions import LARGEST_STRAIN
from lammps_blast.pairs import (
    PairKinds,
    equilibrium_overlaps,
    near_field_law,
    near_field_sources,
    pair_kinds,
    softened_stiffness,
)
from lammps_blast.particles import Particles
from lammps_blast.step_advice import (
    advised_step,
    expected_speed,
    expected_strain,
    largest_velocity,
    step_key,
    step_warnings,
)
from lammps_blast.theory import Floats

# Of the energy of gyration that a rule of time stepping may take or give in a run.
LARGEST_GAIN = 1e-3


def check_near_field(case: Case, particles: Particles) -> None:
    """Refuse a near field that presses particles together beyond what the contact can carry.

    Raises
    ------
    CaseError
        If some pair has no equilibrium at any strain below one half.
    """
    if case.contact is None or case.near_field is None or len(particles) < 2:
        return
    sources = near_field_sources(
        case, particles.radius, particles.mass, particles.charge, particles.sign
    )
    pairs = pair_kinds(particles.radius, particles.mass, sources)
    law = near_field_law(case.near_field)
    with np.errstate(all="ignore"):
        force = interactions.near_field_force(pairs.reach, pairs.source_product, law)
        _check_size(force)
        overlaps = equilibrium_overlaps(case.contact, law, pairs)
    for pair, overlap in zip(pairs, overlaps, strict=True):
        if overlap is None:
            raise CaseError(_diverges(case.near_field, case.contact, pair))


def _check_size(force: Floats) -> None:
    if not np.isfinite(force).all():
        raise CaseError(
            "near_field: the force between two particles that touch is beyond the range of "
            "floating-point numbers; check the strengths, the exponents and the units"
        )


def _diverges(near_field: NearField, contact: Contact, pair: PairKinds) -> str:
    # Between particles of unlike sign the repulsion is what attracts.
    term = "attraction" if pair.source_product > 0.0 else "repulsion"
    strength = getattr(near_field, term).strength
    law = near_field_law(near_field)
    force = interactions.near_field_force(pair.reach, pair.source_product, law)
    stiffness = "youngs_modulus" if contact.stiffness is None else "stiffness"
    return (
        f"near_field.{term}.strength: the near field presses two particles of radii "
        f"{pair.radius_i:g} and {pair.radius_j:g} m together, with {force:.3g} N at touch, and "
        f"their contact resists it at no strain below {LARGEST_STRAIN:g}; take a smaller strength "
        f"or a larger contact.{stiffness}, got {strength!r}"
    )


def remarks(case: Case, particles: Particles) -> Iterator[str]:
    """Yield what a user may want to know of a case that runs."""
    if case.interacts and (advised := advised_step(case, particles)):
        step, scale = advised
        yield (
            f"limiting time scale: {scale.name}, {scale.seconds:.3g} s; advised {step_key(case)} up"
            f" to {step:g} s"
        )
    if left := case.timesteps % case.output_every:
        last = (case.timesteps - left) * case.timestep
        yield f"output.interval does not divide time.duration: the last frame is at {last:g} s"


def case_warnings(case: Case, particles: Particles) -> Iterator[str]:
    """Yield what of a case is allowed, but hardly meant."""
    yield from step_warnings(case, particles)
    if case.time.integrator == "implicit" and case.time.implicit is not None:
        yield from _iteration_warnings(case, case.time.implicit, particles)
    yield from interaction_warnings(case, particles)


def _iteration_warnings(case: Case, scheme: Implicit, particles: Particles) -> Iterator[str]:
    longest = case.time.longest_step
    step = min(longest, case.timestep)
    if step < longest * (1.0 - WHOLE_STEPS_TOLERANCE):
        yield (
            f"time.implicit.max_step {longest:g} s is not reached: time.duration, output.interval "
            f"and output.restart_interval are together whole numbers of {case.timestep:g} s only, "
            "and steps are cut to end there; take intervals that are multiples of each other"
        )
    extent = float(np.abs(particles.position).max())
    motion = largest_velocity(case, particles) * step
    if motion > 0.0 and scheme.tolerance < (rounding := np.finfo(float).eps * extent / motion):
        yield (
            f"time.implicit.tolerance {scheme.tolerance:g} is below the rounding of positions, "
            f"{rounding:.1g} of what a step moves them: steps may not converge"
        )
    omega = theory.cyclotron_frequency(particles.charge_per_mass, case.fields.magnetic)
    gain = theory.trapezoid_gyration_gain(scheme.phi, float(np.abs(omega).max()) * step)
    with np.errstate(over="ignore"):
        overall = gain ** (case.time.duration / step)
    if abs(overall - 1.0) > LARGEST_GAIN:
        yield (
            f"time.implicit.phi {scheme.phi:g} multiplies the energy of gyration by {overall:.3g} "
            f"over the run, in steps of max_step; 0.5 keeps it"
        )


def interaction_warnings(case: Case, particles: Particles) -> Iterator[str]:
    """Yield what of a case's interactions is allowed, but hardly meant."""
    diameter = 2.0 * float(particles.radius.max())
    near_field = case.near_field
    if near_field is not None and near_field.cutoff != "all" and near_field.cutoff < diameter:
        yield (
            f"near_field.cutoff {near_field.cutoff:g} m is smaller than a particle diameter of "
            f"{diameter:g} m: such particles feel their near field only where they overlap"
        )
    bond, contact = case.bond, case.contact
    if contact is not None and len(particles) > 1:
        yield from _softness_warnings(case, particles)
    if bond is not None and contact is not None and bond_wins(bond, contact):
        yield (
            f"bond.stiffness {bond.stiffness:g} N/m2 with exponent {bond.exponent:g}: a bond pulls "
            f"harder than the contact pushes still at a strain of {LARGEST_STRAIN:g}: bonded "
            "particles fall into each other; take a smaller stiffness, or an exponent below "
            f"contact.exponent, {contact.exponent:g}"
        )
    if bond is not None and contact is not None and not can_bond_pull(bond, contact):
        yield (
            f"bond.stiffness {bond.stiffness:g} N/m2 with exponent {bond.exponent:g}: "
            "the bond cannot pull at any overlap, because the contact, with "
            f"{softened_stiffness(contact):g} N/m2 and exponent {contact.exponent:g}, "
            "always pushes harder; bonds only soften contacts"
        )


def _softness_warnings(case: Case, particles: Particles) -> Iterator[str]:
    pairs = pair_kinds(particles.radius, particles.mass, np.zeros(len(particles)))
    strain = float(expected_strain(case, pairs, expected_speed(case, particles)).max())
    if strain >= LARGEST_STRAIN:
        assert case.contact is not None
        key = "stiffness" if case.contact.youngs_modulus is None else "youngs_modulus"
        yield (
            f"contact.{key} is too small for the speed to be expected: two particles that meet "
            f"head on are pressed to half the sum of their radii or more; take a larger one"
        )


def bond_wins(bond: Bond, contact: Contact) -> bool:
    """Tell whether a bond is stronger than the contact at the largest strain meant."""
    assert contact.exponent is not None
    pull = bond.stiffness * LARGEST_STRAIN**bond.exponent
    return pull >= softened_stiffness(contact) * LARGEST_STRAIN**contact.exponent


def can_bond_pull(bond: Bond, contact: Contact) -> bool:
    """Tell whether a bond is stronger than the contact at some strain at which it acts.

    K_nb E^p_b > K_p E^p_p, whose two sides cross at most once, so the ends of the range decide.
    """
    assert contact.exponent is not None
    stiffness, exponent = softened_stiffness(contact), contact.exponent
    least = bond.activation_strain if bond.memory == "none" else 0.0
    if bond.stiffness == 0.0:
        return False
    with np.errstate(divide="ignore"):
        at_least = bond.stiffness * np.power(least, bond.exponent - exponent)
    return bool(max(at_least, bond.stiffness) > stiffness)
