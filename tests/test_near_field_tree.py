"""Summation of the near field by tree against the direct sum, and both on ranks and threads."""

import json
import os
import re
import subprocess
from dataclasses import dataclass

import numpy as np
import pytest
from conftest import PROGRAMS, blast, lmp, make_particles
from test_pair_blast_near_field import (
    FIELDS,
    MANY_TYPES,
    SIGNS,
    TYPES,
    cloud_sums,
    jittered_cloud,
    law_commands,
    pair_energies,
    random_properties,
)

from lammps_blast.deck import write_particle_data

# Accounts of single particles ask for pairs one by one; without them there are sums alone.
SYSTEM = """
units si
atom_style hybrid sphere charge
atom_modify map array sort 0 0.0
boundary s s s
neighbor 0.01 nsq
comm_modify cutoff 1.0e-9
neigh_modify every 1 delay 0 check yes
read_data particles.data extra/atom/types 2
{signs}
{types}
{law}
compute approximation all pair blast/nearfield
compute virial all pressure NULL virial
thermo_style custom step pe c_virial[1] c_approximation[1]
thermo_modify norm no
run 0
variable volume equal vol
variable error equal c_approximation[1]
variable order equal c_approximation[2]
write_dump all custom forces id x y z fx fy fz modify sort id format float %.17g
print "$(v_error:%.17g) $(v_order) $(pe:%.17g) $(c_virial[1]*vol:%.17g) $(c_virial[2]*vol:%.17g) &
$(c_virial[3]*vol:%.17g) $(c_virial[4]*vol:%.17g) $(c_virial[5]*vol:%.17g) &
$(c_virial[6]*vol:%.17g)" file totals
"""


@dataclass(frozen=True)
class Found:
    """Forces (N, 3), energy and virial of a cloud, and what LAMMPS says of their error."""

    force: np.ndarray
    error: float
    order: int
    energy: float
    virial: np.ndarray  # xx, yy, zz, xy, xz, yz
    log: str


def law_with(field, method):
    """Return the commands of a field, or of fields by pairs of types, with a method of summing."""
    first, _, rest = law_commands(field).partition("\n")
    return f"{first} {method}\n{rest}"


def sums(folder, particles, field, method="", *, ranks=1, threads=1):
    """Sum the near field in a process of its own."""
    folder.mkdir(exist_ok=True)
    write_particle_data(particles, folder / "particles.data")
    kinds = 1 if not isinstance(field, dict) else 3
    deck = SYSTEM.format(signs=SIGNS, types=TYPES if kinds > 1 else "", law=law_with(field, method))
    if kinds == 1:
        deck = deck.replace(" extra/atom/types 2", "")
    (folder / "in.deck").write_text(deck)
    command = [str(PROGRAMS / "lmp"), "-in", "in.deck"]
    if ranks > 1:
        command = [str(PROGRAMS / "mpiexec"), "-n", str(ranks), *command]
    environment = os.environ | {"OMP_NUM_THREADS": str(threads)}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout + done.stderr
    error, order, energy, *virial = np.loadtxt(folder / "totals")
    force = np.loadtxt(folder / "forces", skiprows=9, ndmin=2)[:, 4:]
    log = (folder / "log.lammps").read_text()
    return Found(force, error, int(order), energy, np.array(virial), log)


def ball(count, seed):
    """Return unlike particles spread over a ball of radius 1 m."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    position = direction * rng.random((count, 1)) ** (1 / 3)
    return make_particles(position, **random_properties(count, rng))


def relative_error(force, exact):
    return np.sqrt(((force - exact) ** 2).sum() / (exact**2).sum())


@pytest.mark.parametrize("field", [*MANY_TYPES.values(), FIELDS["paper"], FIELDS["real"]])
def test_energy_and_virial_of_the_direct_sum(tmp_path, field):
    particles = jittered_cloud(6, seed=14)
    found = sums(tmp_path, particles, field)
    expected = cloud_sums(field, particles)
    assert np.all(np.abs(found.force - expected.force) <= 1e-12 * expected.force_size)
    energy = pair_energies(field, particles)
    assert abs(found.energy - energy.sum()) <= 1e-12 * np.abs(energy).sum()
    virial = expected.virial[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    np.testing.assert_allclose(found.virial, virial, rtol=0, atol=1e-11 * np.abs(virial).max())


LAWS = {
    name: FIELDS[name]
    for name in ("paper", "real", "half", "none", "beside one", "high", "charge", "signed mass")
}


@pytest.mark.parametrize("name", LAWS)
def test_error_is_below_the_accuracy_asked_for(tmp_path, name):
    """And the forces add up to nothing, to rounding, however large their error."""
    field = LAWS[name]
    # The nearest pair of a random cloud would outweigh all others where exponents are high.
    particles = jittered_cloud(18, seed=1) if name == "high" else ball(6000, seed=1)
    exact = sums(tmp_path / "direct", particles, field)
    assert exact.order == 0
    assert exact.error == 0.0
    size = np.abs(exact.force).sum(axis=0)
    arm = np.abs(particles.position).max()
    for accuracy in (1e-2, 1e-4, 1e-6) if name in ("paper", "charge") else (1e-4,):
        tree = sums(tmp_path / "tree", particles, field, f"method tree accuracy {accuracy}")
        assert tree.order > 0
        error = relative_error(tree.force, exact.force)
        assert error <= accuracy
        if error > 0.1 * accuracy:
            # Measured on a sample, which may hold more of the error or less than its part.
            assert 0.4 * error < tree.error < 2.0 * error
        assert np.all(np.abs(tree.force.sum(axis=0)) <= 1e-13 * size)
        scale = np.abs(exact.virial[:3]).max() + np.abs(exact.energy)
        assert tree.energy == pytest.approx(exact.energy, abs=0.3 * accuracy * scale)
        difference = np.abs(tree.virial - exact.virial).max()
        assert difference <= accuracy * arm * np.linalg.norm(exact.force, axis=1).sum()


def clumps_and_a_straggler():
    """Return two dense clumps 10 m apart, and one particle 100 m away."""
    rng = np.random.default_rng(2)
    clumps = rng.normal(scale=0.05, size=(2, 1500, 3)) + np.array([[[0.0, 0, 0]], [[10.0, 0, 0]]])
    return np.concatenate([clumps.reshape(-1, 3), [[0.0, 100.0, 0.0]]])


SHAPES = {
    "line": np.linspace(0.0, 50.0, 3000)[:, None] * [1.0, 0.0, 0.0],
    "plane": np.random.default_rng(3).uniform(size=(3000, 3)) * [3.0, 3.0, 0.0],
    "lattice": np.stack(np.unravel_index(np.arange(14**3), (14,) * 3), axis=1) * 0.1,
    "clumps": clumps_and_a_straggler(),
    "one": np.zeros((1, 3)),
    "two": np.eye(2, 3),
    "one leaf": np.random.default_rng(4).uniform(size=(32, 3)),
    "two leaves": np.random.default_rng(5).uniform(size=(33, 3)),
}


@pytest.mark.parametrize("shape", SHAPES)
def test_clouds_of_every_shape(tmp_path, shape):
    particles = make_particles(SHAPES[shape])
    exact = sums(tmp_path / "direct", particles, FIELDS["paper"])
    tree = sums(tmp_path / "tree", particles, FIELDS["paper"], "method tree accuracy 1e-5")
    size = np.sqrt((exact.force**2).sum())
    assert np.sqrt(((tree.force - exact.force) ** 2).sum()) <= 1e-5 * size
    assert np.all(np.abs(tree.force.sum(axis=0)) <= 1e-13 * np.abs(exact.force).sum())


@pytest.mark.parametrize("name", MANY_TYPES)
def test_types_with_laws_of_their_own(tmp_path, name):
    particles = ball(3000, seed=6)
    exact = sums(tmp_path / "direct", particles, MANY_TYPES[name])
    tree = sums(tmp_path / "tree", particles, MANY_TYPES[name], "method tree accuracy 1e-4")
    assert tree.order > 0
    assert relative_error(tree.force, exact.force) <= 1e-4
    assert np.all(np.abs(tree.force.sum(axis=0)) <= 1e-13 * np.abs(exact.force).sum(axis=0))


@pytest.mark.parametrize("method", ["", "method tree accuracy 1e-3"])
def test_ranks_and_threads_agree(tmp_path, method):
    particles = ball(2500, seed=7)
    fields = MANY_TYPES["volumes with signs"]
    alone = sums(tmp_path / "alone", particles, fields, method)
    size = np.sqrt((alone.force**2).sum())
    for ranks, threads in ((1, 2), (1, 3), (2, 1), (3, 2)):
        together = sums(
            tmp_path / f"{ranks}-{threads}", particles, fields, method, ranks=ranks, threads=threads
        )
        assert together.order == alone.order
        assert np.sqrt(((together.force - alone.force) ** 2).sum()) <= 1e-13 * size
        assert together.error == pytest.approx(alone.error, rel=1e-6)
        assert together.energy == pytest.approx(alone.energy, rel=1e-12)
        np.testing.assert_allclose(
            together.virial, alone.virial, rtol=0, atol=1e-12 * np.abs(alone.virial).max()
        )


def test_sum_is_the_same_each_time(tmp_path):
    particles = ball(4000, seed=8)
    method = "method tree accuracy 1e-3"
    first, second = (
        sums(tmp_path / name, particles, FIELDS["paper"], method, threads=3) for name in "ab"
    )
    np.testing.assert_array_equal(first.force, second.force)


@pytest.mark.parametrize(("count", "is_tree"), [(1500, False), (20000, True)])
def test_method_is_chosen_by_cost_and_named(tmp_path, count, is_tree):
    found = sums(tmp_path, ball(count, seed=9), FIELDS["paper"], "method auto accuracy 1e-3")
    assert (found.order > 0) == is_tree
    text = "tree of order" if is_tree else "direct sum over all pairs"
    assert re.search(f"^Near field at step 0: {text}", found.log, re.M)


MOTION = """
fix integrate all nve/sphere
timestep {step}
run {steps}
"""


def test_motion_by_tree_follows_that_by_direct_sum(simulate):
    """Through a collapse to half the size, with lists renewed on the way."""
    position = jittered_cloud(13, seed=10).position
    position = position - position.mean(axis=0)
    particles = make_particles(position, velocity=-25.0 * position)
    ends = []
    for method in ("", "method tree accuracy 1e-6"):
        simulation = simulate(particles)
        simulation.commands("neighbor 0.05 nsq\nneigh_modify every 1 delay 0 check yes")
        simulation.commands(law_with(FIELDS["paper"], method))
        simulation.commands(MOTION.format(step=2e-4, steps=100))
        ends.append((simulation.position, simulation.velocity))
    (end, velocity), (end_of_tree, velocity_of_tree) = ends
    assert end.std() < 0.5 * position.std()
    moved = np.linalg.norm(end - position)
    changed = np.linalg.norm(velocity - particles.velocity)
    assert np.linalg.norm(end_of_tree - end) <= 1e-6 * moved
    assert np.linalg.norm(velocity_of_tree - velocity) <= 1e-5 * changed


def test_error_is_measured_anew_as_the_cloud_changes(simulate):
    """At the start of a run, and in it a hundred steps on: of a cloud that becomes a flat disk."""
    position = jittered_cloud(14, seed=15).position
    position = position - position.mean(axis=0)
    simulation = simulate(make_particles(position, velocity=position * [0.0, 0.0, -45.0]))
    simulation.commands("neighbor 0.05 nsq\nneigh_modify every 1 delay 0 check yes")
    simulation.commands(law_with(FIELDS["repulsion alone"], "method tree accuracy 1e-3"))
    simulation.commands("compute approximation all pair blast/nearfield")
    simulation.commands("thermo_style custom step c_approximation[1]")

    def error_after(commands):
        simulation.commands(commands)
        return simulation.lammps.numpy.extract_compute("approximation", 0, 1)[0]

    at_first = error_after("run 0")
    assert error_after(MOTION.format(step=2e-4, steps=90)) == at_first
    later = error_after("run 0")
    assert later != at_first
    assert error_after("run 110") != later


def test_restart_file_carries_method_and_accuracy(simulate, tmp_path):
    simulation = simulate(ball(3000, seed=11))
    simulation.commands(law_with(FIELDS["paper"], "method tree accuracy 1e-3"))
    simulation.commands("compute approximation all pair blast/nearfield\nrun 0")
    force = simulation.per_atom("f")
    simulation.commands(f"""
        write_restart {tmp_path}/state
        clear
        read_restart {tmp_path}/state
        neighbor 0.0 bin
        comm_modify cutoff 1.0e-9
        run 0
    """)
    assert relative_error(simulation.per_atom("f"), force) <= 1e-13


def test_coincident_centres_stop_with_both_ids(simulate):
    position = ball(3000, seed=12).position.copy()
    position[700] = position[2100]
    with pytest.raises(Exception, match=r"atoms (701 and 2101|2101 and 701) coincide at time 0"):
        simulate(make_particles(position)).commands(
            law_with(FIELDS["paper"], "method tree accuracy 1e-3") + "run 0"
        )


def test_coincident_centres_in_two_leaves_are_found(simulate):
    position = np.arange(64)[:, None] * [0.1, 0.0, 0.0]
    position[32] = position[31]
    with pytest.raises(Exception, match=r"atoms (32 and 33|33 and 32) coincide at time 0"):
        simulate(make_particles(position)).commands(
            law_with(FIELDS["paper"], "method tree accuracy 1e-3") + "run 0"
        )


def test_pairs_left_to_another_style_do_not_count(tmp_path, simulate):
    """In a hybrid style, as with neighbour lists."""
    particles = jittered_cloud(4, seed=16)
    simulation = simulate(particles)
    forces = []
    for cutoff, more in (("all", ""), ("9.0", ""), ("all", "method tree accuracy 1e-12")):
        simulation.commands(f"""
            clear
            {SYSTEM.split("read_data")[0]}
            comm_modify cutoff 0.0
            read_data particles.data extra/atom/types 2
            {TYPES}
            pair_style hybrid blast/nearfield {cutoff} mass {more} blast/contact
            pair_coeff * * blast/nearfield 0.5 1 0.3 2
            pair_coeff 1 1 blast/contact stiffness 1.0 exponent 2
            run 0
        """)
        forces.append(simulation.per_atom("f"))
    whole, listed, by_tree = forces
    assert relative_error(whole, listed) <= 1e-13
    assert relative_error(by_tree, listed) <= 1e-11


def test_no_forces_are_exact(tmp_path):
    uncharged = make_particles(ball(3000, seed=17).position, charge=0.0)
    found = sums(tmp_path, uncharged, FIELDS["charge"], "method tree accuracy 1e-3")
    assert found.order > 0
    assert not found.force.any()
    assert "WARNING: Pair" not in found.log


def test_accuracy_out_of_reach_is_summed_directly(tmp_path):
    particles = ball(2000, seed=13)
    exact = sums(tmp_path / "direct", particles, FIELDS["paper"])
    asked = sums(tmp_path / "tree", particles, FIELDS["paper"], "method tree accuracy 1e-13")
    assert asked.order == 0
    assert "no tree reaches accuracy 1e-13" in asked.log
    assert relative_error(asked.force, exact.force) <= 1e-14


BAD_SETTINGS = {
    "0.5 mass method tree accuracy 1e-3": "method and accuracy go with `all` only",
    "0.5 mass accuracy 1e-3": "method and accuracy go with `all` only",
    "all mass method tree": "need an accuracy",
    "all mass method direct accuracy 1e-3": "direct has none",
    "all mass accuracy 1e-3": "direct has none",
    "all mass method fast accuracy 1e-3": "method: fast (direct, tree or auto)",
    "all mass method tree accuracy 0": "accuracy must be above zero",
    "all mass method tree accuracy 1": "accuracy must be less than 1",
    "all mass method": "missing argument",
}


@pytest.mark.parametrize("settings", BAD_SETTINGS)
def test_bad_settings_are_refused_by_name(simulate, settings):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.2, 0, 0]]))
    with pytest.raises(Exception, match=re.escape(BAD_SETTINGS[settings])):
        simulation.commands(f"pair_style blast/nearfield {settings}")


CASE = """
name: gathering
particles:
  {count: 3000, radius: 0.01, density: 7000.0, charge_per_mass: 0.0,
   packing: {method: rsa, domain_radius: 1.0}}
near_field:
  scaling: mass
  attraction: {strength: 0.5, exponent: 1}
  cutoff: all
  method: tree
  accuracy: 1.0e-4
contact: {stiffness: 1.0e7, exponent: 2, damping: 1.0e5}
time: {duration: 1.0e-3, step: 1.0e-4}
output: {interval: 1.0e-3}
"""


def test_run_says_how_its_near_field_was_summed(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE)
    done = blast("run", "case.yaml", "--no-figures", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "runs" / "gathering" / "summary.json").read_text())
    used = summary["near_field"]
    assert used["method"] == "tree"
    assert used["since_step"] == 0
    assert used["error"] <= 1e-4
    assert f"summed by tree, with an error of {used['error']:.1e} of the force" in done.stdout
    # The deck alone, as on a cluster, is summed alike.
    again = lmp("-in", "in.blast", folder=tmp_path / "runs" / "gathering", ranks=2)
    assert again.returncode == 0
    assert f"tree of order {used['order']}" in again.stdout
