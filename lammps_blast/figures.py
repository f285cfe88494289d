"""Pictures of an analysed run, as PNG files: the cloud, its velocities, its envelope, its energy.

They are the counterparts of the paper's figures 5 to 7, and more. A function a figure; each returns
a :class:`matplotlib.figure.Figure`, which a notebook shows and :func:`draw_figures` saves. Whatever
a run lacks (theory, radii, charges, fields, an energy table, more than one frame) is left out of
the pictures, and the pictures say so.

No formula of physics stands here: what is expected comes from :mod:`lammps_blast.theory`.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import colormaps, rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import ListedColormap, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from lammps_blast import theory
from lammps_blast.analysis import EQUAL_TOLERANCE, SpheroidTheory

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses, Check

DPI = 200
# Width of a figure in inches: one that spans a page of a journal, and one that spans a column.
PAGE, COLUMN = 7.2, 4.5

INSTANTS = 6
# More particles than this in one panel only cover each other.
MAX_DRAWN = 3000
ARROWS = 160
TRACKED_SHOWN = 3
# A curve through fewer frames a turn than this does not show the turn, but an alias of it.
RESOLVED_FRAMES_PER_TURN = 8.0
# Points of an exact curve a turn, and how many turns are legible in one panel.
POINTS_PER_TURN = 24
LEGIBLE_TURNS = 20.0
MAX_CURVE_POINTS = 6000
# Diameter in points (1/72 inch) below which a particle would not be seen.
SMALLEST_MARKER = 1.5
# Particles drawn so many times larger than they are are better called points.
MAX_ENLARGED = 1e3
# How much white the colour of the farthest particle is mixed with.
FADING = 0.3

# Colours that colour-blind readers tell apart (Okabe and Ito); line styles differ as well.
BLUE, ORANGE, GREEN, PURPLE, GREY = "#0072B2", "#D55E00", "#009E73", "#AA4499", "#777777"
# From the navy blue to the orange of plasma: its yellow end is lost on white paper.
SPEED_COLOURS = ListedColormap(colormaps["plasma"](np.linspace(0.02, 0.8, 256)), "speed")

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


def draw_figures(analyses: Analyses, folder: Path) -> None:
    """Draw every figure of a run into a folder, as PNG files.

    `cloud.png`, `velocities.png`, `semi_axes.png`, `energy.png`, and `cloud_charges.png` for a
    cloud of both positive and negative particles.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    figures: dict[str, Callable[[Analyses], Figure]] = {
        "cloud": cloud_figure,
        "velocities": velocity_figure,
        "semi_axes": semi_axis_figure,
        "energy": energy_figure,
    }
    if _has_both_charges(analyses):
        figures["cloud_charges"] = charge_figure
    for name, figure in figures.items():
        _save(figure(analyses), folder / f"{name}.png")


def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    with warnings.catch_warnings():
        # A title may hold characters that the font lacks; they become boxes, which is no news.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(path, dpi=DPI, format="png")


# --- the cloud at several instants ----------------------------------------------------------


@rc_context(STYLE)
def cloud_figure(analyses: Analyses) -> Figure:
    """Draw the cloud at several instants, coloured by speed (the paper's figures 5 and 7)."""
    return _cloud_panels(analyses, _SpeedPaint.of(analyses))


@rc_context(STYLE)
def charge_figure(analyses: Analyses) -> Figure:
    """Draw the cloud at several instants, coloured by the sign of the charges."""
    return _cloud_panels(analyses, _ChargePaint(analyses.cloud.turning_sense))


def _cloud_panels(analyses: Analyses, paint: _SpeedPaint | _ChargePaint) -> Figure:
    snapshots = [_Snapshot.of(analyses, frame) for frame in _instants(analyses)]
    camera = _Camera.facing(analyses.axis)
    scene = _Scene.around(snapshots)
    cells, figure = _grid_of_cells(len(snapshots), scene.projected_size(camera))
    drawn = _drawn(analyses)
    clock = _Unit.of(snapshots[-1].time, "s")
    enlarged = 1.0

    for cell, snapshot in zip(cells, snapshots, strict=True):
        axes = _open_scene(figure, cell, scene, camera)
        enlarged = max(enlarged, _draw_particles(axes, snapshot, drawn, scene, camera, paint))
        _draw_spheroid(axes, snapshot, scene, camera)
        _draw_fields(figure, cell, analyses, camera)
        _name_panel(figure, cell, f"t = {clock.show(snapshot.time, snapshots[-1].time)}")

    paint.draw_key(figure, (0.5 * PAGE - 1.5, 0.42, 3.0, 0.09))
    _write_head(figure, analyses)
    _write_foot(figure, *_cloud_remarks(analyses, snapshots, drawn, enlarged))
    return figure


def _cloud_remarks(
    analyses: Analyses, snapshots: Sequence[_Snapshot], drawn: np.ndarray, enlarged: float
) -> Iterator[str]:
    count = len(analyses.cloud.mass)
    if len(drawn) < count:
        yield f"{len(drawn)} of {count} particles drawn"
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
class _Spheroid:
    """A spheroid about `axis` (a unit vector); lengths in m."""

    centre: np.ndarray
    axis: np.ndarray
    along: float
    across: float

    @property
    def half_widths(self) -> np.ndarray:
        """Return half of its size along x, y and z (3,), m."""
        share = self.axis**2
        return np.sqrt(self.along**2 * share + self.across**2 * (1.0 - share))

    def wires(self, meridians: int = 8, parallels: int = 7) -> Iterator[np.ndarray]:
        """Yield curves on it as unit vectors (P, 3), the pole along z."""
        turn, half_turn = np.linspace(0.0, 2.0 * np.pi, 61), np.linspace(0.0, np.pi, 31)
        for longitude in np.linspace(0.0, 2.0 * np.pi, meridians, endpoint=False):
            yield _on_unit_sphere(half_turn, np.full_like(half_turn, longitude))
        for colatitude in np.linspace(0.0, np.pi, parallels + 2)[1:-1]:
            yield _on_unit_sphere(np.full_like(turn, colatitude), turn)


def _on_unit_sphere(colatitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    ring = np.sin(colatitude)
    return np.stack(
        [ring * np.cos(longitude), ring * np.sin(longitude), np.cos(colatitude)], axis=-1
    )


@dataclass(frozen=True)
class _Snapshot:
    """What is drawn of one frame: arrays of shape (N, 3) and (N,), SI units."""

    time: float
    position: np.ndarray
    velocity: np.ndarray
    radius: np.ndarray | None
    spheroid: _Spheroid | None

    @classmethod
    def of(cls, analyses: Analyses, frame: int) -> _Snapshot:
        ts = analyses.universe.trajectory[frame]
        position, velocity = ts.data["position"], ts.data["velocity"]
        return cls(
            float(ts.time), position, velocity, analyses.cloud.radius, _spheroid(analyses, frame)
        )

    @property
    def finite(self) -> np.ndarray:
        """Tell which particles have a place (N,); a diverged run may hold NaN."""
        return np.isfinite(self.position).all(axis=1) & np.isfinite(self.velocity).all(axis=1)


def _spheroid(analyses: Analyses, frame: int) -> _Spheroid | None:
    """Return the exact spheroid of a frame, or None where there is not one."""
    results, expected, case = analyses.envelope.results, analyses.expected, analyses.case
    if case is None or not isinstance(expected, SpheroidTheory):
        return None
    if any(case.fields.electric) and not _moves_as_one(analyses):
        return None
    along, across = expected.semi_axes(results.launch_radius, results.times[frame : frame + 1])
    numbers = [*results.centre[frame], along[0], across[0]]
    if not np.isfinite(numbers).all():
        return None
    return _Spheroid(results.centre[frame], analyses.axis, float(along[0]), float(across[0]))


def _moves_as_one(analyses: Analyses) -> bool:
    """Tell whether an electric field moves all particles alike, so that they share a centre."""
    cloud = analyses.cloud
    if cloud.charge is None:
        return False
    charge_per_mass = cloud.charge / cloud.mass
    return bool(np.ptp(charge_per_mass) <= EQUAL_TOLERANCE * _largest(charge_per_mass))


def _has_both_charges(analyses: Analyses) -> bool:
    charge = analyses.cloud.charge
    return charge is not None and bool((charge < 0.0).any() and (charge > 0.0).any())


def _instants(analyses: Analyses, wanted: int = INSTANTS) -> list[int]:
    """Return frames, first and last included, spread evenly over time and over growth.

    Half of the spread goes with time and half with the change of the cloud's size: frames of a
    cloud that grows steadily are evenly spaced in time, and a cloud that comes to rest early is not
    shown at rest five times.
    """
    results = analyses.envelope.results
    growth = np.nan_to_num(np.abs(np.diff(results.blast_radius, prepend=results.blast_radius[0])))
    progress = _from_0_to_1(results.times) + _from_0_to_1(np.cumsum(growth))
    targets = np.linspace(0.0, progress[-1], wanted)
    nearest = {int(np.abs(progress - target).argmin()) for target in targets}
    return sorted(nearest | {0, len(progress) - 1})


def _from_0_to_1(values: np.ndarray) -> np.ndarray:
    """Return values with the smallest moved to 0 and the largest to 1; zeros if all are equal."""
    if len(values) == 0 or not 0.0 < (span := np.ptp(values)) < np.inf:
        return np.zeros(len(values))
    return (values - values.min()) / span


def _drawn(analyses: Analyses, most: int = MAX_DRAWN) -> np.ndarray:
    """Return indices of the particles that are drawn, the same ones in every panel."""
    count = len(analyses.cloud.mass)
    if count <= most:
        return np.arange(count)
    # At random, because the order of particles may follow their places.
    return np.sort(np.random.default_rng(0).choice(count, most, replace=False))


@dataclass(frozen=True)
class _SpeedPaint:
    """Colours by speed, on a scale from zero, so that a colour tells how large the speed is."""

    unit: _Unit
    smallest: float
    largest: float

    @classmethod
    def of(cls, analyses: Analyses) -> _SpeedPaint:
        results = analyses.speeds.results
        slow, fast = results.smallest, results.largest
        largest = float(np.max(fast, initial=0.0, where=np.isfinite(fast)))
        smallest = float(np.min(slow, initial=largest, where=np.isfinite(slow)))
        return cls(_Unit.of(largest, "m/s"), smallest, largest)

    @property
    def mappable(self) -> ScalarMappable:
        """Return the scale, in the unit in which it is shown."""
        top = self.largest / self.unit.size if self.largest > 0.0 else 1.0
        return ScalarMappable(Normalize(0.0, top), SPEED_COLOURS)

    def colours(self, snapshot: _Snapshot, drawn: np.ndarray) -> np.ndarray:
        """Return a colour for each drawn particle, shape (D, 4)."""
        speed = np.linalg.norm(snapshot.velocity[drawn], axis=1)
        return self.mappable.to_rgba(speed / self.unit.size)

    def draw_key(self, figure: Figure, place: Sequence[float]) -> None:
        """Draw the colour bar, with the range of this run, at left, bottom, width, height (in)."""
        axes = _add_axes(figure, place)
        bar = figure.colorbar(self.mappable, cax=axes, orientation="horizontal")
        bar.outline.set_linewidth(0.4)
        bar.locator = MaxNLocator(6)
        axes.tick_params(width=0.4, length=2.0)
        low, high = (f"{speed / self.unit.size:#.4g}" for speed in (self.smallest, self.largest))
        span = f"always {low}" if low == high else f"from {low} to {high}"
        if self.smallest < 1e-3 * self.largest:
            span = f"up to {high}"
        axes.set_title(f"speed ({self.unit.name}); in this run {span}", pad=2.5, fontsize=7.0)


@dataclass(frozen=True)
class _ChargePaint:
    """Two colours, for positive and for negative particles; `sense` (N,) is +1 or -1."""

    sense: np.ndarray

    def colours(self, snapshot: _Snapshot, drawn: np.ndarray) -> np.ndarray:
        """Return a colour for each drawn particle, shape (D, 4)."""
        scale = ScalarMappable(Normalize(-1.0, 1.0), ListedColormap([BLUE, "#F0A030"]))
        return scale.to_rgba(self.sense[drawn])

    def draw_key(self, figure: Figure, place: Sequence[float]) -> None:
        """Draw the legend into left, bottom, width, height (in)."""
        axes = _add_axes(figure, place)
        axes.set_axis_off()
        handles = [
            Line2D([], [], marker="o", linestyle="none", color=colour, label=label, markersize=5.0)
            for colour, label in (("#F0A030", "positive charge"), (BLUE, "negative charge"))
        ]
        axes.legend(handles=handles, ncols=2, loc="center")


# --- velocities -----------------------------------------------------------------------------


@rc_context(STYLE)
def velocity_figure(analyses: Analyses) -> Figure:
    """Draw velocity vectors, and velocities of a few particles against time (figure 6)."""
    figure = Figure(figsize=(PAGE, 5.0))
    paint = _SpeedPaint.of(analyses)
    camera = _Camera.facing(analyses.axis)
    frames = _moving_instants(analyses)
    height = 3.9 / len(frames)
    last = float(analyses.speeds.results.times[-1])
    clock = _Unit.of(last, "s")
    for row, frame in enumerate(frames):
        cell = (0.05, 4.62 - (row + 1) * height, 3.35, height - 0.05)
        snapshot = _Snapshot.of(analyses, frame)
        scene = _Scene.around([snapshot])
        longest = 0.2 * float(np.median(scene.size))
        scene = scene.widened(longest)
        axes = _open_scene(figure, cell, scene, camera)
        _draw_arrows(axes, snapshot, _drawn(analyses, ARROWS), longest, scene, paint)
        _draw_fields(figure, cell, analyses, camera)
        _name_panel(figure, cell, f"t = {clock.show(snapshot.time, last)}")
    paint.draw_key(figure, (0.45, 0.42, 2.6, 0.09))

    columns = _stack(figure, (4.15, 0.5, 2.9, 3.72), 3)
    _draw_velocities(columns, analyses)
    _write_head(figure, analyses)
    _write_foot(figure, *_arrow_remarks(analyses))
    return figure


def _arrow_remarks(analyses: Analyses) -> Iterator[str]:
    count = len(analyses.cloud.mass)
    if count > ARROWS:
        yield f"velocities of {ARROWS} of {count} particles"
    yield "arrows to one scale within a panel"


def _moving_instants(analyses: Analyses) -> list[int]:
    """Return the first frame, and the last in which the cloud still moves visibly."""
    speed = np.nan_to_num(analyses.speeds.results.rms)
    moving = np.flatnonzero(speed >= 0.3 * speed.max(initial=0.0))
    return sorted({0, int(moving[-1])})


def _draw_arrows(
    axes: Axes3D, snapshot: _Snapshot, drawn: np.ndarray, longest: float, scene: _Scene,
    paint: _SpeedPaint,
) -> None:  # fmt: skip
    """Draw velocities as arrows from the particles; the longest one is `longest` (m) long."""
    drawn = drawn[snapshot.finite[drawn]]
    tail, velocity = snapshot.position[drawn], snapshot.velocity[drawn]
    speed = np.linalg.norm(velocity, axis=1)
    axes.scatter(*scene.shown(tail).T, s=1.5, color="0.45", depthshade=False, linewidths=0.0)
    moves = speed > 0.0
    if not moves.any():
        return
    arrows = longest * velocity[moves] / speed.max() / scene.unit.size
    shafts = paint.colours(snapshot, drawn[moves])
    axes.quiver(
        *scene.shown(tail[moves]).T,
        *arrows.T,
        # matplotlib draws all shafts, then the one stroke of all heads, then the other.
        colors=np.tile(shafts, (3, 1)),
        arrow_length_ratio=0.3,
        linewidths=0.8,
    )


def _draw_velocities(panels: Sequence[Axes], analyses: Analyses) -> None:
    results = analyses.speeds.results
    sampling = _Sampling.of(analyses)
    window = sampling.legible(results.times)
    shown = _shown_tracks(analyses)
    clock = _Unit.of(float(window[-1]), "s")
    directions, names = _components(analyses)
    measured = results.tracked_velocity[: len(window)][:, shown] @ directions.T
    unit = _Unit.of(_largest(measured), "m/s")
    curve_times = sampling.curve_times(window)
    exact = None if curve_times is None else _exact_velocities(analyses, shown, curve_times)
    top = max(_largest(measured), 0.0 if exact is None else _largest(exact)) / unit.size or 1.0
    every = max(1, len(window) // 200)

    for component, (axes, name) in enumerate(zip(panels, names, strict=True)):
        for place, (colour, mark, style) in enumerate(_track_styles(len(shown))):
            if exact is not None:
                curve = exact[:, place] @ directions[component] / unit.size
                axes.plot(curve_times / clock.size, curve, style, color=colour, linewidth=0.6)
            joined = style if exact is None and sampling.resolved else "none"
            axes.plot(
                window / clock.size, measured[:, place, component] / unit.size, mark,
                linestyle=joined, color=colour, markersize=1.9, markevery=every,
            )  # fmt: skip
        axes.axhline(0.0, color="0.8", linewidth=0.5, zorder=0)
        axes.set_ylabel(f"{name} ({unit.name})")
        axes.set_ylim(-1.08 * top, 1.08 * top)
    _finish_stack(panels, clock, window)
    _put_track_legend(panels[0], analyses, shown, exact is not None or sampling.resolved)
    remark = sampling.remark(exact is not None)
    if len(window) < len(results.times):
        turns = results.times[-1] / sampling.period
        remark += f"\nfirst {LEGIBLE_TURNS:.0f} of {turns:.4g} turns"
    panels[0].set_title(remark, loc="left", fontsize=6.5, pad=16.0, color="0.25")


def _track_styles(count: int) -> Sequence[tuple[str, str, str]]:
    return [(BLUE, "o", "-"), (ORANGE, "s", "--"), (GREEN, "^", "-.")][:count]


def _put_track_legend(axes: Axes, analyses: Analyses, shown: Sequence[int], lines: bool) -> None:
    ids = analyses.universe.trajectory[0].data.get("id")
    handles = []
    for track, (colour, mark, style) in zip(shown, _track_styles(len(shown)), strict=True):
        particle = analyses.tracked[track]
        label = f"particle {particle + 1 if ids is None else ids[particle]}"
        if _has_both_charges(analyses):
            label += " (+)" if analyses.cloud.turning_sense[particle] > 0.0 else " (−)"
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
    shown = list(range(min(TRACKED_SHOWN, len(sense))))
    others = np.flatnonzero(sense != sense[0])
    if len(others) and others[0] not in shown:
        shown[-1] = int(others[0])
    return shown


def _exact_velocities(
    analyses: Analyses, shown: Sequence[int], times: np.ndarray
) -> np.ndarray | None:
    """Return exact velocities (T, len(shown), 3) in m/s, None where theory has none.

    Drag that depends on speed alone only shortens the velocity that the fields turn; where there is
    an electric field, the theorem holds without drag, and the shortening is by one.
    """
    case, cloud, expected = analyses.case, analyses.cloud, analyses.expected
    if case is None or cloud.charge is None or not isinstance(expected, SpheroidTheory):
        return None
    results = analyses.speeds.results
    particles = [analyses.tracked[track] for track in shown]
    elapsed = times - results.times[0]
    launch = results.tracked_velocity[0, shown]
    charge_per_mass = cloud.charge[particles] / cloud.mass[particles]
    _, turned = theory.lorentz_orbit(
        elapsed[:, None],
        np.zeros_like(launch),
        launch,
        charge_per_mass,
        case.fields.electric,
        case.fields.magnetic,
    )
    return turned * (expected.speeds(elapsed) / expected.speed)[:, None, None]


def _components(analyses: Analyses) -> tuple[np.ndarray, list[str]]:
    """Return three directions, a row each, the first along the axis, and the components' names."""
    main = int(np.argmax(np.abs(analyses.axis)))
    if abs(analyses.axis[main]) == 1.0:
        order = [main, (main + 1) % 3, (main + 2) % 3]
        return np.eye(3)[order], [f"$v_{'xyz'[i]}$" for i in order]
    across = np.cross(np.eye(3)[np.argmin(np.abs(analyses.axis))], analyses.axis)
    across /= np.linalg.norm(across)
    directions = np.stack([analyses.axis, across, np.cross(analyses.axis, across)])
    return directions, [r"$v_\parallel$", r"$v_{\perp 1}$", r"$v_{\perp 2}$"]


@dataclass(frozen=True)
class _Sampling:
    """How frames sample a turn, in s; the period is infinite without turns, NaN if unknown."""

    period: float
    interval: float

    @classmethod
    def of(cls, analyses: Analyses) -> _Sampling:
        times = analyses.speeds.results.times
        interval = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        return cls(_period(analyses), interval)

    @property
    def frames_per_turn(self) -> float:
        """Return frames a turn; infinite without turns, NaN if unknown."""
        return self.period * (1.0 / self.interval if self.interval > 0.0 else np.inf)

    @property
    def resolved(self) -> bool:
        """Tell whether a line from frame to frame shows the turns; False if that is unknown."""
        return self.frames_per_turn >= RESOLVED_FRAMES_PER_TURN

    def legible(self, times: np.ndarray) -> np.ndarray:
        """Return the leading times that hold as many turns as can be read in one panel."""
        if not self.frames_per_turn >= 2.0:
            return times
        return times[times - times[0] <= LEGIBLE_TURNS * self.period]

    def curve_times(self, times: np.ndarray) -> np.ndarray | None:
        """Return times (s) for a smooth curve; None if there are too many turns to draw one."""
        span = float(times[-1] - times[0])
        points = 400 + (POINTS_PER_TURN * span / self.period if self.period > 0.0 else 0.0)
        if not points <= MAX_CURVE_POINTS:
            return None
        return np.linspace(times[0], times[-1], int(points)) if span > 0.0 else times

    def remark(self, exact: bool) -> str:
        """Return what a reader must know about the sampling."""
        lines = "markers: frames of the run" + ("; lines: exact" if exact else "")
        if not self.resolved:
            return f"{lines}\n{self.warning}"
        if not np.isfinite(self.frames_per_turn):
            return lines
        return f"{lines}; {self.frames_per_turn:.3g} frames a turn"

    @property
    def warning(self) -> str:
        """Return why frames are not joined by lines, where they are not resolved."""
        if np.isnan(self.period):
            return "period of a turn unknown: markers are not joined"
        return f"only {self.frames_per_turn:.2g} frames a turn: too few to join the markers"


def _period(analyses: Analyses) -> float:
    """Return the shortest period of gyration (s), infinite without one, NaN if unknown."""
    case, cloud = analyses.case, analyses.cloud
    if case is None:
        return np.nan
    if not any(case.fields.magnetic):
        return np.inf
    if cloud.charge is None:
        return np.nan
    frequency = theory.cyclotron_frequency(cloud.charge / cloud.mass, case.fields.magnetic)
    return float(np.min(theory.cyclotron_period(frequency)))


# --- semi-axes ------------------------------------------------------------------------------


@rc_context(STYLE)
def semi_axis_figure(analyses: Analyses) -> Figure:
    """Draw the semi-axes of the envelope against time, and how far they are from exact."""
    figure = Figure(figsize=(COLUMN, 5.4))
    panels = _stack(figure, (0.72, 0.55, COLUMN - 0.9, 4.5), 3)
    times = analyses.envelope.results.times
    clock = _Unit.of(float(times[-1]), "s")
    _draw_semi_axes(panels[0], panels[1], analyses, clock)
    _draw_deviations(panels[2], analyses, clock)
    _finish_stack(panels, clock, times)
    _write_head(figure, analyses)
    _write_foot(figure, *_semi_axis_remarks(analyses))
    return figure


def _semi_axis_remarks(analyses: Analyses) -> Iterator[str]:
    sampling = _Sampling.of(analyses)
    if not isinstance(analyses.expected, SpheroidTheory):
        yield f"no exact spheroid: {analyses.expected}"
    if np.isnan(analyses.envelope.results.semi_axis_parallel).all():
        yield "too few particles for a fit"
    if not sampling.resolved:
        yield sampling.warning


def _draw_semi_axes(along: Axes, across: Axes, analyses: Analyses, clock: _Unit) -> None:
    results, expected = analyses.envelope.results, analyses.expected
    sampling = _Sampling.of(analyses)
    measured = [results.semi_axis_parallel, results.semi_axis_perpendicular]
    extents = [results.extent_parallel, results.extent_perpendicular]
    unit = _Unit.of(max(_largest(values) for values in (*measured, *extents)), "m")
    curve_times = sampling.curve_times(results.times)
    exact, style = None, {"linestyle": "-"}
    if curve_times is None:
        curve_times, style = results.times, {"linestyle": "none", "marker": "+"}
    if isinstance(expected, SpheroidTheory):
        exact = expected.semi_axes(results.launch_radius, curve_times)
    every = max(1, len(results.times) // 60)
    seconds = results.times / clock.size
    axis = _axis_name(analyses)

    for i, (axes, where, colour) in enumerate(((along, "along", BLUE), (across, "across", ORANGE))):
        if exact is not None:
            axes.plot(
                curve_times / clock.size, exact[i] / unit.size, color=colour, **style,
                label="exact spheroid",
            )  # fmt: skip
        axes.plot(
            seconds, measured[i] / unit.size, "o", color=colour, markerfacecolor="white",
            markeredgewidth=0.7, markevery=every, label="fitted to all particles",
        )  # fmt: skip
        axes.plot(
            seconds, extents[i] / unit.size, color="0.25", linewidth=0.7, markersize=1.5,
            linestyle="--" if sampling.resolved else "none",
            marker="none" if sampling.resolved and len(seconds) > 1 else ".",
            label="outermost particle centre",
        )  # fmt: skip
        axes.set_ylabel(f"{where} {axis} ({unit.name})")
    along.legend(loc="best")


def _draw_deviations(axes: Axes, analyses: Analyses, clock: _Unit) -> None:
    results, expected = analyses.envelope.results, analyses.expected
    seconds = results.times / clock.size
    curves = {}
    size = _largest(results.blast_radius)
    if isinstance(expected, SpheroidTheory):
        along, across = expected.semi_axes(results.launch_radius, results.times)
        size = max(_largest(along), _largest(across))
        curves["along"] = (np.abs(results.semi_axis_parallel - along), BLUE, "o")
        curves["across"] = (
            np.abs(results.semi_axis_perpendicular - across), ORANGE, "s",
        )  # fmt: skip
    curves["worst particle off the fit"] = (results.fit_residual, GREY, "x")
    relative = {name: (v / (size or 1.0), *rest) for name, (v, *rest) in curves.items()}
    _draw_magnitudes(axes, seconds, relative, analyses.checks.get("semi_axis_parallel"))
    axes.set_ylabel("deviation / size")


# --- energy ---------------------------------------------------------------------------------


@rc_context(STYLE)
def energy_figure(analyses: Analyses) -> Figure:
    """Draw the energy ledger against time: energies, what was exchanged, what is missing."""
    if analyses.ledger is None:
        return _kinetic_energy_figure(analyses)
    ledger = analyses.ledger
    figure = Figure(figsize=(COLUMN, 5.4))
    panels = _stack(figure, (0.72, 0.55, COLUMN - 0.9, 4.5), 3)
    clock = _Unit.of(float(ledger.times[-1]), "s")
    seconds = ledger.times / clock.size
    joined = _energy_may_be_joined(analyses)
    _draw_energies(panels[0], seconds, ledger.kinetic, ledger.rotational, joined)
    _draw_exchange(panels[1], analyses, seconds, joined)
    _draw_ledger_errors(panels[2], analyses, seconds)
    _finish_stack(panels, clock, ledger.times)
    _write_head(figure, analyses)
    if not joined:
        _write_foot(figure, _Sampling.of(analyses).warning)
    return figure


def _kinetic_energy_figure(analyses: Analyses) -> Figure:
    results = analyses.energy.results
    figure = Figure(figsize=(COLUMN, 2.8))
    panels = _stack(figure, (0.72, 0.55, COLUMN - 0.9, 1.9), 1)
    clock = _Unit.of(float(results.times[-1]), "s")
    joined = _energy_may_be_joined(analyses)
    _draw_energies(
        panels[0], results.times / clock.size, results.kinetic, results.rotational, joined
    )
    _finish_stack(panels, clock, results.times)
    _write_head(figure, analyses)
    _write_foot(figure, "from the trajectory; no energy table")
    return figure


def _energy_may_be_joined(analyses: Analyses) -> bool:
    """Tell whether a line through energies is honest: only an electric field makes them swing."""
    case = analyses.case
    swings = case is None or any(case.fields.electric) or any(case.medium.velocity)
    return not swings or _Sampling.of(analyses).resolved


def _draw_energies(
    axes: Axes, seconds: np.ndarray, kinetic: np.ndarray, rotational: np.ndarray, joined: bool
) -> None:
    unit = _Unit.of(max(_largest(kinetic), _largest(rotational)), "J")
    _plot_series(axes, seconds, kinetic / unit.size, BLUE, "-", "o", joined, "kinetic")
    if rotational.any():
        _plot_series(axes, seconds, rotational / unit.size, GREEN, "--", "^", joined, "rotational")
    axes.set_ylim(0.0, 1.15 * (max(_largest(kinetic), _largest(rotational)) / unit.size or 1.0))
    axes.set_ylabel(f"energy ({unit.name})")
    axes.legend(loc="best")


def _draw_exchange(axes: Axes, analyses: Analyses, seconds: np.ndarray, joined: bool) -> None:
    ledger = analyses.ledger
    assert ledger is not None
    change = ledger.kinetic + ledger.rotational - ledger.launch_energy
    accounts = [
        ("kinetic energy gained", change, BLUE, "-", "o"),
        ("work of E", ledger.electric_work, ORANGE, "-.", "s"),
        ("lost to drag", ledger.drag_loss, PURPLE, "--", "^"),
    ]
    unit = _Unit.of(max(_largest(values) for _, values, *_ in accounts), "J")
    for name, values, colour, style, mark in accounts:
        if values.any():
            _plot_series(axes, seconds, values / unit.size, colour, style, mark, joined, name)
    if axes.lines and change.any():
        # What is gained can be hidden behind the work that it comes from.
        axes.lines[0].set(markersize=5.0, markerfacecolor="white")
    axes.axhline(0.0, color="0.8", linewidth=0.5, zorder=0)
    axes.set_ylabel(f"since launch ({unit.name})")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="best")


def _plot_series(
    axes: Axes, x: np.ndarray, y: np.ndarray, colour: str, style: str, mark: str, joined: bool,
    label: str,
) -> None:  # fmt: skip
    axes.plot(
        x, y, color=colour, linestyle=style if joined else "none", marker=mark, markersize=2.4,
        markevery=max(1, len(x) // 40) if joined else 1, label=label,
    )  # fmt: skip


def _draw_ledger_errors(axes: Axes, analyses: Analyses, seconds: np.ndarray) -> None:
    ledger = analyses.ledger
    assert ledger is not None
    scale, name = ledger.launch_energy, "launch energy"
    if not scale > 0.0:
        scale, name = _largest(ledger.kinetic + ledger.rotational), "largest energy"
    if not scale > 0.0:
        scale, name = 1.0, "1 J"
    curves = {
        "missing from the ledger": (np.abs(ledger.residual) / scale, BLUE, "o"),
        "magnetic work": (np.abs(ledger.magnetic_work) / scale, ORANGE, "s"),
    }
    _draw_magnitudes(axes, seconds, curves, analyses.checks.get("energy_ledger"))
    axes.set_ylabel(f"error / {name}")


# --- what several figures share -------------------------------------------------------------


@dataclass(frozen=True)
class _Unit:
    """A unit with a prefix; `size` is its value in the SI unit."""

    size: float
    name: str

    @classmethod
    def of(cls, largest: float, name: str) -> _Unit:
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


def _largest(values: np.ndarray) -> float:
    """Return the largest finite magnitude, zero if there is none."""
    values = np.abs(values)
    return float(np.max(values, initial=0.0, where=np.isfinite(values)))


def _axis_name(analyses: Analyses) -> str:
    """Return what the axis of the envelope is called: B, or its direction if there is no B."""
    case = analyses.case
    if case is not None and any(case.fields.magnetic):
        return "B"
    main = int(np.argmax(np.abs(analyses.axis)))
    if abs(analyses.axis[main]) == 1.0:
        return "xyz"[main]
    return "({})".format(", ".join(f"{part:.2g}" for part in analyses.axis))


def _add_axes(figure: Figure, place: Sequence[float], **options: Any) -> Any:
    """Add axes at left, bottom, width, height in inches."""
    width, height = figure.get_size_inches()
    left, bottom, wide, high = place
    return figure.add_axes((left / width, bottom / height, wide / width, high / height), **options)


def _stack(figure: Figure, place: Sequence[float], count: int, gap: float = 0.24) -> list[Axes]:
    """Add panels above each other, with one time axis, into left, bottom, width, height (in)."""
    left, bottom, width, height = place
    high = (height - gap * (count - 1)) / count
    panels: list[Axes] = []
    for row in range(count):
        low = bottom + (count - 1 - row) * (high + gap)
        share = {"sharex": panels[0]} if panels else {}
        panels.append(_add_axes(figure, (left, low, width, high), **share))
    figure.align_ylabels(panels)
    return panels


def _finish_stack(panels: Sequence[Axes], clock: _Unit, times: np.ndarray) -> None:
    for axes in panels[:-1]:
        axes.tick_params(labelbottom=False)
    panels[-1].set_xlabel(f"time ({clock.name})")
    first, last = times[0] / clock.size, times[-1] / clock.size
    if last > first:
        room = 0.02 * (last - first)
        panels[0].set_xlim(first - room, last + room)


def _draw_magnitudes(
    axes: Axes, seconds: np.ndarray, curves: dict[str, tuple[np.ndarray, str, str]],
    check: Check | None,
) -> None:  # fmt: skip
    """Plot magnitudes (name: values, colour, marker) on a log axis; zeros have no place there."""
    nothing = []
    every = max(1, len(seconds) // 150)
    for name, (values, colour, mark) in curves.items():
        positive = np.where(np.isfinite(values) & (values > 0.0), values, np.nan)
        if np.isfinite(positive).any():
            axes.plot(
                seconds, positive, mark, color=colour, markersize=2.2, markeredgewidth=0.6,
                markevery=every, label=name,
            )  # fmt: skip
        else:
            known = np.isfinite(values).any()
            nothing.append(f"{name}: {'exactly zero' if known else 'unknown'}")
    axes.set_yscale("log")
    axes.margins(y=0.12)
    if check is not None:
        label = f"limit {check.limit:.0e}"
        axes.axhline(check.limit, color="black", linestyle=":", linewidth=0.9, label=label)
    if len(nothing) == len(curves):
        axes.set_yticks([], minor=False)
        axes.set_yticks([], minor=True)
        axes.text(0.02, 0.05, "\n".join(nothing), transform=axes.transAxes, fontsize=7.0)
    elif nothing:
        text = "; ".join(nothing)
        axes.text(1.0, 1.03, text, transform=axes.transAxes, fontsize=7.0, ha="right")
    handles, labels = axes.get_legend_handles_labels()
    if handles:
        # Above the panel: points may lie anywhere in it.
        axes.legend(
            handles, labels, ncols=len(handles), loc="lower left", bbox_to_anchor=(-0.02, 0.98),
            borderaxespad=0.0, columnspacing=1.2, handlelength=1.2, handletextpad=0.4,
        )  # fmt: skip


def _write_head(figure: Figure, analyses: Analyses) -> None:
    case = analyses.case
    title = (case.title if case else "") or analyses.name
    most = int(14.0 * figure.get_figwidth())
    if len(title) > most:
        title = title[: most - 1] + "…"
    height = figure.get_figheight()
    figure.text(
        0.5, 1.0 - 0.07 / height, title, ha="center", va="top", fontsize=9.0, parse_math=False
    )


def _write_foot(figure: Figure, *remarks: str) -> None:
    text = "; ".join(remarks)
    height = figure.get_figheight()
    figure.text(
        0.01, 0.05 / height, text, ha="left", va="bottom", fontsize=6.5, color="0.35",
        parse_math=False,
    )  # fmt: skip


# --- space ----------------------------------------------------------------------------------

# Inches of a cell beside and above the box in it, for ticks, labels and title.
SIDE_ROOM, END_ROOM = 0.95, 0.66

Cell = tuple[float, float, float, float]  # left, bottom, width, height in inches


@dataclass(frozen=True)
class _Camera:
    """An orthographic camera, degrees; equal lengths across the view are equal on paper."""

    azimuth: float
    elevation: float = 20.0

    @classmethod
    def facing(cls, axis: np.ndarray) -> _Camera:
        """Return a camera that sees `axis` from the side, a little from the front."""
        if np.hypot(axis[0], axis[1]) < 1e-6:
            return cls(-65.0)
        return cls(float(np.degrees(np.arctan2(axis[1], axis[0])) % 180.0) - 65.0)

    @property
    def toward(self) -> np.ndarray:
        """Return the unit vector from the scene to the camera (3,)."""
        azimuth, elevation = np.radians([self.azimuth, self.elevation])
        level = np.cos(elevation)
        return np.array([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])

    @property
    def right_and_up(self) -> np.ndarray:
        """Return the unit vectors that point right and up on paper, shape (2, 3)."""
        azimuth = np.radians(self.azimuth)
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        return np.stack([right, np.cross(self.toward, right)])


@dataclass(frozen=True)
class _Scene:
    """The box in space that a panel shows, in m, and the unit of its axes."""

    low: np.ndarray
    high: np.ndarray
    unit: _Unit

    @classmethod
    def around(cls, snapshots: Sequence[_Snapshot]) -> _Scene:
        """Return a scene that holds all particles and spheroids."""
        corners = np.concatenate([_corners(snapshot) for snapshot in snapshots])
        low, high = corners.min(axis=0), corners.max(axis=0)
        size = (high - low).max() or max(np.abs(corners).max(), 1.0)
        # No side is so thin that its ticks have no place.
        half = 0.5 * np.maximum(high - low, 0.25 * size)
        middle = 0.5 * (low + high)
        return cls(middle - half, middle + half, _Unit.of(0.5 * size, "m"))

    def widened(self, room: float) -> _Scene:
        """Return the scene with `room` (m) added on every side."""
        return _Scene(self.low - room, self.high + room, self.unit)

    @property
    def size(self) -> np.ndarray:
        """Return the lengths of the sides (3,), m."""
        return self.high - self.low

    def shown(self, position: np.ndarray) -> np.ndarray:
        """Return positions in the unit of the axes."""
        return position / self.unit.size

    def projected_size(self, camera: _Camera) -> np.ndarray:
        """Return width and height on paper (2,), m."""
        return np.abs(camera.right_and_up) @ self.size


def _corners(snapshot: _Snapshot) -> np.ndarray:
    position = snapshot.position[snapshot.finite]
    if len(position) == 0:
        return np.zeros((1, 3))
    radius = 0.0 if snapshot.radius is None else snapshot.radius[snapshot.finite][:, None]
    corners = [(position - radius).min(axis=0), (position + radius).max(axis=0)]
    if snapshot.spheroid:
        centre, half = snapshot.spheroid.centre, snapshot.spheroid.half_widths
        corners += [centre - half, centre + half]
    return np.array(corners)


def _grid_of_cells(count: int, projected_size: np.ndarray) -> tuple[list[Cell], Figure]:
    """Return cells, from left to right and top to bottom, and a figure that they fit in."""
    aspect = float(np.clip(projected_size[1] / projected_size[0], 0.35, 1.6))
    columns = min(count, 2 if aspect < 0.75 else 3)
    rows = -(-count // columns)
    width = PAGE / max(columns, 2)
    height = (width - SIDE_ROOM) * aspect + END_ROOM
    head, foot = 0.3, 0.85
    figure = Figure(figsize=(PAGE, head + rows * height + foot))
    left = 0.5 * (PAGE - columns * width)
    cells = []
    for place in range(count):
        row, column = divmod(place, columns)
        cells.append((left + column * width, foot + (rows - 1 - row) * height, width, height))
    return cells, figure


def _open_scene(figure: Figure, cell: Cell, scene: _Scene, camera: _Camera) -> Axes3D:
    """Add 3-D axes that show the scene, as large as the cell allows, with equal scales."""
    left, bottom, width, height = cell
    # matplotlib's 3-D axes are square and leave wide margins: they are placed so that the box in
    # them, not they themselves, fills the cell, and may reach under the neighbours.
    axes: Axes3D = _add_axes(
        figure, (left, bottom, width, width), projection="3d", computed_zorder=False
    )
    axes.set_proj_type("ortho")
    axes.view_init(elev=camera.elevation, azim=camera.azimuth)
    low, high = scene.shown(scene.low), scene.shown(scene.high)
    for name, start, stop in zip("xyz", low, high, strict=True):
        axes.set(**{f"{name}lim3d": (start, stop)})
    axes.set_box_aspect(high - low)
    axes.patch.set_visible(False)

    box = _box_on_paper(axes, low, high)
    free = np.array([width - SIDE_ROOM, height - END_ROOM])
    side = width * float(np.min(free / np.ptp(box, axis=0)))
    centre = np.array([left + 0.5 * width, bottom + 0.5 * height])
    centre -= [0.05, 0.0]  # the labels of the z axis stand on the right
    corner = centre - 0.5 * side
    size = figure.get_size_inches()
    axes.set_position((*(corner / size), *(side / size)))
    shift = centre - _box_on_paper(axes, low, high).mean(axis=0)
    axes.set_position((*((corner + shift) / size), *(side / size)))
    _style_box(axes, scene, camera)
    return axes


def _box_on_paper(axes: Axes3D, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the lower left and upper right corner of the projected box (2, 2), inches."""
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1)
    x, y, _ = proj3d.proj_transform(*corners, axes.get_proj())
    inches = axes.transData.transform(np.stack([x, y], axis=-1)) / axes.get_figure().dpi
    return np.stack([inches.min(axis=0), inches.max(axis=0)])


def _style_box(axes: Axes3D, scene: _Scene, camera: _Camera) -> None:
    """Make the box light, with as many ticks as have room on paper."""
    seen = np.linalg.norm(camera.right_and_up, axis=0) * scene.size
    inches = seen * _points_per_metre(axes, scene, camera) / 72.0
    low, high = scene.shown(scene.low), scene.shown(scene.high)
    share = scene.size / scene.size.max()
    for i, axis in enumerate((axes.xaxis, axes.yaxis, axes.zaxis)):
        axis.set_ticks(_ticks(low[i], high[i], inches[i]))
        axis.set_pane_color((0.97, 0.97, 0.97, 1.0))
        axis._axinfo["grid"].update(color="0.88", linewidth=0.4)
        axis._axinfo["tick"].update(inward_factor=0.0, outward_factor=0.15)
        axis.line.set(linewidth=0.5, color="0.4")
        axis.set_label_text(f"{'xyz'[i]} ({scene.unit.name})", fontsize=7.0)
        # matplotlib puts a label farther out the longer the other two sides are; this undoes it.
        axis.labelpad = -1.0 - 3.5 * (share.sum() - share[i]) - (2.0 if i == 2 else 0.0)
    axes.tick_params(labelsize=6.0, pad=-3.0)


def _ticks(low: float, high: float, inches: float) -> np.ndarray:
    """Return round values, away from the ends, where the labels of two axes would meet."""
    room = 0.07 * (high - low)
    low, high = low + room, high - room
    ticks = MaxNLocator(int(np.clip(inches / 0.4, 2, 5)), min_n_ticks=2).tick_values(low, high)
    return ticks[(ticks >= low) & (ticks <= high)]


def _draw_particles(
    axes: Axes3D, snapshot: _Snapshot, drawn: np.ndarray, scene: _Scene, camera: _Camera,
    paint: _SpeedPaint | _ChargePaint,
) -> float:  # fmt: skip
    """Draw particles as discs of their size, near ones over far ones; return how much enlarged."""
    drawn = drawn[snapshot.finite[drawn]]
    if snapshot.radius is None:
        diameter, enlarged = np.full(len(drawn), 2.5), 1.0
    else:
        true = 2.0 * snapshot.radius[drawn] * _points_per_metre(axes, scene, camera)
        diameter = np.maximum(true, SMALLEST_MARKER)
        enlarged = float(np.max(diameter / np.maximum(true, 1e-300), initial=1.0))
    fading = FADING * (1.0 - _from_0_to_1(snapshot.position[drawn] @ camera.toward))
    axes.scatter(
        *scene.shown(snapshot.position[drawn]).T,
        s=diameter**2,
        c=_faded(paint.colours(snapshot, drawn), fading),
        depthshade=False,
        edgecolors=_faded(np.tile([0.0, 0.0, 0.0, 1.0], (len(drawn), 1)), 0.3 + fading),
        linewidths=np.minimum(0.25, 0.1 * diameter),
        zorder=2.0,
    )
    return enlarged


def _faded(colours: np.ndarray, part: np.ndarray) -> np.ndarray:
    """Return colours (D, 4), opaque, mixed with parts (D,) of white."""
    faded = np.ones_like(colours)
    faded[:, :3] = 1.0 - (1.0 - colours[:, :3]) * (1.0 - part[:, None])
    return faded


def _points_per_metre(axes: Axes3D, scene: _Scene, camera: _Camera) -> float:
    box = _box_on_paper(axes, scene.shown(scene.low), scene.shown(scene.high))
    return float(72.0 * np.ptp(box, axis=0)[0] / scene.projected_size(camera)[0])


def _draw_spheroid(axes: Axes3D, snapshot: _Snapshot, scene: _Scene, camera: _Camera) -> None:
    """Draw the wires of the exact spheroid: those behind under the particles, the others over."""
    spheroid = snapshot.spheroid
    if spheroid is None:
        return
    frame = _frame_with_pole(spheroid.axis)
    stretch = np.array([spheroid.across, spheroid.across, spheroid.along])
    # Thinner wires on a small spheroid, which they would cover.
    inches = spheroid.across * _points_per_metre(axes, scene, camera) / 72.0
    near, far = [], []
    for wire in spheroid.wires():
        points = scene.shown(spheroid.centre + (wire * stretch) @ frame)
        normals = (wire / np.maximum(stretch, 1e-300)) @ frame
        faces = (normals[1:] + normals[:-1]) @ camera.toward > 0.0
        segments = np.stack([points[:-1], points[1:]], axis=1)
        near.append(segments[faces])
        far.append(segments[~faces])
    for segments, zorder, colour in ((far, 1.0, (0.6, 0.6, 0.6)), (near, 3.0, (0.0, 0.0, 0.0))):
        wires = Line3DCollection(
            np.concatenate(segments), colors=(*colour, 0.5), linewidths=min(0.4, inches)
        )
        wires.set_zorder(zorder)
        axes.add_collection3d(wires)


def _frame_with_pole(pole: np.ndarray) -> np.ndarray:
    """Return an orthonormal frame, a vector a row, the third one along `pole`."""
    first = np.cross(np.eye(3)[np.argmin(np.abs(pole))], pole)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(pole, first), pole])


def _name_panel(figure: Figure, cell: Cell, text: str) -> None:
    left, bottom, width, height = cell
    size = figure.get_size_inches()
    figure.text(
        (left + 0.5 * width) / size[0], (bottom + height - 0.04) / size[1], text, ha="center",
        va="top",
    )  # fmt: skip


def _draw_fields(figure: Figure, cell: Cell, analyses: Analyses, camera: _Camera) -> None:
    """Draw the directions of B and E, as the camera sees them, in the cell's upper left corner."""
    left, bottom, _, height = cell
    top = np.array([left + 0.15, bottom + height - 0.12])
    fields = _fields(analyses)
    if isinstance(fields, str):
        _write_at(figure, top, fields, ha="left")
        return
    tips = {name: 0.32 * camera.right_and_up @ field for name, field in fields.items()}
    left_of_root = min([0.0, *(tip[0] for tip in tips.values())])
    over_root = max([0.0, *(tip[1] for tip in tips.values())])
    root = top - [left_of_root, over_root]
    for name, tip in tips.items():
        _draw_arrow(figure, root, tip, name)


def _fields(analyses: Analyses) -> dict[str, np.ndarray] | str:
    """Return the directions of the fields that act, or why there are none."""
    if analyses.case is None:
        return "fields unknown"
    strength = {"B": analyses.case.fields.magnetic, "E": analyses.case.fields.electric}
    return {
        name: np.array(field) / np.linalg.norm(field)
        for name, field in strength.items()
        if any(field)
    } or "no field"


def _draw_arrow(figure: Figure, root: np.ndarray, tip: np.ndarray, name: str) -> None:
    """Draw a named arrow from `root` (in) to the `tip` relative to it; it may be of no length."""
    arrow = FancyArrowPatch(
        tuple(root), tuple(root + tip), arrowstyle="-|>", mutation_scale=7.0, shrinkA=0.0,
        shrinkB=0.0, linewidth=0.9, color="black", transform=figure.dpi_scale_trans,
    )  # fmt: skip
    figure.add_artist(arrow)
    length = np.linalg.norm(tip)
    beyond = tip / length if length > 0.0 else np.array([1.0, 0.0])
    _write_at(figure, root + tip + 0.09 * beyond, name, fontweight="bold")


def _write_at(figure: Figure, place: np.ndarray, text: str, **options: Any) -> None:
    options = {"ha": "center", "va": "center", "fontsize": 7.5} | options
    figure.text(*place, text, transform=figure.dpi_scale_trans, **options)
