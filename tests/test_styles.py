"""The plugin's styles as LAMMPS users meet them: groups, restarts, ranks, arguments, forces."""

import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import REPOSITORY, SYSTEM, lmp, make_particles, random_cloud

from lammps_blast import theory
from lammps_blast.deck import write_particle_data
from lammps_blast.trajectory import open_universe

FIELDS = "magnetic 2.0 1.0 0.5 drag chow density 300.0 viscosity 0.2 velocity 0.3 0.0 0.1"
INTEGRATORS = {
    "lorentz": f"fix integrate all nve/sphere/lorentz {FIELDS}\n",
    "verlet": f"fix integrate all nve/sphere\nfix external all lorentz/drag {FIELDS}\n",
}
WORK_FIX = {"lorentz": "integrate", "verlet": "external"}


def test_styles_are_found_from_any_folder_by_lmp_and_python(tmp_path):
    (tmp_path / "in.styles").write_text(
        "info styles fix\n" + SYSTEM.split("read_data")[0] + "region r block -1 1 -1 1 -1 1\n"
        "create_box 1 r\nfix f all nve/sphere/lorentz\nfix g all lorentz/drag\n"
    )
    for folder in (tmp_path, REPOSITORY):
        done = lmp("-in", str(tmp_path / "in.styles"), "-log", "none", folder=folder)
        assert done.returncode == 0, done.stdout
    code = (
        "from lammps_blast.engine import start_lammps\n"
        "print(start_lammps(log='none').has_style('fix', 'nve/sphere/lorentz'))"
    )
    for folder in (tmp_path, REPOSITORY):
        found = subprocess.run(
            [sys.executable, "-c", code], cwd=folder, capture_output=True, text=True
        )
        assert found.stdout.split()[-1] == "True", found.stderr


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_only_the_group_moves_and_works(simulate, integrator):
    particles = random_cloud(20, seed=1, velocity=[1.0, 2.0, 3.0])
    simulation = simulate(particles)
    commands = INTEGRATORS[integrator].replace(" all ", " chosen ")
    simulation.commands(f"group chosen id 1:10\n{commands}timestep 1e-3\nrun 100")
    moved = np.linalg.norm(simulation.position - particles.position, axis=1)
    assert (moved[:10] > 0.1).all()
    assert (moved[10:] == 0.0).all()
    alone = simulate(make_particles(particles.position[:10], velocity=particles.velocity[:10]))
    alone.commands(f"{INTEGRATORS[integrator]}timestep 1e-3\nrun 100")
    fix = WORK_FIX[integrator]
    assert simulation.work(fix) == pytest.approx(alone.work(fix), rel=1e-12, abs=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_run_0_changes_nothing(simulate, integrator):
    particles = random_cloud(5, seed=2, velocity=[1.0, 2.0, 3.0])
    simulation = simulate(particles)
    simulation.commands(f"{INTEGRATORS[integrator]}timestep 1e-3\nrun 0")
    assert (simulation.position == particles.position).all()
    assert (simulation.velocity == particles.velocity).all()
    assert (simulation.work(WORK_FIX[integrator]) == 0.0).all()


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_restart_continues_motion_and_work(simulate, integrator, tmp_path):
    particles = random_cloud(20, seed=3, velocity=[1.0, 2.0, 3.0])
    whole, first = simulate(particles), simulate(particles)
    commands = f"{INTEGRATORS[integrator]}timestep 1e-3\n"
    whole.commands(f"{commands}run 100\nrun 100")
    first.commands(f"{commands}run 100\nwrite_restart {tmp_path}/half.restart")
    second = simulate(particles)
    second.commands(f"clear\nread_restart {tmp_path}/half.restart\n{commands}run 100")
    assert second.position == pytest.approx(whole.position, abs=1e-13)
    fix = WORK_FIX[integrator]
    assert second.work(fix) == pytest.approx(whole.work(fix), rel=1e-12)


DECK = f"""{SYSTEM}
{{integrator}}
fix electric all efield 0.3 -0.2 0.1
timestep 1e-3
blast_pulse all 1.0e3 seed 5
variable drag equal f_{{fix}}[1]
variable magnetic equal f_{{fix}}[2]
dump d all custom 100 out.lammpsbin id type mass radius q x y z vx vy vz
dump_modify d sort id time yes units yes
run 200
print "work $(v_drag:%.17g) $(v_magnetic:%.17g)"
write_restart state.restart
clear
read_restart state.restart
{{integrator}}
variable drag equal f_{{fix}}[1]
run 0
print "restarted $(v_drag:%.17g)"
"""


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_ranks_agree(tmp_path, integrator):
    # One particle sits on the centre of mass, so that its drawn direction is compared as well.
    half = random_cloud(20, seed=4).position
    particles = make_particles(np.vstack([half, -half, [[0.0, 0, 0]]]))
    frames, work = [], []
    for ranks in (1, 2):
        folder = tmp_path / str(ranks)
        folder.mkdir()
        write_particle_data(particles, folder / "particles.data")
        (folder / "in.deck").write_text(
            DECK.format(integrator=INTEGRATORS[integrator], fix=WORK_FIX[integrator])
        )
        done = lmp("-in", "in.deck", folder=folder, ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        numbers = re.findall(r"^(?:work|restarted) (.*)", done.stdout, re.M)
        drag, magnetic, restarted = map(float, " ".join(numbers).split())
        assert restarted == pytest.approx(drag, rel=1e-14)
        work.append((drag, magnetic))
        universe = open_universe(folder / "out.lammpsbin")
        frames.append([ts.data["position"] for ts in universe.trajectory])
    assert np.array(frames[1]) == pytest.approx(np.array(frames[0]), rel=1e-12, abs=1e-13)
    assert work[1] == pytest.approx(work[0], rel=1e-11, abs=1e-9)


def test_forces_are_those_of_theory(simulate):
    rng = np.random.default_rng(6)
    count = 300
    radius, density = 10.0 ** rng.uniform(-4, 0, count), rng.uniform(500, 9000, count)
    velocity = rng.normal(size=(count, 3)) * 10.0 ** rng.uniform(-6, 6, (count, 1))
    velocity[0] = [0.3, 0.0, 0.1]  # at rest in the medium
    charge = rng.normal(size=count)
    particles = make_particles(
        rng.normal(size=(count, 3)),
        velocity=velocity,
        radius=radius,
        density=density,
        charge=charge,
    )
    field, wind = np.array([2.0, 1.0, 0.5]), np.array([0.3, 0.0, 0.1])
    magnetic = particles.charge[:, None] * np.cross(velocity, field)
    for law, keywords in {
        "none": "drag none",
        "constant": "drag constant 0.47",
        "chow": "drag chow",
        "stokes": "drag stokes",
    }.items():
        simulation = simulate(particles)
        simulation.commands(
            f"compute force all lorentz/drag/atom magnetic 2.0 1.0 0.5 {keywords} density 1.3 "
            "viscosity 2.0e-5 velocity 0.3 0.0 0.1\nfix external all lorentz/drag "
            f"magnetic 2.0 1.0 0.5 {keywords} density 1.3 viscosity 2.0e-5 velocity 0.3 0.0 0.1\n"
            "fix integrate all nve/sphere\nrun 0"
        )
        columns = np.array(simulation.lammps.numpy.extract_compute("force", 1, 2)[:count])
        coefficient = 0.47 if law == "constant" else None
        drag = theory.drag_force(
            velocity, radius, theory.DragLaw(law, 1.3, 2.0e-5, coefficient), wind
        )
        assert columns[:, :3] == pytest.approx(magnetic, rel=1e-12)
        assert columns[:, 3:] == pytest.approx(drag, rel=1e-12)
        assert simulation.per_atom("f") == pytest.approx(magnetic + drag, rel=1e-12, abs=1e-300)


def test_torque_and_contact_forces_are_integrated_as_by_stock_nve_sphere(simulate):
    """Two spheres in frictional contact: without field and medium both integrators are one."""
    particles = make_particles(
        [[0.0, 0, 0], [0.0999, 0.005, 0]],
        velocity=[[1.0, 0, 0], [-1.0, 0.5, 0.2]],
        spin=[[0.0, 0, 30.0], [5.0, 0, -20.0]],
    )
    contact = (
        "comm_modify vel yes\npair_style granular\n"
        "pair_coeff * * hertz/material 1e7 0.3 0.3 tangential mindlin NULL 0.5 0.5 damping tsuji\n"
        "timestep 1e-6\n"
    )
    ends = []
    for style in ("nve/sphere", "nve/sphere/lorentz"):
        simulation = simulate(particles)
        simulation.commands(
            f"{contact}neighbor 0.05 nsq\nneigh_modify every 1 delay 0 check yes\n"
            f"fix integrate all {style}\nrun 3000"
        )
        ends.append(np.hstack([simulation.velocity, simulation.per_atom("omega")]))
    assert np.abs(ends[0][:, 3:] - particles.angular_velocity).max() > 0.1
    assert ends[1] == pytest.approx(ends[0], rel=1e-11)


def test_pulse_gives_equal_speeds_away_from_the_centre_of_mass(simulate):
    rng = np.random.default_rng(7)
    particles = random_cloud(60, seed=7, radius=rng.uniform(0.01, 0.05, 60), velocity=[0, 1.0, 0])
    simulation = simulate(particles)
    simulation.commands("blast_pulse all 250.0")
    gained = simulation.velocity - particles.velocity
    directions = theory.launch_directions(particles.position, particles.mass)
    speed = theory.pulse_speed(250.0, particles.mass.sum())
    assert gained == pytest.approx(speed * directions, rel=1e-11, abs=1e-12)


def test_pulse_of_a_group_leaves_the_rest_alone(simulate):
    particles = random_cloud(10, seed=8)
    simulation = simulate(particles)
    simulation.commands("group chosen id 4:10\nblast_pulse chosen 9.0")
    mass = particles.mass
    assert (simulation.velocity[:3] == 0.0).all()
    energy = 0.5 * np.sum(mass[:, None] * simulation.velocity**2)
    assert energy == pytest.approx(9.0, rel=1e-13)


def test_pulse_launches_a_lone_particle_in_a_direction_of_the_seed(simulate):
    directions = []
    for seed in (1, 1, 2):
        simulation = simulate(make_particles([0.1, 0.2, 0.3]))
        simulation.commands(f"blast_pulse all 2.0 seed {seed}")
        assert simulation.kinetic_energy == pytest.approx(2.0, rel=1e-14)
        directions.append(simulation.velocity[0])
    assert (directions[0] == directions[1]).all()
    assert not np.allclose(directions[0], directions[2])


def test_charges_are_needed_only_in_a_magnetic_field(simulate):
    simulation = simulate(make_particles([0.0, 0, 0]))
    simulation.commands(
        "clear\nunits si\natom_style sphere\nboundary s s s\ncomm_modify cutoff 1.0e-9\n"
        "region r block -1 1 -1 1 -1 1\ncreate_box 1 r\ncreate_atoms 1 single 0 0 0\n"
        "set atom 1 diameter 0.1 density 7000.0 vx 3.0\n"
        "fix integrate all nve/sphere/lorentz drag stokes viscosity 10.0\n"
        "timestep 0.01\nrun 10"
    )
    tau = theory.stokes_time(0.05, 7000.0, 10.0)
    assert simulation.velocity[0, 0] == pytest.approx(3.0 * np.exp(-0.1 / tau), rel=1e-12)


BAD_COMMANDS = {
    "fix f all nve/sphere/lorentz magnetic 1 2": "missing argument",
    "fix f all nve/sphere/lorentz magnetic 1 2 x": "x",
    "fix f all nve/sphere/lorentz magnetic 1 2 nan": "nan",
    "fix f all nve/sphere/lorentz magnetic 1 2 1e999": "1e999",
    "fix f all nve/sphere/lorentz colour blue": "Unknown Fix nve/sphere/lorentz keyword: colour",
    "fix f all nve/sphere/lorentz drag": "missing argument",
    "fix f all nve/sphere/lorentz drag thick": "drag law: thick",
    "fix f all nve/sphere/lorentz drag constant": "missing argument",
    "fix f all nve/sphere/lorentz drag constant -1 density 1": "must not be negative",
    "fix f all nve/sphere/lorentz drag constant 1": "needs the keyword density",
    "fix f all nve/sphere/lorentz drag stokes density 1": "needs the keyword viscosity",
    "fix f all nve/sphere/lorentz drag chow density 0 viscosity 1": "above zero",
    "fix f all lorentz/drag density -1": "must not be negative",
    "compute c all lorentz/drag/atom drag thin": "drag law: thin",
    "blast_pulse all": "missing argument",
    "blast_pulse all 0": "above zero",
    "blast_pulse all nan": "nan",
    "blast_pulse nobody 1": "group nobody",
    "blast_pulse all 1 sead 3": "sead",
    "blast_pulse all 1 seed -3": "must not be negative",
    "blast_pulse all 1 seed": "missing argument",
    "set atom 1 diameter 0.0\nfix f all lorentz/drag\nrun 0": "atom 1 is a point",
    "group g id 1\nfix f all nve/sphere/lorentz\nfix g g lorentz/drag\nrun 0": "remove one of them",
    "fix f all nve/sphere/lorentz\nfix g all lorentz/drag\nrun 0": "remove one of them",
    "fix f all nve/sphere/lorentz\nrun_style respa 2 2\nrun 0": "run_style respa",
}


@pytest.mark.parametrize("command", BAD_COMMANDS)
def test_bad_arguments_are_refused_by_name(simulate, command):
    simulation = simulate(make_particles([0.0, 0, 0]))
    with pytest.raises(Exception, match=re.escape(BAD_COMMANDS[command])):
        simulation.commands(command)


def test_styles_refuse_other_units_and_atom_styles(simulate):
    simulation = simulate(make_particles([0.0, 0, 0]))
    box = "region r block -1 1 -1 1 -1 1\ncreate_box 1 r\n"
    for settings, message in (
        ("units lj\natom_style hybrid sphere charge\n", "requires units si"),
        ("units si\natom_style charge\n", "requires atom attributes radius and rmass"),
        ("units si\natom_style sphere\n", "requires atom attribute q"),
    ):
        for style in ("nve/sphere/lorentz", "lorentz/drag"):
            with pytest.raises(Exception, match=message):
                simulation.commands(f"clear\n{settings}{box}fix f all {style} magnetic 1 0 0")
