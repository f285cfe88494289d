"""Envelope and energy of a million particles, in time and in memory."""

from __future__ import annotations

import re
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.results import Row, measure_in_turn
from benchmarks.section_6 import CASE_FILE, REPOSITORY
from lammps_blast.case import Case, load_case
from lammps_blast.deck import write_resolved_case
from lammps_blast.particles import Particles

COUNT, FRAMES = 1_000_000, 10
STEPS_A_FRAME = 10
LIMIT = 30.0  # s
MOST_ROUNDS = 2
# Particles that do not interact may lie within each other, but not so that figures hide them.
RADIUS, DENSITY, CHARGE_PER_MASS = 0.003, 7000.0, 10.0  # m, kg/m3, C/kg


def analysis_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure `lammps_blast.analyze` without figures on a run in either format."""
    particles = _cloud(COUNT)
    rounds = min(repeats, MOST_ROUNDS)
    return [_row(particles, form, rounds, tell) for form in ("binary", "text")]


def _row(particles: Particles, form: str, rounds: int, tell: Callable[[str], None]) -> Row:
    case = _case(form)
    name = f"analyse {COUNT} particles, {FRAMES} frames in {form}"
    memory: list[float] = []
    tell(f"a run of {COUNT} particles in {form}")
    with finished_run(case, particles) as folder:
        write_resolved_case(case, folder)
        times = measure_in_turn({name: lambda: _analyse(folder, memory)}, rounds, tell)
    details = {"largest memory (GB)": max(memory)}
    return Row(name, times[name], "limit", LIMIT, "s", goal=1.0, details=details)


def _case(form: str) -> Case:
    case = load_case(CASE_FILE)
    interval = STEPS_A_FRAME * case.time.step
    duration = (FRAMES - 1) * interval
    output = {"format": form, "interval": interval, "restart_interval": 2.0 * duration}
    return case.model_copy(
        update={
            "time": case.time.model_copy(update={"duration": duration}),
            "output": case.output.model_copy(update=output),
        }
    )


def _cloud(count: int) -> Particles:
    rng = np.random.default_rng(2016)
    position = rng.normal(size=(count, 3))
    position *= (rng.random(count) ** (1.0 / 3.0) / np.linalg.norm(position, axis=1))[:, None]
    return Particles(
        position=position,
        velocity=np.zeros((count, 3)),
        angular_velocity=np.zeros((count, 3)),
        radius=np.full(count, RADIUS),
        density=np.full(count, DENSITY),
        charge_per_mass=np.full(count, CHARGE_PER_MASS),
    )


def _analyse(folder: Path, memory: list[float]) -> float:
    """Run the command in a process of its own; return its seconds, and note its memory in GB."""
    program = (
        "import resource, sys; from lammps_blast.analyze import main; code = main();"
        "print('peak', resource.getrusage(resource.RUSAGE_SELF).ru_maxrss); sys.exit(code)"
    )
    started = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", program, str(folder), "--no-figures"],
        cwd=REPOSITORY,
        capture_output=True,
        text=True,
    )
    seconds = time.perf_counter() - started
    if done.returncode != 0:
        raise RuntimeError(f"lammps_blast.analyze ended with {done.returncode}: {done.stderr}")
    memory.append(float(re.search(r"^peak (\d+)", done.stdout, re.MULTILINE).group(1)) / 1e6)
    return seconds
