"""What the options of the implicit scheme save: `python -m benchmarks.iteration_work`.

Counts force evaluations where the plain fixed-point iteration has a hard time: turns in a magnetic
field with few steps a turn, and 64 spheres that rush together with few steps a contact. Prints the
tables of docs/reproduction.md.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from benchmarks.finished_run import finished_run
from benchmarks.section_9 import section_9
from lammps_blast.case import Case
from lammps_blast.deck import STEP_TABLE
from lammps_blast.particles import Particles, create_particles
from lammps_blast.step_history import StepHistory

DURATION = 0.2  # s
FIELD_STEPS = (1e-3, 5e-3, 1e-2, 2e-2, 4e-2)  # s
CONTACT_STEPS = (1e-3, 2e-3, 5e-3)  # s
TOLERANCES = (5e-4, 1e-6, 1e-9)
FIELD_SCHEMES: dict[str, dict[str, Any]] = {
    "as in the paper": {},
    "anderson: 2": {"anderson": 2},
    "solve_fields": {"solve_fields": True},
}
CONTACT_SCHEMES: dict[str, dict[str, Any]] = {
    "as in the paper": {},
    "safety: 0.9": {"safety": 0.9},
    "anderson: 2": {"anderson": 2},
    "anderson: 2, safety: 0.9": {"anderson": 2, "safety": 0.9},
    "anderson: 5, safety: 0.9": {"anderson": 5, "safety": 0.9},
}


def implicit(name: str, step: float, scheme: dict[str, Any], **changes: Any) -> Case:
    """Return a shipped case with the implicit scheme and a longest step (s)."""
    time = {
        "duration": DURATION,
        "step": 1e-3,
        "integrator": "implicit",
        "implicit": scheme | {"max_step": step, "first_step": step},
    }
    output = {"interval": DURATION, "restart_interval": DURATION, "contacts": False}
    return section_9(name, time=time, output=output, **changes)


def rushing_spheres() -> Particles:
    """Return 4 x 4 x 4 spheres, a little apart, that rush together."""
    case = section_9("contact_blast", particles={"count": 64, "packing": {"relax": False}})
    particles = create_particles(case)
    rng = np.random.default_rng(31)
    lattice = np.stack(np.unravel_index(np.arange(64), (4, 4, 4)), axis=1) * 0.115 - 0.1725
    particles.position[:] = lattice + rng.uniform(-0.005, 0.005, lattice.shape)
    particles.velocity[:] = 0.5 * rng.normal(size=lattice.shape) - 6.0 * lattice
    return particles


def shown_work(case: Case, particles: Particles) -> str:
    """Run a case; return its force evaluations and restarts."""
    with finished_run(case, particles) as folder:
        history = StepHistory.read(folder / STEP_TABLE)
    restarts = int(history.restarts[-1])
    return f"{history.evaluations[-1]:,.0f}" + (f" ({restarts:,})" if restarts else "")


def print_field_table() -> None:
    """Print evaluations of section 6 by step, tolerance and scheme."""
    print("| step, s | omega step | TOL | " + " | ".join(FIELD_SCHEMES) + " |")
    print("|---" * (3 + len(FIELD_SCHEMES)) + "|")
    for step in FIELD_STEPS:
        for tolerance in TOLERANCES[::2]:
            cells = []
            for scheme in FIELD_SCHEMES.values():
                case = implicit("magnetic_blast", step, scheme | {"tolerance": tolerance})
                cells.append(shown_work(case, create_particles(case)))
            print(f"| {step:g} | {100 * step:g} | {tolerance:g} | " + " | ".join(cells) + " |")


def print_contact_table() -> None:
    """Print evaluations of spheres that rush together, without fields and friction."""
    print("| longest step, s | TOL | " + " | ".join(CONTACT_SCHEMES) + " |")
    print("|---" * (2 + len(CONTACT_SCHEMES)) + "|")
    particles = rushing_spheres()
    free = {"blast": None, "fields": {"magnetic": [0, 0, 0]}, "medium": {"drag": "none"}}
    for step in CONTACT_STEPS:
        for tolerance in TOLERANCES:
            cells = []
            for scheme in CONTACT_SCHEMES.values():
                case = implicit(
                    "contact_blast",
                    step,
                    scheme | {"tolerance": tolerance},
                    particles={"packing": {"relax": False}},
                    contact={"friction": None},
                    **free,
                )
                cells.append(shown_work(case, particles))
            print(f"| {step:g} | {tolerance:g} | " + " | ".join(cells) + " |")


def main() -> None:
    """Print both tables, in Markdown: force evaluations, and in brackets restarts."""
    print_field_table()
    print()
    print_contact_table()


if __name__ == "__main__":
    main()
