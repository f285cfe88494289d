"""Velocity vectors in space, and velocities of a few particles against time (figure 6)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from lammps_blast import theory
from lammps_blast.analysis import SpheroidTheory
from lammps_blast.figures.cloud import (
    MAX_ARROWS,
    Snapshot,
    SpeedScale,
    has_both_charges,
    snapshot_of,
)
from lammps_blast.figures.sampling import LEGIBLE_TURNS, Sampling
from lammps_blast.figures.scene import (
    Camera,
    Panel,
    Scene,
    directions_about,
    field_remarks,
    open_panel,
)
from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PAGE,
    STYLE,
    Unit,
    finish_stack,
    largest_of,
    stack,
    write_foot,
    write_head,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# Colour, marker and line of each particle that is followed.
TRACK_STYLES = ((BLUE, "o", "-"), (ORANGE, "s", "--"), (GREEN, "^", "-."))


@rc_context(STYLE)
def velocity_figure(analyses: Analyses) -> Figure:
    """Draw velocity vectors, and velocities of a few particles against time (figure 6)."""
    figure = Figure(figsize=(PAGE, 5.0))
    scale = SpeedScale.of(analyses)
    frames = _moving_instants(analyses)
    height = 3.9 / len(frames)
    last = float(analyses.speeds.results.times[-1])
    clock = Unit.of(last, "s")
    for row, frame in enumerate(frames):
        place = (0.05, 4.62 - (row + 1) * height, 3.35, height - 0.05)
        snapshot = snapshot_of(analyses, frame, MAX_ARROWS)
        scene = Scene.around(snapshot.corners, Camera.facing(analyses.axis))
        longest = 0.2 * float(np.median(scene.size))
        title = f"t = {clock.show(snapshot.time, last)}"
        panel = open_panel(figure, place, scene.widened(longest), analyses, title)
        _draw_arrows(panel, snapshot, longest, scale)
    scale.draw_bar(figure, (0.45, 0.42, 2.6, 0.09))

    _draw_velocities(stack(figure, (4.15, 0.5, 2.9, 3.72), 3), analyses)
    count = len(analyses.cloud.mass)
    share = [f"velocities of {MAX_ARROWS} of {count} particles"] if count > MAX_ARROWS else []
    write_head(figure, analyses)
    write_foot(figure, [*field_remarks(analyses), *share, "arrows to one scale within a panel"])
    return figure


def _moving_instants(analyses: Analyses) -> list[int]:
    """Return the first frame, and the last in which the cloud still moves visibly."""
    speed = np.nan_to_num(analyses.speeds.results.rms)
    moving = np.flatnonzero(speed >= 0.3 * speed.max(initial=0.0))
    return sorted({0, int(moving[-1])})


def _draw_arrows(panel: Panel, snapshot: Snapshot, longest: float, scale: SpeedScale) -> None:
    """Draw velocities as arrows from the particles; the longest one is `longest` (m) long."""
    tail = panel.scene.shown(snapshot.position)
    panel.axes.scatter(*tail.T, s=1.5, color="0.45", depthshade=False, linewidths=0.0)
    speed = np.linalg.norm(snapshot.velocity, axis=1)
    moves = speed > 0.0
    if not moves.any():
        return
    arrows = panel.scene.shown(longest * snapshot.velocity[moves] / speed.max())
    panel.axes.quiver(
        *tail[moves].T,
        *arrows.T,
        # matplotlib draws all shafts, then the one stroke of all heads, then the other.
        colors=np.tile(scale.colours(snapshot)[moves], (3, 1)),
        arrow_length_ratio=0.3,
        linewidths=0.8,
    )


def _draw_velocities(panels: Sequence[Axes], analyses: Analyses) -> None:
    results = analyses.speeds.results
    sampling = Sampling.of(analyses)
    window = sampling.legible(results.times)
    shown = _shown_tracks(analyses)
    clock = Unit.of(float(window[-1]), "s")
    directions, names = directions_about(analyses.axis)
    measured = results.tracked_velocity[: len(window)][:, shown] @ directions.T
    unit = Unit.of(largest_of(measured), "m/s")
    curve_times = sampling.curve_times(window)
    exact = None if curve_times is None else _exact_velocities(analyses, shown, curve_times)
    curves = np.empty(0) if exact is None else exact @ directions.T
    top = largest_of(measured, curves) / unit.size or 1.0
    lines = exact is not None or sampling.resolved

    for component, (axes, name) in enumerate(zip(panels, names, strict=True)):
        for track, (colour, mark, style) in zip(range(len(shown)), TRACK_STYLES, strict=False):
            if exact is not None:
                curve = curves[:, track, component] / unit.size
                axes.plot(curve_times / clock.size, curve, style, color=colour, linewidth=0.6)
            axes.plot(
                window / clock.size, measured[:, track, component] / unit.size, mark,
                linestyle=style if lines and exact is None else "none", color=colour,
                markersize=1.9, markevery=max(1, len(window) // 200),
            )  # fmt: skip
        axes.axhline(0.0, color="0.8", linewidth=0.5, zorder=0)
        axes.set_ylabel(f"$v_{name}$ ({unit.name})")
        axes.set_ylim(-1.08 * top, 1.08 * top)
    finish_stack(panels, clock, window)
    _put_track_legend(panels[0], analyses, shown, lines)

    remark = "markers: frames of the run" + ("; lines: exact" if exact is not None else "")
    if not sampling.resolved:
        remark += f"\n{sampling.warning}"
    elif np.isfinite(sampling.frames_per_turn):
        remark += f"; {sampling.frames_per_turn:.3g} frames a turn"
    if len(window) < len(results.times):
        turns = results.times[-1] / sampling.period
        remark += f"\nfirst {LEGIBLE_TURNS:.0f} of {turns:.4g} turns"
    panels[0].set_title(remark, loc="left", fontsize=6.5, pad=16.0, color="0.25")


def _put_track_legend(axes: Axes, analyses: Analyses, shown: Sequence[int], lines: bool) -> None:
    ids = analyses.cloud.ids
    handles = []
    for track, (colour, mark, style) in zip(shown, TRACK_STYLES, strict=False):
        particle = analyses.tracked[track]
        label = f"particle {particle + 1 if ids is None else ids[particle]}"
        if has_both_charges(analyses):
            charge = analyses.cloud.charge[particle]
            label += " (+)" if charge > 0.0 else " (−)" if charge < 0.0 else ""
        handles.append(
            Line2D(
                [], [], color=colour, marker=mark, linestyle=style if lines else "none",
                linewidth=0.7, label=label,
            )
        )  # fmt: skip
    axes.legend(
        handles=handles, ncols=len(handles), loc="lower left", bbox_to_anchor=(-0.02, 1.0),
        borderaxespad=0.1, columnspacing=1.0, handlelength=2.0, handletextpad=0.4, fontsize=6.5,
    )  # fmt: skip


def _shown_tracks(analyses: Analyses) -> list[int]:
    """Return places in `analyses.tracked`: a few, of both charges where both are tracked."""
    sense = analyses.cloud.turning_sense[analyses.tracked]
    shown = list(range(min(len(TRACK_STYLES), len(sense))))
    others = np.flatnonzero(sense != sense[0])
    if len(others) and others[0] not in shown:
        shown[-1] = int(others[0])
    return shown


def _exact_velocities(
    analyses: Analyses, shown: Sequence[int], times: np.ndarray
) -> np.ndarray | None:
    """Return exact velocities (T, len(shown), 3) in m/s, None where theory has none.

    Drag only shortens the velocity that a magnetic field turns. Not so the velocity that an
    electric field or a wind adds to: with drag, there is no formula for that.
    """
    case, cloud, expected = analyses.case, analyses.cloud, analyses.expected
    if case is None or not isinstance(expected, SpheroidTheory):
        return None
    if case.medium.drag != "none" and any((*case.fields.electric, *case.medium.velocity)):
        return None
    results = analyses.speeds.results
    particles = [analyses.tracked[track] for track in shown]
    elapsed = times - results.times[0]
    launch = results.tracked_velocity[0, shown]
    _, turned = theory.lorentz_orbit(
        elapsed[:, None],
        np.zeros_like(launch),
        launch,
        cloud.charge[particles] / cloud.mass[particles],
        case.fields.electric,
        case.fields.magnetic,
    )
    return turned * (expected.speeds(elapsed) / expected.speed)[:, None, None]
