"""The LAMMPS deck of a case: `in.blast` and `particles.data`, complete without Python.

Whatever a simulation needs is in these two files: `lmp -in in.blast` runs it wherever LAMMPS has
the plugin. Numbers are the only thing of a case that gets into them, besides its checked name.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

import numpy as np

from lammps_blast.case import Case, CaseError, ParticlesFromFile, dump_case, load_case
from lammps_blast.particles import Particles, create_particles

DECK = "in.blast"
PARTICLE_DATA = "particles.data"
CASE = "case.yaml"
PARTICLE_TABLE = "particles.csv"
ENERGY_TABLE = "energy.csv"
RESTART_FOLDER = "restart"
RESTARTS = tuple(f"{RESTART_FOLDER}/blast.{name}" for name in ("1", "2", "interrupted"))
TEXT_TRAJECTORY = "trajectory.lammpstrj"
BINARY_TRAJECTORY = "trajectory.lammpsbin"  # LAMMPS writes binary for .bin and .lammpsbin
TRAJECTORIES = {"text": TEXT_TRAJECTORY, "binary": BINARY_TRAJECTORY}

# Part of the cloud's first width: narrower than the share of one among dozens of ranks in a row,
# even where a magnetic field draws the cloud together to a fraction of that width.
SKIN_OF_CLOUD = 0.005

ENERGY_ACCOUNTS = (
    "kinetic",
    "rotational",
    "electric_work",
    "drag_loss",
    "magnetic_work",
)


def write_deck(case: Case, particles: Particles, folder: Path) -> None:
    """Write `in.blast` and `particles.data` of a case into an existing folder.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    (folder / DECK).write_text(deck_text(case, particles), encoding="ascii")
    write_particle_data(particles, folder / PARTICLE_DATA)


def write_resolved_case(case: Case, folder: Path) -> None:
    """Write `case.yaml` with every default spelled out, so that the folder stands on its own.

    A file of particles is copied beside it, as `particles.csv`.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    if isinstance(case.particles, ParticlesFromFile):
        source = case.folder / case.particles.file
        shutil.copyfile(source, folder / PARTICLE_TABLE)
        own_file = case.particles.model_copy(update={"file": PARTICLE_TABLE})
        case = case.model_copy(update={"particles": own_file})
    (folder / CASE).write_text(dump_case(case), encoding="utf-8")


def write_particle_data(particles: Particles, path: Path) -> None:
    """Write the LAMMPS data file of `particles`, exact to the last bit of each number.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    count = len(particles)
    margin = particles.radius.max()
    low, high = particles.position.min(axis=0) - margin, particles.position.max(axis=0) + margin
    identity = np.arange(1, count + 1)
    one_type = np.ones(count)
    with path.open("w", encoding="ascii") as file:
        file.write(
            f"LAMMPS data file of {count} spheres, SI units\n\n{count} atoms\n1 atom types\n\n"
        )
        for axis, a, b in zip("xyz", low, high, strict=True):
            file.write(f"{_number(a)} {_number(b)} {axis}lo {axis}hi\n")
        file.write("\nAtoms # hybrid\n\n")
        atoms = (
            identity,
            one_type,
            particles.position,
            2.0 * particles.radius,
            particles.density,
            particles.charge,
        )
        np.savetxt(file, np.column_stack(atoms), fmt=["%d", "%d"] + 6 * ["%.17g"])
        if particles.velocity.any() or particles.angular_velocity.any():
            file.write("\nVelocities # hybrid\n\n")
            motion = (identity, particles.velocity, particles.angular_velocity)
            np.savetxt(file, np.column_stack(motion), fmt=["%d"] + 6 * ["%.17g"])


def deck_text(case: Case, particles: Particles) -> str:
    """Return the text of `in.blast`."""
    blocks = [
        _header(case),
        _settings(case),
        system_commands(particles, PARTICLE_DATA),
        _forces_and_integration(case),
        _launch(case),
        _ledger(case),
        _output(case),
        "run ${steps}\n",
    ]
    return "\n".join(block for block in blocks if block)


def _header(case: Case) -> str:
    return f"""\
# Case {case.name}, in SI units. To run it, with lammps-blast's plugin known to LAMMPS:
#   lmp -in {DECK}        mpiexec -n 4 lmp -in {DECK}
# A line "variable NAME index VALUE" is a default: `lmp -in {DECK} -var NAME OTHER` overrides it.
# Duration and intervals are to be whole numbers of steps.
"""


def _settings(case: Case) -> str:
    settings = {
        "duration": case.time.duration,
        "step": case.time.step,
        "output_interval": case.output.interval,
        "restart_interval": case.output.restart_interval,
    }
    if case.blast:
        settings = {"energy": case.blast.energy} | settings
    lines = [f"variable {name} index {_number(value)}" for name, value in settings.items()]
    lines += [
        "variable steps equal round(v_duration/v_step)",
        "variable output_every equal round(v_output_interval/v_step)",
        "variable restart_every equal round(v_restart_interval/v_step)",
    ]
    return "\n".join(lines) + "\n"


def system_commands(particles: Particles, data: str) -> str:
    """Return the commands that set up LAMMPS for `particles`, read from the file `data`."""
    extent = np.ptp(particles.position, axis=0).max() + 2.0 * particles.radius.max()
    return f"""\
units si
atom_style hybrid sphere charge
# A box that follows the cloud: nothing is ever lost, and bins stay as small as the cloud.
boundary s s s
# Particles do not interact: ranks share the work and need no ghosts. Particles change ranks as soon
# as one of them has moved half the skin, so that none crosses a whole rank's share unnoticed.
atom_modify sort 0 0.0
comm_modify cutoff 1.0e-9
neighbor {_number(SKIN_OF_CLOUD * extent)} bin
neigh_modify every 1 delay 0 check yes
read_data {data}
timestep ${{step}}
"""


def _forces_and_integration(case: Case) -> str:
    fields = _external_fields(case)
    if case.time.integrator == "verlet":
        lines = [f"fix external all lorentz/drag {fields}", "fix integrate all nve/sphere"]
    else:
        lines = [f"fix integrate all nve/sphere/lorentz {fields}"]
    if any(case.fields.electric):
        lines.append(f"fix electric all efield {_vector(case.fields.electric)}")
    return "\n".join(lines) + "\n"


def _external_fields(case: Case) -> str:
    """Return the keywords that the plugin's styles share."""
    medium = case.medium
    words = [f"magnetic {_vector(case.fields.magnetic)}", f"drag {medium.drag}"]
    if medium.drag == "constant":
        words.append(_number(medium.drag_coefficient))
    if medium.drag != "none":
        words.append(
            f"density {_number(medium.density)} viscosity {_number(medium.viscosity)}"
            f" velocity {_vector(medium.velocity)}"
        )
    return " ".join(words)


def _launch(case: Case) -> str:
    return f"blast_pulse all ${{energy}} seed {case.seed}\n" if case.blast else ""


def _ledger(case: Case) -> str:
    """Return the commands that keep `energy.csv`, one column an account."""
    work = "external" if case.time.integrator == "verlet" else "integrate"
    electric = any(case.fields.electric)
    start = "variable electric_start equal $(f_electric:%.17g)\n" if electric else ""
    electric_work = "v_electric_start-f_electric" if electric else "0"
    accounts = " ".join(f"v_{account}" for account in ENERGY_ACCOUNTS)
    return f"""\
# The energy ledger, in joules.
compute kinetic all ke
compute rotational all erotate/sphere
run 0 post no
{start}variable kinetic equal c_kinetic
variable rotational equal c_rotational
variable electric_work equal {electric_work}
variable drag_loss equal -f_{work}[1]
variable magnetic_work equal f_{work}[2]
fix ledger all print ${{output_every}} "{_ledger_row()}" &
  file {ENERGY_TABLE} screen no title "time,{",".join(ENERGY_ACCOUNTS)}"
thermo_style custom step time {accounts}
thermo_modify format float %.10g
thermo ${{output_every}}
"""


def _ledger_row() -> str:
    columns = ("time", *(f"v_{account}" for account in ENERGY_ACCOUNTS))
    return ",".join(f"$({column}:%.17g)" for column in columns)


def _output(case: Case) -> str:
    name = TRAJECTORIES[case.output.format]
    columns = "id type mass radius q x y z vx vy vz omegax omegay omegaz"
    modify = "sort id time yes units yes"
    if case.output.format == "text":
        modify += " format float %.15g"
    preparation = ""
    if case.output.forces:
        force_columns, renaming, preparation = _force_columns(case)
        columns += force_columns
        modify += renaming
    return f"""\
{preparation}dump trajectory all custom ${{output_every}} {name} &
  {columns}
dump_modify trajectory {modify}
shell mkdir {RESTART_FOLDER}
# Two files in turn: a crash while one is written leaves the other.
restart ${{restart_every}} {RESTARTS[0]} {RESTARTS[1]}
"""


def _force_columns(case: Case) -> tuple[str, str, str]:
    """Return dump columns of the total force and torque, their renaming, and what they rest on.

    The integrator `lorentz` applies the magnetic force and drag as exact motions, so LAMMPS's own
    force array lacks them and a compute adds them.
    """
    if case.time.integrator == "verlet":
        return " fx fy fz tqx tqy tqz", "", ""
    preparation = f"compute external all lorentz/drag/atom {_external_fields(case)}\n"
    columns = renaming = ""
    for index, axis in enumerate("xyz", start=1):
        total = f"f{axis}+c_external[{index}]+c_external[{index + 3}]"
        preparation += f"variable force_{axis} atom {total}\n"
        columns += f" v_force_{axis}"
        renaming += f" colname v_force_{axis} f{axis}"
    return columns + " tqx tqy tqz", renaming, preparation


def _number(value: float) -> str:
    return repr(float(value))


def _vector(components: tuple[float, float, float]) -> str:
    return " ".join(_number(component) for component in components)


def main(argv: list[str] | None = None) -> int:
    """Write a case's deck and data into a folder; return the exit status."""
    parser = argparse.ArgumentParser(prog="lammps-blast deck", description=main.__doc__)
    parser.add_argument("case", type=Path, help="case file, YAML")
    parser.add_argument("--force", action="store_true", help="replace another case in the folder")
    parser.add_argument(
        "-o", "--output", type=Path, metavar="DIR", help="folder, default: the case's own"
    )
    options = parser.parse_args(argv)
    try:
        case = load_case(options.case)
        particles = create_particles(case)
    except CaseError as error:
        print(error, file=sys.stderr)
        return 2
    folder = options.output or case.folder
    elsewhere = folder.resolve() != case.folder.resolve()
    if elsewhere and (folder / CASE).exists() and not options.force:
        print(f"{folder} holds a case already: give --force to replace it", file=sys.stderr)
        return 3
    try:
        folder.mkdir(parents=True, exist_ok=True)
        write_deck(case, particles, folder)
        if elsewhere:
            write_resolved_case(case, folder)
    except OSError as error:
        print(f"cannot write the deck: {error}", file=sys.stderr)
        return 3
    print(f"{folder / DECK}: {len(particles)} particles, {case.time.steps} steps")
    return 0


if __name__ == "__main__":
    sys.exit(main())
