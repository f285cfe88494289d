"""The pairs of particles that a case has, and the laws of its interactions for them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, Protocol

import numpy as np

from lammps_blast import interactions
from lammps_blast.case import Case, Contact, NearField
from lammps_blast.interactions import LARGEST_STRAIN, NearFieldLaw
from lammps_blast.theory import Floats

# Of this many particles by each of size, mass and source, all pairs together take milliseconds.
KINDS_BY_PROPERTY = 11


@dataclass(frozen=True)
class PairKinds:
    """P kinds of pairs of particles, each an entry of the (P,) arrays.

    Attributes
    ----------
    radius_i, radius_j
        m.
    effective_mass
        m_i m_j/(m_i + m_j) in kg.
    source_product
        What multiplies the strengths of the near field; zero where a case has none.
    """

    radius_i: Any
    radius_j: Any
    effective_mass: Any
    source_product: Any

    def __iter__(self) -> Iterator[PairKinds]:
        """Yield each kind by itself, with numbers in place of arrays."""
        for values in zip(*(vars(self)[field.name] for field in fields(self)), strict=True):
            yield PairKinds(*map(float, values))

    @property
    def reach(self) -> Any:
        """Distance of the centres at touch, (P,) in m."""
        return self.radius_i + self.radius_j

    @property
    def effective_radius(self) -> Any:
        """R* of eq. B.7, (P,) in m."""
        return interactions.effective_radius(self.radius_i, self.radius_j)

    def lens_area(self, strain: Any) -> Any:
        """Return the area of the disk of contact at strains, (P,) in m2 (eq. B.5)."""
        distance = self.reach * (1.0 - strain)
        return interactions.lens_area(distance, self.radius_i, self.radius_j)


def pair_kinds(radius: Floats, mass: Floats, source: Floats) -> PairKinds:
    """Return the kinds of pairs that particles make, equal ones taken together.

    Where particles are of more than about thirty kinds, those stand for all that are evenly spaced
    in the orders of radius, mass and source, the two at each end among them.

    Parameters
    ----------
    radius, mass, source
        (N,) arrays in m, kg and the unit of `near_field_source`.
    """
    kinds, counts = _distinct(np.column_stack([radius, mass, source]))
    chosen = _spread_kinds(kinds)
    kinds, counts = kinds[chosen], counts[chosen]
    i, j = np.triu_indices(len(kinds))
    real = (i != j) | (counts[i] > 1)
    i, j = i[real], j[real]
    return PairKinds(
        radius_i=kinds[i, 0],
        radius_j=kinds[j, 0],
        effective_mass=interactions.effective_mass(kinds[i, 1], kinds[j, 1]),
        source_product=kinds[i, 2] * kinds[j, 2],
    )


def _distinct(properties: Floats) -> tuple[Floats, Any]:
    """Return the distinct rows and how often each occurs; column by column, as rows sort slowly."""
    code = np.zeros(len(properties), dtype=np.int64)
    for column in properties.T:
        values, number = np.unique(column, return_inverse=True)
        _, code = np.unique(code * len(values) + number, return_inverse=True)
    _, first, counts = np.unique(code, return_index=True, return_counts=True)
    return properties[first], counts


def _spread_kinds(kinds: Floats) -> Any:
    """Return the rows of all kinds, or of those that stand for them."""
    count, properties = kinds.shape
    if count <= properties * KINDS_BY_PROPERTY:
        return np.arange(count)
    places = np.linspace(0, count - 1, KINDS_BY_PROPERTY).round().astype(int)
    # Two at each end: the two lightest particles, say, are a pair as well.
    places = np.concatenate([places, [1, count - 2]])
    return np.unique(np.argsort(kinds, axis=0, kind="stable")[places])


def near_field_sources(
    case: Case, radius: Floats, mass: Floats, charge: Floats, sign: Floats
) -> Floats:
    """Return what each particle brings to the near field of a case, zero without one; (N,)."""
    if case.near_field is None:
        return np.zeros(len(radius))
    return interactions.near_field_source(
        case.near_field.scaling, radius=radius, mass=mass, charge=charge, sign=sign
    )


def near_field_law(section: NearField) -> NearFieldLaw:
    """Return the near field of a case, as the closed forms want it."""
    attraction, repulsion = section.attraction, section.repulsion
    return NearFieldLaw(
        attraction=attraction.strength if attraction else 0.0,
        attraction_exponent=attraction.exponent if attraction else 1.0,
        repulsion=repulsion.strength if repulsion else 0.0,
        repulsion_exponent=repulsion.exponent if repulsion else 1.0,
        cutoff=np.inf if section.cutoff == "all" else section.cutoff,
        switch_width=section.switch_width or 0.0,
    )


class ElasticLaw(Protocol):
    """The elastic force of a contact, for P kinds of pairs."""

    def force(self, distance: Any) -> Any:
        """Return the force in N that pushes apart at a distance in m."""

    def stiffness(self, strain: Any) -> Any:
        """Return the growth of the force with the overlap, in N/m, at a strain."""

    def strain_at_energy(self, energy: Any) -> Any:
        """Return the strain that takes up an energy in J, at most `LARGEST_STRAIN`."""


@dataclass(frozen=True)
class LensContact:
    """Law `zohdi`, eq. 7.5, with its softened stiffness in N/m2."""

    pairs: PairKinds
    modulus: float
    exponent: float

    def force(self, distance: Any) -> Any:
        """Return the force in N that pushes apart at a distance in m."""
        return interactions.contact_force(distance, *self._parameters)

    def stiffness(self, strain: Any) -> Any:
        """Return the growth of the force with the overlap, in N/m, at a strain."""
        distance = self.pairs.reach * (1.0 - strain)
        return interactions.contact_stiffness(distance, *self._parameters)

    def strain_at_energy(self, energy: Any) -> Any:
        """Return the strain that takes up an energy in J, at most `LARGEST_STRAIN`."""
        return interactions.strain_at_energy(energy, *self._parameters)

    @property
    def _parameters(self) -> tuple[Any, ...]:
        return (self.pairs.radius_i, self.pairs.radius_j, self.modulus, self.exponent)


@dataclass(frozen=True)
class PowerContact:
    """The stock laws without their adhesion, coefficient * overlap^exponent."""

    pairs: PairKinds
    coefficient: Any
    exponent: float

    def force(self, distance: Any) -> Any:
        """Return the force in N that pushes apart at a distance in m."""
        return self.coefficient * np.maximum(self.pairs.reach - distance, 0.0) ** self.exponent

    def stiffness(self, strain: Any) -> Any:
        """Return the growth of the force with the overlap, in N/m, at a strain."""
        overlap = self.pairs.reach * strain
        return self.coefficient * self.exponent * overlap ** (self.exponent - 1.0)

    def strain_at_energy(self, energy: Any) -> Any:
        """Return the strain that takes up an energy in J, at most `LARGEST_STRAIN`."""
        growth = self.exponent + 1.0
        overlap = (growth * energy / self.coefficient) ** (1.0 / growth)
        return np.minimum(overlap / self.pairs.reach, LARGEST_STRAIN)


def elastic_law(contact: Contact, pairs: PairKinds) -> ElasticLaw:
    """Return the elastic force of a case's contact for some pairs."""
    if contact.law == "zohdi":
        assert contact.exponent is not None
        return LensContact(pairs, softened_stiffness(contact), contact.exponent)
    if contact.law == "hooke":
        return PowerContact(pairs, contact.stiffness, 1.0)
    unit_force = interactions.hertz_force(1.0, pairs.effective_radius, effective_modulus(contact))
    return PowerContact(pairs, unit_force, 1.5)


def equilibrium_overlaps(
    contact: Contact, law: NearFieldLaw, pairs: PairKinds
) -> list[float | None]:
    """Return `interactions.equilibrium_overlap` of each pair: contact against near field, in m.

    The adhesion of `jkr` and `dmt` is left out.
    """

    def overlap(pair: PairKinds) -> float | None:
        return interactions.equilibrium_overlap(
            pair.radius_i,
            pair.radius_j,
            elastic_law(contact, pair).force,
            lambda d: interactions.near_field_force(d, pair.source_product, law),
        )

    return [overlap(pair) for pair in pairs]


def softened_stiffness(contact: Contact) -> float:
    """Return K_p of law `zohdi` in N/m2, of every particle and so of every pair (eq. 7.18-7.20)."""
    assert contact.stiffness is not None
    thermal = contact.thermal
    if thermal is None:
        return contact.stiffness
    return float(interactions.softened_stiffness(contact.stiffness, *thermal.softening))


def effective_modulus(contact: Contact) -> float:
    """Return E* in Pa of two particles of the contact's material (eq. B.7)."""
    modulus, poisson = contact.youngs_modulus, contact.poisson_ratio
    assert modulus is not None
    assert poisson is not None
    return float(interactions.effective_modulus(modulus, poisson, modulus, poisson))
