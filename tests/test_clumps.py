"""Clumps and pair distances against configurations whose answer is known, and brute force."""

import json

import numpy as np
import pytest
from test_analysis import write_dump
from test_figures import make_clumped

from lammps_blast import neighbours
from lammps_blast.analysis import AnalysisError
from lammps_blast.analyze import analyze, report, summarize, write_results
from lammps_blast.clumps import (
    Clumps,
    PairDistances,
    clump_shapes,
    label_pieces,
    piece_sizes,
)
from lammps_blast.neighbours import close_pairs
from lammps_blast.trajectory import open_universe

R = 0.05
B = np.array([2.0, -1.0, 2.0]) / 3.0
ACROSS = np.array([1.0, 2.0, 0.0]) / np.sqrt(5.0)


def chain(length, direction=(1.0, 0.0, 0.0), start=(0.0, 0.0, 0.0), spacing=2.0 * R):
    return np.asarray(start) + spacing * np.outer(np.arange(length), direction)


def chains(lengths, spacing):
    """Chains of spheres, shuffled, and the number of the chain that each sphere belongs to."""
    rng = np.random.default_rng(5)
    directions = rng.normal(size=(len(lengths), 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    number = np.repeat(np.arange(len(lengths)), lengths)
    places = np.arange(len(lengths))[:, None] * [0.0, 0.0, 10.0]
    parts = zip(lengths, directions, places, strict=True)
    position = np.concatenate([chain(*part, spacing) for part in parts])
    order = rng.permutation(len(position))
    return position[order], number[order]


def universe_of(tmp_path, *positions, **properties):
    zeros = np.zeros_like(positions[0])
    frames = [(0.1 * i, position, zeros, zeros) for i, position in enumerate(positions)]
    return open_universe(write_dump(tmp_path / "dump", frames, **properties))


def brute_force_pairs(position, radius, reach):
    """Return pairs and their closeness from all N^2 distances."""
    first, second = np.triu_indices(len(position), 1)
    distance = np.linalg.norm(position[first] - position[second], axis=1)
    closeness = distance / (radius[first] + radius[second])
    near = closeness <= reach
    return np.stack([first, second], axis=1)[near], closeness[near]


def random_cloud(seed, spread, count=400):
    """Spheres in a cube, radii from 1 to exp(spread) times the smallest, many of them close."""
    rng = np.random.default_rng(seed)
    radius = 0.02 * np.exp(spread * rng.random(count))
    return rng.random((count, 3)) * (20.0 * np.sum(radius**3)) ** (1.0 / 3.0), radius


@pytest.mark.parametrize("spacing", [2.0 * R * 0.99, 2.0 * R * 1.0199])
def test_chains_are_told_apart_and_ranked(tmp_path, spacing):
    lengths = [1, 7, 2, 1, 4, 2]
    connected, number = chains(lengths, spacing)
    apart, _ = chains(lengths, 2.0 * R * 1.0201)
    mass = np.where(number == 4, 3.0, 1.0)
    universe = universe_of(tmp_path, apart, connected, mass=mass, radius=np.full(17, R))
    results = Clumps(universe).run().results
    assert results.pieces == pytest.approx([17, 6])
    assert results.clumps == pytest.approx([0, 4])
    assert results.largest == pytest.approx([1, 7])
    assert results.largest_fraction == pytest.approx([1 / 17, 7 / 17])
    assert results.mean_size == pytest.approx([1, 17 / 6])
    assert results.mass_mean_size == pytest.approx([1, (1 + 49 + 4 + 1 + 4 * 12 + 4) / 25])
    assert results.sizes.tolist() == [7, 4, 2, 2, 1, 1]
    for length, label in ((7, 0), (4, 1)):
        assert set(np.flatnonzero(results.labels == label)) == set(
            np.flatnonzero(number == lengths.index(length))
        )
    assert len({(a, b) for a, b in zip(number, results.labels, strict=True)}) == 6
    assert results.times == pytest.approx([0.0, 0.1])


@pytest.mark.parametrize("radii", [(0.05, 0.05), (0.3, 0.004), (0.06, 0.07)])
@pytest.mark.parametrize("gap", [0.0, 0.02, 1.5])
def test_the_gap_is_measured_in_mean_diameters(radii, gap):
    for just, pieces in ((1.0 - 1e-9, 1), (1.0 + 1e-9, 2)):
        distance = sum(radii) * (1.0 + gap) * just
        position = np.array([[1.0, 2.0, 3.0], [1.0, 2.0, 3.0] + distance * B])
        assert len(piece_sizes(label_pieces(position, np.array(radii), gap))) == pieces


@pytest.mark.parametrize("spread", [0.0, 1.0, 4.0], ids=["equal", "mixed", "very unequal"])
@pytest.mark.parametrize("block", [16384, 9], ids=["whole", "in blocks"])
@pytest.mark.parametrize("reach", [1.0, 1.1, 3.0])
def test_pairs_are_those_of_brute_force(monkeypatch, spread, block, reach):
    monkeypatch.setattr(neighbours, "BLOCK", block)
    position, radius = random_cloud(1, spread)
    pairs, closeness = close_pairs(position, radius, reach)
    expected, expected_closeness = brute_force_pairs(position, radius, reach)
    assert len(expected) > 50
    np.testing.assert_array_equal(pairs, expected)
    np.testing.assert_allclose(closeness, expected_closeness, rtol=1e-14)


@pytest.mark.parametrize("spread", [0.0, 3.0])
def test_pieces_are_those_of_a_flood(spread):
    position, radius = random_cloud(2, spread)
    neighbours = [set() for _ in radius]
    for a, b in brute_force_pairs(position, radius, 1.02)[0]:
        neighbours[a].add(b)
        neighbours[b].add(a)
    labels = label_pieces(position, radius)
    sizes = piece_sizes(labels)
    assert sizes.sum() == len(radius)
    assert sizes[0] > 3
    assert np.all(np.diff(sizes) <= 0)
    for start in range(len(radius)):
        flooded, border = {start}, {start}
        while border:
            border = set().union(*(neighbours[i] for i in border)) - flooded
            flooded |= border
        assert set(np.flatnonzero(labels == labels[start])) == flooded


def test_a_sphere_that_touches_many_small_ones_joins_them():
    rng = np.random.default_rng(3)
    direction = rng.normal(size=(200, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    position = np.vstack([np.zeros(3), 1.001 * direction])
    radius = np.append(1.0, np.full(200, 1e-3))
    assert piece_sizes(label_pieces(position, radius)).tolist() == [201]
    assert len(piece_sizes(label_pieces(position[1:], radius[1:]))) > 150


def shapes_of(*clumps, mass=None, radius=R, axis=3.0 * B):
    position = np.concatenate(clumps)
    labels = np.repeat(np.arange(len(clumps)), [len(clump) for clump in clumps])
    mass = np.ones(len(position)) if mass is None else mass
    return clump_shapes(position, np.full(len(position), radius), mass, labels, axis)


@pytest.mark.parametrize("length", [4, 9])
def test_rods_along_and_across_the_field(length):
    square = (2.0 * R) ** 2 * (length**2 - 1) / 12.0  # of equidistant points on a line
    own = R**2 / 5.0
    shapes = shapes_of(chain(length, B, [5, 5, 5]), chain(length, ACROSS, [-5, 3, 2]))
    assert shapes.size.tolist() == [length, length]
    assert shapes.radius_of_gyration == pytest.approx(2 * [np.sqrt(square + 3 * own)], rel=1e-12)
    assert shapes.along == pytest.approx([np.sqrt(square + own), np.sqrt(own)], rel=1e-12)
    assert shapes.across == pytest.approx([np.sqrt(own), np.sqrt(square / 2 + own)], rel=1e-12)
    line = square**2 / (square + 3 * own) ** 2
    assert shapes.asphericity == pytest.approx([line, line], rel=1e-12)
    assert shapes.along_over_across[0] > 1.0 > shapes.along_over_across[1]


def test_a_tetrahedron_is_as_round_as_a_ball():
    corners = R / np.sqrt(2.0) * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    shapes = shapes_of(corners + 7.0)
    assert shapes.along_over_across == pytest.approx([1.0])
    assert shapes.asphericity == pytest.approx([0.0], abs=1e-12)
    assert shapes.alignment == pytest.approx(1.0)


def test_rods_in_all_directions_are_not_aligned():
    rods = [chain(8, direction, 9.0 * direction) for direction in np.eye(3)]
    assert shapes_of(*rods).alignment == pytest.approx(1.0)
    assert shapes_of(*rods[:2], axis=[1, 0, 0]).alignment > 1.2
    assert shapes_of(*rods[:2], axis=[0, 0, 1]).alignment < 0.3


def test_a_heavy_sphere_draws_the_centre_to_it():
    position, mass = chain(4, B), np.array([1.0, 2.0, 3.0, 10.0])
    place = 2.0 * R * np.arange(4)
    spread = np.average((place - np.average(place, weights=mass)) ** 2, weights=mass)
    shapes = shapes_of(position, mass=mass, radius=0.0)
    assert shapes.along == pytest.approx([np.sqrt(spread)], rel=1e-12)
    assert shapes.mass == pytest.approx([16.0])


def test_clumps_of_three_have_no_shape():
    shapes = shapes_of(chain(3))
    assert len(shapes) == 0
    assert np.isnan(shapes.alignment)


def test_particles_without_a_place_belong_to_no_piece(tmp_path):
    position = chain(6)
    lost = position.copy()
    lost[2] = np.nan
    everything_lost = np.full((6, 3), np.nan)
    universe = universe_of(tmp_path, position, everything_lost, lost, radius=np.full(6, R))
    results = Clumps(universe).run().results
    assert results.pieces == pytest.approx([1, 0, 2])
    assert results.largest[[0, 2]] == pytest.approx([6, 3])
    assert np.isnan(results.largest[1])
    assert results.labels.tolist() == [1, 1, -1, 0, 0, 0]


@pytest.mark.parametrize("analysis", [Clumps, PairDistances])
def test_radii_are_needed(tmp_path, analysis):
    bare = universe_of(tmp_path, chain(3), columns="id type mass x y z")
    with pytest.raises(AnalysisError, match="no radii"):
        analysis(bare)


@pytest.mark.parametrize(
    "options", [{"gap": -0.1}, {"gap": np.nan}, {"axis": [0, 0, 0]}, {"axis": [np.nan, 0, 1]}]
)
def test_options_without_meaning_are_refused(tmp_path, options):
    with pytest.raises(AnalysisError):
        Clumps(universe_of(tmp_path, chain(3)), **options)


@pytest.mark.parametrize("block", [16384, 50])
def test_pair_distances_are_those_of_brute_force(tmp_path, monkeypatch, block):
    monkeypatch.setattr(neighbours, "BLOCK", block)
    position, radius = random_cloud(4, 1.0, count=200)
    universe = universe_of(tmp_path, position, 10.0 * position, radius=radius)
    results = PairDistances(universe, reach=3.0, bins=4).run().results
    for frame, scale in enumerate((1.0, 10.0)):
        pairs, closeness = brute_force_pairs(scale * position, radius, 3.0)
        edges = np.linspace(0.0, 3.0, 13)
        volume = 4.0 / 3.0 * np.pi * (edges[1:] ** 3 - edges[:-1] ** 3)
        counted = results.neighbours[frame] * volume * 200 / 2
        np.testing.assert_allclose(counted, np.histogram(closeness, edges)[0], atol=1e-9)
        nearest = np.full(200, np.inf)
        for (a, b), distance in zip(pairs, closeness, strict=True):
            nearest[[a, b]] = np.minimum(nearest[[a, b]], distance)
        np.testing.assert_allclose(results.nearest_gap[frame], nearest - 1.0, rtol=1e-12)
    assert np.isinf(results.nearest_gap[1]).any()


def test_only_the_chosen_frames_are_counted(tmp_path):
    universe = universe_of(tmp_path, *(chain(2, spacing=0.1 * k) for k in (1.25, 2.25, 3.25)))
    distances = PairDistances(universe, reach=5.0, bins=2)
    results = distances.run(frames=[0, 2]).results
    assert results.times == pytest.approx([0.0, 0.2])
    assert results.neighbours.shape == (2, 10)
    assert [np.flatnonzero(row).tolist() for row in results.neighbours] == [[1], [3]]
    # Two particles of radius 0.1, with one neighbour each, in the shell from 0.5 to 1.
    assert results.neighbours[0, 1] == pytest.approx(1.0 / (4.0 / 3.0 * np.pi * (1 - 0.5**3)))
    assert results.nearest_gap[:, 0] == pytest.approx([0.625 - 1.0, 1.625 - 1.0])


def test_clumps_are_left_in_a_table_and_in_the_summary(tmp_path):
    run = make_clumped(tmp_path / "run")  # chains of 6 and 3 and two alone, five contacts recorded
    write_results(run, tmp_path, figures=False)
    summary = json.loads((tmp_path / "summary.json").read_text())
    clumps, contacts = summary["clumps"], summary["contacts"]
    assert (clumps["pieces_first"], clumps["pieces_last"], clumps["clumps"]) == (11, 4, 2)
    assert clumps["largest"] == 6
    assert clumps["sizes"] == {"1": 2, "3": 1, "6": 1}
    assert clumps["shape"]["clumps"] == 1
    assert clumps["shape"]["along_over_across"] == pytest.approx(
        np.sqrt(R**2 / 5 / ((2 * R * 0.999) ** 2 * 35 / 24 + R**2 / 5))
    )
    assert contacts["source"] == "recorded"
    assert (contacts["first"], contacts["last"], contacts["most"]) == (0, 5, 5)
    assert contacts["largest_normal_force"] == 50.0
    table = np.genfromtxt(tmp_path / "clumps.csv", delimiter=",", names=True)
    assert table["pieces"].tolist() == [11, 11, 4]
    assert table["contacts"].tolist() == [0, 0, 5]
    assert table["mean_normal_force"][2] == 30.0
    assert "bonded_fraction" not in table.dtype.names
    text = report(summary)
    assert "11 pieces -> 4, 2 of them clumps of two or more; the largest holds 6 part" in text
    assert "0 contacts -> 5, at most 5; largest strain 0.001" in text


def test_clumps_are_sought_where_particles_meet_and_nowhere_else(tmp_path):
    make_clumped(tmp_path / "run")
    folder, case = tmp_path / "run", tmp_path / "run" / "case.yaml"
    text = case.read_text()
    case.write_text(text[: text.index("contact:")])
    silent = analyze(folder)
    assert (silent.clumps, silent.contacts, silent.distances) == (None, None, None)
    assert not {"clumps", "contacts"} & set(summarize(silent))
    case.unlink()
    lone = analyze(folder)
    assert lone.clumps.results.pieces[-1] == 4
    assert lone.contacts.results.contacts[-1] == 7  # those in the geometry, not those on record
    universe_of(tmp_path, chain(3), chain(3, spacing=3.0 * R), radius=np.full(3, R))
    assert analyze(tmp_path / "dump").clumps is None
