"""What it costs to keep account of contacts, and to watch them: our loops with and without.

After the blast of section 9 in its magnetic field and in air, where few particles touch, and in a
jammed cloud, where each touches several.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.results import Row, measure_in_turn
from benchmarks.section_9 import Scene, flight, jam, pair_law, section_9
from benchmarks.step_loop import INTEGRATORS

# The losses come before the fixes that integrate, as in every deck.
LOSSES = "fix losses all blast/losses"
WATCH = "fix watch all blast/watch 10"
NS = "ns/particle-step"


def ledger_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure the loops with and without in turn, scene after scene."""
    blast = flight(steps=9_800, warm_up_steps=200, integration=INTEGRATORS["chow"])
    return [
        *_rows("contact blast", blast, repeats, tell),
        *_rows("jammed contacts", jam(steps=500, warm_up_steps=100), repeats, tell),
    ]


def _rows(name: str, scene: Scene, repeats: int, tell: Callable[[str], None]) -> list[Row]:
    law = pair_law(section_9("contact_blast"))
    bare, losses, watched = name, f"{name}, losses", f"{name}, losses and watch"
    loops = {
        bare: scene.loop(law),
        losses: scene.loop(f"{law}{LOSSES}"),
        watched: scene.loop(f"{law}{LOSSES}\n{WATCH}"),
    }
    times = measure_in_turn(loops, repeats, tell)
    return [Row(full, times[full], "without", times[bare], NS) for full in (losses, watched)]
