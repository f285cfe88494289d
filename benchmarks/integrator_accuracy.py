"""Both integrators against exact orbits: `python -m benchmarks.integrator_accuracy`.

Runs section 6 without drag and prints the table of docs/reproduction.md: for each step the kinetic
energy after one second in units of the blast's, and the largest error of a particle's position in
gyroradii.
"""

from pathlib import Path

import numpy as np

from benchmarks.finished_run import finished_run
from lammps_blast import theory
from lammps_blast.case import Case, parse_case
from lammps_blast.engine import EngineError
from lammps_blast.particles import create_particles
from lammps_blast.trajectory import open_universe

STEPS = (1e-5, 1e-4, 1e-3, 1e-2)
CASE = {
    "name": "integrator_accuracy",
    "seed": 2016,
    "particles": {
        "count": 2000,
        "radius": 0.05,
        "density": 7000.0,
        "charge_per_mass": 10.0,
        "packing": {"domain_radius": 1.0},
    },
    "blast": {"energy": 1.0e4},
    "fields": {"magnetic": [10.0, 0.0, 0.0]},
    "output": {"interval": 1.0, "format": "binary"},
}


def case_of(integrator: str, step: float) -> Case:
    """Return section 6 without drag for one integrator and step."""
    time = {"duration": 1.0, "step": step, "integrator": integrator}
    return parse_case(CASE | {"time": time}, Path())


def energy_and_error(case: Case) -> tuple[float, float]:
    """Return kinetic energy over launch energy and the largest position error in gyroradii."""
    particles = create_particles(case)
    with finished_run(case, particles) as folder:
        start, end = (open_universe(folder).trajectory[frame].data for frame in (0, -1))
    exact, _ = theory.lorentz_orbit(
        1.0, start["position"], start["velocity"], 10.0, np.zeros(3), case.fields.magnetic
    )
    kinetic = 0.5 * np.sum(particles.mass[:, None] * end["velocity"] ** 2)
    speed = theory.pulse_speed(case.blast.energy, particles.mass.sum())
    gyroradius = theory.cyclotron_radius(
        speed, theory.cyclotron_frequency(10.0, case.fields.magnetic)
    )
    error = np.linalg.norm(end["position"] - exact, axis=1).max()
    return kinetic / case.blast.energy, error / gyroradius


def shown(integrator: str, step: float) -> str:
    """Return the table's cells of one run; verlet at large steps flings particles out of reach."""
    try:
        energy, error = energy_and_error(case_of(integrator, step))
    except EngineError:
        return "no end: particles leave the range of numbers | "
    shown_energy = f"1 {energy - 1:+.0e}" if abs(energy - 1) < 1e-6 else f"{energy:.4g}"
    return f"{shown_energy} | {error:.2g}"


def main() -> None:
    """Print the table, in Markdown."""
    print("| step, s | `lorentz`: energy | error | `verlet`: energy | error |")
    print("|---|---|---|---|---|")
    for step in STEPS:
        print(f"| {step:g} | {shown('lorentz', step)} | {shown('verlet', step)} |")


if __name__ == "__main__":
    main()
