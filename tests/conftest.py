"""Ways to put a handful of charged spheres into LAMMPS and to run decks, for all tests."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lammps_blast.deck import write_particle_data
from lammps_blast.engine import close_lammps, start_lammps
from lammps_blast.particles import Particles

REPOSITORY = Path(__file__).resolve().parents[1]
PROGRAMS = Path(sys.executable).parent

SYSTEM = """
units si
atom_style hybrid sphere charge
atom_modify map array sort 0 0.0
boundary s s s
neighbor 0.0 bin
comm_modify cutoff 1.0e-9
neigh_modify every 1000 delay 0 check no
read_data particles.data
"""


def make_particles(position, *, velocity=None, spin=None, radius=0.05, density=7000.0, charge=10.0):
    """Return Particles; scalars stand for all of them, `charge` is per mass."""
    position = np.atleast_2d(np.asarray(position, dtype=float))
    count = len(position)
    zeros = np.zeros((count, 3))
    return Particles(
        position=position,
        velocity=zeros if velocity is None else np.broadcast_to(velocity, (count, 3)) + zeros,
        angular_velocity=zeros if spin is None else np.broadcast_to(spin, (count, 3)) + zeros,
        radius=np.broadcast_to(np.asarray(radius, dtype=float), count),
        density=np.broadcast_to(np.asarray(density, dtype=float), count),
        charge_per_mass=np.broadcast_to(np.asarray(charge, dtype=float), count),
    )


def random_cloud(count, seed, **properties):
    """Return a cloud of spheres spread over a ball of radius 1 m; overlaps do not matter."""
    rng = np.random.default_rng(seed)
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    return make_particles(direction * rng.random((count, 1)) ** (1 / 3), **properties)


class Simulation:
    """A LAMMPS instance that holds some particles; commands may run over several lines."""

    def __init__(self, folder, particles):
        write_particle_data(particles, folder / "particles.data")
        self.folder = folder
        self.count = len(particles)
        self.lammps = start_lammps(log="none")
        self.lammps.command(f"shell cd {folder}")
        self.commands(SYSTEM)

    def commands(self, text):
        self.lammps.commands_string(text)

    def per_atom(self, name, width=3):
        """Return a per-atom array in the order of ids."""
        ids = np.array(self.lammps.numpy.extract_atom("id")[: self.count])
        values = np.array(self.lammps.numpy.extract_atom(name)[: self.count])
        return values[np.argsort(ids)]

    @property
    def position(self):
        return self.per_atom("x")

    @property
    def velocity(self):
        return self.per_atom("v")

    @property
    def kinetic_energy(self):
        mass = self.per_atom("rmass")
        return 0.5 * np.sum(mass[:, None] * self.velocity**2)

    def work(self, fix="integrate"):
        """Return the cumulative work of drag and of the magnetic force, J."""
        return np.array([self.lammps.extract_fix(fix, 0, 1, i) for i in range(2)])


@pytest.fixture
def simulate(tmp_path):
    """Return a function that makes a Simulation of some particles."""
    running = []

    def start(particles):
        folder = tmp_path / f"simulation{len(running)}"
        folder.mkdir()
        running.append(Simulation(folder, particles))
        return running[-1]

    yield start
    for simulation in running:
        close_lammps(simulation.lammps)


def lmp(*arguments, folder, ranks=1):
    """Run the `lmp` command in a folder, under mpiexec where there are several ranks."""
    command = [str(PROGRAMS / "lmp"), *arguments]
    if ranks > 1:
        command = [str(PROGRAMS / "mpiexec"), "-n", str(ranks), *command]
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)


def blast(command, *arguments, folder, **options):
    """Run `python -m lammps_blast.COMMAND` in a folder."""
    return subprocess.run(
        [sys.executable, "-m", f"lammps_blast.{command}", *map(str, arguments)],
        cwd=folder,
        capture_output=True,
        text=True,
        timeout=300,
        **options,
    )


def ranks_at_work(folder):
    """Return the processes of `lmp` that work in a folder."""
    found = []
    for process in os.listdir("/proc"):
        try:
            if os.readlink(f"/proc/{process}/exe").endswith("/lmp") and os.path.samefile(
                f"/proc/{process}/cwd", folder
            ):
                found.append(int(process))
        except OSError:
            continue
    return found


def mount(folder, options):
    """Mount a disk in memory on a folder, or change how it is mounted."""
    subprocess.run(
        ["mount", "-t", "tmpfs", "-o", options, "tmpfs", folder], check=True, capture_output=True
    )


@pytest.fixture
def small_disk(tmp_path):
    """Yield a folder that is a disk of 6 MiB of its own."""
    folder = tmp_path / "disk"
    folder.mkdir()
    try:
        mount(folder, "size=6m")
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("only the superuser may mount a disk")
    yield folder
    subprocess.run(["umount", "--lazy", folder], check=True)
