"""The whole command on the case of section 6: pack, run, analyse, draw."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from benchmarks.results import Row, measure_in_turn
from benchmarks.section_6 import CASE_FILE, REPOSITORY
from lammps_blast.analyze import analyze, write_results
from lammps_blast.case import load_case
from lammps_blast.deck import write_deck, write_resolved_case
from lammps_blast.engine import run_deck
from lammps_blast.particles import create_particles

CORES = 2
LIMIT = 20.0  # s on so many cores


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
        details=stage_seconds(),
    )
    return [row]


def command_seconds() -> float:
    """Run the command in a process of its own, on two cores at most, and return its seconds."""
    with tempfile.TemporaryDirectory() as folder, _on_cores(CORES):
        arguments = ["-m", "lammps_blast.run", str(CASE_FILE), "--output", f"{folder}/run"]
        started = time.perf_counter()
        done = subprocess.run(
            [sys.executable, *arguments], cwd=REPOSITORY, capture_output=True, text=True
        )
        seconds = time.perf_counter() - started
    if done.returncode != 0:
        raise RuntimeError(f"lammps_blast.run ended with {done.returncode}: {done.stderr}")
    return seconds


def stage_seconds() -> dict[str, float]:
    """Go through the command's stages in this process and return the seconds of each.

    What the command takes beyond them is starting Python and importing modules.
    """
    seconds: dict[str, float] = {}

    @contextlib.contextmanager
    def stage(name: str) -> Iterator[None]:
        started = time.perf_counter()
        yield
        seconds[name] = time.perf_counter() - started

    with tempfile.TemporaryDirectory() as name, _on_cores(CORES):
        folder = Path(name)
        with stage("packing"):
            case = load_case(CASE_FILE)
            particles = create_particles(case)
        with stage("deck"):
            write_resolved_case(case, folder)
            write_deck(case, particles, folder)
        with stage("LAMMPS"):
            run_deck(folder, case.timesteps, case.timestep)
        with stage("analysis"):
            analyses = analyze(folder)
            write_results(analyses, folder, figures=False)
        with stage("figures"):
            write_results(analyses, folder, figures=True)
    return seconds


@contextlib.contextmanager
def _on_cores(count: int) -> Iterator[None]:
    """Keep to so many cores, where the system lets a process choose."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    allowed = os.sched_getaffinity(0)
    os.sched_setaffinity(0, sorted(allowed)[:count])
    try:
        yield
    finally:
        os.sched_setaffinity(0, allowed)
