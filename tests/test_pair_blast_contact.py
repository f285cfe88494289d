"""Pair style blast/contact against an independent evaluation, and its memory, ledger and symmetry."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.integrate import quad

from conftest import lmp, make_particles
from lammps_blast.deck import write_particle_data

STEP = 1.0e-4


@dataclass(frozen=True)
class Law:
    """Arguments of pair_coeff, spelled out."""

    stiffness: float = 1.0e7
    exponent: float = 2.0
    damping: float = 0.0
    friction: tuple[float, float, float] = (0.0, 0.0, 0.0)
    bond: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)  # K_nb, p_b, E*, K_rb
    memory: str = "contact"
    thermal: tuple[float, float, float, float] | None = None

    @property
    def words(self):
        words = f"stiffness {self.stiffness!r} exponent {self.exponent!r} damping {self.damping!r}"
        if self.friction[0]:
            words += " friction {!r} {!r} {!r}".format(*self.friction)
        if self.bond[2]:
            words += " bond {!r} {!r} {!r} {!r}".format(*self.bond) + f" {self.memory}"
        if self.thermal:
            words += " thermal {!r} {!r} {!r} {!r}".format(*self.thermal)
        return words

    @property
    def softened(self):
        if self.thermal is None:
            return self.stiffness
        temperature, reference, sensitivity, floor = self.thermal
        return max(self.stiffness * np.exp(-sensitivity * (temperature / reference - 1)), floor)


PAPER = Law(
    damping=1.0e5,
    friction=(1.0e7, 0.4, 0.3),
    bond=(1.0e6, 2.0, 0.05, 1.0e3),
    thermal=(300.0, 500.0, 1.0, 1.0e6),
)


def pair_forces(law, x, v, w, radius, rotation):
    """Evaluate sections 7.1 to 7.5 for pairs: x, v, w (P, 2, 3), radius (P, 2), in long doubles.

    Returns force on the first of each pair, torques on both, and the sum of the sizes of all terms
    of the force, which may cancel.
    """
    x, v, w, radius = (np.asarray(a, dtype=np.longdouble) for a in (x, v, w, radius))
    offset = x[:, 1] - x[:, 0]
    d = np.sqrt((offset**2).sum(axis=1))
    n = offset / d[:, None]
    r_i, r_j = radius.T
    strain = np.abs(d - (r_i + r_j)) / (r_i + r_j)
    arm_i = (d - (r_j**2 - r_i**2) / d) / 2
    arm_j = d - arm_i
    area = np.where(
        np.abs(arm_i) > r_i, np.minimum(r_i, r_j) ** 2, r_i**2 - arm_i**2
    ) * np.longdouble(np.pi)
    touching = d <= r_i + r_j
    elastic = law.softened * strain**law.exponent * area

    spin = w if rotation else np.zeros_like(w)
    at_i = v[:, 0] + np.cross(spin[:, 0], arm_i[:, None] * n)
    at_j = v[:, 1] + np.cross(spin[:, 1], -arm_j[:, None] * n)
    slip = at_j - at_i
    slip -= (slip * n).sum(axis=1)[:, None] * n
    speed = np.sqrt((slip**2).sum(axis=1))
    tangent = np.divide(slip, speed[:, None], out=np.zeros_like(slip), where=speed[:, None] > 0)
    closing = ((v[:, 1] - v[:, 0]) * n).sum(axis=1)
    stiffness, static, dynamic = law.friction
    trial = stiffness * speed * area * STEP
    friction = np.where(trial < static * elastic, trial, dynamic * elastic) if stiffness else 0

    k_normal, exponent, activation, k_tangential = law.bond
    bonded = (strain >= activation) & (activation > 0)
    normal = law.damping * closing * area - elastic
    normal = normal + np.where(bonded, k_normal * strain**exponent * area, 0)
    across = friction + np.where(bonded, k_tangential * speed * area * STEP, 0)
    force = np.where(touching[:, None], normal[:, None] * n + across[:, None] * tangent, 0)
    torque_i = np.cross(arm_i[:, None] * n, force) * rotation
    torque_j = np.cross(-arm_j[:, None] * n, -force) * rotation
    terms = (elastic, np.abs(law.damping * closing * area), across)
    return force, torque_i, torque_j, sum(terms) * touching


def random_pairs(count, seed):
    """Return x, v, w (P, 2, 3) and radius (P, 2) of pairs from a light touch to one in another."""
    rng = np.random.default_rng(seed)
    radius = 0.05 * np.exp(rng.uniform(-1, 1, (count, 2)))
    reach = radius.sum(axis=1)
    # From a light touch down to nearly concentric; some just apart.
    strain = np.concatenate(
        [10 ** rng.uniform(-2.5, -0.5, count // 2), rng.uniform(0.3, 0.97, count - count // 2)]
    )
    strain[: count // 20] *= -1
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    grid = np.stack(np.unravel_index(np.arange(count), (16, 16, -(-count // 256))), axis=1)
    x = np.stack([grid * 1.0, grid + direction * (reach * (1 - strain))[:, None]], axis=1)
    speed = 10 ** rng.uniform(-4, 1, (count, 1, 1))
    return x, rng.normal(size=x.shape) * speed, rng.normal(size=x.shape) * 10 * speed, radius


def flat(pairs):
    return pairs.reshape(-1, *pairs.shape[2:])


def contact_simulation(simulate, x, v, w, radius, law, *, rotation=True, more=""):
    """Return a simulation of pairs after `run 0`."""
    particles = make_particles(flat(x), velocity=flat(v), spin=flat(w), radius=radius.ravel())
    simulation = simulate(particles)
    simulation.commands(f"""
        neighbor 0.01 nsq
        comm_modify cutoff 0.0 vel yes
        timestep {STEP!r}
        pair_style blast/contact rotation {"yes" if rotation else "no"}
        pair_coeff * * {law.words}
        compute pair all pair blast/contact
        {more}
        thermo_style custom step pe ke c_pair c_pair[1] c_pair[2] c_pair[3] c_pair[4]
        run 0
    """)
    return simulation


LAWS = {
    "paper": PAPER,
    "elastic": Law(),
    "half exponents": replace(PAPER, exponent=1.5, bond=(3.0e6, 0.5, 0.02, 1.0e4)),
    "real exponents": replace(PAPER, exponent=1.37, bond=(3.0e6, 0.81, 0.3, 1.0e4)),
    "linear": Law(exponent=0.0, damping=2.0e4),
    "sticks": Law(friction=(1.0e3, 0.9, 0.5)),
    "slips": Law(friction=(1.0e12, 0.4, 0.3)),
    "floor": Law(thermal=(900.0, 300.0, 3.0, 2.0e6)),
    "bond without memory": replace(PAPER, memory="none"),
}


@pytest.mark.parametrize("rotation", [True, False])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_forces_and_torques_of_random_pairs(simulate, law, rotation):
    x, v, w, radius = random_pairs(2000, seed=7)
    simulation = contact_simulation(simulate, x, v, w, radius, law, rotation=rotation)
    force, torque_i, torque_j, size = pair_forces(law, x, v, w, radius, rotation)
    size = size.astype(float)[:, None]
    measured = simulation.per_atom("f").reshape(-1, 2, 3)
    torque = simulation.per_atom("torque").reshape(-1, 2, 3)
    assert np.count_nonzero(size) >= 1900
    assert np.all(np.abs(measured[:, 0] - force) <= 1e-12 * size)
    np.testing.assert_array_equal(measured[:, 1], -measured[:, 0])
    # The contact point of a swallowed sphere, eq. B.6, may lie far outside of both.
    d = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    arm = radius.sum(axis=1) + np.abs(radius[:, 0] ** 2 - radius[:, 1] ** 2) / d
    for turned, expected in zip((torque[:, 0], torque[:, 1]), (torque_i, torque_j), strict=True):
        assert np.all(np.abs(turned - expected) <= 1e-12 * size * arm[:, None])


def test_random_pairs_reach_every_branch():
    x, v, w, radius = random_pairs(2000, seed=7)
    d = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    strain = 1 - d / radius.sum(axis=1)
    swallowed = d < np.abs(radius[:, 0] - radius[:, 1])
    assert min((strain < 0).sum(), swallowed.sum(), (strain < 0.05).sum()) > 50
    sticking = pair_forces(replace(PAPER, damping=0.0), x, v, w, radius, True)[0]
    slipping = pair_forces(replace(PAPER, damping=0.0, friction=(1.0e20, 0.4, 0.3)), x, v, w,
                           radius, True)[0]
    same = np.all(sticking == slipping, axis=1) & (strain > 0)
    assert 50 < same.sum() < 1900


def test_exact_touch_is_no_force(simulate):
    x = np.array([[[0.0, 0, 0], [0.125, 0, 0]]])
    radius = np.array([[0.0625, 0.0625]])
    v = np.array([[[1.0, 1, 0], [-1, 0, 1]]])
    simulation = contact_simulation(simulate, x, v, v, radius, replace(PAPER, exponent=0.5))
    assert not simulation.per_atom("f").any()
    assert simulation.lammps.extract_compute("pair", 0, 1)[2] == 1.0


def test_coincident_centres_stop_with_both_ids(simulate):
    x = np.array([[[0.0, 0, 0], [1.0, 0, 0]], [[2.0, 0, 0], [0.0, 0, 0]]])
    with pytest.raises(Exception, match="atoms (1 and 4|4 and 1) coincide"):
        contact_simulation(simulate, x, 0 * x, 0 * x, np.full((2, 2), 0.05), PAPER)


@pytest.mark.parametrize("radii", [(0.05, 0.05), (0.05, 0.08), (0.02, 0.09)])
@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.5, 2.0, 3.3])
@pytest.mark.parametrize("strain", [1e-3, 0.1, 0.45, 0.6, 0.9])
def test_energy_is_the_integral_of_the_force(simulate, radii, exponent, strain):
    law = Law(exponent=exponent, bond=(4.0e6, exponent + 0.5, 1e-4, 0.0))
    radius = np.array([radii])
    x = np.array([[[0.0, 0, 0], [sum(radii) * (1 - strain), 0, 0]]])
    simulation = contact_simulation(simulate, x, 0 * x, 0 * x, radius, law)
    energies = simulation.lammps.numpy.extract_compute("pair", 0, 1)

    def force(depth, stiffness, power):
        d = sum(radii) * (1 - depth)
        pair = np.array([[[0.0, 0, 0], [d, 0, 0]]])
        only = Law(stiffness=stiffness, exponent=power)
        return float(-pair_forces(only, pair, 0 * pair, 0 * pair, radius, False)[0][0, 0])

    rim = 1 - abs(radii[0] - radii[1]) / sum(radii)
    for energy, stiffness, power, sign in (
        (energies[0], law.stiffness, exponent, 1),
        (energies[1], law.bond[0], law.bond[1], -1),
    ):
        ends = [0.0, *(p for p in (0.01, 0.3, rim) if p < strain), strain]
        work = sum(
            quad(force, a, b, args=(stiffness, power), epsabs=0, epsrel=1e-12, limit=200)[0]
            for a, b in zip(ends, ends[1:], strict=False)
        )
        assert energy == pytest.approx(sign * sum(radii) * work, rel=1e-10)
