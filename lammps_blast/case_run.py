"""What the run command does with a case: pack, launch, simulate, analyse, draw."""

from __future__ import annotations

import argparse
import contextlib
import os
import sys
import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from lammps_blast.case import Case, CaseError, PackedParticles, ParticlesFromFile, load_case
from lammps_blast.case_warnings import case_warnings, check_near_field, remarks
from lammps_blast.command_line import (
    DONE,
    FAILED,
    INTERRUPTED,
    INVALID,
    OUT_OF_MEMORY,
    shown_text,
    tell,
)
from lammps_blast.deck import (
    BINARY_CONSTANTS,
    CASE,
    CONTACT_TABLE,
    DECK,
    ENERGY_TABLE,
    KEPT_TRAJECTORY,
    LOG,
    PARTICLE_DATA,
    PARTICLE_TABLE,
    RESTARTS,
    STEP_TABLE,
    TRAJECTORIES,
    UNFINISHED,
    size_of,
    write_deck,
    write_resolved_case,
)
from lammps_blast.engine import (
    INTERRUPTED_AFTERWARDS,
    DeckRun,
    EngineError,
    InterruptedRunError,
    check_engine,
    lammps_warnings,
    run_deck,
)
from lammps_blast.folder_lock import FolderError, folder_lock
from lammps_blast.particles import Particles, create_particles
from lammps_blast.progress import ProgressConsole
from lammps_blast.ranks import LaunchedRanks
from lammps_blast.resource_limits import BYTES_TO_RUN, check_room, memory_shortage
from lammps_blast.resumption import Resumption, ResumptionError, prepare_resumption, resumption


def follow(options: argparse.Namespace, launched: LaunchedRanks) -> int:
    """Do what the first rank bids, as another rank; return the exit status."""
    folder = None
    with contextlib.suppress(CaseError):  # the first rank tells it
        folder = run_folder(options, load_case(options.case))
    launched.run_together(folder)
    return DONE


def lead(
    options: argparse.Namespace, launched: LaunchedRanks | None, heed: Callable[[], None]
) -> int:
    """Run the case of a command line, and tell what came of it; return the exit status.

    `heed` raises KeyboardInterrupt if somebody has asked for an end.
    """
    status = FAILED
    try:
        status = _told(options, launched, heed)
    finally:
        if launched:
            launched.end(status)
    return status


def _told(
    options: argparse.Namespace, launched: LaunchedRanks | None, heed: Callable[[], None]
) -> int:
    if options.threads:
        os.environ["OMP_NUM_THREADS"] = str(options.threads)
    try:
        summary = run_case(options, ProgressConsole(quiet=options.quiet), launched, heed)
    except CaseError as error:
        tell(f"{options.case}: not a case that can be run\n{error}", sys.stderr)
        return INVALID
    except InterruptedRunError as interruption:
        tell(interruption, sys.stderr)
        return INTERRUPTED
    except (FolderError, ResumptionError, EngineError) as error:
        tell(error, sys.stderr)
        return FAILED
    except MemoryError:
        tell(OUT_OF_MEMORY, sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        tell("interrupted before the run began", sys.stderr)
        return INTERRUPTED
    with contextlib.suppress(KeyboardInterrupt):  # all is done
        tell(summary)
    return DONE


def run_case(
    options: argparse.Namespace,
    console: Console,
    launched: LaunchedRanks | None,
    heed: Callable[[], None],
) -> str:
    """Run a case in its folder and return a report of it.

    Raises
    ------
    CaseError
        If the case is invalid.
    FolderError
        If the folder cannot be written, or holds a run.
    ResumptionError
        If the run of the folder cannot be gone on with.
    EngineError, InterruptedRunError
        If LAMMPS fails, or the user stops it.
    """
    if launched and options.ranks > 1:
        raise FolderError("--ranks starts ranks of its own: it does not go with mpiexec")
    case = load_case(options.case)
    folder = run_folder(options, case)
    goes_on = options.resume and bool(files_of_a_run(folder))
    if folder.resolve() in input_folders(case) and not goes_on:
        raise FolderError(f"{folder} holds an input of the case: give another folder (--output)")
    check_engine()
    particles = None if goes_on else _packed(case, folder)
    with folder_lock(folder):
        if particles is None:
            run = _resumed(case, options.case, folder, console)
        else:
            if options.resume:
                _say(console, f"{folder} holds no run yet: it begins")
            _prepare_afresh(case, particles, folder, options.force, console)
            run = Resumption(case)
        threading.Thread(target=_import_ahead, args=(not options.no_figures,), daemon=True).start()
        if not run.is_finished:
            _warn_of_many_ranks(options.ranks)
            steps, length = run.case.timesteps, run.case.timestep
            deck = DeckRun(folder, steps, length, run.steps_done, options.ranks, launched)
            heed()
            run_deck(deck, console)
        try:
            for warning in lammps_warnings(folder):
                _say(ProgressConsole(), warning)
            heed()
            return analyze_run(folder, figures=not options.no_figures)
        except KeyboardInterrupt:
            raise InterruptedRunError(INTERRUPTED_AFTERWARDS) from None


def _warn_of_many_ranks(ranks: int) -> None:
    cores = len(os.sched_getaffinity(0))
    if ranks > cores:
        text = f"WARNING: --ranks {ranks} on {cores} cores: ranks that wait take time from others"
        _say(ProgressConsole(), f"{text}, and the run is slower than with {cores}")


def _resumed(case: Case, case_file: Path, folder: Path, console: Console) -> Resumption:
    """Get a run ready to go on, or to begin anew if it had not come to its first restart file."""
    run = resumption(case_file, folder)
    for reason in run.unusable:
        _say(ProgressConsole(), f"WARNING: {reason}")
    if run.state:
        _prepare_to_go_on(run, folder, console)
        return run
    if folder.resolve() in input_folders(case):
        raise FolderError(f"{folder} holds no restart file: run its case anew elsewhere")
    _say(console, f"{folder} holds no restart file yet: the run begins anew")
    _prepare_afresh(case, _packed(case, folder), folder, True, console)
    return replace(run, case=case)


def _packed(case: Case, folder: Path) -> Particles:
    """Pack the particles of a case for which there is memory, and room for its frames."""
    if isinstance(case.particles, PackedParticles):
        shortage = memory_shortage(case.particles.count, BYTES_TO_RUN)
        if shortage:
            raise CaseError(f"particles.count: {shortage}")
    particles = create_particles(case)
    check_near_field(case, particles)
    check_room(case, len(particles), folder, reclaimed=_size_of_a_run(folder))
    return particles


def _size_of_a_run(folder: Path) -> int:
    """Return how many bytes a run takes, which may be at work and rename its files."""
    size = 0
    for path in files_of_a_run(folder):
        with contextlib.suppress(FileNotFoundError):
            size += path.lstat().st_size
    return size


def _prepare_afresh(
    case: Case, particles: Particles, folder: Path, force: bool, console: Console
) -> None:
    """Write the case and its deck into the run folder."""
    try:
        prepare_folder(folder, force=force)
        write_resolved_case(case, folder)
        write_deck(case, particles, folder)
    except OSError as error:
        raise FolderError(f"cannot write the run folder {folder}: {error}") from error
    _say(console, f"{case.name}: {size_of(case, particles)} in {folder}")
    for remark in remarks(case, particles):
        _say(console, remark)
    for warning in case_warnings(case, particles):
        _say(ProgressConsole(), f"WARNING: {warning}")


def _prepare_to_go_on(run: Resumption, folder: Path, console: Console) -> None:
    """Get a run ready to go on."""
    assert run.state is not None
    try:
        if not run.is_finished:
            for name in _results():
                (folder / name).unlink(missing_ok=True)
        prepare_resumption(run, folder)
    except OSError as error:
        raise FolderError(f"cannot write the run folder {folder}: {error}") from error
    what = "is simulated already" if run.is_finished else f"goes on at {run.state.time:g} s"
    _say(console, f"{run.case.name}: {what}, in {folder}")


def _say(console: Console, text: str) -> None:
    """Print as it is what may quote the name of a file."""
    console.print(shown_text(text, console.encoding), highlight=False, markup=False)


def _import_ahead(figures: bool) -> None:
    """Import what is wanted after LAMMPS while it runs: that takes a second or more."""
    with contextlib.suppress(ImportError):  # it comes again, where it can be told
        import lammps_blast.analyze

        if figures:
            import lammps_blast.figures  # noqa: F401


def run_folder(options: argparse.Namespace, case: Case) -> Path:
    """Return the folder that a command line names for the run of a case, or the usual one."""
    return options.output or Path("runs") / case.name


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
    in_the_way = files_of_a_run(folder)
    if in_the_way and not force:
        names = ", ".join(path.name for path in in_the_way[:3])
        raise FolderError(f"{folder} holds a run already ({names}): give --force to replace it")
    folder.mkdir(parents=True, exist_ok=True)
    for path in in_the_way:
        path.unlink()


def files_of_a_run(folder: Path) -> list[Path]:
    """Return what a run has left in a folder, links that lead nowhere among it."""
    return [folder / name for name in _products() if os.path.lexists(folder / name)]


def _products() -> Iterator[str]:
    """Yield the names of all files that a run may leave in its folder."""
    yield from (CASE, DECK, PARTICLE_DATA, PARTICLE_TABLE, ENERGY_TABLE, LOG)
    yield from (CONTACT_TABLE, STEP_TABLE)
    yield from (*TRAJECTORIES.values(), BINARY_CONSTANTS, KEPT_TRAJECTORY)
    yield from (*RESTARTS, *UNFINISHED)
    yield from _results()


def _results() -> Iterator[str]:
    """Yield the names of those that the analysis leaves."""
    from lammps_blast.analyze import (
        CLUMP_TABLE,
        ENVELOPE_TABLE,
        FIGURE_FOLDER,
        FIGURES,
        SPEED_TABLE,
        SUMMARY,
    )

    yield from (SUMMARY, ENVELOPE_TABLE, SPEED_TABLE, CLUMP_TABLE)
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
