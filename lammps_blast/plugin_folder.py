"""Where the compiled LAMMPS plugin lies."""

from importlib import metadata

PLUGIN_FILE = "lammps_blast_plugin.so"


def plugin_folder() -> str:
    """Return the folder of the compiled plugin, as LAMMPS's entry point `lammps.plugins` wants it.

    The installed distribution is asked, not this module's own place: in a checkout, Python may
    have imported the source folder, where nothing is compiled.

    Raises
    ------
    FileNotFoundError
        If the package was not installed, or without its plugin.
    """
    try:
        files = metadata.files("lammps-blast") or []
    except metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.name == PLUGIN_FILE and (path := file.locate()).exists():
            return str(path.parent)
    raise FileNotFoundError(
        f"{PLUGIN_FILE} is not installed: run `pip install .` in the lammps-blast folder"
    )
