"""The contact law of section 9 against LAMMPS's own granular style, in the same scenes.

Both have the same neighbour settings and are integrated by fix nve/sphere. A free cloud measures
how contacts are looked for: after a blast without magnetic field hardly two particles meet. In a
jammed one the laws themselves count. LAMMPS's style always works out torques, ours only where a
case asks for rotation.
"""

from __future__ import annotations

from collections.abc import Callable

from benchmarks.results import Row, measure_in_turn
from benchmarks.section_9 import Scene, flight, jam, pair_law, section_9

GOAL = 1.0
LARGE = 20_000  # particles
REPEATS_OF_LONG = 5  # at most: each takes seconds

STOCK = "pair granular"
# As stiff as eq. 7.5 at a strain of 0.05, and as lossy: an impact leaves 0.42 of the speed.
STOCK_LAW = """\
pair_style granular
pair_coeff * * hertz/material 7.0e5 0.42 0.3 damping tsuji tangential mindlin NULL 1.0 0.4"""
NS = "ns/particle-step"


def contact_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure both laws in turn, scene after scene."""
    early, whole = {"steps": 450, "warm_up_steps": 50}, {"steps": 9_800, "warm_up_steps": 200}
    ours = pair_law(section_9("contact_blast"))
    turning = pair_law(section_9("contact_blast", contact={"rotation": True}))
    jammed = jam(steps=500, warm_up_steps=100)
    return [
        _row(flight(**early), ours, repeats, tell),
        _row(flight(**whole), ours, repeats, tell),
        _row(flight(**early, count=LARGE), ours, repeats, tell),
        _row(flight(**whole, count=LARGE), ours, min(repeats, REPEATS_OF_LONG), tell),
        _row(jammed, ours, repeats, tell),
        _row(jammed, turning, repeats, tell, remark_on_ours="with rotation"),
    ]


def _row(
    scene: Scene, law: str, repeats: int, tell: Callable[[str], None], remark_on_ours: str = ""
) -> Row:
    name = ", ".join(filter(None, ("contact", scene.name, remark_on_ours)))
    loops = {name: scene.loop(law), STOCK: scene.loop(STOCK_LAW)}
    times = measure_in_turn(loops, repeats, tell)
    return Row(name, times[name], STOCK, times[STOCK], NS, goal=GOAL)
