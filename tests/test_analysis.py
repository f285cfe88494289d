"""The analyses against clouds whose envelope is known because it was made so."""

import json
import tracemalloc
from collections import Counter

import numpy as np
import pytest
from conftest import blast

from lammps_blast.analysis import (
    AnalysisError,
    Cloud,
    EnergyLedger,
    Envelope,
    KineticEnergy,
    Speeds,
    Together,
)
from lammps_blast.analyze import analyze, summarize
from lammps_blast.deck import ENERGY_ACCOUNTS
from lammps_blast.step_history import StepHistory
from lammps_blast.trajectory import _Dump, open_universe

AXIS = np.array([1.0, 2.0, -2.0]) / 3.0
FIRST = np.array([2.0, 1.0, 2.0]) / 3.0  # with SECOND and AXIS a right-handed frame
SECOND = np.cross(AXIS, FIRST)
COLUMNS = "id type mass radius q x y z vx vy vz omegax omegay omegaz"


def write_dump(path, frames, *, columns=COLUMNS, **properties):
    """Write a text dump; each frame is (time, position, velocity, angular velocity)."""
    with path.open("w") as file:
        for step, (time, position, velocity, spin) in enumerate(frames):
            count = len(position)
            values = {
                "id": np.arange(1, count + 1),
                "type": np.ones(count),
                "mass": properties.get("mass", np.ones(count)),
                "radius": properties.get("radius", np.full(count, 0.1)),
                "q": properties.get("q", np.ones(count)),
            }
            values |= dict(zip(("x", "y", "z"), position.T, strict=True))
            values |= dict(zip(("vx", "vy", "vz"), velocity.T, strict=True))
            values |= dict(zip(("omegax", "omegay", "omegaz"), spin.T, strict=True))
            file.write(f"ITEM: TIME\n{time!r}\nITEM: TIMESTEP\n{step}\n")
            file.write(f"ITEM: NUMBER OF ATOMS\n{count}\nITEM: BOX BOUNDS ss ss ss\n")
            file.write("-9 9\n-9 9\n-9 9\n" + f"ITEM: ATOMS {columns}\n")
            table = np.column_stack([values[name] for name in columns.split()])
            formats = ["%d" if name in ("id", "type") else "%.17g" for name in columns.split()]
            np.savetxt(file, table, fmt=formats)
    return path


def known_cloud(count=300, *, opposite=False, noise=0.0):
    """Return launch points and what a launch map with a shift for each sign makes of them."""
    rng = np.random.default_rng(1)
    launch = rng.normal(size=(count, 3))
    launch *= (rng.random(count) ** (1 / 3) / np.linalg.norm(launch, axis=1))[:, None]
    launch -= launch.mean(axis=0)
    launch += [5.0, -3.0, 2.0]
    offset = launch - launch.mean(axis=0)
    direction = offset / np.linalg.norm(offset, axis=1)[:, None]
    charge = np.where(opposite & (np.arange(count) % 2 == 1), -1.0, 1.0)
    parallel, perpendicular = 1.7, 0.3 - 0.4j
    across = direction @ FIRST + 1j * (direction @ SECOND)
    turned = np.where(charge > 0, perpendicular * across, np.conj(perpendicular) * across)
    shift = charge[:, None] * np.array([0.2, 0.5, -0.1])
    moved = (
        launch
        + parallel * (direction @ AXIS)[:, None] * AXIS
        + turned.real[:, None] * FIRST
        + turned.imag[:, None] * SECOND
        + shift
        + noise * rng.normal(size=(count, 3))
    )
    return launch, moved, charge, (parallel, perpendicular)


def envelope_of(tmp_path, launch, moved, charge):
    zeros = np.zeros_like(launch)
    frames = [(0.0, launch, zeros, zeros), (0.5, moved, zeros, zeros)]
    path = write_dump(tmp_path / "dump", frames, q=charge)
    return Envelope(open_universe(path), 7.0 * AXIS).run().results


@pytest.mark.parametrize("opposite", [False, True], ids=["one sign", "both signs"])
def test_fit_finds_the_spheroid_that_was_put_in(tmp_path, opposite):
    launch, moved, charge, (parallel, perpendicular) = known_cloud(opposite=opposite)
    results = envelope_of(tmp_path, launch, moved, charge)
    radius = np.linalg.norm(launch - launch.mean(axis=0), axis=1).max()
    assert results.launch_radius == pytest.approx(radius, rel=1e-14)
    assert results.semi_axis_parallel == pytest.approx([radius, radius + parallel], rel=1e-13)
    across = abs(radius + perpendicular)
    assert results.semi_axis_perpendicular == pytest.approx([radius, across], rel=1e-13)
    assert results.fit_residual[1] < 1e-13
    shift = (charge[:, None] * [0.2, 0.5, -0.1]).mean(axis=0)
    assert results.centre[1] == pytest.approx(launch.mean(axis=0) + shift, abs=1e-13)
    assert results.times == pytest.approx([0.0, 0.5])


def test_residual_measures_the_distance_from_a_spheroid(tmp_path):
    launch, moved, charge, _ = known_cloud(2000, noise=1e-3)
    results = envelope_of(tmp_path, launch, moved, charge)
    assert results.fit_residual_rms[1] == pytest.approx(1e-3 * np.sqrt(3), rel=0.05)
    assert results.fit_residual[1] > 2 * results.fit_residual_rms[1]


def test_extents_are_those_of_the_outermost_particles(tmp_path):
    launch = np.array([[0.0, 0, 0], [1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0]])
    launch = np.vstack([launch, -launch[5]])
    moved = launch * [3.0, 2.0, 2.0]
    zeros = np.zeros_like(launch)
    path = write_dump(tmp_path / "dump", [(0.0, launch, zeros, zeros), (1.0, moved, zeros, zeros)])
    results = Envelope(open_universe(path), [1, 0, 0]).run().results
    assert results.extent_parallel == pytest.approx([1.0, 3.0])
    assert results.extent_perpendicular == pytest.approx([1.0, 2.0])
    assert results.blast_radius == pytest.approx([1.0, 3.0])


@pytest.mark.parametrize("shape", ["ring", "line"])
def test_degenerate_clouds_leave_open_what_they_cannot_tell(tmp_path, shape):
    angle = np.linspace(0.0, 2 * np.pi, 12, endpoint=False)
    if shape == "ring":
        launch = np.outer(np.cos(angle), FIRST) + np.outer(np.sin(angle), SECOND)
        moved = 1.5 * launch + [0.3, 0.0, 0.1]
    else:
        launch = np.outer(np.linspace(-1, 1, 4), AXIS)
        moved = launch + np.sign(launch @ AXIS)[:, None] * AXIS + 2.0 * FIRST
    results = envelope_of(tmp_path, launch, moved, np.ones(len(launch)))
    if shape == "ring":
        assert np.isnan(results.semi_axis_parallel[1])
        assert results.semi_axis_perpendicular[1] == pytest.approx(1.5)
    else:
        assert results.semi_axis_parallel[1] == pytest.approx(2.0)
        assert np.isnan(results.semi_axis_perpendicular[1])
        assert results.extent_perpendicular[1] == pytest.approx(0.0, abs=1e-12)
        assert results.centre[1] == pytest.approx(2.0 * FIRST)
    assert results.fit_residual[1] < 1e-12


def test_speeds_and_energies(tmp_path):
    rng = np.random.default_rng(2)
    mass, radius = rng.uniform(1, 2, 50), rng.uniform(0.1, 0.2, 50)
    frames = [(0.1 * i, *rng.normal(size=(3, 50, 3))) for i in range(4)]
    path = write_dump(tmp_path / "dump", frames, mass=mass, radius=radius)
    universe = open_universe(path)
    speeds, energy = Speeds(universe, [7, 3]), KineticEnergy(universe)
    Together(speeds, energy).run(start=1)
    for i, (_, _, velocity, spin) in enumerate(frames[1:]):
        speed = np.linalg.norm(velocity, axis=1)
        assert speeds.results.mean[i] == pytest.approx(speed.mean())
        assert speeds.results.largest[i] == pytest.approx(speed.max())
        assert speeds.results.tracked_velocity[i] == pytest.approx(velocity[[7, 3]])
        assert energy.results.kinetic[i] == pytest.approx(0.5 * np.sum(mass * speed**2))
        inertia = 0.4 * mass * radius**2
        rotational = 0.5 * np.sum(inertia * np.sum(spin**2, axis=1))
        assert energy.results.rotational[i] == pytest.approx(rotational)
    assert speeds.results.times == pytest.approx([0.1, 0.2, 0.3])


def flight(count, frames):
    rng = np.random.default_rng(4)
    launch, zeros = rng.normal(size=(count, 3)), np.zeros((count, 3))
    return [(0.1 * i, (1.0 + i) * launch, launch, zeros) for i in range(frames)]


def test_memory_does_not_grow_with_frames(tmp_path):
    peaks = {}
    for frames in (4, 4, 40):  # the first run also fills caches that stay
        path = write_dump(tmp_path / "dump", flight(1000, frames))
        tracemalloc.start()
        universe = open_universe(path)
        cloud = Cloud.of(universe)
        analyses = Envelope(universe, AXIS, cloud=cloud), Speeds(universe, [3], cloud)
        Together(*analyses, KineticEnergy(universe, cloud)).run()
        peaks[frames] = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
    one_frame = 1000 * len(COLUMNS.split()) * 8
    assert peaks[4] > one_frame
    assert peaks[40] - peaks[4] < 0.5 * one_frame


def test_each_frame_is_read_once_and_the_first_thrice(tmp_path, monkeypatch):
    """To open the trajectory, in the pass over it, and as MDAnalysis rewinds after that."""
    path = write_dump(tmp_path / "dump", flight(50, 5), columns=COLUMNS.replace("radius ", ""))
    read = Counter()
    parse = _Dump._parse

    def counted(self, file, frame):
        read[frame] += 1
        return parse(self, file, frame)

    monkeypatch.setattr(_Dump, "_parse", counted)
    summarize(analyze(path))
    assert read == {0: 3, 1: 1, 2: 1, 3: 1, 4: 1}


def test_missing_columns_and_axes_are_named(tmp_path):
    launch, moved, _charge, _ = known_cloud(10)
    zeros = np.zeros_like(launch)
    frames = [(0.0, launch, zeros, zeros), (0.5, moved, zeros, zeros)]
    bare = open_universe(write_dump(tmp_path / "bare", frames, columns="id type x y z"))
    with pytest.raises(AnalysisError, match="vx vy vz"):
        Speeds(bare)
    with pytest.warns(UserWarning, match="1 kg"):
        Envelope(bare, AXIS).run()
    whole = open_universe(write_dump(tmp_path / "whole", frames))
    for axis in ([0, 0, 0], [np.nan, 0, 1], [1, 0]):
        with pytest.raises(AnalysisError, match="direction"):
            Envelope(whole, axis)


def test_lone_dump_is_analysed_with_a_given_axis(tmp_path):
    launch, moved, _charge, (parallel, _) = known_cloud(100)
    zeros = np.zeros_like(launch)
    frames = [(0.0, launch, zeros, zeros), (0.5, moved, zeros, zeros)]
    write_dump(tmp_path / "a dump", frames, columns=COLUMNS.replace("radius q ", ""))
    done = blast("analyze", "a dump", "--axis", *AXIS, "--no-figures", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "a dump.analysis" / "summary.json").read_text())
    radius = np.linalg.norm(launch - launch.mean(axis=0), axis=1).max()
    assert summary["envelope"]["semi_axis_parallel"] == pytest.approx(radius + parallel)
    assert summary["envelope"]["theory"] is None


def test_dump_of_positions_alone_gives_its_envelope(tmp_path):
    launch, moved, *_ = known_cloud(50)
    zeros = np.zeros_like(launch)
    frames = [(0.0, launch, zeros, zeros), (0.5, moved, zeros, zeros)]
    write_dump(tmp_path / "bare", frames, columns="id type x y z")
    done = blast("analyze", "bare", "--axis", *AXIS, folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "1 kg" in done.stderr
    assert (tmp_path / "bare.analysis" / "figures" / "semi_axes.png").is_file()


HEAD = ",".join(("time", *ENERGY_ACCOUNTS)) + "\n"
OLDER_HEAD = "time,kinetic,rotational,electric_work,drag_loss,magnetic_work\n"
# A blast of 10 J whose accounts balance to the last bit, with energy held at the start.
BALANCED = {
    "kinetic": [10.0, 4.0],
    "rotational": [0.0, 1.0],
    "contact_energy": [0.5, 1.5],
    "bond_energy": [-0.25, -0.75],
    "near_field_energy": [-300.0, -302.0],
    "electric_work": [0.0, 2.0],
    "drag_loss": [0.0, 3.0],
    "magnetic_work": [0.0, 0.0],
    "contact_loss": [0.0, 4.0],
    "friction_loss": [0.0, 0.5],
    "bond_friction_loss": [0.0, 0.25],
    "bond_formation_loss": [0.0, 0.75],
}
# What one joule more in an account takes away from the residual.
TAKEN = dict.fromkeys(ENERGY_ACCOUNTS, 1.0) | {"electric_work": -1.0, "magnetic_work": 0.0}


def ledger_of(tmp_path, accounts):
    rows = zip([0.0, 0.1], *(accounts[name] for name in ENERGY_ACCOUNTS), strict=True)
    lines = (",".join(map(repr, row)) for row in rows)
    (tmp_path / "energy.csv").write_text(HEAD + "\n".join(lines) + "\n")
    return EnergyLedger.read(tmp_path / "energy.csv")


def test_balanced_ledger_has_no_residual(tmp_path):
    ledger = ledger_of(tmp_path, BALANCED)
    assert ledger.residual.tolist() == [0.0, 0.0]
    assert ledger.launch_energy == 10.0
    assert ledger.potential.tolist() == [-299.75, -301.25]
    assert ledger.interaction_loss.tolist() == [0.0, 5.5]


@pytest.mark.parametrize("account", ENERGY_ACCOUNTS)
def test_residual_counts_every_account_with_its_sign(tmp_path, account):
    start, end = BALANCED[account]
    ledger = ledger_of(tmp_path, BALANCED | {account: [start, end + 1.0]})
    assert ledger.residual.tolist() == [0.0, -TAKEN[account]]


@pytest.mark.parametrize(
    ("grown", "turnover"),
    [
        ({}, 10.0),
        # It is the change of a potential that counts, of either sign.
        ({"near_field_energy": [-3000.0, -3050.0]}, 49.5),
        ({"contact_energy": [0.5, 30.5], "bond_energy": [0.0, -10.0]}, 18.0),
        ({"electric_work": [0.0, -70.0]}, 70.0),
        ({"contact_loss": [0.0, 40.0], "friction_loss": [0.0, 2.0]}, 43.0),
        ({"kinetic": [10.0, 20.0], "rotational": [0.0, 15.0]}, 20.0),
        ({"magnetic_work": [0.0, 90.0]}, 10.0),
    ],
)
def test_turnover_is_the_largest_account(tmp_path, grown, turnover):
    assert ledger_of(tmp_path, BALANCED | grown).turnover == turnover


def test_line_that_was_cut_short_is_left_out(tmp_path):
    path = tmp_path / "energy.csv"
    zeros = ",0" * (len(ENERGY_ACCOUNTS) - 1)
    path.write_text(f"{HEAD}0,9{zeros}\n0.1,8{zeros}\n0.2,7{zeros[:-4]},0.00")
    with pytest.warns(UserWarning, match="cut short"):
        ledger = EnergyLedger.read(path)
    assert ledger.times == pytest.approx([0.0, 0.1])


@pytest.mark.parametrize("text", ["", "time\n", "a,b\n1,2\n", HEAD, HEAD + "0,1,2\n"])
def test_damaged_energy_tables_are_refused(tmp_path, text):
    (tmp_path / "energy.csv").write_text(text)
    with pytest.raises(AnalysisError, match=r"energy\.csv"):
        EnergyLedger.read(tmp_path / "energy.csv")


def test_energy_table_of_another_version_is_refused_as_such(tmp_path):
    (tmp_path / "energy.csv").write_text(OLDER_HEAD + "0,9,0,0,0,0\n")
    with pytest.raises(AnalysisError, match=r"energy\.csv: not an energy table of this version"):
        EnergyLedger.read(tmp_path / "energy.csv")


STEPS = "time,step,corrections,error,restarts,evaluations\n"


def test_step_history_is_read_and_adds_up(tmp_path):
    (tmp_path / "steps.csv").write_text(f"{STEPS}0.1,0.1,1,1e-4,0,3\n0.3,0.2,4,2e-5,2,20\n")
    history = StepHistory.read(tmp_path / "steps.csv")
    assert history.duration == pytest.approx(0.3)
    assert history.evaluations_per_second == pytest.approx(20 / 0.3)
    assert history.corrections.tolist() == [1, 4]


@pytest.mark.parametrize("text", ["", STEPS, "time,step\n0,1\n", STEPS + "0,1,x,0,0,0\n"])
def test_damaged_step_histories_are_refused(tmp_path, text):
    (tmp_path / "steps.csv").write_text(text)
    with pytest.raises(AnalysisError, match=r"steps\.csv: not a table of steps"):
        StepHistory.read(tmp_path / "steps.csv")


def test_columns_behind_the_ledger_are_left_to_others(tmp_path):
    head = HEAD.strip() + ",adapted_step,corrections\n"
    zeros = ",0" * (len(ENERGY_ACCOUNTS) - 1)
    (tmp_path / "energy.csv").write_text(f"{head}0,9{zeros},1e-5,3\n")
    assert EnergyLedger.read(tmp_path / "energy.csv").kinetic.tolist() == [9.0]


def test_analysis_of_nothing_is_refused(tmp_path):
    with pytest.raises(ValueError, match="no such file"):
        analyze(tmp_path / "nowhere")
    with pytest.raises(ValueError, match="holds neither"):
        analyze(tmp_path)
