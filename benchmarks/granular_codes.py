"""The same spheres in other codes for granular matter: LIGGGHTS and YADE, where installed.

They get the positions and velocities of the particles, the same time step, number of steps and skin
of the neighbour list, and a contact as stiff as that of LAMMPS's style in `contact`. Their laws are
not ours: Hertz and Mindlin with a history of the tangential spring, and spheres that turn. Neither
knows a magnetic field, nor keeps account of the energy.
"""

from __future__ import annotations

import re
import shutil
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from benchmarks.finished_process import finished_process
from benchmarks.lammps_loop import loop_seconds
from lammps_blast.particles import Particles

YOUNGS_MODULUS, POISSON_RATIO, RESTITUTION, FRICTION = 7.0e5, 0.3, 0.42, 0.4  # Pa, -, -, -
ONE_THREAD = {"OMP_NUM_THREADS": "1"}


@dataclass(frozen=True)
class GranularFlight:
    """Free flight of spheres in another code, from the launch on.

    Attributes
    ----------
    particles
        With the velocities of the launch.
    skin
        By how much pairs may miss each other and still be listed, m.
    resident
        Bytes a particle of the resident set, one number a run.
    """

    particles: Particles
    step: float
    steps: int
    warm_up_steps: int
    skin: float
    resident: list[float] = field(default_factory=list)

    def nanoseconds(self, seconds: float) -> float:
        return 1e9 * seconds / (self.steps * len(self.particles))


@dataclass(frozen=True)
class LiggghtsFlight(GranularFlight):
    """Runs LIGGGHTS on one core."""

    def __call__(self) -> float:
        """Return ns per particle-step.

        Raises
        ------
        RuntimeError
            If LIGGGHTS fails.
        """
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            _write_granular_data(self.particles, folder / "particles.data")
            (folder / "in.flight").write_text(self._deck())
            done = finished_process(["liggghts", "-in", "in.flight"], folder, ONE_THREAD)
            self.resident.append(done.resident / len(self.particles))
            return self.nanoseconds(loop_seconds(done.output))

    def _deck(self) -> str:
        return f"""\
soft_particles yes
units si
atom_style granular
boundary s s s
newton off
communicate single vel yes
neighbor {self.skin!r} bin
neigh_modify every 1 delay 0 check yes
read_data particles.data
fix modulus all property/global youngsModulus peratomtype {YOUNGS_MODULUS!r}
fix ratio all property/global poissonsRatio peratomtype {POISSON_RATIO!r}
fix bounce all property/global coefficientRestitution peratomtypepair 1 {RESTITUTION!r}
fix rub all property/global coefficientFriction peratomtypepair 1 {FRICTION!r}
pair_style gran model hertz tangential history
pair_coeff * *
timestep {self.step!r}
fix integrate all nve/sphere
thermo 1000000
run {self.warm_up_steps}
run {self.steps}
"""


def _write_granular_data(particles: Particles, path: Path) -> None:
    margin = particles.radius.max()
    low, high = particles.position.min(axis=0) - margin, particles.position.max(axis=0) + margin
    identity = np.arange(1, len(particles) + 1)
    with path.open("w", encoding="ascii") as file:
        file.write(f"Spheres\n\n{len(particles)} atoms\n1 atom types\n\n")
        for axis, a, b in zip("xyz", low, high, strict=True):
            file.write(f"{float(a)!r} {float(b)!r} {axis}lo {axis}hi\n")
        file.write("\nAtoms\n\n")
        sizes = 2.0 * particles.radius, particles.density
        atoms = identity, np.ones(len(particles)), *sizes, particles.position
        np.savetxt(file, np.column_stack(atoms), fmt=["%d", "%d"] + 5 * ["%.17g"])
        file.write("\nVelocities\n\n")
        motion = identity, particles.velocity, particles.angular_velocity
        np.savetxt(file, np.column_stack(motion), fmt=["%d"] + 6 * ["%.17g"])


@dataclass(frozen=True)
class YadeFlight(GranularFlight):
    """Runs YADE on one core."""

    def __call__(self) -> float:
        """Return ns per particle-step.

        Raises
        ------
        RuntimeError
            If YADE fails.
        """
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            spheres = self.particles.position, self.particles.velocity, self.particles.radius
            np.save(folder / "spheres.npy", np.column_stack(spheres))
            (folder / "flight.py").write_text(self._script())
            done = finished_process(["yade", "-x", "-n", "-j1", "flight.py"], folder, ONE_THREAD)
            self.resident.append(done.resident / len(self.particles))
            seconds = re.search(r"loop seconds (\S+)", done.output)
            if seconds is None:
                raise RuntimeError(f"YADE did not get to its end: {done.output[-2000:]}")
            return self.nanoseconds(float(seconds.group(1)))

    def _script(self) -> str:
        return f"""\
import time
import numpy as np
matter = FrictMat(young={YOUNGS_MODULUS!r}, poisson={POISSON_RATIO!r},
                  frictionAngle={float(np.arctan(FRICTION))!r},
                  density={float(self.particles.density[0])!r})
O.materials.append(matter)
for row in np.load("spheres.npy"):
    O.bodies.append(sphere(row[:3], row[6], material=matter))
    O.bodies[-1].state.vel = row[3:6]
O.engines = [
    ForceResetter(),
    InsertionSortCollider([Bo1_Sphere_Aabb()], verletDist={0.5 * self.skin!r}),
    InteractionLoop(
        [Ig2_Sphere_Sphere_ScGeom()],
        [Ip2_FrictMat_FrictMat_MindlinPhys(en={RESTITUTION!r}, es={RESTITUTION!r})],
        [Law2_ScGeom_MindlinPhys_Mindlin()],
    ),
    NewtonIntegrator(damping=0.0),
]
O.dt = {self.step!r}
O.run({self.warm_up_steps}, True)
started = time.perf_counter()
O.run({self.steps}, True)
print("loop seconds", time.perf_counter() - started)
"""


def installed(program: str) -> bool:
    """Tell whether a program is on the search path."""
    return shutil.which(program) is not None
