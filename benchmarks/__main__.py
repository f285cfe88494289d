"""Measure, print one table, write JSON: `python -m benchmarks` in the root of the repository."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from rich.console import Console

from benchmarks import machine
from benchmarks.analyses import analysis_rows
from benchmarks.contact import contact_rows
from benchmarks.contact_ledger import ledger_rows
from benchmarks.contact_scale import scale_rows
from benchmarks.near_field import near_field_rows
from benchmarks.near_field_tree import tree_rows
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
    "command": command_rows,
}
WIDTH_OF_FILE = 160  # characters, where the table goes to a file or a pipe


def main(argv: list[str] | None = None) -> int:
    """Run the benchmarks asked for; exit status 1 if a goal is missed."""
    options = _options(argv)
    console = Console(width=None if sys.stdout.isatty() else WIDTH_OF_FILE)
    progress = Console(stderr=True)

    def tell(text: str) -> None:
        progress.print(text, highlight=False)

    description = machine.describe()
    rows: list[Row] = []
    for group in options.only:
        repeats = options.command_repeats if group == "command" else options.repeats
        rows += GROUPS[group](repeats, tell)
    print_table(rows, description, console)
    if options.json:
        write_json(rows, description, options.json)
    return 1 if any(row.met is False for row in rows) else 0


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks", description=__doc__)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all numbers here too")
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
