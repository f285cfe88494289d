"""The step loop of section 6: particles that do not interact, in B and air, without output."""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.lammps_loop import LammpsLoop
from benchmarks.peers import plain_euler, plasmapy_boris, tuned_euler
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_6 import MAGNETIC, MEDIUM_DENSITY, PULSE_ENERGY, STEP, VISCOSITY, cloud
from lammps_blast.particles import Particles

STEPS = 10_000

FIELD = "magnetic {} {} {}".format(*MAGNETIC)
AIR = f"density {MEDIUM_DENSITY} viscosity {VISCOSITY}"
LORENTZ = f"fix integrate all nve/sphere/lorentz {FIELD} drag"
INTEGRATORS = {
    "chow": f"{LORENTZ} chow {AIR}",
    "none": f"{LORENTZ} none",
    "constant": f"{LORENTZ} constant 0.5 {AIR}",
    "stokes": f"{LORENTZ} stokes {AIR}",
    "verlet": f"fix external all lorentz/drag {FIELD} drag chow {AIR}\n"
    "fix integrate all nve/sphere",
}

LOOP_LIMIT = 12.0  # ns per particle-step on one core
NUMPY_GOAL, PLASMAPY_GOAL = 4.0, 6.0

PLAIN, TUNED = "numpy, eq. 6.2", "numpy, tuned by hand"
PLASMAPY = "PlasmaPy Boris"
NS = "ns/particle-step"


def step_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure our step loops and those of the peers, all in turn."""
    particles = cloud()
    contestants: dict[str, Callable[[], float]] = {
        name: step_loop(particles, name) for name in INTEGRATORS
    }
    contestants[PLAIN] = plain_euler(particles)
    contestants[TUNED] = tuned_euler(particles)
    boris = plasmapy_boris(particles)
    if boris is not None:
        contestants[PLASMAPY] = boris
    return _rows(measure_in_turn(contestants, repeats, tell))


def step_loop(particles: Particles, integrator: str) -> LammpsLoop:
    """Return the loop with one of INTEGRATORS, from the start of the blast."""
    pulse = f"blast_pulse all {PULSE_ENERGY} seed 1"
    return LammpsLoop(particles, STEP, f"{INTEGRATORS[integrator]}\n{pulse}", STEPS)


def _rows(times: dict[str, Samples]) -> list[Row]:
    chow, none, boris = times["chow"], times["none"], times.get(PLASMAPY)
    rows = [Row("step loop, drag chow", chow, "limit", LOOP_LIMIT, NS, goal=1.0)]
    rows += [
        Row(f"step loop, drag {law}", times[law], "drag chow", chow, NS)
        for law in ("none", "constant", "stokes")
    ]
    rows += [
        Row("step loop, verlet, drag chow", times["verlet"], "drag chow", chow, NS),
        Row("step loop, drag chow", chow, PLAIN, times[PLAIN], NS, goal=NUMPY_GOAL),
        Row("step loop, drag chow", chow, TUNED, times[TUNED], NS),
        Row(
            "step loop, drag none",
            none,
            PLASMAPY,
            boris,
            NS,
            goal=PLASMAPY_GOAL,
            remark="" if boris else "not installed",
        ),
    ]
    return rows
