"""Times LAMMPS's own step loop: packing, start-up and reading the data do not count."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lammps_blast.case import Case
from lammps_blast.deck import system_commands, write_particle_data
from lammps_blast.engine import start_lammps
from lammps_blast.particles import Particles


@dataclass(frozen=True)
class LammpsLoop:
    """Runs some steps on one core, each time from the same start.

    Attributes
    ----------
    commands
        What follows the reading of the particles, up to the first step.
    warm_up_steps
        Made first, and not timed.
    case
        Whose neighbour settings are used; None for particles that do not interact.
    parts
        Into how many parts the time of a step is divided. None: one a particle.
    """

    particles: Particles
    step: float
    commands: str
    steps: int
    warm_up_steps: int = 200
    case: Case | None = None
    parts: int | None = None

    def __call__(self) -> float:
        """Return ns per step and part."""
        with tempfile.TemporaryDirectory() as folder, self._started(folder) as lammps:
            log = Path(folder, "log.lammps")
            lammps.commands_string(
                f"run {self.warm_up_steps} post no\nlog {log}\nrun {self.steps} pre no\nlog none"
            )
            parts = self.parts or len(self.particles)
            return 1e9 * _loop_seconds(log) / (parts * self.steps)

    def forces(self) -> np.ndarray:
        """Return the forces at the start, shape (N, 3), N, in the order of the particles."""
        with tempfile.TemporaryDirectory() as folder, self._started(folder) as lammps:
            lammps.commands_string("run 0 post no")
            order = np.argsort(lammps.numpy.extract_atom("id")[: len(self.particles)])
            return lammps.numpy.extract_atom("f")[: len(self.particles)][order]

    @contextmanager
    def _started(self, folder: str) -> Iterator[Any]:
        """Give a LAMMPS that is ready to run."""
        data = Path(folder, "particles.data")
        write_particle_data(self.particles, data)
        lammps = start_lammps(log="none")
        try:
            lammps.commands_string(
                f"variable step index {self.step!r}\n"
                f"{system_commands(self.particles, str(data), self.case)}\n"
                f"{self.commands}\n"
                "thermo 0"
            )
            yield lammps
        finally:
            lammps.close()


def _loop_seconds(log: Path) -> float:
    loop = re.search(r"Loop time of (\S+) on 1 procs", log.read_text())
    if loop is None:
        raise RuntimeError(f"LAMMPS did not say how long its loop took: {log.read_text()}")
    return float(loop.group(1))
