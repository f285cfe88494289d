"""Times LAMMPS's step loop in a process of its own, with ranks and threads, and its memory."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

from benchmarks.finished_process import finished_process
from benchmarks.lammps_loop import LammpsLoop
from lammps_blast.deck import write_particle_data

PROGRAMS = Path(sys.executable).parent


@dataclass(frozen=True)
class LammpsProcess:
    """Runs a loop by the commands `lmp` and, for several ranks, `mpiexec`.

    Attributes
    ----------
    resident
        Bytes a particle of the largest rank's resident set, one number a run.
    """

    loop: LammpsLoop
    ranks: int = 1
    threads: int = 1
    resident: list[float] = field(default_factory=list)

    def __call__(self) -> float:
        """Return ns per step and particle, times the cores that were at work.

        Raises
        ------
        RuntimeError
            If LAMMPS fails.
        """
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            data, deck, log = folder / "particles.data", folder / "in.loop", folder / "log.loop"
            write_particle_data(self.loop.particles, data)
            deck.write_text(self.loop.deck(data, log))
            done = finished_process(self._command(deck), folder, {"OMP_NUM_THREADS": "1"})
            self.resident.append(done.resident / len(self.loop.particles))
            return self.ranks * self.threads * self.loop.nanoseconds(log.read_text())

    def _command(self, deck: Path) -> list[str]:
        command = [str(PROGRAMS / "lmp"), "-in", str(deck), "-log", "none", "-screen", "none"]
        if self.threads > 1:
            command += ["-sf", "omp", "-pk", "omp", str(self.threads)]
        if self.ranks > 1:
            command = [str(PROGRAMS / "mpiexec"), "-n", str(self.ranks), *command]
        return command
