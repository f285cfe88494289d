"""Strong scaling of the contact blast: the same spheres on one core and on two.

The whole loop of a deck counts, with the magnetic field, air, the energy ledger and the watch.
Times are those of all cores at work, so that a ratio to one core is the parallel efficiency.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.lammps_process import LammpsProcess
from benchmarks.machine import cores
from benchmarks.results import Row, measure_in_turn
from benchmarks.section_9 import flight, pair_law, section_9
from benchmarks.step_loop import INTEGRATORS

COUNT = 200_000
STEPS, WARM_UP_STEPS = 100, 20
GOAL = 0.85  # parallel efficiency
NS = "core-ns/particle-step"
# What a deck has besides; the losses come before the fixes that integrate.
LOSSES, WATCH = "fix losses all blast/losses", "fix watch all blast/watch 10"
ONE, RANKS, THREADS = "one core", "two ranks", "two threads"


def scaling_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure one core, two ranks and two threads in turn."""
    motion = f"{LOSSES}\n{INTEGRATORS['chow']}\n{WATCH}"
    scene = flight(STEPS, WARM_UP_STEPS, COUNT, integration=motion)
    loop = scene.loop(pair_law(section_9("contact_blast")))
    processes = {
        ONE: LammpsProcess(loop),
        RANKS: LammpsProcess(loop, ranks=2),
        THREADS: LammpsProcess(loop, threads=2),
    }
    times = measure_in_turn(processes, repeats, tell)
    remark = "" if cores() > 1 else "on one core only"
    return [
        Row(f"{scene.name}, {way}", times[way], ONE, times[ONE], NS, goal=GOAL, remark=remark)
        for way in (RANKS, THREADS)
    ]
