"""Analyse a run folder or a dump: `python -m lammps_blast.analyze RUN_DIR_or_dump`.

Works on what a deck leaves behind, whoever ran it: `case.yaml`, the trajectory, `energy.csv` and
LAMMPS's log. A lone dump, ours or somebody else's, gives whatever it has the columns for.
"""

from __future__ import annotations

import argparse
import csv
import json
import math
import os
import re
import sys
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from MDAnalysis import Universe

from lammps_blast.analysis import (
    ENVELOPE_LENGTHS,
    AnalysisError,
    Cloud,
    EnergyLedger,
    Envelope,
    FrameSteps,
    KineticEnergy,
    Speeds,
    Together,
    expected_spheroid,
)
from lammps_blast.case import Case, CaseError, Contact, load_case
from lammps_blast.clumps import CLUMP_NUMBERS, Clumps, PairDistances
from lammps_blast.command_line import DONE, FAILED, INVALID, tell
from lammps_blast.contacts import CONTACT_NUMBERS, ContactFrames, Contacts
from lammps_blast.deck import (
    CASE,
    CONTACT_TABLE,
    ENERGY_ACCOUNTS,
    ENERGY_TABLE,
    LOG,
    STEP_TABLE,
    counted,
)
from lammps_blast.folder_lock import is_at_work
from lammps_blast.input_files import NUMBER, mapped
from lammps_blast.neighbours import pair_blocks
from lammps_blast.pair_histories import FEW_PARTICLES, PairHistories
from lammps_blast.relaxation import RelaxationReport
from lammps_blast.resource_limits import nearest_folder
from lammps_blast.spheroid import SpheroidTheory
from lammps_blast.step_history import StepHistory
from lammps_blast.stock_contacts import energy_reserve
from lammps_blast.summation import SummationReport
from lammps_blast.trajectory import TrajectoryError, find_trajectory, open_universe

if TYPE_CHECKING:
    from lammps_blast.figures.cloud import Snapshot

SUMMARY = "summary.json"
ENVELOPE_TABLE = "envelope.csv"
SPEED_TABLE = "speeds.csv"
CLUMP_TABLE = "clumps.csv"
FIGURE_FOLDER = "figures"
FIGURES = (
    "cloud",
    "cloud_charges",
    "velocities",
    "semi_axes",
    "energy",
    "clumps",
    "clump_statistics",
    "contacts",
    "pair_distances",
    "pair_histories",
    "steps",
)

TRACKED_PARTICLES = 6
DISTANCE_FRAMES = 3

_LOOP_TIME = re.compile(rb"^Loop time of " + NUMBER + rb" on \d+ procs for (\d+) steps", re.M)

# What a run must keep to, as parts of the energy turned over or of the envelope's size.
LEDGER_LIMIT = 1e-6
INTERACTING_LEDGER_LIMIT = 1e-3
STOCK_CONTACT_LIMIT = 0.01
MAGNETIC_WORK_LIMIT = 1e-6
SPHEROID_LIMIT = 1e-6
# Steps that adapt are as long as their tolerance lets them be.
ADAPTED_STEPS_LIMIT = 1e-3


@dataclass(frozen=True)
class Check:
    """A number that theory wants to be zero, with the limit below which it counts as zero."""

    value: float
    limit: float

    @property
    def passed(self) -> bool:
        """Tell whether the number keeps to its limit; NaN does not."""
        return self.value <= self.limit


@dataclass(frozen=True)
class Analyses:
    """Everything that is known of a run, for its summary and its figures.

    `snapshots` are what figures have read of frames, by frame and most particles drawn.
    """

    name: str
    universe: Universe
    cloud: Cloud
    case: Case | None
    axis: np.ndarray
    envelope: Envelope
    frame_steps: np.ndarray
    speeds: Speeds | None
    energy: KineticEnergy | None
    ledger: EnergyLedger | None
    expected: SpheroidTheory | str
    tracked: list[int]
    wall_seconds: float | None
    axis_name: str
    checks: dict[str, Check] = field(default_factory=dict)
    clumps: Clumps | None = None
    contacts: Contacts | None = None
    distances: PairDistances | None = None
    histories: PairHistories | None = None
    steps: StepHistory | None = None
    relaxation: RelaxationReport | None = None
    summation: SummationReport | None = None
    snapshots: dict[int, dict[int, Snapshot]] = field(
        init=False, repr=False, compare=False, default_factory=dict
    )


def analyze(
    path: Path, axis: Sequence[float] | None = None, timestep: float | None = None
) -> Analyses:
    """Run every analysis on a run folder or a dump, in one pass over its trajectory.

    Parameters
    ----------
    path
        Run folder or dump. A `case.yaml` beside the dump is used.
    axis
        Direction of B, shape (3,), for a dump without a case. Without either, x.
    timestep
        Length of a step in s, for a dump without times.

    Raises
    ------
    TrajectoryError, AnalysisError, CaseError
        If the dump, the energy table or the case cannot be used.
    """
    dump = find_trajectory(path)
    folder = dump.parent
    case = load_case(folder / CASE) if (folder / CASE).is_file() else None
    universe = open_universe(dump, timestep=timestep)
    cloud = Cloud.of_frame(universe.trajectory.ts)  # which opening has read
    expected = expected_spheroid(case, cloud) if case else "there is no case file"
    direction = axis if axis is not None else _field_direction(case)
    tracked = _spread_over(universe.atoms.n_atoms, TRACKED_PARTICLES)

    envelope = Envelope(
        universe, direction, expected if isinstance(expected, SpheroidTheory) else None, cloud
    )
    frame_steps = FrameSteps(universe)
    speeds = energy = None
    if cloud.velocity is not None:
        speeds, energy = Speeds(universe, tracked, cloud), KineticEnergy(universe, cloud)
    clumps = contacts = distances = histories = None
    if _particles_meet(universe, cloud, case):
        clumps = Clumps(universe, axis=envelope.axis, cloud=cloud)
        distances = PairDistances(universe, cloud=cloud)
        recorded = _recorded_contacts(folder) if case else None
        contacts = Contacts(universe, recorded, cloud)
        if universe.atoms.n_atoms <= FEW_PARTICLES:
            histories = PairHistories(universe, recorded)
    parts = (frame_steps, envelope, speeds, energy, clumps, contacts, histories)
    Together(*filter(None, parts)).run()
    if distances:
        distances.run(frames=_spread_over(len(universe.trajectory), DISTANCE_FRAMES))

    table, step_table = folder / ENERGY_TABLE, folder / STEP_TABLE
    ledger = EnergyLedger.read(table) if table.is_file() else None
    return Analyses(
        name=case.name if case else dump.stem,
        universe=universe,
        cloud=cloud,
        case=case,
        axis=envelope.axis,
        axis_name="B" if axis is not None or (case and any(case.fields.magnetic)) else "x",
        envelope=envelope,
        frame_steps=frame_steps.results.steps,
        speeds=speeds,
        energy=energy,
        ledger=ledger,
        expected=expected,
        tracked=tracked,
        wall_seconds=wall_seconds_of(folder / LOG),
        checks=_checks(cloud, envelope, ledger, expected, case),
        clumps=clumps,
        contacts=contacts,
        distances=distances,
        histories=histories,
        steps=StepHistory.read(step_table) if step_table.is_file() else None,
        relaxation=RelaxationReport.read(folder / LOG),
        summation=SummationReport.read(folder / LOG),
    )


def _particles_meet(universe: Universe, cloud: Cloud, case: Case | None) -> bool:
    """Tell whether particles interact or, without a case, whether any two touch in the end."""
    if cloud.radius is None:
        return False
    if case:
        return case.interacts
    last = universe.trajectory[-1].data["position"]
    return any(len(pairs) > 0 for pairs, _ in pair_blocks(last, cloud.radius, 1.0))


def _recorded_contacts(folder: Path) -> ContactFrames | None:
    """Return the contacts that a run wrote; None if it wrote none."""
    dump = folder / CONTACT_TABLE
    if not dump.is_file():
        return None
    recorded = ContactFrames(dump)
    return recorded if len(recorded) else None


def _field_direction(case: Case | None) -> tuple[float, float, float]:
    """Return the direction of B; without a field every direction is as good."""
    return case.fields.magnetic if case and any(case.fields.magnetic) else (1.0, 0.0, 0.0)


def _spread_over(count: int, wanted: int) -> list[int]:
    return sorted({int(i) for i in np.linspace(0, count - 1, min(wanted, count))})


def _checks(
    cloud: Cloud,
    envelope: Envelope,
    ledger: EnergyLedger | None,
    expected: SpheroidTheory | str,
    case: Case | None,
) -> dict[str, Check]:
    checks = {}
    least_limit = ADAPTED_STEPS_LIMIT if case and case.time.integrator == "implicit" else 0.0

    def add(name: str, value: float, limit: float) -> None:
        checks[name] = Check(value, max(limit, least_limit))

    if ledger and (scale := ledger.turnover) > 0.0:
        if case and case.contact and case.contact.is_stock:
            # What stock forces took closes their ledger by its nature; but they may give only what
            # they hold.
            given = max(0.0, -float(ledger.contact_loss.min()) - _reserve(cloud, case.contact))
            add("contact_work", given / scale, STOCK_CONTACT_LIMIT)
        else:
            limit = INTERACTING_LEDGER_LIMIT if case and case.interacts else LEDGER_LIMIT
            add("energy_ledger", _largest(ledger.residual) / scale, limit)
        add("magnetic_work", _largest(ledger.magnetic_work) / scale, MAGNETIC_WORK_LIMIT)
    if isinstance(expected, SpheroidTheory):
        if ledger and case and not any((*case.fields.electric, *case.medium.velocity)):
            # The tally of drag closes the ledger by its nature; this holds it against theory.
            lost = 1.0 - (expected.speeds(ledger.times) / expected.speed) ** 2
            off = ledger.drag_loss - ledger.launch_energy * lost
            add("drag_loss", _largest(off) / scale, LEDGER_LIMIT)
        results = envelope.results
        axes = expected.semi_axes(results.launch_radius, results.times)
        largest = max(_largest(a) for a in axes)
        for name, measured, predicted in (
            ("semi_axis_parallel", results.semi_axis_parallel, axes[0]),
            ("semi_axis_perpendicular", results.semi_axis_perpendicular, axes[1]),
        ):
            if np.isfinite(measured).all() and largest > 0.0:
                add(name, _largest(measured - predicted) / largest, SPHEROID_LIMIT)
    return checks


def _reserve(cloud: Cloud, contact: Contact) -> float:
    if cloud.radius is None:
        return 0.0
    return energy_reserve(contact, cloud.position, cloud.radius)


def _largest(values: np.ndarray) -> float:
    return float(np.max(np.abs(values)))


def write_results(analyses: Analyses, folder: Path, *, figures: bool = True) -> dict[str, Any]:
    """Write tables, figures and, last, `summary.json` into a folder; return the summary.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    _write_table(folder / ENVELOPE_TABLE, _envelope_columns(analyses))
    if analyses.speeds:
        _write_table(folder / SPEED_TABLE, _speed_columns(analyses.speeds))
    if analyses.clumps:
        _write_table(folder / CLUMP_TABLE, _clump_columns(analyses))
    if figures:
        from lammps_blast.figures import draw_figures  # matplotlib is slow to import

        draw_figures(analyses, folder / FIGURE_FOLDER)
    summary = summarize(analyses)
    (folder / SUMMARY).write_text(json.dumps(summary, indent=2) + "\n", encoding="utf-8")
    return summary


def summarize(analyses: Analyses) -> dict[str, Any]:
    """Return the contents of `summary.json`; what is not known is None, never NaN."""
    times = analyses.envelope.results.times
    summary = {
        "name": analyses.name,
        "particles": analyses.universe.atoms.n_atoms,
        "steps": _step_count(analyses),
        "duration": float(times[-1] - times[0]),
        "frames": len(times),
        "complete": is_complete(analyses),
        "wall_seconds": analyses.wall_seconds,
        "axis": analyses.axis_name,
        "mass": float(analyses.cloud.mass.sum()),
        "pulse_speed": analyses.cloud.launch_speed,
        "integration": _integration_summary(analyses),
        "energy": _energy_summary(analyses),
        "envelope": _envelope_summary(analyses),
        "checks": {
            name: asdict(check) | {"passed": check.passed}
            for name, check in analyses.checks.items()
        },
    }
    if analyses.relaxation:
        summary["relaxation"] = asdict(analyses.relaxation)
    if analyses.summation:
        summary["near_field"] = asdict(analyses.summation)
    if analyses.clumps:
        summary["clumps"] = _clump_summary(analyses.clumps)
    if analyses.contacts:
        summary["contacts"] = _contact_summary(analyses.contacts)
    return _without_nan(summary)


def _step_count(analyses: Analyses) -> int:
    """Return how many steps the integrator took, which within LAMMPS's own may be many."""
    if analyses.steps:
        return len(analyses.steps.step)
    return int(analyses.frame_steps[-1] - analyses.frame_steps[0])


def _integration_summary(analyses: Analyses) -> dict[str, Any] | None:
    """Return what the steps cost: without adapted ones, the forces are evaluated once a step."""
    case, history = analyses.case, analyses.steps
    if history:
        return {
            "integrator": "implicit",
            "shortest_step": float(history.step.min()),
            "longest_step": _longest_step(history, case),
            "most_corrections": int(history.corrections.max()),
            "restarts": int(history.restarts[-1]),
            "force_evaluations": int(history.evaluations[-1]),
            "evaluations_per_second": history.evaluations_per_second,
        }
    if case is None or case.time.integrator == "implicit":
        return None
    return {
        "integrator": case.time.integrator,
        "shortest_step": case.time.step,
        "longest_step": case.time.step,
        "force_evaluations": _step_count(analyses),
        "evaluations_per_second": 1.0 / case.time.step,
    }


def _longest_step(history: StepHistory, case: Case | None) -> float:
    """Return the longest step; one that fills its interval exceeds the limit by rounding."""
    longest = float(history.step.max())
    if case is None or case.time.implicit is None:
        return longest
    return min(longest, case.time.longest_step)


def is_complete(analyses: Analyses) -> bool | None:
    """Tell whether the trajectory reaches the last frame that its case asks for; None without."""
    case = analyses.case
    if case is None:
        return None
    frames = case.timesteps // case.output_every
    last = frames * case.output_every * case.timestep
    return bool(analyses.envelope.results.times[-1] >= last * (1.0 - 1e-6))


def _energy_summary(analyses: Analyses) -> dict[str, Any]:
    summary, ledger = {}, analyses.ledger
    if analyses.energy:
        results = analyses.energy.results
        summary |= {
            "launch": float(results.kinetic[0] + results.rotational[0]),
            "kinetic": float(results.kinetic[-1]),
            "rotational": float(results.rotational[-1]),
        }
    if ledger:
        summary |= {
            **{account: float(getattr(ledger, account)[-1]) for account in ENERGY_ACCOUNTS[2:]},
            "largest_residual": _largest(ledger.residual),
        }
    return summary


def _envelope_summary(analyses: Analyses) -> dict[str, Any]:
    results, expected = analyses.envelope.results, analyses.expected
    summary = {
        "axis": analyses.axis.tolist(),
        "launch_radius": results.launch_radius,
        "centre": results.centre[-1].tolist(),
    }
    summary |= {name: float(results[name][-1]) for name in ENVELOPE_LENGTHS}
    if isinstance(expected, SpheroidTheory):
        parallel, perpendicular = expected.semi_axes(results.launch_radius, results.times[-1:])
        summary["theory"] = {
            "semi_axis_parallel": float(parallel[0]),
            "semi_axis_perpendicular": float(perpendicular[0]),
        }
        summary["fraction_outside_theory"] = float(results.fraction_outside[-1])
    else:
        summary["theory"] = None
        summary["no_theory_because"] = expected
    return summary


def _clump_summary(clumps: Clumps) -> dict[str, Any]:
    results, shapes = clumps.results, clumps.results.shapes
    sizes, counts = np.unique(results.sizes, return_counts=True)
    return {
        "gap": clumps.gap,
        "pieces_first": int(results.pieces[0]),
        "pieces_last": int(results.pieces[-1]),
        "clumps": int(results.clumps[-1]),
        "largest": _count(results.largest[-1]),
        "largest_fraction": float(results.largest_fraction[-1]),
        "mean_size": float(results.mean_size[-1]),
        "mass_mean_size": float(results.mass_mean_size[-1]),
        "sizes": {str(size): int(count) for size, count in zip(sizes, counts, strict=True)},
        "shape": {
            "clumps": len(shapes),
            "along_over_across": shapes.alignment,
            "radius_of_gyration": _median(shapes.radius_of_gyration),
            "asphericity": _median(shapes.asphericity),
        },
    }


def _contact_summary(contacts: Contacts) -> dict[str, Any]:
    results = contacts.results
    summary = {
        "source": "recorded" if contacts.recorded else "positions and radii",
        "first": _count(results.contacts[0]),
        "last": _count(results.contacts[-1]),
        "most": _count(_largest_known(results.contacts)),
        "coordination": float(results.coordination[-1]),
        "largest_strain": _largest_known(results.largest_strain),
    }
    if results.mean_normal_force is not None:
        summary["largest_normal_force"] = _largest_known(results.largest_normal_force)
    if results.bonded_fraction is not None:
        summary["bonded_fraction"] = float(results.bonded_fraction[-1])
    return summary


def _count(value: float) -> int | None:
    return int(value) if math.isfinite(value) else None


def _median(values: np.ndarray) -> float:
    return float(np.median(values)) if len(values) else math.nan


def _largest_known(values: np.ndarray) -> float:
    return float(np.max(values, initial=-math.inf, where=np.isfinite(values)))


def _clump_columns(analyses: Analyses) -> dict[str, np.ndarray]:
    results, contacts = analyses.clumps.results, analyses.contacts.results
    columns = {"time": results.times} | {name: results[name] for name in CLUMP_NUMBERS}
    return columns | {
        name: contacts[name] for name in CONTACT_NUMBERS if contacts[name] is not None
    }


def _envelope_columns(analyses: Analyses) -> dict[str, np.ndarray]:
    results, expected = analyses.envelope.results, analyses.expected
    columns = {"time": results.times} | {name: results[name] for name in ENVELOPE_LENGTHS}
    columns |= {f"centre_{axis}": results.centre[:, i] for i, axis in enumerate("xyz")}
    if isinstance(expected, SpheroidTheory):
        axes = expected.semi_axes(results.launch_radius, results.times)
        columns |= {
            "theory_parallel": axes[0],
            "theory_perpendicular": axes[1],
            "fraction_outside_theory": results.fraction_outside,
        }
    return columns


def _speed_columns(speeds: Speeds) -> dict[str, np.ndarray]:
    results = speeds.results
    columns = {"time": results.times}
    columns |= {name: results[name] for name in ("mean", "rms", "smallest", "largest")}
    return columns | {f"mean_v{axis}": results.mean_velocity[:, i] for i, axis in enumerate("xyz")}


def _write_table(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    with path.open("w", encoding="ascii", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(map(float, column) for column in columns.values()), strict=True))


def _without_nan(value: Any) -> Any:
    """Return the value with NaN and infinities, which JSON lacks, as None."""
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def wall_seconds_of(log: Path) -> float | None:
    """Return the seconds that the run in LAMMPS's log took, in all its parts; None without one."""
    try:
        with mapped(log) as text:
            after_relaxation = text.rfind(b"\nRelaxed packing: steps ") + 1
            loops = (found.groups() for found in _LOOP_TIME.finditer(text, after_relaxation))
            parts = [float(seconds) for seconds, steps in loops if steps != b"0"]
    except OSError:
        return None
    return sum(parts) if parts else None


def report(summary: Mapping[str, Any]) -> str:
    """Return a few lines for people: what became of the cloud, and which checks failed."""
    envelope, energy = summary["envelope"], summary["energy"]
    lines = [
        f"{summary['name']}: {counted(summary['particles'], 'particle')},"
        f" {counted(summary['frames'], 'frame')},"
        f" {_shown(summary['duration'], 4)} s",
        f"  outermost particles: {_shown(envelope['extent_parallel'])} m along {summary['axis']},"
        f" {_shown(envelope['extent_perpendicular'])} m across",
    ]
    if summary["complete"] is False:
        lines.append("  WARNING: the trajectory ends before the duration that its case asks for")
    if "kinetic" in energy:
        launch, last = _shown(energy["launch"]), _shown(energy["kinetic"])
        lines.insert(1, f"  kinetic energy {launch} J -> {last} J")
    if envelope["theory"]:
        lines.append(
            "  spheroid, measured and exact: "
            f"{_pair(envelope, 'semi_axis_parallel')} along {summary['axis']},"
            f" {_pair(envelope, 'semi_axis_perpendicular')} across"
        )
    else:
        lines.append(f"  no exact spheroid to compare with: {envelope['no_theory_because']}")
    if "relaxation" in summary:
        steps = summary["relaxation"]["steps"]
        lines.insert(1, f"  packing relaxed in {counted(steps, 'step')}, no overlap is left")
    lines += _clump_report(summary)
    lines += _summation_report(summary)
    lines += _integration_report(summary)
    for name, check in summary["checks"].items():
        verdict = "ok" if check["passed"] else f"FAILED, limit {check['limit']:g}"
        value = "not a number" if check["value"] is None else f"{check['value']:.2e}"
        lines.append(f"  check {name}: {value} ({verdict})")
    if not summary["checks"]:
        lines.append("  nothing exact to check this run against")
    if not all(check["passed"] for check in summary["checks"].values()):
        lines.append("  a check that fails by little asks for smaller steps")
    return "\n".join(lines)


def _clump_report(summary: Mapping[str, Any]) -> list[str]:
    if "clumps" not in summary:
        return []
    clumps, contacts = summary["clumps"], summary["contacts"]
    pieces = (
        f"  {counted(clumps['pieces_first'], 'piece')} -> {clumps['pieces_last']},"
        f" {clumps['clumps']} of them clumps of two or more"
    )
    if clumps["largest"] is not None:
        pieces += f"; the largest holds {counted(clumps['largest'], 'particle')}"
    if contacts["first"] is None or contacts["last"] is None:
        return [pieces]
    touching = (
        f"  {counted(contacts['first'], 'contact')} -> {contacts['last']},"
        f" at most {contacts['most']}; largest strain {_shown(contacts['largest_strain'], 3)}"
    )
    return [pieces, touching]


def _integration_report(summary: Mapping[str, Any]) -> list[str]:
    integration = summary["integration"]
    if integration is None or integration["integrator"] != "implicit":
        return []
    return [
        f"  {counted(summary['steps'], 'step')} of {integration['shortest_step']:.3g} to"
        f" {integration['longest_step']:.3g} s, {counted(integration['restarts'], 'restart')},"
        f" {integration['evaluations_per_second']:,.0f} force evaluations per simulated second"
    ]


def _summation_report(summary: Mapping[str, Any]) -> list[str]:
    if "near_field" not in summary:
        return []
    used = summary["near_field"]
    if used["method"] == "direct":
        return ["  near field summed directly over all pairs"]
    return [f"  near field summed by tree, with an error of {used['error']:.1e} of the force"]


def _shown(value: float | None, digits: int = 6) -> str:
    """Return a number of a summary, which has None for what is not finite."""
    return "not a number" if value is None else f"{value:.{digits}g}"


def _pair(envelope: Mapping[str, Any], name: str) -> str:
    pair = envelope[name], envelope["theory"][name]
    return " and ".join("none" if value is None else f"{value:.6g} m" for value in pair)


def main(argv: list[str] | None = None) -> int:
    """Analyse a run folder or a LAMMPS dump: envelope, speeds, energies, figures."""
    parser = argparse.ArgumentParser(
        prog="python -m lammps_blast.analyze", description=main.__doc__
    )
    parser.add_argument("path", type=Path, help="run folder, or dump file")
    parser.add_argument(
        "--axis", type=float, nargs=3, metavar=("BX", "BY", "BZ"),
        help="direction of B, where no case.yaml lies beside the dump",
    )  # fmt: skip
    parser.add_argument("--timestep", type=float, help="step in s, for a dump without times")
    parser.add_argument("-o", "--output", type=Path, metavar="DIR", help="where results go")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")
    options = parser.parse_args(argv)
    if options.axis is not None and not any(options.axis):
        parser.error("--axis needs a direction, not 0 0 0")
    try:
        folder = options.output or _result_folder(options.path)
        _refuse_unwritable(folder)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always", UserWarning)
            analyses = analyze(options.path, options.axis, options.timestep)
        _print_warnings(caught)
        if is_at_work(options.path):
            tell(f"warning: a run is at work in {options.path}: this is how far it is", sys.stderr)
        folder.mkdir(parents=True, exist_ok=True)
        summary = write_results(
            analyses,
            folder,
            figures=not options.no_figures,
        )
    except CaseError as error:
        tell(error, sys.stderr)
        return INVALID
    except (TrajectoryError, AnalysisError, OSError) as error:
        tell(f"cannot analyse: {error}", sys.stderr)
        return FAILED
    except MemoryError:
        tell("cannot analyse: a frame needs more memory than there is", sys.stderr)
        return FAILED
    tell(report(summary))
    tell(f"  results in {folder}")
    return DONE


def _print_warnings(caught: Sequence[warnings.WarningMessage]) -> None:
    for text in dict.fromkeys(str(warning.message) for warning in caught):
        tell(f"warning: {text}", sys.stderr)


def _refuse_unwritable(folder: Path) -> None:
    if not os.access(nearest_folder(folder), os.W_OK | os.X_OK):
        raise AnalysisError(f"results cannot be written to {folder}: give a folder with --output")


def _result_folder(path: Path) -> Path:
    """Return the run folder itself, or for a lone dump a folder beside it."""
    return path if path.is_dir() else path.with_name(path.name + ".analysis")


if __name__ == "__main__":
    sys.exit(main())
