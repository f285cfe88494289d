"""Run a case from beginning to end: `python -m lammps_blast.run case.yaml`.

Exit status: 0 done; 2 the case is invalid, nothing was written; 3 the run failed; 130 interrupted.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any

from lammps_blast.command_line import INTERRUPTED, tell
from lammps_blast.ranks import ASKING, LaunchedRanks

# Launchers and batch systems tell all processes, and these each other: the same wish, told again.
# Who presses Ctrl-C again means it.
SECONDS_OF_ONE_WISH, SECONDS_OF_ONE_KEY = 10.0, 0.3
# Of the cores, how many ranks or threads may be asked for: more are a slip of the finger.
MOST_A_CORE = 16


def main(argv: list[str] | None = None) -> int:
    """Run a case: pack, launch, simulate, analyse, draw."""
    options = _options(argv)
    launched = LaunchedRanks.around_this_process()
    follows = launched is not None and launched.number > 0
    interruption = _Interruption()
    # Signals that ask for an end are the first rank's business.
    before = _handle_asking(signal.SIG_IGN if follows else interruption)
    try:
        # Here, where an interruption of the second that it takes has an answer.
        with interruption.held_back():
            from lammps_blast.case_run import follow, lead
        if follows:
            status = follow(options, launched)
        else:
            status = lead(options, launched, interruption.heed)
    except KeyboardInterrupt:
        tell("interrupted before the run began", sys.stderr)
        status = INTERRUPTED
        if launched:
            launched.end(status)
    for number, handler in before.items():
        # What has been heeded, and is told again, must not kill the process on its last steps.
        signal.signal(number, signal.SIG_IGN if follows or status == INTERRUPTED else handler)
    return status


def _handle_asking(handler: Callable[[int, FrameType | None], None] | int) -> dict[int, Any]:
    """Handle the signals that ask for an end, but for ignored ones; return what did before."""
    before = {number: signal.getsignal(number) for number in ASKING}
    heeded = {number: old for number, old in before.items() if old != signal.SIG_IGN}
    for number in heeded:
        signal.signal(number, handler)
    return heeded


class _AskedToEnd(KeyboardInterrupt):
    """A wish that the run ends. Python does not always see that a plain Ctrl-C was handled."""


class _Interruption:
    """A handler of signals that interrupts once for each wish."""

    def __init__(self) -> None:
        self._last = -SECONDS_OF_ONE_WISH
        self._is_held_back = False
        self._was_asked = False

    def __call__(self, number: int, _frame: FrameType | None) -> None:
        of_one_wish = SECONDS_OF_ONE_KEY if number == signal.SIGINT else SECONDS_OF_ONE_WISH
        if time.monotonic() - self._last < of_one_wish:
            return
        self._last = time.monotonic()
        is_put_off = self._is_held_back and not self._was_asked
        self._was_asked = True
        if not is_put_off:
            raise _AskedToEnd

    def heed(self) -> None:
        """Interrupt for a wish that was held back, or that a library took for a failure of its."""
        if self._was_asked:
            raise _AskedToEnd

    @contextlib.contextmanager
    def held_back(self) -> Iterator[None]:
        """Interrupt not before the end of imports, which cannot be begun again, or asked twice."""
        self._is_held_back = True
        yield
        self._is_held_back = False
        self.heed()


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
        "--ranks",
        type=_at_work,
        default=1,
        metavar="N",
        help="MPI ranks on this machine, default 1",
    )
    parser.add_argument(
        "--threads",
        type=_at_work,
        metavar="N",
        help="threads of a rank, default OMP_NUM_THREADS, or 1",
    )
    parser.add_argument("--no-figures", action="store_true", help="numbers only")
    parser.add_argument("--quiet", action="store_true", help="no progress")
    options = parser.parse_args(argv)
    if options.resume and os.path.isdir(options.case):
        options.output = options.output or options.case
        options.case = options.case / "case.yaml"
    return options


def _folder(text: str) -> Path:
    if not text:
        raise argparse.ArgumentTypeError("must name a folder, got nothing")
    return Path(text)


def _at_work(text: str) -> int:
    """Read a number of ranks or threads."""
    most = MOST_A_CORE * (os.cpu_count() or 1)
    if not text.isdecimal() or not 1 <= int(text[:9]) <= most:
        raise argparse.ArgumentTypeError(f"must be 1 to {most} on this machine, got {text}")
    return int(text)


if __name__ == "__main__":
    sys.exit(main())
