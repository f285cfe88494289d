"""Shows on a terminal, or in a log, how far a run is."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TextIO

from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn

from lammps_blast.command_line import send_to_nobody

_POLL_SECONDS = 0.05
_PLAIN_LINES = 10


class _Unheeded:
    """A stream whose writer goes on where it is closed, full or not read."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError:
            send_to_nobody(self._stream)
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError:
            send_to_nobody(self._stream)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


class ProgressConsole(Console):
    """Standard error output, for as long as it can be written: what is at work goes on."""

    def __init__(self, *, quiet: bool = False) -> None:
        stream = _Unheeded(sys.stderr) if sys.stderr else None
        super().__init__(file=stream, stderr=True, quiet=quiet)


@dataclass(frozen=True)
class Watched:
    """A run to be watched.

    Attributes
    ----------
    ended
        Set when it is over.
    steps_done
        Tells how many steps of LAMMPS are over.
    first_step, last_step, timestep
        Steps that it begins and ends at, and their length (s).
    """

    ended: threading.Event
    steps_done: Callable[[], int]
    first_step: int
    last_step: int
    timestep: float


def watch(run: Watched, console: Console | None) -> None:
    """Wait for the end of a run, and show how far it is, if there is a console."""
    if console is None:
        run.ended.wait()
    elif console.is_terminal:
        _watch_with_bar(run, console)
    else:
        _watch_with_lines(run, console)


def _watch_with_bar(run: Watched, console: Console) -> None:
    columns = (BarColumn(), TaskProgressColumn(), TextColumn("{task.fields[report]}"))
    meter = _Meter(run)
    with Progress(*columns, console=console, transient=True) as progress:
        task = progress.add_task("run", total=run.last_step, report="")
        while not run.ended.wait(_POLL_SECONDS):
            done = _steps_behind(run)
            progress.update(task, completed=done, report=meter.report(done))


def _watch_with_lines(run: Watched, console: Console) -> None:
    meter = _Meter(run)
    part = run.last_step / _PLAIN_LINES
    next_line = part * (1 + run.first_step // part)
    while not run.ended.wait(_POLL_SECONDS):
        done = _steps_behind(run)
        if next_line <= done < run.last_step:
            console.print(meter.report(done), highlight=False)
            next_line += part * (1 + (done - next_line) // part)


def _steps_behind(run: Watched) -> int:
    """Steps that are over, while LAMMPS is in the next."""
    return max(0, run.steps_done() - 1)


class _Meter:
    """Simulated time, speed and time left, from the number of steps done."""

    def __init__(self, run: Watched) -> None:
        self._run = run
        self._started = time.perf_counter()

    def report(self, done: int) -> str:
        run = self._run
        speed = (done - run.first_step) / (time.perf_counter() - self._started)
        left = f"{(run.last_step - done) / speed:.0f} s left" if speed > 0.0 else "starting"
        simulated = f"{done * run.timestep:.4g} of {run.last_step * run.timestep:.4g} s"
        return f"{simulated}, {max(speed, 0.0):,.0f} steps of LAMMPS/s, {left}"
