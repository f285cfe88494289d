"""The cases of lammps_inputs: decks that are what the case files say, run alone, and are right."""

import json
import shutil

import numpy as np
import pytest
from conftest import REPOSITORY, blast, lmp

from lammps_blast import theory
from lammps_blast.analysis import EnergyLedger
from lammps_blast.analyze import analyze, summarize
from lammps_blast.case import load_case
from lammps_blast.deck import ENERGY_TABLE, write_deck
from lammps_blast.particles import create_particles
from lammps_blast.trajectory import open_universe

INPUTS = REPOSITORY / "lammps_inputs"
CASES = sorted(folder.name for folder in INPUTS.iterdir())


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a function that runs a shipped deck with nothing but `lmp`, once a module."""
    done = {}

    def run(name):
        if name not in done:
            folder = tmp_path_factory.mktemp(name)
            for file in ("case.yaml", "in.blast", "particles.data"):
                shutil.copy(INPUTS / name / file, folder)
            result = lmp("-in", "in.blast", folder=folder)
            assert result.returncode == 0, result.stdout + result.stderr
            done[name] = folder
        return done[name]

    return run


@pytest.mark.parametrize("name", CASES)
def test_deck_and_data_are_those_of_the_case_file(name, tmp_path):
    case = load_case(INPUTS / name / "case.yaml")
    assert case.name == name
    write_deck(case, create_particles(case), tmp_path)
    for file in ("in.blast", "particles.data"):
        assert (tmp_path / file).read_bytes() == (INPUTS / name / file).read_bytes()


@pytest.mark.parametrize("name", CASES)
def test_lmp_alone_runs_the_deck_and_leaves_enough_to_analyse(name, runs):
    summary = summarize(analyze(runs(name)))
    assert summary["frames"] == 101
    assert summary["particles"] == 2000
    assert summary["envelope"]["theory"] is not None
    assert summary["envelope"]["fraction_outside_theory"] == 0.0
    failed = {key: check for key, check in summary["checks"].items() if not check["passed"]}
    assert not failed
    assert {"energy_ledger", "semi_axis_parallel", "semi_axis_perpendicular"} <= set(
        summary["checks"]
    )


@pytest.mark.parametrize("name", CASES)
def test_energy_ledger_closes_and_agrees_with_the_trajectory(name, runs):
    ledger = EnergyLedger.read(runs(name) / ENERGY_TABLE)
    case = load_case(INPUTS / name / "case.yaml")
    assert ledger.kinetic[0] == pytest.approx(case.blast.energy, rel=1e-12)
    assert np.abs(ledger.residual).max() < 1e-6 * case.blast.energy
    kinetic = analyze(runs(name)).energy.results.kinetic
    assert kinetic == pytest.approx(ledger.kinetic, rel=1e-11)


def test_magnetic_blast_has_the_papers_numbers(runs):
    summary = summarize(analyze(runs("magnetic_blast")))
    assert summary["mass"] / 2000 == pytest.approx(3.6652, abs=5e-5)
    assert summary["pulse_speed"] == pytest.approx(1.6518, abs=5e-5)
    assert summary["energy"]["drag_loss"] == pytest.approx(21.644, abs=1e-3)
    # Figure 5: the cloud streams along B and hardly grows across it.
    assert summary["envelope"]["extent_parallel"] > 2.5
    assert summary["envelope"]["extent_perpendicular"] < 0.95


def test_viscous_spheroid_comes_to_rest_as_its_exact_terminal_spheroid(runs):
    folder = runs("viscous_spheroid")
    case = load_case(INPUTS / "viscous_spheroid" / "case.yaml")
    particles = create_particles(case)
    results = analyze(folder).envelope.results
    speed = theory.pulse_speed(case.blast.energy, particles.mass.sum())
    terminal = theory.terminal_spheroid(
        results.launch_radius,
        float(speed),
        theory.cyclotron_frequency(10.0, case.fields.magnetic),
        radius=case.particles.radius,
        mass=particles.mass[0],
        drag=theory.DragLaw("stokes", 1.225, case.medium.viscosity),
    )
    measured = results.semi_axis_parallel[-1], results.semi_axis_perpendicular[-1]
    assert measured == pytest.approx(terminal, rel=1e-4)
    assert terminal[0] / terminal[1] > 3.0
    assert results.extent_parallel[-1] == pytest.approx(terminal[0], rel=0.02)


def test_crossed_fields_move_the_spheroid_as_a_whole(runs):
    universe = open_universe(runs("crossed_fields_blast"))
    case = load_case(INPUTS / "crossed_fields_blast" / "case.yaml")
    results = analyze(runs("crossed_fields_blast")).envelope.results
    start = np.array([results.centre[0]])
    moved, _ = theory.lorentz_orbit(
        universe.trajectory[-1].time,
        start,
        np.zeros((1, 3)),
        10.0,
        np.array(case.fields.electric),
        np.array(case.fields.magnetic),
    )
    assert results.centre[-1] == pytest.approx(moved[0], abs=1e-5)


def test_opposite_charges_turn_in_opposite_senses(runs):
    universe = open_universe(runs("mixed_charge_blast"))
    charge = universe.trajectory[0].data["q"]
    first, later = (universe.trajectory[i].data["velocity"] for i in (0, 5))
    turned = np.cross(first, later)[:, 0]
    assert (charge > 0).sum() == 1000
    assert (turned[charge > 0] < 0).all()
    assert (turned[charge < 0] > 0).all()


def test_ranks_of_the_shipped_deck_agree(runs, tmp_path):
    alone = runs("magnetic_blast")
    for file in ("in.blast", "particles.data"):
        shutil.copy(alone / file, tmp_path)
    done = lmp("-in", "in.blast", folder=tmp_path, ranks=2)
    assert done.returncode == 0, done.stdout + done.stderr
    for a, b in zip(
        open_universe(alone).trajectory, open_universe(tmp_path).trajectory, strict=True
    ):
        for key in ("position", "velocity"):
            scale = np.abs(a.data[key]).max()
            assert np.abs(b.data[key] - a.data[key]).max() < 1e-12 * scale


def test_variables_of_the_deck_override_the_case(tmp_path):
    for file in ("in.blast", "particles.data"):
        shutil.copy(INPUTS / "magnetic_blast" / file, tmp_path)
    settings = {"energy": 2.0e4, "duration": 0.02, "step": 2e-4, "output_interval": 0.002}
    words = [word for item in settings.items() for word in ("-var", *map(str, item))]
    done = lmp("-in", "in.blast", *words, folder=tmp_path)
    assert done.returncode == 0, done.stdout
    ledger = EnergyLedger.read(tmp_path / ENERGY_TABLE)
    assert ledger.times == pytest.approx(np.arange(11) * 0.002)
    assert ledger.launch_energy == pytest.approx(2.0e4, rel=1e-12)


def test_run_command_leaves_what_it_promises(tmp_path):
    text = (INPUTS / "magnetic_blast" / "case.yaml").read_text()
    text = text.replace("count: 2000", "count: 100").replace("interval: 0.01", "interval: 0.1")
    (tmp_path / "case.yaml").write_text(text)
    done = blast("run", "case.yaml", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    folder = tmp_path / "runs" / "magnetic_blast"
    for name in ("case.yaml", "in.blast", "particles.data", "log.lammps", "trajectory.lammpstrj"):
        assert (folder / name).is_file()
    assert len(list((folder / "figures").glob("*.png"))) >= 4
    assert list((folder / "restart").iterdir())
    summary = json.loads((folder / "summary.json").read_text())
    assert {
        "name", "particles", "steps", "duration", "wall_seconds", "mass", "pulse_speed", "energy",
        "envelope", "checks",
    } <= set(summary)  # fmt: skip
    assert summary["steps"] == 10000
