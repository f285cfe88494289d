"""The figures: what stands in them, that it is true, and that odd runs can be drawn too."""

import struct
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PathCollection
from matplotlib.figure import Figure
from matplotlib.image import imread
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from lammps_blast import figures
from lammps_blast.analyze import Analyses, analyze
from lammps_blast.figures import (
    charge_figure,
    cloud_figure,
    draw_figures,
    energy_figure,
    semi_axis_figure,
    velocity_figure,
)

OMEGA, SPEED, RADIUS = 10.0, 2.0, 0.05
LEDGER_HEAD = "time,kinetic,rotational,electric_work,drag_loss,magnetic_work\n"


def launched(n: int) -> np.ndarray:
    """Launch points on a unit sphere with their centre of mass at the origin."""
    directions = np.random.default_rng(3).normal(size=(n // 2 or 1, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return np.concatenate([directions, -directions])[: max(n, 1)]


def gyrating(n: int, times: np.ndarray, sign: np.ndarray | float = 1.0):
    """Positions and velocities (T, N, 3) of a blast with B along x, written out by components."""
    start = launched(n)
    omega = OMEGA * np.broadcast_to(sign, n)
    angle = times[:, None] * omega
    _, y, z = (SPEED * start).T
    velocity = np.empty((len(times), n, 3))
    velocity[..., 0] = SPEED * start[:, 0]
    velocity[..., 1] = y * np.cos(angle) + z * np.sin(angle)
    velocity[..., 2] = z * np.cos(angle) - y * np.sin(angle)
    position = start + np.zeros_like(velocity)
    position[..., 0] += velocity[..., 0] * times[:, None]
    position[..., 1] += (y * np.sin(angle) + z * (1.0 - np.cos(angle))) / omega
    position[..., 2] += (z * np.sin(angle) - y * (1.0 - np.cos(angle))) / omega
    return position, velocity


def write_dump(
    path: Path, times, position, velocity, *, charge=1.0, radius=RADIUS, missing=""
) -> None:
    n = position.shape[1]
    fixed = {"id": np.arange(1, n + 1), "mass": np.ones(n), "radius": radius, "q": charge}
    columns = [*fixed, "x", "y", "z", "vx", "vy", "vz"]
    columns = [name for name in columns if name not in missing.split()]
    with path.open("w") as file:
        for step, time in enumerate(np.asarray(times).tolist()):
            file.write(f"ITEM: TIME\n{time!r}\nITEM: TIMESTEP\n{step}\n")
            file.write(f"ITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS ss ss ss\n" + "-9 9\n" * 3)
            file.write(f"ITEM: ATOMS {' '.join(columns)}\n")
            values = fixed | dict(zip(("x", "y", "z"), position[step].T, strict=True))
            values |= dict(zip(("vx", "vy", "vz"), velocity[step].T, strict=True))
            table = np.column_stack([np.broadcast_to(values[name], n) for name in columns])
            np.savetxt(file, table, fmt=["%d"] + ["%.15g"] * (len(columns) - 1))


def write_case(
    folder: Path, *, n, duration, magnetic=(OMEGA, 0, 0), electric=(0, 0, 0), title="a test"
) -> None:
    (folder / "case.yaml").write_text(
        f"name: tiny\ntitle: '{title}'\n"
        f"particles: {{count: {n}, radius: {RADIUS}, density: 1000.0, charge_per_mass: 1.0,"
        " packing: {domain_radius: 2.0}}\n"
        f"blast: {{energy: {0.5 * n * SPEED**2!r}}}\n"
        f"fields: {{electric: {list(electric)}, magnetic: {list(magnetic)}}}\n"
        f"time: {{duration: {float(duration)!r}, step: {float(duration) / 100!r}}}\n",
        encoding="utf-8",
    )


def make_run(
    folder: Path, *, n=12, frames=21, turns=1.0, sign=1.0, ledger=True, magnetic=(OMEGA, 0, 0),
    electric=(0, 0, 0), title="a test", charge=1.0,
) -> Analyses:  # fmt: skip
    folder.mkdir(exist_ok=True)
    duration = float(turns * 2.0 * np.pi / OMEGA)
    times = np.linspace(0.0, duration, frames)
    write_dump(
        folder / "trajectory.lammpstrj", times, *gyrating(n, times, sign), charge=charge * sign
    )
    write_case(folder, n=n, duration=duration, magnetic=magnetic, electric=electric, title=title)
    if ledger:
        rows = [f"{t!r},{0.5 * n * SPEED**2!r},0,0,0,1e-12\n" for t in times.tolist()]
        (folder / "energy.csv").write_text(LEDGER_HEAD + "".join(rows))
    return analyze(folder)


def scenes(figure: Figure) -> list[Axes3D]:
    return [axes for axes in figure.axes if isinstance(axes, Axes3D)]


def words(figure: Figure) -> str:
    """Return every text of a figure."""
    texts = [text.get_text() for text in figure.texts]
    for axes in figure.axes:
        texts += [axes.get_title(loc) for loc in ("left", "center", "right")]
        texts += [axes.get_xlabel(), axes.get_ylabel()]
        texts += [text.get_text() for text in axes.texts]
        if axes.get_legend():
            texts += [text.get_text() for text in axes.get_legend().get_texts()]
    return "\n".join(texts)


def limits(axes: Axes3D) -> np.ndarray:
    return np.array([axes.get_xlim3d(), axes.get_ylim3d(), axes.get_zlim3d()])


def drawn_points(axes: Axes3D) -> np.ndarray:
    (scatter,) = (c for c in axes.collections if isinstance(c, PathCollection))
    return np.array(scatter._offsets3d).T


def on_paper(axes: Axes3D, points: np.ndarray) -> np.ndarray:
    """Return where points are on paper, in points (1/72 inch)."""
    x, y, _ = proj3d.proj_transform(*np.transpose(points), axes.get_proj())
    pixels = axes.transData.transform(np.stack([x, y], axis=-1))
    return 72.0 * pixels / axes.get_figure().dpi


@pytest.fixture(autouse=True)
def coarse(monkeypatch, request):
    """Draw coarsely, which is faster, where the pictures themselves are not looked at."""
    if request.node.name != "test_the_files_are_pictures_of_a_sane_size":
        monkeypatch.setattr(figures, "DPI", 40)


@pytest.fixture(scope="module")
def run(tmp_path_factory) -> Analyses:
    """One turn, twenty frames, the theorem holds."""
    return make_run(tmp_path_factory.mktemp("runs") / "run")


@pytest.fixture(scope="module")
def cloud(run) -> Figure:
    return cloud_figure(run)


def test_the_files_are_pictures_of_a_sane_size(run, tmp_path):
    before = dict(matplotlib.rcParams)
    draw_figures(run, tmp_path / "new" / "figures")
    assert dict(matplotlib.rcParams) == before
    files = sorted((tmp_path / "new" / "figures").iterdir())
    assert [file.name for file in files] == [
        "cloud.png",
        "energy.png",
        "semi_axes.png",
        "velocities.png",
    ]
    for file in files:
        width, height = struct.unpack(">II", file.read_bytes()[16:24])
        assert 3.0 * figures.DPI < width < 8.0 * figures.DPI
        assert 2.0 * figures.DPI < height < 10.0 * figures.DPI
        picture = imread(file)[..., :3]
        ink = np.mean(picture.min(axis=2) < 0.95)
        assert 0.01 < ink < 0.7


def test_all_panels_share_one_view_that_holds_every_particle(run, cloud):
    panels = scenes(cloud)
    assert len(panels) == 6
    low, high = limits(panels[0]).T
    for axes in panels:
        np.testing.assert_array_equal(limits(axes), limits(panels[0]))
        assert (axes.elev, axes.azim) == (panels[0].elev, panels[0].azim)
    for ts in run.universe.trajectory[[0, -1]]:
        assert np.all(ts.data["position"] - RADIUS >= low)
        assert np.all(ts.data["position"] + RADIUS <= high)


def test_the_first_and_the_last_frame_are_drawn(run, cloud):
    frames = run.universe.trajectory
    for axes, frame in ((scenes(cloud)[0], 0), (scenes(cloud)[-1], -1)):
        expected = frames[frame].data["position"]
        np.testing.assert_allclose(drawn_points(axes), expected, atol=1e-12)


def test_equal_lengths_are_equal_on_paper_and_particles_have_their_size(cloud):
    for axes in scenes(cloud):
        azimuth, elevation = np.radians([axes.azim, axes.elev])
        right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
        toward = [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
        up = np.cross(toward, right)
        origin, one_right, one_up = on_paper(axes, np.array([np.zeros(3), right, up]))
        assert np.linalg.norm(one_right - origin) == pytest.approx(np.linalg.norm(one_up - origin))
        (scatter,) = (c for c in axes.collections if isinstance(c, PathCollection))
        diameter = np.sqrt(scatter.get_sizes())
        true = 2.0 * RADIUS * np.linalg.norm(one_right - origin)
        np.testing.assert_allclose(diameter, true, rtol=1e-6)
    assert "true size" in words(cloud)


def test_the_boxes_lie_within_the_figure_and_do_not_overlap(cloud):
    page = 72.0 * cloud.get_size_inches()
    boxes = []
    for axes in scenes(cloud):
        corners = on_paper(axes, np.array(np.meshgrid(*limits(axes))).reshape(3, -1).T)
        boxes.append((corners.min(axis=0), corners.max(axis=0)))
        assert np.all(corners > 0.0)
        assert np.all(corners < page)
    for i, (low, high) in enumerate(boxes):
        for other_low, other_high in boxes[:i]:
            assert np.any(high < other_low) or np.any(other_high < low)


def test_the_colours_begin_at_zero_even_if_all_speeds_are_equal(cloud):
    (bar,) = (axes for axes in cloud.axes if not isinstance(axes, Axes3D))
    assert bar.get_xlim() == pytest.approx((0.0, SPEED))
    assert "always 2.000" in words(cloud)


def test_a_cloud_that_has_come_to_rest_is_not_drawn_six_times(tmp_path):
    times = np.linspace(0.0, 10.0, 101)
    start = launched(12)
    grown = 1.0 + 3.0 * (1.0 - np.exp(-5.0 * times))
    dump = tmp_path / "resting.lammpstrj"
    speed = 15.0 * np.exp(-5.0 * times)
    write_dump(dump, times, grown[:, None, None] * start, speed[:, None, None] * start)
    sizes = [
        np.ptp(drawn_points(axes), axis=0).max() for axes in scenes(cloud_figure(analyze(dump)))
    ]
    assert np.sum(np.array(sizes) < 0.95 * sizes[-1]) >= 3


def test_velocity_curves_are_the_exact_ones(run):
    figure = velocity_figure(run)
    panels = figure.axes[-3:]
    assert [axes.get_ylabel()[:5] for axes in panels] == ["$v_x$", "$v_y$", "$v_z$"]
    for component, axes in enumerate(panels):
        curves = [line for line in axes.lines if len(line.get_xdata()) > 100]
        marks = [line for line in axes.lines if len(line.get_xdata()) == 21]
        assert len(curves) == len(marks) == 3
        for place, (curve, mark) in enumerate(zip(curves, marks, strict=True)):
            times = mark.get_xdata()
            measured = run.speeds.results.tracked_velocity[:, place, component]
            np.testing.assert_allclose(mark.get_ydata(), measured)
            on_curve = np.interp(times, curve.get_xdata(), curve.get_ydata())
            np.testing.assert_allclose(on_curve, measured, atol=1e-3 * SPEED)


def test_the_head_of_an_arrow_has_the_colour_of_its_shaft(tmp_path):
    start = launched(8)[None]
    speeds = np.linspace(1.0, 5.0, 8)[None, :, None]
    dump = tmp_path / "arrows.lammpstrj"
    write_dump(dump, [0.0], start, speeds * start)
    (axes,) = scenes(velocity_figure(analyze(dump)))
    (arrows,) = (c for c in axes.collections if isinstance(c, Line3DCollection))
    segments, colours = np.array(arrows._segments3d), arrows.get_colors()
    assert len(np.unique(colours[:8], axis=0)) == 8
    for head, colour in zip(segments[8:], colours[8:], strict=True):
        ends = segments[:8].reshape(8, 2, 3)
        apart = np.linalg.norm(ends[:, :, None] - head[None, None], axis=-1).min(axis=(1, 2))
        np.testing.assert_array_equal(colour, colours[apart.argmin()])


def marker_styles(figure: Figure, frames: int) -> set[str]:
    return {
        line.get_linestyle()
        for axes in figure.axes[-3:]
        for line in axes.lines
        if len(line.get_xdata()) == frames
    }


def test_frames_that_miss_the_turns_are_not_joined(tmp_path):
    sparse = make_run(tmp_path / "sparse", turns=4.0, frames=25)
    figure = velocity_figure(sparse)
    assert "only 6 frames a turn: too few to join the markers" in words(figure)
    assert marker_styles(figure, 25) == {"None"}
    assert "too few" in words(semi_axis_figure(sparse))
    assert "too few" not in words(energy_figure(sparse))  # nothing swings without E


def test_frames_that_show_the_turns_are_joined_where_theory_has_no_curve(tmp_path):
    dense = make_run(tmp_path / "dense", frames=21, charge=np.linspace(0.9, 1.0, 12))
    assert isinstance(dense.expected, str)  # the theorem wants one charge per mass
    figure = velocity_figure(dense)
    assert "None" not in marker_styles(figure, 21)
    assert "20 frames a turn" in words(figure)
    assert dense.expected in words(semi_axis_figure(dense))


def test_many_turns_are_shown_in_part(tmp_path):
    figure = velocity_figure(make_run(tmp_path / "long", turns=50.0, frames=501))
    assert "first 20 of 50 turns" in words(figure)


def test_more_turns_than_can_be_drawn_are_not_drawn_as_a_curve(tmp_path):
    blind = make_run(tmp_path / "blind", turns=1000.0, frames=11)
    assert "0.01 frames a turn" in words(velocity_figure(blind))
    assert marker_styles(velocity_figure(blind), 11) == {"None"}
    across = semi_axis_figure(blind).axes[1]
    assert {line.get_linestyle() for line in across.lines} == {"None"}


def test_semi_axes_and_their_deviation_keep_to_the_limit(run):
    figure = semi_axis_figure(run)
    along, across, deviation = figure.axes
    assert along.get_ylabel() == "along B (m)"
    assert across.get_ylabel() == "across B (m)"
    assert deviation.get_yscale() == "log"
    limit = run.checks["semi_axis_parallel"].limit
    assert any(np.all(np.equal(line.get_ydata(), limit)) for line in deviation.lines)
    assert deviation.get_ylim()[1] > limit
    assert f"limit {limit:.0e}" in words(figure)


def test_the_energy_ledger_is_drawn_with_its_limit(run):
    figure = energy_figure(run)
    energy, _, error = figure.axes
    assert energy.get_ylim()[0] == 0.0
    np.testing.assert_allclose(energy.lines[0].get_ydata(), 24.0)
    assert "missing from the ledger: exactly zero" in words(figure)
    magnetic = next(line for line in error.lines if line.get_label() == "magnetic work")
    np.testing.assert_allclose(magnetic.get_ydata(), 1e-12 / 24.0)


def test_both_charges_get_a_picture_of_their_own(tmp_path):
    sign = np.where(np.arange(12) % 2, 1.0, -1.0)
    mixed = make_run(tmp_path / "mixed", frames=3, turns=0.2, sign=sign)
    draw_figures(mixed, tmp_path / "figures")
    assert (tmp_path / "figures" / "cloud_charges.png").stat().st_size > 2_000
    assert "negative charge" in words(charge_figure(mixed))
    assert "(+)" in words(velocity_figure(mixed))
    assert "(−)" in words(velocity_figure(mixed))


def test_particles_without_charge_are_not_called_positive(tmp_path):
    three = make_run(tmp_path / "three", frames=2, charge=np.arange(12) % 3 - 1.0)
    assert "no charge" in words(charge_figure(three))


def test_a_crowd_is_drawn_in_part_and_says_so(tmp_path):
    figure = cloud_figure(make_run(tmp_path / "crowd", n=5000, frames=2, ledger=False))
    assert "3000 of 5000 particles drawn" in words(figure)
    assert [len(drawn_points(axes)) for axes in scenes(figure)] == [3000, 3000]


def test_a_lone_dump_tells_what_is_not_known(tmp_path):
    times = np.linspace(0.0, 0.5, 4)
    dump = tmp_path / "lone.lammpstrj"
    write_dump(dump, times, *gyrating(8, times), missing="radius q")
    lone = analyze(dump)
    assert "fields unknown" in words(cloud_figure(lone))
    assert "radii unknown" in words(cloud_figure(lone))
    assert "period of a turn unknown" in words(velocity_figure(lone))
    assert "there is no case file" in words(semi_axis_figure(lone))
    assert "no energy table" in words(energy_figure(lone))
    draw_figures(lone, tmp_path / "figures")


def test_a_dump_without_velocities_is_drawn_in_one_colour(tmp_path):
    times = np.linspace(0.0, 0.5, 4)
    dump = tmp_path / "still.lammpstrj"
    write_dump(dump, times, *gyrating(8, times), missing="mass vx vy vz")
    with pytest.warns(UserWarning, match="1 kg"):
        still = analyze(dump)
    draw_figures(still, tmp_path / "figures")
    names = sorted(file.name for file in (tmp_path / "figures").iterdir())
    assert names == ["cloud.png", "semi_axes.png"]
    figure = cloud_figure(still)
    assert "velocities unknown" in words(figure)
    assert figure.axes == scenes(figure)  # no colour bar
    (tmp_path / "energy.csv").write_text(LEDGER_HEAD + "0,24,0,0,0,0\n0.5,24,0,0,0,0\n")
    with pytest.warns(UserWarning, match="1 kg"):
        draw_figures(analyze(dump), tmp_path / "figures")
    assert (tmp_path / "figures" / "energy.png").is_file()


def test_energies_of_a_dump_without_masses_are_marked(tmp_path):
    times = np.linspace(0.0, 0.5, 4)
    write_dump(tmp_path / "light.lammpstrj", times, *gyrating(8, times), missing="mass")
    with pytest.warns(UserWarning, match="1 kg"):
        light = analyze(tmp_path / "light.lammpstrj")
    figure = energy_figure(light)
    assert "masses unknown: 1 kg each" in words(figure)
    FigureCanvasAgg(figure)
    for text in figure.texts:
        assert text.get_window_extent().x1 < figure.bbox.x1


def test_drag_together_with_another_force_has_no_exact_velocities(tmp_path):
    make_run(tmp_path / "run")
    case = tmp_path / "run" / "case.yaml"
    alone = case.read_text()
    for wind, exact in (((0, 0, 0), True), ((0, 1, 0), False)):
        case.write_text(
            f"{alone}medium: {{drag: stokes, viscosity: 0.1, velocity: {list(wind)}}}\n"
        )
        dragged = analyze(tmp_path / "run")
        assert not isinstance(dragged.expected, str)
        assert ("lines: exact" in words(velocity_figure(dragged))) == exact


def test_no_field_and_other_fields_are_named(tmp_path):
    none = make_run(tmp_path / "none", frames=2, magnetic=(0, 0, 0))
    assert "no field" in words(cloud_figure(none))
    assert semi_axis_figure(none).axes[0].get_ylabel() == "along x (m)"
    both = make_run(tmp_path / "both", frames=2, magnetic=(0, 3, 4), electric=(0, 0, -1))
    assert {"B", "E"} <= set(words(cloud_figure(both)).split("\n"))
    assert r"$v_\parallel$" in words(velocity_figure(both))


def test_mixed_charges_that_are_driven_apart_get_no_common_spheroid(tmp_path):
    sign = np.where(np.arange(12) % 2, 1.0, -1.0)
    apart = make_run(tmp_path / "apart", frames=2, sign=sign, electric=(1, 0, 0))
    assert "exact spheroid" not in words(cloud_figure(apart))
    make_run(tmp_path / "blown", frames=2, sign=sign)
    with (tmp_path / "blown" / "case.yaml").open("a") as case:
        case.write("medium: {drag: stokes, viscosity: 0.1, velocity: [0, 1, 0]}\n")
    blown = analyze(tmp_path / "blown")
    assert not isinstance(blown.expected, str)
    assert "exact spheroid" not in words(cloud_figure(blown))
    together = make_run(tmp_path / "together", frames=2, electric=(1, 0, 0))
    assert "exact spheroid" in words(cloud_figure(together))


@pytest.mark.parametrize(("n", "frames"), [(1, 1), (1, 5), (2, 2), (12, 1)])
def test_few_particles_and_few_frames(tmp_path, n, frames):
    draw_figures(make_run(tmp_path / "few", n=n, frames=frames), tmp_path / "figures")


def test_a_title_is_text_and_not_a_formula(tmp_path, recwarn):
    title = "100 $ of m_i^2 \\frac{ $ for 雪 é 🎆"
    odd = make_run(tmp_path / "odd", n=2, frames=1, title=title)
    draw_figures(odd, tmp_path / "figures")
    assert title in words(energy_figure(odd)).split("\n")
    assert not [w for w in recwarn if "Glyph" in str(w.message)]


@pytest.mark.parametrize(
    ("title", "shown"), [("", "tiny"), ("x" * 200, "x" * 62 + "…"), ("x" * 63, "x" * 63)]
)
def test_a_title_that_is_missing_or_too_long(tmp_path, title, shown):
    odd = make_run(tmp_path / "odd", n=2, frames=1, title=title)
    assert shown in words(energy_figure(odd)).split("\n")


def test_a_cloud_at_rest_with_an_empty_ledger(tmp_path):
    times = np.linspace(0.0, 1.0, 3)
    start = np.broadcast_to(launched(4), (3, 4, 3))
    write_dump(tmp_path / "trajectory.lammpstrj", times, start, np.zeros((3, 4, 3)), charge=0.0)
    write_case(tmp_path, n=4, duration=1.0)
    (tmp_path / "energy.csv").write_text(LEDGER_HEAD + "0,0,0,0,0,0\n0.5,0,0,0,0,0\n1,0,0,0,0,0\n")
    draw_figures(analyze(tmp_path), tmp_path / "figures")


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_run_that_diverged(tmp_path):
    times = np.linspace(0.0, 1.0, 3)
    position, velocity = gyrating(6, times)
    position[1, 2], velocity[1, 2] = np.nan, np.nan
    position[2], velocity[2] = np.nan, np.inf
    write_dump(tmp_path / "trajectory.lammpstrj", times, position, velocity)
    write_case(tmp_path, n=6, duration=1.0)
    diverged = analyze(tmp_path)
    draw_figures(diverged, tmp_path / "figures")
    assert [len(drawn_points(axes)) for axes in scenes(cloud_figure(diverged))] == [6, 5, 0]


def test_particles_too_small_to_be_seen_are_not_called_true(tmp_path):
    times = np.linspace(0.0, 0.5, 2)
    for radius, remark in ((1e-3, "enlarged up to"), (0.0, "drawn as points")):
        dump = tmp_path / f"{radius}.lammpstrj"
        write_dump(dump, times, *gyrating(8, times), radius=radius)
        assert remark in words(cloud_figure(analyze(dump)))
