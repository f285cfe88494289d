"""Contacts, bonds, ledger and motion shared out among threads and ranks: the same as with one."""

import numpy as np
import pytest
from conftest import SYSTEM, lmp, make_particles

from lammps_blast.deck import write_particle_data

SIDE, SPACING, STEP = 7, 0.099, 2.5e-5  # m, s

SETTINGS = f"""
    neighbor 0.02 bin
    neigh_modify every 1 delay 0 check yes
    comm_modify cutoff 0.2 vel yes
    timestep {STEP}
"""
INTERACTIONS = """
    pair_style blast/contact rotation yes
    pair_coeff * * stiffness 1.0e7 exponent 2 damping 1.0e5 friction 1.0e7 0.4 0.3 &
      bond 2.0e6 1 0.04 1.0e3 contact
"""
MOTION = """
    fix losses all blast/losses
    fix integrate all nve/sphere/lorentz magnetic 10 0 0 drag chow density 1.225 viscosity 1.8e-5
    fix watch all blast/watch 10
    compute kinetic all ke
    compute rotational all erotate/sphere
    compute pair all pair blast/contact
    compute rows all blast/contact/local
    thermo_style custom step c_kinetic c_rotational c_pair[1] c_pair[2] f_losses[1] f_losses[2] &
      f_losses[3] f_losses[4] f_integrate[1] f_integrate[2] c_pair[3] c_pair[4]
    thermo 40
"""
ACCOUNTS = ["c_kinetic", "c_rotational", "c_pair[1]", "c_pair[2]"]
LOSSES = ["f_losses[1]", "f_losses[2]", "f_losses[3]", "f_losses[4]"]
TOTALS = [*ACCOUNTS, *LOSSES, "f_integrate[1]", "f_integrate[2]", "c_pair[3]", "c_pair[4]"]
TOTALS += ["f_watch[1]"]


def run_and_write(name, steps):
    """Return commands that make steps and write the particles' state and all accounts."""
    totals = " ".join(f"$({total}:%.17g)" for total in TOTALS)
    return f"""
        run {steps}
        write_dump all custom {name}.state id x y z vx vy vz omegax omegay omegaz &
          fx fy fz tqx tqy tqz modify sort id format float %.17g
        write_dump all local {name}.rows c_rows[1] c_rows[2] c_rows[4] c_rows[6] c_rows[7] &
          modify format float %.17g
        print "{totals}" file {name}.totals
    """


def crowd():
    """Return spheres that nearly fill a lattice, a third of them in contact, and jostle."""
    rng = np.random.default_rng(7)
    lattice = SPACING * np.stack(np.unravel_index(rng.permutation(SIDE**3), 3 * (SIDE,)), axis=1)
    position = lattice + rng.uniform(-1.0e-3, 1.0e-3, lattice.shape)
    return make_particles(
        position, velocity=rng.normal(size=position.shape), spin=rng.normal(size=position.shape)
    )


def run(folder, commands, words=(), ranks=1):
    folder.mkdir(exist_ok=True)
    (folder / "in.deck").write_text(commands)
    done = lmp("-in", "in.deck", "-log", "none", *words, folder=folder, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr


def results(folder, name):
    """Return state (N, 15), totals and contacts, in order of their ids, of `run_and_write`."""
    state = np.loadtxt(folder / f"{name}.state", skiprows=9)[:, 1:]
    rows = np.loadtxt(folder / f"{name}.rows", skiprows=9)
    rows[:, :2] = np.sort(rows[:, :2], axis=1)
    rows = rows[np.lexsort((rows[:, 1], rows[:, 0]))]
    return state, np.loadtxt(folder / f"{name}.totals"), rows


def assert_same(results, expected):
    (state, totals, rows), (expected_state, expected_totals, expected_rows) = results, expected
    for first in range(0, 15, 3):
        quantity = expected_state[:, first : first + 3]
        np.testing.assert_allclose(
            state[:, first : first + 3], quantity, rtol=0, atol=1e-9 * np.abs(quantity).max()
        )
    # The work of the magnetic field is rounding alone.
    np.testing.assert_allclose(totals, expected_totals, rtol=1e-9, atol=1e-13 * totals[0])
    np.testing.assert_array_equal(rows[:, :2], expected_rows[:, :2])
    atol = 1e-9 * np.abs(expected_rows[:, 2:]).max()
    np.testing.assert_allclose(rows[:, 2:], expected_rows[:, 2:], rtol=0, atol=atol)


@pytest.fixture(scope="module")
def alone(tmp_path_factory):
    """Return the folder of a run with one thread, from a start that all runs have in common."""
    folder = tmp_path_factory.mktemp("threads") / "alone"
    folder.mkdir()
    write_particle_data(crowd(), folder / "particles.data")
    run(folder, start(folder) + run_and_write("middle", 120) + run_and_write("end", 120))
    return folder


def start(folder):
    system = SYSTEM.replace("sort 0 0.0", "sort 20 0.1")
    system = system.replace("particles.data", str(folder / "particles.data"))
    return system + SETTINGS + INTERACTIONS + MOTION


@pytest.mark.parametrize("threads", [2, 3])
@pytest.mark.parametrize("by_package", [True, False])
def test_threads_change_nothing_but_rounding(alone, tmp_path, monkeypatch, threads, by_package):
    words = ["-pk", "omp", str(threads)] if by_package else []
    if not by_package:
        monkeypatch.setenv("OMP_NUM_THREADS", str(threads))
    commands = start(alone) + run_and_write("middle", 120)
    run(tmp_path / "once", commands, words)
    once = results(tmp_path / "once", "middle")
    assert_same(once, results(alone, "middle"))
    totals = once[1]
    assert totals[10] > 300  # contacts
    assert 50 < totals[11] < totals[10]  # bonds
    # A number of threads gives one result, to the last bit.
    run(tmp_path / "again", commands, words)
    for first, second in zip(once, results(tmp_path / "again", "middle"), strict=True):
        np.testing.assert_array_equal(second, first)


def test_ledger_closes_and_momentum_is_kept_in_threads(tmp_path):
    write_particle_data(crowd(), tmp_path / "particles.data")
    without_field = MOTION.replace("magnetic 10 0 0", "").replace("drag chow", "drag none")
    commands = start(tmp_path).replace(MOTION, without_field)
    commands += run_and_write("start", 0) + run_and_write("end", 240)
    run(tmp_path, commands, ["-pk", "omp", "3"])
    state, totals, _ = results(tmp_path, "start")
    end_state, end_totals, _ = results(tmp_path, "end")
    lost = end_totals[4] - totals[4]
    assert lost > 0.1 * totals[0]
    assert end_totals[:8].sum() == pytest.approx(totals[:8].sum(), abs=2e-4 * totals[0])
    momentum, end_momentum = (s[:, 3:6].sum(axis=0) for s in (state, end_state))
    np.testing.assert_allclose(end_momentum, momentum, atol=1e-11 * np.abs(state[:, 3:6]).sum())
    force = end_state[:, 9:12]
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).sum()


def test_a_restart_goes_on_with_another_number_of_threads(alone, tmp_path):
    run(tmp_path, start(alone) + "run 120\nwrite_restart state\n", ["-pk", "omp", "3"])
    commands = f"read_restart state\n{SETTINGS}{MOTION}{run_and_write('end', 120)}"
    run(tmp_path, commands, ["-pk", "omp", "2"])
    assert_same(results(tmp_path, "end"), results(alone, "end"))


def test_balanced_ranks_agree_with_one_and_restart(alone, tmp_path):
    """Ranks' shares change every few steps, and particles move there with their bonds."""
    balance = "comm_style tiled\nfix share all balance 10 1.0 rcb\n"
    commands = start(alone) + balance + run_and_write("middle", 120) + "write_restart state\n"
    run(tmp_path, commands, ranks=2)
    assert_same(results(tmp_path, "middle"), results(alone, "middle"))
    commands = f"read_restart state\n{SETTINGS}{MOTION}{balance}{run_and_write('end', 120)}"
    run(tmp_path, commands, ranks=3)
    assert_same(results(tmp_path, "end"), results(alone, "end"))
