"""Closed forms for two particles that touch, stick or attract each other (section 7).

The manner is that of `theory`: SI units, plain numbers or numpy arrays with numpy's broadcasting,
`eq. 7.5` is equation 7.5 of the paper. i and j are the two particles of a pair, d is the distance
of their centres, s = R_i + R_j, and the strain E = (s - d)/s is |E_ij| of eq. 7.6 for spheres that
touch or overlap. A force is a magnitude along the line of centres; each docstring says which way.

Potentials: that of the contact is zero at touch, that of a bond is zero at touch or at the strain
of its activation, and that of a near field is zero at its cutoff.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import hyp2f1

from lammps_blast.theory import Floats

Scaling: TypeAlias = Literal["mass", "area", "volume", "charge"]

# Beyond this strain a sphere has lost its shape, and no law here means anything.
LARGEST_STRAIN = 0.5
# The strains at which a balance of forces is looked for: from far below anything visible.
STRAINS = np.concatenate([[0.0], np.geomspace(1e-12, 1.0, 600)])
BISECTIONS = 60


def effective_mass(mass_i: ArrayLike, mass_j: ArrayLike) -> Any:
    """m_i m_j/(m_i + m_j) in kg: two particles move against each other like one of this mass.

    Parameters
    ----------
    mass_i, mass_j
        m in kg.
    """
    return np.asarray(mass_i) * np.asarray(mass_j) / np.add(mass_i, mass_j)


def effective_radius(radius_i: ArrayLike, radius_j: ArrayLike) -> Any:
    """R* = R_i R_j/(R_i + R_j) in m (eq. B.7).

    Parameters
    ----------
    radius_i, radius_j
        R in m.
    """
    return np.asarray(radius_i) * np.asarray(radius_j) / np.add(radius_i, radius_j)


def contact_strain(distance: ArrayLike, radius_i: ArrayLike, radius_j: ArrayLike) -> Any:
    """E = (R_i + R_j - d)/(R_i + R_j) (eq. 7.6); zero for spheres apart.

    Parameters
    ----------
    distance
        d in m.
    radius_i, radius_j
        R in m.
    """
    reach = np.add(radius_i, radius_j)
    return np.maximum(reach - np.asarray(distance), 0.0) / reach


def lens_arm(distance: ArrayLike, radius_i: ArrayLike, radius_j: ArrayLike) -> Any:
    """L_i in m, from the centre of i to the plane of the lens (eq. B.6); d - L_i is that of j.

    Arguments as for `contact_strain`.
    """
    distance = np.asarray(distance)
    squares = np.subtract(radius_j, radius_i) * np.add(radius_j, radius_i)
    return 0.5 * (distance - squares / distance)


def lens_area(distance: ArrayLike, radius_i: ArrayLike, radius_j: ArrayLike) -> Any:
    """Area A = pi (R_i^2 - L_i^2) of the disk in which two spheres meet, in m2 (eq. B.5).

    As pi (s - d)(s + d)(d^2 - (R_i - R_j)^2)/(4 d^2), in which nothing cancels. Zero for spheres
    apart; pi min(R_i, R_j)^2 for a sphere that the other has swallowed, d < |R_i - R_j|.

    Arguments as for `contact_strain`.
    """
    distance = np.asarray(distance, dtype=float)
    reach, unequal = np.add(radius_i, radius_j), np.abs(np.subtract(radius_i, radius_j))
    with np.errstate(divide="ignore", invalid="ignore"):
        rim = (distance - unequal) * (distance + unequal) / distance**2
        lens = 0.25 * np.pi * np.maximum(reach - distance, 0.0) * (reach + distance) * rim
    disk = np.pi * np.minimum(radius_i, radius_j) ** 2
    return np.where(_is_swallowed(distance, unequal), disk, lens)[()]


def _is_swallowed(distance: Floats, unequal: Floats) -> Any:
    """Whether a sphere lies inside another; equal ones with one centre count as well."""
    return (distance < unequal) | (distance == 0.0)


def softened_stiffness(
    stiffness: ArrayLike,
    temperature: ArrayLike,
    reference: ArrayLike,
    sensitivity: ArrayLike,
    floor: ArrayLike,
) -> Any:
    """K_p = max(K_po exp(-a (Theta/Theta* - 1)), K_lim) of one particle, in N/m2 (eq. 7.18, 7.19).

    Parameters
    ----------
    stiffness
        K_po in N/m2.
    temperature, reference
        Theta and Theta* in K.
    sensitivity
        a.
    floor
        K_lim in N/m2.
    """
    heat = np.asarray(temperature) / np.asarray(reference) - 1.0
    return np.maximum(np.asarray(stiffness) * np.exp(-np.asarray(sensitivity) * heat), floor)


def pair_stiffness(stiffness_i: ArrayLike, stiffness_j: ArrayLike) -> Any:
    """Stiffness of a pair, the mean of the two, in N/m2 (eq. 7.20).

    Parameters
    ----------
    stiffness_i, stiffness_j
        K_p of each particle in N/m2.
    """
    return 0.5 * np.add(stiffness_i, stiffness_j)


def contact_force(
    distance: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
) -> Any:
    """Elastic force K_p E^p A in N, which pushes the particles apart (eq. 7.5).

    Parameters
    ----------
    distance
        d in m.
    radius_i, radius_j
        R in m.
    stiffness
        K_p of the pair in N/m2.
    exponent
        p_p >= 0.
    """
    strain = contact_strain(distance, radius_i, radius_j)
    area = lens_area(distance, radius_i, radius_j)
    return np.asarray(stiffness) * strain ** np.asarray(exponent) * area


def contact_energy(
    distance: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
) -> Any:
    """Potential of `contact_force`, its integral from d to touch, in J.

    With D = R_i - R_j it is pi/4 K s^3 E^(p+2) times

        2/(p+2) - E/(p+3) - (D/s)^2 [1/(1-E) - p/(p+2) F(E)],  F(E) = 2F1(1, p+2; p+3; E),

    and for a swallowed sphere this up to the strain E_c at which it was swallowed, and then
    pi min(R_i, R_j)^2 K s (E^(p+1) - E_c^(p+1))/(p+1).

    Arguments as for `contact_force`.
    """
    strain = contact_strain(distance, radius_i, radius_j)
    return np.asarray(stiffness) * _lens_work(strain, radius_i, radius_j, exponent)


def _lens_work(
    strain: Floats, radius_i: ArrayLike, radius_j: ArrayLike, exponent: ArrayLike
) -> Any:
    """Integral of E^p A over the overlap, from touch to a strain, in m3."""
    p = np.asarray(exponent, dtype=float)
    reach, smaller = np.add(radius_i, radius_j), np.minimum(radius_i, radius_j)
    likeness = 4.0 * np.multiply(radius_i, radius_j) / reach**2
    unlikeness = (np.subtract(radius_i, radius_j) / reach) ** 2
    swallowed_at = 2.0 * smaller / reach
    lens = np.minimum(strain, swallowed_at)
    # The first term of the series is left to 1 - unlikeness = likeness: nothing cancels where one
    # sphere is much the larger. Equal spheres may share a centre, E = 1, and have no series.
    inside = np.where(unlikeness > 0.0, lens, 0.0)
    series = inside * (1.0 / (1.0 - inside) - p / (p + 3.0) * hyp2f1(1.0, p + 3.0, p + 4.0, inside))
    bracket = 2.0 * likeness / (p + 2.0) - lens / (p + 3.0) - unlikeness * series
    disk = np.pi * smaller**2 * reach * (strain ** (p + 1.0) - lens ** (p + 1.0)) / (p + 1.0)
    return 0.25 * np.pi * reach**3 * lens ** (p + 2.0) * bracket + disk


def contact_stiffness(
    distance: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
) -> Any:
    """Growth of `contact_force` with the overlap s - d, in N/m; zero for spheres apart.

    Negative where a small sphere is nearly swallowed: its disk shrinks there (eq. B.5).

    Arguments as for `contact_force`.
    """
    d, p = np.asarray(distance, dtype=float), np.asarray(exponent)
    reach, unequal = np.add(radius_i, radius_j), np.abs(np.subtract(radius_i, radius_j))
    strain = contact_strain(d, radius_i, radius_j)
    smaller = np.minimum(radius_i, radius_j)
    with np.errstate(divide="ignore", invalid="ignore"):
        # A/(E s), which is finite at touch, and the growth of A with the overlap.
        lens = 0.25 * np.pi * (reach + d) * (d - unequal) * (d + unequal) / d**2
        growth = 0.5 * np.pi * (d - reach**2 * unequal**2 / d**3)
        disk = np.pi * smaller**2 / (strain * reach)
    swallowed = _is_swallowed(d, unequal)
    slope = p * np.where(swallowed, disk, lens) + np.where(swallowed, 0.0, growth)
    return np.where(d <= reach, np.asarray(stiffness) * strain**p * slope, 0.0)[()]


def strain_at_energy(
    energy: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
    largest: float = LARGEST_STRAIN,
) -> Any:
    """Strain at which `contact_energy` has taken up an energy, or `largest` where it cannot.

    Parameters
    ----------
    energy
        J; of the motion of the particles against each other, m_eff v^2/2.
    largest
        The answer where it would be beyond this strain.

    The other arguments are as for `contact_force`.
    """
    shape = np.broadcast_shapes(*map(np.shape, (energy, radius_i, radius_j, stiffness, exponent)))
    low, high = np.zeros(shape), np.full(shape, largest)
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        work = _lens_work(middle, radius_i, radius_j, exponent)
        deeper = np.asarray(stiffness) * work < np.asarray(energy)
        low, high = np.where(deeper, middle, low), np.where(deeper, high, middle)
    return high[()]


def damping_coefficient(
    distance: ArrayLike, radius_i: ArrayLike, radius_j: ArrayLike, damping: ArrayLike
) -> Any:
    """Force per speed of approach c_cd A, in N s/m (eq. 7.10); it may pull.

    Parameters
    ----------
    damping
        c_cd in N s/m3.

    The other arguments are as for `contact_strain`.
    """
    return np.asarray(damping) * lens_area(distance, radius_i, radius_j)


def friction_force(
    slip_speed: ArrayLike,
    normal_force: ArrayLike,
    area: ArrayLike,
    step: ArrayLike,
    *,
    stiffness: ArrayLike,
    static: ArrayLike,
    dynamic: ArrayLike,
) -> Any:
    """Friction against the slip in N (eq. 7.11-7.15).

    T = K_f |slip| A dt if that is less than mu_s F, and mu_d F otherwise.

    Parameters
    ----------
    slip_speed
        |v_j - v_i| across the line of centres, at the contact point, in m/s (eq. 7.13).
    normal_force
        F, the elastic force of eq. 7.5 alone, in N.
    area
        A in m2, of `lens_area`.
    step
        Time step dt in s: the law depends on it.
    stiffness
        K_f in N/m3.
    static, dynamic
        mu_s and mu_d.
    """
    trial = np.multiply(stiffness, slip_speed) * np.asarray(area) * np.asarray(step)
    sticks = trial < np.multiply(static, normal_force)
    return np.where(sticks, trial, np.multiply(dynamic, normal_force))[()]


def collision_spin(
    speed: ArrayLike,
    angle: ArrayLike,
    radius_i: ArrayLike,
    mass_i: ArrayLike,
    mass_j: ArrayLike,
    dynamic: ArrayLike,
    restitution: ArrayLike = 1.0,
) -> Any:
    """Spin in rad/s that friction gives sphere i when it meets sphere j; none spins before.

    While the surfaces slide, the impulse of friction is mu_d times that along the line of centres,
    (1 + e) m_eff v cos(theta); they stop sliding, and roll on each other, when it has come to
    2/7 m_eff v sin(theta). The spin is 5/2 times the smaller one, over m_i R_i: for equal spheres
    that lose nothing along the line of centres, omega R/v is the smaller one of
    5/14 sin(theta) and 5/2 mu_d cos(theta). It is the limit of `friction_force` for a large
    stiffness of friction.

    Parameters
    ----------
    speed
        Relative speed v in m/s.
    angle
        theta in rad, between the relative velocity and the line of centres at touch.
    radius_i
        R_i in m.
    mass_i, mass_j
        m in kg; of homogeneous spheres.
    dynamic
        mu_d; infinite for spheres that roll at any angle.
    restitution
        e, what the collision leaves of the speed along the line of centres.
    """
    angle = np.asarray(angle)
    sliding = np.multiply(dynamic, np.add(1.0, restitution)) * np.cos(angle)
    impulse = effective_mass(mass_i, mass_j) * np.minimum(2.0 / 7.0 * np.sin(angle), sliding)
    return 2.5 * np.asarray(speed) * impulse / np.multiply(mass_i, radius_i)


def bond_force(
    distance: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
) -> Any:
    """Force K_nb E^p_b A of an active bond, in N, which pulls the particles together (eq. 7.16).

    Parameters
    ----------
    stiffness
        K_nb in N/m2.
    exponent
        p_b >= 0.

    The other arguments are as for `contact_strain`.
    """
    return contact_force(distance, radius_i, radius_j, stiffness, exponent)


def bond_energy(
    distance: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
    activation_strain: ArrayLike = 0.0,
) -> Any:
    """Potential of `bond_force` in J, zero or negative: -(W(E) - W(E*)), W that of a contact.

    A bond that lasts until the pair separates is measured from touch, E* = 0: it drops by W(E*)
    when it forms, which is heat. One that lasts only while E >= E* is measured from E*.

    Parameters
    ----------
    activation_strain
        E* for `memory: none`; zero, the default, for `memory: contact`.

    The other arguments are as for `bond_force`.
    """
    strain = np.maximum(contact_strain(distance, radius_i, radius_j), activation_strain)
    work = _lens_work(strain, radius_i, radius_j, exponent)
    start = _lens_work(np.asarray(activation_strain), radius_i, radius_j, exponent)
    return -np.asarray(stiffness) * (work - start)


def bond_formation_loss(
    activation_strain: ArrayLike,
    radius_i: ArrayLike,
    radius_j: ArrayLike,
    stiffness: ArrayLike,
    exponent: ArrayLike,
) -> Any:
    """Heat that a bond with `memory: contact` sets free when it forms at a strain, W(E), in J.

    Parameters
    ----------
    activation_strain
        E at which the bond becomes active: E*, or beyond it by what a step crosses.

    The other arguments are as for `bond_force`.
    """
    work = _lens_work(np.asarray(activation_strain), radius_i, radius_j, exponent)
    return np.asarray(stiffness) * work


@dataclass(frozen=True)
class NearFieldLaw:
    """The law of eq. 7.23 for unit sources: strength_1 d^-beta_1 - strength_2 d^-beta_2.

    Attributes
    ----------
    attraction, repulsion
        The strengths, alpha-bar of section 7.7, in N m^beta per unit of the two sources.
    attraction_exponent, repulsion_exponent
        beta.
    cutoff
        Distance in m from which on there is no force; infinite for none.
    switch_width
        The force goes smoothly to zero over the last such length, m, before the cutoff; less than
        the cutoff, and zero for a force that ends in a jump.
    """

    attraction: float = 0.0
    attraction_exponent: float = 1.0
    repulsion: float = 0.0
    repulsion_exponent: float = 1.0
    cutoff: float = np.inf
    switch_width: float = 0.0

    @property
    def terms(self) -> tuple[tuple[float, float], ...]:
        """Strength, negative for repulsion, and exponent of each of the two powers."""
        return (
            (self.attraction, self.attraction_exponent),
            (-self.repulsion, self.repulsion_exponent),
        )


def near_field_source(
    scaling: Scaling,
    *,
    radius: ArrayLike,
    mass: ArrayLike,
    charge: ArrayLike,
    sign: ArrayLike = 1.0,
) -> Any:
    """Factor of one particle in alpha_ij = strength * source_i * source_j (section 7.7).

    m c, 4 pi R^2 c or 4/3 pi R^3 c, with c = +-1, or the charge q, whose sign is its own.

    Parameters
    ----------
    radius
        R in m.
    mass
        m in kg.
    charge
        q in C.
    sign
        c.
    """
    if scaling == "charge":
        return np.asarray(charge)
    if scaling == "mass":
        return np.asarray(mass) * np.asarray(sign)
    radius = np.asarray(radius, dtype=float)
    size = 4.0 * np.pi * radius**2 if scaling == "area" else 4.0 / 3.0 * np.pi * radius**3
    return size * np.asarray(sign)


def smooth_switch(distance: ArrayLike, law: NearFieldLaw) -> Any:
    """Factor of the near field: 1 up to the switch, 0 at the cutoff, twice differentiable between.

    1 - x^3 (10 - 15 x + 6 x^2) with x = (d - cutoff)/switch_width + 1.

    Parameters
    ----------
    distance
        d in m.
    """
    if law.switch_width == 0.0:
        return np.where(np.asarray(distance) < law.cutoff, 1.0, 0.0)[()]
    return _switch(_part_left(distance, law))


def _part_left(distance: ArrayLike, law: NearFieldLaw) -> Any:
    """How much of the switch is left before the cutoff, 1 - x, from 1 to 0."""
    return np.clip((law.cutoff - np.asarray(distance)) / law.switch_width, 0.0, 1.0)


def _switch(left: Any) -> Any:
    """The same polynomial as a product, which keeps its digits next to the cutoff."""
    x = 1.0 - left
    return left**3 * (1.0 + 3.0 * x + 6.0 * x**2)


def near_field_force(distance: ArrayLike, source_product: ArrayLike, law: NearFieldLaw) -> Any:
    """Force alpha_1 d^-beta_1 - alpha_2 d^-beta_2 in N, positive where it attracts (eq. 7.23).

    Parameters
    ----------
    distance
        d in m.
    source_product
        Of `near_field_source` of the two particles.
    """
    d = np.asarray(distance, dtype=float)
    bare = sum(strength * d**-beta for strength, beta in law.terms)
    return np.asarray(source_product) * bare * smooth_switch(d, law)


def near_field_gradient(distance: ArrayLike, source_product: ArrayLike, law: NearFieldLaw) -> Any:
    """Derivative of `near_field_force` by the distance, in N/m.

    Arguments as for `near_field_force`.
    """
    d = np.asarray(distance, dtype=float)
    gradient = sum(-beta * strength * d ** -(beta + 1.0) for strength, beta in law.terms)
    gradient = gradient * smooth_switch(d, law)
    if law.switch_width > 0.0:
        left = _part_left(d, law)
        slope = -30.0 * left**2 * (1.0 - left) ** 2 / law.switch_width
        gradient = gradient + slope * sum(strength * d**-beta for strength, beta in law.terms)
    return np.asarray(source_product) * gradient


def near_field_energy(distance: ArrayLike, source_product: ArrayLike, law: NearFieldLaw) -> Any:
    """Potential in J, of which the force along n_ij on i is the derivative by the distance.

    With a cutoff it is zero there. Without one each term is alpha d^(1-beta)/(1-beta), and
    alpha ln(d / 1 m) for beta = 1.

    Arguments as for `near_field_force`.
    """
    d = np.asarray(distance, dtype=float)
    energy = sum(strength * _power_integral(d, beta, law) for strength, beta in law.terms)
    return np.asarray(source_product) * energy


def _power_integral(distance: Floats, beta: float, law: NearFieldLaw) -> Any:
    """Integral of d^-beta, switched, from where the potential is zero to a distance."""
    if np.isinf(law.cutoff):
        return np.log(distance) if beta == 1.0 else distance ** (1.0 - beta) / (1.0 - beta)
    distance = np.minimum(distance, law.cutoff)
    if law.switch_width == 0.0:
        return _unswitched_integral(distance, law.cutoff, beta)
    switched = np.vectorize(lambda d: _switched_integral(d, beta, law), otypes=[float])
    start = law.cutoff - law.switch_width
    bare = _unswitched_integral(np.minimum(distance, start), start, beta)
    return (bare + switched(np.maximum(distance, start)))[()]


def _unswitched_integral(distance: Floats, end: float, beta: float) -> Any:
    """Integral of d^-beta from an end to a distance: end^(1-b) (x^(1-b) - 1)/(1-b), x = d/end."""
    logarithm = np.log(distance / end)
    growth = (1.0 - beta) * logarithm
    stretch = np.divide(np.expm1(growth), growth, out=np.ones_like(growth), where=growth != 0)
    return end ** (1.0 - beta) * logarithm * stretch


def _switched_integral(distance: float, beta: float, law: NearFieldLaw) -> float:
    """Integral of the switched d^-beta from the cutoff to a distance within the switch."""
    from scipy.integrate import quad  # slow to import, and few cases have a switch

    def integrand(before: float) -> float:
        return (law.cutoff - before) ** -beta * _switch(before / law.switch_width)

    return -quad(integrand, 0.0, law.cutoff - distance, epsabs=0.0, epsrel=1e-13)[0]


def effective_modulus(
    youngs_modulus_i: ArrayLike,
    poisson_ratio_i: ArrayLike,
    youngs_modulus_j: ArrayLike,
    poisson_ratio_j: ArrayLike,
) -> Any:
    """E* = 1/((1 - nu_i^2)/E_i + (1 - nu_j^2)/E_j) in Pa (eq. B.7).

    Parameters
    ----------
    youngs_modulus_i, youngs_modulus_j
        E in Pa.
    poisson_ratio_i, poisson_ratio_j
        nu.
    """
    compliance_i = (1.0 - np.asarray(poisson_ratio_i) ** 2) / np.asarray(youngs_modulus_i)
    compliance_j = (1.0 - np.asarray(poisson_ratio_j) ** 2) / np.asarray(youngs_modulus_j)
    return 1.0 / (compliance_i + compliance_j)


def hertz_force(overlap: ArrayLike, effective_radius: ArrayLike, modulus: ArrayLike) -> Any:
    """Hertz's force 4/3 E* sqrt(R*) overlap^(3/2) in N, which pushes apart (eq. B.7).

    Parameters
    ----------
    overlap
        s - d in m; no force for a negative one.
    effective_radius
        R* in m.
    modulus
        E* in Pa, of `effective_modulus`.
    """
    depth = np.maximum(overlap, 0.0)
    return 4.0 / 3.0 * np.asarray(modulus) * np.sqrt(effective_radius) * depth**1.5


def hooke_energy(overlap: ArrayLike, stiffness: ArrayLike) -> Any:
    """Energy k overlap^2/2 in J that a linear spring holds.

    Parameters
    ----------
    overlap
        s - d in m; none for a negative one.
    stiffness
        k in N/m.
    """
    return 0.5 * np.asarray(stiffness) * np.maximum(overlap, 0.0) ** 2


def hertz_energy(overlap: ArrayLike, effective_radius: ArrayLike, modulus: ArrayLike) -> Any:
    """Energy 2/5 overlap F in J that a contact holds under `hertz_force` F; arguments as there."""
    return 0.4 * np.maximum(overlap, 0.0) * hertz_force(overlap, effective_radius, modulus)


def dmt_binding_energy(
    effective_radius: ArrayLike, modulus: ArrayLike, surface_energy: ArrayLike
) -> Any:
    """Energy in J that DMT adhesion sets free from touch to where it balances Hertz's force.

    The pull is F = 4 pi gamma R* at every overlap, so it is 3/5 F times the overlap of balance.

    Parameters
    ----------
    effective_radius
        R* in m.
    modulus
        E* in Pa, of `effective_modulus`.
    surface_energy
        gamma in J/m2.
    """
    pull = 4.0 * np.pi * np.asarray(surface_energy) * np.asarray(effective_radius)
    overlap = (pull / hertz_force(1.0, effective_radius, modulus)) ** (2.0 / 3.0)
    return 0.6 * pull * overlap


def jkr_binding_energy(
    effective_radius: ArrayLike, modulus: ArrayLike, surface_energy: ArrayLike
) -> Any:
    """Energy in J that JKR adhesion sets free from touch to where the force vanishes.

    With c = sqrt(pi gamma/E*) force and overlap are 4 E*/(3 R*) a^3 - 4 E* c a^(3/2) and
    a^2/R* - 2 c sqrt(a); the contact radius a grows from (2 c R*)^(2/3) to (3 c R*)^(2/3).

    Parameters
    ----------
    effective_radius
        R* in m.
    modulus
        E* in Pa, of `effective_modulus`.
    surface_energy
        gamma in J/m2.
    """
    radius, stiffness = np.asarray(effective_radius), np.asarray(modulus)
    c = np.sqrt(np.pi * np.asarray(surface_energy) / stiffness)

    def work(a: Any) -> Any:
        """Integral of the force over the overlap, up to a constant."""
        high = 8.0 / (15.0 * radius**2) * a**5 - 8.0 * c / (3.0 * radius) * a**3.5
        return stiffness * (high + 2.0 * c**2 * a**2)

    touch, balance = ((n * c * radius) ** (2.0 / 3.0) for n in (2.0, 3.0))
    return work(touch) - work(balance)


def stiffness_like_hertz(radius_i: ArrayLike, radius_j: ArrayLike, modulus: ArrayLike) -> Any:
    """K_p with which eq. 7.5 with exponent 1/2 is Hertz's force for small overlaps, in N/m2.

    A goes to 2 pi R* (s - d), so it is 2 E*/(3 pi) sqrt(s/R*), and 4 E*/(3 pi) for equal radii.

    Parameters
    ----------
    radius_i, radius_j
        R in m.
    modulus
        E* in Pa, of `effective_modulus`.
    """
    slenderness = np.add(radius_i, radius_j) / effective_radius(radius_i, radius_j)
    return 2.0 / (3.0 * np.pi) * np.asarray(modulus) * np.sqrt(slenderness)


def equilibrium_overlap(
    radius_i: float,
    radius_j: float,
    repulsion: Callable[[Any], Any],
    attraction: Callable[[Any], Any],
    largest_strain: float = LARGEST_STRAIN,
) -> float | None:
    """Overlap in m at which a contact carries what pulls two particles together.

    The first balance that a pair meets as it closes, which is a stable one. Zero where nothing
    pulls at touch; None where the contact gives way at every strain up to the largest one, or to
    that at which one sphere swallows the other.

    Parameters
    ----------
    radius_i, radius_j
        R in m.
    repulsion
        Force in N that pushes apart, of the distance in m, such as `contact_force`.
    attraction
        Force in N that pulls together, of the distance in m, such as `near_field_force`.
    """
    from scipy.optimize import brentq  # slow to import, and of use only where something pulls

    reach = radius_i + radius_j
    # Just short of being swallowed, where the disk of a contact (eq. B.5) jumps.
    deepest = min(largest_strain, (2.0 - 1e-9) * min(radius_i, radius_j) / reach)

    def pull(strain: Any) -> Any:
        distance = reach * (1.0 - strain)
        return attraction(distance) - repulsion(distance)

    strains = STRAINS * deepest
    held = np.flatnonzero(pull(strains) <= 0.0)
    if not held.size:
        return None
    if held[0] == 0:
        return 0.0
    root = brentq(pull, strains[held[0] - 1], strains[held[0]], xtol=1e-300, rtol=1e-14)
    return float(reach * root)
