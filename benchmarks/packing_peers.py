"""Random sequential addition by others: numba on a grid, stock LAMMPS, YADE.

Each gets the number of spheres and their radius in m. The domain is a ball of radius 1 m, of YADE,
which fills boxes, a cube of the same volume.
"""

from __future__ import annotations

import math
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lammps_blast.engine import close_lammps, start_lammps

MOST_TRIES = 100_000  # for one sphere


def numba_insertion(count: int, radius: float) -> Callable[[], float] | None:
    """Return what times one sphere after the other, looked up on a grid; None without numba.

    It is what a compiled loop takes that keeps to the definition. The time of compiling, once,
    does not count.
    """
    try:
        import numba
    except ImportError:
        return None
    insert = numba.njit(insert_on_grid)
    insert(2, 0.1, 1)

    def seconds() -> float:
        started = time.perf_counter()
        insert(count, radius, 1)
        return time.perf_counter() - started

    return seconds


def insert_on_grid(count, radius, seed):  # numba infers its types
    """Centres in m, (count, 3): drawn one by one, refused where a neighbour in the grid is near."""
    np.random.seed(seed)  # the generator that numba compiles
    reach, exclusion = 1.0 - radius, 2.0 * radius
    cells = int(2.0 * reach / exclusion)
    scale = cells / (2.0 * reach)
    first = np.full((cells + 2, cells + 2, cells + 2), -1)  # of the spheres of a cell
    following = np.full(count, -1)
    centres = np.empty((count, 3))
    placed = 0
    while placed < count:
        x = np.random.uniform(-reach, reach)
        y = np.random.uniform(-reach, reach)
        z = np.random.uniform(-reach, reach)
        if x * x + y * y + z * z > reach * reach:
            continue
        i, j, k = int((x + reach) * scale), int((y + reach) * scale), int((z + reach) * scale)
        free = True
        for a in range(i, i + 3):
            for b in range(j, j + 3):
                for c in range(k, k + 3):
                    other = first[a, b, c]
                    while free and other >= 0:
                        dx = x - centres[other, 0]
                        dy = y - centres[other, 1]
                        dz = z - centres[other, 2]
                        free = dx * dx + dy * dy + dz * dz >= exclusion * exclusion
                        other = following[other]
                if not free:
                    break
            if not free:
                break
        if free:
            centres[placed] = x, y, z
            following[placed] = first[i + 1, j + 1, k + 1]
            first[i + 1, j + 1, k + 1] = placed
            placed += 1
    return centres


def lammps_insertion(count: int, radius: float) -> Callable[[], float]:
    """Return what times LAMMPS's own command for it, which compares with every atom before."""

    def seconds() -> float:
        lammps = start_lammps(log="none")
        try:
            lammps.commands_string(f"""\
atom_style sphere
region domain sphere 0.0 0.0 0.0 {1.0 - radius!r}
region box block -1.0 1.0 -1.0 1.0 -1.0 1.0
create_box 1 box""")
            command = f"create_atoms 1 random {count} 1 domain overlap {2.0 * radius!r}"
            started = time.perf_counter()
            lammps.command(f"{command} maxtry {MOST_TRIES}")
            elapsed = time.perf_counter() - started
            if lammps.get_natoms() != count:
                raise RuntimeError(f"LAMMPS placed {lammps.get_natoms()} of {count} spheres")
        finally:
            close_lammps(lammps)
        return elapsed

    return seconds


YADE_SCRIPT = """\
import time
from yade import pack
cloud = pack.SpherePack()
started = time.perf_counter()
placed = cloud.makeCloud(
    (0, 0, 0), ({edge!r}, {edge!r}, {edge!r}), rMean={radius!r}, rRelFuzz=0, num={count}, seed=1
)
print("seconds", time.perf_counter() - started, "placed", placed)
"""


def yade_cloud(count: int, radius: float) -> Callable[[], float] | None:
    """Return what times YADE's own function for it; None where YADE is not installed."""
    if shutil.which("yade") is None:
        return None
    edge = (4.0 / 3.0 * math.pi) ** (1 / 3)

    def seconds() -> float:
        with tempfile.TemporaryDirectory() as folder:
            script = Path(folder, "cloud.py")
            script.write_text(YADE_SCRIPT.format(edge=edge, radius=radius, count=count))
            command = ["yade", "-x", "-n", "-j1", script.name]
            done = subprocess.run(
                command, cwd=folder, capture_output=True, text=True, stdin=subprocess.DEVNULL
            )
        words = done.stdout.split()
        if words[-2:] != ["placed", str(count)]:
            raise RuntimeError(f"YADE did not place the spheres: {done.stdout} {done.stderr}")
        return float(words[-3])

    return seconds
