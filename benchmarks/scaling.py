"""Strong scaling of the contact blast: the same spheres on one core and on two.

The whole loop of a deck counts, with the magnetic field, air, the energy ledger and the watch.
Times are those of all cores at work, so that a ratio to one core is the parallel efficiency. What
the machine gives programs that wait for its memory is measured beside it: processes, as many as
cores, that do nothing but add arrays too large for the caches.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass

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
STREAM = "adding arrays of 40 MB"
ADDING = """
import time, numpy as np
a, b, c = np.zeros((3, 5_000_000)) + 1.0
print("ready", flush=True)
input()
started = time.perf_counter()
for _ in range(40):
    np.add(a, b, out=c)
print(time.perf_counter() - started)
"""
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
    streams = {f"{STREAM}, {count}": Streams(count) for count in (1, 2)}
    times = measure_in_turn(processes | streams, repeats, tell)
    alone, together = (times[name] for name in streams)
    ceiling = Row(f"{STREAM}, two at once", together, "one alone", alone, "s")
    remark = "" if cores() > 1 else "on one core only"
    rows = [
        Row(f"{scene.name}, {way}", times[way], ONE, times[ONE], NS, goal=GOAL, remark=remark)
        for way in (RANKS, THREADS)
    ]
    return [*rows, ceiling]


@dataclass(frozen=True)
class Streams:
    """Times processes that add arrays at the same time."""

    count: int

    def __call__(self) -> float:
        """Return the seconds of the slowest."""
        running = [
            subprocess.Popen(
                [sys.executable, "-c", ADDING],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                text=True,
            )
            for _ in range(self.count)
        ]
        for process in running:
            process.stdout.readline()  # its arrays are there
        for process in running:
            process.stdin.write("go\n")
            process.stdin.flush()
        return max(float(process.communicate()[0]) for process in running)
