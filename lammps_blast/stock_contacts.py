"""What contacts under LAMMPS's own laws may give to the particles.

Stock laws keep no account of the energy that they hold, so a run that goes wrong shows only as
contacts that give more than they can have had.
"""

from __future__ import annotations

import numpy as np

from lammps_blast import interactions
from lammps_blast.case import Contact
from lammps_blast.neighbours import close_pairs
from lammps_blast.pairs import effective_modulus
from lammps_blast.theory import Floats

# No spheres, however unequal, have more contacts than this a particle: on average fewer than
# 8 + 4 sqrt(3) others can touch one (Kuperberg and Schramm, 1994), and a contact is of two.
MOST_CONTACTS_PER_PARTICLE = 4.0 + 2.0 * np.sqrt(3.0)


def energy_reserve(contact: Contact, position: Floats, radius: Floats) -> float:
    """Return the energy in J that contacts of a stock law can set free.

    What their springs hold at the start, and what adhesion adds when as many contacts form as
    there can be.

    Parameters
    ----------
    position, radius
        Of the particles at the start, (N, 3) and (N,) in m.
    """
    count = len(radius)
    most_contacts = min(count * (count - 1) / 2, MOST_CONTACTS_PER_PARTICLE * count)
    return _held(contact, position, radius) + most_contacts * _binding(contact, radius)


def _held(contact: Contact, position: Floats, radius: Floats) -> float:
    pairs, closeness = close_pairs(position, radius)
    i, j = pairs.T
    overlap = (1.0 - closeness) * (radius[i] + radius[j])
    if contact.law == "hooke":
        assert contact.stiffness is not None
        return float(np.sum(interactions.hooke_energy(overlap, contact.stiffness)))
    effective = interactions.effective_radius(radius[i], radius[j])
    return float(np.sum(interactions.hertz_energy(overlap, effective, effective_modulus(contact))))


def _binding(contact: Contact, radius: Floats) -> float:
    """Return the energy in J of the strongest bond of adhesion, that of the largest spheres."""
    if contact.surface_energy is None:
        return 0.0
    energies = {
        "dmt": interactions.dmt_binding_energy,
        "jkr": interactions.jkr_binding_energy,
    }
    largest = interactions.effective_radius(radius.max(), radius.max())
    return float(energies[contact.law](largest, effective_modulus(contact), contact.surface_energy))
