"""Error against force evaluations of all integrators: `python -m benchmarks.work_precision`.

Runs the first part of section 9, contact alone and the collapse under all pairs, without friction,
which depends on the step. Prints the tables of docs/reproduction.md and, with --figure FILE, draws
them; that takes a few minutes. The error is that of the positions at the end: root mean square over
all particles, in units of how far they have moved.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from benchmarks.finished_run import finished_run
from benchmarks.section_9 import section_9
from lammps_blast.case import Case
from lammps_blast.deck import STEP_TABLE
from lammps_blast.engine import EngineError
from lammps_blast.figures.style import STYLE
from lammps_blast.particles import create_particles
from lammps_blast.step_history import StepHistory
from lammps_blast.trajectory import open_universe


@dataclass(frozen=True)
class Method:
    """An integrator with its settings; the longest step of an adaptive one is that of the row."""

    name: str
    integrator: str
    marker: str
    scheme: dict[str, Any] | None = None

    def time(self, duration: float, step: float) -> dict[str, Any]:
        """Return the section `time` of a case."""
        time: dict[str, Any] = {"duration": duration, "step": step, "integrator": self.integrator}
        if self.scheme is not None:
            time["implicit"] = self.scheme | {"max_step": step, "first_step": step}
        return time


METHODS = (
    Method("lorentz", "lorentz", "o-"),
    Method("verlet", "verlet", "s-"),
    Method("implicit, as in the paper", "implicit", "^-", {"tolerance": 5e-4}),
    Method("implicit, TOL = 1e-7", "implicit", "v-", {"tolerance": 1e-7}),
    Method("solved fields", "implicit", "D--", {"tolerance": 5e-4, "solve_fields": True}),
    Method("solved fields, Anderson 2, TOL = 1e-7", "implicit", "P--",
           {"tolerance": 1e-7, "solve_fields": True, "anderson": 2}),
)  # fmt: skip


@dataclass(frozen=True)
class Scene:
    """A shipped case up to some time (s), the steps (s) to try, and what to hold them against."""

    name: str
    case: str
    duration: float
    steps: tuple[float, ...]
    reference: Method
    reference_step: float


# Each by the method that is the more exact one there.
SCENES = (
    Scene(
        "contact", "contact_blast", 0.1, (1e-3, 5e-4, 2.5e-4, 1e-4, 5e-5, 2.5e-5),
        Method("reference", "lorentz", ""), 1e-6,
    ),
    Scene(
        "collapse", "near_field_all_pairs", 0.012, (4e-4, 2e-4, 1e-4, 5e-5, 2e-5),
        Method("reference", "implicit", "",
               {"tolerance": 1e-11, "iterations": 30, "solve_fields": True}), 4e-6,
    ),
)  # fmt: skip


@dataclass(frozen=True)
class Measurement:
    """What one run came to; an error of infinity stands for one that did not end."""

    evaluations: int
    error: float


def case_of(scene: Scene, method: Method, step: float) -> Case:
    """Return a scene without friction for one integrator."""
    interval = {"interval": scene.duration, "restart_interval": scene.duration}
    return section_9(
        scene.case,
        particles={"packing": {"relax": False}},  # a relaxation depends on the step as well
        contact={"friction": None},
        time=method.time(scene.duration, step),
        output=interval | {"contacts": False, "format": "binary"},
    )


def end_of(case: Case) -> tuple[np.ndarray, np.ndarray, int]:
    """Run a case; return positions at its start and end, (N, 3) in m, and force evaluations."""
    with finished_run(case, create_particles(case)) as folder:
        start, end = (open_universe(folder).trajectory[k].data["position"].copy() for k in (0, -1))
        table = folder / STEP_TABLE
        if table.is_file():
            return start, end, int(StepHistory.read(table).evaluations[-1])
        return start, end, case.timesteps


def measure(scene: Scene, exact: np.ndarray, method: Method, step: float) -> Measurement:
    """Return what a run costs and how far it is from the reference."""
    try:
        start, end, evaluations = end_of(case_of(scene, method, step))
    except EngineError:
        return Measurement(round(scene.duration / step), np.inf)
    moved = np.sqrt(np.mean((exact - start) ** 2))
    return Measurement(evaluations, float(np.sqrt(np.mean((end - exact) ** 2)) / moved))


def measurements(scene: Scene) -> Iterator[tuple[Method, float, Measurement]]:
    """Yield every method at every step of a scene."""
    _, exact, _ = end_of(case_of(scene, scene.reference, scene.reference_step))
    for method in METHODS:
        for step in scene.steps:
            yield method, step, measure(scene, exact, method, step)


def print_table(scene: Scene, rows: list[tuple[Method, float, Measurement]]) -> None:
    """Print a table in Markdown: evaluations and error of every method, a row a step."""
    print(f"\n{scene.name}, {scene.duration:g} s\n")
    print("| longest step, s | " + " | ".join(method.name for method in METHODS) + " |")
    print("|---" * (1 + len(METHODS)) + "|")
    found = {(method.name, step): result for method, step, result in rows}
    for step in scene.steps:
        cells = (found[method.name, step] for method in METHODS)
        shown = (
            f"{cell.evaluations:,}: {cell.error:.1e}" if np.isfinite(cell.error) else "stopped"
            for cell in cells
        )
        print(f"| {step:g} | " + " | ".join(shown) + " |")


@rc_context(STYLE)
def draw(results: list[tuple[Scene, list[tuple[Method, float, Measurement]]]], path: Path) -> None:
    """Draw error against evaluations, a panel a scene."""
    figure = Figure(figsize=(7.2, 3.7), layout="constrained")
    FigureCanvasAgg(figure)
    panels = figure.subplots(1, len(results))
    for axes, (scene, rows) in zip(panels, results, strict=True):
        for method in METHODS:
            own = [result for by, _, result in rows if by is method]
            axes.loglog(
                [result.evaluations for result in own], [result.error for result in own],
                method.marker, markersize=4, linewidth=1, label=method.name,
            )  # fmt: skip
        axes.set_xlabel(f"force evaluations in {scene.duration:g} s")
        axes.set_ylabel("error of positions / distance moved")
        axes.set_title(scene.name)
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figure.savefig(path, dpi=150)


def main() -> None:
    """Print the tables; draw the figure if asked for."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--figure", type=Path, metavar="FILE", help="draw them too, as PNG")
    options = parser.parse_args()
    results = []
    for scene in SCENES:
        results.append((scene, list(measurements(scene))))
        print_table(*results[-1])
    if options.figure:
        draw(results, options.figure)


if __name__ == "__main__":
    main()
