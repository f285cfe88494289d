"""Each pair that touches by itself: gap, forces and bond against time, and the spins it leaves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator

from lammps_blast.figures.sampling import Sampling, plot_frames
from lammps_blast.figures.style import (
    BLUE,
    GREY,
    ORANGE,
    PAGE,
    STYLE,
    Unit,
    add_axes,
    finish_stack,
    foot_room,
    largest_of,
    put_legend_above,
    stack,
    write_at,
    write_foot,
    write_head,
)
from lammps_blast.interactions import collision_spin

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

MOST_PAIRS = 8
# Inches: the rows of a few pairs together, one row at least, and between rows.
ROWS, LOWEST_ROW, ROW_GAP = 3.9, 0.42, 0.22
# Left ends and widths, in inches, of so many columns.
COLUMNS = {
    1: ((0.62, 6.43),),
    2: ((0.62, 2.75), (4.15, 2.9)),
    3: ((0.62, 1.6), (2.85, 1.6), (5.15, 1.9)),
}
# What two panels above each other, each with a time axis or the like, have between them.
AXIS_ROOM = 0.75
# Gaps are drawn up to so many of the largest overlap: what comes before and after is motion alone.
SHOWN_OVERLAPS = 3.0
# Frames, at least, that are drawn before the first and after the last contact.
MARGIN = 10
IN_CONTACT, BONDED = "0.9", "#BFE5D6"


@rc_context(STYLE)
def pair_history_figure(analyses: Analyses) -> Figure:
    """Draw a row for each pair that touches: its gap, its forces and, shaded, its bond.

    Where particles turn, also the spins against time, and against the angle at which pairs met.
    """
    story = _Story.of(analyses)
    high = max(LOWEST_ROW, (ROWS + ROW_GAP) / len(story.shown) - ROW_GAP)
    height = len(story.shown) * (high + ROW_GAP) - ROW_GAP
    remarks = list(_remarks(story))
    bottom = 0.6 + foot_room(remarks, PAGE)
    figure = Figure(figsize=(PAGE, bottom + height + 0.68))
    columns = COLUMNS[1 + story.forces + story.spins]
    count = len(story.shown)
    left, width = columns[0]
    _draw_gaps(stack(figure, (left, bottom, width, height), count, ROW_GAP), story)
    if story.forces:
        left, width = columns[1]
        _draw_forces(stack(figure, (left, bottom, width, height), count, ROW_GAP), story)
    if story.spins:
        left, width = columns[-1]
        half = 0.5 * (height - AXIS_ROOM)
        _draw_spins(add_axes(figure, (left, bottom + half + AXIS_ROOM, width, half)), story)
        _draw_impacts(add_axes(figure, (left, bottom, width, half)), story)
    _draw_key(figure, story, height + bottom + 0.22)
    write_head(figure, analyses)
    write_foot(figure, remarks)
    return figure


@dataclass(frozen=True)
class _Story:
    """What is drawn: `shown` are places in the results' pairs, `window` the frames."""

    analyses: Analyses
    shown: np.ndarray
    window: slice
    clock: Unit
    joined: bool

    @classmethod
    def of(cls, analyses: Analyses) -> _Story:
        results = analyses.histories.results
        first_touch = results.touching.argmax(axis=0)
        shown = np.sort(np.argsort(first_touch, kind="stable")[:MOST_PAIRS])
        window = _eventful(results.touching.any(axis=1))
        clock = Unit.of(float(results.times[window][-1]), "s")
        joined = Sampling.of(analyses).resolved
        return cls(analyses, shown, window, clock, joined)

    @property
    def results(self) -> Any:
        """Return the results of the analysis."""
        return self.analyses.histories.results

    @property
    def times(self) -> np.ndarray:
        """Return the times in the window, s."""
        return self.results.times[self.window]

    @property
    def forces(self) -> bool:
        """Tell whether forces are known."""
        return self.results.normal_force is not None

    @property
    def spins(self) -> bool:
        """Tell whether any particle of a pair turns."""
        return self.results.spin is not None and bool(np.nan_to_num(self.results.spin).any())

    @property
    def bonds(self) -> bool:
        """Tell whether any pair is ever bonded."""
        return self.results.bonded is not None and bool(self.results.bonded.any())

    @property
    def colours(self) -> list[Any]:
        """Return the colour of each pair that is drawn: their order, where they are compared."""
        if not self.spins:
            return [BLUE] * len(self.shown)
        return list(colormaps["viridis"](np.linspace(0.0, 0.85, len(self.shown))))

    def plot(self, axes: Axes, values: np.ndarray, **look: Any) -> None:
        """Plot a number of each frame (T,) against time, for the window alone."""
        seconds = self.times / self.clock.size
        plot_frames(axes, seconds, values[self.window], self.joined, markersize=1.6, **look)


def _eventful(touching: np.ndarray) -> slice:
    """Return the frames from shortly before the first contact to shortly after the last one."""
    frames = np.flatnonzero(touching)
    margin = max(MARGIN, (frames[-1] - frames[0]) // 2)
    return slice(max(0, int(frames[0] - margin)), int(frames[-1] + margin + 1))


def _draw_gaps(rows: Sequence[Axes], story: _Story) -> None:
    results, shown = story.results, story.shown
    gap = 100.0 * results.gap
    low, high = _gap_range(gap[story.window][:, shown])
    room = 0.08 * (high - low) or 1.0
    for axes, pair, colour in zip(rows, shown, story.colours, strict=True):
        _shade(axes, story, pair)
        axes.axhline(0.0, color="0.5", linewidth=0.5, zorder=1)
        story.plot(axes, gap[:, pair], color=colour, marker="o")
        axes.set_ylim(low - room, high + room)
        axes.yaxis.set_major_locator(MaxNLocator(3))
        first, second = results.ids[pair]
        title = f"{first} and {second}: {what_happens(results, pair)}"
        axes.set_title(title, loc="left", fontsize=6.5, pad=2.0)
    finish_stack(rows, story.clock, story.times)
    _label_rows(rows, "gap (%)")


def _gap_range(gap: np.ndarray) -> tuple[float, float]:
    """Return the smallest gap and the largest one that is drawn."""
    known = gap[np.isfinite(gap)]
    low, high = min(known.min(), 0.0), max(known.max(), 0.0)
    return float(low), float(min(high, -SHOWN_OVERLAPS * low) if low < 0.0 else high)


def what_happens(results: Any, pair: int) -> str:
    """Return the history of a pair, a place in the results of `PairHistories`, in few words."""
    touching = results.touching[:, pair]
    bonded = np.zeros_like(touching) if results.bonded is None else results.bonded[:, pair]
    if bonded.any():
        start = "bond from the start" if bonded[0] else "bond forms"
        return f"{start}, {'holds' if bonded[-1] else 'breaks'}"
    if touching[-1]:
        return "stays in contact" if touching[0] else "comes into contact"
    if touching[0]:
        return "parts"
    times = np.count_nonzero(touching[1:] & ~touching[:-1])
    return "bounces" if times == 1 else f"bounces {times} times"


def _shade(axes: Axes, story: _Story, pair: int) -> None:
    """Shade the times at which a pair touches, and those at which it is bonded."""
    results, seconds = story.results, story.times / story.clock.size
    # Each frame stands for the time that is nearer to it than to the others.
    edges = [seconds[0], *0.5 * (seconds[1:] + seconds[:-1]), seconds[-1]]
    states = {IN_CONTACT: results.touching}
    if results.bonded is not None:
        states[BONDED] = results.bonded
    for colour, state in states.items():
        axes.stairs(
            state[story.window, pair].astype(float), edges, fill=True, color=colour, zorder=0,
            transform=axes.get_xaxis_transform(),
        )  # fmt: skip


def _draw_forces(rows: Sequence[Axes], story: _Story) -> None:
    results, shown = story.results, story.shown
    pushes, pulls = results.normal_force, results.bond_force if story.bonds else None
    largest = largest_of(pushes[:, shown], *([pulls[:, shown]] if story.bonds else []))
    unit = Unit.of(largest, "N")
    for axes, pair, colour in zip(rows, shown, story.colours, strict=True):
        _shade(axes, story, pair)
        story.plot(axes, pushes[:, pair] / unit.size, color=colour, marker="o")
        if pulls is not None:
            look = {"color": ORANGE, "linestyle": "--", "marker": "s"}
            story.plot(axes, pulls[:, pair] / unit.size, **look)
        axes.set_ylim(-0.06 * largest / unit.size, 1.1 * largest / unit.size or 1.0)
        axes.yaxis.set_major_locator(MaxNLocator(3))
    finish_stack(rows, story.clock, story.times)
    _label_rows(rows, f"force ({unit.name})")


def _draw_spins(axes: Axes, story: _Story) -> None:
    spin = story.results.spin[:, story.shown]
    unit = Unit.of(largest_of(spin), "rad/s")
    for pair, colour in enumerate(story.colours):
        for particle, line in enumerate(("-", "--")):
            values = spin[:, pair, particle] / unit.size
            story.plot(axes, values, color=colour, linestyle=line, marker="o")
    axes.set_ylabel(f"spin ({unit.name})")
    finish_stack([axes], story.clock, story.times)


def _draw_impacts(axes: Axes, story: _Story) -> None:
    """Draw the final spin of each pair against the angle at which it met, and what theory says."""
    results, shown = story.results, story.shown
    radius = story.analyses.cloud.radius[results.pairs[shown]]
    spin = (results.spin[-1, shown] * radius).mean(axis=1) / results.impact_speed[shown]
    if _collisions_are_plain(story.analyses):
        angles = np.radians(np.linspace(0.0, 90.0, 181))
        dynamic = story.analyses.case.contact.friction.dynamic
        for friction, name, look in (
            (np.inf, "no sliding", {"color": GREY, "linestyle": ":"}),
            (dynamic, "stiff friction", {"color": "black", "linewidth": 0.8}),
        ):
            curve = collision_spin(1.0, angles, 1.0, 1.0, 1.0, friction)
            axes.plot(np.degrees(angles), curve, label=name, zorder=1, **look)
    if np.isnan(spin).all():
        text = "no impact seen"
        axes.text(0.5, 0.5, text, transform=axes.transAxes, ha="center", color="0.35")
    axes.scatter(
        np.degrees(results.impact_angle[shown]), spin, c=story.colours, s=16.0, zorder=2,
        edgecolors="black", linewidths=0.4, clip_on=False,
    )  # fmt: skip
    axes.set_xlim(0.0, 90.0)
    axes.set_ylim(0.0, None)
    axes.set_xticks(range(0, 91, 30))
    axes.set_xlabel("angle of impact (°)")
    axes.set_ylabel("final spin × radius / speed")
    put_legend_above(axes)


def _collisions_are_plain(analyses: Analyses) -> bool:
    """Tell whether every pair that touches obeys the closed form for two equal spheres.

    Nothing but the elastic contact and its friction acts, no sphere turned before, and none has met
    two others.
    """
    case, cloud, results = analyses.case, analyses.cloud, analyses.histories.results
    if case is None or case.contact is None or case.contact.friction is None:
        return False
    if case.contact.law != "zohdi" or case.contact.damping or case.bond or case.near_field:
        return False
    if any((*case.fields.electric, *case.fields.magnetic)) or case.medium.drag != "none":
        return False
    first, second = results.pairs.T
    alike = all(np.allclose(each[first], each[second]) for each in (cloud.radius, cloud.mass))
    once = len(np.unique(results.pairs)) == results.pairs.size
    return alike and once and not results.spin[0].any()


def _label_rows(rows: Sequence[Axes], text: str) -> None:
    """Write one label for all rows, at their left."""
    figure = rows[0].get_figure()
    place = rows[0].get_position().x0 * PAGE - 0.45
    low, high = rows[-1].get_position().y0, rows[0].get_position().y1
    middle = 0.5 * (low + high) * figure.get_figheight()
    write_at(figure, place, middle, text, rotation="vertical", ha="center", va="center")


def _draw_key(figure: Figure, story: _Story, bottom: float) -> None:
    """Write over the rows what their shades and lines mean."""
    handles: list[Any] = [Patch(color=IN_CONTACT, label="in contact")]
    if story.bonds:
        handles.append(Patch(color=BONDED, label="bonded"))
    if story.forces:
        colour = GREY if story.spins else story.colours[0]
        handles.append(Line2D([], [], color=colour, label="contact pushes"))
    if story.bonds:
        handles.append(Line2D([], [], color=ORANGE, linestyle="--", label="bond pulls"))
    axes = add_axes(figure, (COLUMNS[1][0][0], bottom, PAGE - 1.0, 0.15))
    axes.set_axis_off()
    axes.legend(handles=handles, ncols=len(handles), loc="center left", borderaxespad=0.0)


def _remarks(story: _Story) -> Iterator[str]:
    results = story.results
    touching = len(results.pairs)
    if len(story.shown) < touching:
        yield f"the first {len(story.shown)} of {touching} pairs that touch"
    yield "gap: between the surfaces, over the sum of the radii; wide ones are not drawn"
    if not story.forces:
        yield "forces and bonds unknown"
    if len(story.times) < len(results.times):
        last = float(results.times[-1])
        yield f"nothing touches in the rest of the run of {story.clock.show(last, last)}"
    if story.spins:
        yield "colours of spins: those of the rows"
        yield "angle of impact: between the relative velocity and the line of centres"
        if _collisions_are_plain(story.analyses):
            yield "curves: closed form for friction that is as good as rigid until it slides"
    if not story.joined:
        yield Sampling.of(story.analyses).warning
