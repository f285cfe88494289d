"""What a run's log says of how the near field was summed over all pairs: directly, or by tree."""

from __future__ import annotations

import re
from collections import deque
from dataclasses import dataclass
from pathlib import Path

from lammps_blast.input_files import NUMBER, mapped

_LINE = re.compile(
    rb"^Near field at step (\d{1,18}): (?:direct sum|"
    rb"tree of order (\d{1,9}), opening " + NUMBER + rb", error " + NUMBER + rb" of the force)",
    re.M,
)


@dataclass(frozen=True)
class SummationReport:
    """How the near field was summed in the end.

    Attributes
    ----------
    method
        "direct" or "tree".
    since_step
        The step from which on it was.
    order, opening
        Total order of the expansions; largest ratio of the radii of two cells, added up, to their
        distance. None for a direct sum.
    error
        Root mean square of the error of the force over that of the force, measured on a sample of
        the particles. Zero for a direct sum.
    """

    method: str
    since_step: int
    order: int | None
    opening: float | None
    error: float

    @classmethod
    def read(cls, log: Path) -> SummationReport | None:
        """Find the last report in LAMMPS's log; None if there is none."""
        try:
            with mapped(log) as text:
                last = deque((found.groups() for found in _LINE.finditer(text)), maxlen=1)
        except OSError:
            return None
        if not last:
            return None
        step, order, opening, error = last[0]
        if order is None:
            return cls("direct", int(step), None, None, 0.0)
        return cls("tree", int(step), int(order), float(opening), float(error))
