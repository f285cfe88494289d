"""Files that a user names or a run left: opened only where reading them comes to an end."""

from __future__ import annotations

import errno
import mmap
import os
import stat
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TextIO

# Characters of a line of numbers, whatever a damaged file says.
LONGEST_LINE = 2**16
# A number as C++ writes it, in the bytes of a log.
NUMBER = rb"([-+]?\d+\.?\d*(?:e[-+]?\d+)?)"


def regular_files_only(path: str, flags: int) -> int:
    """Open a regular file and return its descriptor: an opener for the built-in `open`.

    A pipe nobody writes to would be waited for, and some devices never end.

    Raises
    ------
    OSError
        If there is no such file, or it is of another kind.
    """
    descriptor = os.open(path, flags | os.O_NONBLOCK)
    kind = os.fstat(descriptor).st_mode
    if stat.S_ISREG(kind):
        return descriptor
    os.close(descriptor)
    if stat.S_ISDIR(kind):
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), path)
    raise OSError(errno.EINVAL, "not a regular file", path)


def lines_of_numbers(stream: TextIO) -> Iterator[str]:
    """Yield the lines of a text file, none longer than :data:`LONGEST_LINE`.

    Raises
    ------
    ValueError
        If one is longer; it names its number.
    """
    number = 0
    while line := stream.readline(LONGEST_LINE + 1):
        number += 1
        if len(line) > LONGEST_LINE:
            raise ValueError(f"line {number} is longer than {LONGEST_LINE} characters")
        yield line


@contextmanager
def mapped(path: Path) -> Iterator[mmap.mmap | bytes]:
    """Map a file into memory for the time of a search, whatever its size.

    Raises
    ------
    OSError
        If it cannot be read.
    """
    with open(path, "rb", opener=regular_files_only) as file:
        if os.fstat(file.fileno()).st_size == 0:
            yield b""
            return
        with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
            yield content
