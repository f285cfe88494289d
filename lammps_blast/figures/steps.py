"""The steps of an integrator that adapts them, against time: lengths, corrections, errors."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from lammps_blast.case import Implicit
from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    STYLE,
    Unit,
    column_of_panels,
    finish_stack,
    put_legend_above,
)
from lammps_blast.step_history import StepHistory

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# Of an axis of lengths, from its lower end to its upper: steps that are equal look equal.
LEAST_RANGE = 10.0


@rc_context(STYLE)
def step_figure(analyses: Analyses) -> Figure:
    """Draw the length of every step, its corrections, its error, and the restarts so far."""
    history = analyses.steps
    assert history is not None
    scheme = analyses.case.time.implicit if analyses.case else None
    figure, panels = column_of_panels(analyses, list(_remarks(history)), 3, 4.5)
    clock = Unit.of(float(history.times[-1]), "s")
    seconds = history.times / clock.size
    _draw_lengths(panels[0], seconds, history, scheme)
    _draw_counts(panels[1], seconds, history)
    _draw_errors(panels[2], seconds, history, scheme)
    finish_stack(panels, clock, np.append(history.times[0] - history.step[0], history.times))
    return figure


def _remarks(history: StepHistory) -> Iterator[str]:
    yield f"{len(history.step)} steps, {int(history.restarts[-1])} restarts"
    yield f"{history.evaluations_per_second:,.0f} force evaluations per simulated second"
    yield "steps that end at an output are cut to end there"


def _plot_steps(
    axes: Axes, seconds: np.ndarray, values: np.ndarray, colour: str, label: str
) -> None:
    axes.plot(
        seconds, values, "o-", color=colour, markersize=2.2, markeredgewidth=0, linewidth=0.4,
        label=label,
    )  # fmt: skip


def _draw_lengths(
    axes: Axes, seconds: np.ndarray, history: StepHistory, scheme: Implicit | None
) -> None:
    unit = Unit.of(float(history.step.max()), "s")
    _plot_steps(axes, seconds, history.step / unit.size, BLUE, "step")
    if scheme and scheme.max_step:
        limit = scheme.max_step / unit.size
        axes.axhline(limit, color="black", linestyle=":", linewidth=0.9, label="longest allowed")
    axes.set_yscale("log")
    axes.margins(y=0.15)
    bottom, top = axes.get_ylim()
    if top < LEAST_RANGE * bottom:
        middle = np.sqrt(bottom * top)
        axes.set_ylim(middle / np.sqrt(LEAST_RANGE), middle * np.sqrt(LEAST_RANGE))
    axes.set_ylabel(f"step ({unit.name})")
    put_legend_above(axes)


def _draw_counts(axes: Axes, seconds: np.ndarray, history: StepHistory) -> None:
    _plot_steps(axes, seconds, history.corrections, GREEN, "corrections of a step")
    failed = np.diff(history.restarts, prepend=0.0)
    if history.restarts[-1] > 0:
        shown = failed > 0
        axes.plot(
            seconds[shown], failed[shown], "o", color=ORANGE, markersize=4.0, markeredgewidth=0.6,
            markerfacecolor="none", label="restarts of a step",
        )  # fmt: skip
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.set_ylim(0.0, 1.15 * max(2.0, float(history.corrections.max()), float(failed.max())))
    axes.set_ylabel("number")
    put_legend_above(axes)


def _draw_errors(
    axes: Axes, seconds: np.ndarray, history: StepHistory, scheme: Implicit | None
) -> None:
    error = np.where(history.error > 0.0, history.error, np.nan)
    if np.isfinite(error).any():
        _plot_steps(axes, seconds, error, GREY, "error of the last correction")
    else:
        axes.text(0.02, 0.05, "all errors are exactly zero", transform=axes.transAxes, fontsize=7.0)
    if scheme:
        axes.axhline(
            scheme.tolerance, color="black", linestyle=":", linewidth=0.9, label="tolerance"
        )
    axes.set_yscale("log")
    axes.margins(y=0.15)
    axes.set_ylabel("correction / step")
    put_legend_above(axes)
