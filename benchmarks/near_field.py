"""The near field of section 9 over all pairs, and the same law through a neighbour list.

Forces alone, with no step of energies among them. An interaction is the force on one particle from
one other: N particles have N (N - 1) of them, in N (N - 1) / 2 pairs. The list has a cutoff wider
than the cloud, so that all pairs are in it, and is made before the clock starts.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from benchmarks.lammps_loop import LammpsLoop
from benchmarks.peers import ROWS, numba_all_pairs
from benchmarks.plain_kernel import plain_kernels
from benchmarks.results import Row, Samples, measure_in_turn
from benchmarks.section_9 import COUNT, PLAIN_INTEGRATION, PULSE_ENERGY, pair_law, section_9
from lammps_blast.case import Case
from lammps_blast.pairs import near_field_law
from lammps_blast.particles import Particles, create_particles

LIMIT = 1.0  # ns an interaction
LIST_GOAL = 2.0
MANY = 20_000
NUMBA = "numba, each pair twice"
PLAIN_GOAL = 1 / 1.15
WARM_UP_STEPS = 2
WIDER_THAN_CLOUD = 5.0  # m

# LAMMPS works out energies at the end of a run for the computes that may be asked for them.
NO_ENERGIES = """\
thermo_style custom step
uncompute thermo_pe
uncompute thermo_press"""


@dataclass(frozen=True)
class Exponents:
    """Of attraction and repulsion; and how many steps tell what they cost, by sum and by list."""

    attraction: float
    repulsion: float
    steps: int
    steps_by_list: int

    def loop(self, cutoff: float | str, steps: int) -> LammpsLoop:
        """Return the loop from the blast on, in ns a pair."""
        field = {
            "attraction": {"exponent": self.attraction},
            "repulsion": {"exponent": self.repulsion},
            "cutoff": cutoff,
        }
        if cutoff != "all":
            field |= {"method": None, "accuracy": None}
        case, particles = section_9_cloud(COUNT, near_field=field)
        pulse = f"blast_pulse all {COUNT * PULSE_ENERGY} seed 1"
        return LammpsLoop(
            particles,
            case.time.step,
            "\n".join([pair_law(case), PLAIN_INTEGRATION, pulse, NO_ENERGIES]),
            steps,
            WARM_UP_STEPS,
            case,
            parts=COUNT * (COUNT - 1) // 2,
        )


def section_9_cloud(count: int, **changes: Any) -> tuple[Case, Particles]:
    """Return section 9 with its near field alone, and a cloud as full as the paper's."""
    radius = (count / COUNT) ** (1 / 3)
    case = section_9(
        "near_field_all_pairs",
        particles={"count": count, "packing": {"domain_radius": radius, "relax": False}},
        contact=None,
        output={"contacts": False},
        **changes,
    )
    return case, create_particles(case)


WHOLE = Exponents(1.0, 2.0, steps=200, steps_by_list=30)
OTHERS = (
    Exponents(1.5, 2.5, steps=100, steps_by_list=30),
    Exponents(1.1, 2.2, steps=5, steps_by_list=5),
)


def near_field_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure sum and list in turn, for whole exponents, halves, and others."""
    whole, by_list = _measure(WHOLE, repeats, tell)
    rows = [
        Row(
            _name(WHOLE),
            Samples(tuple(0.5 * time for time in whole.values)),
            "limit",
            LIMIT,
            "ns/interaction",
            goal=1.0,
        ),
        _row(WHOLE, whole, by_list, goal=LIST_GOAL),
    ]
    rows += [_row(other, *_measure(other, repeats, tell)) for other in OTHERS]
    return rows + _compiled_loop_rows(repeats, tell)


def _compiled_loop_rows(repeats: int, tell: Callable[[str], None]) -> list[Row]:
    """Measure the direct sum of many particles in turn with compiled loops over all pairs."""
    directly = {"method": "direct", "accuracy": None}
    case, particles = section_9_cloud(MANY, near_field=directly)
    name = f"near field, all pairs of {MANY:,}"
    ours = LammpsLoop(
        particles,
        case.time.step,
        "\n".join([pair_law(case), PLAIN_INTEGRATION, NO_ENERGIES]),
        steps=3,
        warm_up_steps=WARM_UP_STEPS,
        case=case,
        parts=MANY * (MANY - 1) // 2,
    )
    plain = plain_kernels(particles.position)
    numba = numba_all_pairs(particles, near_field_law(case.near_field), ROWS)
    peers: dict[str, Callable[[], float]] = plain | ({NUMBA: numba} if numba else {})
    times = measure_in_turn({name: ours} | peers, repeats, tell)
    best = min((times[loop] for loop in plain), key=lambda samples: samples.best, default=None)
    return [
        Row(
            name,
            times[name],
            "plain vector loop",
            best,
            "ns/pair",
            goal=PLAIN_GOAL,
            remark="" if plain else "no compiler",
        ),
        Row(
            name,
            times[name],
            NUMBA,
            times.get(NUMBA),
            "ns/pair",
            remark="" if numba else "not installed",
        ),
    ]


def _measure(
    exponents: Exponents, repeats: int, tell: Callable[[str], None]
) -> tuple[Samples, Samples]:
    all_pairs, by_list = _name(exponents), f"{_name(exponents)}, by list"
    loops = {
        all_pairs: exponents.loop("all", exponents.steps),
        by_list: exponents.loop(WIDER_THAN_CLOUD, exponents.steps_by_list),
    }
    times = measure_in_turn(loops, repeats, tell)
    return times[all_pairs], times[by_list]


def _row(
    exponents: Exponents, all_pairs: Samples, by_list: Samples, goal: float | None = None
) -> Row:
    return Row(_name(exponents), all_pairs, "neighbour list", by_list, "ns/pair", goal=goal)


def _name(exponents: Exponents) -> str:
    powers = f"{exponents.attraction:g} and {exponents.repulsion:g}"
    return f"near field, all pairs, exponents {powers}"
