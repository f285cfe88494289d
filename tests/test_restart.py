"""Runs that go on from restart files, bit by bit as if nothing had happened."""

import os
import resource
import signal
import subprocess
import time
import zlib

import numpy as np
import pytest
from conftest import lmp, mount, ranks_at_work

from lammps_blast.case import parse_case
from lammps_blast.deck import RESTARTS, write_deck
from lammps_blast.lammps_program import find_lmp, find_mpiexec, program_environment
from lammps_blast.particles import create_particles
from lammps_blast.restart_notes import read_restart_notes

CLOUD = {
    "name": "restarted",
    "seed": 7,
    "particles": {
        "count": 60,
        "radius": 0.05,
        "density": 7000.0,
        "charge_per_mass": 10.0,
        "packing": {"method": "rsa", "domain_radius": 0.3},
    },
    "blast": {"energy": 200.0},
    "fields": {"electric": [0.2, 2.0, 0.0], "magnetic": [10.0, 0.0, 0.0]},
    "medium": {"density": 1.225, "viscosity": 1.8e-5, "drag": "chow"},
    "time": {"duration": 0.05, "step": 1e-4},
    "output": {"interval": 0.005, "restart_interval": 0.01},
}
CONTACT = {
    "stiffness": 1e7,
    "exponent": 2,
    "damping": 1e5,
    "friction": {"stiffness": 1e7, "static": 0.4, "dynamic": 0.3},
    "rotation": True,
}
BOND = {
    "stiffness": 1e6,
    "exponent": 1,
    "tangential_stiffness": 1e3,
    "activation_strain": 0.01,
    "memory": "contact",
}
# Of forces between particles that draw the cloud together, so that contacts last and bonds form.
GATHERING = {"scaling": "mass", "attraction": {"strength": 5.0, "exponent": 1}, "cutoff": "all"}
REPELLING = {"scaling": "mass", "repulsion": {"strength": 0.01, "exponent": 2}}
STOCK = {
    "law": "hertz",
    "youngs_modulus": 1e7,
    "poisson_ratio": 0.3,
    "damping": 0.5,
    "friction": {"static": 0.4, "dynamic": 0.4},
    "rotation": True,
}
FORCES = {"output": CLOUD["output"] | {"forces": True, "format": "binary"}}
CASES = {
    "free": {},
    "binary": FORCES,
    "verlet": {"time": CLOUD["time"] | {"integrator": "verlet"}} | FORCES,
    "contact": {
        "contact": CONTACT,
        "bond": BOND,
        "near_field": GATHERING,
        "output": CLOUD["output"] | {"contacts": True, "forces": True},
    },
    "stock": {"contact": STOCK, "near_field": GATHERING},
    "tree": {"near_field": REPELLING | {"cutoff": "all", "method": "tree", "accuracy": 1e-2}},
    "list": {
        "near_field": {"scaling": "area", "cutoff": 0.3} | REPELLING,
        "particles": CLOUD["particles"] | {"positive_fraction": 0.5},
    },
    "implicit": {
        "contact": {key: CONTACT[key] for key in ("stiffness", "exponent", "damping")},
        "time": CLOUD["time"] | {"step": 5e-3, "integrator": "implicit"},
    },
}
OUTPUTS = ("energy.csv", "trajectory.*", "contacts.lammpsdump", "steps.csv", "constants.lammpsbin")


def deck_of(folder, changes=None):
    """Write a deck of the cloud, with some sections replaced."""
    folder.mkdir(exist_ok=True)
    case = parse_case(CLOUD | (changes or {}), folder)
    write_deck(case, create_particles(case), folder)
    return folder


def command(ranks=1, **variables):
    words = [word for name, value in variables.items() for word in ("-var", name, str(value))]
    lammps = [str(find_lmp()), "-in", "in.blast", "-log", "none", "-nocite", *words]
    return lammps if ranks == 1 else [str(find_mpiexec()), "-n", str(ranks), *lammps]


def run(folder, *, ranks=1, environment=None, limit=None, **variables):
    done = subprocess.run(
        command(ranks, **variables),
        cwd=folder,
        env=program_environment() | (environment or {}),
        preexec_fn=limit,
        capture_output=True,
        text=True,
        timeout=120,
    )
    done.said = done.stdout + done.stderr
    return done


def run_well(folder, **options):
    done = run(folder, **options)
    assert done.returncode == 0, done.said
    return done


def outputs(folder):
    files = [file for pattern in OUTPUTS for file in folder.glob(pattern)]
    return {file.name: file.read_bytes() for file in files}


def newest_and_oldest(folder):
    notes = [read_restart_notes(folder / name) for name in RESTARTS]
    return sorted(notes, key=lambda of_one: -of_one.step)


def interrupt(folder):
    """Take a finished run back to where a crash could have left it, in the midst of a frame."""
    newest, oldest = newest_and_oldest(folder)
    assert oldest.step < newest.step
    newest.file.unlink()
    for name, size in oldest.outputs.items():
        with (folder / name).open("r+b") as file:
            file.truncate((size + (folder / name).stat().st_size) // 2)
            file.seek(0, os.SEEK_END)
            file.write(b"\0 half a frame")


@pytest.fixture
def finished(tmp_path):
    """Return a function that runs a case to its end and returns the folder."""

    def make(changes=None, name="whole", **options):
        folder = deck_of(tmp_path / name, changes)
        run_well(folder, **options)
        return folder

    return make


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("name", CASES)
def test_an_interrupted_run_ends_as_one_that_was_not(finished, name, ranks):
    whole = finished(CASES[name], ranks=ranks)
    expected = outputs(whole)
    assert len(expected) >= 2
    interrupt(whole)
    assert outputs(whole) != expected
    run_well(whole, ranks=ranks, restart="newest")
    found = outputs(whole)
    assert found.keys() == expected.keys()
    if ranks == 1 or name not in ("contact", "list"):
        assert [file for file in expected if found[file] != expected[file]] == []
    else:
        # Ranks that share the cloud out evenly do so anew: other sums are rounded.
        rows = [
            np.genfromtxt(f["energy.csv"].decode().splitlines()[1:], delimiter=",")
            for f in (found, expected)
        ]
        assert np.allclose(*rows, rtol=1e-7, atol=1e-7 * rows[1].max())


def test_the_whole_cloud_of_a_contact_case_touches_and_bonds(finished):
    """The case that the tests above rest on is what it is meant to be."""
    table = np.genfromtxt(finished(CASES["contact"]) / "energy.csv", delimiter=",", names=True)
    for channel in ("contact_loss", "friction_loss", "bond_friction_loss", "bond_formation_loss"):
        middle, end = table[channel][len(table) // 2], table[channel][-1]
        assert 0.0 != middle != end, channel


def test_a_thin_cloud_goes_on_bit_by_bit(tmp_path):
    """Its box has a least size, which it had at the beginning."""
    (tmp_path / "disc.csv").write_text(
        "x,y,z,radius,density,charge_per_mass\n"
        + "".join(f"{0.11 * i},{0.11 * j},0,0.05,7000,10\n" for i in range(24) for j in range(24))
    )
    changes = {
        "particles": {"file": str(tmp_path / "disc.csv")},
        "contact": CASES["implicit"]["contact"],
    }
    folder = deck_of(tmp_path / "disc", changes)
    run_well(folder)
    expected = outputs(folder)
    interrupt(folder)
    run_well(folder, restart="newest")
    assert outputs(folder) == expected


@pytest.mark.parametrize("options", [{}, {"ranks": 2}, {"environment": {"OMP_NUM_THREADS": "2"}}])
@pytest.mark.parametrize("name", ["contact", "tree"])
def test_the_same_run_gives_the_same_bits(finished, name, options):
    one, other = (finished(CASES[name], which, **options) for which in ("one", "other"))
    assert outputs(one) == outputs(other)


def test_a_finished_run_goes_on_to_a_later_end(finished):
    longer = finished({"time": CLOUD["time"] | {"duration": 0.1}} | FORCES, "longer")
    shorter = finished(FORCES, "shorter")
    run_well(shorter, restart="newest", duration=0.1)
    assert outputs(shorter) == outputs(longer)


def test_restart_files_change_nothing_that_depends_on_ranks(tmp_path):
    """Histories of contacts, which LAMMPS keeps in the lists of each rank, stay with them."""
    tables = []
    for ranks in (1, 2):
        folder = deck_of(tmp_path / str(ranks), CASES["stock"])
        run_well(folder, ranks=ranks, restart_interval=0.002)
        tables.append(np.genfromtxt(folder / "energy.csv", delimiter=",")[1:])
    assert np.abs(tables[1] - tables[0]).max() < 1e-11 * tables[0].max()


def test_a_run_on_two_ranks_goes_on_bit_by_bit_where_atoms_change_ranks(finished):
    """Here they turn about the line where the ranks meet, with their histories of contacts."""
    turning = CASES["stock"] | {
        "blast": {"energy": 2000.0},
        "fields": {"electric": [0.2, 2.0, 0.0], "magnetic": [0.0, 0.0, 60.0]},
    }
    intervals = {"ranks": 2, "restart_interval": 5e-3, "output_interval": 5e-3}
    whole = finished(turning, **intervals)
    parts = finished(turning, name="parts", duration=0.015, **intervals)
    run_well(parts, restart="newest", **intervals)
    assert outputs(parts) == outputs(whole)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_file_written_between_runs_leaves_histories_alone(tmp_path, ranks):
    """LAMMPS keeps those of contacts in lists of neighbours, which are renewed for the file."""
    tables = []
    for number, command in enumerate(("", "blast_write_restart state.1 state.2\n")):
        folder = deck_of(tmp_path / str(number), CASES["stock"])
        deck = (folder / "in.blast").read_text()
        before, _, _ = deck.partition("# Two files in turn")
        (folder / "in.blast").write_text(before + "".join(f"run 50\n{command}" for _ in range(6)))
        run_well(folder, ranks=ranks, output_interval=1e-3)
        tables.append(np.genfromtxt(folder / "energy.csv", delimiter=",")[1:])
    assert len(tables[0]) > 20
    assert np.abs(tables[1] - tables[0]).max() < 1e-11 * tables[0].max()


@pytest.mark.parametrize("atoms", ["", "create_atoms 1 single 0 0 0\ncreate_atoms 1 single 0 0 1"])
def test_a_file_is_written_before_any_run(tmp_path, atoms):
    (tmp_path / "in").write_text(
        f"""
        units si
        atom_style sphere
        boundary s s s
        neighbor 0.1 nsq
        comm_modify vel yes
        region ball sphere 0 0 0 2
        create_box 1 ball
        {atoms}
        pair_style granular
        pair_coeff * * hooke 1e5 0.0 tangential linear_history 1e4 0.0 0.4
        fix move all nve/sphere
        blast_write_restart state.1 state.2
        run 1
        """
    )
    done = lmp("-in", "in", "-log", "none", folder=tmp_path)
    assert done.returncode == 0, done.stdout
    assert read_restart_notes(tmp_path / "state.1").step == 0


def test_a_run_that_is_done_stays_as_it_is(finished):
    folder = finished(CASES["contact"])
    expected = outputs(folder)
    run_well(folder, restart="newest")
    assert outputs(folder) == expected


def test_a_misspelt_word_begins_no_run_and_goes_on_with_none(finished):
    folder = finished()
    expected = outputs(folder)
    done = run(folder, restart="Newest", duration=0.1)
    assert done.returncode == 1
    assert "ERROR: restart is no, or newest, but not Newest" in done.said
    assert outputs(folder) == expected


def spoil(file, how):
    content = bytearray(file.read_bytes())
    if how == "pipe":
        file.unlink()
        os.mkfifo(file)
        return
    if how == "short":
        content = content[: len(content) // 2]
    elif how == "flipped":
        content[len(content) // 3] ^= 1
    elif how == "empty":
        content = b""
    elif how == "garbage":
        content = np.random.default_rng(1).bytes(len(content))
    file.write_bytes(content)


@pytest.mark.parametrize("how", ["short", "flipped", "empty", "garbage", "pipe"])
def test_the_older_file_is_used_where_the_newer_one_is_damaged(finished, how):
    folder = finished()
    expected = outputs(folder)
    newest, oldest = newest_and_oldest(folder)
    spoil(newest.file, how)
    assert read_restart_notes(newest.file) is None
    done = run_well(folder, restart="newest")
    assert f"goes on from restart/{oldest.file.name}" in done.said
    assert f"restart/{newest.file.name} " in done.said
    assert outputs(folder) == expected


def test_nothing_is_touched_where_no_restart_file_is_whole(finished):
    folder = finished()
    expected = outputs(folder)
    spoil(folder / RESTARTS[0], "short")
    spoil(folder / RESTARTS[1], "flipped")
    done = run(folder, restart="newest")
    assert done.returncode != 0
    assert "there is no restart file to go on from" in done.said
    assert "restart/blast.1 ends before its seal" in done.said
    assert "restart/blast.2 is damaged" in done.said
    assert outputs(folder) == expected


def test_output_that_was_lost_is_made_again(finished):
    folder = finished()
    expected = outputs(folder)
    newest, oldest = newest_and_oldest(folder)
    size = oldest.outputs["trajectory.lammpstrj"]
    os.truncate(folder / "trajectory.lammpstrj", size + 1)
    done = run_well(folder, restart="newest")
    assert f"restart/{newest.file.name} goes with" in done.said
    assert outputs(folder) == expected


def test_another_step_is_refused(finished):
    folder = finished()
    expected = outputs(folder)
    done = run(folder, restart="newest", step=5e-5)
    assert done.returncode != 0
    assert "has a time step of 0.0001 s, not of 5e-05 s" in done.said
    assert outputs(folder) == expected


def rewrite_notes(file, old, new):
    """Change what a restart file says of itself, and seal it again."""
    notes, seal = file.read_bytes().replace(old, new).rsplit(b"sealed by lammps-blast: ", 1)
    checksum = b"%08x" % zlib.crc32(notes)
    file.write_bytes(notes + b"sealed by lammps-blast: " + seal[:17] + checksum + seal[25:])


def test_other_versions_are_told(finished):
    folder = finished()
    newest, _ = newest_and_oldest(folder)
    rewrite_notes(newest.file, b"\nplugin ", b"\nplugin 0.0.0-")
    done = run_well(folder, restart="newest")
    assert "was written by lammps-blast plugin version 0.0.0-" in done.said


def test_another_layout_is_refused(finished):
    folder = finished()
    expected = outputs(folder)
    newest, _ = newest_and_oldest(folder)
    rewrite_notes(newest.file, b"\nlayout ", b"\nlayout 9")
    done = run(folder, restart="newest")
    assert done.returncode != 0
    assert "holds other numbers than this plugin" in done.said
    assert outputs(folder) == expected


def start(folder, table="energy.csv", **options):
    """Start a run that takes long, and wait until it has written some lines of a table."""
    process = subprocess.Popen(
        command(duration=500.0, **options),
        cwd=folder,
        env=program_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        # A shell may have started the tests in the background, where Ctrl-C is ignored.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    table = folder / table
    end = time.monotonic() + 60
    while not table.is_file() or table.read_bytes().count(b"\n") < 4:
        assert process.poll() is None, process.stdout.read()
        assert time.monotonic() < end
        time.sleep(0.02)
    return process


@pytest.mark.parametrize("ranks", [1, 2])
@pytest.mark.parametrize("asking", [signal.SIGTERM, signal.SIGINT])
def test_a_signal_ends_a_run_with_a_restart_file(tmp_path, asking, ranks):
    folder = deck_of(tmp_path / "run", {"output": CLOUD["output"] | {"restart_interval": 500.0}})
    process = start(folder, ranks=ranks)
    assert not (folder / RESTARTS[0]).exists()
    process.send_signal(asking)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert f"Signal {int(asking)} ends the run at step" in said
    notes = read_restart_notes(folder / RESTARTS[0])
    assert notes.fits_outputs(folder)
    end = 0.005 * (notes.step // 50 + 2)
    run_well(folder, ranks=ranks, restart="newest", duration=end)
    table = np.genfromtxt(folder / "energy.csv", delimiter=",", names=True)
    assert np.allclose(np.diff(table["time"]), 0.005)
    assert table["time"][-1] == pytest.approx(end)


SLOW_STEPS = """
units si
region world block -1 1 -1 1 -1 1
create_box 1 world
create_atoms 1 random 4 1 NULL
mass 1 1.0
fix integrate all nve
fix restart all blast/restart
run 1000 every 1 "print '$(step)' append steps" "shell sleep 0.3"
"""


def test_ranks_heed_a_signal_within_two_steps_where_those_take_long(tmp_path):
    (tmp_path / "in.blast").write_text(SLOW_STEPS)
    process = start(tmp_path, table="steps", ranks=2)
    process.send_signal(signal.SIGTERM)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert 4 <= int(said.split("ends the run at step ")[1].split()[0]) <= 6


def test_a_signal_that_comes_twice_is_one_wish(tmp_path):
    """A batch system tells all processes, and the launcher tells its ranks once more."""
    folder = deck_of(tmp_path / "run", {"output": CLOUD["output"] | {"restart_interval": 500.0}})
    process = start(folder, ranks=2)
    ranks = ranks_at_work(folder)
    assert len(ranks) == 2
    for rank in ranks:
        os.kill(rank, signal.SIGTERM)
    process.send_signal(signal.SIGTERM)
    said, _ = process.communicate(timeout=60)
    assert process.returncode == 0, said
    assert read_restart_notes(folder / RESTARTS[0]).fits_outputs(folder)


@pytest.mark.parametrize("beyond", range(1, 67, 13))
def test_every_byte_of_the_seal_counts(finished, beyond):
    folder = finished() if beyond == 1 else finished(name=f"whole{beyond}")
    newest, oldest = newest_and_oldest(folder)
    content = bytearray(newest.file.read_bytes())
    content[-beyond] ^= 4
    newest.file.write_bytes(content)
    assert read_restart_notes(newest.file) is None
    assert f"goes on from restart/{oldest.file.name}" in run_well(folder, restart="newest").said


def test_an_end_before_the_present_is_refused(finished):
    folder = finished(FORCES)
    expected = outputs(folder)
    done = run(folder, restart="newest", duration=0.03)
    assert done.returncode != 0
    assert "has come to step 500 already" in done.said
    assert outputs(folder) == expected


def test_one_run_at_a_time_in_a_folder(tmp_path):
    folder = deck_of(tmp_path / "run")
    process = start(folder)
    size = (folder / "energy.csv").stat().st_size
    for restart in ("no", "newest"):
        done = run(folder, restart=restart)
        assert done.returncode != 0
        assert "another LAMMPS is at work in this folder: it holds restart/lock" in done.said
    assert (folder / "energy.csv").stat().st_size >= size
    process.kill()
    process.communicate()
    run_well(folder)


def files_of_at_most(size):
    """Return what limits the files that a process may write, as a full disk does."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return limit


LONG = {"duration": 0.1, "output_interval": 1e-4}


@pytest.mark.parametrize("name", ["free", "contact"])
def test_a_file_that_grows_too_large_stops_a_run_that_goes_on_when_it_may(finished, tmp_path, name):
    expected = outputs(finished(CASES[name], **LONG))
    folder = deck_of(tmp_path / "full", CASES[name])
    size = int(0.7 * len(expected["trajectory.lammpstrj"]))
    done = run(folder, limit=files_of_at_most(size), **LONG)
    assert done.returncode != 0
    assert "File too large" in done.said
    run_well(folder, restart="newest", **LONG)
    assert outputs(folder) == expected


def test_a_full_disk_stops_a_run_that_goes_on_when_there_is_room(finished, small_disk):
    expected = outputs(finished(CASES["free"], **LONG))
    deck_of(small_disk)
    for attempt in range(2):
        done = run(small_disk, restart="newest" if attempt else "no", **LONG)
        assert done.returncode != 0
        assert "No space left on device" in done.said
    mount(small_disk, "remount,size=100m")
    run_well(small_disk, restart="newest", **LONG)
    assert outputs(small_disk) == expected


def test_a_restart_file_that_finds_no_room_leaves_the_others(finished):
    folder = finished(CASES["contact"])
    before = [(folder / name).read_bytes() for name in RESTARTS]
    unfinished = folder / f"{RESTARTS[0]}.unfinished"
    unfinished.symlink_to("/dev/full")
    done = run(folder, restart="newest", duration=0.1)
    assert done.returncode != 0
    assert "while writing restart" in done.said
    assert [(folder / name).read_bytes() for name in RESTARTS] == before
    unfinished.unlink()
    run_well(folder, restart="newest", duration=0.1)


def test_a_number_that_is_none_in_the_data_is_refused(tmp_path):
    folder = deck_of(tmp_path / "run", CASES["contact"])
    data = (folder / "particles.data").read_text().splitlines()
    row = data.index("Atoms # hybrid") + 2
    words = data[row].split()
    (folder / "particles.data").write_text(
        "\n".join([*data[:row], " ".join([*words[:2], "nan", *words[3:]]), *data[row + 1 :]]) + "\n"
    )
    done = run(folder)
    assert done.returncode != 0
    assert "ERROR" in done.said


def test_a_table_that_cannot_be_written_stops_the_run(tmp_path):
    folder = deck_of(tmp_path / "run")
    deck = folder / "in.blast"
    deck.write_text(deck.read_text().replace(" energy.csv v_", " /dev/full v_"))
    done = run(folder)
    assert done.returncode != 0
    assert "Fix blast/table cannot write /dev/full: No space left on device" in done.said


def test_ranks_may_be_others_when_a_run_goes_on(finished):
    folder = finished(CASES["contact"])
    expected = np.genfromtxt(folder / "energy.csv", delimiter=",")[1:]
    interrupt(folder)
    run_well(folder, restart="newest", ranks=2)
    found = np.genfromtxt(folder / "energy.csv", delimiter=",")[1:]
    assert np.allclose(found, expected, rtol=1e-7, atol=1e-7 * expected.max())


def test_a_run_that_begins_anew_has_nothing_of_an_earlier_one(finished):
    """Which had come farther, and died between two frames of a binary trajectory."""
    folder = finished(FORCES)
    expected = outputs(folder)
    run_well(folder, duration=0.1, restart="newest")
    (folder / "trajectory.lammpsbin.kept").write_bytes(b"of an earlier run")
    process = start(folder)
    process.kill()
    process.communicate()
    assert not any((folder / name).exists() for name in RESTARTS) or all(
        notes is None or notes.fits_outputs(folder)
        for notes in (read_restart_notes(folder / name) for name in RESTARTS)
    )
    run_well(folder)
    assert outputs(folder) == expected
    assert {notes.step for notes in newest_and_oldest(folder)} == {400, 500}


def test_a_folder_holds_nothing_but_whole_files_in_the_end(finished):
    folder = finished(CASES["contact"])
    assert sorted(p.name for p in (folder / "restart").iterdir()) == ["blast.1", "blast.2", "lock"]
