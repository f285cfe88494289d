"""What a benchmark measures: samples of a time, and rows that set two of them in proportion."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from statistics import median


@dataclass(frozen=True)
class Samples:
    """Repeated measurements of one time, or of one amount of memory.

    Whatever else a machine does makes a measurement longer, never shorter: the best one is nearest
    to what the program takes.
    """

    values: tuple[float, ...]

    @property
    def best(self) -> float:
        return min(self.values)


@dataclass(frozen=True)
class Row:
    """One line of the table: how many times `ours` goes into `other`.

    Attributes
    ----------
    other
        A peer measured in turn with ours, or a limit (a plain number). None: not there.
    goal
        The least ratio that will do. None: there is no goal, the row is for information.
    details
        Other numbers to be told with it, by what they are.
    parts
        What `ours` is made up of, in the same unit.
    """

    name: str
    ours: Samples
    other_name: str
    other: Samples | float | None
    unit: str
    goal: float | None = None
    remark: str = ""
    details: Mapping[str, float] = field(default_factory=dict)
    parts: Mapping[str, float] = field(default_factory=dict)

    @property
    def other_best(self) -> float | None:
        return self.other.best if isinstance(self.other, Samples) else self.other

    @property
    def ratio(self) -> float | None:
        """Best of the other over best of ours."""
        return None if self.other_best is None else self.other_best / self.ours.best

    @property
    def median_ratio(self) -> float | None:
        """Median over the rounds of the ratio within a round."""
        if self.other is None:
            return None
        if isinstance(self.other, float):
            return self.other / median(self.ours.values)
        rounds = zip(self.other.values, self.ours.values, strict=True)
        return median(other / ours for other, ours in rounds)

    @property
    def met(self) -> bool | None:
        return None if self.goal is None or self.ratio is None else self.ratio >= self.goal


def measure_in_turn(
    contestants: Mapping[str, Callable[[], float]],
    repeats: int,
    tell: Callable[[str], None],
) -> dict[str, Samples]:
    """Measure A B C, A B C, ... so that a slow spell of the machine meets all of them alike."""
    values: dict[str, list[float]] = {name: [] for name in contestants}
    for turn in range(repeats):
        for name, measure in contestants.items():
            tell(f"round {turn + 1} of {repeats}: {name}")
            values[name].append(measure())
    return {name: Samples(tuple(times)) for name, times in values.items()}
