"""A plain vector loop over all pairs, compiled for this machine: what the plugin's is held against.

It knows the exponents and the mass of section 9's particles when it is compiled or called; the
plugin takes any, finds coincident centres, and runs from one build on every processor.
"""

from __future__ import annotations

import ctypes
import shutil
import subprocess
import tempfile
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).with_name("plain_kernel.cpp")
# Those of the plugin, but for its choice among processors.
FLAGS = ("-O3", "-std=c++17", "-fopenmp-simd", "-fno-math-errno", "-fno-trapping-math")
FOR_THIS_MACHINE = "-march=native"


@dataclass(frozen=True)
class PlainKernel:
    """Times the loop on some positions (N, 3), `tile` sources at a time."""

    position: np.ndarray
    tile: int

    def __call__(self) -> float:
        """Return ns per pair."""
        with tempfile.TemporaryDirectory() as folder:
            forces = _compiled(Path(folder)).plain_forces
            x, y, z = np.ascontiguousarray(self.position.T)
            f = np.zeros((3, len(x)))
            columns = [_address(column) for column in (x, y, z)]
            sums = [_address(column) for column in f]
            numbers = ctypes.c_double(6.7), ctypes.c_double(0.13)
            started = time.perf_counter()
            forces(len(x), self.tile, *columns, *numbers, *sums)
            seconds = time.perf_counter() - started
        return 1e9 * seconds / (len(x) * (len(x) - 1) // 2)


def plain_kernels(position: np.ndarray) -> dict[str, PlainKernel]:
    """Return the loop over whole rows and the loop over tiles; none without a compiler."""
    if shutil.which("g++") is None:
        return {}
    return {
        "plain vector loop": PlainKernel(position, len(position)),
        "plain vector loop, tiled": PlainKernel(position, 512),
    }


def _address(column: np.ndarray) -> ctypes.c_void_p:
    return column.ctypes.data_as(ctypes.c_void_p)


def _compiled(folder: Path) -> ctypes.CDLL:
    library = folder / "plain_kernel.so"
    subprocess.run(
        ["g++", *FLAGS, FOR_THIS_MACHINE, "-shared", "-fPIC", str(SOURCE), "-o", str(library)],
        check=True,
    )
    return ctypes.CDLL(str(library))
