"""A program that has run to its end in a folder, and the memory that it took."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

BYTES_OF_UNIT = 1024  # of ru_maxrss, on Linux
# A process counts as its own what the one that started it held: so a small one starts the program.
LAUNCHER = """\
import resource, subprocess, sys
status = subprocess.call(sys.argv[2:], stdin=subprocess.DEVNULL)
with open(sys.argv[1], "w") as file:
    file.write(str(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss))
sys.exit(status)
"""


@dataclass(frozen=True)
class FinishedProcess:
    """What a program printed, and its largest resident set in bytes.

    Of a program that starts others, it is that of the largest one.
    """

    output: str
    resident: int


def finished_process(
    command: Sequence[str], folder: Path, environment: Mapping[str, str] | None = None
) -> FinishedProcess:
    """Run a command in a folder.

    Raises
    ------
    RuntimeError
        If it fails; the message ends with what it printed last.
    """
    resident = folder / "resident.txt"
    done = subprocess.run(
        [sys.executable, "-c", LAUNCHER, str(resident), *command],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        env={**os.environ, **(environment or {})},
    )
    if done.returncode != 0:
        raise RuntimeError(f"{command[0]} ended with {done.returncode}: {done.stdout[-2000:]}")
    return FinishedProcess(done.stdout, BYTES_OF_UNIT * int(resident.read_text()))
