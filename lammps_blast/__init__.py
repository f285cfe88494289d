"""Exploding clouds of charged particles in electromagnetic fields, simulated with LAMMPS.

The stages of a run, each a module with one product that can be opened and read:

``case`` (case.yaml) -> ``particles`` -> ``deck`` (in.blast, particles.data) -> ``engine`` (LAMMPS
with the plugin) -> ``trajectory`` -> ``analysis`` -> ``figures``.

``run`` goes through all of them; ``theory`` holds the closed forms that runs are checked against.
"""

from importlib import metadata

try:
    __version__ = metadata.version("lammps-blast")
except metadata.PackageNotFoundError:
    __version__ = "not installed"
