"""The semi-axes of the envelope against time, and how far they are from exact."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from MDAnalysis.analysis.results import Results

from lammps_blast.analysis import SpheroidTheory
from lammps_blast.figures.sampling import Sampling
from lammps_blast.figures.style import (
    BLUE,
    GREY,
    ORANGE,
    STYLE,
    Unit,
    column_of_panels,
    draw_magnitudes,
    finish_stack,
    largest_of,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses


# Part of the cloud's radius that particles are off a fit, on average, which then says little.
POOR_FIT = 0.1


@rc_context(STYLE)
def semi_axis_figure(analyses: Analyses) -> Figure:
    """Draw the semi-axes of the envelope against time, and how far they are from exact."""
    figure, panels = column_of_panels(analyses, list(_remarks(analyses)), 3, 4.5)
    times = analyses.envelope.results.times
    clock = Unit.of(float(times[-1]), "s")
    _draw_semi_axes(panels[0], panels[1], analyses, clock)
    _draw_deviations(panels[2], analyses, clock)
    finish_stack(panels, clock, times)
    return figure


def _remarks(analyses: Analyses) -> Iterator[str]:
    sampling = Sampling.of(analyses)
    if not isinstance(analyses.expected, SpheroidTheory):
        yield f"no exact spheroid: {analyses.expected}"
    results = analyses.envelope.results
    if np.isnan(results.semi_axis_parallel).all():
        yield "too few particles for a fit"
    elif (off := _worst_fit(results)) > POOR_FIT:
        yield f"particles are up to {off:.0%} of the cloud's radius off the fit (rms): no spheroid"
    if not sampling.resolved:
        yield sampling.warning


def _worst_fit(results: Results) -> float:
    """Return the largest rms distance of particles from the fit, over the cloud's radius."""
    with np.errstate(divide="ignore", invalid="ignore"):
        parts = results.fit_residual_rms / results.blast_radius
    return float(np.max(parts, initial=0.0, where=np.isfinite(parts)))


def _draw_semi_axes(along: Axes, across: Axes, analyses: Analyses, clock: Unit) -> None:
    results, expected = analyses.envelope.results, analyses.expected
    sampling = Sampling.of(analyses)
    measured = results.semi_axis_parallel, results.semi_axis_perpendicular
    extents = results.extent_parallel, results.extent_perpendicular
    unit = Unit.of(largest_of(*measured, *extents), "m")
    curve_times, style = sampling.curve_times(results.times), {"linestyle": "-"}
    if curve_times is None:
        curve_times, style = results.times, {"linestyle": "none", "marker": "+"}
    seconds = results.times / clock.size
    name = _axis_name(analyses)

    for i, (axes, where, colour) in enumerate(((along, "along", BLUE), (across, "across", ORANGE))):
        if isinstance(expected, SpheroidTheory):
            exact = expected.semi_axes(results.launch_radius, curve_times)[i]
            axes.plot(
                curve_times / clock.size, exact / unit.size, color=colour, **style,
                label="exact spheroid",
            )  # fmt: skip
        if np.isfinite(measured[i]).any():
            axes.plot(
                seconds, measured[i] / unit.size, "o", color=colour, markerfacecolor="white",
                markeredgewidth=0.7, markevery=max(1, len(seconds) // 60),
                label="fitted to all particles",
            )  # fmt: skip
        axes.plot(
            seconds, extents[i] / unit.size, color="0.25", linewidth=0.7, markersize=1.5,
            linestyle="--" if sampling.resolved else "none",
            marker="none" if sampling.resolved and len(seconds) > 1 else ".",
            label="outermost particle centre",
        )  # fmt: skip
        axes.set_ylabel(f"{where} {name} ({unit.name})")
    along.legend(loc="best")


def _axis_name(analyses: Analyses) -> str:
    """Return what the axis of the envelope is called: B, or its direction if there is no B."""
    if analyses.case and any(analyses.case.fields.magnetic):
        return "B"
    main = int(np.argmax(np.abs(analyses.axis)))
    if abs(analyses.axis[main]) == 1.0:
        return "xyz"[main]
    return "({})".format(", ".join(f"{part:.2g}" for part in analyses.axis))


def _draw_deviations(axes: Axes, analyses: Analyses, clock: Unit) -> None:
    results, expected = analyses.envelope.results, analyses.expected
    curves, size = {}, largest_of(results.blast_radius) or 1.0
    if isinstance(expected, SpheroidTheory):
        along, across = expected.semi_axes(results.launch_radius, results.times)
        size = largest_of(along, across) or 1.0
        curves = {
            "along": (np.abs(results.semi_axis_parallel - along) / size, BLUE, "o"),
            "across": (np.abs(results.semi_axis_perpendicular - across) / size, ORANGE, "s"),
        }
    fits = np.isfinite(results.semi_axis_parallel) | np.isfinite(results.semi_axis_perpendicular)
    off = np.where(fits, results.fit_residual, np.nan) / size
    curves["worst particle off the fit"] = (off, GREY, "x")
    checks = {
        name: analyses.checks.get(f"semi_axis_{axis}")
        for name, axis in (("along", "parallel"), ("across", "perpendicular"))
        if name in curves
    }
    draw_magnitudes(axes, results.times / clock.size, curves, checks)
    axes.set_ylabel("deviation / size")
