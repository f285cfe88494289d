"""Pair style blast/contact against an independent evaluation; its bonds, symmetries and ranks."""

import re
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import SYSTEM, lmp, make_particles
from scipy.integrate import quad, simpson

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


@dataclass(frozen=True)
class Contacts:
    """Pairs (P, ...) that sections 7.1 to 7.5 were evaluated for; zero where they do not touch."""

    touching: np.ndarray
    strain: np.ndarray
    elastic: np.ndarray
    damping: np.ndarray  # on the first, along the normal
    friction: np.ndarray
    bond: np.ndarray
    bond_friction: np.ndarray
    normal: np.ndarray  # (P, 3)
    tangent: np.ndarray
    arms: tuple[np.ndarray, np.ndarray]  # zero without rotation

    @property
    def force(self):
        """Force on the first of each pair."""
        along = self.bond + self.damping - self.elastic
        across = self.friction + self.bond_friction
        return along[:, None] * self.normal + across[:, None] * self.tangent

    @property
    def torques(self):
        turning = np.cross(self.normal, self.force)
        return self.arms[0][:, None] * turning, self.arms[1][:, None] * turning

    @property
    def size(self):
        """Sum of the sizes of all terms of the force, which may cancel."""
        return self.elastic + np.abs(self.damping) + self.friction + self.bond + self.bond_friction

    @property
    def rows(self):
        """What compute blast/contact/local is to say of each pair, but for its ids."""
        forces = (self.elastic, -self.damping, self.friction, self.bond, self.bond_friction)
        return np.column_stack([self.strain, *forces])


def evaluate(law, x, v, w, radius, rotation, step=STEP):
    """Evaluate sections 7.1 to 7.5 in long doubles for pairs: x, v, w (P, 2, 3), radius (P, 2)."""
    x, v, w, radius = (np.asarray(a, dtype=np.longdouble) for a in (x, v, w, radius))
    offset = x[:, 1] - x[:, 0]
    d = np.sqrt((offset**2).sum(axis=1))
    n = offset / d[:, None]
    r_i, r_j = radius.T
    touching = d <= r_i + r_j
    strain = np.abs(d - (r_i + r_j)) / (r_i + r_j)
    arm_i = (d - (r_j**2 - r_i**2) / d) / 2
    swallowed = np.abs(arm_i) > r_i
    square = np.where(swallowed, np.minimum(r_i, r_j) ** 2, r_i**2 - arm_i**2)
    area = touching * square * np.pi
    arms = (arm_i, d - arm_i) if rotation else (0 * d, 0 * d)
    elastic = law.softened * strain**law.exponent * area

    at_i = v[:, 0] + np.cross(w[:, 0], arms[0][:, None] * n)
    at_j = v[:, 1] + np.cross(w[:, 1], -arms[1][:, None] * n)
    slip = at_j - at_i
    slip -= (slip * n).sum(axis=1)[:, None] * n
    speed = np.sqrt((slip**2).sum(axis=1))
    tangent = np.divide(slip, speed[:, None], out=np.zeros_like(slip), where=speed[:, None] > 0)
    closing = ((v[:, 1] - v[:, 0]) * n).sum(axis=1)
    stiffness, static, dynamic = law.friction
    trial = stiffness * speed * area * step
    slips = (trial >= static * elastic) & (speed > 0)
    friction = np.where(slips, dynamic * elastic, trial) * (stiffness > 0)

    k_normal, exponent, activation, k_tangential = law.bond
    bonded = (strain >= activation) & (activation > 0)
    return Contacts(
        touching=touching,
        strain=strain,
        elastic=elastic,
        damping=law.damping * closing * area,
        friction=friction,
        bond=bonded * k_normal * strain**exponent * area,
        bond_friction=bonded * k_tangential * speed * area * step,
        normal=n,
        tangent=tangent,
        arms=arms,
    )


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
    contacts = evaluate(law, x, v, w, radius, rotation)
    size = contacts.size.astype(float)[:, None]
    measured = simulation.per_atom("f").reshape(-1, 2, 3)
    torque = simulation.per_atom("torque").reshape(-1, 2, 3)
    assert np.count_nonzero(size) >= 1900
    assert np.all(np.abs(measured[:, 0] - contacts.force) <= 1e-12 * size)
    np.testing.assert_array_equal(measured[:, 1], -measured[:, 0])
    # The contact point of a swallowed sphere, eq. B.6, may lie far outside of both.
    d = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    arm = radius.sum(axis=1) + np.abs(radius[:, 0] ** 2 - radius[:, 1] ** 2) / d
    for turned, expected in zip((torque[:, 0], torque[:, 1]), contacts.torques, strict=True):
        assert np.all(np.abs(turned - expected) <= 1e-12 * size * arm[:, None])


def test_random_pairs_reach_every_branch():
    x, v, w, radius = random_pairs(2000, seed=7)
    contacts = evaluate(PAPER, x, v, w, radius, True)
    d = np.linalg.norm(x[:, 1] - x[:, 0], axis=1)
    swallowed = d < np.abs(radius[:, 0] - radius[:, 1])
    sticks = contacts.friction < PAPER.friction[2] * contacts.elastic
    slips = contacts.friction == PAPER.friction[2] * contacts.elastic
    branches = [~contacts.touching, swallowed, contacts.bond == 0, contacts.damping > 0]
    branches += [contacts.touching & sticks, contacts.touching & slips]
    assert min(branch.sum() for branch in branches) > 50


def test_exact_touch_is_no_force(simulate):
    x = np.array([[[0.0, 0, 0], [0.125, 0, 0]]])
    radius = np.array([[0.0625, 0.0625]])
    v = np.array([[[1.0, 1, 0], [-1, 0, 1]]])
    simulation = contact_simulation(simulate, x, v, v, radius, replace(PAPER, exponent=0.5))
    assert not simulation.per_atom("f").any()
    assert simulation.lammps.extract_compute("pair", 0, 1)[2] == 1.0


def test_coincident_centres_stop_with_both_ids(simulate):
    x = np.array([[[0.0, 0, 0], [1.0, 0, 0]], [[2.0, 0, 0], [0.0, 0, 0]]])
    with pytest.raises(Exception, match=r"atoms (1 and 4|4 and 1) coincide"):
        contact_simulation(simulate, x, 0 * x, 0 * x, np.full((2, 2), 0.05), PAPER)


def work_of_force(stiffness, exponent, radii, start, end):
    """Integrate eq. 7.5 over the distance between two strains."""
    radius, reach = np.array([radii]), sum(radii)
    law = Law(stiffness=stiffness, exponent=exponent)

    def force(strain):
        x = np.array([[[0.0, 0, 0], [reach * (1 - strain), 0, 0]]])
        return float(evaluate(law, x, 0 * x, 0 * x, radius, False).elastic[0])

    rim = 1 - abs(radii[0] - radii[1]) / reach
    ends = [start, *(strain for strain in (0.01, 0.3, rim) if start < strain < end), end]
    return reach * sum(
        quad(force, a, b, epsabs=0, epsrel=1e-12, limit=200)[0] for a, b in pairwise(ends)
    )


@pytest.mark.parametrize("radii", [(0.05, 0.05), (0.05, 0.08), (0.02, 0.09)])
@pytest.mark.parametrize("exponent", [0.0, 0.5, 1.5, 2.0, 3.3])
@pytest.mark.parametrize("strain", [1e-3, 0.1, 0.45, 0.6, 0.9])
def test_energy_is_the_integral_of_the_force(simulate, radii, exponent, strain):
    """From touch on; for a bond without memory from the strain that activates it."""
    power = exponent + 0.5
    x = np.array([[[0.0, 0, 0], [sum(radii) * (1 - strain), 0, 0]]])
    contact_work = work_of_force(1.0e7, exponent, radii, 0, strain)
    for memory, start in (("contact", 0.0), ("none", 0.05)):
        law = Law(exponent=exponent, bond=(4.0e6, power, 0.05, 0.0), memory=memory)
        simulation = contact_simulation(simulate, x, 0 * x, 0 * x, np.array([radii]), law)
        contact, bond = simulation.lammps.numpy.extract_compute("pair", 0, 1)[:2]
        assert contact == pytest.approx(contact_work, rel=1e-10)
        work = work_of_force(4.0e6, power, radii, start, strain) if strain > 0.05 else 0.0
        assert bond == pytest.approx(-work, rel=1e-10)


def overlapping_cloud(side, seed):
    """Return moving and turning spheres of unequal sizes, each in several contacts."""
    rng = np.random.default_rng(seed)
    lattice = np.stack(np.unravel_index(np.arange(side**3), (side,) * 3), axis=1) * 0.085
    count = len(lattice)
    return make_particles(
        lattice + rng.uniform(-0.01, 0.01, (count, 3)),
        velocity=rng.normal(size=(count, 3)),
        spin=20 * rng.normal(size=(count, 3)),
        radius=0.05 * np.exp(rng.uniform(-0.2, 0.2, count)),
        density=rng.uniform(1000.0, 9000.0, count),
    )


@dataclass(frozen=True)
class CloudContacts:
    """All contacts of a cloud, with what they add up to on each particle."""

    first: np.ndarray  # (C,)
    second: np.ndarray
    contacts: Contacts
    force: np.ndarray  # (N, 3)
    force_size: np.ndarray  # (N, 1)
    torque: np.ndarray
    torque_size: np.ndarray


def cloud_contacts(law, particles, rotation=True):
    i, j = np.triu_indices(len(particles), 1)
    x, v, w, radius = (
        np.stack([values[i], values[j]], axis=1)
        for values in (
            particles.position,
            particles.velocity,
            particles.angular_velocity,
            particles.radius,
        )
    )
    touching = np.linalg.norm(x[:, 1] - x[:, 0], axis=1) <= radius.sum(axis=1)
    i, j, x, v, w, radius = (values[touching] for values in (i, j, x, v, w, radius))
    contacts = evaluate(law, x, v, w, radius, rotation)
    count = len(particles)
    sums = {
        "force": np.zeros((count, 3), dtype=np.longdouble),
        "force_size": np.zeros((count, 1), dtype=np.longdouble),
        "torque": np.zeros((count, 3), dtype=np.longdouble),
        "torque_size": np.zeros((count, 1), dtype=np.longdouble),
    }
    for ends, sign, torque, arm in zip((i, j), (1, -1), contacts.torques, radius.T, strict=True):
        np.add.at(sums["force"], ends, sign * contacts.force)
        np.add.at(sums["torque"], ends, torque)
        np.add.at(sums["force_size"], ends, contacts.size[:, None])
        np.add.at(sums["torque_size"], ends, (contacts.size * arm)[:, None])
    return CloudContacts(i, j, contacts, **sums)


def system_commands(newton="on"):
    return f"""
        {SYSTEM.replace("units si", f"units si{chr(10)}newton {newton}")}
        neighbor 0.01 nsq
        neigh_modify every 1 delay 0 check yes
        comm_modify cutoff 0.0 vel yes
        timestep {STEP!r}
        compute virial all pressure NULL virial
        compute each all pe/atom
        thermo_style custom step pe c_virial c_virial[1]
    """


NEAR_FIELD = "0.2 mass", "0.5 1 0.01 2"


def pair_commands(law, rotation="yes", style="both"):
    """Return the contact, the near field, or both by hybrid/overlay."""
    settings, coefficients = NEAR_FIELD
    return {
        "contact": f"""
            pair_style blast/contact rotation {rotation}
            pair_coeff * * {law.words}
        """,
        "near field": f"""
            pair_style blast/nearfield {settings}
            pair_coeff * * {coefficients}
        """,
        "both": f"""
            pair_style hybrid/overlay blast/contact rotation {rotation} blast/nearfield {settings}
            pair_coeff * * blast/contact {law.words}
            pair_coeff * * blast/nearfield {coefficients}
        """,
        "all": f"""
            pair_style hybrid/overlay blast/nearfield all mass blast/contact rotation {rotation}
            pair_coeff * * blast/contact {law.words}
            pair_coeff * * blast/nearfield {coefficients}
        """,
    }[style]


def cloud_simulation(simulate, particles, law, *, newton="on", style="contact", more="run 0"):
    simulation = simulate(particles)
    pair = pair_commands(law, style=style)
    simulation.commands(f"clear\n{system_commands(newton)}\n{pair}\n{more}")
    return simulation


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("law", LAWS.values(), ids=LAWS.keys())
def test_forces_of_a_cloud_and_its_contacts_row_by_row(simulate, law, newton):
    particles = overlapping_cloud(5, seed=21)
    cloud = cloud_contacts(law, particles)
    more = """
        group some id 1:70
        compute rows all blast/contact/local
        compute some some blast/contact/local
        run 0
    """
    simulation = cloud_simulation(simulate, particles, law, newton=newton, more=more)
    assert len(cloud.first) > 250
    assert np.all(np.abs(simulation.per_atom("f") - cloud.force) <= 1e-12 * cloud.force_size)
    error = np.abs(simulation.per_atom("torque") - cloud.torque)
    assert np.all(error <= 1e-12 * cloud.torque_size)

    rows, some = (
        np.array(simulation.lammps.numpy.extract_compute(name, 2, 2)) for name in ("rows", "some")
    )
    assert_rows(rows, cloud)
    np.testing.assert_array_equal(some, rows[(rows[:, :2] <= 70).all(axis=1)])


def assert_rows(rows, cloud):
    """Assert that each contact has one row, with its forces."""
    rows = np.hstack([np.sort(rows[:, :2], axis=1), rows[:, 2:]])
    rows = rows[np.lexsort([rows[:, 1], rows[:, 0]])]
    np.testing.assert_array_equal(rows[:, :2], np.column_stack([cloud.first, cloud.second]) + 1)
    expected = cloud.contacts.rows
    size = np.hstack([np.ones((len(rows), 1)), np.tile(cloud.contacts.size[:, None], 5)])
    assert np.all(np.abs(rows[:, 2:] - expected) <= 1e-12 * size)


@pytest.mark.parametrize("memory", ["contact", "none"])
def test_single_gives_the_forces_that_do_not_depend_on_velocities(simulate, memory):
    """In compute pair/local, which visits each pair, with the energies that pe/atom shares out."""
    law = replace(PAPER, exponent=1.5, bond=(3.0e6, 0.5, 0.05, 1.0e3), memory=memory)
    particles = overlapping_cloud(5, seed=28)
    more = """
        compute ids all property/local patom1 patom2 cutoff radius
        compute single all pair/local force eng cutoff radius
        run 0
    """
    simulation = cloud_simulation(simulate, particles, law, more=more)
    ids = np.sort(np.array(simulation.lammps.numpy.extract_compute("ids", 2, 2)), axis=1)
    force, energy = np.array(simulation.lammps.numpy.extract_compute("single", 2, 2)).T
    order = np.lexsort([ids[:, 1], ids[:, 0]])
    cloud = cloud_contacts(law, particles)
    np.testing.assert_array_equal(ids[order], np.column_stack([cloud.first, cloud.second]) + 1)
    contacts = cloud.contacts
    expected = (contacts.elastic - contacts.bond).astype(float)
    size = (contacts.elastic + contacts.bond).astype(float)
    assert np.all(np.abs(force[order] - expected) <= 1e-12 * size)
    assert energy.sum() == pytest.approx(simulation.lammps.get_thermo("pe"), rel=1e-11)
    assert np.count_nonzero(contacts.bond) > 100


@pytest.mark.parametrize("style", ["contact", "both", "all"])
def test_momentum_is_conserved_to_rounding(simulate, style):
    particles = overlapping_cloud(5, seed=22)
    simulation = cloud_simulation(simulate, particles, PAPER, style=style)
    force, torque = simulation.per_atom("f"), simulation.per_atom("torque")
    size = np.abs(force).sum()
    assert np.all(np.abs(force.sum(axis=0)) < 1e-14 * size)
    moment = np.cross(particles.position, force) + torque
    assert np.all(np.abs(moment.sum(axis=0)) < 1e-14 * size)


@pytest.mark.parametrize("style", ["contact", "both", "all"])
def test_forces_turn_with_the_whole_scene(simulate, style):
    angle = 0.7
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    ) @ np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    cloud = overlapping_cloud(5, seed=23)
    turned = replace(
        cloud,
        position=cloud.position @ turn.T,
        velocity=cloud.velocity @ turn.T,
        angular_velocity=cloud.angular_velocity @ turn.T,
    )
    straight, oblique = (
        cloud_simulation(simulate, particles, PAPER, style=style) for particles in (cloud, turned)
    )
    for name in ("f", "torque"):
        expected = straight.per_atom(name)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(oblique.per_atom(name) @ turn, expected, atol=1e-12 * scale)


@pytest.mark.parametrize("newton", ["on", "off"])
def test_overlay_is_the_sum_of_both_styles(simulate, newton):
    particles = overlapping_cloud(5, seed=24)
    states = {}
    for style in ("contact", "near field", "both"):
        simulation = cloud_simulation(simulate, particles, PAPER, style=style, newton=newton)
        volume = simulation.lammps.get_thermo("vol")
        states[style] = (
            simulation.per_atom("f"),
            simulation.per_atom("torque"),
            simulation.lammps.get_thermo("pe"),
            volume * np.array(simulation.lammps.numpy.extract_compute("virial", 0, 1)),
        )
    for contact, near, both in zip(*states.values(), strict=True):
        scale = np.abs(contact).max() + np.abs(near).max()
        np.testing.assert_allclose(both, contact + near, rtol=0, atol=1e-12 * scale)
    cloud = cloud_contacts(PAPER, particles)
    offset = particles.position[cloud.second] - particles.position[cloud.first]
    # LAMMPS keeps x fy of the two halves of a tensor that friction makes unsymmetric.
    virial = -np.einsum("pk,pl->kl", offset, cloud.contacts.force.astype(float))
    expected = virial[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(states["contact"][3], expected, rtol=1e-11)


def state_commands(name):
    """Return commands that leave forces, torques, contacts and totals in files."""
    return f"""
        compute rows all blast/contact/local
        compute pair all pair blast/contact
        thermo_style custom step pe c_pair c_virial
        run 0
        write_dump all custom {name}.forces id fx fy fz tqx tqy tqz c_each &
          modify sort id format float %.17g
        write_dump all local {name}.rows c_rows[1] c_rows[2] c_rows[3] c_rows[4] c_rows[5] &
          c_rows[6] c_rows[7] c_rows[8] modify format float %.17g
        print "$(pe:%.17g) $(c_pair[1]:%.17g) $(c_pair[2]:%.17g) $(c_pair[3]:%.17g) &
$(c_pair[4]:%.17g) $(c_virial[1]:%.17g) $(c_virial[2]:%.17g) $(c_virial[3]:%.17g) &
$(c_virial[4]:%.17g) $(c_virial[5]:%.17g) $(c_virial[6]:%.17g)" file {name}.totals
        thermo_style one
        uncompute pair
        uncompute rows
    """


def test_ranks_and_newton_agree(tmp_path):
    particles = overlapping_cloud(5, seed=25)
    cloud = cloud_contacts(PAPER, particles)
    alone = {}
    for ranks, newton in ((1, "on"), (1, "off"), (2, "on"), (2, "off"), (3, "on")):
        folder = tmp_path / f"{ranks}-{newton}"
        folder.mkdir()
        write_particle_data(particles, folder / "particles.data")
        deck = system_commands(newton)
        for style in ("contact", "both", "all"):
            deck += pair_commands(PAPER, style=style) + state_commands(style)
        (folder / "in.deck").write_text(deck)
        done = lmp("-in", "in.deck", "-log", "none", folder=folder, ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        for style in ("contact", "both", "all"):
            assert_rows(np.loadtxt(folder / f"{style}.rows", skiprows=9), cloud)
            state = np.loadtxt(folder / f"{style}.forces", skiprows=9)[:, 1:]
            totals = np.loadtxt(folder / f"{style}.totals")
            first_state, first_totals = alone.setdefault(style, (state, totals))
            for quantity in (slice(0, 3), slice(3, 6), slice(6, 7)):
                expected = first_state[:, quantity]
                tolerance = 1e-12 * np.abs(expected).max()
                np.testing.assert_allclose(state[:, quantity], expected, rtol=0, atol=tolerance)
            np.testing.assert_allclose(totals, first_totals, rtol=1e-11)
            assert state[:, 6].sum() == pytest.approx(totals[0], rel=1e-11)
            assert totals[3] == len(cloud.first)
            assert totals[4] == np.count_nonzero(cloud.contacts.bond) > 50


@pytest.mark.parametrize("step", [1e-4, 2e-4, 1e-2])
@pytest.mark.parametrize("part", [1e-6, 0.5, 0.999, 1.001, 1e3])
def test_stick_grows_with_slip_and_step_until_it_slips(simulate, part, step):
    """One sphere pressed on another: eq. 7.12 below mu_s F_normal, mu_d F_normal beyond."""
    law = Law(friction=(1.0e6, 0.5, 0.2))
    d = 0.0985
    area = np.pi * (0.05**2 - d**2 / 4)
    pressed = 1.0e7 * (1 - d / 0.1) ** 2 * area
    slip = part * 0.5 * pressed / (1.0e6 * area * step)
    x = np.array([[[0.0, 0, 0], [0.0, 0, d]]])
    v = np.array([[[0.0, 0, 0], [0.6 * slip, 0.8 * slip, 0]]])
    radius = np.array([[0.05, 0.05]])
    more = f"timestep {step}"
    simulation = contact_simulation(simulate, x, v, 0 * v, radius, law, more=more)
    friction = (part * 0.5 if part < 1 else 0.2) * pressed
    expected = [0.6 * friction, 0.8 * friction, -pressed]
    np.testing.assert_allclose(simulation.per_atom("f")[0], expected, rtol=1e-11)


def test_spheres_that_roll_on_each_other_do_not_rub(simulate):
    """Unequal spheres whose surfaces move alike at the contact point of eq. B.6."""
    radius = np.array([[0.05, 0.08]])
    d = 0.125
    arm = (d - (0.08**2 - 0.05**2) / d) / 2
    x = np.array([[[0.0, 0, 0], [d, 0, 0]]])
    v = np.array([[[0.0, 2.0, 0], [0, -1.5, 0]]])
    law = Law(friction=(1.0e8, 0.4, 0.3))
    # omega x r, with the surfaces of both at rest
    w = np.array([[[0, 0, -2.0 / arm], [0, 0, -1.5 / (d - arm)]]])
    forces = []
    for spin, rotation in ((w, True), (0 * w, True), (w, False)):
        simulation = contact_simulation(simulate, x, v, spin, radius, law, rotation=rotation)
        forces.append(simulation.per_atom("f")[0, 1] / simulation.per_atom("f")[0, 0])
    assert abs(forces[0]) < 1e-12
    assert forces[1:] == pytest.approx([0.3, 0.3], rel=1e-12)


@pytest.mark.parametrize("style", ["contact", "both", "all"])
def test_momentum_and_its_moment_are_kept_through_many_collisions(simulate, style):
    rng = np.random.default_rng(26)
    lattice = np.stack(np.unravel_index(np.arange(125), (5, 5, 5)), axis=1) * 0.12 - 0.24
    particles = make_particles(
        lattice,
        velocity=rng.normal(size=(125, 3)) - 10 * lattice + np.cross([0, 0, 3.0], lattice),
        spin=20 * rng.normal(size=(125, 3)),
        radius=0.05 * np.exp(rng.uniform(-0.1, 0.1, 125)),
    )
    inertia = 0.4 * particles.mass * particles.radius**2

    def momenta(simulation):
        x, v, w = (simulation.per_atom(name) for name in ("x", "v", "omega"))
        momentum = particles.mass[:, None] * v
        return np.hstack([momentum, np.cross(x, momentum) + inertia[:, None] * w])

    simulation = cloud_simulation(simulate, particles, PAPER, style=style)
    start = momenta(simulation)
    simulation.commands("""
        compute pair all pair blast/contact
        variable contacts equal c_pair[3]
        variable bonds equal c_pair[4]
        fix integrate all nve/sphere
        fix mean all ave/time 1 1 1 v_contacts v_bonds mode scalar ave running
        run 1500
    """)
    end = momenta(simulation)
    contacts, bonds = (simulation.lammps.extract_fix("mean", 0, 1, n) for n in range(2))
    assert contacts > 60
    assert bonds > 10
    change = np.abs((end - start).sum(axis=0))
    assert np.all(change < 1e-11 * np.abs(end).sum(axis=0))
    assert np.abs(end - start).sum() > 0.5 * np.abs(start).sum()


BONDING = Law(stiffness=1.0e7, bond=(2.0e6, 1.0, 0.05, 1.0e3))


def paired_lattice():
    """Return 27 pairs along x, 0.102 m apart, odd ids on the left; some about x = 0 and x = 1 m."""
    middle = np.stack(np.unravel_index(np.arange(27), (3, 3, 3)), axis=1) * 0.5 - 0.5
    half = np.array([0.051, 0.0, 0.0])
    return make_particles(np.stack([middle - half, middle + half], axis=1).reshape(-1, 3))


def drive(name, speed, drift, steps):
    """Return commands that part the pairs at a speed while all drift, then write the contacts."""
    x, y, z = drift
    return f"""
        fix left odd move linear {x - speed / 2!r} {y} {z}
        fix right even move linear {x + speed / 2!r} {y} {z}
        run {steps}
        write_dump all local {name}.rows c_rows[1] c_rows[2] c_rows[3] c_rows[7] &
          modify format float %.17g
        unfix left
        unfix right
    """


DRIVEN = """
    neighbor 0.02 nsq
    neigh_modify every 1 delay 0 check no
    comm_modify cutoff 0.3 vel yes
    timestep 1e-3
    variable odd atom "id % 2 == 1"
    variable even atom "id % 2 == 0"
    group odd variable odd
    group even variable even
    compute rows all blast/contact/local
    thermo_modify lost error
"""
DRIFT = (70.0, 37.0, -11.0)
PRESS = drive("pressed", -0.4, (0, 0, 0), 20)  # to 0.094 m, strain 0.06
LOOSEN = drive("loosened", 0.4, DRIFT, 10)  # to 0.098 m, strain 0.02
PART_AND_TOUCH = drive("apart", 0.4, DRIFT, 10) + drive("touching", -0.4, DRIFT, 10)


def driven_deck(law):
    """Return the deck up to `PRESS`, in a periodic box, with particles sorted now and then."""
    system = SYSTEM.replace("sort 0 0.0", "sort 3 0.5").replace("s s s", "p p p")
    system = system.replace("read_data", "processors * 1 1\nread_data")
    return f"""
        {system}
        change_box all x final -1 1 y final -1 1 z final -1 1
        displace_atoms all move 0.5 0.0 0.0
        pair_style blast/contact
        pair_coeff * * {law.words}
        {DRIVEN}
    """


def bond_rows(folder, name):
    """Return ids (27, 2), strain and bond force (27,) of a dump that holds all pairs once."""
    rows = np.atleast_2d(np.loadtxt(folder / f"{name}.rows", skiprows=9))
    ids = np.sort(rows[:, :2], axis=1)
    order = np.argsort(ids[:, 0])
    np.testing.assert_array_equal(ids[order], np.arange(1, 55).reshape(27, 2))
    return rows[order, 2], rows[order, 3]


def strong_bond(strain):
    d = 0.1 * (1 - strain)
    return 2.0e6 * strain * np.pi * (0.05**2 - d**2 / 4)


def run_deck(folder, deck, ranks):
    (folder / "in.deck").write_text(deck)
    done = lmp("-in", "in.deck", "-log", "none", folder=folder, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("ranks", [1, 2])
def test_bonds_last_across_ranks_sorting_and_restarts(tmp_path, ranks, newton):
    """Pairs bond, some as ghosts of each other; drift through a periodic box; part; touch again."""
    write_particle_data(paired_lattice(), tmp_path / "particles.data")
    deck = f"newton {newton}\n{driven_deck(BONDING)}{PRESS}write_restart state\n"
    run_deck(tmp_path, deck + LOOSEN + PART_AND_TOUCH, ranks)

    def assert_memory():
        strain, bond = bond_rows(tmp_path, "loosened")
        assert strain == pytest.approx(0.02, rel=1e-9)
        assert bond == pytest.approx(strong_bond(strain), rel=1e-12)
        strain, bond = bond_rows(tmp_path, "touching")
        assert strain == pytest.approx(0.02, rel=1e-9)
        assert (bond == 0).all()

    strain, bond = bond_rows(tmp_path, "pressed")
    assert bond == pytest.approx(strong_bond(strain), rel=1e-12)
    assert_memory()
    # The restart file goes to the other number of ranks.
    run_deck(tmp_path, f"read_restart state\n{DRIVEN}{LOOSEN}{PART_AND_TOUCH}", 3 - ranks)
    assert_memory()


def test_bonds_without_memory_end_below_the_activation_strain(tmp_path):
    write_particle_data(paired_lattice(), tmp_path / "particles.data")
    law = replace(BONDING, memory="none")
    run_deck(tmp_path, driven_deck(law) + PRESS + LOOSEN, ranks=1)
    strain, bond = bond_rows(tmp_path, "pressed")
    assert bond == pytest.approx(strong_bond(strain), rel=1e-12)
    assert (bond_rows(tmp_path, "loosened")[1] == 0).all()


@pytest.mark.parametrize("skin", [0.0, 1e-4, 0.02])
def test_a_bond_ends_when_a_pair_parts_between_two_lists(simulate, skin):
    """Even where one step takes the pair out of the list's reach."""
    simulation = bound_pair(simulate, law=BONDING, distance=0.093, step=1e-3)
    simulation.commands(f"neighbor {skin} nsq\ngroup moved id 2")
    bonds, strengths = [], []
    for speed in (0.0, 10.0, -5.0):  # bonded, apart by 0.003 m, in touch at 0.098 m
        simulation.commands(f"fix drive moved move linear {speed} 0 0\nrun 1\nunfix drive")
        bonds.append(simulation.lammps.numpy.extract_compute("pair", 0, 1)[3])
        strengths.append(simulation.per_atom("f")[1, 0])
    assert bonds == [1, 0, 0]
    assert strengths[1] == 0
    assert strengths[2] == pytest.approx(1.0e7 * 0.02**2 * np.pi * (0.05**2 - 0.049**2), rel=1e-9)


def bound_pair(simulate, *, law, distance=0.1, energy=0.0, step=1e-6, more=""):
    """Return a simulation of two spheres that close in with a kinetic energy."""
    speed = np.sqrt(energy / make_particles([0.0, 0, 0]).mass[0])
    x = np.array([[[0.0, 0, 0], [distance, 0, 0]]])
    v = np.array([[[speed, 0, 0], [-speed, 0, 0]]])
    more = f"""
        comm_modify cutoff 0.3
        neigh_modify every 1 delay 0 check yes
        {more}
        timestep {step!r}
    """
    radius = np.array([[0.05, 0.05]])
    return contact_simulation(simulate, x, v, 0 * v, radius, law, rotation=False, more=more)


def test_a_bond_ends_when_a_pair_parts_within_a_list(simulate):
    """A sphere swings from 0.093 m by way of 0.101 m to 0.097 m, while no list is built anew."""
    more = """
        neighbor 0.02 nsq
        group moved id 2
        fix swing moved move wiggle 0.008 0 0 240.0
    """
    simulation = bound_pair(simulate, law=BONDING, distance=0.093, step=1.0, more=more)
    bonds = []
    for run in ("run 10", "run 90 pre no"):
        simulation.commands(run)
        bonds.append(simulation.lammps.numpy.extract_compute("pair", 0, 1)[3])
    assert simulation.position[1, 0] == pytest.approx(0.097, rel=1e-9)
    assert bonds == [1, 0]


TEARING = Law(stiffness=1.0e7, bond=(2.0e6, 1.0, 0.1, 0.0))


def formation_heat(strain):
    """Return the work of the bond of TEARING from a strain to touch, of spheres of 0.05 m."""
    return 2.0e6 * 0.1**3 * np.pi / 4 * (2 / 3 * strain**3 - strain**4 / 4)


@pytest.mark.parametrize("energy", [0.6, 0.95, 1.05, 2.0, 10.0])
def test_a_bond_takes_its_formation_heat_from_a_rebound(simulate, energy):
    """Two spheres part with what the heat has left, or stay together where that is nothing."""
    more = "fix losses all blast/losses\nfix integrate all nve/sphere"
    simulation = bound_pair(simulate, law=TEARING, energy=energy, more=more)
    simulation.commands("run 200000")
    heat = simulation.lammps.extract_fix("losses", 0, 1, 3)
    speed = np.sqrt(2 * energy / (simulation.per_atom("rmass")[0] / 2))
    step = speed * 1e-6 / 0.1
    assert formation_heat(0.1 - step) <= heat <= formation_heat(0.1 + step)
    distance = np.ptp(simulation.position[:, 0])
    if energy < heat:
        assert distance < 0.1
    else:
        assert distance > 0.1
        # Its force of 300 N acts half a step too soon.
        assert simulation.kinetic_energy == pytest.approx(energy - heat, abs=300 * speed * 1e-6)


def test_tearing_a_bond_slowly_takes_its_formation_heat(simulate, tmp_path):
    """The contact gives back what pressing cost, so that tearing costs the heat in all."""
    steps, move = 10000, 1e-6
    more = f"""
        fix losses all blast/losses
        group moved id 2
        fix drive moved move linear {-move * (1 + 1e-9) / 1e-6!r} 0 0
    """
    simulation = bound_pair(simulate, law=TEARING, more=more)
    simulation.commands(f"run {steps - 1}")
    assert simulation.lammps.extract_fix("losses", 0, 1, 3) == 0.0
    simulation.commands("run 1")
    heat = simulation.lammps.extract_fix("losses", 0, 1, 3)
    given_back = simulation.lammps.extract_compute("pair", 0, 1)[0]
    simulation.commands(f"""
        unfix drive
        fix drive moved move linear {move / 1e-6!r} 0 0
        fix trace all print 1 "$(x[2]:%.17g) $(fx[2]:%.17g)" screen no title "" &
          file {tmp_path}/trace
        run {steps + 1}
    """)
    x, force = np.loadtxt(tmp_path / "trace").T
    assert force.min() < -100
    assert x[-1] > 0.1
    work = simpson(-force, x=x) + given_back
    assert work == pytest.approx(formation_heat(0.1), rel=1e-8)
    # The bond of 300 N formed within the last step.
    assert heat == pytest.approx(work, abs=300 * move)


@pytest.mark.parametrize("style", ["contact", "both"])
def test_a_restart_continues_a_run_of_collisions(simulate, tmp_path, style):
    pair = pair_commands(PAPER, style=style)
    run = f"""
        neighbor 0.01 nsq
        neigh_modify every 1 delay 0 check yes
        comm_modify vel yes
        timestep {STEP!r}
        compute pair all pair blast/contact
        thermo_style custom step c_pair
        fix losses all blast/losses work yes
        fix integrate all nve/sphere
        run 150
    """
    straight, restarted = (simulate(overlapping_cloud(4, seed=27)) for _ in range(2))
    straight.commands(f"clear\n{system_commands()}{pair}{run}run 150")
    # LAMMPS keeps the settings of a hybrid's styles, but not their coefficients.
    coefficients = pair.split("\n", 2)[2] if style == "both" else ""
    restarted.commands(f"""
        clear
        {system_commands()}{pair}{run}
        write_restart {tmp_path}/state
        clear
        read_restart {tmp_path}/state
        {coefficients}{run}
    """)
    bonds = straight.lammps.numpy.extract_compute("pair", 0, 1)[3]
    assert bonds > 10
    assert restarted.lammps.numpy.extract_compute("pair", 0, 1)[3] == bonds
    for name in ("x", "v", "omega"):
        expected = straight.per_atom(name)
        scale = np.abs(expected).max()
        np.testing.assert_allclose(restarted.per_atom(name), expected, rtol=0, atol=1e-11 * scale)
    expected = [straight.lammps.extract_fix("losses", 0, 1, n) for n in range(5)]
    losses = [restarted.lammps.extract_fix("losses", 0, 1, n) for n in range(5)]
    assert min(np.abs(expected)) > 1e-3
    assert losses == pytest.approx(expected, rel=1e-10)


def test_unlike_types_share_the_mean_stiffness_of_eq_7_20(simulate):
    """Each softened first (eq. 7.18); a pair_coeff of their own comes before the mean."""
    radius = np.array([[0.05, 0.07]])
    x = np.array([[[0.0, 0, 0], [0.11, 0, 0]]])
    stiff = Law(stiffness=3.0e7, thermal=(900.0, 300.0, 0.5, 1.0e6))
    soft = Law(stiffness=1.0e7, thermal=(300.0, 300.0, 3.0, 1.2e7))
    particles = make_particles(x[0], radius=radius[0])
    for own in (None, Law(stiffness=5.0e6)):
        simulation = simulate(particles)
        simulation.commands(f"""
            clear
            {SYSTEM.replace("particles.data", "particles.data extra/atom/types 1")}
            neighbor 0.01 nsq
            set atom 2 type 2
            pair_style blast/contact
            pair_coeff 1 1 {stiff.words}
            pair_coeff 2 2 {soft.words}
            {f"pair_coeff 1 2 {own.words}" if own else ""}
            run 0
        """)
        mean = Law(stiffness=(stiff.softened + soft.softened) / 2)
        expected = evaluate(own or mean, x, 0 * x, 0 * x, radius, False).elastic[0]
        assert simulation.per_atom("f")[1, 0] == pytest.approx(float(expected), rel=1e-12)
    assert stiff.softened < 3.0e7
    assert soft.softened == 1.2e7


@pytest.mark.parametrize("radii", [(0.05, 0.05), (0.05, 0.08), (0.02, 0.09)])
def test_a_half_exponent_goes_to_hertz_at_small_overlaps(simulate, radii):
    """Stock hertz/material is eq. B.7, and the lens with K_p = 2/(3 pi) E* sqrt(s/R*) its limit."""
    modulus, poisson, reach = 2.0e7, 0.3, sum(radii)
    effective = modulus / (2 * (1 - poisson**2))
    curved = radii[0] * radii[1] / reach
    law = Law(2 / (3 * np.pi) * effective * float(np.sqrt(reach / curved)), exponent=0.5)
    strains = np.array([1e-3, 1e-4, 1e-5])
    grid = np.arange(3)[:, None] * [0.0, 1.0, 0.0]
    x = np.stack([grid, grid + (reach * (1 - strains))[:, None] * [1.0, 0, 0]], axis=1)
    radius = np.tile(radii, (3, 1))
    simulation = contact_simulation(simulate, x, 0 * x, 0 * x, radius, law, rotation=False)
    lens = simulation.per_atom("f").reshape(-1, 2, 3)[:, 1, 0]
    simulation.commands(f"""
        uncompute pair
        thermo_style one
        pair_style granular
        pair_coeff * * hertz/material {modulus} 0 {poisson} tangential linear_nohistory 0 0
        run 0
    """)
    hertz = simulation.per_atom("f").reshape(-1, 2, 3)[:, 1, 0]
    overlap = reach - (x[:, 1, 0] - x[:, 0, 0])
    expected = 4 / 3 * effective * np.sqrt(curved) * overlap**1.5
    np.testing.assert_allclose(hertz, expected, rtol=1e-11)
    beyond = (lens / hertz - 1) / strains
    unequal = ((radii[1] - radii[0]) / reach) ** 2
    assert beyond == pytest.approx(-0.5 - 2 * unequal / (1 - unequal), rel=5e-3)


GOOD = "stiffness 1e7 exponent 2"
BAD_COMMANDS = {
    "pair_style blast/contact rotation": "no settings but: rotation yes or no",
    "pair_style blast/contact rotation maybe": "maybe",
    "pair_style blast/contact friction yes": "no settings but: rotation yes or no",
    "{style}\npair_coeff *": "missing argument",
    "{style}\npair_coeff * *": "needs the keywords stiffness and exponent",
    "{style}\npair_coeff * * stiffness 1e7": "needs the keywords stiffness and exponent",
    "{style}\npair_coeff * * stiffness": "missing argument",
    "{style}\npair_coeff * * stiffness 0 exponent 2": "stiffness must be above zero",
    "{style}\npair_coeff * * stiffness nan exponent 2": "nan",
    "{style}\npair_coeff * * stiffness 1e7 exponent -0.5": "exponent must not be negative",
    "{style}\npair_coeff * * {good} damping -1": "damping must not be negative",
    "{style}\npair_coeff * * {good} friction 1e7 0.4": "missing argument",
    "{style}\npair_coeff * * {good} friction 0 0.4 0.3": "friction stiffness must be above zero",
    "{style}\npair_coeff * * {good} friction 1 -0.4 0.3": "static friction must not be negative",
    "{style}\npair_coeff * * {good} friction 1 0.4 -0.3": "dynamic friction must not be negative",
    "{style}\npair_coeff * * {good} bond 1e6 2 0.05 1e3": "missing argument",
    "{style}\npair_coeff * * {good} bond 1e6 2 0.05 1e3 ever": "contact or none: ever",
    "{style}\npair_coeff * * {good} bond -1 2 0.05 1e3 none": "bond stiffness must not be",
    "{style}\npair_coeff * * {good} bond 1e6 -2 0.05 1e3 none": "bond exponent must not be",
    "{style}\npair_coeff * * {good} bond 1e6 2 0 1e3 none": "activation strain must be above zero",
    "{style}\npair_coeff * * {good} bond 1e6 2 0.05 -1 none": "tangential stiffness must not be",
    "{style}\npair_coeff * * {good} thermal 300 500 1": "missing argument",
    "{style}\npair_coeff * * {good} thermal -3 500 1 1e6": "temperature must not be negative",
    "{style}\npair_coeff * * {good} thermal 300 0 1 1e6": "reference temperature must be above",
    "{style}\npair_coeff * * {good} thermal 300 500 1 0": "stiffness floor must be above zero",
    "{style}\npair_coeff * * {good} colour blue": "keyword: colour",
    "{style}\npair_coeff 2 2 {good}": "2",
    "{style}\nrun 0": "All pair coeffs are not set",
    "comm_modify vel no\n{style}\npair_coeff * * {good} damping 1\nrun 0": "comm_modify vel yes",
    "compute c all blast/contact/local strain": "takes no arguments",
    "compute c all blast/contact/local\nrun 0": "requires pair style blast/contact",
    "pair_style hybrid/overlay blast/contact blast/contact\n"
    "pair_coeff * * blast/contact 1 {good} bond 1 2 0.05 0 contact\n"
    "pair_coeff * * blast/contact 2 {good} bond 1 2 0.05 0 contact\nrun 0": "only once",
}


@pytest.mark.parametrize("command", BAD_COMMANDS)
def test_bad_arguments_are_refused_by_name(simulate, command):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.2, 0, 0]]))
    simulation.commands("neighbor 0.01 nsq\ncomm_modify cutoff 0.0 vel yes")
    with pytest.raises(Exception, match=re.escape(BAD_COMMANDS[command])):
        simulation.commands(command.format(style="pair_style blast/contact", good=GOOD))


def test_attributes_and_units_are_demanded(simulate):
    simulation = simulate(make_particles([0.0, 0, 0]))
    for settings, message in (
        ("units lj\natom_style sphere", "requires units si"),
        ("units si\natom_style charge", "requires atom attribute radius"),
    ):
        with pytest.raises(Exception, match=message):
            simulation.commands(f"""
                clear
                {settings}
                region r block -1 1 -1 1 -1 1
                create_box 1 r
                pair_style blast/contact
                pair_coeff * * {GOOD}
                run 0
            """)


@pytest.mark.parametrize(
    "other",
    [
        replace(PAPER, exponent=1.0),
        replace(PAPER, damping=2.0),
        replace(PAPER, friction=(1.0e7, 0.4, 0.2)),
        replace(PAPER, bond=(1.0e6, 2.0, 0.06, 1.0e3)),
        replace(PAPER, memory="none"),
    ],
)
def test_only_stiffness_is_mixed(simulate, other):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.2, 0, 0]]))
    with pytest.raises(
        Exception, match="mixes stiffness only: give a pair_coeff for types 1 and 2"
    ):
        simulation.commands(f"""
            clear
            {SYSTEM.replace("particles.data", "particles.data extra/atom/types 1")}
            comm_modify vel yes
            pair_style blast/contact
            pair_coeff 1 1 {PAPER.words}
            pair_coeff 2 2 {other.words}
            run 0
        """)
