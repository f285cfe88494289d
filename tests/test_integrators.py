"""The two integrators against exact motion: orbits, spheroids, energies, orders of convergence."""

import numpy as np
import pytest
from conftest import make_particles, random_cloud

from lammps_blast import theory
from lammps_blast.theory import DragLaw

ENERGY = 1.0e4
AIR = "density 1.225 viscosity 1.8e-5"
OBLIQUE = np.array([3.0, -6.0, 7.0])


def launch(simulation, fields, *, step, duration, electric=None, integrator="lorentz"):
    """Launch a cloud and run it; return its state right after the pulse."""
    if integrator == "lorentz":
        simulation.commands(f"fix integrate all nve/sphere/lorentz {fields}")
    else:
        simulation.commands(f"fix integrate all nve/sphere\nfix external all lorentz/drag {fields}")
    if electric is not None:
        simulation.commands("fix electric all efield {} {} {}".format(*electric))
    simulation.commands(f"timestep {step}\nblast_pulse all {ENERGY}\nrun 0")
    start = simulation.position, simulation.velocity
    simulation.commands(f"run {round(duration / step)}")
    return start


def magnetic(field):
    return "magnetic {} {} {}".format(*field)


@pytest.mark.parametrize("step", [1e-4, 1e-2])
@pytest.mark.parametrize("field", [(10.0, 0.0, 0.0), OBLIQUE], ids=["along x", "oblique"])
@pytest.mark.parametrize("charges", ["one sign", "mixed"])
def test_orbits_in_a_magnetic_field_are_exact_for_any_step(simulate, step, field, charges):
    charge = 10.0 if charges == "one sign" else np.where(np.arange(2000) % 3, 10.0, -10.0)
    particles = random_cloud(2000, seed=1, charge=charge)
    simulation = simulate(particles)
    position, velocity = launch(simulation, magnetic(field), step=step, duration=1.0)
    exact, _ = theory.lorentz_orbit(
        1.0, position, velocity, particles.charge_per_mass, np.zeros(3), np.array(field)
    )
    assert np.linalg.norm(simulation.position - exact, axis=1).max() < 1e-10
    assert simulation.kinetic_energy == pytest.approx(ENERGY, rel=1e-12)
    assert abs(simulation.work()[1]) < 1e-12 * ENERGY


def test_step_far_beyond_a_gyration_is_still_exact(simulate):
    particles = random_cloud(20, seed=2)
    simulation = simulate(particles)
    position, velocity = launch(simulation, magnetic(OBLIQUE), step=0.25, duration=1.0)
    exact, _ = theory.lorentz_orbit(1.0, position, velocity, 10.0, np.zeros(3), OBLIQUE)
    assert np.linalg.norm(simulation.position - exact, axis=1).max() < 1e-12


def test_electric_field_at_an_angle_is_second_order(simulate):
    electric, field = np.array([1.0, -4.0, 2.0]), OBLIQUE / 10
    particles = random_cloud(50, seed=3)
    errors = []
    for step in (0.02, 0.01, 0.005):
        simulation = simulate(particles)
        position, velocity = launch(
            simulation, magnetic(field), step=step, duration=0.6, electric=electric
        )
        exact, _ = theory.lorentz_orbit(0.6, position, velocity, 10.0, electric, field)
        errors.append(np.linalg.norm(simulation.position - exact, axis=1).max())
    assert errors[0] > 1e-6
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2.0, 2.0], abs=0.05)


DRAG_LAWS = {
    "constant": ("drag constant 0.7 density 300.0", DragLaw("constant", 300.0, 0.0, 0.7)),
    "chow": ("drag chow density 900.0 viscosity 4.0", DragLaw("chow", 900.0, 4.0)),
    "stokes": ("drag stokes viscosity 30.0", DragLaw("stokes", 0.0, 30.0)),
}


def semi_axis_errors(simulation, particles, start, field, duration, drag):
    """Return how far the fitted launch map is from theory, in units of the envelope's radius."""
    position, velocity = start
    mass = theory.sphere_mass(0.05, 7000.0)
    speed = theory.pulse_speed(ENERGY, particles.mass.sum())
    frequency = theory.cyclotron_frequency(10.0, field)
    parallel, perpendicular = theory.launch_displacement(
        duration, speed, frequency, radius=0.05, mass=mass, drag=drag
    )
    exact = theory.spheroid_semi_axes(1.0, parallel, perpendicular)
    axis = field / np.linalg.norm(field)
    moved, direction = simulation.position - position, velocity / speed
    measured_parallel = np.dot(moved @ axis, direction @ axis) / np.sum((direction @ axis) ** 2)
    first = np.cross(axis, [0.0, 0.0, 1.0]) / np.linalg.norm(np.cross(axis, [0.0, 0.0, 1.0]))
    second = np.cross(axis, first)
    across = direction @ first + 1j * (direction @ second)
    moved_across = moved @ first + 1j * (moved @ second)
    measured_across = np.vdot(across, moved_across) / np.vdot(across, across)
    measured = theory.spheroid_semi_axes(1.0, measured_parallel, measured_across)
    return np.abs(np.subtract(measured, exact)) / max(exact)


@pytest.mark.parametrize("law", DRAG_LAWS)
def test_spheroid_under_drag_is_second_order_and_accurate(simulate, law):
    keywords, drag = DRAG_LAWS[law]
    particles = random_cloud(200, seed=4)
    field = OBLIQUE / 4
    errors = []
    for step in (0.02, 0.01, 0.005, 1e-4):
        simulation = simulate(particles)
        start = launch(simulation, f"{magnetic(field)} {keywords}", step=step, duration=0.4)
        errors.append(semi_axis_errors(simulation, particles, start, field, 0.4, drag).max())
    assert errors[-1] < 1e-6
    orders = np.log2(np.divide(errors[:-2], errors[1:-1]))
    assert orders == pytest.approx([2.0, 2.0], abs=0.1)


@pytest.mark.parametrize("law", DRAG_LAWS)
@pytest.mark.parametrize("step", [0.5, 1e-3])
def test_drag_alone_is_exact_for_any_step(simulate, law, step):
    keywords, drag = DRAG_LAWS[law]
    particles = make_particles([[0.0, 0, 0], [1, 0, 0]], velocity=[[6.0, 2.0, 3.0], [0.0, 0, 0]])
    simulation = simulate(particles)
    simulation.commands(
        f"fix integrate all nve/sphere/lorentz {keywords}\ntimestep {step}\nrun {round(1 / step)}"
    )
    speed = np.linalg.norm(simulation.velocity, axis=1)
    exact = theory.speed_history(1.0, 7.0, radius=0.05, mass=particles.mass[0], drag=drag)
    assert speed[0] == pytest.approx(float(exact), rel=1e-11)
    assert speed[1] == 0.0


@pytest.mark.parametrize(
    ("keywords", "drag"),
    [
        ("drag stokes viscosity 1.8e-5", DragLaw("stokes", 0.0, 1.8e-5)),
        (f"drag constant 0.5 {AIR}", DragLaw("constant", 1.225, 0.0, 0.5)),
        (f"drag chow {AIR}", DragLaw("chow", 1.225, 1.8e-5)),
    ],
    ids=["stokes", "constant", "chow"],
)
def test_tiny_losses_of_many_steps_add_up(simulate, keywords, drag):
    """Each step's loss is right to the rounding of the velocity that it is taken from."""
    step, steps, speed = 1e-5, 20000, 1.6518
    particles = make_particles([0.0, 0, 0], velocity=[speed, 0, 0])
    simulation = simulate(particles)
    simulation.commands(
        f"fix integrate all nve/sphere/lorentz {keywords}\ntimestep {step}\nrun {steps}"
    )
    exact = theory.speed_history(
        step * steps, speed, radius=0.05, mass=particles.mass[0], drag=drag
    )
    lost = speed - float(exact)
    rounding = 0.5 * np.spacing(speed) / (0.5 * lost / steps)
    assert speed - simulation.velocity[0, 0] == pytest.approx(lost, rel=rounding)
    loss = 0.5 * particles.mass[0] * (speed**2 - float(exact) ** 2)
    assert -simulation.work()[0] == pytest.approx(loss, rel=rounding)


@pytest.mark.parametrize("law", ["constant 0.5", "chow", "stokes"])
def test_drag_that_takes_nearly_all_at_once_leaves_the_right_rest(simulate, law):
    particles = make_particles([0.0, 0, 0], velocity=[0.0, 1.0e8, 0.0])
    simulation = simulate(particles)
    simulation.commands(
        f"fix integrate all nve/sphere/lorentz drag {law} density 1.225 viscosity 1.0\n"
        "timestep 1.0e3\nrun 1"
    )
    kind, *coefficient = law.split()
    drag = DragLaw(kind, 1.225, 1.0, *map(float, coefficient))
    exact = theory.speed_history(1e3, 1e8, radius=0.05, mass=particles.mass[0], drag=drag)
    assert simulation.velocity[0, 1] == pytest.approx(float(exact), rel=1e-9)


def test_chow_drag_crosses_every_branch_of_its_fit_exactly(simulate):
    """A launch at Re = 5e6 that ends below Re = 1, in a medium made for it."""
    drag = DragLaw("chow", 1000.0, 1.0)
    start = 5e6 * drag.viscosity / (2 * 0.05 * drag.density)
    particles = make_particles([0.0, 0, 0], velocity=[0.0, 0.0, start], density=2000.0)
    ends = []
    for duration in (1e-5, 1e-3, 0.1, 10.0, 60.0):
        simulation = simulate(particles)
        simulation.commands(
            "fix integrate all nve/sphere/lorentz drag chow density 1000.0 viscosity 1.0\n"
            f"timestep {duration / 4}\nrun 4"
        )
        exact = theory.speed_history(
            duration, start, radius=0.05, mass=particles.mass[0], drag=drag
        )
        ends.append(simulation.velocity[0, 2])
        assert ends[-1] == pytest.approx(float(exact), rel=1e-10)
    reynolds = theory.reynolds_number(np.array(ends), 0.05, drag.density, drag.viscosity)
    assert reynolds[0] > 2e6
    assert reynolds[-1] < 1.0


def test_motion_is_the_same_in_a_moving_frame(simulate):
    """Without a field only the velocity relative to the medium counts (Galilean invariance)."""
    wind, keywords = np.array([3.0, -1.0, 2.0]), f"drag chow {AIR.replace('1.225', '500.0')}"
    cloud = random_cloud(30, seed=5)
    velocity = np.random.default_rng(6).normal(size=(30, 3))
    ends = []
    for frame in (np.zeros(3), wind):
        simulation = simulate(make_particles(cloud.position, velocity=velocity + frame))
        simulation.commands(
            "fix integrate all nve/sphere/lorentz {} velocity {} {} {}".format(keywords, *frame)
            + "\ntimestep 1e-3\nrun 500"
        )
        ends.append((simulation.position - 0.5 * frame, simulation.velocity - frame))
    assert ends[1][0] == pytest.approx(ends[0][0], abs=1e-12)
    assert ends[1][1] == pytest.approx(ends[0][1], abs=1e-12)


def test_motion_turns_with_the_whole_scene(simulate):
    angle = 0.7
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]]
    ) @ np.array([[1, 0, 0], [0, 0.6, -0.8], [0, 0.8, 0.6]])
    cloud = random_cloud(40, seed=7)
    wind, field, electric = np.array([0.4, 0.1, -0.3]), np.array([2.0, 1.0, 0.5]), [0.3, 0.2, -1]
    ends = []
    for rotation in (np.eye(3), turn):
        simulation = simulate(make_particles(cloud.position @ rotation.T))
        fields = "{} drag chow density 500.0 viscosity 0.1 velocity {} {} {}".format(
            magnetic(rotation @ field), *(rotation @ wind)
        )
        launch(simulation, fields, step=1e-3, duration=0.3, electric=rotation @ electric)
        ends.append(simulation.position @ rotation)
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)


@pytest.mark.parametrize("step", [1e-4, 5e-5])
def test_force_on_half_step_velocity_pumps_energy_as_the_explicit_scheme_does(simulate, step):
    """Finding of the section-6 scheme: gyration energy grows by 1 + omega^2 dt^2 a step."""
    particles = random_cloud(500, seed=8)
    simulation = simulate(particles)
    _, velocity = launch(
        simulation, magnetic((10.0, 0, 0)), step=step, duration=1.0, integrator="verlet"
    )
    across = np.sum(velocity[:, 1:] ** 2) / np.sum(velocity**2)
    growth = (1.0 + (100.0 * step) ** 2) ** (1.0 / step)
    expected = ENERGY * (1.0 - across + across * growth)
    assert simulation.kinetic_energy == pytest.approx(expected, rel=1e-3)
    # The ledger blames the magnetic force of the discrete motion, to rounding.
    gain = simulation.kinetic_energy - ENERGY
    assert simulation.work("external")[1] == pytest.approx(gain, rel=1e-11)


def test_verlet_converges_to_the_same_motion_at_first_order(simulate):
    """Its forces see the velocity of half a step ago, which costs it an order."""
    particles = random_cloud(30, seed=9)
    fields = f"{magnetic((1.0, 0.5, 0))} drag constant 0.5 density 200.0"
    simulation = simulate(particles)
    launch(simulation, fields, step=1e-5, duration=0.1)
    reference = simulation.position
    errors = []
    for step in (2e-4, 1e-4, 5e-5):
        simulation = simulate(particles)
        launch(simulation, fields, step=step, duration=0.1, integrator="verlet")
        errors.append(np.abs(simulation.position - reference).max())
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([1.0, 1.0], abs=0.05)


@pytest.mark.parametrize("integrator", ["lorentz", "verlet"])
def test_work_accounts_for_every_joule(simulate, integrator):
    simulation = simulate(random_cloud(100, seed=10))
    fields = f"{magnetic(OBLIQUE)} drag chow density 400.0 viscosity 0.3 velocity 1.0 0.0 0.5"
    launch(simulation, fields, step=1e-3, duration=0.2, integrator=integrator)
    work = simulation.work("integrate" if integrator == "lorentz" else "external")
    assert work[0] < -0.1 * ENERGY
    assert ENERGY + work.sum() == pytest.approx(simulation.kinetic_energy, rel=1e-12)
