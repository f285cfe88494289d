"""The relaxation of dense packings in the deck: what it leaves before the pulse."""

import re
import subprocess
import sys
from dataclasses import dataclass

import numpy as np
import pytest
from conftest import lmp
from scipy.spatial import cKDTree

from lammps_blast.case import parse_case
from lammps_blast.deck import write_deck
from lammps_blast.engine import lammps_warnings
from lammps_blast.particles import PackingError, create_particles
from lammps_blast.relaxation import ALLOWANCE, CHECK_EVERY, MOST_STEPS
from lammps_blast.trajectory import open_universe

STEP = 1e-4


@dataclass(frozen=True)
class Relaxed:
    """What a deck makes of a packing before its first step; centres in radii of the domain."""

    packed: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    radius: float
    time: float
    log: str
    warnings: list[str]

    @property
    def gaps(self):
        """Return the distances of nearest centres, in diameters, before and after."""
        return [
            cKDTree(centres).query(centres, k=2)[0][:, 1].min() / (2 * self.radius)
            for centres in (self.packed, self.position)
        ]

    @property
    def report(self):
        """Return the steps and the largest strain that the log tells of."""
        (told,) = re.findall(
            r"^Relaxed packing: steps (\d+), .*?largest strain +(\S+) of", self.log, re.M
        )
        return int(told[0]), float(told[1])

    @property
    def shift(self):
        """Return by what the cloud was moved as a whole when it had come to rest, (3,)."""
        numbers = re.findall(r"^displace_atoms all move (\S+) (\S+) +(\S+) units", self.log, re.M)
        return np.array(numbers[-1], dtype=float)


def text_of(count, fraction, *, seed=1, size=1.0, step=STEP, density=7000.0):
    """Return a case of packed spheres that fill a part of their domain's volume, and no more."""
    radius = size * (fraction / count) ** (1 / 3)
    return (
        f"name: packing\nseed: {seed}\n"
        f"particles: {{count: {count}, radius: {radius!r}, density: {density!r},\n"
        "            charge_per_mass: 10.0,\n"
        f"            packing: {{domain_radius: {size!r}, relax: true}}}}\n"
        f"time: {{duration: {step!r}, step: {step!r}}}\n"
    )


def relax(folder, text, *words, ranks=1):
    """Run the deck of a case in a new folder and return what its first frame holds."""
    case = parse_case(text, folder)
    particles = create_particles(case)
    folder.mkdir()
    write_deck(case, particles, folder)
    done = lmp("-in", "in.blast", *words, folder=folder, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr
    frame = open_universe(folder).trajectory[0]
    size = case.particles.packing.domain_radius
    return Relaxed(
        packed=particles.position / size,
        position=frame.data["position"] / size,
        velocity=frame.data["velocity"].copy(),
        radius=particles.radius[0] / size,
        time=frame.time,
        log=(folder / "log.lammps").read_text(),
        warnings=lammps_warnings(folder),
    )


@pytest.mark.parametrize(
    ("count", "fraction"), [(6, 0.35), (60, 0.5), (300, 0.45), (300, 0.56), (2000, 0.58)]
)
def test_dense_packing_comes_apart_inside_its_domain(tmp_path, count, fraction):
    relaxed = relax(tmp_path / "run", text_of(count, fraction))
    before, after = relaxed.gaps
    assert before < 0.999
    # Spheres wider by the allowance overlap by half of it at most.
    assert after >= (1.0 + ALLOWANCE) * (1.0 - 0.5 * ALLOWANCE) * (1.0 - 1e-12)
    # The wall gives way by about the allowance; then the cloud is moved back to its centre.
    outermost = np.linalg.norm(relaxed.position - relaxed.shift, axis=1).max()
    assert outermost + relaxed.radius <= 1.0 + 2.0 * ALLOWANCE * relaxed.radius
    assert np.linalg.norm(relaxed.shift) < 0.3 * relaxed.radius
    centres = relaxed.packed.mean(axis=0), relaxed.position.mean(axis=0)
    assert centres[1] == pytest.approx(centres[0], abs=1e-14)
    assert not relaxed.velocity.any()
    assert relaxed.time == 0.0
    steps, strain = relaxed.report
    assert steps % CHECK_EVERY == 0
    assert 0 < steps < MOST_STEPS
    assert strain <= 0.5 * ALLOWANCE


def test_packing_with_room_stays_as_it_is(tmp_path):
    relaxed = relax(tmp_path / "run", text_of(300, 0.25))
    assert relaxed.report == (CHECK_EVERY, 0.0)
    assert min(relaxed.gaps) >= 1.0
    # Those nearer to each other than the allowance are moved apart, by a little more than that.
    moved = np.linalg.norm(relaxed.position - relaxed.packed, axis=1) / relaxed.radius
    assert 0.0 < moved.max() < 10 * ALLOWANCE
    assert np.median(moved) < 1e-12


@pytest.mark.parametrize("count", [1, 2])
def test_one_or_two_spheres_stay_where_they_are(tmp_path, count):
    relaxed = relax(tmp_path / "run", text_of(count, 0.1))
    assert relaxed.position == pytest.approx(relaxed.packed, abs=1e-15)


def test_relaxed_packing_does_not_depend_on_units_of_length_time_and_mass(tmp_path):
    first = relax(tmp_path / "first", text_of(100, 0.5))
    for name, text in {
        "size": text_of(100, 0.5, size=1e-5),
        "step": text_of(100, 0.5, step=1e-7),
        "density": text_of(100, 0.5, density=1.0),
    }.items():
        other = relax(tmp_path / name, text)
        assert other.report == first.report
        assert other.position == pytest.approx(first.position, abs=1e-10)


def test_step_given_to_the_deck_leaves_the_relaxation_alone(tmp_path):
    text = text_of(100, 0.5).replace(f"duration: {STEP!r}", "duration: 0.01")
    first = relax(tmp_path / "first", text)
    words = ["-var", "step", "1e-3", "-var", "output_interval", "1e-3"]
    longer = relax(tmp_path / "longer", text, *words)
    assert np.array_equal(longer.position, first.position)
    assert open_universe(tmp_path / "longer").trajectory[-1].time == pytest.approx(0.01)


def test_particles_that_feel_nothing_after_relaxation_run_without_warnings(tmp_path):
    assert relax(tmp_path / "run", text_of(60, 0.5)).warnings == []


@pytest.mark.parametrize("count", [60, 2000])
def test_ranks_relax_a_packing_alike(tmp_path, count):
    alone, together = (
        relax(tmp_path / str(ranks), text_of(count, 0.5), ranks=ranks) for ranks in (1, 2)
    )
    assert together.report == alone.report
    assert together.position == pytest.approx(alone.position, abs=1e-10)
    assert min(together.gaps[1], alone.gaps[1]) > 1.0


def test_packing_that_does_not_settle_is_an_error_that_names_it(tmp_path):
    (tmp_path / "case.yaml").write_text(text_of(300, 0.56))
    code = (
        "import lammps_blast.relaxation as relaxation\n"
        "from lammps_blast.run import main\n"
        "relaxation.MOST_STEPS = 50\n"
        "raise SystemExit(main(['case.yaml', '--output', 'out', '--no-figures']))"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 3
    assert "packing_did_not_relax" in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "out" / "summary.json").exists()
    assert not (tmp_path / "out" / "trajectory.lammpstrj").exists()


def test_packing_beyond_reach_is_refused(tmp_path):
    with pytest.raises(PackingError, match="relaxation reaches"):
        create_particles(parse_case(text_of(2000, 0.62), tmp_path))
