"""The run command under bad input and failures: what it says, its exit status, what it leaves."""

import importlib
import json
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import PROGRAMS, blast, lmp, mount, ranks_at_work

from lammps_blast.analysis import EnergyLedger
from lammps_blast.case import load_case
from lammps_blast.contacts import ContactFrames
from lammps_blast.deck import ENERGY_ACCOUNTS, RESTARTS
from lammps_blast.lammps_program import find_lmp, program_environment
from lammps_blast.restart_notes import newest_restart
from lammps_blast.trajectory import open_universe

CASE = """\
name: small
particles: {count: 20, radius: 0.05, density: 7000.0, charge_per_mass: 10.0,
            packing: {domain_radius: 1.0}}
blast: {energy: 100.0}
fields: {magnetic: [10, 0, 0]}
medium: {density: 1.225, viscosity: 1.8e-5, drag: chow}
time: {duration: 0.01, step: 1.0e-4}
output: {interval: 0.001}
"""

CLUSTER = """\
name: cluster
particles: {count: 60, radius: 0.05, density: 7000.0, charge_per_mass: 10.0,
            packing: {domain_radius: 0.31, relax: true}}
blast: {energy: 300.0}
fields: {magnetic: [10, 0, 0]}
medium: {density: 1.225, viscosity: 1.8e-5, drag: chow}
contact: {stiffness: 1.0e7, exponent: 2, damping: 1.0e5,
          friction: {stiffness: 1.0e7, static: 0.4, dynamic: 0.3}}
near_field: {scaling: mass, attraction: {strength: 0.5, exponent: 1},
             repulsion: {strength: 0.01, exponent: 2}, cutoff: 0.15}
time: {duration: 0.2, step: 1.0e-4}
output: {interval: 0.01, contacts: true}
"""


def without_interactions(text):
    """Return the case of the cluster without contact and near field."""
    lines = text.splitlines(keepends=True)
    gone = ("contact", "near_field", "          friction", "             repul")
    free = "".join(line for line in lines if not line.startswith(gone))
    return free.replace(", contacts: true", "")


BAD_CASES = {
    "unknown key": (CASE + "colour: blue\n", "colour"),
    "misspelt key": (CASE.replace("density: 7000", "densty: 7000"), "did you mean `density`"),
    "wrong type": (CASE.replace("0.05", "wide"), "particles.radius"),
    "nan": (CASE.replace("100.0", ".nan"), "blast.energy"),
    "negative radius": (CASE.replace("0.05", "-0.05"), "particles.radius"),
    "step above duration": (CASE.replace("step: 1.0e-4", "step: 1.0"), "time.step"),
    "empty": ("", "empty"),
    "shell in the name": (CASE.replace("small", '"small\\nshell touch hacked"'), "name"),
    "cannot be packed": (CASE.replace("count: 20", "count: 9000"), "particles.count"),
    "contact": (CASE + "contact: {law: zohdi}\n", "contact.stiffness"),
    "near field that contact cannot resist": (
        CLUSTER.replace("strength: 0.5", "strength: 5.0e3"),
        "near_field.attraction.strength",
    ),
    "implicit": (
        CASE.replace("step: 1.0e-4}", "step: 1.0e-4, integrator: implicit, implicit: {phi: 2}}"),
        "time.implicit.phi: must be at most 1",
    ),
    "file missing": (
        "name: a\nparticles: {file: none.csv}\ntime: {duration: 1, step: 0.1}\n",
        "none.csv",
    ),
}  # fmt: skip


@pytest.fixture
def refused(monkeypatch, capsys):
    """Return a function that gives a command in this process, and returns status and complaint."""

    def give(command, *arguments, folder):
        main = importlib.import_module(f"lammps_blast.{command}").main
        with monkeypatch.context() as here:
            here.chdir(folder)
            status = main([str(word) for word in arguments])
        return status, capsys.readouterr().err

    return give


@pytest.mark.parametrize("kind", BAD_CASES)
def test_bad_case_is_named_and_nothing_is_written(kind, tmp_path, refused):
    text, named = BAD_CASES[kind]
    (tmp_path / "case.yaml").write_text(text)
    status, complaint = refused("run", "case.yaml", folder=tmp_path)
    assert status == 2
    assert named in complaint
    assert [path.name for path in tmp_path.iterdir()] == ["case.yaml"]


@pytest.mark.parametrize(
    ("rows", "named"),
    [
        ("x,y,z,radius,density\n0,0,0,0.1,1000\n", "charge_per_mass"),
        (
            "x,y,z,radius,density,charge_per_mass\n0,0,0,0.1,1000,1\n5,0,0,0.1,1000,1\n"
            "5.1,0,0,0.1,1000,1\n",
            "3 and 4",
        ),
    ],
    ids=["missing column", "overlap"],
)
def test_bad_particle_file_is_named(tmp_path, refused, rows, named):
    (tmp_path / "particles.csv").write_text(rows)
    (tmp_path / "case.yaml").write_text(
        "name: few\nparticles: {file: particles.csv}\ntime: {duration: 1.0, step: 0.1}\n"
    )
    status, complaint = refused("run", "case.yaml", folder=tmp_path)
    assert status == 2
    assert named in complaint


def test_binary_file_is_refused(tmp_path):
    (tmp_path / "case.yaml").write_bytes(bytes(range(256)))
    done = blast("run", "case.yaml", folder=tmp_path)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr


def run(folder, *options, text=CASE):
    (folder / "case.yaml").write_text(text)
    return blast("run", "case.yaml", "--no-figures", *options, folder=folder)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    """Return a folder with the case, and its run in runs/small, that is not to be changed."""
    folder = tmp_path_factory.mktemp("small")
    assert run(folder).returncode == 0
    return folder


@pytest.fixture
def finished(small, tmp_path):
    """Return a copy of the same, which may be changed."""
    shutil.copytree(small, tmp_path / "finished")
    return tmp_path / "finished"


def test_progress_is_told_in_plain_lines_where_there_is_no_terminal(tmp_path):
    text = CASE.replace("count: 20", "count: 1000").replace("duration: 0.01", "duration: 10.0")
    done = run(tmp_path, text=text.replace("interval: 0.001", "interval: 1.0"))
    assert done.returncode == 0
    line = r"\d\S* of 10 s, [\d,]+ steps of LAMMPS/s, \d+ s left"
    assert re.search(line, done.stderr), done.stderr


def test_finished_run_is_replaced_only_by_force(finished):
    keepsakes = [finished / "runs" / "small" / name for name in ("notes.txt", "figures/mine.pdf")]
    for keepsake in keepsakes:
        keepsake.parent.mkdir(exist_ok=True)
        keepsake.write_text("mine")
    before = (finished / "runs" / "small" / "summary.json").read_bytes()
    refused = run(finished)
    assert refused.returncode == 3
    assert "--force" in refused.stderr
    assert (finished / "runs" / "small" / "summary.json").read_bytes() == before
    assert run(finished, "--force").returncode == 0
    assert [keepsake.read_text() for keepsake in keepsakes] == ["mine", "mine"]


def test_first_run_leaves_what_else_is_in_its_folder(tmp_path):
    keepsake = tmp_path / "paper" / "restart" / "mine"
    keepsake.parent.mkdir(parents=True)
    keepsake.write_text("mine")
    assert run(tmp_path, "--output", "paper").returncode == 0
    assert keepsake.read_text() == "mine"


def test_force_does_not_destroy_the_particle_file(tmp_path):
    (tmp_path / "out").mkdir()
    table = tmp_path / "out" / "particles.csv"
    table.write_text("x,y,z,radius,density,charge_per_mass\n0,0,0,0.1,1000,1\n")
    text = "name: a\nparticles: {file: out/particles.csv}\ntime: {duration: 1, step: 0.1}\n"
    done = run(tmp_path, "--output", "out", "--force", text=text)
    assert done.returncode == 3
    assert "input" in done.stderr
    assert table.exists()


def test_run_that_broke_off_is_called_incomplete(finished):
    folder = finished / "runs" / "small"
    case = folder / "case.yaml"
    case.write_text(case.read_text().replace("duration: 0.01", "duration: 0.02"))
    done = blast("analyze", folder, "--no-figures", folder=finished)
    assert "ends before" in done.stdout
    assert json.loads((folder / "summary.json").read_text())["complete"] is False


def test_step_too_large_for_drag_is_warned_about(tmp_path):
    text = CASE.replace("radius: 0.05", "radius: 1.0e-6").replace(
        "domain_radius: 1.0", "domain_radius: 1.0e-4"
    )
    done = run(tmp_path, text=text.replace("100.0", "1.0e-12"))
    assert done.returncode == 0
    assert "time.step is" in done.stderr


def said(done):
    """Return what a command said on stderr, its lines joined."""
    return " ".join(done.stderr.split())


def test_step_too_large_for_a_contact_is_warned_about_with_one_that_is_not(tmp_path):
    done = run(tmp_path, text=CLUSTER.replace("step: 1.0e-4", "step: 1.0e-3"))
    assert done.returncode == 0
    assert "two particles in contact" in said(done)
    (suggested,) = re.findall(r"such as time\.step: (\S+);", said(done))
    assert 1e-5 < float(suggested) < 1e-3
    done = run(tmp_path, "--force", text=CLUSTER.replace("step: 1.0e-4", f"step: {suggested}"))
    assert done.returncode == 0
    assert "advised time.step up to" in said(done)
    assert "WARNING" not in done.stderr


@pytest.mark.parametrize(
    ("stiffness", "symptom"),
    [("1.7e9", "came from nothing"), ("1.0e10", "of its radius in a step")],
)
def test_unstable_run_is_stopped_with_a_step_that_works(tmp_path, stiffness, symptom):
    text = CLUSTER.replace("stiffness: 1.0e7, exponent", f"stiffness: {stiffness}, exponent")
    text = text.replace("damping: 1.0e5,", "")
    done = run(tmp_path, text=text.replace("step: 1.0e-4", "step: 2.0e-3"))
    assert done.returncode == 3
    assert symptom in said(done)
    (told,) = re.findall(r"Fix blast/watch: (.*) in runs/cluster/in.blast, line \d+", said(done))
    assert re.search(r"\batom \d+\b", told)
    assert re.search(r"\btime 0\.\d+\b", told)
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "runs" / "cluster" / "summary.json").exists()
    (suggested,) = re.findall(r"try a time step of (\S+) s or less", said(done))
    text = text.replace("step: 1.0e-4", f"step: {suggested}").replace("0.2,", "0.05,")
    done = run(tmp_path, "--force", text=text)
    assert done.returncode == 0, done.stderr
    assert "WARNING" not in done.stderr


IMPLICIT = CLUSTER.replace(
    "step: 1.0e-4",
    "step: 1.0e-4, integrator: implicit, implicit: {first_step: 1.0e-5, max_step: 2.5e-4}",
)


def test_adaptive_steps_leave_their_history_and_the_same_physics(cluster, tmp_path):
    assert IMPLICIT != CLUSTER
    (tmp_path / "case.yaml").write_text(IMPLICIT)
    done = blast("run", "case.yaml", "--output", "out", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert re.search(r"\d+ steps of 1e-05 to 0\.00025 s, 0 restarts, [\d,]+ force", done.stdout)
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert all(check["passed"] for check in summary["checks"].values())
    assert {check["limit"] for check in summary["checks"].values()} == {1e-3}
    table = np.genfromtxt(tmp_path / "out" / "steps.csv", delimiter=",", names=True)
    ledger = np.genfromtxt(tmp_path / "out" / "energy.csv", delimiter=",", names=True)
    assert summary["steps"] == len(table) == ledger["steps_taken"][-1]
    assert table["step"].sum() == pytest.approx(summary["duration"], rel=1e-12)
    assert summary["integration"]["force_evaluations"] == table["evaluations"][-1]
    assert summary["frames"] == 21
    assert summary["complete"]
    assert "steps" in {path.stem for path in (tmp_path / "out" / "figures").iterdir()}
    expected = json.loads((cluster / "summary.json").read_text())
    for name in ("extent_parallel", "extent_perpendicular"):
        assert summary["envelope"][name] == pytest.approx(expected["envelope"][name], rel=0.02)
    # A run without them takes away what is theirs.
    short = CLUSTER.replace("duration: 0.2", "duration: 0.02")
    done = run(tmp_path, "--output", "out", "--force", text=short)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "out" / "steps.csv").exists()
    assert not (tmp_path / "out" / "figures" / "steps.png").exists()


def test_dumped_forces_of_adaptive_steps_are_those_of_the_frame(tmp_path):
    """Magnetic force and drag included: m dv/dt along the orbit of a free particle."""
    text = without_interactions(IMPLICIT).replace("0.01}", "0.01, forces: true}")
    assert run(tmp_path, "--output", "out", "--no-figures", text=text).returncode == 0
    data = open_universe(tmp_path / "out").trajectory[-1].data
    rest = data["force"] - data["q"][:, None] * np.cross(data["velocity"], [10.0, 0.0, 0.0])
    # What is left is drag, against the velocity.
    speed = np.linalg.norm(data["velocity"], axis=1)
    along = np.einsum("nk,nk->n", rest, data["velocity"]) / speed
    assert (along < 0).all()
    assert np.linalg.norm(rest, axis=1) == pytest.approx(-along, rel=1e-6)


@pytest.mark.parametrize("quiet", [True, False])
def test_warnings_of_a_case_reach_every_user(tmp_path, quiet):
    """Those who write a deck for a cluster, and those who want no progress, among them."""
    text = CLUSTER.replace("step: 1.0e-4", "step: 1.0e-3")
    done = run(tmp_path, *(["--quiet"] if quiet else []), "--no-figures", text=text)
    assert "WARNING: time.step is" in said(done)
    assert ("limiting time scale" in said(done)) == (not quiet)
    done = blast("deck", "case.yaml", "-o", "deck", folder=tmp_path)
    assert done.returncode == 0
    assert "WARNING: time.step is" in done.stderr
    assert "limiting time scale: contact" in done.stderr


def test_deck_of_a_near_field_that_contact_cannot_resist_is_not_written(tmp_path):
    (tmp_path / "case.yaml").write_text(CLUSTER.replace("strength: 0.5", "strength: 5.0e3"))
    done = blast("deck", "case.yaml", folder=tmp_path)
    assert done.returncode == 2
    assert "near_field.attraction.strength" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["case.yaml"]


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    """Return the folder of a run of sixty particles that touch and attract each other."""
    folder = tmp_path_factory.mktemp("cluster")
    (folder / "case.yaml").write_text(CLUSTER)
    done = blast("run", "case.yaml", "--output", "out", folder=folder)
    assert done.returncode == 0, done.stderr
    return folder / "out"


def test_run_of_interacting_particles_leaves_contacts_and_clumps(cluster):
    summary = json.loads((cluster / "summary.json").read_text())
    assert all(check["passed"] for check in summary["checks"].values())
    assert summary["contacts"]["source"] == "recorded"
    assert summary["contacts"]["first"] == 0
    assert summary["contacts"]["last"] > 20
    assert summary["clumps"]["pieces_last"] < summary["clumps"]["pieces_first"]
    assert set(ENERGY_ACCOUNTS[2:]) < set(summary["energy"])
    assert len(ContactFrames(cluster / "contacts.lammpsdump")) == summary["frames"] == 21
    header, *rows = (cluster / "clumps.csv").read_text().splitlines()
    assert header.startswith("time,pieces,")
    assert len(rows) == 21
    drawn = {path.stem for path in (cluster / "figures").iterdir()}
    assert drawn == {
        "cloud", "velocities", "semi_axes", "energy", "clumps", "clump_statistics", "contacts",
        "pair_distances",
    }  # fmt: skip


def test_force_takes_away_what_only_interacting_particles_leave(cluster, tmp_path):
    shutil.copytree(cluster, tmp_path / "out")
    done = run(tmp_path, "--output", "out", "--force", text=without_interactions(CLUSTER))
    assert done.returncode == 0, done.stderr
    left = {path.name for path in (tmp_path / "out").rglob("*")}
    assert "summary.json" in left
    assert not left & {"contacts.lammpsdump", "clumps.csv", "clumps.png", "contacts.png"}
    assert "contacts" not in json.loads((tmp_path / "out" / "summary.json").read_text())


def test_lone_dump_of_interacting_particles_is_analysed(cluster, tmp_path):
    shutil.copy(cluster / "trajectory.lammpstrj", tmp_path / "alone")
    done = blast("analyze", "alone", "--no-figures", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    summary = json.loads((tmp_path / "alone.analysis" / "summary.json").read_text())
    whole = json.loads((cluster / "summary.json").read_text())
    assert summary["contacts"].pop("source") == "positions and radii"
    for name in ("first", "last", "most", "coordination"):
        assert summary["contacts"][name] == whole["contacts"][name]
    assert summary["contacts"]["largest_strain"] == pytest.approx(
        whole["contacts"]["largest_strain"], rel=1e-9
    )
    assert summary["clumps"]["sizes"] == whole["clumps"]["sizes"]


def test_launch_faster_than_light_is_refused(tmp_path, refused):
    (tmp_path / "case.yaml").write_text(CASE.replace("100.0", "1.0e25"))
    status, complaint = refused("run", "case.yaml", folder=tmp_path)
    assert status == 2
    assert "faster than light" in complaint


def test_folder_of_the_case_itself_is_refused(tmp_path, refused):
    (tmp_path / "case.yaml").write_text(CASE)
    status, _ = refused("run", "case.yaml", "--output", ".", "--force", folder=tmp_path)
    assert status == 3
    assert (tmp_path / "case.yaml").read_text() == CASE


def test_folder_that_cannot_be_written(tmp_path, refused):
    (tmp_path / "case.yaml").write_text(CASE)
    (tmp_path / "in_the_way").write_text("a file, not a folder")
    status, complaint = refused("run", "case.yaml", "-o", "in_the_way/run", folder=tmp_path)
    assert status == 3
    assert "in_the_way" in complaint


def test_folder_that_may_only_be_read(small, small_disk, tmp_path, refused):
    shutil.copytree(small, small_disk, dirs_exist_ok=True)
    mount(small_disk, "remount,ro")
    for command in (
        "run case.yaml --output new",
        "run case.yaml --force",
        "run case.yaml --resume",
        "run case.yaml --ranks 2 --output new",
        "deck case.yaml --output new",
        "analyze runs/small",
    ):
        status, complaint = refused(*command.split(), folder=small_disk)
        assert status == 3, command
        cure = "give a folder with --output" if "analyze" in command else "Read-only file system"
        assert cure in complaint
        assert complaint.count("\n") == 1
    folder = small_disk / "runs" / "small"
    for restart in ("no", "newest"):
        done = lmp("-in", "in.blast", "-log", "none", "-var", "restart", restart, folder=folder)
        assert done.returncode != 0
        assert "Read-only file system" in done.stdout
    done = blast("analyze", folder, "--no-figures", "--output", "results", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    table = "envelope.csv"
    assert (tmp_path / "results" / table).read_bytes() == (folder / table).read_bytes()


def test_lammps_failure_is_told_with_lammps_words_and_the_line_of_the_deck(tmp_path):
    """A folder where the trajectory should go makes LAMMPS fail."""
    folder = tmp_path / "out"
    (folder / "trajectory.lammpstrj").mkdir(parents=True)
    code = (
        "import lammps_blast.case_run, lammps_blast.run as r\n"
        "lammps_blast.case_run.prepare_folder = lambda folder, force: None\n"
        "raise SystemExit(r.main(['case.yaml', '--output', 'out']))"
    )
    (tmp_path / "case.yaml").write_text(CASE)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 3
    assert "ERROR" in done.stderr
    line = int(done.stderr.split("in.blast, line ")[1].split()[0])
    assert (folder / "in.blast").read_text().splitlines()[line - 1].startswith("run ")
    assert "Traceback" not in done.stderr


def start_run(folder, before="", ranks=1):
    """Start the run command in a folder with a case, after some Python; Ctrl-C reaches it."""
    command = f"{before}\nfrom lammps_blast.run import main; raise SystemExit(main(['case.yaml']))"
    launcher = [] if ranks == 1 else [str(PROGRAMS / "mpiexec"), "-n", str(ranks)]
    return subprocess.Popen(
        [*launcher, sys.executable, "-c", command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        # A shell may have started the tests in the background, where Ctrl-C is ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def wait_for(condition):
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.05)


def test_interruption_stops_cleanly_and_keeps_the_state(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE.replace("duration: 0.01", "duration: 200.0"))
    process = start_run(tmp_path)
    table = tmp_path / "runs" / "small" / "energy.csv"
    wait_for(lambda: table.exists() and table.read_text().count("\n") > 5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "Traceback" not in errors
    assert newest_restart(table.parent, RESTARTS).step > 0
    assert not (table.parent / "summary.json").exists()
    # MPI shares memory under a name with the number of its process.
    assert not list(Path("/dev/shm").glob(f"*_{process.pid:x}_*"))


ASK = "import os, signal, sys, time\ndef ask(): os.kill(os.getpid(), signal.SIGINT)\n"
ASK_IN_IMPORTS = """
import lammps_blast.run
class Finder:
    def find_spec(name, *_):
        if name == "lammps_blast.case_run":
            ask()
sys.meta_path.insert(0, Finder)
"""
ASK_OTHER_RANKS = f"""
if os.environ.get("PMI_RANK", "0") != "0":
{textwrap.indent(ASK_IN_IMPORTS, "    ")}
"""
ASK_A_LIBRARY_THAT_DOES_NOT_HEED = """
import lammps_blast.deck as deck
dump_case = deck.dump_case
def dump_unheeding(case):
    try:
        ask()
        time.sleep(1)
    except KeyboardInterrupt:
        return dump_case(case)
deck.dump_case = dump_unheeding
"""
ASK_AT_THE_LAST_STEP = """
import lammps_blast.engine as engine
def watch(run, console):
    run.ended.wait()
    ask()
    time.sleep(1)
engine.watch = watch
"""


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize(
    ("asking", "told"),
    [
        (ASK_IN_IMPORTS, "interrupted before the run began"),
        (ASK_A_LIBRARY_THAT_DOES_NOT_HEED, "interrupted before the run began"),
        (ASK_AT_THE_LAST_STEP, "interrupted after the simulation"),
    ],
    ids=["imports", "library", "last step"],
)
def test_an_interruption_is_heeded_whenever_it_comes(tmp_path, asking, told, ranks):
    (tmp_path / "case.yaml").write_text(CASE)
    process = start_run(tmp_path, ASK + ASK_OTHER_RANKS + asking, ranks)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert told in errors
    assert "Traceback" not in errors
    assert not list(tmp_path.glob("runs/small/summary.json"))
    assert run(tmp_path, "--resume").returncode == 0


def test_a_failure_beside_lammps_ends_it_and_keeps_its_own_status(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE.replace("duration: 0.01", "duration: 200.0"))
    fails = (
        "import time, lammps_blast.engine as engine\n"
        "def watch(run, console):\n"
        "    while run.steps_done() < 100: time.sleep(0.01)\n"
        "    raise MemoryError\n"
        "engine.watch = watch\n"
    )
    process = start_run(tmp_path, before=fails)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 3
    assert "the memory is used up" in errors
    assert newest_restart(tmp_path / "runs" / "small", RESTARTS).step >= 100


def test_who_interrupts_again_leaves_at_once(tmp_path):
    """LAMMPS does not stop within a step that lasts for ever."""
    (tmp_path / "case.yaml").write_text(CASE.replace("duration: 0.01", "duration: 200.0"))
    deaf = "import lammps_blast.engine as e; e._InProcess.stop = lambda s: s.ended.wait()\n"
    # What comes after that at the end of a process has crashed one in five with LAMMPS at work.
    usual_end = "import atexit; atexit.register(print, 'ends as usual')\n"
    process = start_run(tmp_path, before=deaf + usual_end)
    folder = tmp_path / "runs" / "small"
    wait_for((folder / "energy.csv").exists)
    process.send_signal(signal.SIGINT)
    time.sleep(1.0)
    assert process.poll() is None
    process.send_signal(signal.SIGINT)
    output, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "ends as usual" not in output
    assert "Traceback" not in errors
    assert "to go on, give --resume" in errors
    assert {path.name for path in tmp_path.iterdir()} == {"case.yaml", "runs"}


@pytest.mark.parametrize("output", ["unread", "full", "closed"])
def test_a_run_goes_on_when_nobody_is_told(tmp_path, output):
    (tmp_path / "case.yaml").write_text(CASE)
    command = f"exec {shlex.quote(sys.executable)} -m lammps_blast.run case.yaml --no-figures"
    to = {"unread": "", "full": ">/dev/full 2>&1", "closed": ">&- 2>&-"}[output]
    process = subprocess.Popen(
        ["sh", "-c", f"{command} {to}"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    process.stderr.close()
    process.stdout.close()
    assert process.wait(timeout=60) == 0
    assert (tmp_path / "runs" / "small" / "summary.json").exists()


def test_an_interruption_before_the_run_begins_is_told(tmp_path):
    code = (
        "import os, signal, threading, lammps_blast.run as r\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "threading.Timer(0.05, os.kill, (os.getpid(), signal.SIGINT)).start()\n"
        "raise SystemExit(r.main(['case.yaml']))"
    )
    (tmp_path / "case.yaml").write_text(CASE)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 130
    assert done.stderr == "interrupted before the run began\n"
    assert not (tmp_path / "runs").exists()


def state_of(folder):
    """Return what a run has written that it goes on with."""
    return {name: (folder / name).read_bytes() for name in ("energy.csv", "trajectory.lammpstrj")}


LONGER = CASE.replace("duration: 0.01", "duration: 50.0").replace(
    "interval: 0.001", "interval: 0.1"
)


@pytest.fixture(scope="module")
def longer(tmp_path_factory):
    """Return what the longer run writes when it is left alone."""
    folder = tmp_path_factory.mktemp("longer")
    assert run(folder, text=LONGER).returncode == 0
    return state_of(folder / "runs" / "small")


@pytest.mark.parametrize("asking", [signal.SIGTERM, signal.SIGKILL])
def test_a_run_that_was_ended_is_resumed(longer, tmp_path, asking):
    (tmp_path / "case.yaml").write_text(LONGER)
    process = start_run(tmp_path)
    folder = tmp_path / "runs" / "small"
    wait_for(lambda: newest_restart(folder, RESTARTS) is not None)
    process.send_signal(asking)
    if asking == signal.SIGTERM:  # batch systems and launchers tell it again
        time.sleep(0.02)
        process.send_signal(asking)
    process.communicate(timeout=60)
    assert process.returncode == (130 if asking == signal.SIGTERM else -signal.SIGKILL)
    again = run(tmp_path, text=LONGER)
    assert again.returncode == 3
    assert "holds a run already" in again.stderr
    resumed = run(tmp_path, "--resume", text=LONGER)
    assert resumed.returncode == 0, resumed.stderr
    assert "small: goes on at " in resumed.stderr
    assert (folder / "summary.json").exists()
    found = state_of(folder)
    if asking == signal.SIGKILL:
        assert found == longer
    else:
        rows = [
            np.genfromtxt(f["energy.csv"].splitlines()[1:], delimiter=",") for f in (longer, found)
        ]
        assert rows[1] == pytest.approx(rows[0], rel=1e-9, abs=1e-9)
    finished = run(tmp_path, "--resume", text=LONGER)
    assert finished.returncode == 0
    assert "is simulated already" in finished.stderr
    assert state_of(folder) == found


def test_a_run_is_made_longer(tmp_path):
    short = CASE.replace("interval: 0.001", "interval: 0.001, restart_interval: 0.005")
    long = short.replace("duration: 0.01", "duration: 0.04")
    assert run(tmp_path, "--output", "whole", text=long).returncode == 0
    assert run(tmp_path, "--output", "run", text=short).returncode == 0
    done = run(tmp_path, "--output", "run", "--resume", text=long)
    assert done.returncode == 0, done.stderr
    assert state_of(tmp_path / "run") == state_of(tmp_path / "whole")
    assert load_case(tmp_path / "run" / "case.yaml").time.duration == 0.04
    # Its own case, which stands for the whole run, goes on as well.
    again = blast("run", "run", "--resume", "--no-figures", folder=tmp_path)
    assert again.returncode == 0, again.stderr
    shorter = run(tmp_path, "--output", "run", "--resume", text=short)
    assert shorter.returncode == 3
    assert "has come to 0.04 s already: time.duration must be at least that" in shorter.stderr


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("energy: 100.0", "energy: 200.0", "blast.energy: 100.0 in the run, 200.0 in the case"),
        ("interval: 0.001", "interval: 0.002", "output.interval: 0.001 in the run, 0.002"),
        ("drag: chow", "drag: none", "medium.drag: chow in the run, none in the case"),
    ],
)
def test_a_run_of_another_case_is_not_resumed(finished, refused, old, new, told):
    before = tree(finished / "runs")
    (finished / "case.yaml").write_text(CASE.replace(old, new))
    status, complaint = refused("run", "case.yaml", "--resume", folder=finished)
    assert status == 3
    assert told in complaint
    assert tree(finished / "runs") == before


def tree(folder):
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_particles_of_another_file_are_not_gone_on_with(tmp_path):
    table = "x,y,z,radius,density,charge_per_mass\n0,0,0,0.05,7000,10\n1,0,0,0.05,7000,10\n"
    (tmp_path / "spheres.csv").write_text(table)
    packed = CASE[CASE.index("particles") : CASE.index("blast")]
    text = CASE.replace(packed, "particles: {file: spheres.csv}\n")
    assert run(tmp_path, text=text).returncode == 0
    assert run(tmp_path, "--resume", text=text).returncode == 0
    (tmp_path / "spheres.csv").write_text(table.replace("\n1,", "\n2,"))
    done = run(tmp_path, "--resume", text=text)
    assert done.returncode == 3
    assert "spheres.csv is not what it was when the run began" in done.stderr


def test_results_of_a_shorter_run_do_not_pass_for_those_of_a_longer_one(finished):
    folder = finished / "runs" / "small"
    deck = folder / "in.blast"
    deck.write_text(deck.read_text().replace("run ${steps}", "no_command"))
    longer = CASE.replace("duration: 0.01", "duration: 0.02")
    done = run(finished, "--resume", text=longer)
    assert done.returncode == 3
    assert "Unknown command: no_command" in done.stderr
    assert not (folder / "summary.json").exists()
    assert not (folder / "envelope.csv").exists()


def test_frames_beyond_the_end_of_a_run_are_not_taken_for_its_own(small, finished):
    """As of a run that was made longer, and killed, and is not to be longer after all."""
    folder = finished / "runs" / "small"
    with (folder / "trajectory.lammpstrj").open("a") as trajectory:
        trajectory.write("ITEM: TIMESTEP\n101\n")
    expected = state_of(small / "runs" / "small")
    assert state_of(folder) != expected
    done = run(finished, "--resume")
    assert done.returncode == 0, done.stderr
    assert state_of(folder) == expected


def test_a_run_whose_case_is_gone_is_not_to_be_replaced(finished):
    (finished / "runs" / "small" / "case.yaml").unlink()
    done = run(finished, "--resume")
    assert done.returncode == 3
    assert "runs/small/case.yaml is gone" in done.stderr
    assert "--force" not in done.stderr


@pytest.mark.parametrize("how", ["damaged", "gone"])
def test_nothing_is_lost_where_a_run_cannot_be_resumed(finished, how):
    for name in RESTARTS:
        file = finished / "runs" / "small" / name
        content = bytearray(file.read_bytes())
        content[len(content) // 2] ^= 1
        file.unlink()
        if how == "damaged":
            file.write_bytes(content)
    before = tree(finished / "runs")
    done = run(finished, "--resume")
    assert done.returncode == 3
    assert "cannot be gone on with" in done.stderr
    assert f"blast.2 is {how}" in done.stderr or f"blast.2 are {how}" in done.stderr
    assert tree(finished / "runs") == before


def test_lmp_at_work_keeps_its_files(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE)
    folder = tmp_path / "runs" / "small"
    assert blast("deck", "case.yaml", "-o", folder, folder=tmp_path).returncode == 0
    at_work = subprocess.Popen(
        [str(find_lmp()), "-in", "in.blast", "-log", "none", "-var", "duration", "200.0"],
        cwd=folder,
        env=program_environment(),
        stdout=subprocess.DEVNULL,
    )
    wait_for(lambda: (folder / "energy.csv").exists())
    for command in ("run", "deck"):
        words = ("-o", folder, "--force")
        done = blast(command, "case.yaml", *words, folder=tmp_path)
        assert done.returncode == 3
        assert "another run is at work in" in done.stderr
    assert (folder / "energy.csv").exists()
    looked_at = blast("analyze", folder, "--no-figures", folder=tmp_path)
    assert looked_at.returncode == 0, looked_at.stderr
    assert "a run is at work in" in looked_at.stderr
    at_work.kill()
    at_work.wait()


def test_one_command_begins_a_run_and_goes_on_with_it(tmp_path):
    for told in (" in runs/small", "is simulated already"):
        done = run(tmp_path, "--resume")
        assert done.returncode == 0, done.stderr
        assert told in done.stderr


def test_two_runs_do_not_share_a_folder(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE.replace("duration: 0.01", "duration: 200.0"))
    process = start_run(tmp_path)
    table = tmp_path / "runs" / "small" / "energy.csv"
    wait_for(table.exists)
    for option in ("--force", "--resume"):
        done = blast("run", "case.yaml", option, folder=tmp_path)
        assert done.returncode == 3
        assert "another run is at work in runs/small" in done.stderr
    process.kill()
    process.communicate()
    assert run(tmp_path, "--force").returncode == 0


def test_ranks_give_the_same_run(tmp_path):
    for options in (["--output", "one"], ["--output", "two", "--ranks", "2", "--threads", "1"]):
        done = run(tmp_path, *options)
        assert done.returncode == 0, done.stderr
    outer = [str(PROGRAMS / "mpiexec"), "-n", "2", sys.executable, "-m", "lammps_blast.run"]
    done = subprocess.run(
        [*outer, "case.yaml", "--output", "outer", "--no-figures"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("results in outer") == 1
    rows = [
        np.genfromtxt(tmp_path / name / "energy.csv", delimiter=",")[1:]
        for name in ("one", "two", "outer")
    ]
    assert rows[1] == pytest.approx(rows[0], rel=1e-9, abs=1e-9)
    assert state_of(tmp_path / "two") == state_of(tmp_path / "outer")


def test_ranks_end_where_the_last_frame_does_not(tmp_path):
    done = run(tmp_path, "--ranks", "2", text=CASE.replace("interval: 0.001", "interval: 0.003"))
    assert done.returncode == 0, done.stderr
    assert newest_restart(tmp_path / "runs" / "small", RESTARTS).step == 100


def test_an_outer_mpiexec_ends_with_an_invalid_case(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE.replace("count: 20", "count: -1"))
    outer = [str(PROGRAMS / "mpiexec"), "-n", "2", sys.executable, "-m", "lammps_blast.run"]
    done = subprocess.run(
        [*outer, "case.yaml"], cwd=tmp_path, capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert done.stderr.count("particles.count: must be at least 1, got -1") == 1


def test_a_rank_that_dies_takes_the_run_down_and_is_told(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE.replace("duration: 0.01", "duration: 200.0"))
    process = subprocess.Popen(
        [sys.executable, "-m", "lammps_blast.run", "case.yaml", "--ranks", "2"],
        cwd=tmp_path,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    folder = tmp_path / "runs" / "small"
    wait_for(lambda: len(ranks_at_work(folder)) == 2 and (folder / "energy.csv").exists())
    os.kill(ranks_at_work(folder)[-1], signal.SIGKILL)
    died = time.monotonic()
    _, errors = process.communicate(timeout=60)
    assert time.monotonic() - died < 10.0
    assert process.returncode == 3
    assert "a rank of LAMMPS died, of signal SIGKILL; to go on, give --resume" in errors


def test_interruption_of_a_relaxation_is_one_before_the_run(tmp_path):
    # With no motion allowed at all, spheres jostle for as long as the deck lets them.
    text = CLUSTER.replace("count: 60, radius: 0.05", "count: 300, radius: 0.12")
    (tmp_path / "case.yaml").write_text(text.replace("domain_radius: 0.31", "domain_radius: 1.0"))
    restless = "import lammps_blast.relaxation as relaxation; relaxation.KINETIC_LIMIT = 0.0\n"
    process = start_run(tmp_path, before=restless)
    log = tmp_path / "runs" / "cluster" / "log.lammps"
    wait_for(lambda: log.exists() and "v_strain\n" in log.read_text())
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130, errors
    assert "before the run began" in errors
    # Steps of the relaxation are none of the run.
    assert "LAMMPS/s" not in errors


def test_text_and_binary_runs_are_the_same(tmp_path):
    for form in ("text", "binary"):
        text = CASE.replace("interval: 0.001", f"interval: 0.001, format: {form}, forces: true")
        assert run(tmp_path, "--output", form, text=text).returncode == 0
    universes = [open_universe(tmp_path / form) for form in ("text", "binary")]
    for a, b in zip(*(universe.trajectory for universe in universes), strict=True):
        assert a.time == pytest.approx(b.time, rel=1e-14)
        for key in ("position", "velocity", "force", "torque", "mass", "q"):
            assert a.data[key] == pytest.approx(b.data[key], rel=1e-14, abs=1e-300)


@pytest.mark.parametrize("integrator", ["lorentz", "verlet"])
def test_first_frame_has_the_forces_of_the_state_after_the_pulse(tmp_path, integrator):
    text = CASE.replace("interval: 0.001", "interval: 0.001, forces: true")
    text = text.replace("magnetic: [10, 0, 0]", "magnetic: [10, 1, 2], electric: [3, -2, 1]")
    text = text.replace("step: 1.0e-4}", f"step: 1.0e-4, integrator: {integrator}}}")
    assert run(tmp_path, text=text).returncode == 0
    data = open_universe(tmp_path / "runs" / "small").trajectory[0].data
    velocity, charge = data["velocity"], data["q"]
    lorentz = charge[:, None] * (np.array([3.0, -2, 1]) + np.cross(velocity, [10.0, 1, 2]))
    difference = data["force"] - lorentz
    # What is left is drag: opposite to the velocity, and small here (the paper's lambda).
    cosine = np.sum(difference * velocity, axis=1) / (
        np.linalg.norm(difference, axis=1) * np.linalg.norm(velocity, axis=1)
    )
    assert cosine == pytest.approx(-1.0, abs=1e-5)
    assert np.abs(difference).max() < 1e-2 * np.abs(lorentz).max()


def test_resolved_case_repeats_the_run(small, tmp_path):
    resolved = small / "runs" / "small" / "case.yaml"
    done = blast("run", resolved, "--no-figures", "--output", tmp_path / "again", folder=tmp_path)
    assert done.returncode == 0
    first, again = (small / "runs" / "small", tmp_path / "again")
    for name in ("in.blast", "particles.data", "energy.csv", "trajectory.lammpstrj", "case.yaml"):
        assert (first / name).read_bytes() == (again / name).read_bytes()


def test_particles_from_a_file_come_along(tmp_path):
    (tmp_path / "my particles.csv").write_text(
        "x,y,z,radius,density,charge_per_mass,vx,vy,vz\n"
        "0,0,0,0.1,1000,2,0,1,0\n1,0,0,0.2,2000,-2,0,0,1\n"
    )
    text = (
        "name: two\nparticles: {file: my particles.csv}\nfields: {magnetic: [0, 0, 3]}\n"
        "time: {duration: 1.0, step: 0.01}\n"
    )
    assert run(tmp_path, text=text).returncode == 0
    folder = tmp_path / "runs" / "two"
    again = blast("run", folder / "case.yaml", "--no-figures", "--output", "again", folder=tmp_path)
    assert again.returncode == 0, again.stderr
    ledger = EnergyLedger.read(folder / "energy.csv")
    assert ledger.kinetic[-1] == pytest.approx(ledger.kinetic[0], rel=1e-13)
    assert len(open_universe(tmp_path / "again").atoms) == 2


def test_one_particle_runs_from_beginning_to_end(tmp_path):
    text = CASE.replace("count: 20", "count: 1")
    (tmp_path / "case.yaml").write_text(text)
    done = blast("run", "case.yaml", folder=tmp_path)
    assert done.returncode == 0, done.stderr
    assert EnergyLedger.read(tmp_path / "runs/small/energy.csv").kinetic[0] == pytest.approx(100.0)


def test_console_script_knows_its_commands(tmp_path):
    (tmp_path / "case.yaml").write_text(CASE)
    for arguments, status in (
        (["theory", "case.yaml"], 0),
        (["deck", "case.yaml", "-o", "deck"], 0),
        (["run", "deck/case.yaml", "--no-figures", "--quiet", "--output", "out"], 0),
        (["analyze", "out", "--no-figures"], 0),
        (["analyze", "out/trajectory.lammpstrj", "--no-figures", "-o", "results"], 0),
        (["analyze", "nowhere"], 3),
        (["lmp", "-help"], 0),
        (["explode"], 2),
        (["--help"], 0),
    ):
        done = subprocess.run(
            [PROGRAMS / "lammps-blast", *arguments],
            cwd=tmp_path, capture_output=True, text=True, env=os.environ | {"COLUMNS": "100"},
        )  # fmt: skip
        assert done.returncode == status, (arguments, done.stderr)
        assert "Traceback" not in done.stderr
    assert (tmp_path / "results" / "summary.json").is_file()


def test_no_particle_is_lost_when_it_crosses_several_ranks(tmp_path):
    """Two streams pass through each other, from the first of four ranks to the last."""
    start = np.linspace(-1.0, 1.0, 60)
    velocity = -4.0 * np.sign(start)
    rows = "".join(f"{x},0,0,0.01,1000,0,{v},0,0\n" for x, v in zip(start, velocity, strict=True))
    head = "x,y,z,radius,density,charge_per_mass,vx,vy,vz\n"
    (tmp_path / "particles.csv").write_text(head + rows)
    (tmp_path / "case.yaml").write_text(
        "name: streams\nparticles: {file: particles.csv}\ntime: {duration: 0.5, step: 0.01}\n"
        "output: {interval: 0.5, restart_interval: 0.5}\n"
    )
    assert blast("deck", "case.yaml", folder=tmp_path).returncode == 0
    deck = tmp_path / "in.blast"
    deck.write_text(deck.read_text().replace("read_data", "processors 4 1 1\nread_data"))
    done = lmp("-in", "in.blast", folder=tmp_path, ranks=4)
    assert done.returncode == 0, done.stdout
    end = open_universe(tmp_path).trajectory[-1].data["position"][:, 0]
    assert end == pytest.approx(start + 0.5 * velocity, rel=1e-12)
