"""The steps of an integrator that adapts them: how long they were, and what they cost.

`fix nve/implicit` leaves a row for every step in `steps.csv`.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lammps_blast.analysis import AnalysisError, read_table
from lammps_blast.case import LARGEST_SIZE, SMALLEST_SIZE

COLUMNS = ("time", "step", "corrections", "error", "restarts", "evaluations")


@dataclass(frozen=True)
class StepHistory:
    """Every step that was accepted, each an array of shape (S,).

    Attributes
    ----------
    times
        At the end of each step, s.
    step
        Its length, s.
    corrections
        Corrections that it took, K in eq. C.5.
    error
        Of the last of them, in units of the motion of the whole step.
    restarts
        Attempts that failed, from the start of the run until the step was accepted.
    evaluations
        Of the forces, from the start of the run until the step was accepted.
    """

    times: np.ndarray
    step: np.ndarray
    corrections: np.ndarray
    error: np.ndarray
    restarts: np.ndarray
    evaluations: np.ndarray

    @property
    def duration(self) -> float:
        """Time in s that the steps take together."""
        return float(self.step.sum())

    @property
    def evaluations_per_second(self) -> float:
        """Force evaluations per simulated second."""
        return float(self.evaluations[-1]) / self.duration

    @classmethod
    def read(cls, path: Path) -> StepHistory:
        """Read `steps.csv`.

        Raises
        ------
        AnalysisError
            If the file is missing or is not such a table.

        Warns
        -----
        UserWarning
            If the last line was cut short.
        """
        names, table = read_table(path, "a table of steps")
        if names != COLUMNS:
            raise AnalysisError(f"{path}: not a table of steps of this version")
        history = cls(*table.T)
        if not (np.abs(table).max() <= LARGEST_SIZE and history.step.min() >= SMALLEST_SIZE):
            raise AnalysisError(f"{path}: damaged: a number that no step can have")
        return history
