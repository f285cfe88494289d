"""Locks that keep two runs out of one folder, and end with the processes that hold them."""

from __future__ import annotations

import contextlib
import fcntl
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from lammps_blast.input_files import regular_files_only

FOLDER_LOCK = ".lock"
# That of LAMMPS itself.
RUN_LOCK = "restart/lock"


class FolderError(RuntimeError):
    """A run folder cannot be used; `str()` says why and what to do."""


@contextlib.contextmanager
def folder_lock(folder: Path) -> Iterator[None]:
    """Keep other runs out of a folder, which is made if there is none.

    Raises
    ------
    FolderError
        If another run is at work in it, by this package or by LAMMPS alone, or the folder cannot be
        written.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        file = (folder / FOLDER_LOCK).open("a+")
    except OSError as error:
        raise FolderError(f"cannot write the run folder {folder}: {error}") from error
    with file:
        _take(file, folder)
        require_idle(folder)
        yield


def require_idle(folder: Path) -> None:
    """Make sure that no LAMMPS is at work in a folder.

    Raises
    ------
    FolderError
        If there is one.
    """
    try:
        with open(folder / RUN_LOCK, "r+", opener=regular_files_only) as file:
            _take(file, folder)
    except FileNotFoundError:
        pass
    except OSError as error:
        raise FolderError(f"cannot tell whether a run is at work in {folder}: {error}") from error


def is_at_work(folder: Path) -> bool:
    """Tell whether LAMMPS is at work in a folder, which may be somebody else's."""
    try:
        with open(folder / RUN_LOCK, opener=regular_files_only) as file:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        pass  # no lock, or nothing that can be told about it
    return False


def _take(file: IO[str], folder: Path) -> None:
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise FolderError(f"another run is at work in {folder}: wait for its end") from None
    except OSError:
        pass  # a file system without locks
