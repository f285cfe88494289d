"""Lines of numbers as arrays: the compiled parser, where it is installed."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Callable
from pathlib import Path

import numpy as np

from lammps_blast.plugin_folder import plugin_folder

# LAMMPS loads whatever ends in "plugin.so" in this folder.
LIBRARY_FILE = "lammps_blast_text_columns.so"


@functools.cache
def compiled_parser() -> Callable[..., bool] | None:
    """Return the parser of `cpp_plugins/text_columns.cpp`; None where no compiler could make it."""
    try:
        library = ctypes.CDLL(str(Path(plugin_folder(), LIBRARY_FILE)))
    except OSError:
        return None
    parser = library.read_text_columns
    size = ctypes.c_size_t
    parser.argtypes = [ctypes.c_char_p, size, size, size, size, ctypes.c_void_p]
    parser.restype = ctypes.c_bool
    return parser


def read_text_columns(text: bytes, start: int, shape: tuple[int, int]) -> np.ndarray | None:
    """Read all lines from `start` on as numbers, the very doubles that float() makes of them.

    Returns
    -------
    numpy.ndarray or None
        Doubles of the shape given, a row a line. None if the text is not exactly that many lines
        of that many numbers, if one of them is too large or small for a double or unusual in its
        form, or if there is no compiled parser.

    """
    parser = compiled_parser()
    if parser is None:
        return None
    table = np.empty(shape)
    return table if parser(text, start, len(text), *shape, table.ctypes.data) else None
