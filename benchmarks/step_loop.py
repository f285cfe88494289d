"""The step loop of section 6: particles that do not interact, in B and air, without output.

LAMMPS's own loop time counts; packing, start-up and reading the data do not.
"""

from __future__ import annotations

import re
import tempfile
from dataclasses import dataclass
from pathlib import Path

from benchmarks.section_6 import MAGNETIC, MEDIUM_DENSITY, PULSE_ENERGY, STEP, VISCOSITY
from lammps_blast.deck import system_commands, write_particle_data
from lammps_blast.engine import start_lammps
from lammps_blast.particles import Particles

STEPS = 10_000
WARM_UP_STEPS = 200

FIELD = "magnetic {} {} {}".format(*MAGNETIC)
AIR = f"density {MEDIUM_DENSITY} viscosity {VISCOSITY}"
LORENTZ = f"fix integrate all nve/sphere/lorentz {FIELD} drag"
INTEGRATORS = {
    "chow": f"{LORENTZ} chow {AIR}",
    "none": f"{LORENTZ} none",
    "constant": f"{LORENTZ} constant 0.5 {AIR}",
    "stokes": f"{LORENTZ} stokes {AIR}",
    "verlet": f"fix external all lorentz/drag {FIELD} drag chow {AIR}\n"
    "fix integrate all nve/sphere",
}


@dataclass(frozen=True)
class StepLoop:
    """Runs the loop with one of INTEGRATORS, each time from the start of the blast."""

    particles: Particles
    integrator: str
    steps: int = STEPS

    def __call__(self) -> float:
        """Return ns per particle-step."""
        with tempfile.TemporaryDirectory() as folder:
            data, log = Path(folder, "particles.data"), Path(folder, "log.lammps")
            write_particle_data(self.particles, data)
            lammps = start_lammps(log="none")
            try:
                lammps.commands_string(self._deck(data, log))
            finally:
                lammps.close()
            return 1e9 * _loop_seconds(log) / (len(self.particles) * self.steps)

    def _deck(self, data: Path, log: Path) -> str:
        system = system_commands(self.particles, str(data)).replace("${step}", f"{STEP}")
        return f"""{system}
{INTEGRATORS[self.integrator]}
blast_pulse all {PULSE_ENERGY} seed 1
thermo 0
run {WARM_UP_STEPS} post no
log {log}
run {self.steps}
log none
"""


def _loop_seconds(log: Path) -> float:
    loop = re.search(r"Loop time of (\S+) on 1 procs", log.read_text())
    if loop is None:
        raise RuntimeError(f"LAMMPS did not say how long its loop took: {log.read_text()}")
    return float(loop.group(1))
