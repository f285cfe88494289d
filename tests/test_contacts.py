"""Contact networks: dumps of contacts, whole and damaged, and lattices whose contacts are known."""

import warnings

import numpy as np
import pytest
from test_analysis import write_dump

from lammps_blast.analysis import AnalysisError
from lammps_blast.contacts import ContactFrames, Contacts, distribution_about_mean
from lammps_blast.trajectory import TrajectoryError, open_universe

R = 0.05
COLUMNS = "id1 id2 strain normal_force damping_force friction_force bond_force bond_friction_force"
ROWS = (
    "17 243 0.0012 5.1 0.2 0.0 0 0\n3 99 0.0007 1.1 -0.1 0.3 2.5 0.25\n",
    "",
    "3 17 1.5e-05 7 0 0 0.5 0\n",
)


def frame_text(step, rows="", columns=COLUMNS, *, first=False, time=None):
    count = rows.count("\n")
    units = "ITEM: UNITS\nsi\n" if first else ""
    return (
        f"{units}ITEM: TIME\n{step / 10 if time is None else time}\nITEM: TIMESTEP\n{step}\n"
        f"ITEM: NUMBER OF ENTRIES\n{count}\nITEM: BOX BOUNDS ss ss ss\n"
        f"-1.0 1.0\n-1.0 1.0\n-1.0 1.0\nITEM: ENTRIES {columns} \n{rows}"
    )


def whole_text():
    return "".join(frame_text(i, rows, first=i == 0) for i, rows in enumerate(ROWS))


def dump_of(tmp_path, text):
    path = tmp_path / "contacts.lammpsdump"
    path.write_text(text)
    return path


def universe_of(tmp_path, *positions, **properties):
    zeros = np.zeros_like(positions[0])
    frames = [(0.1 * i, position, zeros, zeros) for i, position in enumerate(positions)]
    return open_universe(write_dump(tmp_path / "dump", frames, **properties))


def test_a_dump_of_contacts_holds_what_was_written(tmp_path):
    frames = ContactFrames(dump_of(tmp_path, whole_text()))
    assert len(frames) == 3
    assert frames.steps == [0, 1, 2]
    first, empty, last = frames
    assert first.ids.tolist() == [[17, 243], [3, 99]]
    assert first.strain.tolist() == [0.0012, 0.0007]
    assert first.normal_force.tolist() == [5.1, 1.1]
    assert first.damping_force.tolist() == [0.2, -0.1]
    assert first.friction_force.tolist() == [0.0, 0.3]
    assert first.bond_force.tolist() == [0.0, 2.5]
    assert first.bond_friction_force.tolist() == [0.0, 0.25]
    assert empty.ids.shape == (0, 2)
    assert len(empty.strain) == len(empty.normal_force) == 0
    assert (last.time, last.step, last.strain.tolist()) == (0.2, 2, [1.5e-05])
    assert frames.at_step(2).ids.tolist() == [[3, 17]]
    assert frames.at_step(7) is None


def test_columns_are_found_by_their_names(tmp_path):
    text = frame_text(5, "0.25 8 9 4\n", "strain id2 more id1")
    (frame,) = ContactFrames(dump_of(tmp_path, text))
    assert frame.ids.tolist() == [[4, 8]]
    assert frame.strain.tolist() == [0.25]
    assert frame.normal_force is None
    assert frame.bond_force is None


def test_a_file_cut_anywhere_keeps_its_complete_frames(tmp_path):
    text = whole_text()
    ends = np.cumsum([len(frame_text(i, rows, first=i == 0)) for i, rows in enumerate(ROWS)])
    for cut in range(1, len(text) + 1):
        path = dump_of(tmp_path, text[:cut])
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            frames = ContactFrames(path)
        assert len(frames) == np.count_nonzero(ends <= cut), repr(text[:cut][-40:])
        assert len(caught) == (cut not in ends), repr(text[:cut][-40:])
        assert [len(frame.strain) for frame in frames] == [2, 0, 1][: len(frames)]


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda text: "", "empty"),
        (lambda text: "id1,id2\n1,2\n", "not a LAMMPS dump of contacts"),
        (lambda text: text.replace("ENTRIES", "ATOMS"), "not a LAMMPS dump of contacts"),
        (lambda text: text.replace("TIMESTEP\n1\n", "TIMESTEP\none\n"), "frame 1: damaged header"),
        (lambda text: text.replace("TIMESTEP\n1\n", "TIMELESS\n1\n"), "frame 1: damaged header"),
        (lambda text: text.replace("17 243 ", "17 "), "step 0: damaged"),
        (lambda text: text.replace("17 243 ", "17 two "), "step 0: damaged"),
        (lambda text: text.replace("17 243 ", "17 243.5 "), "step 0: damaged: an id that is not"),
        (lambda text: text.replace("3 99 0.0", "3 99 0.0\n3 99 0.0"), "2 contacts announced, 3"),
        (lambda text: text.replace("id2", "id3"), "no column id2"),
    ],
)
def test_damaged_dumps_are_refused(tmp_path, damage, message):
    path = dump_of(tmp_path, damage(whole_text()))
    with pytest.raises(TrajectoryError, match=message):
        list(ContactFrames(path))


def test_a_missing_dump_is_refused(tmp_path):
    with pytest.raises(TrajectoryError, match="cannot be read"):
        ContactFrames(tmp_path / "nowhere")


@pytest.mark.parametrize("strain", [0.01, -0.01])
@pytest.mark.parametrize("n", [2, 5])
def test_contacts_of_a_simple_cubic_block(tmp_path, n, strain):
    spacing = 2.0 * R * (1.0 - strain)
    block = spacing * np.stack(np.meshgrid(*3 * [np.arange(n)]), axis=-1).reshape(-1, 3)
    universe = universe_of(tmp_path, 2.0 * block, block, radius=np.full(n**3, R))
    results = Contacts(universe).run().results
    bonds = 3 * n**2 * (n - 1) if strain > 0 else 0
    assert results.contacts == pytest.approx([0, bonds])
    assert results.coordination == pytest.approx([0, 2 * bonds / n**3])
    assert results.largest_strain == pytest.approx([0, max(strain, 0.0)], abs=1e-12)
    assert results.mean_normal_force is None
    assert results.bonded_fraction is None
    assert len(results.last) == bonds
    assert results.fullest.frame == (1 if bonds else 0)
    apart = np.diff(block[results.last.pairs], axis=1)
    assert np.linalg.norm(apart, axis=-1) == pytest.approx(spacing)


def test_strain_is_a_part_of_the_sum_of_unequal_radii(tmp_path):
    position = np.array([[0.0, 0.0, 0.0], [0.0, 0.9, 0.0]])
    universe = universe_of(tmp_path, position, radius=np.array([0.7, 0.3]))
    assert Contacts(universe).run().results.largest_strain == pytest.approx([0.1])


def recorded_run(tmp_path, text):
    """A trajectory of three frames whose particles have the ids 3, 17, 99 and 243."""
    position = np.arange(12.0).reshape(4, 3)
    path = tmp_path / "dump"
    universe_of(tmp_path, position, position, position)
    renamed = path.read_text().split("\n")
    for i, line in enumerate(renamed):
        if len(line.split()) == 14:
            number, rest = line.split(maxsplit=1)
            renamed[i] = f"{(3, 17, 99, 243)[int(number) - 1]} {rest}"
    path.write_text("\n".join(renamed))
    return open_universe(path), ContactFrames(dump_of(tmp_path, text))


def test_recorded_contacts_are_known_with_their_forces(tmp_path):
    results = Contacts(*recorded_run(tmp_path, whole_text())).run().results
    assert results.contacts == pytest.approx([2, 0, 1])
    assert results.coordination == pytest.approx([1.0, 0.0, 0.5])
    assert results.largest_strain == pytest.approx([0.0012, 0.0, 1.5e-05])
    assert results.mean_normal_force == pytest.approx([3.1, np.nan, 7.0], nan_ok=True)
    assert results.largest_normal_force == pytest.approx([5.1, 0.0, 7.0])
    assert results.bonded_fraction == pytest.approx([0.5, np.nan, 1.0], nan_ok=True)
    assert results.times == pytest.approx([0.0, 0.1, 0.2])
    assert results.fullest.time == 0.0
    assert results.fullest.pairs.tolist() == [[1, 3], [0, 2]]
    assert results.last.pairs.tolist() == [[0, 1]]
    assert results.last.time == pytest.approx(0.2)


def test_a_frame_without_contacts_on_record_is_unknown_not_empty(tmp_path):
    text = frame_text(0, ROWS[0], first=True) + frame_text(2, ROWS[2])
    results = Contacts(*recorded_run(tmp_path, text)).run().results
    assert results.contacts == pytest.approx([2, np.nan, 1], nan_ok=True)
    assert results.last.frame == 2


def test_contacts_of_unknown_particles_are_refused(tmp_path):
    text = whole_text().replace("3 99", "3 98")
    with pytest.raises(TrajectoryError, match="step 0: no particle has the id 98"):
        Contacts(*recorded_run(tmp_path, text)).run()
    text = whole_text().replace("3 99", "3 999")
    with pytest.raises(TrajectoryError, match="no particle has the id 999"):
        Contacts(*recorded_run(tmp_path, text)).run()


def test_contacts_need_radii_or_a_record_and_ids(tmp_path):
    position = np.arange(12.0).reshape(4, 3)
    bare = universe_of(tmp_path, position, columns="id type mass x y z")
    with pytest.raises(AnalysisError, match="no radii"):
        Contacts(bare)
    with pytest.warns(UserWarning, match="no id column"):
        nameless = universe_of(tmp_path, position, columns="type radius x y z")
    recorded = ContactFrames(dump_of(tmp_path, whole_text()))
    with pytest.raises(AnalysisError, match="no ids"):
        Contacts(nameless, recorded)


def test_force_distribution_has_unit_integral_and_the_exponential_form():
    force = 40.0 * np.random.default_rng(1).exponential(size=20000)
    edges, density = distribution_about_mean(force)
    assert density @ np.diff(edges) == pytest.approx(1.0, rel=1e-12)
    assert edges[0] == 0.0
    assert edges[-1] == pytest.approx(force.max() / force.mean())
    # The mean of exp(-x) over a bin.
    exact = -np.diff(np.exp(-edges)) / np.diff(edges)
    assert density[:8] == pytest.approx(exact[:8], rel=0.05)


@pytest.mark.parametrize("force", [[], [0.0, 0.0], [np.nan, 1.0]])
def test_forces_without_a_mean_have_no_distribution(force):
    assert distribution_about_mean(np.array(force)) is None
