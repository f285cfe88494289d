"""How far particles are from each other: gaps to the nearest one, and neighbours in shells."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter

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
# Share of the particles whose gaps the axis holds: one that has escaped would squeeze all others.
SHOWN_SHARE = 0.995


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
    cut = _label_gaps(gaps, analyses)
    _label_shells(shells, analyses)
    write_head(figure, analyses)
    remarks = [
        *cut,
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


def _label_gaps(axes: Axes, analyses: Analyses) -> list[str]:
    """Set limits and labels; return remarks on gaps that are not shown, if there are any."""
    gap = analyses.distances.results.nearest_gap
    farthest, largest = _reach_of_gaps(gap)
    nearest = min(np.min(gap, initial=0.0), -0.05)
    alone = float(np.isinf(gap).mean(axis=1).max())
    reach = analyses.distances.results.edges[-1]
    axes.axvline(0.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlim(nearest - 0.02 * (farthest - nearest), farthest)
    axes.set_ylim(0.0, 103.0)
    axes.set_xlabel("gap to the nearest surface (mean diameters)")
    axes.set_ylabel("particles with a smaller gap (%)")
    remarks = []
    if alone > 0.0:
        share = f"{100.0 * alone:.2g} % of the particles"
        remarks.append(f"no neighbour within {reach:g} mean diameters: up to {share}")
    if largest > farthest:
        remarks.append(
            f"gaps beyond the axis, of fewer than 1 % of the particles: up to {largest:.3g}"
        )
    return remarks


def _reach_of_gaps(gap: np.ndarray) -> tuple[float, float]:
    """Return where the axis ends and the largest gap, of gaps (T, N) to nearest neighbours."""
    frames = [row[np.isfinite(row)] for row in gap]
    frames = [row for row in frames if len(row)]
    if not frames:
        return 1.0, 0.0
    most = max(np.quantile(row, SHOWN_SHARE, method="higher") for row in frames)
    return 1.05 * max(float(most), 0.05), float(max(row.max() for row in frames))


def _draw_shells(axes: Axes, analyses: Analyses, frame: int, look: dict[str, str]) -> None:
    results = analyses.distances.results
    # An empty shell lies below the axis, so that what stands alone is seen to.
    filled = np.maximum(results.neighbours[frame], np.finfo(float).tiny)
    axes.stairs(filled, results.edges, baseline=None, **look)


def _label_shells(axes: Axes, analyses: Analyses) -> None:
    results = analyses.distances.results
    filled = np.flatnonzero(results.neighbours.any(axis=0))
    if len(filled):
        _make_plain_log_scale(axes, results.neighbours[results.neighbours > 0.0])
    else:
        text = f"none within {results.edges[-1]:g}"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", color="0.35")
    nearest = results.edges[filled[0]] if len(filled) else 1.0
    axes.axvline(1.0, color="0.8", linewidth=0.8, zorder=0)
    axes.set_xlim(min(nearest, 0.85), results.edges[-1])
    axes.set_xlabel("distance of centres (mean diameters; 1: touch)")
    axes.set_ylabel("neighbours / volume")
    axes.legend(loc="best")


def _make_plain_log_scale(axes: Axes, values: np.ndarray) -> None:
    """Give positive values a log axis with plain numbers: 0.2, 0.5, 1; decades where it is long."""
    axes.set_yscale("log")
    low, high = values.min() / 1.3, values.max() * 1.3
    axes.set_ylim(low, high)
    axes.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0) if high < 300.0 * low else (1.0,)))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
