"""Fix blast/watch: it stops runs that have become unstable, says why, and leaves others alone."""

import re

import numpy as np
import pytest
from conftest import SYSTEM, lmp, make_particles

from lammps_blast.deck import write_particle_data

CONTACT = """
neighbor 0.02 nsq
neigh_modify every 1 delay 0 check yes
comm_modify cutoff 0.0 vel yes
pair_style blast/contact
pair_coeff * * stiffness 1.5e7 exponent 2 damping 1.0e5
compute pair all pair blast/contact
fix losses all blast/losses
fix integrate all nve/sphere
compute kinetic all ke
compute potential all pe
thermo_style custom step c_kinetic c_potential
variable total equal c_kinetic+c_potential+f_losses[1]
"""


def colliding_cloud():
    rng = np.random.default_rng(41)
    lattice = np.stack(np.unravel_index(np.arange(64), (4, 4, 4)), axis=1) * 0.105 - 0.1575
    return make_particles(lattice, velocity=0.5 * rng.normal(size=(64, 3)) - 6 * lattice)


def test_a_healthy_run_goes_on_and_tells_its_largest_overlap(simulate):
    simulation = simulate(colliding_cloud())
    kinetic = simulation.kinetic_energy
    simulation.commands(f"""
        {CONTACT}
        compute rows all blast/contact/local
        compute deepest all reduce max c_rows[3] inputs local
        run 0
        variable start equal $(v_total:%.17g)
        variable created equal v_total-v_start
        fix watch all blast/watch 5 energy v_created 1.0e-3 strain 0.5 advice 1.0e-5
        timestep 1.0e-4
        fix deepest all ave/time 5 1 5 c_deepest
        run 1000
    """)
    overlap, created = (simulation.lammps.extract_fix("watch", 0, 1, n) for n in range(2))
    assert overlap == simulation.lammps.extract_compute("deepest", 0, 0)
    assert 0.01 < overlap < 0.5
    total, start = (simulation.lammps.extract_variable(name) for name in ("total", "start"))
    assert created == pytest.approx((total - start) / kinetic, rel=0.02)
    assert 0 < abs(created) < 1e-3


TOUCHING = """
    neighbor 0.01 nsq
    comm_modify cutoff 0.0
    pair_style blast/contact
    pair_coeff * * stiffness 1.0e6 exponent 1
"""
# Beside a wind that both share, each flies at 100 m/s and may move by its radius of 0.05 m a step.
PARTING = [[7.0, 60.0, 80.0], [7.0, -60.0, -80.0]]


@pytest.mark.parametrize("advised", [1.0e-3, 1.0e-4])
def test_a_move_beyond_the_radius_stops(simulate, advised):
    """Relative to the cloud, in the very step that is too long; half of it is advised."""
    simulation = simulate(make_particles([[0.0, 0, 0], [3.0, 0, 0]], velocity=PARTING))
    simulation.commands(f"""
        {TOUCHING}
        fix integrate all nve/sphere
        fix watch all blast/watch 4 advice {advised}
        timestep 4.0e-4
        run 12
    """)
    message = (
        "atom 1 moves by 1.2 of its radius in a step at time 0.0054"
        f": try a time step of {min(advised, 3e-4):.3g} s or less"
    )
    with pytest.raises(Exception, match=re.escape(message)):
        simulation.commands("timestep 6.0e-4\nrun 12")


@pytest.mark.parametrize(("contact", "wind"), [(TOUCHING, 1.0e4), ("", 0.0)])
def test_a_wind_and_particles_that_never_touch_may_move_far(simulate, contact, wind):
    slow = 1.0 if contact else 100.0
    velocity = np.array(PARTING) / 100.0 * slow + [wind, 0.0, 0.0]
    simulation = simulate(make_particles([[0.0, 0, 0], [3.0, 0, 0]], velocity=velocity))
    simulation.commands(f"""
        {contact}
        fix integrate all nve/sphere
        fix watch all blast/watch 4
        timestep 1.0e-3
        run 12
    """)
    assert np.abs(simulation.velocity - velocity).max() == 0.0


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("name", ["x", "v"])
def test_motion_that_is_no_number_stops(simulate, name, value):
    simulation = simulate(make_particles(np.arange(3)[:, None] * [1.0, 0.5, 0]))
    simulation.commands("fix integrate all nve/sphere\nfix watch all blast/watch 1")
    simulation.commands("timestep 1.0e-3\nrun 3")
    simulation.lammps.numpy.extract_atom(name)[1, 2] = value
    message = r"position, velocity or force of atom 2 is no number at time 0\.004: try a smaller"
    with pytest.raises(Exception, match=message):
        simulation.commands("run 1 pre no")


def test_a_force_that_is_no_number_stops(simulate):
    particles = make_particles([[0.0, 0, 0], [1.0, 0, 0], [1.3, 0, 0]])
    simulation = simulate(particles)
    simulation.commands("""
        neighbor 0.01 nsq
        comm_modify cutoff 0.0
        pair_style blast/nearfield 0.5 mass
        pair_coeff * * 1.0e300 20 0 1
        fix watch all blast/watch 1
    """)
    with pytest.raises(Exception, match=r"force of atom [23] is no number at time 1"):
        simulation.commands("timestep 1.0\nrun 1")


@pytest.mark.parametrize(("limit", "strain"), [("", 0.92), ("strain 0.3", 0.32)])
def test_a_strain_beyond_the_limit_stops(simulate, limit, strain):
    """Of two spheres pressed together by 0.02 of their distance a step; others touch lightly."""
    x = np.array([[0.0, 0, 0], [1.0, 0, 0], [1.098, 0, 0], [0.1, 0, 0]])
    simulation = simulate(make_particles(x))
    simulation.commands(f"""
        {CONTACT}
        unfix integrate
        group pressed id 4
        fix press pressed move linear -2.0 0 0
        fix watch all blast/watch 1 {limit} advice 2.0e-4
        timestep 1.0e-3
    """)
    time = (strain / 0.02) * 1e-3
    message = (
        rf"atoms (1 and 4|4 and 1) overlap by {strain} of their radii at time {time:.10g}: "
        ".*: try a time step of 0.0002 s or less"
    )
    with pytest.raises(Exception, match=message):
        simulation.commands("run 60")


def test_a_sphere_inside_another_stops(simulate):
    """Pressed into a larger one by 2.1 mm a step: 28 mm between their centres are too few."""
    particles = make_particles([[0.0, 0, 0], [0.07, 0, 0]], radius=[0.05, 0.02])
    simulation = simulate(particles)
    simulation.commands(f"""
        {CONTACT}
        unfix integrate
        group pressed id 2
        fix press pressed move linear -2.1 0 0
        fix watch all blast/watch 1
        timestep 1.0e-3
    """)
    message = r"of atoms (1 and 2|2 and 1) one lies inside the other at time 0\.02:"
    with pytest.raises(Exception, match=message):
        simulation.commands("run 30")


def test_a_sphere_that_begins_inside_another_is_no_matter_of_the_step(simulate):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.02, 0, 0]], radius=[0.05, 0.02]))
    simulation.commands(f"{CONTACT}\nfix watch all blast/watch 1 advice 1e-6\ntimestep 1.0e-9")
    with pytest.raises(
        Exception, match=r"as at the start: .* let them begin farther apart"
    ) as stop:
        simulation.commands("run 1")
    assert "time step" not in str(stop.value)


def test_created_energy_stops(simulate):
    """Two spheres meet in a step that is too long for their stiffness."""
    x = [[0.0, 0, 0], [3.0, 0, 0], [3.1004, 0, 0]]
    particles = make_particles(x, velocity=[[0.0, 0, 0], [4.0, 0, 0], [-4.0, 0, 0]])
    simulation = simulate(particles)
    simulation.commands(f"""
        {CONTACT}
        pair_coeff * * stiffness 3.0e8 exponent 2
        run 0
        variable start equal $(v_total:%.17g)
        variable created equal v_total-v_start
        fix watch all blast/watch 2 energy v_created 0.05 advice 1.0e-5
        timestep 2.0e-3
    """)
    start = simulation.kinetic_energy
    message = (
        r"(\S+) J came from nothing by time (\S+), with at most (\S+) J in motion; the fastest "
        r"particle is atom [23]: try a time step of 1e-05 s or less"
    )
    with pytest.raises(Exception, match=message) as stop:
        simulation.commands("run 200")
    created, time, kinetic = map(float, re.search(message, str(stop.value)).groups())
    assert kinetic >= start * (1 - 1e-3)
    assert created > 0.05 * kinetic
    assert created == pytest.approx(simulation.lammps.extract_variable("total") - start, rel=1e-3)
    assert time == pytest.approx(2.0e-3 * simulation.lammps.extract_global("ntimestep"))


@pytest.mark.parametrize("part", [0.049, 0.051])
def test_created_energy_is_compared_with_the_largest_kinetic_energy(simulate, part):
    """Which was there at step 4; afterwards drag takes nearly all of it."""
    particles = make_particles([0.0, 0, 0], velocity=[0.0, 20.0, 0])
    kinetic = 0.5 * float(particles.mass[0]) * 20.0**2
    simulation = simulate(particles)
    simulation.commands(f"""
        fix integrate all nve/sphere/lorentz drag stokes viscosity 1.0e3
        variable created equal {part * kinetic!r}*(step>5)
        fix watch all blast/watch 4 energy v_created 0.05
        timestep 1.0e-7
        run 4
        timestep 1.0e-3
    """)
    assert simulation.kinetic_energy == pytest.approx(kinetic, rel=1e-3)
    if part < 0.05:
        simulation.commands("run 400")
        assert simulation.kinetic_energy < 0.01 * kinetic
    else:
        with pytest.raises(Exception, match=r"J came from nothing by time 0\.0040004"):
            simulation.commands("run 400")


def test_lost_atoms_stop(simulate):
    particles = make_particles(
        [[0.0, 0, 0], [1.0, 1.0, 1.0], [0.5, 0.5, 0.5]],
        velocity=[[0.0, 0, 0], [9.0, 0, 0], [0] * 3],
    )
    simulation = simulate(particles)
    simulation.commands("""
        change_box all boundary f f f
        change_box all x final -1.0 1.0525 y final -1.0 2.0 z final -1.0 2.0
        neighbor 0.01 nsq
        neigh_modify every 1 delay 0 check no
        thermo_modify lost ignore
        fix integrate all nve/sphere
        fix watch all blast/watch 1
        timestep 1.0e-3
    """)
    message = "1 of 3 atoms were lost by time 0.006 (IDs 2): try a smaller time step"
    with pytest.raises(Exception, match=re.escape(message)):
        simulation.commands("run 60")


def test_several_ranks_stop_together(tmp_path):
    x = np.array([[0.0, 0, 0], [5.0, 0, 0], [5.09, 0, 0], [0.2, 0, 0]])
    velocity = np.outer([0, 0, 0, 1], [0, 10.0, 0])
    for watched, message in (
        # One rank stops the others: MPI may drop what it said last.
        ("strain 0.05", ""),
        ("energy v_energy 0.9", "the fastest particle is atom 4: try a time step of 1e-07 s"),
    ):
        write_particle_data(make_particles(x, velocity=velocity), tmp_path / "particles.data")
        (tmp_path / "in.deck").write_text(f"""
            {SYSTEM}
            {CONTACT}
            variable energy equal c_kinetic
            fix watch all blast/watch 2 {watched} advice 1.0e-7
            timestep 1.0e-6
            run 10
        """)
        done = lmp("-in", "in.deck", "-log", "none", folder=tmp_path, ranks=2)
        assert done.returncode != 0
        assert message in done.stdout + done.stderr


BAD_COMMANDS = {
    "fix f all blast/watch": "missing argument",
    "fix f all blast/watch 0": "interval must be above zero",
    "fix f all blast/watch often": "often",
    "fix f all blast/watch 10 energy v_e": "missing argument",
    "fix f all blast/watch 10 energy e 0.1": "must name a variable v_NAME: e",
    "fix f all blast/watch 10 energy v_e 0": "energy limit must be above zero",
    "fix f all blast/watch 10 energy v_e 0.1\nrun 0": "no equal-style variable e",
    "variable e atom x\nfix f all blast/watch 10 energy v_e 0.1\nrun 0": "no equal-style variable",
    "fix f all blast/watch 10 strain": "missing argument",
    "fix f all blast/watch 10 strain -0.5": "strain limit must be above zero",
    "fix f all blast/watch 10 advice 0": "advised step must be above zero",
    "fix f all blast/watch 10 colour blue": "keyword: colour",
    "group g id 1\nfix f g blast/watch 10": "requires group all",
}


@pytest.mark.parametrize("command", BAD_COMMANDS)
def test_bad_arguments_are_refused_by_name(simulate, command):
    simulation = simulate(make_particles([0.0, 0, 0]))
    with pytest.raises(Exception, match=re.escape(BAD_COMMANDS[command])):
        simulation.commands(command)
