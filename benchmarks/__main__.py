"""Measure, print one table, write JSON and a plot: `python -m benchmarks` in the root folder.

Peers that are not installed are left out, and the table says so.
"""

from __future__ import annotations

import argparse
import sys
import time
from pathlib import Path

from rich.console import Console

from benchmarks import machine
from benchmarks.analyses import analysis_rows
from benchmarks.contact import contact_rows
from benchmarks.contact_ledger import ledger_rows
from benchmarks.contact_scale import scale_rows
from benchmarks.near_field import near_field_rows
from benchmarks.near_field_tree import tree_rows
from benchmarks.packing import packing_rows
from benchmarks.plot import draw
from benchmarks.results import Row
from benchmarks.scaling import scaling_rows
from benchmarks.step_loop import step_rows
from benchmarks.table import print_table, write_json
from benchmarks.trajectory import trajectory_rows
from benchmarks.whole_command import command_rows

GROUPS = {
    "steps": step_rows,
    "contact": contact_rows,
    "contact-scale": scale_rows,
    "scaling": scaling_rows,
    "near-field": near_field_rows,
    "tree": tree_rows,
    "ledger": ledger_rows,
    "trajectory": trajectory_rows,
    "analyses": analysis_rows,
    "packing": packing_rows,
    "command": command_rows,
}
JSON, PLOT = Path("runs/benchmarks.json"), Path("runs/benchmarks.png")
WIDTH_OF_FILE = 160  # characters, where the table goes to a file or a pipe


def main(argv: list[str] | None = None) -> int:
    """Run the benchmarks asked for.

    Exit status: 0 all goals met, 1 a goal is missed, 2 the results could not be written.
    """
    options = _options(argv)
    console = Console(width=None if sys.stdout.isatty() else WIDTH_OF_FILE)
    progress = Console(stderr=True)

    def tell(text: str) -> None:
        progress.print(text, highlight=False)

    description = machine.describe()
    rows: list[Row] = []
    seconds: dict[str, float] = {}
    for group in options.only:
        repeats = options.command_repeats if group == "command" else options.repeats
        started = time.perf_counter()
        rows += GROUPS[group](repeats, tell)
        seconds[group] = time.perf_counter() - started
    print_table(rows, description, console)
    spent = ", ".join(f"{group} {took:.0f} s" for group, took in seconds.items())
    console.print(f"it took {sum(seconds.values()) / 60:.1f} min: {spent}", highlight=False)
    try:
        write_json(rows, description, seconds, options.json)
        draw(rows, description, options.plot)
    except OSError as error:
        print(f"cannot write the results: {error}", file=sys.stderr)
        return 2
    console.print(f"also in {options.json} and {options.plot}", highlight=False)
    return 1 if any(row.met is False for row in rows) else 0


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    for option, default, content in (
        ("--json", JSON, "all numbers, with every round"),
        ("--plot", PLOT, "a picture of the ratios, PNG, PDF or SVG by its name"),
    ):
        parser.add_argument(
            option, type=Path, default=default, metavar="FILE", help=f"{content}; default {default}"
        )
    parser.add_argument("--repeats", type=int, default=7, help="rounds of each loop")
    parser.add_argument("--command-repeats", type=int, default=2, help="runs of the whole command")
    parser.add_argument(
        "--only", nargs="+", choices=GROUPS, default=list(GROUPS), help="groups to measure"
    )
    options = parser.parse_args(argv)
    if min(options.repeats, options.command_repeats) < 1:
        parser.error("there must be at least one repeat")
    return options


if __name__ == "__main__":
    sys.exit(main())
