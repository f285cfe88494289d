"""A case that has been run from Python, for those who want what it left behind."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from lammps_blast.case import Case
from lammps_blast.deck import write_deck
from lammps_blast.engine import run_deck
from lammps_blast.particles import Particles


@contextmanager
def finished_run(case: Case, particles: Particles) -> Iterator[Path]:
    """Run a case in a folder that lasts as long as the context; give that folder.

    Raises
    ------
    EngineError
        If the run fails.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_deck(case, particles, folder)
        run_deck(folder, case.timesteps, case.timestep)
        yield folder
