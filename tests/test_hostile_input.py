"""Files that nobody should feed the package: each ends in a clear message, none in a crash."""

import math
import os
import signal
import struct
import warnings
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from conftest import lmp
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lammps_blast import analyze, deck, theory
from lammps_blast.analysis import AnalysisError, EnergyLedger
from lammps_blast.case import CaseError, dump_case, load_case, parse_case
from lammps_blast.contacts import ContactFrames
from lammps_blast.deck import ENERGY_ACCOUNTS, deck_text
from lammps_blast.particles import ParticleFileError, create_particles, read_particles
from lammps_blast.step_history import COLUMNS, StepHistory
from lammps_blast.summation import SummationReport
from lammps_blast.trajectory import BlastDumpReader, TrajectoryError

CASE = """\
name: hostile
particles: {count: 3, radius: 0.05, density: 7000.0, charge_per_mass: 10.0,
  packing: {domain_radius: 1.0}}
blast: {energy: 1.0e4}
fields: {magnetic: [10.0, 0.0, 0.0]}
medium: {density: 1.225, viscosity: 1.8e-5, drag: chow}
contact: {stiffness: 1.0e7, exponent: 2.0, friction: {stiffness: 1.0e7, static: 0.4, dynamic: 0.3}}
near_field: {scaling: mass, attraction: {strength: 0.5, exponent: 1.0}, cutoff: 0.3}
time: {duration: 1.0e-3, step: 1.0e-4}
output: {interval: 5.0e-4}
"""
CSV = "x,y,z,radius,density,charge_per_mass,sign\n0,0,0,0.1,1,1,1\n1,0,0,0.1,1.5e3,-2,-1\n"
FRAME = """\
ITEM: UNITS
si
ITEM: TIME
{time}
ITEM: TIMESTEP
{step}
ITEM: NUMBER OF ATOMS
2
ITEM: BOX BOUNDS ss ss ss
-1 1
-1 1
-1 1
ITEM: ATOMS id type mass radius q x y z vx vy vz
2 1 1.5 0.1 1 0.5 0 0 1 0 0
1 1 1.5 0.1 1 -0.5 0 0 -1 0 0
"""
TEXT_DUMP = (FRAME.format(time=0, step=0) + FRAME.format(time=0.1, step=10)).encode()
CONTACTS = b"""\
ITEM: TIME
0.01
ITEM: TIMESTEP
100
ITEM: NUMBER OF ENTRIES
1
ITEM: BOX BOUNDS ss ss ss
-1 1
-1 1
-1 1
ITEM: ENTRIES id1 id2 strain normal_force
17 243 0.0012 5.1
"""
ENERGIES = (
    ",".join(("time", *ENERGY_ACCOUNTS)) + "\n" + ",".join(["0"] * 13) + "\n0.1" + ",5" * 12 + "\n"
).encode()
STEPS = (",".join(COLUMNS) + "\n0.1,0.1,2,1e-4,0,3\n0.2,0.1,2,1e-4,0,6\n").encode()
LOG = b"""\
Loop time of 0.5 on 1 procs for 100 steps with 2 atoms
Near field at step 7: tree of order 4, opening 0.5, error 1.2e-07 of the force (asked: 1e-06)
"""


def binary_frame(step, time):
    """Return a frame of LAMMPS's binary format, of two particles."""
    columns = b"id type mass radius q x y z vx vy vz"
    rows = np.array(
        [[2, 1, 1.5, 0.1, 1, 0.5, 0, 0, 1, 0, 0], [1, 1, 1.5, 0.1, 1, 0, 0, 0, 0, 0, 0.0]]
    )
    return b"".join(
        (
            struct.pack("<q", -10) + b"DUMPCUSTOM",
            struct.pack("<iiqqi6i6d", 1, 2, step, 2, 0, *[2] * 6, *[-1, 1] * 3),
            struct.pack("<ii", 11, 2) + b"si" + b"\1" + struct.pack("<d", time),
            struct.pack("<i", len(columns)) + columns,
            struct.pack("<ii", 1, rows.size) + rows.tobytes(),
        )
    )


BINARY_DUMP = b"".join(binary_frame(10 * k, 0.1 * k) for k in range(4))


@contextmanager
def at_most(seconds):
    """Turn what waits or goes on for ever into a failure."""

    def give_up(*_):
        raise TimeoutError(f"still busy after {seconds} s")

    before = signal.signal(signal.SIGALRM, give_up)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def examples(count):
    """Return settings that try the same examples every time."""
    return settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )


TOKENS = (
    b"nan .nan inf -.inf -1 0 1e308 1e400 1e-320 9223372036854775808 -9223372036854775809 1_0 "
    b"0x1p3 1000000000000000000 ITEM: id velocity position x * & ! | > % @ ` ' \" ? - {} [] <<: ~ "
    b"true no 2001-99-99 \xff \x00 \xe2\x80\xa8 \x1b[2J *a &a !!int !!python/object:os.system"
).split(b" ")
TOKENS += [
    b"",
    b"9" * 5000,
    b"\n",
    b"\r",
    b"\t",
    b",",
    b",,",
    b": ",
    b"shell touch pwned",
    b"$(1/0)",
]


@st.composite
def damaged(draw, *originals):
    """Make one of some files otherwise: cut, with bytes or words replaced, lost or repeated."""
    content = draw(st.sampled_from(originals))
    for _ in range(draw(st.integers(1, 4))):
        start = draw(st.integers(0, len(content)))
        length = draw(st.sampled_from((0, 1, 2, 4, 8, 40)))
        piece = content[start : start + length]
        substitute = draw(
            st.one_of(
                st.sampled_from(TOKENS),
                st.binary(max_size=8),
                st.just(b""),
                st.just(2 * piece),
                st.sampled_from((-1, 0, 1, 7, 2**31 - 1, 10**18, 2**63 - 1)).map(
                    lambda n: struct.pack("<q", n)
                ),
                st.floats(width=64).map(lambda x: struct.pack("<d", x)),
            )
        )
        content = content[:start] + substitute + content[start + length :]
        if draw(st.integers(0, 9)) == 0:
            content = content[: draw(st.integers(0, len(content)))]
    return content


def is_shown_whole(problem):
    """Tell whether a message stays on its line, and is not endless."""
    return problem.isprintable() and 0 < len(problem) < 1000


def refused(error):
    """Check the message of a refused file; return False, for no file that can be used."""
    assert error.problems
    assert all(map(is_shown_whole, error.problems))
    return False


def check_case(content, path):
    """A case file is refused line by line, or it is a case that can be written and read again."""
    path.write_bytes(content)
    try:
        case = load_case(path)
    except CaseError as error:
        return refused(error)
    assert parse_case(dump_case(case), path.parent) == case
    return True


def check_particles(content, path):
    path.write_bytes(content)
    try:
        particles = read_particles(path)
    except ParticleFileError as error:
        return refused(error)
    assert len(particles) > 0
    assert np.isfinite(particles.position).all()
    assert (particles.radius > 0.0).all()
    assert np.isin(particles.sign, (1.0, -1.0)).all()
    return True


def check_dump(content, path):
    """Of a dump come whole frames, or an error."""
    path.write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        try:
            reader = BlastDumpReader(path, timestep=0.01)
            for ts in reader:
                assert ts.data["position"].shape == (reader.n_atoms, 3)
                assert math.isfinite(ts.data["time"])
                assert -(2**63) < ts.data["step"] < 2**63
        except TrajectoryError:
            return False
    return True


def check_tables(content, path):
    """Each reader of what a run leaves says what it finds, or that it finds nothing."""
    path.write_bytes(content)
    readable = 0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        for read in (EnergyLedger.read, StepHistory.read, lambda p: list(ContactFrames(p))):
            with suppress(AnalysisError, TrajectoryError):
                readable += read(path) is not None
        SummationReport.read(path)
        analyze.wall_seconds_of(path)
    return readable > 0


READERS = {
    "case": (check_case, [CASE.encode()]),
    "csv": (check_particles, [CSV.encode()]),
    "dump": (check_dump, [TEXT_DUMP, BINARY_DUMP]),
    "tables": (check_tables, [ENERGIES, STEPS, CONTACTS, LOG]),
}


def search(reader, path, count):
    """Try damaged files on a reader; return how many it could use all the same."""
    check, originals = READERS[reader]
    usable = []

    @examples(count)
    @given(damaged(*originals))
    def try_one(content):
        with at_most(20.0):
            usable.append(check(content, path))

    try_one()
    return sum(usable), len(usable)


@pytest.mark.parametrize("reader", READERS)
def test_damaged_files_are_refused_or_whole(tmp_path, reader):
    for original in READERS[reader][1]:
        assert READERS[reader][0](original, tmp_path / "file") or original is LOG
    usable, tried = search(reader, tmp_path / "file", 100)
    assert usable < tried >= 100


@pytest.mark.slow
@pytest.mark.parametrize("reader", READERS)
def test_many_damaged_files_are_refused_or_whole(tmp_path, reader):
    usable, tried = search(reader, tmp_path / "file", 5000)
    assert usable < tried >= 5000


@pytest.mark.parametrize("content", [TEXT_DUMP, BINARY_DUMP], ids=["text", "binary"])
def test_a_dump_may_be_cut_anywhere(tmp_path, content):
    first = len(FRAME.format(time=0, step=0)) if content is TEXT_DUMP else len(content) // 4
    for cut in range(0, len(content), 11):
        assert check_dump(content[:cut], tmp_path / "dump") == (cut >= first)


def merge_bomb(levels):
    lines = ["a0: &a0 {x: 1}"]
    for level in range(1, levels):
        aliases = ", ".join(9 * [f"*a{level - 1}"])
        lines.append(f"a{level}: &a{level} {{<<: [{aliases}]}}")
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (merge_bomb(12), "more than 20 aliases"),
        (merge_bomb(12).replace("{<<: ", "").replace("]}", "]"), "more than 20 aliases"),
        ("[" * 20_000, "nested too deeply"),
        ("- " * 30_000, "nested too deeply"),
        ("a: {" * 10_000, "nested too deeply|not valid YAML"),
        ("x: [" + "1," * 30_000 + "]", "more than 2000 values"),
        ("".join(f"k{i}: 1\n" for i in range(900)), "further problems are not listed"),
        ("seed: !!int ''", "no use for tags such as !!int"),
        ("seed: !!bool x", "no use for tags such as !!bool"),
        ("seed: !!python/object/apply:os.system [ls]", "no use for tags such as !!python"),
        ("seed: " + "9" * 60_000, "not valid YAML: .*4300 digits"),
        ("seed: 0x" + "f" * 60_000, "seed: must be less than 2147483648, got an enormous integer"),
        ("blast: {energy: 1e400}", "blast.energy: must be a finite number"),
        ("title: &a {b: *a}", "title: must be text"),
        ("name: a\nname: b", 'duplicate key "name"'),
    ],
)
def test_small_texts_cost_little(tmp_path, text, expected):
    with at_most(20.0), pytest.raises(CaseError, match=expected) as told:
        parse_case(text, tmp_path)
    assert len(told.value.problems) <= 51
    assert all(map(is_shown_whole, told.value.problems))


NO_FILES = {
    "folder": lambda path: path.mkdir(),
    "pipe": os.mkfifo,
    "endless": lambda path: path.symlink_to("/dev/zero"),
    "forbidden": lambda path: path.write_text(CASE) and path.chmod(0),
    "missing": lambda path: None,
    "loop": lambda path: path.symlink_to(path),
    "empty": lambda path: path.touch(),
    "hole": lambda path: path.touch() or os.truncate(path, 2**40),
}


@pytest.mark.parametrize("kind", NO_FILES)
def test_what_is_no_file_with_an_end_is_refused(tmp_path, kind, capsys):
    path = tmp_path / "input"
    NO_FILES[kind](path)
    if kind == "forbidden" and os.access(path, os.R_OK):
        pytest.skip("the superuser may read everything")
    with at_most(20.0):
        assert theory.main([str(path)]) == 2
        assert deck.main([str(path), "-o", str(tmp_path / "deck")]) == 2
        with pytest.raises(ParticleFileError, match=r"particles\.file: "):
            read_particles(path)
        if kind != "hole":  # the end of a text that large is sought for minutes
            assert analyze.main([str(path), "--no-figures"]) == 3
            for read in (EnergyLedger.read, StepHistory.read):
                with pytest.raises(AnalysisError, match="input: not a"):
                    read(path)
            with pytest.raises(TrajectoryError, match=r"input: "):
                ContactFrames(path)
            assert SummationReport.read(path) is None
            assert analyze.wall_seconds_of(path) is None
    assert all(map(is_shown_whole, capsys.readouterr().err.splitlines()))
    assert sorted(p.name for p in tmp_path.iterdir()) in (["input"], [])


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({b"ITEM: NUMBER OF ATOMS\n2": b"ITEM: NUMBER OF ATOMS\n1000000000000000000"}, "cut|atoms"),
        ({b"TIMESTEP\n10": b"TIMESTEP\n9223372036854775808"}, "a time step beyond"),
        ({b"TIME\n0.1": b"TIME\nnan"}, "nan is no time"),
        ({b"TIME\n0.1": b"TIME\n-5"}, "is before that of frame 0"),
    ],
)
def test_numbers_in_a_header_are_those_of_a_run(tmp_path, changes, expected):
    content = TEXT_DUMP
    for old, new in changes.items():
        assert old in content
        content = content.replace(old, new)
    (tmp_path / "dump").write_bytes(content)
    with pytest.raises(TrajectoryError, match=expected):
        list(BlastDumpReader(tmp_path / "dump"))


def test_a_run_folder_of_wild_numbers_is_analysed_or_refused(tmp_path, capsys):
    """What a diverged or damaged run leaves: no number in any column, in the whole of `analyze`."""
    (tmp_path / "case.yaml").write_text(CASE)
    for value in ("nan", "inf", "-1", "1e308", "0"):
        wild = TEXT_DUMP.replace(b" 0.5 0 0 1 0 0", f" {value} 0 0 {value} 0 0".encode())
        (tmp_path / "trajectory.lammpstrj").write_bytes(wild)
        (tmp_path / "energy.csv").write_bytes(ENERGIES.replace(b",5", f",{value}".encode()))
        with np.errstate(all="ignore"):
            assert analyze.main([str(tmp_path), "--no-figures"]) == 0
        (tmp_path / "energy.csv").write_bytes(ENERGIES.replace(b"\n0.1", f"\n{value}".encode()))
        (tmp_path / "steps.csv").write_bytes(STEPS.replace(b"0.2,0.1", f"0.2,{value}".encode()))
        assert analyze.main([str(tmp_path), "--no-figures"]) == 3
        (tmp_path / "steps.csv").unlink()
    assert "not a number" in capsys.readouterr().out


HOSTILE_NAMES = (
    "a b",
    "'quoted\" `x`",
    "$(touch pwned) ${x} $HOME",
    "# & ; | > pwned < * ?",
    "\nshell touch pwned\n",
    "é 粒子 \u202e",
    "[bold] [red] {name} %s",
    "-o",
    "\x1b]0;pwned\x07",
    os.fsdecode(b"\xff\xfe"),
)


def tree(folder):
    return {p.relative_to(folder) for p in folder.rglob("*")}


@pytest.mark.parametrize("name", HOSTILE_NAMES)
def test_names_are_nothing_but_names(tmp_path, name, capsys):
    """Whatever files, folders and titles are called: the deck is the same, and nothing else is."""
    folder = tmp_path / name
    folder.mkdir()
    (folder / f"{name}.csv").write_text(CSV)
    title = "".join(c for c in name if c.isprintable())
    content = {"title": title, "particles": {"file": f"{name.strip()}.csv"}}
    if not name.isprintable():
        (folder / f"{name}.csv").rename(folder / "plain.csv")
        content["particles"]["file"] = "plain.csv"
    plain = parse_case(CASE, folder).model_dump(mode="json")
    case = parse_case(plain | content | {"near_field": None}, folder)
    bare = parse_case(plain | content | {"near_field": None, "title": ""}, folder)
    assert deck_text(case, create_particles(case)) == deck_text(bare, create_particles(bare))
    assert case.title == title

    file = folder / f"{name}.yaml"
    file.write_text(dump_case(case), encoding="utf-8")
    before = tree(tmp_path)
    assert deck.main([str(file), "-o", str(folder / "out")]) == 0
    assert theory.main([str(file)]) == 0
    assert "hostile" in capsys.readouterr().out
    made = {p.name for p in tree(tmp_path) - before}
    assert made <= {"out", "in.blast", "particles.data", "particles.csv", "case.yaml"}
    (folder / f"{name}.dump").write_bytes(TEXT_DUMP)
    assert analyze.main([str(folder / f"{name}.dump"), "--no-figures"]) == 0
    said = capsys.readouterr()
    assert all(line.isprintable() for line in (said.out + said.err).splitlines())


def test_a_run_in_a_hostile_folder_obeys_nothing_but_its_deck(tmp_path):
    folder = tmp_path / "$(touch pwned) # &\nshell touch pwned\n'\"é"
    folder.mkdir()
    (folder / "case.yaml").write_text(CASE)
    assert deck.main([str(folder / "case.yaml")]) == 0
    done = lmp("-in", "in.blast", folder=folder)
    assert done.returncode == 0, done.stdout
    assert not [p for p in tree(tmp_path) if "pwned" in p.name and p != Path(folder.name)]
    assert {p.parts[0] for p in tree(tmp_path)} == {folder.name}
