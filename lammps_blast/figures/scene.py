"""Space on paper: a camera, boxes with equal scales, particles, wires and arrows in them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from matplotlib.ticker import MaxNLocator
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from lammps_blast.figures.style import PAGE, Place, Unit, add_axes, from_0_to_1, write_at

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# Inches of a panel beside and above the box in it, for ticks, labels and title.
SIDE_ROOM, END_ROOM = 0.95, 0.66
# Diameter in points (1/72 inch) below which a particle would not be seen.
SMALLEST_MARKER = 1.5
# How much white the colour of the farthest particle is mixed with.
FADING = 0.3


@dataclass(frozen=True)
class Camera:
    """An orthographic camera, degrees; equal lengths across the view are equal on paper."""

    azimuth: float
    elevation: float = 20.0

    @classmethod
    def facing(cls, axis: np.ndarray) -> Camera:
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
class Scene:
    """A box in space (m), the unit of its axes, and the camera that sees it."""

    low: np.ndarray
    high: np.ndarray
    unit: Unit
    camera: Camera

    @classmethod
    def around(cls, points: np.ndarray, camera: Camera) -> Scene:
        """Return a scene that holds points (P, 3)."""
        low, high = points.min(axis=0), points.max(axis=0)
        size = (high - low).max() or max(np.abs(points).max(), 1.0)
        # No side is so thin that its ticks have no place.
        half = 0.5 * np.maximum(high - low, 0.25 * size)
        middle = 0.5 * (low + high)
        return cls(middle - half, middle + half, Unit.of(0.5 * size, "m"), camera)

    def widened(self, room: float) -> Scene:
        """Return the scene with `room` (m) added on every side."""
        return replace(self, low=self.low - room, high=self.high + room)

    @property
    def size(self) -> np.ndarray:
        """Return the lengths of the sides (3,), m."""
        return self.high - self.low

    @property
    def projected_size(self) -> np.ndarray:
        """Return width and height on paper (2,), m."""
        return np.abs(self.camera.right_and_up) @ self.size

    def shown(self, position: np.ndarray) -> np.ndarray:
        """Return positions in the unit of the axes."""
        return position / self.unit.size


@dataclass(frozen=True)
class Panel:
    """3-D axes that show a scene; `inches` is the length of a metre on paper."""

    axes: Axes3D
    scene: Scene
    inches: float


@dataclass(frozen=True)
class Spheroid:
    """A spheroid about `axis` (a unit vector); lengths in m."""

    centre: np.ndarray
    axis: np.ndarray
    along: float
    across: float

    @property
    def corners(self) -> np.ndarray:
        """Return the lowest and the highest corner (2, 3) of the smallest box around it, m."""
        share = self.axis**2
        half_widths = np.sqrt(self.along**2 * share + self.across**2 * (1.0 - share))
        return self.centre + np.array([-half_widths, half_widths])


def grid_of_places(count: int, scene: Scene) -> tuple[Figure, list[Place]]:
    """Return a figure, and places for panels in it, from left to right and top to bottom."""
    aspect = _aspect(scene)
    columns = min(count, 2 if aspect < 0.75 else 3)
    rows = -(-count // columns)
    width = PAGE / max(columns, 2)
    height = (width - SIDE_ROOM) * aspect + END_ROOM + _label_room(scene)
    head, foot = 0.3, 0.85
    left = 0.5 * (PAGE - columns * width)
    places = []
    for number in range(count):
        row, column = divmod(number, columns)
        places.append((left + column * width, foot + (rows - 1 - row) * height, width, height))
    return Figure(figsize=(PAGE, head + rows * height + foot)), places


def _aspect(scene: Scene) -> float:
    return float(np.clip(scene.projected_size[1] / scene.projected_size[0], 0.35, 1.6))


def _label_room(scene: Scene) -> float:
    """Return by how much farther down (in) labels of the lower axes of a tall scene stand."""
    return 0.45 * max(0.0, _aspect(scene) - 1.0)


def open_panel(figure: Figure, place: Place, scene: Scene, analyses: Analyses, title: str) -> Panel:
    """Add a panel that shows a scene, as large as its place allows, with the fields' directions."""
    left, bottom, width, height = place
    axes: Axes3D = add_axes(
        figure, (left, bottom, width, width), projection="3d", computed_zorder=False
    )
    axes.set_proj_type("ortho")
    axes.view_init(elev=scene.camera.elevation, azim=scene.camera.azimuth)
    low, high = scene.shown(scene.low), scene.shown(scene.high)
    axes.set(xlim3d=(low[0], high[0]), ylim3d=(low[1], high[1]), zlim3d=(low[2], high[2]))
    axes.set_box_aspect(high - low)
    axes.patch.set_visible(False)

    # matplotlib's 3-D axes are square and leave wide margins: they are placed so that the box in
    # them, not they themselves, fills the place, and may reach under the neighbours.
    corners = np.array(np.meshgrid(*zip(low, high, strict=True))).reshape(3, -1)
    x, y, _ = proj3d.proj_transform(*corners, axes.get_proj())
    box = axes.transLimits.transform(np.stack([x, y], axis=-1))
    labels = _label_room(scene)
    side = float(np.min([width - SIDE_ROOM, height - END_ROOM - labels] / np.ptp(box, axis=0)))
    middle = 0.5 * (box.min(axis=0) + box.max(axis=0))
    # The labels of the z axis stand on the right.
    centre = np.array([left + 0.5 * width - 0.13, bottom + 0.5 * (height + labels)])
    size = figure.get_size_inches()
    axes.set_position((*((centre - side * middle) / size), *(side / size)))

    panel = Panel(axes, scene, side * float(np.ptp(box[:, 0]) / scene.projected_size[0]))
    _style_box(panel)
    _draw_fields(figure, place, analyses, scene.camera)
    write_at(figure, left + 0.5 * width, bottom + height - 0.04, title, ha="center", va="top")
    return panel


def _style_box(panel: Panel) -> None:
    """Make the box light, with as many ticks as have room on paper."""
    axes, scene = panel.axes, panel.scene
    inches = np.linalg.norm(scene.camera.right_and_up, axis=0) * scene.size * panel.inches
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
        axis.labelpad = -1.0 - 3.5 * (share.sum() - share[i]) + (3.0 if i == 2 else 0.0)
    axes.tick_params(labelsize=6.0, pad=-3.0)
    axes.tick_params(axis="z", pad=-1.0)


def _ticks(low: float, high: float, inches: float) -> np.ndarray:
    """Return round values, away from the ends, where the labels of two axes would meet."""
    room = 0.07 * (high - low)
    low, high = low + room, high - room
    ticks = MaxNLocator(int(np.clip(inches / 0.4, 2, 5)), min_n_ticks=2).tick_values(low, high)
    return ticks[(ticks >= low) & (ticks <= high)]


def draw_particles(
    panel: Panel, position: np.ndarray, radius: np.ndarray | None, colours: np.ndarray
) -> float:
    """Draw particles as discs of their size, near ones over far ones; return how much enlarged.

    `position` (D, 3) and `radius` (D,) in m; `colours` has one row, or D.
    """
    if radius is None:
        diameter, enlarged = np.full(len(position), 2.5), 1.0
    else:
        true = 2.0 * radius * 72.0 * panel.inches
        diameter = np.maximum(true, SMALLEST_MARKER)
        enlarged = float(np.max(diameter / np.maximum(true, 1e-300), initial=1.0))
    fading = FADING * (1.0 - from_0_to_1(position @ panel.scene.camera.toward))[:, None]
    panel.axes.scatter(
        *panel.scene.shown(position).T,
        s=diameter**2,
        c=1.0 - (1.0 - colours[:, :3]) * (1.0 - fading),
        depthshade=False,
        edgecolors=np.tile(0.3 + fading, 3),
        linewidths=np.minimum(0.25, 0.1 * diameter),
        zorder=2.0,
    )
    return enlarged


def draw_spheroid(panel: Panel, spheroid: Spheroid) -> None:
    """Draw the wires of a spheroid: those behind under the particles, the others over them."""
    frame = frame_with_pole(spheroid.axis)
    stretch = np.array([spheroid.across, spheroid.across, spheroid.along])
    near, far = [], []
    for wire in _wires():
        points = panel.scene.shown(spheroid.centre + (wire * stretch) @ frame)
        normals = (wire / np.maximum(stretch, 1e-300)) @ frame
        faces = (normals[1:] + normals[:-1]) @ panel.scene.camera.toward > 0.0
        segments = np.stack([points[:-1], points[1:]], axis=1)
        near.append(segments[faces])
        far.append(segments[~faces])
    # Thinner wires on a small spheroid, which they would cover.
    width = min(0.4, spheroid.across * panel.inches)
    for segments, zorder, grey in ((far, 1.0, 0.6), (near, 3.0, 0.0)):
        wires = Line3DCollection(
            np.concatenate(segments), colors=(grey, grey, grey, 0.5), linewidths=width
        )
        wires.set_zorder(zorder)
        panel.axes.add_collection3d(wires)


def _wires(meridians: int = 8, parallels: int = 7) -> Iterator[np.ndarray]:
    """Yield curves on the unit sphere (P, 3), the pole along z."""
    turn, half_turn = np.linspace(0.0, 2.0 * np.pi, 61), np.linspace(0.0, np.pi, 31)
    longitudes = np.linspace(0.0, 2.0 * np.pi, meridians, endpoint=False)
    lines = [(half_turn, longitude) for longitude in longitudes]
    lines += [(colatitude, turn) for colatitude in np.linspace(0.0, np.pi, parallels + 2)[1:-1]]
    for colatitude, longitude in lines:
        ring = np.sin(colatitude)
        points = ring * np.cos(longitude), ring * np.sin(longitude), np.cos(colatitude)
        yield np.stack(np.broadcast_arrays(*points), axis=-1)


def frame_with_pole(pole: np.ndarray) -> np.ndarray:
    """Return an orthonormal frame, a vector a row, the third one along `pole`."""
    first = np.cross(np.eye(3)[np.argmin(np.abs(pole))], pole)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(pole, first), pole])


def directions_about(axis: np.ndarray) -> tuple[np.ndarray, list[str]]:
    """Return three directions, a row each, the first along `axis`, and what they are called.

    The names are indices of formulas; directions are the coordinate axes where `axis` is one.
    """
    main = int(np.argmax(np.abs(axis)))
    if abs(axis[main]) == 1.0:
        order = [main, (main + 1) % 3, (main + 2) % 3]
        return np.eye(3)[order], ["xyz"[i] for i in order]
    directions = np.roll(frame_with_pole(axis), 1, axis=0)
    return directions, [r"\parallel", r"{\perp 1}", r"{\perp 2}"]


def field_remarks(analyses: Analyses) -> Iterator[str]:
    """Yield why no arrow of a field is drawn, where none is."""
    if analyses.case is None:
        yield "fields unknown"
    elif not any((*analyses.case.fields.magnetic, *analyses.case.fields.electric)):
        yield "no field"


def _draw_fields(figure: Figure, place: Place, analyses: Analyses, camera: Camera) -> None:
    """Draw the directions of B and E, as the camera sees them, in the upper left corner."""
    left, bottom, _, height = place
    corner = np.array([left + 0.15, bottom + height - 0.12])
    fields = analyses.case.fields if analyses.case else None
    strengths = {"B": fields.magnetic, "E": fields.electric} if fields else {}
    tips = {
        name: 0.32 * camera.right_and_up @ (np.array(strength) / np.linalg.norm(strength))
        for name, strength in strengths.items()
        if any(strength)
    }
    if not tips:
        return
    ends = np.array([np.zeros(2), *tips.values()])
    root = corner - [ends[:, 0].min(), ends[:, 1].max()]
    for name, tip in tips.items():
        arrow = FancyArrowPatch(
            tuple(root), tuple(root + tip), arrowstyle="-|>", mutation_scale=7.0, shrinkA=0.0,
            shrinkB=0.0, linewidth=0.9, color="black", transform=figure.dpi_scale_trans,
        )  # fmt: skip
        figure.add_artist(arrow)
        length = np.linalg.norm(tip)  # zero if the camera looks along the field
        beyond = tip / length if length > 0.0 else np.array([1.0, 0.0])
        write_at(
            figure, *(root + tip + 0.09 * beyond), name, ha="center", va="center", fontsize=7.5,
            fontweight="bold",
        )  # fmt: skip
