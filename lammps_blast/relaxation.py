"""The LAMMPS commands that relax a packing: overlapping spheres push each other apart.

A damped motion of linear springs inside the domain, with nothing of the case's own physics in it.
Spheres are relaxed a little wider than they are, so that the small overlap left when the motion
ends is none for the spheres themselves.
"""

from __future__ import annotations

import contextlib
import math
import re
from dataclasses import dataclass
from pathlib import Path

from lammps_blast import theory
from lammps_blast.case import PackedParticles
from lammps_blast.input_files import NUMBER, mapped
from lammps_blast.pair_commands import CONTACT_STYLE, number

# By this part wider spheres are relaxed, until they overlap by half of it at most.
ALLOWANCE = 1e-3
# Kinetic energy is below this part of that of all springs pressed by the allowance.
KINETIC_LIMIT = 1e-3
# Of a spring's own oscillation, in radians a step: a sphere among twelve others has five times as
# stiff a hold, and velocity-Verlet is stable up to two radians.
PHASE_PER_STEP = 0.15
# Of critical damping of one spring: low enough to let a dense cloud spread, high enough to stop it.
DAMPING_RATIO = 0.1
# Time runs from here while the packing relaxes, so that all of it lies before the pulse, at zero.
BEGINNING = -1.0e9
CHECK_EVERY = 50
MOST_STEPS = 200_000


@dataclass(frozen=True)
class RelaxationReport:
    """What a deck says of its relaxation: how long it took, and what was left in the end."""

    steps: int
    kinetic_energy: float  # J
    largest_strain: float  # of spheres that are wider by ALLOWANCE

    @classmethod
    def read(cls, log: Path) -> RelaxationReport | None:
        """Find the report in LAMMPS's log; None if there is none."""
        pattern = (
            rb"(?m)^Relaxed packing: steps (\d{1,18}), kinetic energy "
            + NUMBER
            + rb" J, largest strain\s+"
            + NUMBER
            + rb" of"
        )
        with contextlib.suppress(OSError), mapped(log) as text:
            found = re.search(pattern, text)
            return cls(int(found[1]), float(found[2]), float(found[3])) if found else None
        return None


def relaxation_commands(packed: PackedParticles, step: float) -> str:
    """Return the commands that relax packed spheres and leave them at rest about their centre.

    They end with the deck's own time step.

    Parameters
    ----------
    packed
        The packing, in a domain about the origin.
    step
        A time step (s). Springs are made to suit it.
    """
    radius = packed.radius
    wide = radius * (1.0 + ALLOWANCE)
    mass = float(theory.sphere_mass(radius, packed.density))
    spring = mass * (PHASE_PER_STEP / step) ** 2
    # Of law blast/contact with exponent 0, whose lens area is pi R overlap for a small overlap.
    stiffness = spring / (math.pi * wide)
    # The wall's force grows with the square of the depth: as stiff as two springs at the allowance.
    wall = spring / (ALLOWANCE * wide)
    damping = 2.0 * DAMPING_RATIO * math.sqrt(spring * mass)
    rest = KINETIC_LIMIT * packed.count * 0.5 * spring * (2.0 * ALLOWANCE * radius) ** 2
    reach = packed.packing.domain_radius - radius
    return f"""\
# Relaxation: spheres wider by {ALLOWANCE:g} of their radius push each other apart like springs
# inside the domain, against a viscous drag, until the strain of every contact is below
# {ALLOWANCE / 2:g} and the kinetic energy below {rest:.4g} J. No contact is then left between the
# spheres themselves.
variable centre_x equal $(xcm(all,x):%.17g)
variable centre_y equal $(xcm(all,y):%.17g)
variable centre_z equal $(xcm(all,z):%.17g)
reset_timestep 0 time {number(BEGINNING)}
timestep {number(step)}
set group all diameter {number(2.0 * wide)}
pair_style {CONTACT_STYLE}
pair_coeff * * stiffness {number(stiffness)} exponent 0
fix move all nve
fix slow all viscous {number(damping)}
fix wall all indent {number(wall)} sphere 0.0 0.0 0.0 {number(reach)} side in
compute motion all ke
fix overlap all blast/watch 1
variable strain equal f_overlap[1]
variable unsettled equal (v_strain>{number(ALLOWANCE / 2.0)})||(c_motion>{number(rest)})
fix settled all halt {CHECK_EVERY} v_unsettled < 0.5 error continue message no
thermo_style custom step c_motion v_strain
thermo {20 * CHECK_EVERY}
run {MOST_STEPS}
unfix settled
fix packing_did_not_relax all halt 1 v_strain > {number(ALLOWANCE)} error hard
run 1 post no
print "Relaxed packing: steps $(step-1), kinetic energy $(c_motion:%.4g) J, largest strain &
$(v_strain:%.4g) of spheres wider by {ALLOWANCE:g}"
unfix packing_did_not_relax
unfix wall
unfix slow
unfix move
unfix overlap
uncompute motion
set group all diameter {number(2.0 * radius)}
displace_atoms all move $(v_centre_x-xcm(all,x):%.17g) $(v_centre_y-xcm(all,y):%.17g) &
  $(v_centre_z-xcm(all,z):%.17g) units box
velocity all set 0.0 0.0 0.0
pair_style none
reset_timestep 0 time 0.0
timestep ${{step}}
"""
