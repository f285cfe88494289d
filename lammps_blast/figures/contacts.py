"""The contact network: who presses whom, how hard, and how many contacts there are when."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import EllipseCollection, LineCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator, NullFormatter

from lammps_blast.contacts import ContactNetwork, distribution_about_mean
from lammps_blast.figures.cloud import SPEED_COLOURS
from lammps_blast.figures.sampling import Sampling, plot_frames
from lammps_blast.figures.scene import directions_about
from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PAGE,
    STYLE,
    Unit,
    add_axes,
    finish_stack,
    largest_of,
    stack,
    write_at,
    write_foot,
    write_head,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# Inches: the two projections side by side, the highest that they may be, what is under them.
PROJECTIONS, HIGHEST, LOWER_PART = 5.6, 3.2, 3.35
# So few contacts are drawn one by one: their distribution is no curve.
MOST_BARS = 10
# Widths in points of the lines of the weakest and of the strongest contact.
THIN, THICK = 0.4, 2.4


@rc_context(STYLE)
def contact_figure(analyses: Analyses) -> Figure:
    """Draw the network of the frame with most contacts, its forces, and contacts against time.

    Lines join the centres of spheres in contact, coloured by normal force; by strain where forces
    are unknown.
    """
    network = analyses.contacts.results.fullest
    scale = ContactScale.of(network)
    figure = _draw_projections(analyses, network, scale)
    scale.draw_bar(figure)
    forces = add_axes(figure, (0.62, 0.72, 2.75, 1.55))
    if len(network) <= MOST_BARS:
        _draw_each(forces, analyses, network, scale)
    else:
        _draw_distribution(forces, scale)
    _draw_history(stack(figure, (4.15, 0.72, 2.3, 1.55), 2, gap=0.15), analyses)
    write_head(figure, analyses)
    write_foot(figure, list(_remarks(analyses)))
    return figure


def _remarks(analyses: Analyses) -> Iterator[str]:
    if analyses.contacts.recorded:
        yield "contacts and forces as the run recorded them"
    else:
        yield "contacts: spheres that overlap; forces unknown"
    yield "grey: spheres at their true size; strain: overlap over the sum of the radii"
    sampling = Sampling.of(analyses)
    if not sampling.resolved:
        yield sampling.warning


@dataclass(frozen=True)
class ContactScale:
    """What contacts are coloured by: `values` (C,) are normal forces in N, or strains."""

    values: np.ndarray
    what: str
    unit: Unit

    @classmethod
    def of(cls, network: ContactNetwork) -> ContactScale:
        """Return the scale of normal forces; of strains where forces are unknown."""
        if network.normal_force is None:
            return cls(network.strain, "strain", Unit(0.01, "%"))
        force = network.normal_force
        return cls(force, "normal force", Unit.of(largest_of(force), "N"))

    @property
    def mappable(self) -> ScalarMappable:
        """Return the scale of colours, in the unit in which it is shown."""
        top = largest_of(self.values) / self.unit.size or 1.0
        return ScalarMappable(Normalize(0.0, top), SPEED_COLOURS)

    def draw_contacts(self, axes: Axes, ends: np.ndarray) -> None:
        """Draw contacts as lines between `ends` (C, 2, 2), strong ones over weak ones."""
        order = np.argsort(self.values)
        share = self.values[order] / (largest_of(self.values) or 1.0)
        axes.add_collection(
            LineCollection(
                ends[order],
                colors=self.mappable.to_rgba(self.values[order] / self.unit.size),
                linewidths=THIN + (THICK - THIN) * share,
                capstyle="round",
            )
        )

    def draw_bar(self, figure: Figure) -> None:
        """Draw the colour bar between the projections and what is under them."""
        axes = add_axes(figure, (0.5 * PAGE - 1.5, LOWER_PART - 0.62, 3.0, 0.09))
        bar = figure.colorbar(self.mappable, cax=axes, orientation="horizontal")
        bar.outline.set_linewidth(0.4)
        bar.locator = MaxNLocator(6)
        axes.tick_params(width=0.4, length=2.0)
        axes.set_title(f"{self.what} ({self.unit.name})", pad=2.5, fontsize=7.0)


def _draw_projections(analyses: Analyses, network: ContactNetwork, scale: ContactScale) -> Figure:
    """Return a figure with the network seen from the side and seen along the axis."""
    directions, indices = directions_about(analyses.axis)
    names = [f"${index}$" if index in "xyz" else f"$r_{index}$" for index in indices]
    position = analyses.universe.trajectory[network.frame].data["position"] @ directions.T
    low, high = _box(position, analyses.cloud.radius)
    if np.diff(high - low)[1] < -0.5 * (high - low)[1]:
        # Seen from the side, a flat cloud is seen from the side on which it does not hide itself.
        turned = [0, 2, 1]
        position, names = position[:, turned], [names[i] for i in turned]
        low, high = low[turned], high[turned]
    inches = min(PROJECTIONS / (high - low)[:2].sum(), HIGHEST / (high - low)[2])
    widths = inches * (high - low)
    unit = Unit.of(float(np.abs([low, high]).max()), "m")
    clock = Unit.of(network.time, "s")

    figure = Figure(figsize=(PAGE, LOWER_PART + widths[2] + 0.72))
    left = 0.5 * (PAGE - widths[0] - widths[1] - 0.35)
    for across, start in ((0, left), (1, left + widths[0] + 0.7)):
        axes = add_axes(figure, (start, LOWER_PART, widths[across], widths[2]))
        shown = [across, 2]
        _draw_spheres(axes, position[:, shown] / unit.size, analyses.cloud.radius / unit.size)
        scale.draw_contacts(axes, position[network.pairs][..., shown] / unit.size)
        axes.set_xlim(low[across] / unit.size, high[across] / unit.size)
        axes.set_ylim(low[2] / unit.size, high[2] / unit.size)
        axes.xaxis.set_major_locator(MaxNLocator(max(2, int(widths[across] / 0.45))))
        axes.yaxis.set_major_locator(MaxNLocator(max(2, int(widths[2] / 0.4))))
        axes.set_xlabel(f"{names[across]} ({unit.name})")
        axes.set_ylabel(f"{names[2]} ({unit.name})", labelpad=1.0)
        view = "from the side" if across == 0 else f"along {analyses.axis_name}"
        axes.set_title(f"seen {view}", fontsize=7.0, pad=3.0)
    write_at(
        figure, 0.5 * PAGE, LOWER_PART + widths[2] + 0.34,
        f"t = {clock.show(network.time, network.time)}: {len(network)} contacts,"
        " the most in any frame",
        ha="center",
    )  # fmt: skip
    return figure


def _box(position: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners (3,) of a box that holds all spheres and has room for ticks."""
    finite = np.isfinite(position).all(axis=1)
    position, room = position[finite], radius[finite][:, None]
    low = np.min(position - room, axis=0, initial=np.inf)
    high = np.max(position + room, axis=0, initial=-np.inf)
    if not finite.any():
        low, high = np.full(3, -1.0), np.full(3, 1.0)
    half = 0.5 * (high - low)
    half = 1.03 * np.maximum(half, 0.2 * half.max() or 1.0)
    middle = 0.5 * (low + high)
    return middle - half, middle + half


def _draw_spheres(axes: Axes, centre: np.ndarray, radius: np.ndarray) -> None:
    axes.add_collection(
        EllipseCollection(
            2.0 * radius, 2.0 * radius, np.zeros(len(radius)), units="xy", offsets=centre,
            offset_transform=axes.transData, facecolors="0.93", edgecolors="0.78", linewidths=0.2,
        )
    )  # fmt: skip


def _draw_distribution(axes: Axes, scale: ContactScale) -> None:
    distribution = distribution_about_mean(scale.values)
    axes.set_xlabel(f"{scale.what} / mean of the frame")
    axes.set_ylabel("probability density")
    if distribution is None:
        axes.text(0.5, 0.5, "no force", transform=axes.transAxes, ha="center", color="0.35")
        return
    edges, density = distribution
    middle, filled = 0.5 * (edges[1:] + edges[:-1]), density > 0.0
    axes.stairs(density, edges, color=BLUE, fill=True, alpha=0.18)
    axes.stairs(density, edges, color=BLUE, linewidth=0.8)
    axes.plot(middle[filled], density[filled], "o", color=BLUE)
    axes.set_yscale("log")
    # A decade at least, so that a tick has a number.
    top = 2.0 * density.max()
    axes.set_ylim(min(0.5 * density[filled].min(), 0.08 * top), top)
    axes.yaxis.set_major_formatter("{x:g}")
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_xlim(0.0, edges[-1])
    count, mean = len(scale.values), scale.values.mean() / scale.unit.size
    axes.set_title(
        f"{count} contacts, mean {mean:.3g} {scale.unit.name}", fontsize=7.0, pad=3.0
    )  # fmt: skip


def _draw_each(
    axes: Axes, analyses: Analyses, network: ContactNetwork, scale: ContactScale
) -> None:
    """Draw a bar for each of a few contacts, the strongest one above."""
    ids = analyses.cloud.ids
    if ids is None:
        ids = np.arange(1, len(analyses.cloud.mass) + 1)
    order = np.argsort(scale.values, kind="stable")
    names = [f"{first} and {second}" for first, second in ids[network.pairs[order]]]
    values = scale.values[order] / scale.unit.size
    axes.barh(names, values, 0.6, color=scale.mappable.to_rgba(values))
    # Two bars alone would fill the panel.
    axes.set_ylim(len(names) - 0.5 - max(len(names), 5), len(names) - 0.5)
    axes.set_xlabel(f"{scale.what} ({scale.unit.name})")
    axes.set_title("each contact, with the ids of its spheres", fontsize=7.0, pad=3.0)
    axes.tick_params(axis="y", length=0.0)


def _draw_history(panels: Sequence[Axes], analyses: Analyses) -> None:
    results = analyses.contacts.results
    clock = Unit.of(float(results.times[-1]), "s")
    seconds = results.times / clock.size
    joined = Sampling.of(analyses).resolved
    number, strain = panels
    look: dict[str, Any] = {"linestyle": "-", "marker": "o", "markersize": 2.0}
    plot_frames(number, seconds, results.contacts, joined, color=BLUE, **look)
    if results.bonded_fraction is not None and np.nansum(results.bonded_fraction) > 0.0:
        bonded = results.contacts * np.nan_to_num(results.bonded_fraction)
        look = {"linestyle": ":", "marker": "^", "markersize": 2.0}
        plot_frames(number, seconds, bonded, joined, color=GREEN, label="bonded", **look)
        number.legend(loc="best")
    number.set_ylim(0.0, 1.1 * (largest_of(results.contacts) or 1.0))
    number.yaxis.set_major_locator(MaxNLocator(3, integer=True))
    number.set_ylabel("contacts")
    per_particle = 2.0 / len(analyses.cloud.mass)
    second = number.secondary_yaxis(
        "right", functions=(lambda count: count * per_particle, lambda mean: mean / per_particle)
    )
    second.set_ylabel("a particle")
    percent = 100.0 * results.largest_strain
    look |= {"linestyle": "--", "marker": "s"}
    plot_frames(strain, seconds, percent, joined, color=ORANGE, **look)
    strain.set_ylim(0.0, 1.1 * (largest_of(percent) or 1.0))
    strain.set_ylabel("largest\nstrain (%)")
    finish_stack(panels, clock, results.times)
