"""How fast lammps-blast is, against its own targets and against peers: `python -m benchmarks`."""
