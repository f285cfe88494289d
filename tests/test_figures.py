"""The figures: what stands in them, that it is true, and that odd runs can be drawn too."""

import struct
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import EllipseCollection, LineCollection, PathCollection
from matplotlib.figure import Figure
from matplotlib.image import imread
from mpl_toolkits.mplot3d import Axes3D, proj3d
from mpl_toolkits.mplot3d.art3d import Line3DCollection

from lammps_blast import figures, interactions
from lammps_blast.analyze import FIGURES, Analyses, analyze
from lammps_blast.deck import ENERGY_ACCOUNTS
from lammps_blast.figures import (
    charge_figure,
    cloud_figure,
    clump_figure,
    clump_statistics_figure,
    contact_figure,
    draw_figures,
    energy_figure,
    pair_distance_figure,
    pair_history_figure,
    scene,
    semi_axis_figure,
    step_figure,
    velocity_figure,
)
from lammps_blast.figures import contacts as contact_pictures

OMEGA, SPEED, RADIUS = 10.0, 2.0, 0.05


def ledger_row(time: float, **accounts: float) -> str:
    """A line of the energy table; accounts that are not given are empty."""
    values = (time, *(accounts.get(account, 0.0) for account in ENERGY_ACCOUNTS))
    return ",".join(repr(float(value)) for value in values)


def write_ledger(folder: Path, *rows: str) -> None:
    head = ",".join(("time", *ENERGY_ACCOUNTS))
    (folder / "energy.csv").write_text("\n".join((head, *rows)) + "\n")


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
    path: Path, times, position, velocity, *, charge=1.0, radius=RADIUS, missing="", spin=None
) -> None:
    """Write a text dump; `spin` (T, N) are angular velocities about z."""
    n = position.shape[1]
    fixed = {"id": np.arange(1, n + 1), "mass": np.ones(n), "radius": radius, "q": charge}
    columns = [*fixed, "x", "y", "z", "vx", "vy", "vz"]
    if spin is not None:
        columns += ["omegax", "omegay", "omegaz"]
    columns = [name for name in columns if name not in missing.split()]
    with path.open("w") as file:
        for step, time in enumerate(np.asarray(times).tolist()):
            file.write(f"ITEM: TIME\n{time!r}\nITEM: TIMESTEP\n{step}\n")
            file.write(f"ITEM: NUMBER OF ATOMS\n{n}\nITEM: BOX BOUNDS ss ss ss\n" + "-9 9\n" * 3)
            file.write(f"ITEM: ATOMS {' '.join(columns)}\n")
            values = fixed | dict(zip(("x", "y", "z"), position[step].T, strict=True))
            values |= dict(zip(("vx", "vy", "vz"), velocity[step].T, strict=True))
            if spin is not None:
                values |= {"omegax": 0.0, "omegay": 0.0, "omegaz": spin[step]}
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
        accounts = {"kinetic": 0.5 * n * SPEED**2, "magnetic_work": 1e-12}
        write_ledger(folder, *(ledger_row(time, **accounts) for time in times))
    return analyze(folder)


def make_clumped(folder: Path, *, frames=3, magnetic=(OMEGA, 0, 0), recorded=True) -> Analyses:
    """A chain of six spheres along y, three on a line along z and two alone, drawn together.

    The contacts on record are the five of the chain, in the last frame, each stronger than the one
    before it.
    """
    folder.mkdir()
    places = [[0, 2 * RADIUS * i, 0] for i in range(6)]
    places += [[1, 0, 2 * RADIUS * i] for i in range(3)] + [[-1, 1, 0], [-1, -1, 1]]
    times = np.linspace(0.0, 0.02 * np.pi, frames)
    shrinking = np.linspace(3.0, 0.999, frames)[:, None, None] if frames > 1 else 0.999
    position = shrinking * np.array(places, dtype=float) * np.ones((frames, 1, 1))
    write_dump(folder / "trajectory.lammpstrj", times, position, np.ones_like(position))
    write_case(folder, n=len(places), duration=0.1, magnetic=magnetic)
    with (folder / "case.yaml").open("a") as case:
        case.write("contact: {law: zohdi, stiffness: 1.0e7, exponent: 2, damping: 1.0e5}\n")
    if recorded:
        with (folder / "contacts.lammpsdump").open("w") as file:
            for step in range(frames):
                count = 5 if step == frames - 1 else 0
                file.write(f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{count}\n")
                file.write("ITEM: BOX BOUNDS ss ss ss\n" + "-9 9\n" * 3)
                file.write("ITEM: ENTRIES id1 id2 strain normal_force\n")
                file.writelines(f"{i} {i + 1} 1e-3 {10 * i}\n" for i in range(1, count + 1))
    return analyze(folder)


def make_pairs(
    folder: Path, stories: dict[str, list[float]], *, contact="", spins=None
) -> Analyses:
    """Pairs along y, each with its gap (mean diameters) in every frame; a bond where it is < -0.05.

    A bond lasts until the pair separates. `spins` are those of the pairs in the last frame.
    """
    folder.mkdir()
    gaps = np.array(list(stories.values())).T
    frames, count = gaps.shape
    times = 1e-3 * np.arange(frames)
    position = np.zeros((frames, count, 2, 3))
    position[..., 1] = 8.0 * RADIUS * np.arange(count)[:, None]
    position[..., 0] = RADIUS * (1.0 + gaps)[..., None] * [-1.0, 1.0]
    velocity = np.gradient(position, times, axis=0)
    spin = np.zeros((frames, count, 2))
    if spins is not None:
        spin[-1] = np.array(spins)[:, None]
    shape = (frames, 2 * count, 3)
    write_dump(
        folder / "trajectory.lammpstrj", times, position.reshape(shape), velocity.reshape(shape),
        spin=spin.reshape(shape[:2]),
    )  # fmt: skip
    write_case(folder, n=2 * count, duration=times[-1], magnetic=(0, 0, 0))
    with (folder / "case.yaml").open("a") as case:
        case.write(f"contact: {{law: zohdi, stiffness: 1.0e7, exponent: 2{contact}}}\n")
    bonded = np.zeros(count, dtype=bool)
    with (folder / "contacts.lammpsdump").open("w") as file:
        for step, gap in enumerate(gaps):
            bonded = (bonded | (gap < -0.05)) & (gap <= 0.0)
            rows = [
                f"{2 * i + 1} {2 * i + 2} {-gap[i]} {-1e3 * gap[i]} {1e3 * bonded[i]}\n"
                for i in np.flatnonzero(gap <= 0.0)
            ]
            file.write(f"ITEM: TIMESTEP\n{step}\nITEM: NUMBER OF ENTRIES\n{len(rows)}\n")
            file.write("ITEM: BOX BOUNDS ss ss ss\n" + "-9 9\n" * 3)
            file.write("ITEM: ENTRIES id1 id2 strain normal_force bond_force\n")
            file.writelines(rows)
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


def interacting_ledger(folder: Path, **changes: np.ndarray) -> Figure:
    """Return the picture of a ledger whose accounts grow by powers of two, but for `changes`."""
    grown = 2.0 ** np.arange(21) - 1.0
    accounts = {
        "kinetic": 24.0 - 0.01 * grown,
        "contact_energy": 1.0 + 0.5 * grown,
        "near_field_energy": -0.3 * grown,
        "drag_loss": grown,
        "contact_loss": 1e-3 * grown,
        "bond_formation_loss": 1e-9 * grown,
    } | changes
    run = make_run(folder)
    rows = zip(*accounts.values(), strict=True)
    times = run.envelope.results.times
    lines = (
        ledger_row(time, **dict(zip(accounts, row, strict=True)))
        for time, row in zip(times, rows, strict=True)
    )
    write_ledger(folder, *lines)
    return energy_figure(analyze(folder))


def test_energies_of_interactions_are_drawn_as_changes_and_losses_by_channel(tmp_path):
    figure = interacting_ledger(tmp_path / "run")
    changes, potentials, losses, error = figure.axes
    grown = 2.0 ** np.arange(21) - 1.0
    drawn = {line.get_label(): np.array(line.get_ydata()) for line in changes.lines}
    unit = {"J": 1.0, "kJ": 1e3, "MJ": 1e6}[changes.get_ylabel().split("(")[1][:-1]]
    np.testing.assert_allclose(drawn["kinetic"] * unit, -0.01 * grown, atol=1e-9)
    np.testing.assert_allclose(drawn["potential"] * unit, 0.2 * grown, atol=1e-9)
    np.testing.assert_allclose(drawn["lost"] * unit, (1.001 + 1e-9) * grown)
    assert "rotational" not in drawn
    assert "work of E" not in drawn
    drawn = {line.get_label(): np.array(line.get_ydata()) for line in potentials.lines}
    unit = {"J": 1.0, "kJ": 1e3, "MJ": 1e6}[potentials.get_ylabel().split("(")[1][:-1]]
    np.testing.assert_allclose(drawn["contacts"] * unit, 0.5 * grown)
    np.testing.assert_allclose(drawn["near field"] * unit, -0.3 * grown)
    assert "bonds" not in drawn

    assert losses.get_yscale() == "log"
    drawn = {line.get_label(): np.array(line.get_ydata()) for line in losses.lines}
    assert set(drawn) == {"drag", "contacts"}
    floor = 1e-6 * grown[-1]
    for name, values in (("drag", grown), ("contacts", 1e-3 * grown)):
        visible = values >= floor
        np.testing.assert_allclose(drawn[name][visible], values[visible])
        assert np.isnan(drawn[name][~visible]).all()
    assert losses.get_ylim()[0] < floor
    assert losses.get_ylim()[1] > grown[-1]
    assert "bonds forming: less than" in words(figure)
    assert error.get_yscale() == "log"
    assert "kinetic energy at launch: 24.0 J" in words(figure)


def test_losses_that_are_given_back_have_a_linear_axis(tmp_path):
    swings = 1e6 * np.sin(np.arange(21.0))
    losses = interacting_ledger(tmp_path / "run", contact_loss=swings).axes[2]
    assert losses.get_yscale() == "linear"
    contacts = next(line for line in losses.lines if line.get_label() == "contacts")
    assert np.min(contacts.get_ydata()) < 0.0


@pytest.mark.parametrize(
    ("empty", "missing"), [("contact_energy", "potential"), ("contact_loss", "lost")]
)
def test_without_potentials_or_without_losses_there_is_no_panel_for_them(tmp_path, empty, missing):
    also = ("near_field_energy", "drag_loss", "bond_formation_loss", empty)
    figure = interacting_ledger(tmp_path / "run", **dict.fromkeys(also, np.zeros(21)))
    drawn = [axes.get_ylabel().split(" (")[0] for axes in figure.axes[:-1]]
    assert drawn == ["since launch", "potential, change" if missing == "lost" else "lost"]


def test_both_charges_get_a_picture_of_their_own(tmp_path):
    sign = np.where(np.arange(12) % 2, 1.0, -1.0)
    mixed = make_run(tmp_path / "mixed", frames=3, turns=0.2, sign=sign)
    draw_figures(mixed, tmp_path / "figures")
    assert (tmp_path / "figures" / "cloud_charges.png").stat().st_size > 2_000
    assert "negative charge" in words(charge_figure(mixed))
    assert "(+)" in words(velocity_figure(mixed))
    assert "(−)" in words(velocity_figure(mixed))


def test_figures_read_a_frame_once(tmp_path, monkeypatch):
    sign = np.where(np.arange(12) % 2, 1.0, -1.0)
    mixed = make_run(tmp_path / "mixed", frames=3, turns=0.2, sign=sign)
    read = []
    reader = type(mixed.universe.trajectory)
    plain = reader._read_frame
    monkeypatch.setattr(
        reader, "_read_frame", lambda self, frame: read.append(frame) or plain(self, frame)
    )
    for figure in (cloud_figure, charge_figure, velocity_figure):
        figure(mixed)
    assert sorted(read) == [0, 1, 2]


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
    write_ledger(tmp_path, ledger_row(0.0, kinetic=24), ledger_row(0.5, kinetic=24))
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
    write_ledger(tmp_path, *map(ledger_row, times))
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


@pytest.fixture(scope="module")
def clumped(tmp_path_factory) -> Analyses:
    return make_clumped(tmp_path_factory.mktemp("runs") / "clumped")


def test_a_run_whose_particles_meet_gets_five_figures_more(clumped, tmp_path):
    draw_figures(clumped, tmp_path)
    names = {"clumps", "clump_statistics", "contacts", "pair_distances", "pair_histories"}
    drawn = {file.name.removesuffix(".png") for file in tmp_path.iterdir()}
    assert names < drawn < set(FIGURES)


def test_steps_are_drawn_with_their_limits(tmp_path):
    """One that failed twice before it came about, and one that no correction changed."""
    run = make_run(tmp_path / "run", frames=3)
    table = "time,step,corrections,error,restarts,evaluations\n"
    rows = [(0.1, 0.1, 1, 1e-4, 0, 3), (0.3, 0.2, 4, 2e-5, 2, 20), (0.4, 0.1, 1, 0.0, 2, 22)]
    rows = "".join(",".join(map(str, row)) + "\n" for row in rows)
    (tmp_path / "run" / "steps.csv").write_text(table + rows)
    case = tmp_path / "run" / "case.yaml"
    text = case.read_text().rstrip("}\n")
    case.write_text(text + ", integrator: implicit, implicit: {max_step: 0.25, tolerance: 2e-4}}\n")
    run = analyze(tmp_path / "run")
    figure = step_figure(run)
    lengths, counts, errors = figure.axes
    assert lines(lengths)["step"][1] == pytest.approx([100.0, 200.0, 100.0])  # ms
    assert lines(lengths)["longest allowed"][1] == [250.0, 250.0]
    assert lines(counts)["corrections of a step"][1] == [1, 4, 1]
    assert lines(counts)["restarts of a step"] == ([300.0], [2])
    assert lines(errors)["tolerance"][1] == [2e-4, 2e-4]
    assert np.isnan(lines(errors)["error of the last correction"][1][2])
    assert "3 steps, 2 restarts; 55 force evaluations per simulated second" in words(figure)
    draw_figures(run, tmp_path / "figures")
    assert (tmp_path / "figures" / "steps.png").is_file()


def lines(axes) -> dict[str, tuple[list[float], list[float]]]:
    """Return the points of the labelled lines of a panel, in the units of its axes."""
    return {
        line.get_label(): tuple(np.asarray(data, dtype=float).tolist() for data in line.get_data())
        for line in axes.lines
    }


def test_particles_have_the_colour_of_the_size_of_their_clump(clumped, monkeypatch):
    monkeypatch.setattr(scene, "FADING", 0.0)
    figure = clump_figure(clumped)
    colours = []
    for axes in (scenes(figure)[0], scenes(figure)[-1]):
        (scatter,) = (c for c in axes.collections if isinstance(c, PathCollection))
        colours.append(np.round(scatter.get_facecolor(), 6))
    assert len(np.unique(colours[0], axis=0)) == 1
    single, chain, line, alone = colours[0][0], colours[1][:6], colours[1][6:9], colours[1][9:]
    assert np.all(alone == single)
    assert len(np.unique(chain, axis=0)) == len(np.unique(line, axis=0)) == 1
    assert len({tuple(colour) for colour in (single, chain[0], line[0])}) == 3
    text = words(figure)
    assert {"single", "clumps of 2–4", "clumps of 5–19"} <= set(text.split("\n"))
    assert "100 or more" not in text


def test_clump_statistics_are_those_of_the_analysis(clumped):
    figure = clump_statistics_figure(clumped)
    number, sizes, ratio, shares, shapes = figure.axes
    assert number.lines[0].get_ydata() == pytest.approx([11, 11, 4])
    assert number.lines[1].get_ydata() == pytest.approx([0, 0, 2])
    assert sizes.lines[0].get_ydata() == pytest.approx([1, 1, 6])
    assert ratio.lines[-1].get_ydata()[-1] < 1.0  # the chain lies across B
    heights = [[bar.get_height() for bar in bars] for bars in shares.containers]
    assert heights[0] == pytest.approx([50, 25, 25])
    assert heights[1] == pytest.approx([200 / 11, 300 / 11, 600 / 11])
    assert [label.get_text() for label in shares.get_xticklabels()] == ["1", "2–3", "4–7"]
    assert shapes.lines[-1].get_xdata() == pytest.approx([6])


def test_the_contact_network_joins_the_centres_of_spheres_that_press(clumped, monkeypatch):
    monkeypatch.setattr(contact_pictures, "MOST_BARS", 4)
    figure = contact_figure(clumped)
    centres = clumped.universe.trajectory[-1].data["position"]
    for axes, shown in zip(figure.axes[:2], ([0, 2], [1, 2]), strict=True):
        (lines,) = (c for c in axes.collections if type(c) is LineCollection)
        scale = 1e-3 if "mm" in axes.get_xlabel() else 1.0
        ends = scale * np.array(lines.get_segments())
        expected = [[centres[i][shown], centres[i + 1][shown]] for i in range(5)]
        np.testing.assert_allclose(ends, expected, atol=1e-12)
        assert np.all(np.diff(lines.get_linewidths()) > 0.0)
        (spheres,) = (c for c in axes.collections if isinstance(c, EllipseCollection))
        assert len(spheres.get_offsets()) == len(centres)
        for limits, places in ((axes.get_xlim(), 0), (axes.get_ylim(), 1)):
            span = scale * np.array(limits)
            assert span[0] <= centres[:, shown[places]].min() - RADIUS
            assert span[1] >= centres[:, shown[places]].max() + RADIUS
        width, height = axes.get_position().size * figure.get_size_inches()
        assert np.ptp(axes.get_xlim()) / width == pytest.approx(np.ptp(axes.get_ylim()) / height)
    assert "normal force (N)" in words(figure)
    assert "5 contacts, mean 30 N" in words(figure)
    number = figure.axes[-2]
    assert number.lines[0].get_ydata() == pytest.approx([0, 0, 5])
    (per_particle,) = number.child_axes
    figure.draw_without_rendering()
    assert per_particle.get_ylim()[1] == pytest.approx(number.get_ylim()[1] * 2 / 11)


def test_few_contacts_are_drawn_one_by_one(clumped):
    bars = contact_figure(clumped).axes[3]
    names = [label.get_text() for label in bars.get_yticklabels()]
    assert names == ["1 and 2", "2 and 3", "3 and 4", "4 and 5", "5 and 6"]
    assert [bar.get_width() for bar in bars.patches] == pytest.approx([10, 20, 30, 40, 50])


def test_contacts_without_a_record_are_coloured_by_strain(tmp_path, monkeypatch):
    monkeypatch.setattr(contact_pictures, "MOST_BARS", 4)
    figure = contact_figure(make_clumped(tmp_path / "run", recorded=False))
    assert "7 contacts, mean 0.1 %" in words(figure)  # those of the line of three as well
    assert "strain (%)" in words(figure)
    assert "forces unknown" in words(figure)


def test_gaps_and_shells_of_a_clumped_run(clumped):
    gaps, shells = pair_distance_figure(clumped).axes
    legend = [text.get_text() for text in shells.get_legend().get_texts()]
    assert legend == ["t = 0.0 ms", "t = 31.4 ms", "t = 62.8 ms"]
    last = gaps.lines[2]
    assert last.get_xdata() == pytest.approx(np.full(10, -1e-3))
    assert last.get_ydata() == pytest.approx(100 / 11 * np.arange(10))


def test_a_particle_far_away_does_not_squeeze_the_gaps_of_all_others(tmp_path):
    n = 1000
    lattice = np.stack(np.unravel_index(np.arange(n), (10, 10, 10)), axis=1)
    gaps = np.random.default_rng(1).uniform(0.0, 0.3, n)
    position = 2.0 * RADIUS * 1.3 * lattice - RADIUS * gaps[:, None] / np.sqrt(3.0)
    position[-1] = [0.0, 0.0, -2.0 * RADIUS * 5.0]
    folder = tmp_path / "run"
    folder.mkdir()
    write_dump(folder / "trajectory.lammpstrj", [0.0], position[None], position[None])
    write_case(folder, n=n, duration=0.1)
    with (folder / "case.yaml").open("a") as case:
        case.write("contact: {law: zohdi, stiffness: 1.0e7, exponent: 2}\n")
    figure = pair_distance_figure(analyze(folder))
    gaps, shells = figure.axes
    assert gaps.get_xlim()[1] < 0.6
    assert gaps.lines[0].get_xdata()[-1] > 3.0
    assert "gaps beyond the axis, of fewer than 1 % of the particles: up to" in words(figure)
    figure.draw_without_rendering()
    low, high = shells.get_ylim()
    ticks = zip(shells.get_yticks(), shells.get_yticklabels(), strict=True)
    shown = [label.get_text() for tick, label in ticks if low <= tick <= high]
    assert len(shown) > 1
    assert [f"{float(text):g}" for text in shown] == shown


def test_contacts_that_swing_with_the_turns_are_not_joined(tmp_path):
    fast = make_clumped(tmp_path / "fast", magnetic=(100.0 * OMEGA, 0, 0))
    for figure, panels in ((clump_statistics_figure(fast), 3), (contact_figure(fast), 5)):
        lines = [
            line for axes in figure.axes[:panels] for line in axes.lines
            if len(line.get_xdata()) == 3
        ]  # fmt: skip
        assert {line.get_linestyle() for line in lines} <= {"None"}
        assert "too few to join the markers" in words(figure).replace("\n", " ")


@pytest.mark.parametrize("magnetic", [(0, 0, 0), (0, 0, OMEGA), (1, 2, -2)])
@pytest.mark.parametrize(("frames", "recorded"), [(1, True), (2, False)])
def test_clumps_in_other_fields(tmp_path, magnetic, frames, recorded):
    run = make_clumped(tmp_path / "run", frames=frames, magnetic=magnetic, recorded=recorded)
    draw_figures(run, tmp_path / "figures")
    assert (tmp_path / "figures" / "contacts.png").is_file()


def test_the_foot_of_a_figure_stays_clear_of_its_axes(clumped, tmp_path):
    alone = make_clumped(tmp_path / "run", recorded=False, magnetic=(1000.0, 2000.0, 500.0))
    for run in (clumped, alone):
        for draw in (
            clump_statistics_figure,
            contact_figure,
            pair_distance_figure,
            pair_history_figure,
        ):
            figure = draw(run)
            FigureCanvasAgg(figure)
            figure.draw_without_rendering()
            foot = figure.texts[-1].get_window_extent()
            for axes in figure.axes:
                label = axes.xaxis.label
                if label.get_text():
                    assert label.get_window_extent().y0 > foot.y1
            for text in figure.texts:
                assert text.get_window_extent().x1 < figure.bbox.x1


def test_particles_that_never_meet_have_no_network(tmp_path):
    make_run(tmp_path / "run", n=1, frames=2)
    with (tmp_path / "run" / "case.yaml").open("a") as case:
        case.write("contact: {law: zohdi, stiffness: 1.0e7, exponent: 2, damping: 1.0e5}\n")
    lonely = analyze(tmp_path / "run")
    draw_figures(lonely, tmp_path / "figures")
    names = {file.name for file in (tmp_path / "figures").iterdir()}
    assert "clumps.png" in names
    assert "contacts.png" not in names


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
def test_a_clumped_run_that_diverged(tmp_path):
    whole = make_clumped(tmp_path / "run", recorded=False).universe.trajectory
    position = np.array([ts.data["position"] for ts in whole])
    position[-1] = np.nan
    times = [ts.time for ts in whole]
    write_dump(tmp_path / "run" / "trajectory.lammpstrj", times, position, position)
    diverged = analyze(tmp_path / "run")
    assert diverged.clumps.results.pieces[-1] == 0
    draw_figures(diverged, tmp_path / "figures")


STORIES = {
    "bounces": [0.1, 0.05, -0.02, -0.03, 0.01, 0.1, 0.1],
    "bond forms, holds": [0.1, 0.01, -0.06, -0.1, -0.04, -0.04, -0.04],
    "bond from the start, holds": [-0.1, -0.09, -0.08, -0.07, -0.07, -0.07, -0.07],
    "bond from the start, breaks": [-0.1, -0.05, -0.02, 0.1, 1.0, 5.0, 9.0],
    "bounces 2 times": [0.1, -0.01, 0.1, -0.01, 0.1, 0.1, 0.1],
    "comes into contact": [0.3, 0.2, 0.2, 0.2, 0.2, 0.1, -0.01],
    "parts": [-0.01, 0.1, 0.1, 0.1, 0.1, 0.1, 0.1],
    "stays in contact": [-0.01, -0.02, -0.01, -0.02, -0.01, -0.02, -0.01],
}


@pytest.fixture(scope="module")
def paired(tmp_path_factory) -> Analyses:
    return make_pairs(tmp_path_factory.mktemp("runs") / "pairs", STORIES)


def test_each_pair_has_its_history_told(paired):
    figure = pair_history_figure(paired)
    gaps, forces = figure.axes[:8], figure.axes[8:16]
    assert len(figure.axes) == 17  # and a key: nothing turns
    for i, (name, story) in enumerate(STORIES.items()):
        assert gaps[i].get_title("left") == f"{2 * i + 1} and {2 * i + 2}: {name}"
        assert gaps[i].lines[-1].get_ydata() == pytest.approx(100.0 * np.array(story))
        pushes, pulls = (line.get_ydata() for line in forces[i].lines)
        assert pushes == pytest.approx(np.maximum(-np.array(story), 0.0))
        assert set(np.unique(pulls)) <= {0.0, 1.0}
        assert np.any(pulls > 0.0) == ("bond" in name)
        touching, bonded = (patch.get_data().values for patch in gaps[i].patches)
        assert touching.tolist() == [gap <= 0.0 for gap in story]
        assert bonded.tolist() == pulls.tolist()
    low, high = gaps[0].get_ylim()
    assert low < -10.0
    assert 30.0 < high < 40.0  # three of the largest overlap, not 900


@pytest.mark.parametrize(("before", "after"), [(1, 40), (40, 1), (30, 30), (1, 1)])
def test_the_time_axis_of_pairs_is_that_of_their_contacts(tmp_path, before, after):
    story = {"bounces": [0.1] * before + [-0.01] * 30 + [0.1] * after}
    figure = pair_history_figure(make_pairs(tmp_path / "run", story))
    drawn = figure.axes[0].lines[-1].get_xdata()  # of 30 frames, 14 more are half
    assert drawn[0] == pytest.approx(max(before - 14, 0))
    assert drawn[-1] == pytest.approx(before + 29 + min(after, 14))
    whole = before + after == 2
    remark = f"nothing touches in the rest of the run of {before + after + 29}"
    assert (remark in words(figure)) != whole


def test_only_the_first_of_many_pairs_are_drawn(tmp_path):
    story = {str(i): [0.1] * (10 - i) + [-0.01] * (i + 1) for i in range(10)}
    figure = pair_history_figure(make_pairs(tmp_path / "run", story))
    assert "the first 8 of 10 pairs that touch" in words(figure)
    assert figure.axes[0].get_title("left").startswith("5 and 6:")


FRICTION = ", friction: {stiffness: 1.0e14, static: 0.3, dynamic: 0.3}, rotation: true"


@pytest.mark.parametrize("contact", [FRICTION, FRICTION + ", damping: 1.0"])
def test_final_spins_stand_against_the_angle_of_impact_with_theory(tmp_path, contact):
    story = {"one": [0.3, 0.1, -0.1, 0.1], "other": [0.1, 0.05, -0.05, 0.3]}
    figure = pair_history_figure(
        make_pairs(tmp_path / "run", story, contact=contact, spins=[3.0, 7.0])
    )
    spins, impacts = figure.axes[4:6]
    assert [line.get_ydata()[-1] for line in spins.lines] == pytest.approx([3, 3, 7, 7])
    (points,) = (c for c in impacts.collections if isinstance(c, PathCollection))
    # Head on, at the speeds of the frames before the touch: differences of gaps over two frames.
    speeds = 2.0 * RADIUS * np.array([0.4, 0.15]) / 2e-3
    expected = np.stack([np.zeros(2), np.array([3.0, 7.0]) * RADIUS / speeds], axis=1)
    np.testing.assert_allclose(points.get_offsets(), expected, rtol=1e-9, atol=1e-9)
    curves = [line for line in impacts.lines if len(line.get_xdata()) > 100]
    if "damping" in contact:
        assert not curves
        return
    angles = np.radians(curves[1].get_xdata())
    law = interactions.collision_spin(2.0, angles, RADIUS, 3.0, 3.0, 0.3) * RADIUS / 2.0
    np.testing.assert_allclose(curves[1].get_ydata(), law)
    assert np.max(curves[0].get_ydata()) == pytest.approx(5.0 / 14.0)


def test_histories_are_for_few_particles_that_interact(tmp_path):
    assert make_run(tmp_path / "free", frames=2).histories is None
    touching = [-0.01, -0.01]
    many = make_pairs(tmp_path / "many", {str(i): touching for i in range(13)})
    assert many.histories is None
    few = make_pairs(tmp_path / "few", {str(i): touching for i in range(12)})
    assert len(few.histories.results.pairs) == 12
    apart = make_pairs(tmp_path / "apart", {"never": [0.1, 0.1]})
    draw_figures(apart, tmp_path / "figures")
    assert not (tmp_path / "figures" / "pair_histories.png").exists()
