"""Several MPI ranks of LAMMPS, started from here, or by an `mpiexec` around all of Python.

In the second case the first rank does what a single process does. The others only lend LAMMPS
their hands: they follow the deck, which LAMMPS reads on the first rank and hands on line by line.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import re
import signal
import subprocess
import sys
import tempfile
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

from lammps_blast.command_line import FAILED, leave_at_once, tell
from lammps_blast.lammps_program import find_lmp, find_mpiexec, program_environment

# What asks a run to end: the keyboard, a batch system at its time or ahead of it, a terminal that
# is closed.
ASKING = (signal.SIGINT, signal.SIGTERM, signal.SIGUSR1, signal.SIGHUP)

_KEPT_LINES = 200
# What MPICH, Open MPI and their kin tell the processes that they start: number, and number of all.
_LAUNCHERS = (
    ("PMI_RANK", "PMI_SIZE"),
    ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"),
    ("MV2_COMM_WORLD_RANK", "MV2_COMM_WORLD_SIZE"),
)
_SET_DEATH_SIGNAL = 1  # of prctl(2)


class RankError(Exception):
    """Ranks ended before their time; `str()` says how, `lammps_error` what LAMMPS said, if so."""

    def __init__(self, text: str, lammps_error: str | None = None) -> None:
        super().__init__(text)
        self.lammps_error = lammps_error


@dataclass
class LaunchedRanks:
    """Ranks that something else has started, this process among them.

    Attributes
    ----------
    number, count
        Which of them this process is, from zero, and how many there are.
    are_at_work
        Whether all of them are in one LAMMPS, or have been.
    are_broken
        Whether some of them wait for one that an error has taken out.
    """

    number: int
    count: int
    are_at_work: bool = False
    are_broken: bool = False

    @classmethod
    def around_this_process(cls) -> LaunchedRanks | None:
        """Return the ranks that this process belongs to; None if it was started by itself."""
        for number, count in _LAUNCHERS:
            with contextlib.suppress(KeyError, ValueError):
                ranks = cls(int(os.environ[number]), int(os.environ[count]))
                if ranks.count > 1:
                    return ranks
        return None

    def end(self, status: int) -> None:
        """End the others, with or without having been at work; may end this process."""
        if self.are_broken:
            self._leave(status)
        if not self.are_at_work:
            # They cannot be let go by half.
            for asking in ASKING:
                signal.signal(asking, signal.SIG_IGN)
            self.run_together()

    def tell(self, lammps: Any, variables: Mapping[str, str]) -> None:
        """Set variables of LAMMPS that only this rank, the first, knows, in all of them."""
        with tempfile.NamedTemporaryFile("w", suffix=".in") as file:
            file.writelines(f"variable {name} index {value}\n" for name, value in variables.items())
            file.flush()
            lammps.file(file.name)

    @contextlib.contextmanager
    def broken_by(self, kind: type[Exception]) -> Iterator[None]:
        """Know that others wait for this rank, once an exception has taken it out."""
        try:
            yield
        except kind:
            self.are_broken = True
            raise

    def _leave(self, status: int, reason: Exception | None = None) -> NoReturn:
        """End this process alone: the others end when their launcher sees it fail."""
        if reason:
            tell(reason, sys.stderr)
        leave_at_once(status)

    def run_together(self, folder: Path | None = None) -> None:
        """Run what the first rank reads: there variables and a deck, or as little as here.

        Parameters
        ----------
        folder
            The run folder; None where there is none.
        """
        from lammps_blast.engine import EngineError, start_lammps

        self.are_at_work = True
        try:
            lammps = start_lammps(log="none")  # which waits for the first rank
        except EngineError as error:
            self._leave(FAILED, error if self.number > 0 else None)  # the first has told it
        if folder and folder.is_dir():
            os.chdir(folder)
        try:
            for _part in ("variables", "deck"):
                lammps.file(os.devnull)
        except Exception as error:
            if is_of_one_rank(error):
                self._leave(1, error)
        lammps.finalize()


def is_of_one_rank(error: Exception) -> bool:
    """Tell whether an error of LAMMPS came to one rank alone, and left the others waiting."""
    return type(error).__name__ == "MPIAbortException"


class RankedLammps:
    """LAMMPS in several ranks on this machine, in the present folder.

    Parameters
    ----------
    ranks
        How many.
    arguments
        LAMMPS's command line.

    Raises
    ------
    FileNotFoundError
        If there is no `mpiexec` or `lmp`.
    OSError
        If they cannot be started.
    """

    def __init__(self, ranks: int, arguments: list[str]) -> None:
        mpiexec, lmp = find_mpiexec(), find_lmp()
        for name, program in (("mpiexec", mpiexec), ("lmp", lmp)):
            if program is None:
                raise FileNotFoundError(f"there is no {name} in this environment or on the PATH")
        command = [str(mpiexec), "-n", str(ranks), str(lmp), *arguments, "-log", "none", "-nocite"]
        # In a session of its own, so that Ctrl-C comes to this process alone, and stops once.
        self._process = subprocess.Popen(
            command,
            env=program_environment(),
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="replace",
            start_new_session=True,
            preexec_fn=_ending_with_parent(),
        )

    def stop(self) -> None:
        """Ask all ranks to write a restart file after the present step, and to end."""
        with contextlib.suppress(ProcessLookupError):
            self._process.send_signal(signal.SIGTERM)

    def wait(self) -> str:
        """Wait until all ranks have ended; return the last of what they said.

        Raises
        ------
        RankError
            If they did not end well.
        """
        assert self._process.stdout is not None
        said = deque(self._process.stdout, maxlen=_KEPT_LINES)
        status, text = self._process.wait(), "".join(said)
        if status == 0:
            return text
        raise RankError(_how_they_ended(text, status), _error_of_lammps(text))


def _ending_with_parent() -> Callable[[], object]:
    """Return what has the system ask a process to stop when the one that started it dies.

    All that it needs is at hand before the new process comes to be: other threads may be in the
    midst of loading libraries then.
    """
    prctl = ctypes.CDLL(None).prctl
    return lambda: prctl(_SET_DEATH_SIGNAL, signal.SIGTERM)


def _error_of_lammps(output: str) -> str | None:
    """Return LAMMPS's error in the output of its ranks, with the command that it stopped at."""
    end = r"(?=^(?:application called|=====|Abort)|\Z)"
    found = re.search(rf"^ERROR(?: on proc \d+)?:.*?{end}", output, re.M | re.S)
    return found[0].strip() if found else None


def _how_they_ended(output: str, status: int) -> str:
    found = re.search(r"\(signal (\d+)\)", output)
    if found:
        with contextlib.suppress(ValueError):
            return f"a rank of LAMMPS died, of signal {signal.Signals(int(found[1])).name}"
    return f"a rank of LAMMPS ended with status {status}"
