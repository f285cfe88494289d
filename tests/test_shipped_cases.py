"""The cases of lammps_inputs: decks that are what the case files say, run alone, and are right."""

import json
import shutil
from functools import cache

import numpy as np
import pytest
from conftest import REPOSITORY, blast, lmp
from scipy.optimize import brentq

from lammps_blast import theory
from lammps_blast.analysis import EnergyLedger
from lammps_blast.analyze import analyze, summarize
from lammps_blast.case import Medium, load_case, parse_case
from lammps_blast.contacts import ContactFrames
from lammps_blast.deck import CONTACT_TABLE, ENERGY_ACCOUNTS, ENERGY_TABLE, write_deck
from lammps_blast.particles import create_particles
from lammps_blast.trajectory import open_universe

INPUTS = REPOSITORY / "lammps_inputs"
CASES = sorted(folder.name for folder in INPUTS.iterdir())
# Parts of the energy turned over by which the ledger may fail to close: ten times what it does.
LEDGER_LIMITS = {
    "adaptive_contact_blast": 5e-4,
    "bonded_pairs": 6e-5,
    "contact_blast": 6e-9,
    "near_field_all_pairs": 1.2e-4,
    "near_field_blast": 3e-4,
    "oblique_collisions": 9e-7,
}
# Of the trapezoid it is what its tolerance leaves, 2.6e-4 here.
MAGNETIC_WORK_LIMITS = {"adaptive_contact_blast": 5e-4}
FREE = [name for name in CASES if name not in LEDGER_LIMITS]
INTERACTING = sorted(LEDGER_LIMITS)
# All pairs of 2000 particles take long: up to the collapse, with four times the shipped step.
SHORTENED = {"near_field_all_pairs": {"step": 4e-5, "duration": 0.024}}


def settings(**values):
    """Return the words that override variables of a deck."""
    return [word for item in values.items() for word in ("-var", *map(str, item))]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Return a function that runs a shipped deck with nothing but `lmp`, once a module."""

    @cache
    def run(name):
        folder = tmp_path_factory.mktemp(name)
        shutil.copytree(INPUTS / name, folder, dirs_exist_ok=True)
        words = settings(**SHORTENED.get(name, {}))
        result = lmp("-in", "in.blast", *words, folder=folder)
        assert result.returncode == 0, result.stdout + result.stderr
        return folder

    return run


@pytest.fixture(scope="module")
def analyses(runs):
    """Return a function that analyses the run of a shipped deck, once a module."""
    return cache(lambda name: analyze(runs(name)))


@pytest.mark.parametrize("name", CASES)
def test_deck_and_data_are_those_of_the_case_file(name, tmp_path):
    case = load_case(INPUTS / name / "case.yaml")
    assert case.name == name
    assert case.interacts == (name in INTERACTING)
    write_deck(case, create_particles(case), tmp_path)
    for file in ("in.blast", "particles.data"):
        assert (tmp_path / file).read_bytes() == (INPUTS / name / file).read_bytes()


@pytest.mark.parametrize("name", FREE)
def test_lmp_alone_runs_the_deck_and_leaves_enough_to_analyse(name, analyses):
    summary = summarize(analyses(name))
    assert summary["frames"] == 101
    assert summary["particles"] == 2000
    assert summary["envelope"]["theory"] is not None
    assert summary["envelope"]["fraction_outside_theory"] == 0.0
    failed = {key: check for key, check in summary["checks"].items() if not check["passed"]}
    assert not failed
    assert {"energy_ledger", "semi_axis_parallel", "semi_axis_perpendicular"} <= set(
        summary["checks"]
    )


@pytest.mark.parametrize("name", INTERACTING)
def test_lmp_alone_runs_the_deck_of_interacting_particles(name, analyses, runs):
    case = load_case(INPUTS / name / "case.yaml")
    summary = summarize(analyses(name))
    assert summary["particles"] == len(create_particles(case))
    assert summary["complete"] == (name not in SHORTENED)
    assert summary["frames"] == (61 if name in SHORTENED else 101)
    assert summary["envelope"]["theory"] is None
    assert summary["checks"]["energy_ledger"]["value"] < LEDGER_LIMITS[name]
    limit = MAGNETIC_WORK_LIMITS.get(name, 1e-12)
    assert summary["checks"]["magnetic_work"]["value"] < limit
    # Every frame of the trajectory has its contacts, or the deck was not to write them.
    source = "recorded" if case.output.contacts else "positions and radii"
    assert summary["contacts"]["source"] == source
    assert np.isfinite(analyses(name).contacts.results.contacts).all()
    assert (runs(name) / CONTACT_TABLE).exists() == case.output.contacts


@pytest.mark.parametrize("name", FREE)
def test_energy_ledger_closes_to_rounding(name, analyses):
    ledger = analyses(name).ledger
    energy = load_case(INPUTS / name / "case.yaml").blast.energy
    assert np.abs(ledger.residual).max() < 1e-6 * energy


@pytest.mark.parametrize("name", CASES)
def test_energy_ledger_agrees_with_the_trajectory(name, analyses):
    ledger, energy = analyses(name).ledger, analyses(name).energy.results
    case = load_case(INPUTS / name / "case.yaml")
    if case.blast:
        assert ledger.kinetic[0] == pytest.approx(case.blast.energy, rel=1e-12)
    assert energy.kinetic == pytest.approx(ledger.kinetic, rel=1e-11)
    assert energy.rotational == pytest.approx(ledger.rotational, rel=1e-11, abs=1e-300)


def test_magnetic_blast_has_the_papers_numbers(analyses):
    summary = summarize(analyses("magnetic_blast"))
    assert summary["mass"] / 2000 == pytest.approx(3.6652, abs=5e-5)
    assert summary["pulse_speed"] == pytest.approx(1.6518, abs=5e-5)
    assert summary["energy"]["drag_loss"] == pytest.approx(21.644, abs=1e-3)
    # Figure 5: the cloud streams along B and hardly grows across it.
    assert summary["envelope"]["extent_parallel"] > 2.5
    assert summary["envelope"]["extent_perpendicular"] < 0.95


def test_viscous_spheroid_comes_to_rest_as_its_exact_terminal_spheroid(analyses):
    case = load_case(INPUTS / "viscous_spheroid" / "case.yaml")
    particles = create_particles(case)
    results = analyses("viscous_spheroid").envelope.results
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


def test_crossed_fields_move_the_spheroid_as_a_whole(runs, analyses):
    universe = open_universe(runs("crossed_fields_blast"))
    case = load_case(INPUTS / "crossed_fields_blast" / "case.yaml")
    results = analyses("crossed_fields_blast").envelope.results
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


def test_contacts_hardly_matter_to_the_blast(runs, analyses):
    """Figure 8: some 0.03 % of the energy is lost where particles collide, and it does not show."""
    ledger, case = analyses("contact_blast").ledger, load_case(INPUTS / "contact_blast/case.yaml")
    lost = (ledger.contact_loss + ledger.friction_loss)[-1]
    assert 1e-4 < lost / case.blast.energy < 1e-3
    assert ledger.friction_loss[-1] > 0.0
    for account in (ledger.contact_loss, ledger.friction_loss):
        assert (np.diff(account) >= 0.0).all()
    touching, free = (
        analyses(name).envelope.results for name in ("contact_blast", "magnetic_blast")
    )
    for name in ("extent_parallel", "extent_perpendicular", "semi_axis_parallel"):
        assert touching[name] == pytest.approx(free[name], rel=0.02)
    # The two runs start from the same packing; most particles never meet another.
    ends = [
        open_universe(runs(name)).trajectory[-1].data["position"]
        for name in ("contact_blast", "magnetic_blast")
    ]
    assert np.median(np.linalg.norm(ends[0] - ends[1], axis=1)) < 1e-9


def test_the_papers_adaptive_steps_go_at_their_limit_and_are_solved_once(analyses):
    """Section 9 in its own time stepping: one correction a step is Heun's method.

    It multiplies the energy of gyration by 1 + (omega dt)^4/4 a step: that is its magnetic work.
    """
    run, explicit = analyses("adaptive_contact_blast"), analyses("contact_blast")
    steps = run.steps
    assert steps.step[:3] == pytest.approx([1e-5, 1e-4, 2.5e-4])
    # One step is cut at the first output; from there on all of them fit.
    assert np.count_nonzero(np.abs(steps.step / 2.5e-4 - 1) > 1e-6) == 3
    assert steps.corrections.max() == 1
    assert steps.restarts[-1] == 0
    assert np.abs(steps.times[:, None] - run.ledger.times[1:]).min(axis=0).max() < 1e-12
    start = run.universe.trajectory[0].data
    across = 0.5 * np.sum(start["mass"][:, None] * start["velocity"][:, 1:] ** 2)
    gained = across * 4000 * (100 * 2.5e-4) ** 4 / 4
    assert run.ledger.magnetic_work[-1] == pytest.approx(gained, rel=0.01)
    # What the ledger lacks is that, and no more.
    missing = run.ledger.residual + run.ledger.magnetic_work
    assert np.abs(missing).max() < 1e-3 * gained
    for name in ("extent_parallel", "extent_perpendicular"):
        mine, other = run.envelope.results[name], explicit.envelope.results[name]
        assert mine == pytest.approx(other, rel=1e-3)
    assert run.ledger.contact_loss[-1] == pytest.approx(explicit.ledger.contact_loss[-1], rel=0.02)
    # Below its limit friction is proportional to the step.
    friction = run.ledger.friction_loss[-1] / explicit.ledger.friction_loss[-1]
    assert 2.0 < friction < 2.5


def test_near_field_makes_clumps_that_stream_along_the_field(analyses):
    """Figure 9: with a near field cut off at 1.5 diameters, a hundred clumps or so."""
    results = analyses("near_field_blast").clumps.results
    assert results.pieces[0] == 1773
    assert 20 < results.pieces[-1] < 150
    assert results.largest[-1] > 50
    envelope = analyses("near_field_blast").envelope.results
    assert envelope.extent_parallel[-1] > 2.0
    assert envelope.extent_perpendicular[-1] < 1.2
    assert analyses("near_field_blast").ledger.contact_loss[-1] > 1e4


def test_near_field_of_all_pairs_collapses_along_the_field(analyses):
    """Equation 7.23 over all pairs makes a disk normal to B, in a small part of a second."""
    results = analyses("near_field_all_pairs").envelope.results
    flat = results.extent_parallel < 0.25 * results.launch_radius
    assert flat.any()
    first = int(np.argmax(flat))
    assert results.times[first] < 0.025
    assert results.extent_perpendicular[first] > 2.5 * results.extent_parallel[first]
    assert analyses("near_field_all_pairs").ledger.kinetic[first] > 1e6


# Of the spheres of bonded_pairs, pi R^2 in m2: 2 E - E^2 times it is the area of eq. B.5.
DISK = np.pi * 0.05**2


def strains_of_pair(runs, first, second):
    """Return times, strains and bond forces of the frames in which two particles touch."""
    rows = []
    for frame in ContactFrames(runs("bonded_pairs") / CONTACT_TABLE):
        chosen = (np.sort(frame.ids, axis=1) == [first, second]).all(axis=1)
        rows += [(frame.time, frame.strain[k], frame.bond_force[k]) for k in np.flatnonzero(chosen)]
    return np.array(rows).T


def net_pull(strain):
    """Return by how much the bond of bonded_pairs outweighs its contact (eq. 7.5, 7.16), N."""
    return (1.0e6 * strain - 1.0e7 * strain**2) * DISK * (2.0 * strain - strain**2)


def work_of(strain, stiffness, exponent):
    """Return the integral of stiffness E^exponent times the area, from touch to a strain, in J."""
    wide, deep = strain ** (exponent + 2), strain ** (exponent + 3)
    return stiffness * 0.1 * DISK * (2 * wide / (exponent + 2) - deep / (exponent + 3))


def test_slow_pair_bounces_without_a_bond(runs):
    times, strain, bond = strains_of_pair(runs, 1, 2)
    assert 0.02 < strain.max() < 0.05
    assert (bond == 0.0).all()
    assert times[-1] < 0.5
    end = open_universe(runs("bonded_pairs")).trajectory[-1].data
    assert end["position"][1, 0] - end["position"][0, 0] > 0.1
    # Dissipation took most of what it came with.
    assert 0.0 < end["velocity"][1, 0] < 0.5 * 0.05


def test_fast_pair_bonds_and_settles_where_bond_and_contact_balance(runs):
    times, strain, bond = strains_of_pair(runs, 3, 4)
    assert times[-1] == pytest.approx(0.5)
    assert strain[-1] == pytest.approx(1.0e6 / 1.0e7, abs=1e-6)
    assert np.array_equal(bond > 0.0, np.arange(len(bond)) >= np.argmax(strain >= 0.05))


def test_charged_pair_holds_where_its_bond_carries_the_electric_force(runs):
    times, strain, bond = strains_of_pair(runs, 5, 6)
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(0.5)
    assert (bond > 0.0).all()
    mass = 7000.0 * 4 / 3 * np.pi * 0.05**3
    stretched = brentq(lambda e: net_pull(e) - 4.0 * mass * 1.0, 0.07, 0.1, xtol=1e-14)
    assert strain[-1] == pytest.approx(stretched, abs=1e-7)
    strongest = net_pull(np.linspace(0.0, 0.1, 10001)).max()
    assert 4.0 * mass < strongest < 10.0 * mass


def test_highly_charged_pair_tears_its_bond(runs):
    times, strain, bond = strains_of_pair(runs, 7, 8)
    assert (np.diff(strain) < 0.0).all()
    # Below the strain at which bonds form, this one goes on until the two separate.
    assert (bond > 0.0).all()
    assert strain[-1] < 0.05
    assert times[-1] < 0.1
    end = open_universe(runs("bonded_pairs")).trajectory[-1].data
    assert end["position"][7, 0] - end["position"][6, 0] > 1.0


def test_heat_is_set_free_by_the_one_bond_that_forms(analyses):
    ledger = analyses("bonded_pairs").ledger
    # The bond forms at the first step beyond its strain; the pair closes at 0.4 m/s at most.
    overshoot = 0.4 * 1e-4 / 0.1
    least, most = (work_of(strain, 1.0e6, 1) for strain in (0.05, 0.05 + overshoot))
    assert least <= ledger.bond_formation_loss[-1] < most
    formed = np.flatnonzero(np.diff(ledger.bond_formation_loss))
    assert len(formed) == 1
    assert 0.03 < ledger.times[formed[0]] < 0.04
    assert ledger.bond_formation_loss[0] == 0.0


def test_ledger_holds_the_potentials_of_contacts_and_bonds(runs, analyses):
    ledger = analyses("bonded_pairs").ledger
    both = np.array([strains_of_pair(runs, *pair)[1][[0, -1]] for pair in ((5, 6), (7, 8), (3, 4))])
    for row, strains in ((0, both[:2, 0]), (-1, both[[0, 2], 1])):
        bond, contact = -work_of(strains, 1.0e6, 1).sum(), work_of(strains, 1.0e7, 2).sum()
        assert ledger.bond_energy[row] == pytest.approx(bond, rel=1e-8)
        assert ledger.contact_energy[row] == pytest.approx(contact, rel=1e-8)


OBLIQUE_ANGLES = np.radians(np.arange(10, 90, 10))


def motion_of_pairs(universe, frame):
    """Return momenta (8, 3), angular momenta (8, 3) and spins (8, 2) about z of each pair."""
    data = universe.trajectory[frame].data
    mass, radius = data["mass"][:, None], data["radius"][:, None]
    momentum, spin = mass * data["velocity"], data["angular_velocity"]
    turning = np.cross(data["position"], momentum) + 0.4 * mass * radius**2 * spin
    by_pair = (vectors.reshape(8, 2, 3) for vectors in (momentum, turning))
    return *(vectors.sum(axis=1) for vectors in by_pair), spin[:, 2].reshape(8, 2).copy()


def test_oblique_collisions_roll_or_slide(runs):
    _, _, spin = motion_of_pairs(open_universe(runs("oblique_collisions")), -1)
    assert spin[:, 0] == pytest.approx(spin[:, 1], rel=1e-10)
    # Spheres that meet at v = 1 m/s: friction ends the slip, or takes its part of the impulse.
    rolling = -5 / 14 * np.sin(OBLIQUE_ANGLES) / 0.05
    sliding = -5 / 2 * 0.3 * np.cos(OBLIQUE_ANGLES) / 0.05
    up_to_40, from_70 = slice(0, 4), slice(6, 8)
    assert spin[up_to_40, 0] == pytest.approx(rolling[up_to_40], rel=0.01)
    assert spin[from_70, 0] == pytest.approx(sliding[from_70], rel=0.06)
    # Friction cannot do more than end the slip, nor more than sliding all the time.
    assert (np.abs(spin[:, 0]) < 1.005 * np.abs(rolling)).all()
    assert (np.abs(spin[:, 0]) < 1.005 * np.abs(sliding)).all()


def test_oblique_collisions_conserve_momentum_and_angular_momentum(runs):
    universe = open_universe(runs("oblique_collisions"))
    start, turning, _ = motion_of_pairs(universe, 0)
    assert np.abs(start).max() == 0.0
    for frame in (50, 100):
        momentum, later, spin = motion_of_pairs(universe, frame)
        assert np.abs(spin).min() > 1.0
        assert np.abs(momentum).max() < 1e-12
        # Of momenta of 1.8 kg m/s at 1.4 m; spins hold more than 1e-3 of it.
        assert later == pytest.approx(turning, rel=0, abs=1e-11)


def largest_drift(name, folder, *, step, duration, **near_field):
    """Return the largest residual of a shipped case without friction, dissipation and drag.

    As part of the blast's energy, in ten frames.
    """
    case = load_case(INPUTS / name / "case.yaml")
    sections = {
        "contact": case.contact.model_copy(update={"damping": 0.0, "friction": None}),
        "medium": Medium(),
        "time": case.time.model_copy(update={"step": step, "duration": duration}),
        "output": case.output.model_copy(
            update={"interval": duration / 10, "restart_interval": duration, "contacts": False}
        ),
    }
    if case.near_field:
        sections["near_field"] = case.near_field.model_copy(update=near_field)
    case = case.model_copy(update=sections)
    folder = folder / f"{step:g}"
    folder.mkdir()
    write_deck(case, create_particles(case), folder)
    done = lmp("-in", "in.blast", folder=folder)
    assert done.returncode == 0, done.stdout
    ledger = EnergyLedger.read(folder / ENERGY_TABLE)
    assert ledger.interaction_loss.tolist() == [0.0] * 11
    assert ledger.contact_energy.max() > 1e-6 * case.blast.energy
    return np.abs(ledger.residual).max() / case.blast.energy


@pytest.mark.parametrize(
    ("name", "near_field", "step", "duration", "limit"),
    [
        ("contact_blast", {}, 8e-5, 0.2, 5e-10),
        pytest.param("contact_blast", {}, 4e-5, 1.0, 2e-10, marks=pytest.mark.slow),
        ("near_field_blast", {"switch_width": 0.02}, 1e-4, 0.1, 2e-5),
        pytest.param(
            "near_field_blast", {"switch_width": 0.02}, 4e-5, 1.0, 5e-6, marks=pytest.mark.slow
        ),
    ],
)
def test_conservative_forces_keep_the_energy_to_second_order(
    tmp_path, name, near_field, step, duration, limit
):
    drifts = [
        largest_drift(name, tmp_path, step=length, duration=duration, **near_field)
        for length in (step, step / 2)
    ]
    assert drifts[0] < limit
    assert drifts[0] / drifts[1] == pytest.approx(4.0, rel=0.25)


@pytest.mark.parametrize("name", ["contact_blast", "near_field_blast"])
def test_small_adaptive_steps_end_where_small_exact_ones_do(tmp_path, name):
    """Section 9 before chaos sets in, without friction, which depends on the step.

    And with a near field that ends smoothly: a jump makes any step of first order.
    """
    case = load_case(INPUTS / name / "case.yaml").model_dump(mode="json")
    case["contact"]["friction"] = None
    if case["near_field"]:
        case["near_field"]["switch_width"] = 0.02
    case["particles"]["packing"]["relax"] = False
    case["output"] = {"interval": 0.03, "format": "binary"}
    scheme = {"max_step": 2e-5, "tolerance": 1e-8, "solve_fields": True}
    ends = {}
    for integrator, step in (("lorentz", 2e-6), ("implicit", 2e-5)):
        case["time"] = {"duration": 0.03, "step": step, "integrator": integrator}
        case["time"]["implicit"] = scheme
        folder = tmp_path / integrator
        folder.mkdir()
        run = parse_case(case, folder)
        write_deck(run, create_particles(run), folder)
        done = lmp("-in", "in.blast", folder=folder)
        assert done.returncode == 0, done.stdout
        frames = open_universe(folder).trajectory
        start, end = (frames[k].data["position"].copy() for k in (0, -1))
        ends[integrator] = end
    assert EnergyLedger.read(folder / ENERGY_TABLE).contact_loss[-1] > 0.01
    moved = np.sqrt(np.mean((end - start) ** 2))
    off = np.sqrt(np.mean((ends["implicit"] - ends["lorentz"]) ** 2))
    assert off < 2e-6 * moved


@pytest.mark.slow
def test_near_field_that_ends_in_a_jump_keeps_the_energy_nearly_as_well(tmp_path):
    assert largest_drift("near_field_blast", tmp_path, step=4e-5, duration=1.0) < 1.5e-4


@pytest.mark.slow
def test_whole_collapse_of_all_pairs(tmp_path):
    shutil.copytree(INPUTS / "near_field_all_pairs", tmp_path, dirs_exist_ok=True)
    done = lmp("-in", "in.blast", folder=tmp_path)
    assert done.returncode == 0, done.stdout
    analyses = analyze(tmp_path)
    assert analyses.checks["energy_ledger"].value < 2e-5
    results = analyses.envelope.results
    assert results.extent_parallel.min() < 0.15 * results.launch_radius
    assert analyses.ledger.kinetic.max() > 5e6
    # Dissipation has stopped what is left, in one clump.
    assert analyses.ledger.kinetic[-1] < 2e5
    assert analyses.clumps.results.largest[-1] > 1900


def test_ranks_of_the_shipped_deck_agree(runs, tmp_path):
    alone = runs("magnetic_blast")
    for file in ("in.blast", "particles.data"):
        shutil.copy(alone / file, tmp_path)
    done = lmp("-in", "in.blast", folder=tmp_path, ranks=2)
    assert done.returncode == 0, done.stdout + done.stderr
    assert largest_difference(alone, tmp_path) < 1e-12


@pytest.mark.parametrize(
    ("name", "duration", "output_interval", "ranks", "limit"),
    [
        # Contacts make neighbouring paths part: rounding grows with time.
        ("contact_blast", 0.05, 0.01, (2,), 1e-9),
        ("adaptive_contact_blast", 0.05, 0.01, (2,), 1e-8),
        ("near_field_all_pairs", 0.0006, 0.00012, (2, 3), 1e-11),
    ],
)
def test_ranks_of_interacting_particles_agree(
    tmp_path, name, duration, output_interval, ranks, limit
):
    words = settings(duration=duration, output_interval=output_interval)
    for count in (1, *ranks):
        folder = tmp_path / str(count)
        shutil.copytree(INPUTS / name, folder)
        done = lmp("-in", "in.blast", *words, folder=folder, ranks=count)
        assert done.returncode == 0, done.stdout + done.stderr
    alone = tmp_path / "1"
    for count in ranks:
        assert largest_difference(alone, tmp_path / str(count)) < limit
        ledgers = [EnergyLedger.read(f / ENERGY_TABLE) for f in (alone, tmp_path / str(count))]
        for account in ENERGY_ACCOUNTS:
            first, second = (getattr(ledger, account) for ledger in ledgers)
            assert second == pytest.approx(first, rel=0, abs=1e-9 * ledgers[0].turnover)


def largest_difference(folder, other):
    """Return by how much positions or velocities of two runs differ, as part of the largest."""
    differences = []
    for a, b in zip(open_universe(folder).trajectory, open_universe(other).trajectory, strict=True):
        for key in ("position", "velocity"):
            scale = np.abs(a.data[key]).max()
            differences.append(np.abs(b.data[key] - a.data[key]).max() / scale)
    return max(differences)


def test_variables_of_the_deck_override_the_case(tmp_path):
    for file in ("in.blast", "particles.data"):
        shutil.copy(INPUTS / "magnetic_blast" / file, tmp_path)
    words = settings(energy=2.0e4, duration=0.02, step=2e-4, output_interval=0.002)
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
