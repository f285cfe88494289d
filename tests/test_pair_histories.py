"""Histories of pairs: straight flights with known gaps and impacts, and what friction spins."""

import numpy as np
import pytest
from test_analysis import write_dump
from test_contacts import frame_text

from lammps_blast.contacts import ContactFrames
from lammps_blast.interactions import collision_spin
from lammps_blast.pair_histories import PairHistories
from lammps_blast.trajectory import TrajectoryError, open_universe

RADII = np.array([0.1, 0.3, 0.1, 0.1])
IMPACT, SPEED = np.radians(35.0), 2.0
TIMES = np.linspace(0.0, 0.2, 11)
COLUMNS = "id type mass radius q x y z vx vy vz omegax omegay omegaz"


def flights():
    """Two unequal spheres that touch at t = 0.105 s, and two others that never meet."""
    reach = RADII[0] + RADII[1]
    normal = np.array([np.cos(IMPACT), np.sin(IMPACT), 0.0])
    common = np.array([0.3, -0.2, 0.7])
    velocity = np.array([[SPEED, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    velocity += common
    meeting = np.array([[0.0, 0.0, 0.0], reach * normal, [5.0, 0.0, 0.0], [6.0, 0.0, 0.0]])
    position = meeting + (TIMES[:, None, None] - 0.105) * velocity
    return position, velocity


def universe(tmp_path, position, velocity, columns=COLUMNS):
    spin = np.outer([1.0, 2.0, 0.0, 0.0], [0.0, 3.0, 4.0])
    frames = [(t, x, velocity, t * spin) for t, x in zip(TIMES.tolist(), position, strict=True)]
    return open_universe(write_dump(tmp_path / "dump", frames, columns=columns, radius=RADII))


def recorded(tmp_path, *rows):
    path = tmp_path / "contacts.lammpsdump"
    path.write_text("".join(frame_text(step, row) for step, row in rows))
    return ContactFrames(path)


def test_gap_spin_and_impact_of_a_straight_flight(tmp_path):
    position, velocity = flights()
    results = PairHistories(universe(tmp_path, position, velocity)).run().results
    assert results.pairs.tolist() == [[0, 1]]
    assert results.ids.tolist() == [[1, 2]]
    distance = np.linalg.norm(position[:, 1] - position[:, 0], axis=1)
    np.testing.assert_allclose(results.gap[:, 0], distance / 0.4 - 1.0, atol=1e-14)
    assert results.touching[:, 0].tolist() == [False] * 6 + [True] * 5
    np.testing.assert_allclose(results.spin[:, 0], np.outer(TIMES, [5.0, 10.0]), atol=1e-14)
    assert results.impact_angle == pytest.approx([IMPACT], rel=1e-12)
    assert results.impact_speed == pytest.approx([SPEED], rel=1e-12)
    assert results.normal_force is results.bond_force is results.bonded is None


@pytest.mark.parametrize("order", ["1 2", "2 1"])
def test_forces_and_bonds_are_those_on_record(tmp_path, order):
    tail = "0 0 {} 0\n"
    rows = [
        (5, ""),
        (6, f"{order} 0.01 5.0 {tail.format(0)}"),
        (7, f"{order} 0.02 7.0 {tail.format(2.5)}"),
    ]
    position, velocity = flights()
    analysis = PairHistories(universe(tmp_path, position, velocity), recorded(tmp_path, *rows))
    results = analysis.run().results
    assert results.normal_force[5:8, 0].tolist() == [0.0, 5.0, 7.0]
    assert results.bond_force[5:8, 0].tolist() == [0.0, 0.0, 2.5]
    assert np.isnan(results.normal_force[[*range(5), *range(8, 11)], 0]).all()
    assert np.flatnonzero(results.bonded[:, 0]).tolist() == [7]


def test_a_record_of_other_particles_is_refused(tmp_path):
    rows = [(6, "1 9 0.01 5.0 0 0 0 0\n")]
    position, velocity = flights()
    analysis = PairHistories(universe(tmp_path, position, velocity), recorded(tmp_path, *rows))
    with pytest.raises(TrajectoryError, match="step 6: no two particles have the ids 1 and 9"):
        analysis.run()


@pytest.mark.parametrize("unknown", ["the first frame", "the way there", "velocities"])
def test_an_impact_that_nobody_saw_is_unknown(tmp_path, unknown):
    position, velocity = flights()
    columns = COLUMNS
    if unknown == "the first frame":
        position = position[::-1]
    elif unknown == "the way there":
        velocity = -velocity
    else:
        columns = COLUMNS.replace(" vx vy vz", "")
    results = PairHistories(universe(tmp_path, position, velocity, columns)).run().results
    assert len(results.pairs) == 1
    assert np.isnan(results.impact_angle).all()
    assert np.isnan(results.impact_speed).all()


@pytest.mark.parametrize("angle", [5.0, 40.0, 60.0, 66.0, 85.0])
@pytest.mark.parametrize("restitution", [1.0, 0.5])
@pytest.mark.parametrize("masses", [(2.0, 2.0), (0.5, 3.0)])
def test_collision_spin_is_what_coulomb_friction_leaves(angle, restitution, masses):
    """Integrate slip and spins under a normal force of the right impulse, in any shape."""
    theta, dynamic, steps = np.radians(angle), 0.3, 10_000
    mass, radius = np.array(masses), np.array([0.1, 0.25])
    effective = np.prod(mass) / mass.sum()
    push = np.random.default_rng(1).random(steps)
    push *= effective * SPEED * np.cos(theta) * (1.0 + restitution) / push.sum()
    velocity = np.array([SPEED * np.sin(theta), 0.0])
    spin = np.zeros(2)
    for impulse in push:
        slip = velocity[0] - velocity[1] - spin @ radius
        if slip <= 0.0:
            break
        kick = dynamic * impulse
        velocity += [-kick / mass[0], kick / mass[1]]
        spin += kick * radius / (0.4 * mass * radius**2)
    for i, j in ((0, 1), (1, 0)):
        law = collision_spin(SPEED, theta, radius[i], mass[i], mass[j], dynamic, restitution)
        one_kick = 2.5 * dynamic * push.max() / (mass[i] * radius[i])
        assert law == pytest.approx(spin[i], rel=1e-9, abs=one_kick)


def test_collision_spin_of_equal_spheres():
    angles = np.radians([0.0, 30.0, 64.0, 65.0, 90.0])
    ratio = 0.05 / 1.5 * collision_spin(1.5, angles, 0.05, 7.0, 7.0, 0.3)
    rolls, slides = 5.0 / 14.0 * np.sin(angles), 2.5 * 0.3 * np.cos(angles)
    np.testing.assert_allclose(ratio, [*rolls[:3], *slides[3:]], atol=1e-15)
