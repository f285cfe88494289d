"""The whole command on the case of section 6: pack, run, analyse, draw; and where its time goes."""

from __future__ import annotations

import json
import re
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from benchmarks.cores import on_cores
from benchmarks.results import Row, measure_in_turn
from benchmarks.section_6 import CASE_FILE, REPOSITORY

CORES = 2
LIMIT = 20.0  # s on so many cores
PYTHON = "Python's start and end"


def command_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure the whole command, and once its stages."""
    times = measure_in_turn({"the whole command": command_seconds}, repeats, tell)
    tell("stages of the command")
    row = Row(
        "lammps_blast.run, section 6",
        times["the whole command"],
        "limit",
        LIMIT,
        "s",
        goal=1.0,
        parts=stage_seconds(),
    )
    return [row]


def command_seconds() -> float:
    """Run the command in a process of its own, on two cores at most, and return its seconds."""
    with tempfile.TemporaryDirectory() as folder:
        return _seconds("lammps_blast.run", str(CASE_FILE), "--output", f"{folder}/run")


def stage_seconds() -> dict[str, float]:
    """Run the command once more under the profiler; return the seconds of its stages.

    They add up to the whole. What is imported while LAMMPS runs is not in `imports`.
    """
    with tempfile.TemporaryDirectory() as name:
        result, folder = Path(name, "stages.json"), Path(name, "run")
        arguments = str(result), str(CASE_FILE), "--output", str(folder)
        whole = _seconds("benchmarks.command_profile", *arguments)
        stages: dict[str, float] = json.loads(result.read_text())
        output = _output_seconds(folder / "log.lammps")
    stages["LAMMPS, output"] = output
    stages["LAMMPS, steps and start"] = stages.pop("LAMMPS") - output
    stages[PYTHON] = whole - sum(stages.values())
    return dict(sorted(stages.items(), key=lambda stage: -stage[1]))


def _seconds(module: str, *arguments: str) -> float:
    """Run a module on so many cores at most; return the seconds from start to end."""
    with on_cores(CORES):
        started = time.perf_counter()
        done = subprocess.run(
            [sys.executable, "-m", module, *arguments],
            cwd=REPOSITORY,
            capture_output=True,
            text=True,
        )
        seconds = time.perf_counter() - started
    if done.returncode != 0:
        raise RuntimeError(f"{module} ended with {done.returncode}: {done.stderr}")
    return seconds


def _output_seconds(log: Path) -> float:
    """Return what LAMMPS says that writing trajectory and tables took."""
    rows = re.findall(r"^Output +\| *(\S+)", log.read_text(), re.MULTILINE)
    return sum(float(seconds) for seconds in rows)
