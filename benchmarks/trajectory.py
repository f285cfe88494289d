"""Writing trajectories, in text and binary, and reading them beside MDAnalysis's own reader."""

from __future__ import annotations

import re
import tempfile
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from MDAnalysis.coordinates.base import ReaderBase
from MDAnalysis.coordinates.LAMMPS import DumpReader

from benchmarks.finished_run import finished_run
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_6 import CASE_FILE, cloud
from lammps_blast.case import Case, load_case
from lammps_blast.deck import TRAJECTORIES
from lammps_blast.engine import LOG
from lammps_blast.particles import Particles
from lammps_blast.trajectory import BlastDumpReader

FRAMES = 101
WRITE_GOAL, BINARY_READ_GOAL, TEXT_READ_GOAL = 15.0, 30.0, 3.0
MS = "ms/frame"
STOCK, STOCK_FILE = "MDAnalysis LAMMPSDUMP", "stock.lammpstrj"
# What MDAnalysis's reader cannot read past: it counts on the time step in the second line.
UNKNOWN_TO_STOCK = re.compile(r"ITEM: (?:UNITS|TIME)\n[^\n]*\n")


def trajectory_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure section 6 with 101 frames: what writing them takes, and reading them again."""
    particles = cloud()
    with _trajectories(particles) as folder:
        return _write_rows(particles, repeats, tell) + _read_rows(folder, repeats, tell)


def _section_6(form: str, frames: int | None = None) -> Case:
    """Return the case of section 6; with `frames`, a short one with a frame every step."""
    case = load_case(CASE_FILE)
    time, output = case.time, case.output.model_copy(update={"format": form})
    if frames is not None:
        duration = (frames - 1) * time.step
        times = {"interval": time.step, "restart_interval": 2.0 * duration}
        time = time.model_copy(update={"duration": duration})
        output = output.model_copy(update=times)
    return case.model_copy(update={"time": time, "output": output})


@dataclass(frozen=True)
class RunTimes:
    """Seconds of LAMMPS's run, and what output took of them, by its own clock."""

    whole: float
    output: float

    @classmethod
    def of(cls, case: Case, particles: Particles) -> RunTimes:
        """Run a case and read the clock of its last run."""
        with finished_run(case, particles) as folder:
            log = (folder / LOG).read_text()
        loops = re.findall(r"^Loop time of (\S+)", log, re.MULTILINE)
        outputs = re.findall(r"^Output\s*\|\s*(\S+)", log, re.MULTILINE)
        return cls(float(loops[-1]), float(outputs[-1]))


def _write_rows(particles: Particles, repeats: int, tell: Callable[[str], None]) -> list[Row]:
    written = measure_in_turn(
        {
            form: lambda form=form: (
                1e3 * RunTimes.of(_section_6(form, FRAMES), particles).output / FRAMES
            )
            for form in TRAJECTORIES
        },
        repeats,
        tell,
    )
    rows = [
        Row("write binary trajectory", written["binary"], "text", written["text"], MS, WRITE_GOAL)
    ]
    for form in TRAJECTORIES:
        tell(f"section 6 with {FRAMES} frames in {form}")
        runs = [RunTimes.of(_section_6(form), particles) for _ in range(repeats)]
        rows.append(
            Row(
                f"section 6, {FRAMES} frames in {form}: output",
                Samples(tuple(run.output for run in runs)),
                "half of LAMMPS's run",
                Samples(tuple(0.5 * run.whole for run in runs)),
                "s",
                goal=1.0,
            )
        )
    return rows


@contextmanager
def _trajectories(particles: Particles) -> Iterator[Path]:
    """Give a folder with the same frames in text, in binary, and as MDAnalysis's reader wants."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for form in TRAJECTORIES:
            with finished_run(_section_6(form, FRAMES), particles) as run:
                for product in run.glob("*.lammps*"):
                    product.rename(folder / product.name)
        text = (folder / TRAJECTORIES["text"]).read_text()
        (folder / STOCK_FILE).write_text(UNKNOWN_TO_STOCK.sub("", text))
        yield folder


def _read_rows(folder: Path, repeats: int, tell: Callable[[str], None]) -> list[Row]:
    files = {form: (BlastDumpReader, folder / file) for form, file in TRAJECTORIES.items()}
    files[STOCK] = DumpReader, folder / STOCK_FILE
    whole = measure_in_turn(
        {
            name: lambda file=file: 1e3 * _seconds(_all, *file) / FRAMES
            for name, file in files.items()
        },
        repeats,
        tell,
    )
    one = measure_in_turn(
        {
            f"one frame, {name}": lambda file=file: 1e3 * _seconds(_one, *file)
            for name, file in files.items()
        },
        repeats,
        tell,
    )
    goals = {"binary": BINARY_READ_GOAL, "text": TEXT_READ_GOAL}
    rows = [
        Row(f"read {form} trajectory", whole[form], STOCK, whole[STOCK], MS, goal)
        for form, goal in goals.items()
    ]
    rows += [
        Row(
            f"open {form} trajectory, read its middle",
            one[f"one frame, {form}"],
            STOCK,
            one[f"one frame, {STOCK}"],
            "ms",
        )
        for form in goals
    ]
    return rows


def _seconds(read: Callable[[ReaderBase], None], reader: type[ReaderBase], path: Path) -> float:
    started = time.perf_counter()
    with reader(str(path)) as trajectory:
        read(trajectory)
    return time.perf_counter() - started


def _all(trajectory: ReaderBase) -> None:
    for _ in trajectory:
        pass


def _one(trajectory: ReaderBase) -> None:
    trajectory[len(trajectory) // 2]
