"""How far particles are from each other: gaps to the nearest one, and neighbours in shells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PAGE,
    STYLE,
    Unit,
    add_axes,
    write_foot,
    write_head,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# Colour and line of the first, a middle and the last frame.
FRAME_STYLES = ((GREEN, ":"), (ORANGE, "--"), (BLUE, "-"))


@rc_context(STYLE)
def pair_distance_figure(analyses: Analyses) -> Figure:
    """Draw the distribution of gaps to the nearest neighbour, and the neighbours in shells."""
    figure = Figure(figsize=(PAGE, 3.3))
    gaps = add_axes(figure, (0.62, 0.72, 2.75, 2.15))
    shells = add_axes(figure, (4.15, 0.72, 2.9, 2.15))
    times = analyses.distances.results.times
    last = float(times[-1])
    clock = Unit.of(last, "s")
    styles = FRAME_STYLES[-len(times) :]
    for frame, (time, (colour, line)) in enumerate(zip(times, styles, strict=True)):
        look = {"color": colour, "linestyle": line, "label": f"t = {clock.show(time, last)}"}
        _draw_gaps(gaps, analyses, frame, look)
        _draw_shells(shells, analyses, frame, look)
    _label_gaps(gaps, analyses)
    _label_shells(shells, analyses)
    write_head(figure, analyses)
    remarks = [
        "mean diameter: the sum of the radii of a pair",
        "neighbours: mean number in a shell about a particle over the shell's volume in mean"
        " diameters cubed, not divided by an ideal density, which an expanding cloud lacks",
    ]
    write_foot(figure, remarks)
    return figure


def _draw_gaps(axes: Axes, analyses: Analyses, frame: int, look: dict[str, str]) -> None:
    gap = np.sort(analyses.distances.results.nearest_gap[frame])
    gap = gap[np.isfinite(gap)]
    share = np.arange(len(gap) + 1) / len(analyses.cloud.mass)
    if len(gap):
        axes.step(np.append(gap[0], gap), 100.0 * share, where="post", **look)


def _label_gaps(axes: Axes, analyses: Analyses) -> None:
    gap = analyses.distances.results.nearest_gap
    axes.axvline(0.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlim(min(np.min(gap, initial=0.0), -0.05), None)
    axes.set_ylim(0.0, 103.0)
    axes.set_xlabel("gap to the nearest surface (mean diameters)")
    axes.set_ylabel("particles with a smaller gap (%)")


def _draw_shells(axes: Axes, analyses: Analyses, frame: int, look: dict[str, str]) -> None:
    results = analyses.distances.results
    neighbours = results.neighbours[frame]
    filled = np.where(neighbours > 0.0, neighbours, np.nan)
    axes.stairs(filled, results.edges, baseline=None, **look)


def _label_shells(axes: Axes, analyses: Analyses) -> None:
    results = analyses.distances.results
    filled = np.flatnonzero(results.neighbours.any(axis=0))
    if len(filled):
        axes.set_yscale("log")
    else:
        text = f"none within {results.edges[-1]:g}"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", color="0.35")
    nearest = results.edges[filled[0]] if len(filled) else 1.0
    axes.axvline(1.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlim(min(nearest, 0.85), results.edges[-1])
    axes.set_xlabel("distance of centres (mean diameters; 1: touch)")
    axes.set_ylabel("neighbours / volume")
    axes.legend(loc="best")
