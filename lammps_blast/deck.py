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

from lammps_blast.case import (
    WHOLE_STEPS_TOLERANCE,
    Case,
    CaseError,
    Implicit,
    PackedParticles,
    ParticlesFromFile,
    dump_case,
    load_case,
)
from lammps_blast.case_warnings import case_warnings, check_near_field, remarks
from lammps_blast.command_line import DONE, FAILED, INVALID, OUT_OF_MEMORY, tell
from lammps_blast.folder_lock import RUN_LOCK, FolderError, require_idle
from lammps_blast.pair_commands import (
    CONTACT_STYLE,
    NEAR_FIELD_STYLE,
    SIGN_FIX,
    SIGN_PROPERTY,
    SIGN_SECTION,
    number,
    numbers,
    pair_commands,
    pair_styles,
    uses_signs,
)
from lammps_blast.particles import Particles, create_particles
from lammps_blast.relaxation import relaxation_commands
from lammps_blast.step_advice import advised_step, largest_velocity
from lammps_blast.stock_contacts import energy_reserve

DECK = "in.blast"
PARTICLE_DATA = "particles.data"
CASE = "case.yaml"
PARTICLE_TABLE = "particles.csv"
ENERGY_TABLE = "energy.csv"
STEP_TABLE = "steps.csv"
RESTART_FOLDER = "restart"
RESTARTS = (f"{RESTART_FOLDER}/blast.1", f"{RESTART_FOLDER}/blast.2")
# What a run may leave that is killed while it writes one of them.
UNFINISHED = tuple(f"{name}.unfinished" for name in (RESTARTS[0], DECK, CASE))
LOG = "log.lammps"
CONTACT_TABLE = "contacts.lammpsdump"
TEXT_TRAJECTORY = "trajectory.lammpstrj"
BINARY_TRAJECTORY = "trajectory.lammpsbin"  # LAMMPS writes binary for .bin and .lammpsbin
BINARY_CONSTANTS = "constants.lammpsbin"
KEPT_TRAJECTORY = f"{BINARY_TRAJECTORY}.kept"
TRAJECTORIES = {"text": TEXT_TRAJECTORY, "binary": BINARY_TRAJECTORY}

# Part of the cloud's first width: narrower than the share of one among dozens of ranks in a row,
# even where a magnetic field draws the cloud together to a fraction of that width.
SKIN_OF_CLOUD = 0.005
# Parts of a usual diameter and of a near field's cutoff: wide enough that lists last for many
# steps, narrow enough that they hold few pairs that feel nothing.
SKIN_OF_CONTACT, SKIN_OF_CUTOFF = 0.2, 0.1
# Ways of the longest step of an integrator that adapts them.
SKIN_OF_STEPS = 6.0
# So few particles are compared each with each: LAMMPS's bins fail when all lie in a plane.
FEW_PARTICLES = 500

ENERGY_ACCOUNTS = (
    "kinetic",
    "rotational",
    "contact_energy",
    "bond_energy",
    "near_field_energy",
    "electric_work",
    "drag_loss",
    "magnetic_work",
    "contact_loss",
    "friction_loss",
    "bond_friction_loss",
    "bond_formation_loss",
)
# What energy.csv says besides of an integrator that adapts its steps, each a number of fix
# nve/implicit's vector, whose first two are works.
STEP_COLUMNS = (
    "adapted_step",
    "corrections",
    "iteration_error",
    "steps_taken",
    "step_restarts",
    "force_evaluations",
)
FIRST_STEP_NUMBER = 3
CONSTANT_COLUMNS = "type mass radius q"
STATE_COLUMNS = "x y z vx vy vz omegax omegay omegaz"
NO_GHOSTS = "atom_modify sort 0 0.0\ncomm_modify cutoff 1.0e-9"
# LAMMPS's time steps between two looks at how evenly ranks share particles that touch, and how many
# times the mean the fullest one may have.
BALANCE_EVERY = 1000
UNEVENNESS = 1.1
# LAMMPS's time steps between two looks for numbers gone wild, and the part of the largest kinetic
# energy that may come from nothing before a run is stopped.
WATCH_EVERY = 10
ENERGY_FROM_NOTHING = 0.1
# Of the energies in the ledger, what their sums are not trusted to.
ROUNDING_OF_LEDGER = 1e-9


def write_deck(case: Case, particles: Particles, folder: Path) -> None:
    """Write `in.blast` and `particles.data` of a case into an existing folder.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    (folder / DECK).write_text(deck_text(case, particles), encoding="ascii")
    write_particle_data(particles, folder / PARTICLE_DATA, signs=uses_signs(case, particles))


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


def write_particle_data(particles: Particles, path: Path, *, signs: bool = False) -> None:
    """Write the LAMMPS data file of `particles`, exact to the last bit of each number.

    With `signs` it has a section of them, which LAMMPS has to be told of.

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
            file.write(f"{number(a)} {number(b)} {axis}lo {axis}hi\n")
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
        if signs:
            file.write(f"\n{SIGN_SECTION}\n\n")
            np.savetxt(file, np.column_stack([identity, particles.sign]), fmt="%d")


def deck_text(case: Case, particles: Particles) -> str:
    """Return the text of `in.blast`."""
    blocks = [
        _header(case),
        _settings(case),
        _box_and_neighbours(particles, case),
        _beginning(case, particles),
        pair_commands(pair_styles(case, particles)),
        _ghosts_no_more(case),
        _forces_and_integration(case),
        _launch(case),
        _balance(case),
        _ledger(case, particles),
        _watch(case, particles),
        _output(case),
        _run(case),
    ]
    return "\n".join(block for block in blocks if block)


def size_of(case: Case, particles: Particles) -> str:
    """Return how many particles and steps a case has, or how long these are where they adapt."""
    steps = counted(case.timesteps, "step")
    if _adapts(case):
        steps = f"steps of up to {case.time.longest_step:g} s"
    return f"{counted(len(particles), 'particle')}, {steps}"


def counted(number: int, what: str) -> str:
    """Return a number of things in words, such as `1 particle` or `2 particles`."""
    return f"{number} {what}" if number == 1 else f"{number} {what}s"


def _header(case: Case) -> str:
    return f"""\
# Case {case.name}, in SI units. To run it, with lammps-blast's plugin known to LAMMPS:
#   lmp -in {DECK}        mpiexec -n 4 lmp -in {DECK}
# A line "variable NAME index VALUE" is a default: `lmp -in {DECK} -var NAME OTHER` overrides it.
# Duration and intervals are to be whole numbers of steps.{_remark_on_steps(case)}
# To go on after an interruption, or longer: lmp -in {DECK} -log none -var restart newest
"""


def _remark_on_steps(case: Case) -> str:
    if not _adapts(case):
        return ""
    return """
# Here step is a step of LAMMPS, within which fix nve/implicit takes as many of its own as it needs,
# of first_step at first and none longer than max_step."""


def _adapts(case: Case) -> bool:
    """Tell whether the integrator takes steps of its own within those of LAMMPS."""
    return case.time.integrator == "implicit"


def _scheme(case: Case) -> Implicit:
    assert case.time.implicit is not None  # resolved when `time` was checked
    return case.time.implicit


def _settings(case: Case) -> str:
    settings = {
        "duration": case.time.duration,
        "step": case.timestep,
        "output_interval": case.output.interval,
        "restart_interval": case.output.restart_interval,
    }
    if case.blast:
        settings = {"energy": case.blast.energy} | settings
    if _adapts(case):
        settings |= {"max_step": case.time.longest_step, "first_step": _scheme(case).first_step}
        settings |= {"tolerance": _scheme(case).tolerance}
    lines = [f"variable {name} index {number(value)}" for name, value in settings.items()]
    lines += [
        "variable restart index no",
        'if "(${restart} != no) && (${restart} != newest)" then &',
        "  \"print 'ERROR: restart is no, or newest, but not ${restart}'\" &",
        '  "quit 1"',
        "variable steps equal round(v_duration/v_step)",
        "variable output_every equal round(v_output_interval/v_step)",
        "variable restart_every equal round(v_restart_interval/v_step)",
        *_refusal_of_broken_steps(),
    ]
    return "\n".join(lines) + "\n"


def _refusal_of_broken_steps() -> list[str]:
    """Return commands that end LAMMPS where -var gave times that are no whole numbers of steps."""
    misfits = [
        f"(abs({count}*v_step-{length})>{WHOLE_STEPS_TOLERANCE}*{length})"
        for count, length in (
            ("v_steps", "v_duration"),
            ("v_output_every", "v_output_interval"),
            ("v_restart_every", "v_restart_interval"),
        )
    ]
    return [
        f"variable broken_steps equal {'||'.join(misfits)}",
        'if "${broken_steps}" then &',
        "  \"print 'ERROR: duration and intervals are no whole numbers of steps of ${step} s'\" &",
        '  "quit 1"',
    ]


def system_commands(particles: Particles, data: str, case: Case | None = None) -> str:
    """Return the commands that set up LAMMPS for `particles`, read from the file `data`.

    With a case whose particles interact, or are relaxed, ranks exchange ghosts and lists are made.
    """
    signs = case is not None and uses_signs(case, particles)
    return f"{_box_and_neighbours(particles, case)}{_reading(data, signs)}timestep ${{step}}\n"


def _box_and_neighbours(particles: Particles, case: Case | None) -> str:
    touching = case is not None and (case.interacts or _is_relaxed(case))
    signs = case is not None and uses_signs(case, particles)
    neighbours = _neighbours(particles, case) if touching else _no_neighbours(particles)
    property_of_signs = f"fix {SIGN_FIX} all property/atom {SIGN_PROPERTY} ghost yes\n"
    return f"""\
units si
atom_style hybrid sphere charge
# A box that follows the cloud: nothing is ever lost, and bins stay as small as the cloud.
boundary {_boundaries(particles) if touching else "s s s"}
{neighbours}neigh_modify every 1 delay 0 check yes
{property_of_signs if signs else ""}"""


def _beginning(case: Case, particles: Particles) -> str:
    """Return the commands that bring particles in: from their file, or in the midst of a run."""
    relaxation = _relaxation(case)
    return f"""\
shell mkdir {RESTART_FOLDER}
variable append string no
variable units string yes
if "${{restart}} != no" then &
  "variable append string yes" &
  "variable units string no" &
  "jump SELF go_on"
blast_new_run {" ".join(RESTARTS)} lock {RUN_LOCK}
log {LOG}
{_reading(PARTICLE_DATA, uses_signs(case, particles))}timestep ${{step}}
{relaxation and chr(10) + relaxation}
label go_on
if "${{append}} == yes" then &
  "blast_read_restart {" ".join(RESTARTS)} lock {RUN_LOCK} step ${{step}} upto ${{steps}}" &
  "log {LOG} append"
fix restart all blast/restart lock {RUN_LOCK}{_binary_words(case)}
"""


def _binary_words(case: Case) -> str:
    return f" binary {BINARY_TRAJECTORY}" if case.output.format == "binary" else ""


def _no_neighbours(particles: Particles) -> str:
    extent = np.ptp(particles.position, axis=0).max() + 2.0 * particles.radius.max()
    return f"""\
# Particles do not interact: ranks share the work and need no ghosts. Particles change ranks as soon
# as one of them has moved half the skin, so that none crosses a whole rank's share unnoticed.
{NO_GHOSTS}
neighbor {number(SKIN_OF_CLOUD * extent)} bin
"""


def _neighbours(particles: Particles, case: Case) -> str:
    diameter = 2.0 * float(np.median(particles.radius))
    skin = SKIN_OF_CONTACT * diameter
    if _adapts(case):
        # Steps are cut where a particle moves by half the skin: not by the motion of the launch.
        way = case.time.longest_step * largest_velocity(case, particles)
        skin = max(skin, min(SKIN_OF_STEPS * way, diameter))
    field = case.near_field
    cutoff = field.cutoff if field and field.cutoff != "all" else 0.0
    extent = float(np.ptp(particles.position, axis=0).max())
    few = len(particles) <= FEW_PARTICLES or cutoff > extent
    return f"""\
comm_modify vel yes
neighbor {number(max(skin, SKIN_OF_CUTOFF * cutoff))} {"nsq" if few else "bin"}
"""


def _boundaries(particles: Particles) -> str:
    """Return how the box follows the cloud: not below its first size where that is thin.

    LAMMPS refuses boxes far thinner than a neighbour distance.
    """
    extent = np.ptp(particles.position, axis=0)
    thin = extent < 2.0 * particles.radius.max()
    return " ".join("m" if is_thin else "s" for is_thin in thin)


def _reading(data: str, signs: bool) -> str:
    return f"read_data {data}{f' fix {SIGN_FIX} NULL {SIGN_SECTION}' if signs else ''}\n"


def _is_relaxed(case: Case) -> bool:
    return isinstance(case.particles, PackedParticles) and case.particles.packing.relax


def _needs_ghosts(case: Case) -> bool:
    return bool(case.contact or (case.near_field and case.near_field.cutoff != "all"))


def _ghosts_no_more(case: Case) -> str:
    """Return what keeps LAMMPS from looking for ghosts, where the start of the deck let it."""
    if _needs_ghosts(case) or not (case.interacts or _is_relaxed(case)):
        return ""
    return f"{NO_GHOSTS}\n"


def _relaxation(case: Case) -> str:
    return relaxation_commands(case.particles, case.time.step) if _is_relaxed(case) else ""


def _forces_and_integration(case: Case) -> str:
    fields = _external_fields(case)
    lines = []
    if case.contact:
        # Before the fixes that add forces and integrate: it counts work with what they find.
        lines.append(f"fix losses all blast/losses{' work yes' if case.contact.is_stock else ''}")
    if case.time.integrator == "verlet":
        lines += [f"fix external all lorentz/drag {fields}", "fix integrate all nve/sphere"]
    elif case.time.integrator == "implicit":
        lines.append(f"fix integrate all nve/implicit {_scheme_words(_scheme(case))} &\n  {fields}")
    else:
        lines.append(f"fix integrate all nve/sphere/lorentz {fields}")
    if any(case.fields.electric):
        lines.append(f"fix electric all efield {numbers(*case.fields.electric)}")
    return "\n".join(lines) + "\n"


def _scheme_words(scheme: Implicit) -> str:
    fields = "solved" if scheme.solve_fields else "iterated"
    return (
        f"phi {number(scheme.phi)} iterations {scheme.iterations} tolerance ${{tolerance}}"
        " first_step $(ternary(v_first_step<v_max_step,v_first_step,v_max_step):%.17g)"
        f" max_step ${{max_step}} safety {number(scheme.safety)}"
        f" fields {fields} anderson {scheme.anderson} file {STEP_TABLE}"
    )


def _external_fields(case: Case) -> str:
    """Return the keywords that the plugin's styles share."""
    medium = case.medium
    words = [f"magnetic {numbers(*case.fields.magnetic)}", f"drag {medium.drag}"]
    if medium.drag == "constant":
        words.append(number(medium.drag_coefficient))
    if medium.drag != "none":
        words.append(
            f"density {number(medium.density)} viscosity {number(medium.viscosity)}"
            f" velocity {numbers(*medium.velocity)}"
        )
    return " ".join(words)


def _launch(case: Case) -> str:
    if not case.blast:
        return ""
    return f'if "${{append}} == no" then "blast_pulse all ${{energy}} seed {case.seed}"\n'


def _balance(case: Case) -> str:
    """Return the commands that share the cloud out evenly, where there are ranks to share it.

    Not with stock contacts: their histories do not travel between the boxes of such a partition.
    """
    is_stock = case.contact is not None and case.contact.is_stock
    if is_stock or not _needs_ghosts(case) or _adapts(case):
        return ""
    return f"""\
# A cloud fills the middle of its box and not the corners: ranks get boxes that hold equal numbers.
if "$(extract_setting(world_size)) > 1" then &
  "comm_style tiled" &
  "fix share all balance {BALANCE_EVERY} {number(UNEVENNESS)} rcb"
"""


def _ledger(case: Case, particles: Particles) -> str:
    """Return the commands that keep `energy.csv`, one column an account."""
    computes = ["compute kinetic all ke", "compute rotational all erotate/sphere"]
    if case.contact and not case.contact.is_stock:
        computes.append(f"compute contact all pair {CONTACT_STYLE}")
    if case.near_field:
        computes.append(f"compute near_field all pair {NEAR_FIELD_STYLE}")
    columns = _accounts(case) | _step_columns(case)
    named = " ".join(f"v_{name}" for name in columns)
    starts = [
        f'  "variable {start} equal $({source}:%.17g)"' for start, source in _starts(case).items()
    ]
    lines = [
        "# The energy ledger, in joules.",
        *computes,
        *(f"variable {name} equal {text}" for name, text in columns.items()),
        *_energy_from_nothing(case, particles),
        # Of the columns, so that energies are there when they are first asked for.
        "thermo_style custom step time pe",
        " &\n".join(['if "${append} == no" then', '  "run 0 post no"', *starts]),
        f"fix ledger all blast/table ${{output_every}} {ENERGY_TABLE} {named}",
        f"thermo_style custom step time {named}",
        "thermo_modify format float %.10g",
        "thermo ${output_every}",
    ]
    return "\n".join(lines) + "\n"


def _starts(case: Case) -> dict[str, str]:
    """Return the variables that hold what something was at the launch, and what that was."""
    starts = {}
    if any(case.fields.electric):
        starts["electric_start"] = "f_electric"
    if case.near_field:
        starts["near_field_start"] = "c_near_field"
    if case.interacts and not (case.contact and case.contact.is_stock):
        starts["balance_start"] = "v_balance"
    return starts


def _accounts(case: Case) -> dict[str, str]:
    """Return what each account is in LAMMPS's terms."""
    work = "external" if case.time.integrator == "verlet" else "integrate"
    accounts = dict.fromkeys(ENERGY_ACCOUNTS, "0.0") | {
        "kinetic": "c_kinetic",
        "rotational": "c_rotational",
        "drag_loss": f"-f_{work}[1]",
        "magnetic_work": f"f_{work}[2]",
    }
    if any(case.fields.electric):
        accounts["electric_work"] = "v_electric_start-f_electric"
    if case.near_field:
        accounts["near_field_energy"] = "c_near_field"
    if case.contact and case.contact.is_stock:
        # Stock styles keep no account: what all pair forces took and the near field does not hold.
        held = "-(c_near_field-v_near_field_start)" if case.near_field else ""
        accounts["contact_loss"] = f"-f_losses[5]{held}"
    elif case.contact:
        accounts |= {
            "contact_energy": "c_contact[1]",
            "bond_energy": "c_contact[2]",
            "contact_loss": "f_losses[1]",
            "friction_loss": "f_losses[2]",
            "bond_friction_loss": "f_losses[3]",
            "bond_formation_loss": "f_losses[4]",
        }
    return accounts


def _step_columns(case: Case) -> dict[str, str]:
    """Return what is known of adaptive steps, in LAMMPS's terms."""
    if not _adapts(case):
        return {}
    numbers = range(FIRST_STEP_NUMBER, FIRST_STEP_NUMBER + len(STEP_COLUMNS))
    return {name: f"f_integrate[{n}]" for name, n in zip(STEP_COLUMNS, numbers, strict=True)}


def _watch(case: Case, particles: Particles) -> str:
    """Return the commands that stop a run of interacting particles when it becomes unstable."""
    if not case.interacts:
        return ""
    advised = advised_step(case, particles)
    advice = f" advice {number(advised[0])}" if advised else ""
    every = 1 if _adapts(case) else WATCH_EVERY
    return f"""\
fix watch all blast/watch {every}{advice}
fix watch_energy all blast/watch ${{output_every}} energy v_created {ENERGY_FROM_NOTHING}{advice}
"""


def _energy_from_nothing(case: Case, particles: Particles) -> list[str]:
    """Return the variable `created`, in joules, positive only when a run goes wrong."""
    if not case.interacts:
        return []
    if case.contact and case.contact.is_stock:
        # Their loss is what their forces took, whatever that was; they may give what they hold.
        reserve = energy_reserve(case.contact, particles.position, particles.radius)
        return [f"variable created equal -v_contact_loss-{number(reserve)}"]
    held = "v_kinetic+v_rotational+v_contact_energy+v_bond_energy+v_near_field_energy"
    lost = "v_drag_loss+v_contact_loss+v_friction_loss+v_bond_friction_loss+v_bond_formation_loss"
    size = "abs(v_contact_energy)+abs(v_bond_energy)+abs(v_near_field_energy)+v_contact_loss"
    return [
        f"variable balance equal {held}+{lost}-v_electric_work",
        f"variable rounding equal {ROUNDING_OF_LEDGER}*({size})",
        "variable created equal v_balance-v_balance_start-v_rounding",
    ]


def _output(case: Case) -> str:
    forces = preparation = renaming = ""
    if case.output.forces:
        forces, renaming, preparation = _force_columns(case)
    contacts = _contact_dump() if case.output.contacts else ""
    return f"{preparation}{_trajectory(case, forces, renaming)}{contacts}"


def _run(case: Case) -> str:
    """Return the run, in parts that each end with a restart file, the last one too."""
    words = [*RESTARTS, "outputs", *_growing_outputs(case), "logs", LOG]
    if starts := _starts(case):
        words += ["values", *starts]
    return f"""\
# Two files in turn: a crash while one is written leaves the other.
run ${{steps}} upto post no every ${{restart_every}} &
  "blast_write_restart {" ".join(words)}"
if "$(step) < ${{steps}}" then &
  "print 'Stopped at step $(step) of ${{steps}}. To go on: -log none -var restart newest'"
"""


def _growing_outputs(case: Case) -> list[str]:
    """Return the files that a run adds to from beginning to end."""
    outputs = [ENERGY_TABLE, TRAJECTORIES[case.output.format]]
    if case.output.contacts:
        outputs.append(CONTACT_TABLE)
    if _adapts(case):
        outputs.append(STEP_TABLE)
    return outputs


def _trajectory(case: Case, forces: str, renaming: str) -> str:
    name = TRAJECTORIES[case.output.format]
    columns, modify, once = STATE_COLUMNS, "sort id time yes units ${units}", ""
    if case.output.format == "text":
        columns = f"{CONSTANT_COLUMNS} {columns}"
        modify += " format float %.15g"
    else:
        once = (
            "# What no frame need repeat.\n"
            f'if "${{append}} == no" then &\n  "write_dump all custom {BINARY_CONSTANTS}'
            f' id {CONSTANT_COLUMNS} modify {modify}"\n'
        )
    return f"""\
{once}dump trajectory all custom ${{output_every}} {name} &
  id {columns}{forces}
dump_modify trajectory append ${{append}} {modify}{renaming}
"""


def _contact_dump() -> str:
    columns = (
        "id1",
        "id2",
        "strain",
        "normal_force",
        "damping_force",
        "friction_force",
        "bond_force",
        "bond_friction_force",
    )
    sources = " ".join(f"c_contacts[{k}]" for k in range(1, len(columns) + 1))
    names = " ".join(f"colname c_contacts[{k}] {name}" for k, name in enumerate(columns, start=1))
    return f"""\
compute contacts all blast/contact/local
dump contacts all local ${{output_every}} {CONTACT_TABLE} {sources}
dump_modify contacts append ${{append}} time yes units ${{units}} format float %.10g {names}
"""


def _force_columns(case: Case) -> tuple[str, str, str]:
    """Return dump columns of the total force and torque, their renaming, and what they rest on.

    The integrator `lorentz` applies the magnetic force and drag as exact motions, so LAMMPS's own
    force array lacks them and a compute adds them.
    """
    if case.time.integrator != "lorentz":
        return " fx fy fz tqx tqy tqz", "", ""
    preparation = f"compute external all lorentz/drag/atom {_external_fields(case)}\n"
    columns = renaming = ""
    for index, axis in enumerate("xyz", start=1):
        total = f"f{axis}+c_external[{index}]+c_external[{index + 3}]"
        preparation += f"variable force_{axis} atom {total}\n"
        columns += f" v_force_{axis}"
        renaming += f" colname v_force_{axis} f{axis}"
    return columns + " tqx tqy tqz", renaming, preparation


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
        check_near_field(case, particles)
    except CaseError as error:
        tell(error, sys.stderr)
        return INVALID
    except MemoryError:
        return _out_of_memory()
    folder = options.output or case.folder
    try:
        folder.mkdir(parents=True, exist_ok=True)
        _make_way(case, particles, folder, force=options.force)
        write_deck(case, particles, folder)
        if folder.resolve() != case.folder.resolve():
            write_resolved_case(case, folder)
    except FolderError as error:
        tell(error, sys.stderr)
        return FAILED
    except OSError as error:
        tell(f"cannot write the deck: {error}", sys.stderr)
        return FAILED
    except MemoryError:
        return _out_of_memory()
    for remark in remarks(case, particles):
        tell(remark, sys.stderr)
    for warning in case_warnings(case, particles):
        tell(f"WARNING: {warning}", sys.stderr)
    tell(f"{folder / DECK}: {size_of(case, particles)}")
    return DONE


def _make_way(case: Case, particles: Particles, folder: Path, *, force: bool) -> None:
    """Refuse a folder with another case or its run; with `force`, the state of that run goes."""
    require_idle(folder)
    elsewhere = folder.resolve() != case.folder.resolve()
    if elsewhere and (folder / CASE).exists() and not force:
        raise FolderError(f"{folder} holds a case already: give --force to replace it")
    states = [folder / name for name in RESTARTS if (folder / name).exists()]
    if not states:
        return
    deck = folder / DECK
    if deck.is_file() and deck.read_bytes() == deck_text(case, particles).encode("ascii"):
        return
    if not force:
        raise FolderError(f"{folder} holds the state of another run: give --force to remove it")
    for state in states:
        state.unlink()


def _out_of_memory() -> int:
    tell(OUT_OF_MEMORY, sys.stderr)
    return FAILED


if __name__ == "__main__":
    sys.exit(main())
