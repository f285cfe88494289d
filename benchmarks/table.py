"""The table on the terminal, and the same numbers as JSON."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.results import Row, Samples

CAPTION = (
    "ratio: how many times ours goes into the other, best of the rounds, and in brackets the "
    "median of the ratios within a round; peers are measured in turn with ours; a pair has two "
    "interactions, one on each particle"
)
VERDICTS = {True: "met", False: "MISSED", None: ""}


def print_table(rows: Sequence[Row], machine: Mapping[str, Any], console: Console) -> None:
    """Print rows, and what they were measured on."""
    table = Table(title=machine_title(machine), caption=CAPTION, title_justify="left")
    for heading in ("benchmark", "ours", "", "against", "", "ratio", "goal", ""):
        table.add_column(heading, justify="right" if heading in ("ours", "ratio") else "left")
    for row in rows:
        table.add_row(*_cells(row))
    console.print(table)
    for row in rows:
        if row.details:
            numbers = ", ".join(f"{name} {value:.3g}" for name, value in row.details.items())
            console.print(f"{row.name}: {numbers}", highlight=False)
        if row.parts:
            console.print(_parts_table(row))


def _parts_table(row: Row) -> Table:
    table = Table(title=f"{row.name}: where it goes", title_justify="left")
    for heading in ("part", row.unit, "share"):
        table.add_column(heading, justify="left" if heading == "part" else "right")
    whole = sum(row.parts.values())
    for name, value in (*row.parts.items(), ("together", whole)):
        table.add_row(name, f"{value:.2f}", f"{value / whole:.1%}")
    return table


def machine_title(machine: Mapping[str, Any]) -> str:
    """Return the machine and the versions in two lines."""
    versions = ", ".join(f"{name} {version}" for name, version in machine["versions"].items())
    return (
        f"{machine['processor']}, {machine['cores']} cores, load {machine['load']:.2f}\n"
        f"{versions}; compiler {machine['compiler']}"
    )


def _cells(row: Row) -> tuple[str, ...]:
    other = "" if row.other_best is None else f"{row.other_best:.4g}"
    ratio = "" if row.ratio is None else f"{row.ratio:.2f} ({row.median_ratio:.2f})"
    goal = "" if row.goal is None else f"at least {row.goal:g}"
    verdict = row.remark or VERDICTS[row.met]
    return row.name, f"{row.ours.best:.4g}", row.unit, row.other_name, other, ratio, goal, verdict


def write_json(
    rows: Sequence[Row],
    machine: Mapping[str, Any],
    group_seconds: Mapping[str, float],
    path: Path,
) -> None:
    """Write rows with all their samples, the machine, and how long each group took.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    content = {
        "machine": machine,
        "group_seconds": group_seconds,
        "rows": [_record(row) for row in rows],
    }
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content, indent=2) + "\n", encoding="utf-8")


def _record(row: Row) -> dict[str, Any]:
    return {
        "name": row.name,
        "unit": row.unit,
        "ours": row.ours.best,
        "other_name": row.other_name,
        "other": row.other_best,
        "ratio": row.ratio,
        "median_ratio": row.median_ratio,
        "goal": row.goal,
        "met": row.met,
        "remark": row.remark,
        "ours_samples": row.ours.values,
        "other_samples": row.other.values if isinstance(row.other, Samples) else None,
        "details": dict(row.details),
        "parts": dict(row.parts),
    }
