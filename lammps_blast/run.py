"""Run a case from beginning to end: `python -m lammps_blast.run case.yaml`.

Exit status: 0 done; 2 the case is invalid, nothing was written; 3 the run failed; 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

from rich.console import Console

from lammps_blast.case import Case, CaseError, ParticlesFromFile, load_case
from lammps_blast.case_warnings import case_warnings, check_near_field, remarks
from lammps_blast.deck import (
    BINARY_CONSTANTS,
    CASE,
    CONTACT_TABLE,
    DECK,
    ENERGY_TABLE,
    PARTICLE_DATA,
    PARTICLE_TABLE,
    RESTARTS,
    STEP_TABLE,
    TRAJECTORIES,
    size_of,
    write_deck,
    write_resolved_case,
)
from lammps_blast.engine import LOG, EngineError, InterruptedRunError, lammps_warnings, run_deck
from lammps_blast.particles import Particles, create_particles

DONE, INVALID, FAILED, INTERRUPTED = 0, 2, 3, 130


class FolderError(RuntimeError):
    """The output folder cannot be used; `str()` says why and what to do."""


def main(argv: list[str] | None = None) -> int:
    """Run a case: pack, launch, simulate, analyse, draw."""
    options = _options(argv)
    console = Console(stderr=True, quiet=options.quiet)
    try:
        case = load_case(options.case)
        particles = create_particles(case)
        check_near_field(case, particles)
        summary = run_case(case, particles, options, console)
    except CaseError as error:
        print(f"{options.case}: not a case that can be run\n{error}", file=sys.stderr)
        return INVALID
    except InterruptedRunError as interruption:
        print(interruption, file=sys.stderr)
        return INTERRUPTED
    except (FolderError, EngineError) as error:
        print(error, file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        text = "interrupted; a run that is simulated already is finished by lammps_blast.analyze"
        print(text, file=sys.stderr)
        return INTERRUPTED
    print(summary)
    return DONE


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m lammps_blast.run", description=main.__doc__)
    parser.add_argument("case", type=Path, help="case file, YAML")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="run folder, default runs/NAME"
    )
    parser.add_argument("--force", action="store_true", help="replace a run that is in the way")
    parser.add_argument("--no-figures", action="store_true", help="numbers only")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    return parser.parse_args(argv)


def run_case(
    case: Case, particles: Particles, options: argparse.Namespace, console: Console
) -> str:
    """Run a case in its folder and return a report of it.

    Raises
    ------
    FolderError
        If the folder cannot be written, or holds a run.
    EngineError, InterruptedRunError
        If LAMMPS fails, or the user stops it.
    """
    folder = options.output or Path("runs") / case.name
    if folder.resolve() in input_folders(case):
        raise FolderError(f"{folder} holds an input of the case: give another folder (--output)")
    try:
        prepare_folder(folder, force=options.force)
        write_resolved_case(case, folder)
        write_deck(case, particles, folder)
    except OSError as error:
        raise FolderError(f"cannot write the run folder {folder}: {error}") from error
    console.print(f"{case.name}: {size_of(case, particles)} in {folder}")
    for remark in remarks(case, particles):
        console.print(remark, highlight=False, markup=False)
    warnings = Console(stderr=True)
    for warning in case_warnings(case, particles):
        warnings.print(f"WARNING: {warning}", highlight=False, markup=False)
    threading.Thread(target=_import_ahead, args=(not options.no_figures,)).start()
    run_deck(folder, case.timesteps, case.timestep, console)
    for warning in lammps_warnings(folder):
        warnings.print(warning, highlight=False, markup=False)
    return analyze_run(folder, figures=not options.no_figures)


def _import_ahead(figures: bool) -> None:
    """Import what is wanted after LAMMPS while it runs: that takes a second or more."""
    with contextlib.suppress(ImportError):  # it comes again, where it can be told
        import lammps_blast.analyze

        if figures:
            import lammps_blast.figures  # noqa: F401


def input_folders(case: Case) -> set[Path]:
    """Return the folders that a case file and its particle file lie in."""
    files = [case.folder / CASE]
    if isinstance(case.particles, ParticlesFromFile):
        files.append(case.folder / case.particles.file)
    return {file.resolve().parent for file in files}


def prepare_folder(folder: Path, *, force: bool) -> None:
    """Make a folder ready for a run; with `force`, a run that is in it goes, and nothing else.

    Raises
    ------
    FolderError
        If there is a run in it and `force` is false.
    OSError
        If it cannot be made, or cleared.
    """
    in_the_way = []
    if folder.is_dir():
        in_the_way = [folder / name for name in _products() if (folder / name).exists()]
    if in_the_way and not force:
        names = ", ".join(path.name for path in in_the_way[:3])
        raise FolderError(f"{folder} holds a run already ({names}): give --force to replace it")
    folder.mkdir(parents=True, exist_ok=True)
    for path in in_the_way:
        path.unlink()


def _products() -> Iterator[str]:
    """Yield the names of all files that a run may leave in its folder."""
    from lammps_blast.analyze import (
        CLUMP_TABLE,
        ENVELOPE_TABLE,
        FIGURE_FOLDER,
        FIGURES,
        SPEED_TABLE,
        SUMMARY,
    )

    yield from (SUMMARY, CASE, DECK, PARTICLE_DATA, PARTICLE_TABLE, ENERGY_TABLE, LOG)
    yield from (ENVELOPE_TABLE, SPEED_TABLE, CLUMP_TABLE, CONTACT_TABLE, STEP_TABLE)
    yield from (*TRAJECTORIES.values(), BINARY_CONSTANTS)
    yield from RESTARTS
    yield from (f"{FIGURE_FOLDER}/{name}.png" for name in FIGURES)


def analyze_run(folder: Path, *, figures: bool) -> str:
    """Analyse the run in a folder, write the results there, and return a report.

    Raises
    ------
    EngineError
        If what LAMMPS left cannot be analysed.
    FolderError
        If results cannot be written.
    """
    from lammps_blast.analysis import AnalysisError
    from lammps_blast.analyze import analyze, report, write_results
    from lammps_blast.trajectory import TrajectoryError

    try:
        summary = write_results(analyze(folder), folder, figures=figures)
    except (TrajectoryError, AnalysisError) as error:
        raise EngineError(f"the run ended, but cannot be analysed: {error}") from error
    except OSError as error:
        raise FolderError(f"cannot write results into {folder}: {error}") from error
    return f"{report(summary)}\n  results in {folder}"


if __name__ == "__main__":
    sys.exit(main())
