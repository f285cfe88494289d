"""Times LAMMPS's own step loop: packing, start-up and reading the data do not count."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lammps_blast.case import Case
from lammps_blast.deck import system_commands, write_particle_data
from lammps_blast.engine import close_lammps, start_lammps
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
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder, "log.lammps")
            with self._running(folder, lambda data: self.deck(data, log)):
                return self.nanoseconds(log.read_text())

    def forces(self) -> np.ndarray:
        """Return the forces at the start, shape (N, 3), N, in the order of the particles."""
        with (
            tempfile.TemporaryDirectory() as folder,
            self._running(folder, lambda data: f"{self._start(data)}\nrun 0 post no") as lammps,
        ):
            order = np.argsort(lammps.numpy.extract_atom("id")[: len(self.particles)])
            return lammps.numpy.extract_atom("f")[: len(self.particles)][order]

    def nanoseconds(self, log: str) -> float:
        """Return ns per step and part by what LAMMPS logged of the steps that count.

        Raises
        ------
        RuntimeError
            If LAMMPS did not get so far.
        """
        parts = self.parts or len(self.particles)
        return 1e9 * loop_seconds(log) / (parts * self.steps)

    def deck(self, data: Path, log: Path) -> str:
        """Return the commands, which read the particles from `data` and time the steps in `log`."""
        return f"""\
{self._start(data)}
run {self.warm_up_steps} post no
log {log}
run {self.steps} pre no
log none
"""

    def _start(self, data: Path) -> str:
        return f"""\
variable step index {self.step!r}
{system_commands(self.particles, str(data), self.case)}
{self.commands}
thermo 0
"""

    @contextmanager
    def _running(self, folder: str, deck: Callable[[Path], str]) -> Iterator[Any]:
        """Give a LAMMPS that has obeyed a deck, made for a data file."""
        data = Path(folder, "particles.data")
        write_particle_data(self.particles, data)
        lammps = start_lammps(log="none")
        try:
            lammps.commands_string(deck(data))
            yield lammps
        finally:
            close_lammps(lammps)


def loop_seconds(log: str) -> float:
    """Return how long the last run in a log of LAMMPS or LIGGGHTS took, s.

    Raises
    ------
    RuntimeError
        If no run ended.
    """
    loops = re.findall(r"Loop time of (\S+) on \d+ procs", log)
    if not loops:
        raise RuntimeError(f"the log does not say how long its loop took: {log}")
    return float(loops[-1])
