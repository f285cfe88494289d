"""Commands in processes of their own, side by side and for a limited time, whatever they do."""

from __future__ import annotations

import contextlib
import os
import re
import signal
import subprocess
import tempfile
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Outcome:
    """How a process ended: what it wrote to its two outputs, and what went wrong, if anything."""

    output: str = ""
    errors: str = ""
    failure: str = ""

    @property
    def reason(self) -> str:
        """The failure with the line that says most of it: the last that names an error, or last."""
        lines = [line.strip() for line in self.errors.splitlines() if re.search(r"\w", line)]
        said = [line for line in lines if "error" in line.lower()] or lines
        return f"{self.failure}: {said[-1]}" if said else self.failure


class Examination:
    """A command that runs in a process of its own, for a limited time, and its children with it."""

    def __init__(self, command: Sequence[str], folder: Path) -> None:
        # Files rather than pipes: a grandchild that survives must not keep the doctor waiting.
        self._output = tempfile.TemporaryFile()  # noqa: SIM115
        self._errors = tempfile.TemporaryFile()  # noqa: SIM115
        self._process = subprocess.Popen(
            command,
            cwd=folder,
            # Other numbers of threads are the patient's choice, and may be too many.
            env={**os.environ, "OMP_NUM_THREADS": "1"},
            stdin=subprocess.DEVNULL,
            stdout=self._output,
            stderr=self._errors,
            start_new_session=True,
        )
        self._stopped = False

    def outcome(self, deadline: float, limit: float) -> Outcome:
        """Wait for the end or until `deadline` on the monotonic clock, and return what came."""
        failure = ""
        try:
            status = self._process.wait(max(0.0, deadline - time.monotonic()))
        except subprocess.TimeoutExpired:
            more = f"on a busy machine, give more: --time-limit {4 * limit:g}"
            failure = f"no answer within {limit:g} s ({more})"
        else:
            if status < 0:
                failure = f"crashed ({_signal_name(-status)})"
            elif status > 0:
                failure = f"failed with exit status {status}"
        self.stop()
        return Outcome(self._text(self._output), self._text(self._errors), failure)

    def stop(self) -> None:
        """End what is left of the process and its children."""
        if self._stopped:
            return
        self._stopped = True
        self._signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        self._signal(signal.SIGKILL)
        self._process.wait()

    def _signal(self, number: int) -> None:
        with contextlib.suppress(OSError):
            os.killpg(self._process.pid, number)

    @staticmethod
    def _text(file: Any) -> str:
        file.seek(0)
        return file.read().decode(errors="replace")


def _signal_name(number: int) -> str:
    try:
        return signal.Signals(number).name
    except ValueError:
        return f"signal {number}"


def run_side_by_side(
    commands: Mapping[str, Sequence[str] | None], files: Mapping[str, str], time_limit: float
) -> dict[str, Outcome]:
    """Run commands in one folder that is made for them; return their outcomes by name.

    Parameters
    ----------
    commands
        By name; None stands for one that cannot be run.
    files
        Texts of the files of the folder, by their names.
    time_limit
        s; what takes longer is ended.
    """
    outcomes = {name: Outcome(failure="not run") for name in commands}
    running: dict[str, Examination] = {}
    try:
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place)
            for name, text in files.items():
                (folder / name).write_text(text)
            deadline = time.monotonic() + time_limit
            try:
                for name, command in commands.items():
                    if command:
                        running[name] = Examination(command, folder)
                for name, examination in running.items():
                    outcomes[name] = examination.outcome(deadline, time_limit)
            finally:
                for examination in running.values():
                    examination.stop()
    except OSError as error:
        failed = Outcome(failure=f"cannot be run: {error}")
        return {name: failed if o.failure == "not run" else o for name, o in outcomes.items()}
    return outcomes
