"""The particles: the law of the packing, its limits, and files of particles."""

from __future__ import annotations

from fractions import Fraction
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from scipy import stats
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

from lammps_blast.case import Case, CaseError, parse_case
from lammps_blast.particles import (
    PackingError,
    ParticleFileError,
    Particles,
    _add_sequentially,
    _Room,
    coincident_pair,
    create_particles,
    deepest_overlap,
    densest_relaxed,
    overlap_depth,
    pack_spheres,
    place_for_relaxation,
    read_particles,
)

HEADER = "x,y,z,radius,density,charge_per_mass"


@pytest.mark.parametrize(
    ("count", "fraction"),
    [(1, 1.0), (1, 0.001), (2, 0.1), (20, 0.2), (2000, 0.25), (2000, 0.34), (1000, 1e-20)],
)
def test_packed_spheres_lie_inside_and_apart(count: int, fraction: float) -> None:
    radius = 2.0 * (fraction / count) ** (1 / 3)
    centres = pack_spheres(count, radius, 2.0, np.random.default_rng(3))
    assert centres.shape == (count, 3)
    assert np.all(np.linalg.norm(centres, axis=1) + radius <= 2.0)
    assert np.all(pdist(centres) >= 2 * radius)


def test_the_seed_decides_the_packing() -> None:
    first, again, other = (
        pack_spheres(500, 0.08, 1.0, np.random.default_rng(seed)) for seed in (5, 5, 6)
    )
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_a_dilute_packing_is_uniform_in_the_ball_of_centres() -> None:
    count, radius = 20_000, 1e-3
    centres = pack_spheres(count, radius, 1.0, np.random.default_rng(11))
    distance = np.linalg.norm(centres, axis=1)
    volume_inside = (distance / (1 - radius)) ** 3
    cosine, azimuth = centres[:, 2] / distance, np.arctan2(centres[:, 1], centres[:, 0])
    for variate, low, high in (
        (volume_inside, 0, 1),
        (cosine, -1, 1),
        (azimuth, -np.pi, np.pi),
    ):
        counts, _ = np.histogram(variate, bins=50, range=(low, high))
        assert counts.sum() == count
        assert stats.chisquare(counts).pvalue > 1e-3
    shell, octant = (8 * volume_inside).astype(int), (centres > 0) @ [1, 2, 4]
    assert stats.chisquare(np.bincount(8 * shell + octant, minlength=64)).pvalue > 1e-3
    assert cubes_are_filled_alike(centres, 1 - radius)


def cubes_are_filled_alike(centres: np.ndarray, reach: float, across: int = 12) -> bool:
    """Tell by chi-square whether cubes that lie wholly in a ball hold their part of all centres."""
    corner = np.arange(-across // 2, across // 2)
    outermost = np.maximum(abs(corner), abs(corner + 1))
    inside = sum(np.meshgrid(*[outermost**2] * 3)) <= (across / 2) ** 2
    counts, _ = np.histogramdd(centres, bins=across, range=[(-reach, reach)] * 3)
    part = (2 / across) ** 3 / (4 / 3 * np.pi)
    observed = np.append(counts[inside], len(centres) - counts[inside].sum())
    expected = np.append(np.full(inside.sum(), part), 1 - inside.sum() * part) * len(centres)
    return bool(stats.chisquare(observed, expected).pvalue > 1e-3)


def add_one_by_one(
    count: int, radius: float, domain_radius: float, rng: np.random.Generator
) -> np.ndarray:
    """Random sequential addition as it is defined."""
    centres: list[np.ndarray] = []
    while len(centres) < count:
        centre = rng.uniform(-domain_radius, domain_radius, 3)
        inside = np.linalg.norm(centre) + radius <= domain_radius
        if inside and all(np.linalg.norm(centre - other) >= 2 * radius for other in centres):
            centres.append(centre)
    return np.array(centres)


def test_the_packing_follows_the_law_of_addition_one_by_one() -> None:
    # Six such spheres leave little room for the last: the cells are divided in most trials.
    count, radius, trials = 6, 0.3, 500
    packings = {
        pack: [pack(count, radius, 1.0, np.random.default_rng([seed, 7])) for seed in range(trials)]
        for pack in (pack_spheres, add_one_by_one)
    }
    for measure in (
        lambda centres: np.linalg.norm(centres[0]),
        lambda centres: np.linalg.norm(centres[1]),
        lambda centres: np.linalg.norm(centres[-1]),
        lambda centres: pdist(centres).min(),
        lambda centres: pdist(centres).mean(),
    ):
        samples = [[measure(centres) for centres in group] for group in packings.values()]
        assert stats.ks_2samp(*samples).pvalue > 1e-3


@pytest.mark.parametrize("fraction", [0.02, 0.25, 0.33])
def test_rounds_accept_what_one_by_one_would_of_the_same_draws(
    fraction: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With this, what is left of the law is that draws are uniform and no room is lost."""
    rounds = []
    draw = _Room.draw

    def recorded(room: _Room, draws: int, rng: np.random.Generator) -> np.ndarray:
        rounds.append(draw(room, draws, rng))
        return rounds[-1]

    monkeypatch.setattr(_Room, "draw", recorded)
    count = 800
    radius = (fraction / count) ** (1 / 3)
    centres = pack_spheres(count, radius, 1.0, np.random.default_rng(12))
    expected = np.empty((0, 3))
    for candidate in np.concatenate(rounds):
        apart = expected - candidate
        if not len(expected) or np.einsum("ij,ij->i", apart, apart).min() >= (2 * radius) ** 2:
            expected = np.vstack([expected, candidate])
        if len(expected) == count:
            break
    np.testing.assert_array_equal(centres, expected)


def test_draws_are_uniform_in_what_is_left_of_a_divided_room() -> None:
    radius, rng = 0.08, np.random.default_rng(14)
    placed = pack_spheres(480, radius, 1.0, rng)
    room = _Room.of_domain(radius, 1.0).divided(placed).divided(placed)
    outermost = np.linalg.norm(np.abs(room.corners + room.edge / 2) + room.edge / 2, axis=1)
    within_reach = np.flatnonzero(outermost <= room.reach)
    points = room.draw(400_000, rng)
    _, cell = cKDTree(room.corners + room.edge / 2).query(points, p=np.inf)
    counts = np.bincount(cell, minlength=len(room.corners))[within_reach]
    assert counts.mean() > 20
    assert stats.chisquare(counts).pvalue > 1e-3
    within = (points - room.corners[cell])[np.isin(cell, within_reach)] / room.edge
    for axis in within.T:
        assert stats.chisquare(np.histogram(axis, bins=20, range=(0, 1))[0]).pvalue > 1e-3


def add_many_one_by_one(count: int, radius: float, rng: np.random.Generator) -> np.ndarray:
    """As `add_one_by_one` for a domain of 1 m, quicker: all spheres are looked at together."""
    centres = np.empty((count, 3))
    placed = 0
    while placed < count:
        for centre in rng.uniform(radius - 1, 1 - radius, (1000, 3)):
            if centre @ centre > (1 - radius) ** 2:
                continue
            apart = centres[:placed] - centre
            if placed == 0 or np.einsum("ij,ij->i", apart, apart).min() >= (2 * radius) ** 2:
                centres[placed] = centre
                placed += 1
                if placed == count:
                    break
    return centres


def structure(centres: np.ndarray, radius: float) -> np.ndarray:
    """Numbers that tell how centres lie to each other, to the wall, and in their order.

    Pairs by their distance up to two diameters (the pair correlation), centres by their distance
    from the middle, mean and spread of the number of neighbours, and how near its nearest
    neighbour the last tenth of the spheres lies.
    """
    pairs = pdist(centres)
    near, _ = np.histogram(pairs, bins=10, range=(2 * radius, 4 * radius))
    shells, _ = np.histogram(np.linalg.norm(centres, axis=1), bins=8, range=(0, 1 - radius))
    tree = cKDTree(centres)
    neighbours = tree.query_ball_point(centres, 3 * radius, return_length=True)
    last = tree.query(centres[-len(centres) // 10 :], k=2)[0][:, 1] / radius
    return np.array([*near, *shells, neighbours.mean(), neighbours.var(), last.mean(), last.max()])


@pytest.mark.parametrize("fraction", [0.1, 0.25])
def test_dense_packings_are_built_like_those_of_addition_one_by_one(fraction: float) -> None:
    count, trials = 200, 40
    radius = (fraction / count) ** (1 / 3)
    ours, plain = (
        np.array(
            [structure(pack(np.random.default_rng([seed, 9])), radius) for seed in range(trials)]
        )
        for pack in (
            lambda rng: pack_spheres(count, radius, 1.0, rng),
            lambda rng: add_many_one_by_one(count, radius, rng),
        )
    )
    # Of numbers that are zero in every trial, and equal, nothing is to be told.
    told = (ours.var(axis=0) + plain.var(axis=0)) > 0
    score = stats.ttest_ind(ours[:, told], plain[:, told], equal_var=False)
    assert told.sum() >= 20
    assert score.pvalue.min() > 1e-3 / told.sum()
    assert np.sqrt(np.mean(score.statistic**2)) < 1.7


def test_spheres_stop_finding_places_at_the_known_saturation() -> None:
    """0.384, the saturation of random sequential addition of spheres far from any wall."""
    radius = 0.04
    centres = _add_sequentially(10_000, _Room.of_domain(radius, 1.0), np.random.default_rng(17))
    inner = 1 - 4 * radius
    inside = np.sum(np.linalg.norm(centres, axis=1) <= inner)
    assert inside * (radius / inner) ** 3 == pytest.approx(0.384, rel=0.015)
    # No point of space is left where another sphere would fit.
    points = _Room.of_domain(radius, 1.0).draw(300_000, np.random.default_rng(18))
    assert cKDTree(centres).query(points)[0].max() < 2 * radius


def pairs_nearer_than(centres: np.ndarray, reach: float) -> np.ndarray:
    """Pairs of centres, (P, 2), found by comparing neighbouring cubes of edge `reach`."""
    cubes = np.floor((centres - centres.min(axis=0)) / reach).astype(np.int64) + 1
    strides = np.array(
        [1, cubes[:, 0].max() + 2, (cubes[:, 0].max() + 2) * (cubes[:, 1].max() + 2)]
    )
    cube = cubes @ strides
    order = np.argsort(cube, kind="stable")
    found = []
    for offset in product((-1, 0, 1), repeat=3):
        beside = cube + offset @ strides
        start, stop = (np.searchsorted(cube[order], beside, side) for side in ("left", "right"))
        for step in range((stop - start).max()):
            first = np.flatnonzero(start + step < stop)
            second = order[start[first] + step]
            near = np.linalg.norm(centres[first] - centres[second], axis=1) < reach
            pairs = np.stack([first[near], second[near]], axis=1)
            found.append(pairs[pairs[:, 0] < pairs[:, 1]])
    return np.concatenate(found)


def check_exactly(centres: np.ndarray, radius: float) -> None:
    """Find the closest pairs and the outermost spheres, and judge them in exact arithmetic."""
    pairs = pairs_nearer_than(centres, 2.02 * radius)
    assert len(pairs) > 100
    distance = np.linalg.norm(centres[pairs[:, 0]] - centres[pairs[:, 1]], axis=1)
    for i, j in pairs[np.argsort(distance)[:50]]:
        a, b = ([Fraction(x) for x in centres[k].tolist()] for k in (i, j))
        square = sum((x - y) ** 2 for x, y in zip(a, b, strict=True))
        assert square >= (2 * Fraction(radius)) ** 2
    for centre in centres[np.argsort(np.linalg.norm(centres, axis=1))[-50:]].tolist():
        assert sum(Fraction(x) ** 2 for x in centre) <= (1 - Fraction(radius)) ** 2


def check_evenness(centres: np.ndarray, radius: float) -> None:
    """Find neither shells nor a lattice, least of all that of the cells that are drawn from.

    Spheres that keep apart are spread more evenly than chance: a chi-square may be small.
    """
    distance = np.linalg.norm(centres, axis=1)
    inner = 1 - 8 * radius  # the wall, which orders the spheres next to it, is far away
    interior = centres[distance <= inner]
    shells, _ = np.histogram((distance[distance <= inner] / inner) ** 3, bins=40, range=(0, 1))
    octants = np.bincount((interior > 0) @ [1, 2, 4], minlength=8)
    assert all(stats.chisquare(counts).pvalue > 1e-3 for counts in (shells, octants))
    cell = 2 * (1 - radius) / np.ceil((1 - radius) / radius)
    for period in (cell, cell / 2, 2 * radius):
        place, _ = np.histogram((interior + 1 - radius) / period % 1, bins=16, range=(0, 1))
        by_axis = [
            np.histogram(axis, bins=16, range=(0, 1))[0]
            for axis in ((interior + 1 - radius) / period % 1).T
        ]
        assert all(stats.chisquare(counts).pvalue > 1e-3 for counts in (place, *by_axis))


@pytest.mark.parametrize("count", [30_000, pytest.param(1_000_000, marks=pytest.mark.slow)])
def test_many_spheres_lie_exactly_apart_and_evenly(count: int) -> None:
    radius = (0.25 / count) ** (1 / 3)
    centres = pack_spheres(count, radius, 1.0, np.random.default_rng(2016))
    assert len(centres) == count
    check_exactly(centres, radius)
    check_evenness(centres, radius)


def test_divided_room_holds_every_possible_centre() -> None:
    radius, rng = 0.1, np.random.default_rng(2)
    placed = pack_spheres(150, radius, 1.0, rng)
    room = _Room.of_domain(radius, 1.0)
    points = room.draw(300_000, rng)
    possible = points[cKDTree(placed).query(points)[0] >= 2 * radius]
    assert len(possible) > 1000
    volumes = []
    for _ in range(3):
        room = room.divided(placed)
        nearest_middle = cKDTree(room.corners + room.edge / 2).query(possible, p=np.inf)[0]
        assert np.all(nearest_middle <= room.edge / 2 * (1 + 1e-9))
        volumes.append(len(room.corners) * room.edge**3)
    assert volumes == sorted(volumes, reverse=True)


@pytest.mark.parametrize(
    ("count", "radius", "reached"),
    [(2, 0.5, 1), (2, 0.51, 1), (3, 0.49, None), (2000, 0.06, None), (2000, 0.07, None)],
)
def test_spheres_that_do_not_fit_are_refused(
    count: int, radius: float, reached: int | None
) -> None:
    with pytest.raises(PackingError) as caught:
        pack_spheres(count, radius, 1.0, np.random.default_rng(1))
    message = str(caught.value)
    assert f"of {count} spheres" in message
    assert f"{count * radius**3:.3f} asked" in message
    for key in ("particles.count", "particles.radius", "particles.packing.domain_radius"):
        assert key in message
    if reached is not None:
        assert f"only {reached} of" in message
    offered = "particles.packing.relax: true" in message
    assert offered == (count * radius**3 <= densest_relaxed(count))


@pytest.mark.parametrize(("count", "radius"), [(2_000_000_000, 0.05), (2, 1.0), (1, 1.001)])
def test_the_inconceivable_is_refused_at_once(count: int, radius: float) -> None:
    with pytest.raises(PackingError, match=r"no packing of equal spheres fills more than 0\.74"):
        pack_spheres(count, radius, 1.0, np.random.default_rng(1))


@pytest.mark.parametrize(("count", "fraction"), [(2000, 0.30), (300, 0.2), (1, 1.0)])
def test_what_is_packed_with_ease_needs_no_shrinking(count: int, fraction: float) -> None:
    radius = (fraction / count) ** (1 / 3)
    placed, packed = (
        place(count, radius, 1.0, np.random.default_rng(6))
        for place in (place_for_relaxation, pack_spheres)
    )
    np.testing.assert_array_equal(placed, packed)


@pytest.mark.parametrize(
    ("count", "fraction"),
    [(2000, 0.35), (2000, 0.5), (5000, 0.6), (40, 0.45), (6, 0.35), (2, 0.23)],
)
@pytest.mark.parametrize("seed", [1, 2])
def test_dense_clouds_are_placed_apart_inside_the_domain(
    count: int, fraction: float, seed: int
) -> None:
    radius = 2.0 * (fraction / count) ** (1 / 3)
    centres = place_for_relaxation(count, radius, 2.0, np.random.default_rng(seed))
    assert centres.shape == (count, 3)
    assert np.all(np.linalg.norm(centres, axis=1) + radius <= 2.0)
    # Shrunk to a volume fraction of 0.3 they do not overlap; a handful needs more room.
    assert pdist(centres).min() >= (1.5 if count >= 2000 else 0.8) * radius


def test_relaxed_particles_keep_their_full_radius_and_overlap() -> None:
    count, radius = 400, 0.1
    case = packed_case(count=count, radius=radius, packing={"domain_radius": 1.0, "relax": True})
    particles = create_particles(parse_case(case, Path()))
    np.testing.assert_array_equal(particles.radius, radius)
    np.testing.assert_allclose(particles.mass, 29.3215, rtol=1e-5)
    assert overlap_depth(particles) == pytest.approx(2 * radius - pdist(particles.position).min())
    assert 0 < overlap_depth(particles) < 0.5 * radius
    case["particles"]["packing"]["relax"] = False
    with pytest.raises(PackingError, match=r"or particles\.packing\.relax: true"):
        create_particles(parse_case(case, Path()))


@pytest.mark.parametrize(
    ("count", "radius"), [(2000, 0.0675), (20, 0.3), (2, 0.56), (2_000_000_000, 0.05)]
)
def test_clouds_too_dense_to_relax_are_refused(count: int, radius: float) -> None:
    with pytest.raises(PackingError, match=r"random close packing is near 0\.64") as caught:
        place_for_relaxation(count, radius, 1.0, np.random.default_rng(1))
    assert f"would fill {count * radius**3:.3g} of" in str(caught.value)
    assert "relax: true" not in str(caught.value)


def packed_case(**particles: object) -> dict[str, object]:
    section = {
        "count": 7,
        "radius": 0.05,
        "density": 7000.0,
        "charge_per_mass": 10.0,
        "packing": {"domain_radius": 1.0},
    }
    return {
        "name": "packed",
        "particles": {**section, **particles},
        "time": {"duration": 1, "step": 0.1},
    }


@pytest.mark.parametrize(("fraction", "positive"), [(1.0, 7), (0.0, 0), (0.4, 3), (0.6, 4)])
def test_packed_particles_are_at_rest_with_the_asked_charges(
    fraction: float, positive: int
) -> None:
    case = parse_case(packed_case(positive_fraction=fraction), Path())
    particles = create_particles(case)
    assert len(particles) == 7
    np.testing.assert_array_equal(particles.velocity, 0)
    np.testing.assert_array_equal(particles.angular_velocity, 0)
    np.testing.assert_allclose(particles.mass, 3.6652, rtol=1e-5)
    assert np.sum(particles.charge_per_mass == 10.0) == positive
    assert np.sum(particles.charge_per_mass == -10.0) == 7 - positive
    np.testing.assert_array_equal(particles.charge, particles.charge_per_mass * particles.mass)
    np.testing.assert_array_equal(particles.sign, 1)
    np.testing.assert_array_equal(particles.position, create_particles(case).position)


def test_which_particles_are_positive_is_drawn() -> None:
    particles = create_particles(
        parse_case(packed_case(count=400, radius=0.01, positive_fraction=0.5), Path())
    )
    positive = particles.charge_per_mass > 0
    assert positive.sum() == 200
    assert 60 < positive[:200].sum() < 140


@pytest.mark.parametrize(
    "extreme", [{"radius": 1e-90, "density": 1e-60}, {"radius": 1e-100, "density": 1e-99}]
)
def test_masses_beyond_floating_point_are_refused(extreme: dict[str, float]) -> None:
    with pytest.raises(CaseError, match="range of floating-point"):
        create_particles(parse_case(packed_case(**extreme), Path()))


def write_file(folder: Path, text: str) -> Path:
    path = folder / "particles.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_with_all_columns_in_any_order(tmp_path: Path) -> None:
    path = write_file(
        tmp_path,
        "wx,wy,wz,density, radius ,x,y,z,sign,vz,vy,vx,charge_per_mass\n"
        "1,2,3,7e3,.5,0,0,0,-1,6,5,4,-10\n\n"
        "0,0,0,1,0.25, 5 ,-5,1e-3,+1.0,0,0,0,0\n",
    )
    particles = read_particles(path)
    np.testing.assert_array_equal(particles.position, [[0, 0, 0], [5, -5, 1e-3]])
    np.testing.assert_array_equal(particles.velocity, [[4, 5, 6], [0, 0, 0]])
    np.testing.assert_array_equal(particles.angular_velocity, [[1, 2, 3], [0, 0, 0]])
    np.testing.assert_array_equal(particles.radius, [0.5, 0.25])
    np.testing.assert_array_equal(particles.density, [7000, 1])
    np.testing.assert_array_equal(particles.charge_per_mass, [-10, 0])
    np.testing.assert_array_equal(particles.sign, [-1, 1])


def test_a_case_finds_its_file_beside_it(tmp_path: Path) -> None:
    write_file(tmp_path, f"\ufeff{HEADER}\r\n0,0,0,1,1,1\r\n")
    source = {**packed_case(), "particles": {"file": "particles.csv"}}
    particles = create_particles(parse_case(source, tmp_path))
    assert isinstance(particles, Particles)
    np.testing.assert_array_equal(particles.velocity, [[0, 0, 0]])
    np.testing.assert_array_equal(particles.sign, [1])


ROW = "0,0,0,1,1,1"


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "line 1: must be a header"),
        (f"{HEADER}\n", "no particles"),
        (f"x,y,z,radius,density\n{ROW}", "line 1: column 'charge_per_mass': missing"),
        (f"x,y,z,raduis,density,charge_per_mass\n{ROW}", "did you mean 'radius'"),
        (f"{HEADER},sign\n{ROW},0", "line 2: column 'sign': must be 1 or -1, got '0'"),
        (f"{HEADER},sign\n{ROW},-2", "column 'sign': must be 1 or -1, got '-2'"),
        (f"{HEADER},sign\n{ROW},+", "column 'sign': must be a number, got"),
        (f"{HEADER},colour\n{ROW},1", "column 'colour': unknown column, known: x, y"),
        (f"{HEADER},x\n{ROW},1", "column 'x': given 2 times"),
        (f"{HEADER},vx,vz\n{ROW},1,1", "column 'vy': missing; give all of vx,vy,vz or none"),
        (f"{HEADER},wz\n{ROW},1", "column 'wx': missing"),
        (f"{HEADER}\n{ROW}\n5,0,zero,1,1,1", "line 3: column 'z': must be a number, got 'zero'"),
        (f"{HEADER}\n5,,0,1,1,1", "line 2: column 'y': must be a number, got ''"),
        (f"{HEADER}\n1_0,0,0,1,1,1", "line 2: column 'x': must be a number"),
        (f"{HEADER}\nnan,0,0,1,1,1", "line 2: column 'x': must be a finite number, got 'nan'"),
        (f"{HEADER}\n0,0,0,1,1,1e999", "column 'charge_per_mass': must be a finite number"),
        (f"{HEADER}\n0,0,0,0,1,1", "column 'radius': must be greater than 0, got '0'"),
        (f"{HEADER}\n0,0,0,1,-1,1", "column 'density': must be greater than 0, got '-1'"),
        (f"{HEADER}\n\n{ROW}\n0,0,0", "line 4: must have 6 fields as the header has, got 3"),
        (f"{HEADER}\n{ROW},7", "line 2: must have 6 fields as the header has, got 7"),
        (f'{HEADER}\n"0,0,0,1,1,1', "not CSV"),
        (f"{HEADER}\n{'9' * 200_000},0,0,1,1,1", "line 2 is longer"),
        (f"{HEADER}\n\x00\x1b,0,0,1,1,1", "line 2"),
        (
            f"{HEADER}\n{ROW}\n5,0,0,1,1,1\n0.5,0,0,1,1,1",
            "lines 2 and 4: .* distance 0.5 m, .* 2 m",
        ),
        (f"{HEADER}\n{ROW}\n{ROW}", "lines 2 and 3: .* distance 0 m"),
    ],
)
def test_bad_files_are_told_line_and_column(tmp_path: Path, text: str, expected: str) -> None:
    path = write_file(tmp_path, text)
    with pytest.raises(ParticleFileError, match=expected) as caught:
        read_particles(path)
    for problem in caught.value.problems:
        assert problem.startswith(f"particles.file: {path}: ")
        assert problem.isprintable()


def test_a_file_full_of_errors_is_cut_short(tmp_path: Path) -> None:
    path = write_file(tmp_path, HEADER + "\na,b,c,d,e,f" * 1000)
    with pytest.raises(ParticleFileError, match="further lines") as caught:
        read_particles(path)
    assert 20 <= len(caught.value.problems) < 30


@pytest.mark.parametrize("content", [None, b"\xff\xfe\x00\x01"])
def test_files_that_cannot_be_read(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "particles.csv"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ParticleFileError, match=r"No such file|not a text file"):
        read_particles(path)
    with pytest.raises(ParticleFileError, match="cannot be read"):
        read_particles(tmp_path)


def test_overlaps_are_accepted_on_request(tmp_path: Path) -> None:
    path = write_file(tmp_path, f"{HEADER}\n{ROW}\n{ROW}")
    assert len(read_particles(path, allow_overlap=True)) == 2


CONTACT = {"stiffness": 1e7, "exponent": 2}
REPULSION = {"scaling": "mass", "repulsion": {"strength": 1, "exponent": 2}, "cutoff": "all"}


def case_of_file(folder: Path, text: str, **sections: object) -> Case:
    write_file(folder, text)
    particles = {"file": "particles.csv", "allow_overlap": True}
    return parse_case({**packed_case(), "particles": particles, **sections}, folder)


@pytest.mark.parametrize("sections", [{"contact": CONTACT}, {"near_field": REPULSION}])
@pytest.mark.parametrize("apart", [0.0, 1e-13])
def test_particles_at_one_place_are_refused_where_they_interact(
    tmp_path: Path, sections: dict[str, object], apart: float
) -> None:
    text = f"{HEADER}\n0,0,0,1,1,1\n0,0,0.5,1,1,1\n{apart},0,0,0.5,1,1"
    with pytest.raises(ParticleFileError, match="lines 2 and 4: the particles are at one place"):
        create_particles(case_of_file(tmp_path, text, **sections))
    assert len(create_particles(case_of_file(tmp_path, text))) == 3
    near = text.replace(f"{apart},0,0", "1e-11,0,0")
    assert len(create_particles(case_of_file(tmp_path, near, **sections))) == 3


def test_one_coincidence_among_many_particles_is_found() -> None:
    position = np.random.default_rng(8).random((100_000, 3))
    radius = np.full(100_000, 1e-3)
    assert coincident_pair(position, radius) is None
    position[777] = position[91_234] + [0, 1e-15, 0]
    assert set(coincident_pair(position, radius) or ()) == {777, 91_234}
    assert coincident_pair(np.zeros((100_000, 3)), radius) is not None


ATTRACTION = {"strength": 1, "exponent": 1}


@pytest.mark.parametrize(
    ("scaling", "attributes", "key"),
    [
        ("charge", ["0,1", "0,-1"], "scaling: 'charge' needs charged particles"),
        ("charge", ["0,1", "5,-1"], None),
        ("charge", ["5,1", "-5,1"], None),
        ("charge", ["5,1", "5,-1"], "attraction.exponent: diverges"),
        ("mass", ["5,1", "-5,1"], "attraction.exponent: diverges"),
        ("mass", ["5,1", "5,-1"], None),
        ("mass", ["5,1", "5,-1", "5,-1"], "attraction.exponent: diverges"),
    ],
)
def test_near_field_of_particles_from_a_file(
    tmp_path: Path, scaling: str, attributes: list[str], key: str | None
) -> None:
    """Particles of unlike sign repel each other by what attracts those of like sign."""
    rows = [f"{place},0,0,0.1,1,{pair}" for place, pair in enumerate(attributes)]
    text = "\n".join([f"{HEADER},sign", *rows])
    near_field = {"scaling": scaling, "attraction": ATTRACTION, "cutoff": 0.5}
    case = case_of_file(tmp_path, text, near_field=near_field)
    if key:
        with pytest.raises(CaseError, match=rf"^near_field\.{key}"):
            create_particles(case)
    else:
        assert len(create_particles(case)) == len(attributes)
    if not key or "diverges" in key:
        create_particles(case_of_file(tmp_path, text, near_field=near_field, contact=CONTACT))


def test_touching_spheres_do_not_overlap() -> None:
    along = 0.1 * np.arange(50)
    position = np.stack([along, np.zeros(50), np.zeros(50)], axis=1)
    assert deepest_overlap(position, np.full(50, 0.05)) is None
    assert deepest_overlap(position, np.full(50, 0.05 * (1 + 1e-6))) is not None


def depths(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    distance = np.linalg.norm(position[:, None] - position, axis=-1)
    overlap = radius[:, None] + radius - distance
    np.fill_diagonal(overlap, -np.inf)
    return overlap


@pytest.mark.parametrize("spread", [0.0, 0.5, 4.0])
@pytest.mark.parametrize("size", [0.002, 0.01, 0.05])
@pytest.mark.parametrize("seed", range(6))
def test_deepest_overlap_as_by_brute_force(spread: float, size: float, seed: int) -> None:
    rng = np.random.default_rng(seed)
    position = rng.random((300, 3))
    radius = size * np.exp(spread * rng.normal(size=300) - spread**2)
    expected = depths(position, radius)
    pair = deepest_overlap(position, radius)
    if expected.max() <= 0:
        assert pair is None
    else:
        assert pair is not None
        assert expected[pair] == pytest.approx(expected.max(), rel=1e-6)


def test_overlaps_of_one_huge_sphere_among_many_small_ones() -> None:
    rng = np.random.default_rng(4)
    direction = rng.normal(size=(50_000, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    position = np.concatenate([direction * rng.uniform(1.001, 3, (50_000, 1)), [[0, 0, 0]]])
    radius = np.append(np.full(50_000, 1e-7), 1.0)
    assert deepest_overlap(position, radius) is None
    position[123] *= 0.9 / np.linalg.norm(position[123])
    assert set(deepest_overlap(position, radius) or ()) == {123, 50_000}


def test_many_spheres_in_one_place_are_found_at_once() -> None:
    radius = np.random.default_rng(0).uniform(1, 2, 100_000)
    pair = deepest_overlap(np.zeros((100_000, 3)), radius)
    assert set(pair or ()) == set(np.argsort(radius)[-2:])
