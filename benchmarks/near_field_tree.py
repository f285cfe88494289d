"""The near field of section 9 by tree: its error, its time beside the direct sum, and its growth.

Clouds as full as that of the paper, of more and more particles; forces alone, as in near_field.py.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.lammps_loop import LammpsLoop
from benchmarks.near_field import NO_ENERGIES, section_9_cloud
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_9 import PLAIN_INTEGRATION, pair_law

COUNT = 100_000
ACCURACIES = (1e-2, 1e-4, 1e-6)
COMPARED_ACCURACY = 1e-4
SPEED_GOAL = 10.0
GROWTH_COUNTS = (10_000, 100_000, 1_000_000)
GROWTH_LIMIT = 1.2  # power of N
NS = "ns/particle-step"


@dataclass(frozen=True)
class TreeCase:
    """A cloud of some particles, and how its near field is summed."""

    count: int
    accuracy: float | None  # None: directly

    def loop(self, steps: int) -> LammpsLoop:
        """Return the loop, in ns a particle-step."""
        method = {"method": "direct", "accuracy": None}
        if self.accuracy:
            method = {"method": "tree", "accuracy": self.accuracy}
        case, particles = section_9_cloud(self.count, near_field=method)
        commands = "\n".join([pair_law(case), PLAIN_INTEGRATION, NO_ENERGIES])
        return LammpsLoop(particles, case.time.step, commands, steps, warm_up_steps=0, case=case)


def tree_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure errors, then tree and direct sum in turn, then trees of more and more particles."""
    return [*_error_rows(tell), *_speed_rows(min(repeats, 2), tell), _growth_row(repeats, tell)]


def _error_rows(tell: Callable[[str], None]) -> list[Row]:
    tell(f"forces of {COUNT} particles, directly")
    exact = TreeCase(COUNT, None).loop(steps=0).forces()
    rows = []
    for accuracy in ACCURACIES:
        tell(f"forces of {COUNT} particles, by tree of accuracy {accuracy:g}")
        forces = TreeCase(COUNT, accuracy).loop(steps=0).forces()
        error = float(np.sqrt(((forces - exact) ** 2).sum() / (exact**2).sum()))
        momentum = float(np.abs(forces.sum(axis=0)).max() / np.abs(forces).sum(axis=0).max())
        rows.append(
            Row(
                f"error of {COUNT:,} forces by tree, asked: {accuracy:g}",
                Samples((error,)),
                "accuracy asked for",
                accuracy,
                "of the force",
                goal=1.0,
                details={"momentum gained, of the sum of all forces": momentum},
            )
        )
    return rows


def _speed_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    direct = "direct sum"
    contestants = {
        f"tree, accuracy {accuracy:g}": TreeCase(COUNT, accuracy).loop(steps=2)
        for accuracy in ACCURACIES
    }
    times = measure_in_turn(contestants | {direct: TreeCase(COUNT, None).loop(1)}, repeats, tell)
    return [
        Row(
            f"near field of {COUNT:,}, {name}",
            times[name],
            direct,
            times[direct],
            NS,
            goal=SPEED_GOAL if accuracy == COMPARED_ACCURACY else None,
        )
        for name, accuracy in zip(contestants, ACCURACIES, strict=True)
    ]


def _growth_row(repeats: int, tell: Callable[[str], None]) -> Row:
    contestants = {
        f"{count:,} particles": TreeCase(count, COMPARED_ACCURACY).loop(steps=1)
        for count in GROWTH_COUNTS
    }
    times = measure_in_turn(contestants, min(repeats, 2), tell)
    per_particle = [samples.best for samples in times.values()]
    span = math.log(GROWTH_COUNTS[-1] / GROWTH_COUNTS[0])
    power = 1.0 + math.log(per_particle[-1] / per_particle[0]) / span
    return Row(
        f"growth of the tree's time, {GROWTH_COUNTS[0]:,} to {GROWTH_COUNTS[-1]:,}",
        Samples((power,)),
        "limit",
        GROWTH_LIMIT,
        "power of N",
        goal=1.0,
        details={f"{name}, {NS}": samples.best for name, samples in times.items()},
    )
