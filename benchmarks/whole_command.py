"""The whole command on the case of section 6: pack, run, analyse, draw."""

from __future__ import annotations

import contextlib
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from benchmarks.section_6 import CASE_FILE, REPOSITORY
from lammps_blast.analyze import analyze, write_results
from lammps_blast.case import load_case
from lammps_blast.deck import write_deck, write_resolved_case
from lammps_blast.engine import run_deck
from lammps_blast.particles import create_particles

CORES = 2


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
            run_deck(folder, case.time.steps, case.time.step)
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
