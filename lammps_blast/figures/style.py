"""How the figures look: sizes, colours, units, head and foot, and panels above each other."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses, Check

# Width of a figure in inches: one that spans a page of a journal, and one that spans a column.
PAGE, COLUMN = 7.2, 4.5
SMALLEST_ERROR = 1e-20  # relative; below it there is only rounding of rounding

# Colours that colour-blind readers tell apart (Okabe and Ito); line styles differ as well.
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#AA4499", "#777777"

STYLE: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 8.0,
    "axes.titlesize": 8.0,
    "axes.labelsize": 8.0,
    "xtick.labelsize": 7.0,
    "ytick.labelsize": 7.0,
    "legend.fontsize": 7.0,
    "legend.frameon": True,
    "legend.edgecolor": "none",
    "legend.framealpha": 0.85,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": False,
    "lines.linewidth": 1.1,
    "lines.markersize": 3.0,
    "text.usetex": False,
    "figure.facecolor": "white",
    "savefig.facecolor": "white",
}

Place = tuple[float, float, float, float]  # left, bottom, width, height in inches


@dataclass(frozen=True)
class Unit:
    """A unit with a prefix; `size` is its value in the SI unit."""

    size: float
    name: str

    @classmethod
    def of(cls, largest: float, name: str) -> Unit:
        """Return the multiple of an SI unit in which `largest` is between 0.5 and 500."""
        prefixes = "qryzafpnµm kMGTPEZYRQ"  # the space is no prefix
        if not 0.0 < largest < np.inf:
            return cls(1.0, name)
        power = int(np.clip(np.floor(np.log10(2.0 * largest) / 3.0), -10, 10))
        return cls(1000.0**power, f"{prefixes[power + 10].strip()}{name}")

    def show(self, value: float, largest: float) -> str:
        """Return a value (SI) with this unit; the largest one would have three digits."""
        digits = 2 - int(np.floor(np.log10(largest / self.size))) if largest > 0.0 else 0
        return f"{value / self.size:.{max(digits, 0)}f} {self.name}"


def largest_of(*arrays: np.ndarray) -> float:
    """Return the largest finite magnitude in some arrays, zero if there is none."""
    values = np.abs(np.concatenate([array.ravel() for array in arrays]))
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def from_0_to_1(values: np.ndarray) -> np.ndarray:
    """Return values with the smallest moved to 0 and the largest to 1; zeros if all are equal."""
    if len(values) == 0 or not 0.0 < (span := np.ptp(values)) < np.inf:
        return np.zeros(len(values))
    return (values - values.min()) / span


def add_axes(figure: Figure, place: Place, **options: Any) -> Any:
    """Add axes at a place in inches."""
    width, height = figure.get_size_inches()
    left, bottom, wide, high = place
    return figure.add_axes((left / width, bottom / height, wide / width, high / height), **options)


def write_at(figure: Figure, x: float, y: float, text: str, **options: Any) -> None:
    """Write text at a place in inches."""
    figure.text(x, y, text, transform=figure.dpi_scale_trans, **options)


def write_head(figure: Figure, analyses: Analyses) -> None:
    """Write the title of the run over the figure."""
    width, height = figure.get_size_inches()
    title = (analyses.case.title if analyses.case else "") or analyses.name
    most = int(14.0 * width)
    if len(title) > most:
        title = title[: most - 1] + "…"
    write_at(
        figure, 0.5 * width, height - 0.07, title, ha="center", va="top", fontsize=9.0,
        parse_math=False,
    )  # fmt: skip


def write_foot(figure: Figure, remarks: Sequence[str]) -> None:
    """Write remarks, what a reader must know to read the figure, under it."""
    width = figure.get_figwidth()
    write_at(
        figure, 0.01 * width, 0.05, "\n".join(_foot_lines(remarks, width)), va="bottom",
        fontsize=6.5, color="0.35", parse_math=False,
    )  # fmt: skip


def foot_room(remarks: Sequence[str], width: float) -> float:
    """Return how much higher than one line (in) the remarks are under a figure of a `width`."""
    return 0.12 * max(0, len(_foot_lines(remarks, width)) - 1)


def _foot_lines(remarks: Sequence[str], width: float) -> list[str]:
    return textwrap.wrap("; ".join(remarks), int(20.0 * width))


def column_of_panels(
    analyses: Analyses, remarks: Sequence[str], count: int, height: float
) -> tuple[Figure, list[Axes]]:
    """Return a figure with head and foot, as wide as a column, and panels of a `height` (in)."""
    room = foot_room(remarks, COLUMN)
    figure = Figure(figsize=(COLUMN, height + 0.9 + room))
    write_head(figure, analyses)
    write_foot(figure, remarks)
    return figure, stack(figure, (0.72, 0.55 + room, COLUMN - 0.9, height), count)


def stack(figure: Figure, place: Place, count: int, gap: float = 0.24) -> list[Axes]:
    """Add panels above each other, with one time axis."""
    left, bottom, width, height = place
    high = (height - gap * (count - 1)) / count
    panels: list[Axes] = []
    for row in range(count):
        low = bottom + (count - 1 - row) * (high + gap)
        share = {"sharex": panels[0]} if panels else {}
        panels.append(add_axes(figure, (left, low, width, high), **share))
    figure.align_ylabels(panels)
    return panels


def finish_stack(panels: Sequence[Axes], clock: Unit, times: np.ndarray) -> None:
    """Label the time axis that panels share, and give it the range of `times` (s)."""
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel(f"time ({clock.name})")
    first, last = times[0] / clock.size, times[-1] / clock.size
    if last > first:
        room = 0.02 * (last - first)
        panels[0].set_xlim(first - room, last + room)


def draw_magnitudes(
    axes: Axes, seconds: np.ndarray, curves: dict[str, tuple[np.ndarray, str, str]],
    checks: Mapping[str, Check | None],
) -> None:  # fmt: skip
    """Plot magnitudes on a log axis, on which zeros have no place, and the limits they have.

    Parameters
    ----------
    curves
        Name: values, colour, marker.
    checks
        What holds some of the curves to limits, by their names.
    """
    nothing: dict[str, str] = {}
    for name, (values, colour, mark) in curves.items():
        positive = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
        if np.isfinite(positive).any():
            axes.plot(
                seconds, positive, mark, color=colour, markersize=2.2, markeredgewidth=0.6,
                markevery=max(1, len(seconds) // 150), label=name,
            )  # fmt: skip
        else:
            nothing[name] = "exactly zero" if np.isfinite(values).any() else "unknown"
    axes.set_yscale("log")
    axes.margins(y=0.12)
    limits = {name: check.limit for name, check in checks.items() if check and name not in nothing}
    _draw_limits(axes, curves, limits)
    bottom, top = axes.get_ylim()
    if bottom < SMALLEST_ERROR < top:
        axes.set_ylim(SMALLEST_ERROR, top)
    missing = [f"{name}: {what}" for name, what in nothing.items()]
    if len(missing) == len(curves):
        axes.set_yticks([], minor=False)
        axes.set_yticks([], minor=True)
        axes.text(0.02, 0.05, "\n".join(missing), transform=axes.transAxes, fontsize=7.0)
    elif missing:
        text = "; ".join(missing)
        axes.text(1.0, 1.03, text, transform=axes.transAxes, fontsize=7.0, ha="right")
    put_legend_above(axes)


def _draw_limits(
    axes: Axes, curves: dict[str, tuple[np.ndarray, str, str]], limits: dict[str, float]
) -> None:
    """Draw one line where all limits are the same, else one in the colour of each curve."""
    shared = len(set(limits.values())) == 1
    for name, limit in list(limits.items())[: 1 if shared else None]:
        colour = "black" if shared else curves[name][1]
        label = f"limit {limit:.0e}"
        axes.axhline(limit, color=colour, linestyle=":", linewidth=0.9, label=label)


def put_legend_above(axes: Axes) -> None:
    """Put the legend in a row above a panel, as points may lie anywhere in it."""
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        axes.legend(
            handles, labels, ncols=len(handles), loc="lower left", bbox_to_anchor=(-0.02, 0.98),
            borderaxespad=0.0, columnspacing=1.2, handlelength=1.2, handletextpad=0.4,
            frameon=False,
        )  # fmt: skip
