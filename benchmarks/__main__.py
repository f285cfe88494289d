"""Measure, print one table, write JSON: `python -m benchmarks` in the root of the repository."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from rich.console import Console

from benchmarks import machine
from benchmarks.peers import plain_euler, plasmapy_boris, tuned_euler
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_6 import cloud
from benchmarks.step_loop import INTEGRATORS, StepLoop
from benchmarks.table import print_table, write_json
from benchmarks.whole_command import command_seconds, stage_seconds

LOOP_LIMIT = 12.0  # ns per particle-step on one core
COMMAND_LIMIT = 20.0  # s on two cores
NUMPY_GOAL, PLASMAPY_GOAL = 4.0, 6.0

PLAIN, TUNED = "numpy, eq. 6.2", "numpy, tuned by hand"
PLASMAPY = "PlasmaPy Boris"
NS = "ns/particle-step"


def main(argv: list[str] | None = None) -> int:
    """Run all benchmarks; exit status 1 if a goal is missed."""
    options = _options(argv)
    console, progress = Console(), Console(stderr=True)

    def tell(text: str) -> None:
        progress.print(text, highlight=False)

    description = machine.describe()
    rows = step_rows(options.repeats, tell)
    if not options.steps_only:
        rows.append(command_row(options.command_repeats, tell))
    print_table(rows, description, console)
    if options.json:
        write_json(rows, description, options.json)
    return 1 if any(row.met is False for row in rows) else 0


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here too")
    parser.add_argument("--repeats", type=int, default=7, help="rounds of the step loops")
    parser.add_argument("--command-repeats", type=int, default=2, help="runs of the whole command")
    parser.add_argument("--steps-only", action="store_true", help="leave the whole command out")
    options = parser.parse_args(argv)
    if min(options.repeats, options.command_repeats) < 1:
        parser.error("there must be at least one repeat")
    return options


def step_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure our step loops and those of the peers, all in turn."""
    particles = cloud()
    contestants: dict[str, Callable[[], float]] = {
        name: StepLoop(particles, name) for name in INTEGRATORS
    }
    contestants[PLAIN] = plain_euler(particles)
    contestants[TUNED] = tuned_euler(particles)
    boris = plasmapy_boris(particles)
    if boris is not None:
        contestants[PLASMAPY] = boris
    times = measure_in_turn(contestants, repeats, tell)
    return _step_rows(times)


def _step_rows(times: dict[str, Samples]) -> list[Row]:
    chow, none, boris = times["chow"], times["none"], times.get(PLASMAPY)
    rows = [Row("step loop, drag chow", chow, "limit", LOOP_LIMIT, NS, goal=1.0)]
    rows += [
        Row(f"step loop, drag {law}", times[law], "drag chow", chow, NS)
        for law in ("none", "constant", "stokes")
    ]
    rows += [
        Row("step loop, verlet, drag chow", times["verlet"], "drag chow", chow, NS),
        Row("step loop, drag chow", chow, PLAIN, times[PLAIN], NS, goal=NUMPY_GOAL),
        Row("step loop, drag chow", chow, TUNED, times[TUNED], NS),
        Row(
            "step loop, drag none",
            none,
            PLASMAPY,
            boris,
            NS,
            goal=PLASMAPY_GOAL,
            remark="" if boris else "not installed",
        ),
    ]
    return rows


def command_row(repeats: int, tell: Callable[[str], None]) -> Row:
    """Measure the whole command, and once its stages."""
    times = measure_in_turn({"the whole command": command_seconds}, repeats, tell)
    tell("stages of the command")
    return Row(
        "lammps_blast.run, section 6",
        times["the whole command"],
        "limit",
        COMMAND_LIMIT,
        "s",
        goal=1.0,
        details=stage_seconds(),
    )


if __name__ == "__main__":
    sys.exit(main())
