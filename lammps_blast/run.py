"""Run a case from beginning to end: `python -m lammps_blast.run case.yaml`.

Exit status: 0 done; 2 the case is invalid, nothing was written; 3 the run failed; 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from types import FrameType

from rich.console import Console

from lammps_blast.case import Case, CaseError, PackedParticles, ParticlesFromFile, load_case
from lammps_blast.case_warnings import case_warnings, check_near_field, remarks
from lammps_blast.command_line import shown_text, tell
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
    DeckRun,
    EngineError,
    InterruptedRunError,
    lammps_warnings,
    run_deck,
)
from lammps_blast.folder_lock import FolderError, folder_lock
from lammps_blast.particles import Particles, create_particles
from lammps_blast.progress import ProgressConsole
from lammps_blast.ranks import LaunchedRanks
from lammps_blast.resource_limits import BYTES_TO_RUN, check_room, memory_shortage
from lammps_blast.resumption import Resumption, ResumptionError, prepare_resumption, resumption

DONE, INVALID, FAILED, INTERRUPTED = 0, 2, 3, 130
# What a batch system sends to end a run, at its time or ahead of it.
ASKING = (signal.SIGTERM, signal.SIGUSR1)
# Of the cores, how many ranks may be asked for: more are a slip of the finger.
RANKS_A_CORE = 16


def main(argv: list[str] | None = None) -> int:
    """Run a case: pack, launch, simulate, analyse, draw."""
    options = _options(argv)
    launched = LaunchedRanks.around_this_process()
    if launched and launched.number > 0:
        launched.follow(_folder_of(options))
        return DONE
    status = FAILED
    try:
        status = _lead(options, launched)
    finally:
        if launched:
            launched.end(status)
    return status


def _folder_of(options: argparse.Namespace) -> Path | None:
    """Return the run folder; None if the case is none, which the first rank tells."""
    with contextlib.suppress(CaseError):
        return options.output or Path("runs") / load_case(options.case).name
    return None


def _lead(options: argparse.Namespace, launched: LaunchedRanks | None) -> int:
    console = ProgressConsole(quiet=options.quiet)
    if options.threads:
        os.environ["OMP_NUM_THREADS"] = str(options.threads)
    before = {number: signal.signal(number, _interrupt) for number in ASKING}
    try:
        summary = run_case(options, console, launched)
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
        tell("the memory is used up: take fewer particles, or a larger machine", sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("interrupted; to go on, give --resume", file=sys.stderr)
        return INTERRUPTED
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    tell(summary)
    return DONE


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    """Take what a batch system sends for a Ctrl-C."""
    raise KeyboardInterrupt


def _options(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m lammps_blast.run", description=main.__doc__)
    parser.add_argument(
        "case", type=Path, help="case file, YAML; with --resume also the folder of a run"
    )
    parser.add_argument(
        "-o", "--output", type=_folder, metavar="DIR", help="run folder, default runs/NAME"
    )
    beginning = parser.add_mutually_exclusive_group()
    beginning.add_argument("--force", action="store_true", help="replace a run that is in the way")
    beginning.add_argument(
        "--resume",
        action="store_true",
        help="go on with a run that was interrupted, or is to be longer; begin where there is none",
    )
    parser.add_argument(
        "--ranks", type=_ranks, default=1, metavar="N", help="MPI ranks on this machine, default 1"
    )
    parser.add_argument(
        "--threads",
        type=_count,
        metavar="N",
        help="threads of a rank, default OMP_NUM_THREADS, or 1",
    )
    parser.add_argument("--no-figures", action="store_true", help="numbers only")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    options = parser.parse_args(argv)
    if options.resume and options.case.is_dir():
        options.output = options.output or options.case
        options.case = options.case / CASE
    return options


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("must name a folder, got nothing")
    return Path(text)


def _ranks(text: str) -> int:
    number, most = _count(text), RANKS_A_CORE * (os.cpu_count() or 1)
    if number > most:
        raise argparse.ArgumentTypeError(f"must be at most {most} on this machine, got {text}")
    return number


def _count(text: str) -> int:
    number = int(text)
    if number < 1:
        raise argparse.ArgumentTypeError(f"must be at least 1, got {text}")
    return number


def run_case(
    options: argparse.Namespace, console: Console, launched: LaunchedRanks | None = None
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
    folder = options.output or Path("runs") / case.name
    goes_on = options.resume and bool(files_of_a_run(folder))
    if folder.resolve() in input_folders(case) and not goes_on:
        raise FolderError(f"{folder} holds an input of the case: give another folder (--output)")
    particles = None if goes_on else _packed(case, folder)
    with folder_lock(folder):
        steps_done = 0
        if particles is None:
            case, steps_done = _resumed(case, options.case, folder, console)
        else:
            _prepare_afresh(case, particles, folder, options.force, console)
        threading.Thread(target=_import_ahead, args=(not options.no_figures,)).start()
        if steps_done < case.timesteps:
            run_deck(
                DeckRun(folder, case.timesteps, case.timestep, steps_done, options.ranks, launched),
                console,
            )
        for warning in lammps_warnings(folder):
            _say(ProgressConsole(), warning)
        return analyze_run(folder, figures=not options.no_figures)


def _resumed(case: Case, case_file: Path, folder: Path, console: Console) -> tuple[Case, int]:
    """Get a run ready to go on, or to begin anew if it had not come to its first restart file.

    Return its case, and the steps that need not be done again.
    """
    run = resumption(case_file, folder)
    for reason in run.unusable:
        _say(ProgressConsole(), f"WARNING: {reason}")
    if run.state:
        _prepare_to_go_on(run, folder, console)
        return run.case, run.steps_done
    if folder.resolve() in input_folders(case):
        raise FolderError(f"{folder} holds no restart file: run its case anew elsewhere")
    _say(console, f"{folder} holds no restart file yet: the run begins anew")
    _prepare_afresh(case, _packed(case, folder), folder, True, console)
    return case, 0


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
    yield from (*TRAJECTORIES.values(), BINARY_CONSTANTS, KEPT_TRAJECTORY)
    yield from (*RESTARTS, *UNFINISHED)
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
