"""A million touching particles after a blast: time and memory beside codes for granular matter.

Each program runs in a process of its own on one core, from the same positions and velocities. The
memory is the largest resident set of the process, program and libraries included.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from benchmarks.contact import STOCK, STOCK_LAW
from benchmarks.granular_codes import GranularFlight, LiggghtsFlight, YadeFlight, installed
from benchmarks.lammps_process import LammpsProcess
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_9 import PULSE_ENERGY, STEP, Scene, flight, pair_law, section_9
from lammps_blast import theory
from lammps_blast.deck import SKIN_OF_CONTACT
from lammps_blast.particles import Particles

MILLION = 1_000_000
FEWER = 100_000  # for YADE, which takes minutes to be given a million spheres
STEPS, WARM_UP_STEPS = 100, 20
MOST_REPEATS = 3  # each takes a minute
GOAL = 1.0
NS, BYTES = "ns/particle-step", "bytes/particle"
OURS = "contact blast"


def scale_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure a million spheres in LAMMPS and LIGGGHTS, and fewer in YADE."""
    repeats = min(repeats, MOST_REPEATS)
    tell(f"packing {MILLION} spheres")
    million = flight(STEPS, WARM_UP_STEPS, MILLION)
    rows = _rows(million, {STOCK: _lammps(million, STOCK_LAW)}, "LIGGGHTS", repeats, tell)
    return rows + _rows(flight(STEPS, WARM_UP_STEPS, FEWER), {}, "YADE", repeats, tell)


def _rows(
    scene: Scene,
    peers: dict[str, LammpsProcess | GranularFlight],
    code: str,
    repeats: int,
    tell: Callable[[str], None],
) -> list[Row]:
    other_code = _other_code(code, scene)
    if other_code:
        peers = peers | {code: other_code}
    ours = _lammps(scene, pair_law(section_9("contact_blast")))
    times = measure_in_turn({OURS: ours, **peers}, repeats, tell)
    name = f"{OURS}, {scene.name}"
    own_memory = Samples(tuple(ours.resident))
    rows: list[Row] = []
    for peer, process in peers.items():
        memory = Samples(tuple(process.resident))
        rows += [
            Row(name, times[OURS], peer, times[peer], NS, goal=GOAL),
            Row(f"{name}, memory", own_memory, peer, memory, BYTES, goal=GOAL),
        ]
    if not other_code:
        rows.append(Row(name, times[OURS], code, None, NS, goal=GOAL, remark="not installed"))
    return rows


def _lammps(scene: Scene, law: str) -> LammpsProcess:
    return LammpsProcess(scene.loop(law))


def _other_code(code: str, scene: Scene) -> GranularFlight | None:
    if not installed(code.lower()):
        return None
    launched = _launched(scene.particles)
    skin = SKIN_OF_CONTACT * 2.0 * float(launched.radius[0])
    kind = LiggghtsFlight if code == "LIGGGHTS" else YadeFlight
    return kind(launched, STEP, scene.steps, scene.warm_up_steps, skin)


def _launched(particles: Particles) -> Particles:
    """Return particles with the velocities that the pulse gives them in LAMMPS."""
    energy = PULSE_ENERGY * len(particles)
    speed = theory.pulse_speed(energy, particles.mass.sum())
    direction = theory.launch_directions(particles.position, particles.mass)
    return replace(particles, velocity=speed * direction)
