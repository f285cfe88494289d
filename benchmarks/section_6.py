"""The numbers of section 6 of Zohdi (2016), which every benchmark runs."""

from __future__ import annotations

from pathlib import Path

from lammps_blast.case import load_case
from lammps_blast.particles import Particles, create_particles

REPOSITORY = Path(__file__).resolve().parents[1]
CASE_FILE = REPOSITORY / "lammps_inputs" / "magnetic_blast" / "case.yaml"

PULSE_ENERGY = 1.0e4  # J
MAGNETIC = (10.0, 0.0, 0.0)  # T
MEDIUM_DENSITY = 1.225  # kg/m3
VISCOSITY = 1.8e-5  # Pa s
STEP = 1.0e-4  # s


def cloud() -> Particles:
    """Return the 2,000 particles before the blast."""
    return create_particles(load_case(CASE_FILE))
