"""Random sequential addition of many spheres: time, memory, and others who can do it.

Every packing of ours is made in a process of its own on one core, `python -m benchmarks.packing N`,
and that its spheres lie apart and inside is checked after the clock has stopped.
"""

from __future__ import annotations

import json
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.cores import on_cores
from benchmarks.packing_peers import lammps_insertion, numba_insertion, yade_cloud
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_6 import REPOSITORY
from lammps_blast.particles import pack_spheres

VOLUME_FRACTION = 0.25
FEWEST, FEW, MANY, MILLION = 2_000, 10_000, 100_000, 1_000_000
LIMITS = {MANY: 5.0, MILLION: 90.0}  # s on one core
LINEAR = 0.8  # memory a sphere with MANY over that with a MILLION, at least
# At most: of a hundred thousand, and of a million, each of which takes half a minute.
MOST_REPEATS, REPEATS_OF_MILLION = 3, 2

OURS, GRID = "packing", "numba, one by one on a grid"
STOCK, YADE = "LAMMPS create_atoms random overlap", "YADE makeCloud"
SECONDS, BYTES = "s", "bytes/particle"


def radius_of(count: int) -> float:
    """Return the radius in m of so many spheres that fill their part of a domain of 1 m."""
    return float((VOLUME_FRACTION / count) ** (1 / 3))


@dataclass(frozen=True)
class PackingProcess:
    """Packs spheres in a process of its own, with another seed every time.

    Attributes
    ----------
    memory
        Bytes a sphere by which the largest resident set grew, one number a run.
    """

    count: int
    memory: list[float] = field(default_factory=list)

    def __call__(self) -> float:
        """Return seconds.

        Raises
        ------
        RuntimeError
            If the packing fails, or is wrong.
        """
        arguments = ["-m", "benchmarks.packing", str(self.count), str(len(self.memory) + 1)]
        with on_cores(1):
            done = subprocess.run(
                [sys.executable, *arguments], cwd=REPOSITORY, capture_output=True, text=True
            )
        if done.returncode != 0:
            raise RuntimeError(f"packing ended with {done.returncode}: {done.stderr}")
        measured = json.loads(done.stdout)
        self.memory.append(measured["bytes"] / self.count)
        return float(measured["seconds"])


def packing_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure a hundred thousand spheres and a million, and peers on as many as they can do."""
    many, million = PackingProcess(MANY), PackingProcess(MILLION)
    grid = numba_insertion(MANY, radius_of(MANY))
    with_grid = _race(many, GRID, grid, repeats, tell)
    of_million = _in_turn(million, {}, min(repeats, REPEATS_OF_MILLION), tell)[OURS]
    cloud, insertion = yade_cloud(FEW, radius_of(FEW)), lammps_insertion(FEWEST, radius_of(FEWEST))
    return [
        Row(_name(MANY), with_grid.ours, "limit", LIMITS[MANY], SECONDS, goal=1.0),
        Row(_name(MILLION), of_million, "limit", LIMITS[MILLION], SECONDS, goal=1.0),
        Row(
            f"{_name(MILLION)}, memory",
            Samples(tuple(million.memory)),
            f"{MANY} spheres",
            min(many.memory),
            BYTES,
            goal=LINEAR,
        ),
        with_grid,
        _race(PackingProcess(FEW), YADE, cloud, repeats, tell),
        _race(PackingProcess(FEWEST), STOCK, insertion, repeats, tell),
    ]


def _race(
    ours: PackingProcess,
    name: str,
    peer: Callable[[], float] | None,
    repeats: int,
    tell: Callable[[str], None],
) -> Row:
    times = _in_turn(ours, {name: peer} if peer else {}, repeats, tell)
    remark = "" if peer else "not installed"
    return Row(_name(ours.count), times[OURS], name, times.get(name), SECONDS, remark=remark)


def _in_turn(
    ours: PackingProcess,
    peers: dict[str, Callable[[], float]],
    repeats: int,
    tell: Callable[[str], None],
) -> dict[str, Samples]:
    tell(f"packing {ours.count} spheres")
    return measure_in_turn({OURS: ours, **peers}, min(repeats, MOST_REPEATS), tell)


def _name(count: int) -> str:
    return f"packing, {count} spheres at {VOLUME_FRACTION:g}"


def _largest_resident() -> int:
    """Return the largest resident set of this process so far, in bytes."""
    status = Path("/proc/self/status").read_text()
    return 1024 * int(status.split("VmHWM:")[1].split()[0])


def _check(centres: np.ndarray, radius: float) -> None:
    distance = cKDTree(centres).query(centres, k=2)[0][:, 1]
    outermost = np.linalg.norm(centres, axis=1).max()
    if distance.min() < 2.0 * radius or outermost + radius > 1.0:
        raise RuntimeError("the spheres overlap, or leave the domain")


def main() -> None:
    """Pack as many spheres, with a seed, as the command line says; print seconds and bytes."""
    count, seed = (int(argument) for argument in sys.argv[1:])
    radius = radius_of(count)
    resident = _largest_resident()
    started = time.perf_counter()
    centres = pack_spheres(count, radius, 1.0, np.random.default_rng(seed))
    seconds = time.perf_counter() - started
    print(json.dumps({"seconds": seconds, "bytes": _largest_resident() - resident}))
    _check(centres, radius)


if __name__ == "__main__":
    main()
