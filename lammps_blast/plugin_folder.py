"""Where the compiled LAMMPS plugin lies."""

from importlib import metadata
from pathlib import Path

PLUGIN_FILE = "lammps_blast_plugin.so"


def plugin_folder() -> str:
    """Return the folder of the compiled plugin, as LAMMPS's entry point `lammps.plugins` wants it.

    The installed distribution is asked, not this module's own place: in a checkout, Python may
    have imported the source folder, where nothing is compiled. Where the plugin is missing, the
    answer is a folder without plugins: LAMMPS must start for others all the same.
    """
    try:
        files = metadata.files("lammps-blast") or []
    except metadata.PackageNotFoundError:
        files = []
    for file in files:
        if file.name == PLUGIN_FILE:
            return str(file.locate().parent)
    return str(Path(__file__).parent / "plugins")


def plugin_file() -> Path:
    """Return where the compiled plugin is, or would be."""
    return Path(plugin_folder(), PLUGIN_FILE)


def require_plugin() -> None:
    """Make sure that the plugin is there.

    Raises
    ------
    FileNotFoundError
        If the package was not installed, or without its plugin.
    """
    if not plugin_file().is_file():
        raise FileNotFoundError(
            f"{PLUGIN_FILE} is not installed: run `pip install .` in the lammps-blast folder"
        )
