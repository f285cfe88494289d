"""Pair style blast/nearfield against an independent evaluation of eq. 7.23 and its integral."""

import re
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import SYSTEM, lmp, make_particles
from scipy.integrate import quad

from lammps_blast.deck import write_particle_data

Power = tuple[float, float]  # strength and exponent


@dataclass(frozen=True)
class Field:
    """Arguments of pair_style and pair_coeff, spelled out; no cutoff stands for `all`."""

    attraction: Power = (0.5, 1.0)
    repulsion: Power = (0.01, 2.0)
    scaling: str = "mass"
    cutoff: float | None = None
    switch: float = 0.0
    signed: bool = False

    @property
    def style(self):
        words = f"{'all' if self.cutoff is None else repr(self.cutoff)} {self.scaling}"
        if self.switch:
            words += f" switch {self.switch!r}"
        return words + " signs i_sign" * self.signed

    @property
    def coefficients(self):
        return "{!r} {!r} {!r} {!r}".format(*self.attraction, *self.repulsion)

    def factors(self, particles):
        """Return the factor of each particle in alpha_ij (below eq. 7.23)."""
        factors = {
            "mass": particles.mass,
            "area": 4 * np.pi * particles.radius**2,
            "volume": 4 / 3 * np.pi * particles.radius**3,
            "charge": particles.charge,
        }[self.scaling]
        return factors * signs_of(particles) if self.signed else factors

    def terms(self, d):
        """Return attraction and repulsion at distances `d` for unit factors, without a switch."""
        within = 1 if self.cutoff is None else d < self.cutoff
        return [within * a * d**-b for a, b in (self.attraction, self.repulsion)]

    def size(self, d):
        """Return the size of the two terms, which may cancel each other or the switch them."""
        return np.abs(self.terms(d)).sum(axis=0)

    def force(self, d):
        attraction, repulsion = self.terms(d)
        part = np.zeros_like(d)
        if self.switch:
            part = np.clip((d - (self.cutoff - self.switch)) / self.switch, 0, 1)
        return (attraction - repulsion) * (1 - part) ** 3 * (1 + 3 * part + 6 * part**2)

    def energy(self, d):
        """Return the potential for unit factors by quadrature from the cutoff, or as defined."""
        if self.cutoff is None:
            return sum(
                sign * a * (np.log(d) if b == 1 else d ** (1 - b) / (1 - b))
                for sign, (a, b) in zip((1, -1), (self.attraction, self.repulsion), strict=True)
            )
        if d >= self.cutoff:
            return 0.0
        ends = sorted({d, max(d, self.cutoff - self.switch), self.cutoff})
        work = (
            quad(lambda r: float(self.force(np.float64(r))), a, b, epsabs=0, epsrel=1e-12)[0]
            for a, b in pairwise(ends)
        )
        return -sum(work)


EXPONENTS = {
    "paper": (1.0, 2.0),
    "its reverse": (2.0, 1.0),
    "equal": (2.0, 2.0),
    "1 and 3": (1.0, 3.0),
    "2 and 3": (2.0, 3.0),
    "none": (0.0, 0.0),
    "whole": (3.0, 7.0),
    "half": (0.5, 2.5),
    "half and whole": (1.5, 6.0),
    "real": (1.37, 2.81),
    "beside one": (1.0 + 1e-9, 0.3),
    "high": (15.5, 13.0),
    "too high for products": (20.0, 16.0),
}
FIELDS = {
    **{name: Field((0.5, a), (0.3, r)) for name, (a, r) in EXPONENTS.items()},
    "attraction alone": Field((0.7, 2.5), (0.0, 1.0)),
    "repulsion alone": Field((0.0, 4.5), (0.7, 2.0)),
    "strengths below zero": Field((-0.5, 1.0), (-0.01, 2.0)),
    "area": Field(scaling="area"),
    "volume": Field((0.5, 0.5), scaling="volume"),
    "charge": Field(scaling="charge"),
    "signed mass": Field(signed=True),
    "signed area": Field(scaling="area", signed=True),
    "signed volume": Field(scaling="volume", signed=True),
}


def cut(field):
    """Return the field cut off at 0.45 m."""
    return replace(field, cutoff=0.45)


def switched(field):
    return replace(field, cutoff=0.45, switch=0.3)


def random_properties(count, rng):
    """Return unequal radii, densities and charges of both signs as arguments of make_particles."""
    return {
        "radius": 0.02 * np.exp(rng.uniform(-0.5, 0.5, count)),
        "density": rng.uniform(1000.0, 9000.0, count),
        "charge": rng.normal(size=count),
    }


def signs_of(particles):
    """Return c of each particle, as SIGNS sets it."""
    return np.where(np.arange(1, len(particles) + 1) * 7 % 5 > 2, -1, 1)


SIGNS = """
fix sign all property/atom i_sign ghost yes
variable sign atom "1 - 2*((id*7) % 5 > 2)"
set atom * i_sign v_sign
"""


def types_of(particles):
    """Return the type of each particle, 1 to 3, as TYPES sets it."""
    return np.arange(1, len(particles) + 1) ** 2 % 7 % 3 + 1


TYPES = """
variable kind atom "(id*id % 7) % 3 + 1"
set atom * type v_kind
"""


def separate_pairs(distance, seed):
    """Return particles, of which each two are a pair out of the others' reach."""
    rng = np.random.default_rng(seed)
    count = len(distance)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    side = int(np.ceil(count ** (1 / 3)))
    grid = np.stack(np.unravel_index(np.arange(count), (side,) * 3), axis=1) * 1.6
    position = np.stack([grid, grid + distance[:, None] * direction], axis=1).reshape(-1, 3)
    return make_particles(position, **random_properties(2 * count, rng))


def pair_distances(particles):
    """Return r_j - r_i (P, 3) and its size (P,), of each pair, in long doubles."""
    pairs = particles.position.astype(np.longdouble).reshape(-1, 2, 3)
    offset = pairs[:, 1] - pairs[:, 0]
    return offset, np.sqrt((offset**2).sum(axis=1))


def pair_factors(field, particles):
    return field.factors(particles).reshape(-1, 2).prod(axis=1)


def jittered_cloud(side, seed):
    """Return particles about the points of a cubic lattice."""
    rng = np.random.default_rng(seed)
    lattice = np.stack(np.unravel_index(np.arange(side**3), (side,) * 3), axis=1) * 0.15
    position = lattice + rng.uniform(-0.05, 0.05, lattice.shape)
    return make_particles(position, **random_properties(side**3, rng))


@dataclass(frozen=True)
class Sums:
    """What a whole cloud feels, and the sums of the sizes of the terms that make it up."""

    force: np.ndarray  # (N, 3)
    force_size: np.ndarray  # (N, 1)
    virial: np.ndarray  # (3, 3), sum of r F over pairs


def cloud_sums(field, particles):
    """Add up all pairs under one field, or under those of pairs of types."""
    fields = field if isinstance(field, dict) else {(1, 1): field}
    types = types_of(particles) if len(fields) > 1 else np.ones(len(particles), dtype=int)
    x = particles.position.astype(np.longdouble)
    offset = x[None, :, :] - x[:, None, :]
    distance = np.sqrt((offset**2).sum(axis=2))
    np.fill_diagonal(distance, 1.0)
    force, size = np.empty_like(distance), np.empty_like(distance)
    for (t, u), field in fields.items():
        factors = field.factors(particles).astype(np.longdouble)
        both = factors[:, None] * factors[None, :]
        for a, b in {(t, u), (u, t)}:
            among = (types[:, None] == a) & (types[None, :] == b)
            force[among] = both[among] * field.force(distance[among])
            size[among] = np.abs(both[among]) * field.size(distance[among])
    np.fill_diagonal(force, 0.0)
    np.fill_diagonal(size, 0.0)
    vectors = (force / distance)[:, :, None] * offset
    virial = -0.5 * np.einsum("ijk,ijl->kl", vectors.astype(float), offset.astype(float))
    return Sums(vectors.sum(axis=1), size.sum(axis=1)[:, None], virial)


def pair_energies(field, particles):
    """Return the energy of every pair under one field, or under those of pairs of types."""
    fields = field if isinstance(field, dict) else {(1, 1): field}
    types = types_of(particles) if len(fields) > 1 else np.ones(len(particles), dtype=int)
    i, j = np.triu_indices(len(particles), 1)
    d = np.linalg.norm(particles.position[j] - particles.position[i], axis=1)
    energy = np.empty_like(d)
    for (t, u), between in fields.items():
        factors = between.factors(particles)
        among = np.minimum(types[i], types[j]) * 10 + np.maximum(types[i], types[j]) == 10 * t + u
        energy[among] = (factors[i] * factors[j] * between.energy(d))[among]
    return energy


def system_commands(kinds, newton="on"):
    """Return commands that read the particles, give them signs and types, and define computes."""
    system = SYSTEM.replace("units si", f"units si\nnewton {newton}").replace(
        "particles.data", f"particles.data extra/atom/types {kinds - 1}"
    )
    return f"""
        {system}
        neighbor 0.01 nsq
        comm_modify cutoff 0.0
        {SIGNS}
        {TYPES if kinds > 1 else ""}
        compute each all pe/atom
        compute virial all pressure NULL virial
        compute stress all stress/atom NULL pair
        compute stresses all reduce sum c_stress[1] c_stress[2] c_stress[3] c_stress[4] &
          c_stress[5] c_stress[6]
        thermo_style custom step pe c_virial c_virial[1] c_stresses[1]
    """


def law_commands(field):
    """Return the pair style of one field, or of those of pairs of types."""
    if isinstance(field, Field):
        return f"pair_style blast/nearfield {field.style}\npair_coeff * * {field.coefficients}\n"
    commands = [f"pair_style blast/nearfield {field[1, 1].style}"]
    for (t, u), between in field.items():
        cutoff = repr(between.cutoff) if between.cutoff else ""
        commands.append(f"pair_coeff {t} {u} {between.coefficients} {cutoff}")
    return "\n".join(commands) + "\n"


def near_field_simulation(simulate, particles, field, *, newton="on", more=""):
    """Return a simulation under the near field after `run 0`."""
    simulation = simulate(particles)
    kinds = 1 if isinstance(field, Field) else max(max(pair) for pair in field)
    simulation.commands(
        f"clear\n{system_commands(kinds, newton)}\n{law_commands(field)}\n{more}\nrun 0"
    )
    return simulation


def potential_energies(simulation):
    """Return LAMMPS's potential energy of each particle, in the order of ids."""
    ids = np.array(simulation.lammps.numpy.extract_atom("id")[: simulation.count])
    energies = np.array(simulation.lammps.numpy.extract_compute("each", 1, 1)[: simulation.count])
    return energies[np.argsort(ids)]


def virial_tensor(simulation):
    """Return the tensor (3, 3) of r F over pairs that LAMMPS's pressure is made of."""
    xx, yy, zz, xy, xz, yz = simulation.lammps.numpy.extract_compute("virial", 0, 1)
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return tensor * simulation.lammps.get_thermo("vol")


@pytest.mark.parametrize("end", [cut, switched])
@pytest.mark.parametrize("field", FIELDS.values(), ids=FIELDS.keys())
def test_forces_of_random_pairs(simulate, field, end):
    field = end(field)
    distance = np.random.default_rng(1).uniform(0.02, 0.5, 1500)
    particles = separate_pairs(distance, seed=2)
    simulation = near_field_simulation(simulate, particles, field)
    offset, d = pair_distances(particles)
    both = pair_factors(field, particles)
    force = (both * field.force(d) / d)[:, None] * offset
    size = np.abs(both) * field.size(d)
    assert 100 < np.count_nonzero(size == 0) < 300
    measured = simulation.per_atom("f").reshape(-1, 2, 3)
    assert np.all(np.abs(measured[:, 0] - force) <= 1e-12 * size[:, None])
    np.testing.assert_array_equal(measured[:, 1], -measured[:, 0])


@pytest.mark.parametrize("end", [cut, switched])
@pytest.mark.parametrize("field", FIELDS.values(), ids=FIELDS.keys())
def test_energy_of_a_pair_is_the_integral_of_its_force(simulate, field, end):
    field = end(field)
    distance = np.array([0.02, 0.05, 0.1, 0.149, 0.151, 0.3, 0.4, 0.44, 0.449955, 0.4501])
    particles = separate_pairs(distance, seed=4)
    simulation = near_field_simulation(simulate, particles, field)
    measured = potential_energies(simulation).reshape(-1, 2)
    both = pair_factors(field, particles)
    alone = replace(field, repulsion=(0.0, 1.0)), replace(field, attraction=(0.0, 1.0))
    size = sum(np.abs([replace(term, switch=0.0).energy(d) for d in distance]) for term in alone)
    error = np.abs(measured.sum(axis=1) - both * [field.energy(d) for d in distance])
    assert np.all(error <= 1e-10 * np.abs(both) * size)
    assert (size[-2:] > 0).tolist() == [True, False]
    np.testing.assert_array_equal(measured[:, 0], measured[:, 1])


@pytest.mark.parametrize("field", FIELDS.values(), ids=FIELDS.keys())
def test_forces_and_energy_of_a_whole_cloud(simulate, field):
    particles = jittered_cloud(5, seed=5)
    simulation = near_field_simulation(simulate, particles, field)
    sums = cloud_sums(field, particles)
    assert np.all(np.abs(simulation.per_atom("f") - sums.force) <= 1e-12 * sums.force_size)

    energy = pair_energies(field, particles)
    total = simulation.lammps.get_thermo("pe")
    assert abs(total - energy.sum()) <= 1e-12 * np.abs(energy).sum()
    assert potential_energies(simulation).sum() == pytest.approx(total, rel=1e-11)


MANY_TYPES = {
    "one exponent each": {
        (1, 1): Field((0.5, 1.0), (0.01, 2.0)),
        (1, 2): Field((0.2, 0.5), (0.03, 1.5)),
        (1, 3): Field((-0.1, 2.0), (0.02, 3.0)),
        (2, 2): Field((0.0, 1.0), (0.5, 1.0)),
        (2, 3): Field((0.3, 1.37), (0.1, 2.2)),
        (3, 3): Field((0.3, 1.0), (0.0, 0.0)),
    }
}
MANY_TYPES["exponents alone"] = {
    types: Field((0.5, 0.5 * sum(types)), (0.3, 1.0 + types[1]))
    for types in MANY_TYPES["one exponent each"]
}
MANY_TYPES["volumes with signs"] = {
    types: replace(field, scaling="volume", signed=True)
    for types, field in MANY_TYPES["one exponent each"].items()
}
MANY_TYPES["charges"] = {
    types: replace(field, scaling="charge")
    for types, field in MANY_TYPES["one exponent each"].items()
}


def cut_by_types(fields):
    return {
        types: replace(field, cutoff=0.2 + 0.05 * sum(types), switch=0.1)
        for types, field in fields.items()
    }


@pytest.mark.parametrize("end", [dict, cut_by_types])
@pytest.mark.parametrize("fields", MANY_TYPES.values(), ids=MANY_TYPES.keys())
def test_forces_among_several_types(simulate, fields, end):
    particles = jittered_cloud(5, seed=6)
    fields = end(fields)
    simulation = near_field_simulation(simulate, particles, fields)
    sums = cloud_sums(fields, particles)
    assert np.all(np.abs(simulation.per_atom("f") - sums.force) <= 1e-12 * sums.force_size)
    tensor = virial_tensor(simulation)
    np.testing.assert_allclose(tensor, sums.virial, rtol=0, atol=1e-11 * np.abs(tensor).max())


@pytest.mark.parametrize("newton", ["on", "off"])
@pytest.mark.parametrize("name", ["paper", "half", "signed mass", "charge"])
def test_all_is_a_cutoff_beyond_the_cloud(simulate, name, newton):
    field = FIELDS[name]
    particles = jittered_cloud(5, seed=8)
    whole = near_field_simulation(simulate, particles, field, newton=newton)
    beyond = replace(field, cutoff=5.0)
    listed = near_field_simulation(simulate, particles, beyond, newton=newton)
    sums = cloud_sums(field, particles)
    tolerance = {"rtol": 0, "atol": 1e-12 * np.abs(sums.virial).max()}
    for simulation in (whole, listed):
        assert np.all(np.abs(simulation.per_atom("f") - sums.force) <= 1e-12 * sums.force_size)
        np.testing.assert_allclose(virial_tensor(simulation), sums.virial, **tolerance)
        # stress/atom has the opposite sign, and xy before xz before yz.
        stress = simulation.lammps.numpy.extract_compute("stresses", 0, 1)
        expected = -sums.virial[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        np.testing.assert_allclose(stress, expected, **tolerance)


@pytest.mark.parametrize("switch", [0.0, 0.3])
@pytest.mark.parametrize("exponents", [(1.0, 2.0), (0.5, 3.0), (1.37, 1.0 + 1e-9)])
def test_single_gives_the_energy_and_its_slope(simulate, exponents, switch):
    """In the rows of compute pair/local: five distances about each point of a difference."""
    field = Field((0.5, exponents[0]), (0.01, exponents[1]), cutoff=0.45, switch=switch)
    middle = np.random.default_rng(9).uniform(0.05, 0.44, 40)
    steps = np.arange(-2, 3) * 1e-3 * middle[:, None]
    particles = separate_pairs((middle[:, None] + steps).ravel(), seed=10)
    equal = replace(particles, radius=np.full(400, 0.02), density=np.full(400, 7000.0))
    more = "compute rows all pair/local dist eng force"
    simulation = near_field_simulation(simulate, equal, field, more=more)
    rows = simulation.lammps.numpy.extract_compute("rows", 2, 2)
    d, energy, force = rows[np.argsort(rows[:, 0])].T
    order = np.argsort(np.argsort(pair_distances(equal)[1]))
    d, energy, force = (column[order].reshape(-1, 5) for column in (d, energy, force))
    factor = equal.mass[0] ** 2
    np.testing.assert_allclose(force[:, 2], -factor * field.force(d[:, 2]), rtol=1e-11)
    slope = (8 * (energy[:, 3] - energy[:, 1]) - (energy[:, 4] - energy[:, 0])) / (
        12 * (d[:, 4] - d[:, 0]) / 4
    )
    assert np.all(np.abs(slope + force[:, 2]) <= 1e-8 * factor * field.size(d[:, 2]))


def test_pair_write_tabulates_the_law(simulate, tmp_path):
    field = Field((0.5, 1.37), (0.01, 2.0), cutoff=0.5, switch=0.2)
    particles = make_particles([[0.0, 0, 0], [0.2, 0, 0]])
    simulation = simulate(particles)
    simulation.commands(f"""
        neighbor 0.01 nsq
        comm_modify cutoff 0.0
        {law_commands(field)}
        pair_write 1 1 50 r 0.05 0.49 {tmp_path}/table.txt LAW
    """)
    _, d, energy, force = np.loadtxt(tmp_path / "table.txt", skiprows=5).T
    factor = particles.mass[0] ** 2
    np.testing.assert_allclose(force, -factor * field.force(d), rtol=1e-12)
    expected = factor * np.array([field.energy(r) for r in d])
    np.testing.assert_allclose(energy, expected, rtol=1e-10)


@pytest.mark.parametrize("cutoff", [None, 0.45])
def test_restart_file_carries_the_law(simulate, tmp_path, cutoff):
    fields = MANY_TYPES["volumes with signs"]
    switch = 0.1 if cutoff else 0.0
    fields = {t: replace(f, cutoff=cutoff, switch=switch) for t, f in fields.items()}
    particles = jittered_cloud(4, seed=11)
    simulation = near_field_simulation(simulate, particles, fields)
    force = simulation.per_atom("f")
    simulation.commands(f"""
        write_restart {tmp_path}/state
        clear
        read_restart {tmp_path}/state
        fix sign all property/atom i_sign ghost yes
        neighbor 0.01 nsq
        comm_modify cutoff 0.0
        run 0
    """)
    np.testing.assert_array_equal(simulation.per_atom("f"), force)


@pytest.mark.parametrize("cutoff", [None, 0.45])
@pytest.mark.parametrize(("first", "second"), [(1, 6), (1, 2), (5, 7), (3, 7)])
def test_coincident_centres_stop_with_both_ids(simulate, first, second, cutoff):
    fields = {t: replace(f, cutoff=cutoff) for t, f in MANY_TYPES["one exponent each"].items()}
    position = np.arange(7)[:, None] * [0.1, 0.05, 0.0]
    position[second - 1] = position[first - 1]
    message = f"atoms ({first} and {second}|{second} and {first}) coincide at time 0"
    with pytest.raises(Exception, match=message):
        near_field_simulation(simulate, make_particles(position), fields)


def test_settings_given_anew_hold_for_the_coefficients(simulate):
    particles = separate_pairs(np.linspace(0.05, 0.45, 30), seed=16)
    simulation = near_field_simulation(simulate, particles, cut(FIELDS["paper"]))
    anew = replace(FIELDS["paper"], cutoff=0.3, switch=0.1)
    simulation.commands(f"pair_style blast/nearfield {anew.style}\nrun 0")
    force = simulation.per_atom("f")
    simulation = near_field_simulation(simulate, particles, anew)
    np.testing.assert_array_equal(force, simulation.per_atom("f"))


def state_commands(name):
    """Return commands that leave forces, energies and the pressure tensor in files."""
    return f"""
        run 0
        write_dump all custom {name}.forces id fx fy fz c_each modify sort id format float %.17g
        print "$(pe:%.17g) $(c_virial[1]:%.17g) $(c_virial[2]:%.17g) $(c_virial[3]:%.17g) &
$(c_virial[4]:%.17g) $(c_virial[5]:%.17g) $(c_virial[6]:%.17g)" file {name}.totals
    """


def test_ranks_and_newton_agree(tmp_path):
    particles = jittered_cloud(5, seed=13)
    whole = MANY_TYPES["volumes with signs"]
    clouds = {"all": whole, "cut": cut_by_types(whole)}
    sums = {name: cloud_sums(fields, particles) for name, fields in clouds.items()}
    alone = {}
    for ranks, newton in ((1, "on"), (1, "off"), (2, "on"), (2, "off"), (3, "on")):
        folder = tmp_path / f"{ranks}-{newton}"
        folder.mkdir()
        write_particle_data(particles, folder / "particles.data")
        laws = (law_commands(fields) + state_commands(name) for name, fields in clouds.items())
        (folder / "in.deck").write_text(system_commands(3, newton) + "".join(laws))
        done = lmp("-in", "in.deck", "-log", "none", folder=folder, ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        for name in clouds:
            _, *force, energy = np.loadtxt(folder / f"{name}.forces", skiprows=9).T
            totals = np.loadtxt(folder / f"{name}.totals")
            error = np.abs(np.transpose(force) - sums[name].force)
            assert np.all(error <= 1e-12 * sums[name].force_size)
            energies, first_totals = alone.setdefault(name, (energy, totals))
            np.testing.assert_allclose(energy, energies, rtol=1e-11)
            np.testing.assert_allclose(totals, first_totals, rtol=1e-11)
            assert energy.sum() == pytest.approx(totals[0], rel=1e-11)


BAD_COMMANDS = {
    "pair_style blast/nearfield": "missing argument",
    "pair_style blast/nearfield 0.5": "missing argument",
    "pair_style blast/nearfield 0.0 mass": "cutoff must be above zero",
    "pair_style blast/nearfield -1 mass": "cutoff must be above zero",
    "pair_style blast/nearfield nan mass": "nan",
    "pair_style blast/nearfield every mass": "every",
    "pair_style blast/nearfield 0.5 weight": "scaling: weight",
    "pair_style blast/nearfield 0.5 mass switch": "missing argument",
    "pair_style blast/nearfield 0.5 mass switch 0": "switch must be above zero",
    "pair_style blast/nearfield 0.5 mass switch 0.5": "switch must be narrower than a cutoff",
    "pair_style blast/nearfield all mass switch 0.1": "switch must be narrower than a cutoff",
    "pair_style blast/nearfield 0.5 mass signs": "missing argument",
    "pair_style blast/nearfield 0.5 mass signs sign": "an integer property i_NAME: sign",
    "pair_style blast/nearfield 0.5 mass signs d_sign": "an integer property i_NAME: d_sign",
    "pair_style blast/nearfield 0.5 charge signs i_sign": "takes signs from the charges",
    "pair_style blast/nearfield 0.5 mass colour blue": "keyword: colour",
    "{mass}\npair_coeff * * 0.5 1 0.01": "missing argument",
    "{mass}\npair_coeff * * 0.5 1 0.01 2 0.4 7": "takes no pair coefficient 7",
    "pair_style blast/nearfield all mass\npair_coeff * * 0.5 1 0.01 2 0.4": "coefficient 0.4",
    "{mass}\npair_coeff * * 0.5 1 0.01 2 0": "cutoff must be above zero",
    "{mass} switch 0.3\npair_coeff * * 0.5 1 0.01 2 0.2": "switch must be narrower",
    "{mass}\npair_coeff * * 0.5 -1 0.01 2": "attraction exponent must not be negative",
    "{mass}\npair_coeff * * 0.5 1 0.01 -2": "repulsion exponent must not be negative",
    "{mass}\npair_coeff * * 1e999 1 0.01 2": "1e999",
    "{mass}\npair_coeff * * 0.5 1 x 2": "x",
    "{mass}\npair_coeff 2 2 0.5 1 0.01 2": "2",
    "{mass}\nrun 0": "All pair coeffs are not set",
    "{mass} signs i_none\npair_coeff * * 0.5 1 0.01 2\nrun 0": "no integer atom property i_none",
    "fix s all property/atom i_s\n{mass} signs i_s\npair_coeff * * 1 1 1 1\nrun 0": "ghost yes",
    "fix s all property/atom i_s ghost yes\nset atom 2 i_s -2\nset atom 1 i_s 1\n"
    "{mass} signs i_s\npair_coeff * * 1 1 1 1\nrun 0": "i_s of atom 2 is neither 1 nor -1",
    "change_box all boundary p s s\npair_style blast/nearfield all mass\n"
    "pair_coeff * * 1 1 1 1\nrun 0": "requires boundaries that are not periodic",
}


@pytest.mark.parametrize("command", BAD_COMMANDS)
def test_bad_arguments_are_refused_by_name(simulate, command):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.2, 0, 0]]))
    simulation.commands("neighbor 0.01 nsq")
    with pytest.raises(Exception, match=re.escape(BAD_COMMANDS[command])):
        simulation.commands(command.format(mass="pair_style blast/nearfield 0.5 mass"))


def test_attributes_and_units_are_demanded(simulate):
    simulation = simulate(make_particles([0.0, 0, 0]))
    box = "region r block -1 1 -1 1 -1 1\ncreate_box {} r\n"
    for settings, scaling, message in (
        ("units lj\natom_style sphere", "mass", "requires units si"),
        ("units si\natom_style charge", "mass", "requires atom attribute rmass"),
        ("units si\natom_style charge", "area", "requires atom attribute radius"),
        ("units si\natom_style sphere", "charge", "requires atom attribute q"),
    ):
        coefficients = f"pair_style blast/nearfield 0.5 {scaling}\npair_coeff * * 1 1 1 1\nrun 0"
        with pytest.raises(Exception, match=message):
            simulation.commands(f"clear\n{settings}\n{box.format(1)}{coefficients}")


def test_types_are_not_mixed(simulate):
    fields = MANY_TYPES["one exponent each"]
    own = {pair: field for pair, field in fields.items() if pair != (1, 3)}
    particles = jittered_cloud(2, seed=15)
    with pytest.raises(Exception, match="does not mix: give a pair_coeff for types 1 and 3"):
        near_field_simulation(simulate, particles, own)
