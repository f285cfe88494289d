"""The cloud at several instants, coloured by speed or by charge (the paper's figures 5 and 7)."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize, to_rgba_array
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator

from lammps_blast.analysis import SpheroidTheory
from lammps_blast.figures.scene import (
    Camera,
    Scene,
    Spheroid,
    draw_particles,
    draw_spheroid,
    field_remarks,
    grid_of_places,
    open_panel,
)
from lammps_blast.figures.style import (
    BLUE,
    GREY,
    PAGE,
    STYLE,
    Place,
    Unit,
    add_axes,
    from_0_to_1,
    largest_of,
    write_foot,
    write_head,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

INSTANTS = 6
# More particles than this in one panel only cover each other.
MAX_DRAWN = 3000
MAX_ARROWS = 160
# Particles drawn so many times larger than they are are better called points.
MAX_ENLARGED = 1e3
# From the navy blue to the orange of plasma: its yellow end is lost on white paper.
SPEED_COLOURS = ListedColormap(colormaps["plasma"](np.linspace(0.02, 0.8, 256)), "speed")
# Of the charges with sign 0, 1 and, counted from the end, -1.
CHARGES = (("no charge", GREY), ("positive charge", "#F0A030"), ("negative charge", BLUE))
KEY_PLACE = (0.5 * PAGE - 1.5, 0.42, 3.0, 0.09)


@rc_context(STYLE)
def cloud_figure(analyses: Analyses) -> Figure:
    """Draw the cloud at several instants, coloured by speed where the dump has velocities."""
    if analyses.speeds is None:
        plain = to_rgba_array(BLUE)
        return cloud_panels(analyses, lambda _: plain, "velocities unknown")
    scale = SpeedScale.of(analyses)
    figure = cloud_panels(analyses, scale.colours)
    scale.draw_bar(figure, KEY_PLACE)
    return figure


@rc_context(STYLE)
def charge_figure(analyses: Analyses) -> Figure:
    """Draw the cloud at several instants, coloured by the sign of the charges."""
    charge = analyses.cloud.charge
    signs = (charge > 0.0).astype(int) - (charge < 0.0)
    colours = to_rgba_array([colour for _, colour in CHARGES])
    figure = cloud_panels(analyses, lambda snapshot: colours[signs[snapshot.drawn]])
    draw_key(figure, dict(CHARGES[sign] for sign in (1, -1, 0) if (signs == sign).any()))
    return figure


def draw_key(figure: Figure, colours: Mapping[str, Any]) -> None:
    """Write under the panels what the colours of the particles mean (name: colour)."""
    handles = [
        Line2D([], [], marker="o", linestyle="none", color=colour, label=name, markersize=5.0)
        for name, colour in colours.items()
    ]
    axes = add_axes(figure, KEY_PLACE)
    axes.set_axis_off()
    axes.legend(handles=handles, ncols=len(handles), loc="center")


def cloud_panels(
    analyses: Analyses, colours: Callable[[Snapshot], np.ndarray], *remarks: str
) -> Figure:
    """Draw the cloud at several instants; `colours` returns those (D, 4) of what is drawn."""
    snapshots = [snapshot_of(analyses, frame, MAX_DRAWN) for frame in _instants(analyses)]
    corners = np.concatenate([snapshot.corners for snapshot in snapshots])
    scene = Scene.around(corners, Camera.facing(analyses.axis))
    figure, places = grid_of_places(len(snapshots), scene)
    last = snapshots[-1].time
    clock = Unit.of(last, "s")
    enlarged = 1.0
    for place, snapshot in zip(places, snapshots, strict=True):
        panel = open_panel(figure, place, scene, analyses, f"t = {clock.show(snapshot.time, last)}")
        size = draw_particles(panel, snapshot.position, snapshot.radius, colours(snapshot))
        enlarged = max(enlarged, size)
        if snapshot.spheroid:
            draw_spheroid(panel, snapshot.spheroid)
    write_head(figure, analyses)
    write_foot(figure, [*remarks, *_cloud_remarks(analyses, snapshots, enlarged)])
    return figure


def _cloud_remarks(
    analyses: Analyses, snapshots: Sequence[Snapshot], enlarged: float
) -> Iterator[str]:
    yield from field_remarks(analyses)
    count = len(analyses.cloud.mass)
    if count > MAX_DRAWN:
        yield f"{MAX_DRAWN} of {count} particles drawn"
    if analyses.cloud.radius is None:
        yield "radii unknown"
    elif enlarged > MAX_ENLARGED:
        yield "particles drawn as points, not to scale"
    elif enlarged > 1.05:
        yield f"particles enlarged up to {enlarged:.2g} times to be visible"
    else:
        yield "particles at their true size"
    yield "farther ones paler"
    if any(snapshot.spheroid for snapshot in snapshots):
        yield "wires: exact spheroid of the particle centres"


@dataclass(frozen=True)
class Snapshot:
    """What is drawn of one frame, SI units.

    `drawn` (D,) are indices of particles, to which `position` and `velocity` (D, 3) and `radius`
    (D,) belong; the box between `corners` (2, 3) holds all particles, drawn or not.
    """

    frame: int
    time: float
    drawn: np.ndarray
    position: np.ndarray
    velocity: np.ndarray | None
    radius: np.ndarray | None
    corners: np.ndarray
    spheroid: Spheroid | None


def snapshot_of(analyses: Analyses, frame: int, most: int) -> Snapshot:
    """Return a frame with at most so many particles drawn: MAX_DRAWN or MAX_ARROWS.

    A frame is read once for all figures; kept is what they draw of it.
    """
    if frame not in analyses.snapshots:
        analyses.snapshots[frame] = _read_snapshots(analyses, frame)
    return analyses.snapshots[frame][most]


def _read_snapshots(analyses: Analyses, frame: int) -> dict[int, Snapshot]:
    """Read a frame; return its snapshots by the most particles that they may draw."""
    ts = analyses.universe.trajectory[frame]
    position, velocity = ts.data["position"], ts.data.get("velocity")
    radius = analyses.cloud.radius
    # A diverged run may hold NaN.
    finite = np.isfinite(position).all(axis=1)
    if velocity is not None:
        finite &= np.isfinite(velocity).all(axis=1)
    spheroid = _spheroid(analyses, frame)
    room = 0.0 if radius is None else radius[finite][:, None]
    ends = [position[finite] - room, position[finite] + room]
    ends = np.concatenate([*ends, spheroid.corners] if spheroid else ends)
    corners = [ends.min(axis=0), ends.max(axis=0)] if len(ends) else np.zeros((2, 3))
    snapshots = {}
    for most in (MAX_DRAWN, MAX_ARROWS):
        drawn = _drawn(finite, most)
        snapshots[most] = Snapshot(
            frame,
            float(ts.time),
            drawn,
            position[drawn],
            None if velocity is None else velocity[drawn],
            None if radius is None else radius[drawn],
            np.array(corners),
            spheroid,
        )
    return snapshots


def _drawn(finite: np.ndarray, most: int) -> np.ndarray:
    """Return which particles are drawn; of more than `most`, the same few in each frame."""
    drawn = np.arange(len(finite))
    if len(drawn) > most:
        # At random, because the order of particles may follow their places.
        drawn = np.sort(np.random.default_rng(0).choice(len(drawn), most, replace=False))
    return drawn[finite[drawn]]


def _spheroid(analyses: Analyses, frame: int) -> Spheroid | None:
    """Return the exact spheroid of a frame, or None where there is not one."""
    results, expected, case = analyses.envelope.results, analyses.expected, analyses.case
    if case is None or not isinstance(expected, SpheroidTheory):
        return None
    if has_both_charges(analyses) and any((*case.fields.electric, *case.medium.velocity)):
        return None  # the charges part, each with a spheroid of its own
    along, across = expected.semi_axes(results.launch_radius, results.times[frame])
    if not np.isfinite([*results.centre[frame], along, across]).all():
        return None
    return Spheroid(results.centre[frame], analyses.axis, float(along), float(across))


def has_both_charges(analyses: Analyses) -> bool:
    """Tell whether the cloud has both positive and negative particles."""
    charge = analyses.cloud.charge
    return charge is not None and bool((charge < 0.0).any() and (charge > 0.0).any())


def _instants(analyses: Analyses) -> list[int]:
    """Return frames, first and last included, spread evenly over time and over growth.

    Half of the spread goes with time and half with the change of the cloud's size: frames of a
    cloud that grows steadily are evenly spaced in time, and a cloud that comes to rest early is not
    shown at rest five times.
    """
    results = analyses.envelope.results
    growth = np.nan_to_num(np.abs(np.diff(results.blast_radius, prepend=results.blast_radius[0])))
    progress = from_0_to_1(results.times) + from_0_to_1(np.cumsum(growth))
    targets = np.linspace(0.0, progress[-1], INSTANTS)
    nearest = {int(np.abs(progress - target).argmin()) for target in targets}
    return sorted(nearest | {0, len(progress) - 1})


@dataclass(frozen=True)
class SpeedScale:
    """Colours by speed, from zero, so that a colour tells how large the speed is; m/s."""

    smallest: float
    largest: float

    @classmethod
    def of(cls, analyses: Analyses) -> SpeedScale:
        """Return the scale of a run, for all of its frames."""
        results = analyses.speeds.results
        slow, largest = results.smallest, largest_of(results.largest)
        return cls(float(np.min(slow, initial=largest, where=np.isfinite(slow))), largest)

    @property
    def unit(self) -> Unit:
        """Return the unit in which speeds are shown."""
        return Unit.of(self.largest, "m/s")

    @property
    def mappable(self) -> ScalarMappable:
        """Return the scale, in the unit in which it is shown."""
        return ScalarMappable(Normalize(0.0, self.largest / self.unit.size or 1.0), SPEED_COLOURS)

    def colours(self, snapshot: Snapshot) -> np.ndarray:
        """Return a colour for each drawn particle, shape (D, 4)."""
        return self.mappable.to_rgba(np.linalg.norm(snapshot.velocity, axis=1) / self.unit.size)

    def draw_bar(self, figure: Figure, place: Place) -> None:
        """Draw the colour bar, with the range of this run."""
        axes = add_axes(figure, place)
        bar = figure.colorbar(self.mappable, cax=axes, orientation="horizontal")
        bar.outline.set_linewidth(0.4)
        bar.locator = MaxNLocator(6)
        axes.tick_params(width=0.4, length=2.0)
        low, high = (f"{speed / self.unit.size:#.4g}" for speed in (self.smallest, self.largest))
        span = f"always {low}" if low == high else f"from {low} to {high}"
        if self.smallest < 1e-3 * self.largest:
            span = f"up to {high}"
        axes.set_title(f"speed ({self.unit.name}); in this run {span}", pad=2.5, fontsize=7.0)
