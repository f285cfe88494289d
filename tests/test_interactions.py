"""Closed forms of the interactions against quadrature and exact arithmetic, and the advice on steps
and the refusals that rest on them."""

import importlib
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from conftest import REPOSITORY, make_particles
from scipy.integrate import quad
from scipy.optimize import brentq

from lammps_blast import interactions as ia
from lammps_blast.case import CaseError, parse_case
from lammps_blast.case_warnings import case_warnings, check_near_field, interaction_warnings
from lammps_blast.derived_numbers import derive_numbers
from lammps_blast.interactions import NearFieldLaw
from lammps_blast.pairs import pair_kinds
from lammps_blast.step_advice import advised_step, step_warnings, time_scales

RADII = [(0.05, 0.05), (0.05, 0.07), (0.02, 0.3), (1.0, 1e-4)]
EXPONENTS = [0.0, 0.5, 2.0, 3.7]


def integral(function, start, end):
    return quad(function, start, end, epsabs=0, epsrel=1e-12, limit=400)[0]


def area_at(strain, radii):
    """The lens of eq. B.1-B.6 in terms of the strain, so that nothing cancels near touch."""
    reach, rim = sum(radii), 2 * min(radii) / sum(radii)
    if strain > rim:
        return np.pi * min(radii) ** 2
    chords = strain * (2 - strain) * (rim - strain) * (2 - rim - strain)
    return np.pi / 4 * reach**2 * chords / (1 - strain) ** 2 if strain < 1 else 0.0


def work_to(strain, radii, exponent):
    """Integral of E^p A over the overlap, in pieces that end where a sphere is swallowed."""
    rim = 2 * min(radii) / sum(radii)
    ends = [0.0, strain] if strain <= rim else [0.0, rim, strain]
    return sum(radii) * sum(
        integral(lambda e: e**exponent * area_at(e, radii), low, high)
        for low, high in pairwise(ends)
    )


def strains_of(radii):
    """From a hair's breadth to one sphere swallowed, by part of the strain of swallowing."""
    rim = 2 * min(radii) / sum(radii)
    return [1e-9 * rim, 0.01 * rim, 0.6 * rim, 0.99 * rim] + ([0.5 * (1 + rim)] if rim < 1 else [])


class TestGeometry:
    @pytest.mark.parametrize("radii", RADII)
    @pytest.mark.parametrize("part", [1e-12, 1e-6, 0.1, 0.9])
    def test_lens_area_is_exact_to_rounding(self, radii, part):
        distance = sum(radii) - part * 2 * min(radii)
        d, r_i, r_j = map(Fraction, (distance, *radii))
        arm = (d - (r_j**2 - r_i**2) / d) / 2
        exact = float(r_i**2 - arm**2)
        # The sum s is itself rounded; near touch that is all of the error.
        rounding = 4 * np.finfo(float).eps * sum(radii) / (sum(radii) - distance)
        area = ia.lens_area(distance, *radii)
        assert area / np.pi == pytest.approx(exact, rel=1e-14 + rounding)
        assert ia.lens_arm(distance, *radii) == pytest.approx(float(arm), rel=1e-13)

    def test_touch_swallowing_and_one_centre(self):
        assert ia.lens_area([0.5, 0.6], 0.2, 0.3).tolist() == [0.0, 0.0]
        disk = np.pi * 0.1**2
        assert ia.lens_area([0.0, 0.05, 0.19], 0.1, 0.3) == pytest.approx([disk] * 3)
        assert ia.lens_area(0.0, 0.1, 0.1) == pytest.approx(disk)
        assert ia.lens_area(1e-9, 0.1, 0.1) == pytest.approx(disk)
        assert ia.contact_strain([0.15, 0.2, 0.3], 0.1, 0.1) == pytest.approx([0.25, 0, 0])


class TestContact:
    @pytest.mark.parametrize("radii", RADII)
    @pytest.mark.parametrize("exponent", EXPONENTS)
    def test_energy_is_the_work_of_the_force(self, radii, exponent):
        for strain in strains_of(radii):
            expected = 3.0e5 * work_to(strain, radii, exponent)
            energy = 3.0e5 * ia._lens_work(strain, *radii, exponent)
            assert energy == pytest.approx(expected, rel=2e-12), strain
            assert area_at(strain, radii) == pytest.approx(
                ia.lens_area(sum(radii) * (1 - strain), *radii), rel=1e-15 / min(strain, 1e-3)
            )
        distance = sum(radii) * (1 - strains_of(radii)[2])
        force = ia.contact_force(distance, *radii, 3.0e5, exponent)
        strain = ia.contact_strain(distance, *radii)
        assert force == pytest.approx(3.0e5 * strain**exponent * ia.lens_area(distance, *radii))
        energy = ia.contact_energy(distance, *radii, 3.0e5, exponent)
        assert energy == pytest.approx(3.0e5 * work_to(strain, radii, exponent), rel=1e-11)

    def test_energy_of_equal_spheres(self):
        # pi/4 K s^3 E^4 (1/2 - E/5) for p = 2, and spheres apart have none.
        energy = ia.contact_energy([0.08, 0.1, 0.2], 0.05, 0.05, 1e7, 2)
        assert energy == pytest.approx([np.pi / 4 * 1e4 * 0.2**4 * 0.46, 0, 0], rel=1e-13)
        # Down to one centre, for p = 0: pi/4 K s^3 2/3, of the volume in the lenses.
        assert ia.contact_energy(0.0, 0.5, 0.5, 1.0, 0.0) == pytest.approx(np.pi / 6)

    @pytest.mark.parametrize("radii", RADII)
    @pytest.mark.parametrize("exponent", EXPONENTS)
    def test_stiffness_integrates_to_the_force(self, radii, exponent):
        reach, rim = sum(radii), 2 * min(radii) / sum(radii)
        for low, high in [(0.0, 0.3 * rim), (0.3 * rim, 0.95 * rim), (rim + 1e-3, 1.0)]:
            if high <= low:
                continue
            gain = integral(
                lambda e: ia.contact_stiffness(reach * (1 - e), *radii, 7.0, exponent) * reach,
                low,
                high,
            )
            force = ia.contact_force(reach * (1 - np.array([low, high])), *radii, 7.0, exponent)
            assert gain == pytest.approx(force[1] - force[0], rel=1e-11, abs=1e-13 * force[1])

    @pytest.mark.parametrize("radii", RADII[:3])
    @pytest.mark.parametrize("exponent", EXPONENTS)
    def test_strain_at_energy_inverts_the_energy(self, radii, exponent):
        strain = np.array([1e-6, 0.03, 0.1])
        energy = 5.0 * ia._lens_work(strain, *radii, exponent)
        assert ia.strain_at_energy(energy, *radii, 5.0, exponent) == pytest.approx(strain, rel=1e-9)
        assert ia.strain_at_energy(1e9, *radii, 5.0, exponent) == 0.5

    def test_softening(self):
        softened = ia.softened_stiffness(1e7, [300, 500, 5000], 500, 1, 1e6)
        assert softened == pytest.approx([1.4918247e7, 1e7, 1e6], rel=1e-8)
        assert ia.pair_stiffness(2e6, 1e6) == 1.5e6

    def test_damping_and_friction(self):
        area = ia.lens_area(0.09, 0.05, 0.05)
        assert ia.damping_coefficient(0.09, 0.05, 0.05, 1e5) == pytest.approx(1e5 * area)
        coefficients = {"stiffness": 1e7, "static": 0.4, "dynamic": 0.3}
        # The threshold, 0.4 F = 4 N, is met at a slip of 0.4 m/s exactly.
        force = ia.friction_force([0.0, 0.3, 0.39999, 0.4, 9.0], 10.0, 1e-3, 1e-3, **coefficients)
        assert force == pytest.approx([0.0, 3.0, 3.9999, 3.0, 3.0])
        # Half the step, half the force of sticking.
        assert ia.friction_force(0.3, 10.0, 1e-3, 5e-4, **coefficients) == pytest.approx(1.5)


class TestBond:
    @pytest.mark.parametrize("radii", RADII[:2])
    def test_energy_is_the_work_of_the_force(self, radii):
        reach, strain, least = sum(radii), 0.2, 0.05

        def force(e):
            return ia.bond_force(reach * (1 - e), *radii, 1e6, 1.5) * reach

        distance = reach * (1 - strain)
        lasting = ia.bond_energy(distance, *radii, 1e6, 1.5)
        assert lasting == pytest.approx(-integral(force, 0, strain), rel=1e-11)
        brief = ia.bond_energy(distance, *radii, 1e6, 1.5, least)
        assert brief == pytest.approx(-integral(force, least, strain), rel=1e-11)
        heat = ia.bond_formation_loss(least, *radii, 1e6, 1.5)
        assert heat == pytest.approx(brief - lasting, rel=1e-11)
        assert ia.bond_energy(reach * (1 - 0.04), *radii, 1e6, 1.5, least) == 0.0


FIELDS = [
    NearFieldLaw(0.5, beta_1, 0.01, beta_2, cutoff, width)
    for beta_1, beta_2 in [(1.0, 2.0), (0.0, 3.5)]
    for cutoff, width in [(np.inf, 0.0), (0.5, 0.0), (0.5, 0.1), (0.5, 0.45)]
]
FIELDS.append(NearFieldLaw(0.5, 1.0 + 1e-9, 0.01, 1.0 - 1e-6, 0.5, 0.1))


class TestNearField:
    def test_scalings(self):
        particle = {"radius": 0.1, "mass": 3.0, "charge": -2.0, "sign": -1.0}
        sources = {
            "mass": -3.0,
            "area": -4 * np.pi * 0.01,
            "volume": -4 / 3 * np.pi * 0.001,
            "charge": -2.0,
        }
        for scaling, source in sources.items():
            assert ia.near_field_source(scaling, **particle) == pytest.approx(source), scaling
        assert ia.near_field_source("charge", **particle | {"charge": 2.0}) == 2.0

    def test_equation_7_23(self):
        law = NearFieldLaw(0.5, 1.0, 0.01, 2.0)
        expected = [4.0 * (0.5 / 0.1 - 0.01 / 0.01), 0.0]
        assert ia.near_field_force([0.1, 0.02], 4.0, law) == pytest.approx(expected, abs=1e-12)
        # Unlike signs: attraction and repulsion change roles.
        assert ia.near_field_force(0.1, -4.0, law) == pytest.approx(-16.0)

    @pytest.mark.parametrize("law", FIELDS)
    def test_energy_is_the_work_and_gradient_the_slope(self, law):
        places = [0.02, 0.1, 0.35, 0.4, 0.43, 0.49999]
        for start, end in pairwise(places):
            work = integral(lambda d: ia.near_field_force(d, 2.0, law), start, end)
            energy = ia.near_field_energy(np.array([start, end]), 2.0, law)
            assert energy[1] - energy[0] == pytest.approx(work, rel=1e-10, abs=1e-11), start
            gain = integral(lambda d: ia.near_field_gradient(d, 2.0, law), start, end)
            force = ia.near_field_force(np.array([start, end]), 2.0, law)
            assert gain == pytest.approx(force[1] - force[0], rel=1e-11), start
        if law.cutoff < np.inf:
            for function in (ia.near_field_force, ia.near_field_energy, ia.near_field_gradient):
                assert function([0.5, 0.7], 2.0, law) == pytest.approx([0.0, 0.0], abs=0.0)

    def test_potential_without_a_cutoff(self):
        energy = ia.near_field_energy([0.5, 1.0, 2.0], 3.0, NearFieldLaw(0.5, 1.0, 0.25, 3.0))
        assert energy == pytest.approx(
            3 * (0.5 * np.log([0.5, 1, 2]) + 0.125 / np.array([0.25, 1, 4]))
        )

    def test_switch_is_smooth(self):
        law = NearFieldLaw(1.0, cutoff=1.0, switch_width=0.5)
        assert ia.smooth_switch([0.1, 0.5, 0.75, 1.0, 2.0], law) == pytest.approx([1, 1, 0.5, 0, 0])
        # Two derivatives vanish at both ends: what is left is 10 x^3.
        x = 1e-3
        ends = [1 - ia.smooth_switch(0.5 + 0.5 * x, law), ia.smooth_switch(1 - 0.5 * x, law)]
        assert ends == pytest.approx([10 * x**3] * 2, rel=2e-3)


class TestHertz:
    def test_equation_b_7(self):
        modulus = ia.effective_modulus(1e7, 0.3, 1e7, 0.3)
        assert modulus == pytest.approx(1e7 / 1.82)
        assert ia.effective_modulus(1e7, 0.3, np.inf, 0.0) == pytest.approx(1e7 / 0.91)
        force = ia.hertz_force([-1e-3, 1e-3], ia.effective_radius(0.05, 0.05), modulus)
        assert force == pytest.approx([0.0, 36.630036630], rel=1e-9)

    @pytest.mark.parametrize("radii", RADII[:3])
    def test_the_lens_law_goes_to_hertz_at_small_overlaps(self, radii):
        stiffness = ia.stiffness_like_hertz(*radii, 2.0e6)
        overlap = min(radii) * np.array([1e-2, 1e-4, 1e-6])
        lens = ia.contact_force(sum(radii) - overlap, *radii, stiffness, 0.5)
        excess = lens / ia.hertz_force(overlap, ia.effective_radius(*radii), 2.0e6) - 1
        # The deviation falls in proportion to the overlap.
        assert np.abs(excess[0]) < 0.03
        assert excess[1:] / excess[0] == pytest.approx([1e-2, 1e-4], rel=0.02)

    def test_equal_spheres_are_weaker_than_hertz_by_half_the_strain(self):
        stiffness = ia.stiffness_like_hertz(0.05, 0.05, 2.0e6)
        assert stiffness == pytest.approx(4 * 2.0e6 / (3 * np.pi))
        strain = np.array([0.01, 0.1, 0.4])
        lens = ia.contact_force(0.1 * (1 - strain), 0.05, 0.05, stiffness, 0.5)
        hertz = ia.hertz_force(0.1 * strain, 0.025, 2.0e6)
        assert lens / hertz == pytest.approx(1 - strain / 2, rel=1e-12)


class TestAdhesion:
    MODULUS, GAMMA, RADIUS = 5.5e6, 12.0, 0.02

    def test_energies_are_integrals_of_the_forces(self):
        overlap = 3e-3
        held = integral(lambda d: ia.hertz_force(d, self.RADIUS, self.MODULUS), 0.0, overlap)
        assert ia.hertz_energy(overlap, self.RADIUS, self.MODULUS) == pytest.approx(held, rel=1e-9)
        assert ia.hooke_energy([overlap, -overlap], 2e5) == pytest.approx([0.9, 0.0])

    def test_dmt(self):
        pull = 4 * np.pi * self.GAMMA * self.RADIUS

        def force(overlap):
            return pull - ia.hertz_force(overlap, self.RADIUS, self.MODULUS)

        balance = brentq(force, 1e-6, 1e-2)
        energy = ia.dmt_binding_energy(self.RADIUS, self.MODULUS, self.GAMMA)
        assert energy == pytest.approx(integral(force, 0.0, balance), rel=1e-9)

    def test_jkr(self):
        """By the contact radius a: overlap a^2/R* - 2 sqrt(pi gamma a/E*), and its force."""
        modulus, gamma, radius = self.MODULUS, self.GAMMA, self.RADIUS

        def overlap(a):
            return a**2 / radius - 2 * np.sqrt(np.pi * gamma * a / modulus)

        def pull(a):
            adhesion = 2 * np.pi * a**2 * np.sqrt(4 * gamma * modulus / (np.pi * a))
            return adhesion - 4 * modulus * a**3 / (3 * radius)

        def work(a):
            return pull(a) * (2 * a / radius - np.sqrt(np.pi * gamma / (modulus * a)))

        touch, balance = brentq(overlap, 1e-4, 1e-2), brentq(pull, 1e-4, 1e-2)
        energy = ia.jkr_binding_energy(radius, modulus, gamma)
        assert energy == pytest.approx(integral(work, touch, balance), rel=1e-9)
        assert energy > 0


class TestEquilibrium:
    LAW = NearFieldLaw(0.5, 1.0, 0.01, 2.0)

    def overlap(self, stiffness, product, law=LAW, radii=(0.05, 0.05)):
        return ia.equilibrium_overlap(
            *radii,
            lambda d: ia.contact_force(d, *radii, stiffness, 2),
            lambda d: ia.near_field_force(d, product, law),
        )

    def test_balance_of_section_9(self):
        stiffness, product = 1.4918e7, 3.6652**2
        depth = self.overlap(stiffness, product)
        # Independently, in powers of the strain: pi/4 K s^2 E^3 (2 - E) against eq. 7.23.
        strain = brentq(
            lambda e: (
                np.pi / 4 * stiffness * 0.01 * e**3 * (2 - e)
                - product * (5 / (1 - e) - 1 / (1 - e) ** 2)
            ),
            1e-3,
            0.2,
            xtol=1e-15,
        )
        assert depth == pytest.approx(0.1 * strain, rel=1e-10)
        assert strain == pytest.approx(0.0629, abs=1e-4)

    def test_none_and_zero(self):
        assert self.overlap(1.0, 13.0) is None
        assert self.overlap(1e7, -13.0) == 0.0
        assert self.overlap(1e7, 13.0, NearFieldLaw(0.5, 1.0, cutoff=0.09)) == 0.0

    def test_a_sphere_about_to_be_swallowed_is_not_held(self):
        # The disk of the contact shrinks there, and jumps once the sphere is inside.
        assert self.overlap(1e4, 1.0, NearFieldLaw(0.5, 1.0), radii=(0.01, 0.3)) is None


def section_9(**changes):
    content = {
        "name": "contact_blast",
        "particles": {
            "count": 125,
            "radius": 0.05,
            "density": 7000.0,
            "charge_per_mass": 10.0,
            "packing": {"domain_radius": 1.0},
        },
        # The pulse speed of 2000 particles and 1e4 J.
        "blast": {"energy": 625.0},
        "fields": {"magnetic": [10.0, 0.0, 0.0]},
        "contact": {
            "stiffness": 1e7,
            "exponent": 2.0,
            "damping": 1e5,
            "friction": {"stiffness": 1e7, "static": 0.4, "dynamic": 0.3},
            "thermal": {"temperature": 300.0, "reference": 500.0, "sensitivity": 1.0, "floor": 1e6},
        },
        "bond": BOND,
        "near_field": NEAR_FIELD,
        "time": {"duration": 1.0, "step": 1.0e-4},
    }
    content |= changes
    return parse_case({key: value for key, value in content.items() if value is not None}, "")


BOND = {"stiffness": 1e6, "exponent": 2.0, "tangential_stiffness": 1e3, "activation_strain": 0.05}
NEAR_FIELD = {
    "scaling": "mass",
    "attraction": {"strength": 0.5, "exponent": 1.0},
    "repulsion": {"strength": 0.01, "exponent": 2.0},
    "cutoff": 0.15,
}
HERTZ = {"law": "hertz", "youngs_modulus": 1e7, "poisson_ratio": 0.3, "damping": 10.0}
NOTHING_BUT_CONTACT = {"bond": None, "near_field": None, "fields": {}}
GRID = 0.3 * np.stack(np.meshgrid(*[np.arange(5.0)] * 3), axis=-1).reshape(-1, 3)
CLOUD = make_particles(GRID)


class TestStepAdvice:
    def scales(self, case, particles=CLOUD):
        return {scale.name: scale for scale in time_scales(case, particles)}

    def test_scales_of_section_9(self):
        scales = self.scales(section_9(blast=None))
        # At a strain of a tenth, nothing moving: A = pi/4 s^2 (1 - 0.9^2).
        area, mass = np.pi / 4 * 0.01 * 0.19, 7000 * 4 / 3 * np.pi * 0.05**3 / 2
        pressure = 1e7 * np.exp(0.4) * 0.01
        stiffness = pressure * (2 * area / 0.01 + np.pi / 2 * 0.09)
        expected = {
            "gyration": 2 * np.pi / 100.0,
            "contact": np.pi * np.sqrt(mass / stiffness),
            "dissipation": mass / (1e5 * area),
            "friction": np.sqrt(mass / (1e7 * area)),
            "bond": np.pi * np.sqrt(mass / (stiffness * np.exp(-0.4) / 10)),
            "bond friction": np.sqrt(mass / (1e3 * area)),
            # |-0.5/d^2 + 0.02/d^3| at touch is 30.
            "near field": np.pi * np.sqrt(mass / (30 * (2 * mass) ** 2)),
        }
        # No two particles of the cloud are within the cutoff, and none moves.
        assert {name: scale.seconds for name, scale in scales.items()} == pytest.approx(expected)

    def test_launch_deepens_the_contact(self):
        fast, slow = (
            self.scales(section_9(blast={"energy": energy}, **NOTHING_BUT_CONTACT))
            for energy in (1e4, 1e-6)
        )
        assert fast["contact"].seconds < 0.6 * slow["contact"].seconds
        assert fast["crossing"].seconds == pytest.approx(1e-5 * slow["crossing"].seconds)

    def test_all_neighbours_count_in_the_near_field(self):
        near_field = {"scaling": "mass", "attraction": {"strength": 0.5, "exponent": 1.0}}
        case = section_9(near_field=near_field | {"cutoff": "all"})
        mass = CLOUD.mass[0]
        gradients = [
            0.5 * mass * sum(1 / d**2 for d in np.linalg.norm(GRID - centre, axis=1) if d > 0)
            for centre in GRID
        ]
        estimate = self.scales(case)["near field of all"].seconds
        # Of sixteen particles, of which the busiest is nearly as busy as any.
        assert estimate == pytest.approx(np.pi / np.sqrt(max(gradients)), rel=0.2)
        assert estimate >= np.pi / np.sqrt(max(gradients)) * (1 - 1e-12)

    @pytest.mark.parametrize("law", ["hooke", "hertz"])
    def test_stock_laws(self, law):
        hooke = {"law": "hooke", "stiffness": 2e5, "damping": 10.0}
        friction = {"static": 0.4, "dynamic": 0.4}
        contact = {"hooke": hooke, "hertz": HERTZ}[law] | {"rotation": True}
        stiffness = 2e5 if law == "hooke" else 2 * 1e7 / 1.82 * np.sqrt(0.025 * 0.01)
        friction |= {"stiffness": 1e5} if law == "hooke" else {}
        tangential = 1e5 if law == "hooke" else 2 * 0.7 / 1.7 * stiffness
        changes = NOTHING_BUT_CONTACT | {"blast": None, "contact": contact | {"friction": friction}}
        scales = self.scales(section_9(**changes))
        mass = CLOUD.mass[0] / 2
        assert scales["contact"].seconds == pytest.approx(np.pi * np.sqrt(mass / stiffness))
        assert scales["dissipation"].seconds == pytest.approx(mass / 10)
        swing = np.pi * np.sqrt(2 / 7 * mass / tangential)
        assert scales["friction"].seconds == pytest.approx(swing)

    def test_an_unequal_cloud_is_judged_by_its_quickest_pair(self):
        mixed = make_particles(GRID, radius=np.where(np.arange(125) % 2, 0.05, 0.01))
        small = make_particles(GRID, radius=0.01)
        case = section_9(blast=None, **NOTHING_BUT_CONTACT)
        assert self.scales(case, mixed)["contact"] == self.scales(case, small)["contact"]

    def test_the_longest_step_resolves_a_bounce_and_much_longer_ones_do_not(self):
        """Two spheres head on, by velocity-Verlet, without dissipation."""
        case = section_9(**NOTHING_BUT_CONTACT | {"contact": {"stiffness": 1e7, "exponent": 2.0}})
        contact = self.scales(case)["contact"]
        speed = np.sqrt(2 * 625.0 / CLOUD.mass.sum())
        errors = [
            abs(bounce(CLOUD.mass[0] / 2, 2 * speed, contact.seconds / steps) - 1)
            for steps in (contact.steps, 1.0)
        ]
        assert errors[0] < 1e-3
        assert errors[1] > 0.1

    def test_the_advised_step_is_fit_and_silences_the_warning(self):
        step, limiting = advised_step(section_9(), CLOUD)
        assert limiting.name == "contact"
        assert step == 1e-4
        assert not list(step_warnings(section_9(), CLOUD))
        (warning,) = step_warnings(section_9(time={"duration": 1.0, "step": 1e-2}), CLOUD)
        assert warning.startswith("time.step is 1.2 times the 0.0083 s of half a swing of two")
        assert "time.step: 0.0001; also too long for: dissipation" in warning

    @pytest.mark.parametrize("duration", [0.37, 1.0, 2.5e-3, np.pi])
    def test_the_advised_step_makes_whole_steps(self, duration):
        time = {"duration": duration, "step": duration / 100}
        step, limiting = advised_step(section_9(time=time), CLOUD)
        assert limiting.longest_step / 4 < step <= limiting.longest_step or step == duration / 100
        assert parse_case(section_9(time={"duration": duration, "step": step}).model_dump(), "")

    def test_cases_without_interactions(self):
        free = section_9(contact=None, **NOTHING_BUT_CONTACT)
        assert time_scales(free, CLOUD) == []
        assert advised_step(free, CLOUD) is None
        medium = {"drag": "stokes", "viscosity": 1e3}
        dragged = section_9(contact=None, medium=medium, **NOTHING_BUT_CONTACT)
        (scale,) = time_scales(dragged, CLOUD)
        assert scale.seconds == pytest.approx(2 * 0.05**2 * 7000 / (9 * 1e3))
        time = {"duration": 1.0, "step": 0.01}
        (warning,) = step_warnings(
            dragged.model_copy(update={"time": section_9(time=time).time}), CLOUD
        )
        assert "in which drag slows a particle: paths come out wrong; take a tenth" in warning

    @pytest.mark.parametrize("other", ["contact", "electric field"])
    def test_forces_between_exact_turns_want_a_part_of_a_turn_a_step(self, other):
        changes = NOTHING_BUT_CONTACT | {"fields": {"magnetic": [0, 0, 10.0]}}
        if other == "electric field":
            changes |= {"contact": None}
            changes["fields"] = changes["fields"] | {"electric": [1.0, 0, 1.0]}
        warned = {}
        for step in (5e-3, 2e-2):  # of a turn of 63 ms
            case = section_9(**changes, time={"duration": 1.0, "step": step})
            warned[step] = any("gyration" in text for text in step_warnings(case, CLOUD))
        assert warned == {5e-3: False, 2e-2: True}
        along = section_9(
            **changes | {"contact": None, "fields": {"magnetic": [0, 0, 10], "electric": [0, 0, 1]}}
        )
        assert "gyration" not in self.scales(along)

    def test_a_collapse_under_all_pairs_is_faster_than_the_launch(self):
        """The speed that it gives: energy set free from the cloud as it is to a dense one."""
        near_field = {"scaling": "mass", "attraction": {"strength": 0.5, "exponent": 1.0}}
        case = section_9(blast=None, near_field=near_field | {"cutoff": "all"}, bond=None)
        mass = CLOUD.mass[0]
        width = np.linalg.norm(GRID - GRID.mean(axis=0), axis=1).max()
        shrinking = (125 * 0.05**3 / 0.64) ** (1 / 3) / width
        i, j = np.triu_indices(125, 1)
        before = np.linalg.norm(GRID[i] - GRID[j], axis=1)
        after = np.maximum(shrinking * before, 0.1)
        released = 0.5 * mass**2 * np.log(before / after).sum()
        speed = np.sqrt(2 * released / (125 * mass))
        assert self.scales(case)["crossing"].seconds == pytest.approx(0.05 / speed, rel=0.05)

    @pytest.mark.parametrize(
        ("integrator", "warned"), [("verlet", True), ("implicit", True), ("lorentz", False)]
    )
    def test_gyration_alone_limits_all_but_the_exact_turns(self, integrator, warned):
        time = {"duration": 1.0, "step": 5e-3, "integrator": integrator}
        case = section_9(
            contact=None, **NOTHING_BUT_CONTACT | {"fields": {"magnetic": [0, 0, 10.0]}}, time=time
        )
        warnings = list(step_warnings(case, CLOUD))
        assert bool(warnings) == warned
        assert not warned or "of a gyration" in warnings[0]


class TestIterationWarnings:
    """What is said of the adaptive scheme before a run."""

    def warnings(self, scheme, **changes):
        time = {"duration": 1.0, "step": 1e-4, "integrator": "implicit", "implicit": scheme}
        case = section_9(contact=None, time=time, **NOTHING_BUT_CONTACT | changes)
        return [text for text in case_warnings(case, CLOUD) if text.startswith("time.implicit")]

    def test_a_sound_case_gives_none(self):
        assert self.warnings({}) == []

    def test_intervals_that_have_little_in_common_cut_steps(self):
        output = {"interval": 0.0333, "restart_interval": 0.0667}
        (warning,) = self.warnings({"max_step": 1e-3}, output=output)
        assert warning.startswith("time.implicit.max_step 0.001 s is not reached")
        assert "whole numbers of 0.0001 s only" in warning

    def test_a_tolerance_below_rounding(self):
        (warning,) = self.warnings({"tolerance": 1e-13})
        assert warning.startswith("time.implicit.tolerance 1e-13 is below the rounding of posit")
        assert self.warnings({"tolerance": 1e-10}) == []

    @pytest.mark.parametrize("phi", [0.45, 0.55])
    def test_a_phi_that_feeds_or_damps_gyrations(self, phi):
        """The factor is that of a thousand steps of the recursion."""
        fields = {"magnetic": [0, 0, 5.0]}
        angle = 50.0 * 1e-3
        velocity = ((1 + 1j * (1 - phi) * angle) / (1 - 1j * phi * angle)) ** 1000
        (warning,) = self.warnings({"phi": phi, "max_step": 1e-3}, fields=fields)
        factor = float(warning.split("energy of gyration by ")[1].split()[0])
        assert factor == pytest.approx(abs(velocity) ** 2, rel=5e-3)
        assert self.warnings({"phi": 0.5, "max_step": 1e-3}, fields=fields) == []


def bounce(mass, speed, step):
    """Return the kinetic energy after a collision, over that before it."""
    distance, velocity, force = 0.1, -speed, 0.0
    for _ in range(100_000):
        velocity += 0.5 * step * force / mass
        distance += step * velocity
        force = float(ia.contact_force(max(distance, 0.0), 0.05, 0.05, 1e7, 2.0))
        velocity += 0.5 * step * force / mass
        if distance > 0.1 and velocity > 0:
            break
    return (velocity / speed) ** 2


class TestPairKinds:
    def test_a_pair_takes_two_particles(self):
        # One of 0.3 m among three of 0.1 m: no pair of two large ones.
        radius = np.array([0.1, 0.3, 0.1, 0.1])
        pairs = pair_kinds(radius, radius**3, np.array([1.0, -5.0, 1.0, 1.0]))
        assert sorted(pairs.reach) == pytest.approx([0.2, 0.4])
        assert sorted(pairs.source_product) == [-5.0, 1.0]

    def test_many_kinds_are_represented_by_their_extremes(self):
        rng = np.random.default_rng(5)
        radius, mass, source = rng.uniform(0.1, 1.0, (3, 5000))
        pairs = pair_kinds(radius, mass, source)
        assert len(pairs.reach) < 1000
        assert pairs.radius_i.min() == radius.min()
        assert max(pairs.radius_j.max(), pairs.radius_i.max()) == radius.max()
        ordered = np.sort(mass)
        for found, (a, b) in (
            (pairs.effective_mass.min(), ordered[:2]),
            (pairs.effective_mass.max(), ordered[-2:]),
        ):
            assert found == pytest.approx(a * b / (a + b))


class TestRefusals:
    def test_section_9_is_accepted(self):
        check_near_field(section_9(), CLOUD)
        check_near_field(section_9(near_field=None), CLOUD)

    def test_attraction_that_a_contact_cannot_carry(self):
        near_field = NEAR_FIELD | {"attraction": {"strength": 500.0, "exponent": 1.0}}
        with pytest.raises(CaseError, match=r"^near_field\.attraction\.strength: .* got 500\.0"):
            check_near_field(section_9(near_field=near_field), CLOUD)
        # Of a single such particle among light ones there is no such pair.
        density = np.where(np.arange(125) == 7, 7000.0, 7.0)
        check_near_field(section_9(near_field=near_field), make_particles(GRID, density=density))

    def test_unlike_signs_attract_by_the_repulsion(self):
        near_field = NEAR_FIELD | {
            "scaling": "charge",
            "repulsion": {"strength": 5.0, "exponent": 2.0},
        }
        near_field["attraction"] = {"strength": 0.5, "exponent": 1.0}
        case = section_9(near_field=near_field)
        unlike = make_particles(GRID, charge=np.where(np.arange(125) % 2, 10.0, -10.0))
        check_near_field(case, make_particles(GRID))
        with pytest.raises(CaseError, match=r"^near_field\.repulsion\.strength: "):
            check_near_field(case, unlike)

    def test_cutoff_below_a_diameter(self):
        assert not list(interaction_warnings(section_9(bond=None), CLOUD))
        case = section_9(near_field=NEAR_FIELD | {"cutoff": 0.09}, bond=None)
        (warning,) = interaction_warnings(case, CLOUD)
        assert warning.startswith("near_field.cutoff 0.09 m is smaller than a particle diameter")

    @pytest.mark.parametrize(
        ("bond", "pulls"),
        [
            ({}, False),
            ({"stiffness": 1.5e7}, True),
            # A lower exponent wins at small strains, which a bond with memory comes to.
            ({"exponent": 1.0}, True),
            # From E* = 0.05 on it is 1e6 E against 1.49e7 E^2: it wins below E = 0.067.
            ({"exponent": 1.0, "memory": "none"}, True),
            ({"exponent": 1.0, "memory": "none", "activation_strain": 0.07}, False),
            ({"exponent": 3.0, "stiffness": 1.4e7}, False),
            ({"exponent": 1.0, "stiffness": 0.0}, False),
        ],
    )
    def test_bonds_that_cannot_pull(self, bond, pulls):
        warnings = list(interaction_warnings(section_9(bond=BOND | bond), CLOUD))
        assert any("cannot pull" in warning for warning in warnings) != pulls
        assert pulls or warnings[0].startswith("bond.stiffness ")


class TestDerivedNumbers:
    def test_section_9(self):
        numbers = derive_numbers(section_9())
        # K_po e^0.4, and the balance of energy 1/2 m_eff (2 v)^2 = pi/4 K s^3 E^4 (1/2 - E/5).
        assert numbers["contact_stiffness"].value == pytest.approx(1.4918247e7, rel=1e-8)
        strain = numbers["launch_strain"].value
        energy = np.pi / 4 * 1.4918247e7 * 1e-3 * strain**4 * (0.5 - strain / 5)
        assert energy == pytest.approx(3.6651914 * 1.6518**2, rel=1e-4)
        assert numbers["near_field_at_touch"].value == pytest.approx(4 * 3.6651914**2)
        assert numbers["equilibrium_strain"].value == pytest.approx(0.0629, abs=1e-4)
        assert numbers["advised_step"].value == 1e-4
        assert numbers["advised_step"].note.startswith("limited by contact")
        assert numbers["friction_time"].value > numbers["dissipation_time"].value > 0

    def test_large_clouds_have_all_but_the_step(self):
        particles = section_9().particles.model_dump() | {"count": 10**7, "radius": 1e-3}
        numbers = derive_numbers(section_9(particles=particles))
        assert numbers["contact_time"].value > 0
        assert numbers["near_field_at_touch"].value is not None
        assert "more than" in numbers["advised_step"].note

    @pytest.mark.parametrize(
        ("changes", "row", "reason"),
        [
            ({"contact": None, "bond": None}, "contact_time", "no contact"),
            ({"contact": None, "bond": None}, "equilibrium_strain", "no contact"),
            ({"contact": HERTZ, "bond": None}, "contact_stiffness", "law hertz"),
            ({"contact": HERTZ, "bond": None}, "friction_time", "no friction"),
            ({"near_field": None}, "near_field_at_touch", "no near field"),
        ],
    )
    def test_absent_numbers_say_why(self, changes, row, reason):
        number = derive_numbers(section_9(**changes))[row]
        assert number.value is None
        assert number.note == reason


def test_every_closed_form_is_on_the_physics_page():
    page = (REPOSITORY / "docs" / "physics.md").read_text(encoding="utf-8")
    module = importlib.import_module("lammps_blast.interactions")
    own = {n for n, f in vars(module).items() if getattr(f, "__module__", "") == module.__name__}
    public = {name for name in own if not name.startswith("_")} - {"NearFieldLaw", "Scaling"}
    assert not {name for name in public if f"interactions.py::{name}`" not in page}


def test_numbers_of_section_9_on_the_physics_page():
    page = (REPOSITORY / "docs" / "physics.md").read_text(encoding="utf-8")
    particles = section_9().particles.model_dump() | {"count": 2000}
    numbers = derive_numbers(section_9(particles=particles, blast={"energy": 1e4}))
    for name, shown, value in [
        ("contact_stiffness", "1.4918·10⁷ N/m²", 1.4918e7),
        ("launch_strain", "0.208", 0.208),
        ("contact_time", "8.32 ms", 8.32e-3),
        ("dissipation_time", "6.27 ms", 6.27e-3),
        ("friction_time", "7.92 ms", 7.92e-3),
        ("near_field_at_touch", "53.7 N", 53.7),
        ("equilibrium_strain", "0.0629", 0.0629),
    ]:
        assert f"| {shown} |" in page
        assert numbers[name].value == pytest.approx(value, rel=2e-3), name
