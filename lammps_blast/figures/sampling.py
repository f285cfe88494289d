"""Whether the frames of a run show the gyration, and what is said where they do not."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes

from lammps_blast import theory

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

# A curve through fewer frames a turn than this does not show the turn, but an alias of it.
RESOLVED_FRAMES_PER_TURN = 8.0
# Points of an exact curve a turn, and how many turns are legible in one panel.
POINTS_PER_TURN = 24
LEGIBLE_TURNS = 20.0
MAX_CURVE_POINTS = 6000


@dataclass(frozen=True)
class Sampling:
    """How frames sample a turn, in s; the period is infinite without turns, NaN if unknown."""

    period: float
    interval: float

    @classmethod
    def of(cls, analyses: Analyses) -> Sampling:
        """Compare the time between frames with the shortest period of gyration."""
        times = analyses.envelope.results.times
        interval = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
        return cls(_period(analyses), interval)

    @property
    def frames_per_turn(self) -> float:
        """Return frames a turn; infinite without turns, NaN if unknown."""
        return self.period * (1.0 / self.interval if self.interval > 0.0 else np.inf)

    @property
    def resolved(self) -> bool:
        """Tell whether a line from frame to frame shows the turns; False if that is unknown."""
        return self.frames_per_turn >= RESOLVED_FRAMES_PER_TURN

    @property
    def warning(self) -> str:
        """Return why frames are not joined by lines, where they are not resolved."""
        if np.isnan(self.period):
            return "period of a turn unknown: markers are not joined"
        return f"only {self.frames_per_turn:.2g} frames a turn: too few to join the markers"

    def legible(self, times: np.ndarray) -> np.ndarray:
        """Return the leading times that hold as many turns as can be read in one panel."""
        if not self.frames_per_turn >= 2.0:
            return times
        return times[times - times[0] <= LEGIBLE_TURNS * self.period]

    def curve_times(self, times: np.ndarray) -> np.ndarray | None:
        """Return times (s) for a smooth curve; None if there are too many turns to draw one."""
        span = float(times[-1] - times[0])
        points = 400 + (POINTS_PER_TURN * span / self.period if self.period > 0.0 else 0.0)
        if not points <= MAX_CURVE_POINTS:
            return None
        return np.linspace(times[0], times[-1], int(points)) if span > 0.0 else times


def plot_frames(
    axes: Axes, seconds: np.ndarray, values: np.ndarray, joined: bool, **look: Any
) -> None:
    """Plot a number of each frame; markers joined by a line, or all of the markers alone."""
    if joined:
        look["markevery"] = max(1, len(seconds) // 40)
    else:
        look["linestyle"] = "none"
    axes.plot(seconds, values, **look)


def _period(analyses: Analyses) -> float:
    case, cloud = analyses.case, analyses.cloud
    if case is None:
        return np.nan
    if not any(case.fields.magnetic):
        return np.inf
    if cloud.charge is None or not cloud.has_mass:
        return np.nan
    frequency = theory.cyclotron_frequency(cloud.charge / cloud.mass, case.fields.magnetic)
    return float(np.min(theory.cyclotron_period(frequency)))
