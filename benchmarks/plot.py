"""The ratios of the table as a picture: a bar a row, on a logarithmic axis, with the goals."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

from benchmarks.results import Row
from benchmarks.table import machine_title
from lammps_blast.figures.style import BLUE, GREY, ORANGE, STYLE

WIDTH, HEIGHT_OF_ROW, HEIGHT_OF_REST = 9.0, 0.22, 1.4  # inches
LETTERS_OF_TITLE = 140  # in a line
ROOM = 1.6  # for the numbers beside the bars, as a factor
COLOURS = {True: BLUE, False: ORANGE, None: GREY}
MEANINGS = {True: "goal met", False: "goal missed", None: "no goal"}


@rc_context(STYLE)
def draw(rows: Sequence[Row], machine: Mapping[str, Any], path: Path) -> None:
    """Draw the rows that have a ratio, the first on top.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    shown = [row for row in rows if row.ratio is not None]
    if not shown:
        return
    figure = Figure(
        figsize=(WIDTH, HEIGHT_OF_ROW * len(shown) + HEIGHT_OF_REST), layout="constrained"
    )
    FigureCanvasAgg(figure)
    lines = machine_title(machine).splitlines()
    title = "\n".join(textwrap.fill(line, LETTERS_OF_TITLE) for line in lines)
    figure.suptitle(title, x=0.01, ha="left", fontsize="medium")
    axes = figure.subplots()
    _draw_bars(axes, shown)
    handles, labels = axes.get_legend_handles_labels()
    once = dict(zip(labels, handles, strict=True))
    figure.legend(once.values(), once.keys(), loc="outside lower left", ncols=len(once))
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=150)


def _draw_bars(axes: Axes, rows: Sequence[Row]) -> None:
    """Draw bars that start at a ratio of 1: to the right ours is better, to the left worse."""
    axes.set_xscale("log")
    for place, row in enumerate(rows):
        label = MEANINGS[row.met]
        axes.barh(place, row.ratio - 1.0, left=1.0, height=0.7, color=COLOURS[row.met], label=label)
        axes.annotate(
            f"{row.ratio:.3g}",
            (row.ratio, place),
            xytext=(3 if row.ratio >= 1.0 else -3, 0),
            textcoords="offset points",
            ha="left" if row.ratio >= 1.0 else "right",
            va="center",
        )
        if row.goal is not None:
            axes.plot([row.goal] * 2, [place - 0.45, place + 0.45], color="black", label="goal")
    axes.axvline(1.0, color="black", linewidth=0.6)
    names = [f"{row.name}: {row.other_name}" for row in rows]
    axes.set_yticks(range(len(rows)), names)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    ends = [1.0, *(row.ratio for row in rows), *(row.goal for row in rows if row.goal)]
    axes.set_xlim(min(ends) / ROOM, max(ends) * ROOM)
    axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel(
        "how many times ours goes into the other, named after the colon (more is better)"
    )
