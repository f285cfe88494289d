"""Clumps: the cloud coloured by the size of its pieces (figure 9), and sizes and shapes in numbers.

A piece is a set of spheres that touch or nearly touch, see :mod:`lammps_blast.clumps`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba_array
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from lammps_blast.clumps import SMALLEST_SHAPED, label_pieces, piece_sizes
from lammps_blast.figures.cloud import Snapshot, cloud_panels, draw_key
from lammps_blast.figures.sampling import Sampling, plot_frames
from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PAGE,
    STYLE,
    Unit,
    add_axes,
    finish_stack,
    largest_of,
    put_legend_above,
    stack,
    write_foot,
    write_head,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# The smallest pieces of each class, and its colour: grey for single spheres, then ever darker.
CLASS_STARTS = np.array([1, 2, 5, 20, 100])
CLASS_COLOURS = to_rgba_array(["#B0B0B0", *colormaps["viridis"]([0.88, 0.62, 0.38, 0.02])])

# Sizes that a picture of their distribution has room for, however few there are.
FEWEST_PLACES = 4

FIRST_LOOK: dict[str, Any] = {"color": BLUE, "linestyle": "-", "marker": "o"}
SECOND_LOOK: dict[str, Any] = {"color": ORANGE, "linestyle": "--", "marker": "s"}
THIRD_LOOK: dict[str, Any] = {"color": GREEN, "linestyle": "-.", "marker": "^"}


@rc_context(STYLE)
def clump_figure(analyses: Analyses) -> Figure:
    """Draw the cloud at several instants, coloured by the size of the piece of each particle."""
    shown = set()

    def colours(snapshot: Snapshot) -> np.ndarray:
        classes = _size_classes(analyses, snapshot)
        shown.update(classes.tolist())
        return CLASS_COLOURS[classes]

    figure = cloud_panels(analyses, colours, _gap_remark(analyses))
    draw_key(figure, {_class_name(i): CLASS_COLOURS[i] for i in sorted(shown)})
    return figure


def _size_classes(analyses: Analyses, snapshot: Snapshot) -> np.ndarray:
    """Return the class of size of the piece of each drawn particle (D,)."""
    position = analyses.universe.trajectory[snapshot.frame].data["position"]
    labels = label_pieces(position, analyses.cloud.radius, analyses.clumps.gap)
    sizes = piece_sizes(labels)[labels[snapshot.drawn]]
    return np.searchsorted(CLASS_STARTS, sizes, side="right") - 1


def _class_name(index: int) -> str:
    if index == 0:
        return "single"
    start = CLASS_STARTS[index]
    if index == len(CLASS_STARTS) - 1:
        return f"clumps of {start} or more"
    return f"clumps of {start}–{CLASS_STARTS[index + 1] - 1}"


@rc_context(STYLE)
def clump_statistics_figure(analyses: Analyses) -> Figure:
    """Draw numbers, sizes and shapes of the pieces against time, and those of the last frame."""
    figure = Figure(figsize=(PAGE, 5.4))
    results = analyses.clumps.results
    clock = Unit.of(float(results.times[-1]), "s")
    left = stack(figure, (0.62, 0.72, 2.75, 4.25), 3)
    _draw_numbers(left[0], analyses, clock)
    _draw_sizes(left[1], analyses, clock)
    _draw_alignment(left[2], analyses, clock)
    finish_stack(left, clock, results.times)
    last = clock.show(float(results.times[-1]), float(results.times[-1]))
    _draw_size_distribution(add_axes(figure, (4.15, 3.42, 2.9, 1.55)), analyses, last)
    _draw_shapes(add_axes(figure, (4.15, 0.72, 2.9, 1.65)), analyses, last)
    write_head(figure, analyses)
    remarks = [
        _gap_remark(analyses),
        f"along / across {analyses.axis_name}: ratio of gyration radii, 1 where no direction is"
        f" preferred, of clumps of {SMALLEST_SHAPED} or more",
    ]
    sampling = Sampling.of(analyses)
    write_foot(figure, remarks if sampling.resolved else [*remarks, sampling.warning])
    return figure


def _gap_remark(analyses: Analyses) -> str:
    gap = analyses.clumps.gap
    return f"clumps: two spheres or more, from surface to surface at most {gap:.3g} mean diameters"


def _draw_numbers(axes: Axes, analyses: Analyses, clock: Unit) -> None:
    results = analyses.clumps.results
    for name, look in (("pieces", FIRST_LOOK), ("clumps", SECOND_LOOK)):
        _plot(axes, analyses, clock, results[name], label=name, **look)
    axes.set_ylim(0.0, 1.1 * max(largest_of(results.pieces), 1.0))
    axes.yaxis.set_major_locator(MaxNLocator(5, integer=True))
    axes.set_ylabel("number")
    put_legend_above(axes)


def _draw_sizes(axes: Axes, analyses: Analyses, clock: Unit) -> None:
    results = analyses.clumps.results
    curves = {
        "largest piece": (results.largest, FIRST_LOOK),
        "mean, by mass": (results.mass_mean_size, THIRD_LOOK),
        "mean, by number": (results.mean_size, SECOND_LOOK),
    }
    for name, (values, look) in curves.items():
        _plot(axes, analyses, clock, values, label=name, **look)
    axes.set_yscale("log")
    axes.set_ylim(0.9, 1.5 * max(largest_of(results.largest), 10.0))
    axes.yaxis.set_major_formatter("{x:g}")
    axes.set_ylabel("spheres in a piece")
    put_legend_above(axes)


def _draw_alignment(axes: Axes, analyses: Analyses, clock: Unit) -> None:
    ratio = analyses.clumps.results.along_over_across
    axes.axhline(1.0, color="0.8", linewidth=0.8, zorder=0)
    _plot(axes, analyses, clock, ratio, **FIRST_LOOK)
    _make_ratio_scale(axes, ratio)
    axes.set_ylabel(f"along / across {analyses.axis_name}")
    axes.set_title("all clumps together", fontsize=7.0, pad=3.0, loc="left")


def _plot(axes: Axes, analyses: Analyses, clock: Unit, values: np.ndarray, **look: Any) -> None:
    seconds = analyses.clumps.results.times / clock.size
    plot_frames(axes, seconds, values, Sampling.of(analyses).resolved, **look)


def _make_ratio_scale(axes: Axes, ratios: np.ndarray) -> None:
    """Give ratios a log axis with one in its middle."""
    known = ratios[np.isfinite(ratios) & (ratios > 0.0)]
    farthest = 1.3 * np.exp(np.max(np.abs(np.log(known)), initial=np.log(2.0)))
    axes.set_yscale("log")
    axes.set_ylim(1.0 / farthest, farthest)
    ticks = np.array([0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 20.0])
    ticks = ticks[(ticks > 1.0 / farthest) & (ticks < farthest)]
    axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.set_yticks([], minor=True)
    if len(known) == 0:
        text = f"no clump of {SMALLEST_SHAPED} or more"
        axes.text(0.5, 0.7, text, transform=axes.transAxes, ha="center", color="0.35")


def _draw_size_distribution(axes: Axes, analyses: Analyses, last: str) -> None:
    """Draw what share of the pieces, and of the spheres, is in pieces of each size; in octaves."""
    sizes = analyses.clumps.results.sizes
    octave = np.frexp(sizes)[1] - 1
    count = int(octave.max(initial=0)) + 1
    pieces = np.bincount(octave, minlength=count) / max(len(sizes), 1)
    spheres = np.bincount(octave, sizes, count) / max(sizes.sum(), 1)
    place = np.arange(count)
    axes.bar(place - 0.2, 100.0 * pieces, 0.4, color=BLUE, label="of the pieces")
    axes.bar(
        place + 0.2, 100.0 * spheres, 0.4, color="white", edgecolor=ORANGE, hatch="////",
        label="of the spheres",
    )  # fmt: skip
    names = [f"{2**i}–{2 ** (i + 1) - 1}" if i else "1" for i in place]
    slant = {"rotation": 35.0, "ha": "right", "rotation_mode": "anchor"} if count > 6 else {}
    axes.set_xticks(place, names, **slant)
    # Two bars alone would fill the panel.
    axes.set_xlim(-0.6, max(count, FEWEST_PLACES) - 0.4)
    axes.set_xlabel("spheres in a piece")
    axes.set_ylabel("share (%)")
    axes.legend(loc="best")
    axes.set_title(f"sizes at t = {last}", fontsize=8.0)


def _draw_shapes(axes: Axes, analyses: Analyses, last: str) -> None:
    shapes = analyses.clumps.results.shapes
    axes.axhline(1.0, color="0.8", linewidth=0.8, zorder=0)
    axes.plot(
        shapes.size, shapes.along_over_across, "o", color=BLUE, markerfacecolor="none",
        markeredgewidth=0.8,
    )  # fmt: skip
    _make_ratio_scale(axes, shapes.along_over_across)
    axes.set_xscale("log")
    axes.set_xlim(0.8 * SMALLEST_SHAPED, 1.3 * max(largest_of(shapes.size), 100.0))
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("spheres in a clump")
    axes.set_ylabel(f"along / across {analyses.axis_name}")
    axes.set_title(f"gyration radius of each clump at t = {last}", fontsize=8.0)
    for height, word, side in ((1.0, "long", "top"), (0.0, "flat", "bottom")):
        axes.text(
            1.01, height, f"{word} along {analyses.axis_name}", transform=axes.transAxes,
            va=side, fontsize=6.5, color=GREY, rotation=270.0,
        )  # fmt: skip
