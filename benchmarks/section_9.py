"""The scenes of section 9 of Zohdi (2016) that the benchmarks run: clouds of touching particles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from benchmarks.finished_run import finished_run
from benchmarks.lammps_loop import LammpsLoop
from benchmarks.section_6 import REPOSITORY
from lammps_blast.case import Case, load_case, parse_case
from lammps_blast.pair_commands import pair_commands, pair_styles
from lammps_blast.particles import Particles, create_particles
from lammps_blast.trajectory import open_universe

COUNT = 2000
STEP = 1.0e-4  # s
PULSE_ENERGY = 5.0  # J a particle
PLAIN_INTEGRATION = "fix integrate all nve/sphere"

# How full the vessel of the jammed cloud is before its spheres swell, by how much they do, and how
# fast they jostle (m/s).
VESSEL_FRACTION, SWELLING, JOSTLING = 0.58, 1.03, 0.05


@dataclass(frozen=True)
class Scene:
    """Particles on their way, all but what they do to each other.

    Attributes
    ----------
    motion
        The commands that integrate, launch and confine.
    """

    name: str
    particles: Particles
    motion: str
    steps: int
    warm_up_steps: int

    def loop(self, law: str) -> LammpsLoop:
        """Return the loop with a contact law, given by its commands."""
        case = section_9("contact_blast")
        commands = f"{law}\n{self.motion}"
        return LammpsLoop(self.particles, STEP, commands, self.steps, self.warm_up_steps, case)


def section_9(name: str, **changes: Any) -> Case:
    """Return a shipped case of section 9 with some values changed, section by section."""
    path = REPOSITORY / "lammps_inputs" / name / "case.yaml"
    content = load_case(path).model_dump(mode="json")
    return parse_case(_changed(content, changes), path.parent)


def _changed(content: dict[str, Any], changes: dict[str, Any]) -> dict[str, Any]:
    result = dict(content)
    for key, change in changes.items():
        if isinstance(change, dict):
            change = _changed(content[key] or {}, change)
        result[key] = change
    return result


def pair_law(case: Case) -> str:
    """Return the commands of what the particles of a case do to each other."""
    return pair_commands(pair_styles(case, create_particles(case)))


def flight(
    steps: int, warm_up_steps: int, count: int = COUNT, integration: str = PLAIN_INTEGRATION
) -> Scene:
    """Return the time after the blast of a cloud as full as that of the paper."""
    packing = {"domain_radius": (count / COUNT) ** (1 / 3)}
    case = section_9("contact_blast", particles={"count": count, "packing": packing})
    motion = f"{integration}\nblast_pulse all {count * PULSE_ENERGY} seed 1"
    name = f"{count} spheres, {STEP * (warm_up_steps + steps):g} s"
    return Scene(name, create_particles(case), motion, steps, warm_up_steps)


def jam(steps: int, warm_up_steps: int) -> Scene:
    """Return spheres that press on each other in a spherical vessel, and jostle."""
    position = _relaxed_positions()
    reach = float(np.linalg.norm(position, axis=1).max())
    particles = create_particles(section_9("contact_blast"))
    particles = replace(
        particles,
        position=position,
        velocity=np.random.default_rng(1).normal(scale=JOSTLING, size=position.shape),
        radius=SWELLING * particles.radius,
    )
    vessel = f"fix vessel all indent 1.0e8 sphere 0.0 0.0 0.0 {reach!r} side in"
    touching = _neighbours_in_touch(particles)
    name = f"{COUNT} jammed spheres, each touches {touching:.1f}"
    return Scene(name, particles, f"{vessel}\n{PLAIN_INTEGRATION}", steps, warm_up_steps)


def _relaxed_positions() -> np.ndarray:
    """Centres of a dense packing about the origin without overlaps, (COUNT, 3) array in m."""
    radius = section_9("contact_blast").particles.radius
    packing = {"domain_radius": radius * (COUNT / VESSEL_FRACTION) ** (1 / 3), "relax": True}
    case = section_9(
        "contact_blast",
        particles={"packing": packing},
        blast=None,
        time={"duration": STEP},
        output={"interval": STEP, "restart_interval": STEP, "contacts": False},
    )
    with finished_run(case, create_particles(case)) as folder:
        return open_universe(folder).trajectory[0].data["position"].copy()


def _neighbours_in_touch(particles: Particles) -> float:
    pairs = cKDTree(particles.position).query_pairs(2.0 * particles.radius[0])
    return 2.0 * len(pairs) / len(particles)
