"""Small simulations with exact answers, and what the process that runs them can tell of LAMMPS.

`lammps-blast doctor` runs this module in a process of its own: whatever is broken may take it down.
Each stage says that it begins and what came out, a line of JSON each, so that the last line tells
where it died.
"""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from lammps_blast import theory
from lammps_blast.engine import close_lammps, start_lammps
from lammps_blast.plugin_folder import PLUGIN_FILE, plugin_folder
from lammps_blast.text_columns import LIBRARY_FILE, read_text_columns

STYLES = {
    "command": (
        "blast_pulse",
        "blast_new_run",
        "blast_write_restart",
        "blast_read_restart",
    ),
    "pair": ("blast/contact", "blast/nearfield"),
    "fix": (
        "lorentz/drag",
        "nve/sphere/lorentz",
        "nve/implicit",
        "BLAST/BONDS",
        "blast/losses",
        "blast/watch",
        "blast/restart",
        "blast/table",
    ),
    "compute": ("lorentz/drag/atom", "blast/contact/local"),
}

RADIUS, DENSITY, CHARGE_PER_MASS = 0.05, 7000.0, 10.0
MASS = theory.sphere_mass(RADIUS, DENSITY)
ENERGY = 100.0
CLOUD = np.array(
    [[0.3, 0.1, -0.2], [-0.4, 0.2, 0.1], [0.1, -0.5, 0.3], [0.2, 0.4, 0.5], [-0.1, -0.2, -0.6]]
)
MAGNETIC = np.array([3.0, -6.0, 7.0])
VISCOSITY = 30.0
STEP, STEPS = 0.1, 10
ROUNDING = 1e-12

COLLISION_STEP = 1e-6
COLLISION_SPEED = 1.0
COLLISION_LIMIT = 1e-6


def main() -> None:
    """Go through all stages; each prints that it begins, then its result or its error."""
    for stage, examine in STAGES.items():
        _print_line(stage=stage)
        try:
            _print_line(stage=stage, result=examine())
        except Exception as error:
            _print_line(stage=stage, error=" ".join(str(error).split()) or type(error).__name__)


def _print_line(**content: Any) -> None:
    print(json.dumps(content), flush=True)


def read_numbers() -> dict[str, Any]:
    """Read two lines of numbers with the compiled text reader."""
    numbers = read_text_columns(b"1 2.5\n-3e-7 4\n", 0, (2, 2))
    if numbers is None:
        there = Path(plugin_folder(), LIBRARY_FILE).is_file()
        raise RuntimeError(f"{LIBRARY_FILE} {'cannot be used' if there else 'is not installed'}")
    if numbers.tolist() != [[1.0, 2.5], [-3e-7, 4.0]]:
        raise RuntimeError(f"{LIBRARY_FILE} misreads numbers: {numbers.tolist()}")
    return {}


def load_plugin() -> dict[str, Any]:
    """Start LAMMPS with the plugin; return what the process then has loaded.

    Returns
    -------
    dict
        `version` of LAMMPS, `mpi` library file (None where it cannot be told), `missing` styles,
        `vectors` that the plugin's loops use, or `load_error` of the plugin's file.
    """
    with _lammps() as lammps:
        missing = [
            f"{category} {name}"
            for category, names in STYLES.items()
            for name in names
            if not lammps.has_style(category, name)
        ]
        found = {
            "version": lammps.version(),
            "mpi": _loaded_mpi(),
            "missing": missing,
        }
        try:
            level = ctypes.CDLL(str(Path(plugin_folder(), PLUGIN_FILE))).lammps_blast_vector_level
        except (OSError, AttributeError) as error:
            return {**found, "load_error": str(error)}
        level.restype = ctypes.c_char_p
        return {**found, "vectors": level().decode()}


def _loaded_mpi() -> str | None:
    """Return the file of the MPI library that this process has loaded."""
    with contextlib.suppress(OSError):
        files = re.findall(r"\S*/libmpi(?:ch)?\.so\S*", Path("/proc/self/maps").read_text())
        if files:
            return os.path.realpath(files[0])
    return None


def fly() -> dict[str, Any]:
    """Blast a cloud without any field: particles fly straight, with the speed of eq. 3.4."""
    position, _ = _launch("")
    speed, direction = _pulse()
    distance = speed * STEPS * STEP
    error = np.linalg.norm(position - CLOUD - distance * direction, axis=1).max() / distance
    return _result(error, ROUNDING, "of the distance flown")


def gyrate() -> dict[str, Any]:
    """Blast a cloud in a uniform magnetic field: particles gyrate, more than a turn a step."""
    position, _ = _launch("magnetic {} {} {}".format(*MAGNETIC))
    speed, direction = _pulse()
    exact, _ = theory.lorentz_orbit(
        STEPS * STEP, CLOUD, speed * direction, CHARGE_PER_MASS, np.zeros(3), MAGNETIC
    )
    frequency = theory.cyclotron_frequency(CHARGE_PER_MASS, MAGNETIC)
    error = np.linalg.norm(position - exact, axis=1).max()
    return _result(
        error / theory.cyclotron_radius(speed, frequency), ROUNDING, "of the cyclotron radius"
    )


def slow_down() -> dict[str, Any]:
    """Blast a cloud into a viscous medium: speeds decay exponentially."""
    _, velocity = _launch(f"drag stokes viscosity {VISCOSITY}")
    decay = theory.stokes_time(RADIUS, DENSITY, VISCOSITY)
    exact = theory.stokes_speed(STEPS * STEP, _pulse()[0], decay)
    error = np.abs(np.linalg.norm(velocity, axis=1) / exact - 1.0).max()
    return _result(error, ROUNDING, "of the speed")


def collide() -> dict[str, Any]:
    """Let two spheres meet head-on: what they lose is what the ledger says is lost."""
    with _lammps() as lammps:
        _create(lammps, np.array([[-0.0505, 0.0, 0.0], [0.0505, 0.0, 0.0]]))
        lammps.commands_string(f"""
            velocity all set {COLLISION_SPEED} 0 0
            group right id 2
            velocity right set {-COLLISION_SPEED} 0 0
            pair_style blast/contact
            pair_coeff * * stiffness 1.0e7 exponent 2 damping 1.0e5
            fix losses all blast/losses
            fix integrate all nve/sphere/lorentz
            timestep {COLLISION_STEP}
            run 30000
        """)
        kinetic, potential = lammps.get_thermo("ke"), lammps.get_thermo("pe")
        lost = lammps.extract_fix("losses", 0, 1, 0)
        velocity = _per_particle(lammps, "v")
    if not velocity[1, 0] > 0.0 > velocity[0, 0]:
        raise RuntimeError("the spheres did not rebound")
    before = MASS * COLLISION_SPEED**2
    error = abs(kinetic + potential + lost - before) / before
    return _result(error, COLLISION_LIMIT, "of the energy")


def _launch(fields: str) -> tuple[np.ndarray, np.ndarray]:
    """Return positions and velocities, (N, 3), some time after a blast, without contacts."""
    with _lammps() as lammps:
        _create(lammps, CLOUD)
        lammps.commands_string(f"""
            fix integrate all nve/sphere/lorentz {fields}
            blast_pulse all {ENERGY}
            timestep {STEP}
            run {STEPS}
        """)
        return _per_particle(lammps, "x"), _per_particle(lammps, "v")


def _pulse() -> tuple[float, np.ndarray]:
    """Return the exact speed and directions, (N, 3), of a launch."""
    masses = np.full(len(CLOUD), MASS)
    return theory.pulse_speed(ENERGY, masses.sum()), theory.launch_directions(CLOUD, masses)


@contextlib.contextmanager
def _lammps() -> Iterator[Any]:
    lammps = start_lammps(log="none")
    try:
        yield lammps
    finally:
        close_lammps(lammps)


def _create(lammps: Any, positions: np.ndarray) -> None:
    """Put equal charged spheres at rest into a new system."""
    lammps.commands_string("""
        units si
        atom_style hybrid sphere charge
        atom_modify map array sort 0 0.0
        boundary s s s
        neighbor 0.01 nsq
        comm_modify cutoff 1.0e-9 vel yes
        neigh_modify every 1 delay 0 check yes
        region world block -1 1 -1 1 -1 1
        create_box 1 world
    """)
    for position in positions:
        lammps.command("create_atoms 1 single {} {} {} units box".format(*position))
    charge = CHARGE_PER_MASS * MASS
    lammps.command(f"set group all diameter {2 * RADIUS} density {DENSITY} charge {charge:.17g}")


def _per_particle(lammps: Any, name: str) -> np.ndarray:
    """Return a vector of every particle, (N, 3), in the order of creation."""
    return np.array(lammps.gather_atoms(name, 1, 3)).reshape(-1, 3)


def _result(error: float, limit: float, measure: str) -> dict[str, Any]:
    return {"error": float(error), "limit": limit, "measure": measure}


STAGES: dict[str, Callable[[], dict[str, Any]]] = {
    "text reader": read_numbers,
    "plugin": load_plugin,
    "flight": fly,
    "gyration": gyrate,
    "drag": slow_down,
    "collision": collide,
}


if __name__ == "__main__":
    main()
