"""Fix nve/implicit against an independent implementation of section 8, and against exact motion."""

import re
import shutil
from dataclasses import dataclass, field, replace
from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from conftest import SYSTEM, lmp, make_particles
from test_fix_blast_losses import colliding_cloud
from test_pair_blast_contact import Law, evaluate

from lammps_blast.deck import write_particle_data
from lammps_blast.theory import DragLaw, drag_resistance, trapezoid_gyration_gain

ROUNDING = 1e-9  # by which a step may miss the end of an interval and still be taken for whole


NO_DRAG = DragLaw()


@dataclass(frozen=True)
class Scheme:
    """Arguments of the fix, spelled out."""

    phi: float = 0.5
    iterations: int = 10
    tolerance: float = 5e-4
    first_step: float = 1e-5
    max_step: float = 2.5e-4
    safety: float = 1.0
    solved: bool = False
    anderson: int = 0

    @property
    def words(self):
        words = f"phi {self.phi!r} iterations {self.iterations} tolerance {self.tolerance!r}"
        words += f" first_step {self.first_step!r} max_step {self.max_step!r}"
        words += f" safety {self.safety!r}"
        return words + f" fields {'solved' if self.solved else 'iterated'} anderson {self.anderson}"


@dataclass(frozen=True)
class Scene:
    """What acts on some particles; contact, near field and medium may be missing."""

    law: Law | None = None
    rotation: bool = True
    near_field: tuple[float, float, float, float] | None = None
    electric: tuple[float, float, float] = (0.0, 0.0, 0.0)
    magnetic: tuple[float, float, float] = (0.0, 0.0, 0.0)
    drag: DragLaw = NO_DRAG
    wind: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def pair_commands(self):
        styles, coefficients = [], []
        if self.law:
            styles.append(f"blast/contact rotation {'yes' if self.rotation else 'no'}")
            coefficients.append(f"blast/contact {self.law.words}")
        if self.near_field:
            styles.append("blast/nearfield all mass")
            coefficients.append("blast/nearfield {!r} {!r} {!r} {!r}".format(*self.near_field))
        if not styles:
            return ""
        lines = [f"pair_style hybrid/overlay {' '.join(styles)}"]
        return "\n".join([*lines, *(f"pair_coeff * * {words}" for words in coefficients)])

    @property
    def external_words(self):
        words = "magnetic {!r} {!r} {!r}".format(*self.magnetic)
        if self.drag.kind != "none":
            coefficient = self.drag.coefficient if self.drag.kind == "constant" else ""
            words += f" drag {self.drag.kind} {coefficient} density {self.drag.density!r}"
            words += f" viscosity {float(self.drag.viscosity)!r}"
            words += " velocity {!r} {!r} {!r}".format(*self.wind)
        return words


@dataclass
class Reference:
    """Section 8 and its decisions, in numpy, for a handful of particles."""

    scene: Scene
    scheme: Scheme
    particles: object
    bonds: set = field(default_factory=set)
    rows: list = field(default_factory=list)  # (step, K, error, restarts, evaluations)
    restarts: int = 0
    evaluations: int = 0

    def __post_init__(self):
        p = self.particles
        self.x, self.v, self.w = p.position.copy(), p.velocity.copy(), p.angular_velocity.copy()
        self.mass, self.inertia = p.mass[:, None], (0.4 * p.mass * p.radius**2)[:, None]
        self.adapted = self.scheme.first_step
        self.start = self.evaluate(self.x, self.v, self.w, self.adapted, commits=True)

    def evaluate(self, x, v, w, step, *, commits=False):
        """Return force without fields, torque, drag and magnetic force of every particle."""
        self.evaluations += 1
        force, torque = self.pair_forces(x, v, w, step, commits)
        scene, p = self.scene, self.particles
        force += p.charge[:, None] * np.array(scene.electric)
        relative = np.array(scene.wind) - v
        drag = np.zeros_like(force)
        if scene.drag.kind != "none":
            speed = np.linalg.norm(relative, axis=1)
            drag = drag_resistance(speed, p.radius, scene.drag)[:, None] * relative
        magnetic = p.charge[:, None] * np.cross(v, scene.magnetic)
        return force, torque, drag, magnetic

    def pair_forces(self, x, v, w, step, commits):
        force, torque = np.zeros_like(x), np.zeros_like(x)
        p, scene = self.particles, self.scene
        for i in range(len(p)):
            for j in range(i + 1, len(p)):
                offset = x[j] - x[i]
                distance = np.linalg.norm(offset)
                if scene.near_field:
                    a, m, b, n = scene.near_field
                    size = p.mass[i] * p.mass[j] * (a * distance**-m - b * distance**-n)
                    force[i] += size / distance * offset
                    force[j] -= size / distance * offset
                if scene.law is None:
                    continue
                touching = distance <= p.radius[i] + p.radius[j]
                if not touching:
                    if commits:
                        self.bonds.discard((i, j))
                    continue
                law = scene.law
                if (i, j) in self.bonds and law.memory == "contact":
                    law = replace(law, bond=(law.bond[0], law.bond[1], 1e-300, law.bond[3]))
                pair = [np.array([[a[i], a[j]]]) for a in (x, v, w)]
                radii = np.array([[p.radius[i], p.radius[j]]])
                contact = evaluate(law, *pair, radii, scene.rotation, step)
                if commits and scene.law.bond[2] and contact.strain[0] >= scene.law.bond[2]:
                    self.bonds.add((i, j))
                force[i] += contact.force[0].astype(float)
                force[j] -= contact.force[0].astype(float)
                torque[i] += contact.torques[0][0].astype(float)
                torque[j] += contact.torques[1][0].astype(float)
        return force, torque

    def corrected(self, now, v, h):
        """Return x, v, w at the end of a step from the forces at a tried state of velocity v."""
        phi = self.scheme.phi
        (force, torque, drag, magnetic), begin = now, self.start
        old = begin[0] + begin[2] + begin[3]
        if not self.scheme.solved:
            new = force + drag + magnetic
            velocity = self.v + h / self.mass * (phi * new + (1 - phi) * old)
        else:
            velocity = self.solved_velocity(force, old, v, h)
        position = self.x + h * (phi * velocity + (1 - phi) * self.v)
        spin = self.w + h / self.inertia * (phi * torque + (1 - phi) * begin[1])
        return position, velocity, spin

    def solved_velocity(self, force, old, v, h):
        scene, p, phi = self.scene, self.particles, self.scheme.phi
        bx, by, bz = scene.magnetic
        turn = np.array([[0, bz, -by], [-bz, 0, bx], [by, -bx, 0]])  # v x B
        velocity = np.empty_like(v)
        wind = np.array(scene.wind)
        for i in range(len(p)):
            speed = np.linalg.norm(v[i] - wind)
            c = float(drag_resistance(speed, p.radius[i], scene.drag))
            m = p.mass[i]
            matrix = np.eye(3) * (1 + phi * h * c / m) - phi * h * p.charge[i] / m * turn
            right = self.v[i] + h / m * (phi * (force[i] + c * wind) + (1 - phi) * old[i])
            velocity[i] = np.linalg.solve(matrix, right)
        return velocity

    def mixed(self, history, h):
        """Return the last iterate, mixed with up to `anderson` differences before it."""
        position, velocity, spin = history[-1][0]
        weight = np.sqrt(np.concatenate([np.repeat(self.mass, 3), np.repeat(self.inertia, 3)]))
        images = [np.concatenate([g[1].ravel(), g[2].ravel()]) for g, _ in history]
        tried = [np.concatenate([y[1].ravel(), y[2].ravel()]) for _, y in history]
        residuals = [weight * (g - y) for g, y in zip(images, tried, strict=True)]
        depth = min(self.scheme.anderson, len(history) - 1)
        if depth == 0:
            return position, velocity, spin
        of_images = np.diff(images[-depth - 1 :], axis=0).T
        of_residuals = np.diff(residuals[-depth - 1 :], axis=0).T
        coefficients = np.linalg.lstsq(of_residuals, residuals[-1], rcond=1e-10)[0]
        mixture = images[-1] - of_images @ coefficients
        velocity, spin = mixture[: velocity.size], mixture[velocity.size :]
        velocity, spin = velocity.reshape(-1, 3), spin.reshape(-1, 3)
        phi = self.scheme.phi
        return self.x + h * (phi * velocity + (1 - phi) * self.v), velocity, spin

    def attempt(self, h):
        """Return K, the error and the state it ends with; None for a state not converged."""
        tried = self.corrected(self.start, self.v, h)
        if self.scheme.phi == 0:
            return 1, 0.0, tried
        history = []
        for corrections in range(1, self.scheme.iterations + 1):
            now = self.evaluate(*tried, h)
            result = self.corrected(now, tried[1], h)
            moved = np.linalg.norm(result[0] - tried[0], axis=1).sum()
            error = moved / np.linalg.norm(result[0] - self.x, axis=1).sum() if moved else 0.0
            if error <= self.scheme.tolerance * (1 + 1e-6):
                return corrections, error, result
            if corrections < self.scheme.iterations:
                history.append((result, tried))
                tried = self.mixed(history, h)
        return corrections, error, None

    def factor(self, error, corrections):
        scheme = self.scheme
        wanted = scheme.tolerance ** (1 / (2 * scheme.iterations))
        found = error ** (1 / (2 * corrections))
        return min(max(scheme.safety * wanted / found, 0.1), 10.0)

    def cross_interval(self, left):
        while True:
            h = min(self.adapted, left)
            if h > (1 - ROUNDING) * left:
                h = left
            cut = h < (1 - ROUNDING) * self.adapted
            corrections, error, state = self.attempt(h)
            if state is None:
                self.restarts += 1
                self.adapted = h * self.factor(error, corrections)
                continue
            self.x, self.v, self.w = state
            self.rows.append((h, corrections, error, self.restarts, self.evaluations))
            if not cut:
                longest = self.scheme.max_step
                grown = h * self.factor(error, corrections) if error else longest
                self.adapted = min(grown, longest)
            self.start = self.evaluate(*state, h, commits=True)
            if h == left:
                return
            left -= h


def reference_run(scene, scheme, particles, interval, intervals):
    run = Reference(scene, scheme, particles)
    for _ in range(intervals):
        run.cross_interval(interval)
    return run


# The skin is wide enough for any step.
SYSTEM_OF_PAIRS = """
neighbor 0.5 nsq
neigh_modify every 1 delay 0 check yes
comm_modify cutoff 0.0 vel yes
"""


def start_simulation(simulate, scene, scheme, particles, interval, more=""):
    simulation = simulate(particles)
    simulation.commands(f"""
        {SYSTEM_OF_PAIRS}
        timestep {interval!r}
        {scene.pair_commands}
        {more}
        fix integrate all nve/implicit {scheme.words} {scene.external_words} file steps.csv
    """)
    if any(scene.electric):
        simulation.commands("fix electric all efield {!r} {!r} {!r}".format(*scene.electric))
    return simulation


def steps_of(folder):
    """Return the columns of a step history."""
    table = np.genfromtxt(folder / "steps.csv", delimiter=",", names=True)
    return {name: np.atleast_1d(table[name]) for name in table.dtype.names}


def colliding_particles(count=6):
    """Return a handful of turning, charged spheres of unequal sizes that rush together."""
    rng = np.random.default_rng(3)
    position = rng.uniform(-0.09, 0.09, (count, 3))
    return make_particles(
        position,
        velocity=rng.normal(size=(count, 3)) - 10 * position,
        spin=5 * rng.normal(size=(count, 3)),
        radius=0.05 * np.exp(rng.uniform(-0.2, 0.2, count)),
        charge=rng.choice([-10.0, 10.0], count),
    )


BONDING = Law(damping=1e5, friction=(1e7, 0.4, 0.3), bond=(1e6, 1.0, 0.05, 1e3))
ELASTIC = Scene(law=Law(stiffness=1e8), rotation=False)
ATTRACTING = Scene(near_field=(0.5, 1.0, 0.01, 2.0))
EVERYTHING = Scene(
    law=BONDING,
    near_field=(0.5, 1.0, 0.01, 2.0),
    electric=(1.0, -2.0, 0.5),
    magnetic=(3.0, -6.0, 7.0),
    drag=DragLaw("chow", 400.0, 0.3),
    wind=(1.0, 0.0, 0.5),
)
FREE_FLIGHT = Scene(magnetic=(3.0, -6.0, 7.0), drag=DragLaw("constant", 300.0, 0.0, 0.7))
LONG = {"max_step": 1e-2}

RUNS = {
    "the paper's scheme": (EVERYTHING, Scheme()),
    "restarts by contact": (ELASTIC, Scheme(iterations=3, tolerance=1e-4, **LONG)),
    "restarts by attraction": (ATTRACTING, Scheme(iterations=2, tolerance=1e-3, **LONG)),
    "restarts by everything": (EVERYTHING, Scheme(iterations=3, tolerance=1e-4, **LONG)),
    "bonds without memory": (
        replace(EVERYTHING, law=replace(BONDING, memory="none")),
        Scheme(iterations=4, tolerance=1e-5, **LONG),
    ),
    "safety": (EVERYTHING, Scheme(iterations=4, tolerance=1e-5, safety=0.9, **LONG)),
    "explicit": (EVERYTHING, Scheme(phi=0.0, max_step=1e-3)),
    "a third": (EVERYTHING, Scheme(phi=0.3, iterations=6, tolerance=1e-6, max_step=1e-3)),
    "implicit": (EVERYTHING, Scheme(phi=1.0, iterations=6, tolerance=1e-5, max_step=1e-3)),
    "solved fields": (
        EVERYTHING, Scheme(iterations=4, tolerance=1e-5, solved=True, safety=0.9, **LONG),
    ),
    "Anderson": (EVERYTHING, Scheme(tolerance=1e-5, anderson=2, safety=0.9, **LONG)),
    "both": (EVERYTHING, Scheme(tolerance=1e-5, anderson=3, solved=True, safety=0.9, **LONG)),
    "field and drag": (FREE_FLIGHT, Scheme(iterations=4, tolerance=1e-6, **LONG)),
}  # fmt: skip


@cache
def reference_of(name):
    return reference_run(*RUNS[name], colliding_particles(), interval=0.01, intervals=4)


@pytest.mark.parametrize("name", RUNS)
def test_steps_and_states_are_those_of_an_independent_implementation(simulate, tmp_path, name):
    scene, scheme = RUNS[name]
    run = reference_of(name)
    simulation = start_simulation(simulate, scene, scheme, colliding_particles(), interval=0.01)
    simulation.commands("run 4")
    steps = steps_of(tmp_path / "simulation0")
    step, corrections, error, restarts, evaluations = np.array(run.rows).T
    assert len(steps["step"]) == len(step)
    np.testing.assert_array_equal(steps["corrections"], corrections)
    np.testing.assert_array_equal(steps["restarts"], restarts)
    np.testing.assert_array_equal(steps["evaluations"], evaluations)
    # An error is a small difference of positions: what is left of it is less exact than they are.
    assert steps["step"] == pytest.approx(step, rel=1e-6)
    assert steps["error"] == pytest.approx(error, rel=1e-3)
    assert simulation.position == pytest.approx(run.x, abs=1e-10)
    assert simulation.velocity == pytest.approx(run.v, abs=1e-8)
    assert simulation.per_atom("omega") == pytest.approx(run.w, abs=1e-7)
    if scene.law and scene.law.bond[2] and scene.law.memory == "contact":
        simulation.commands("compute pair all pair blast/contact\nrun 0")
        assert simulation.lammps.extract_compute("pair", 0, 1)[3] == len(run.bonds) > 0


def test_the_runs_with_a_reference_reach_every_branch():
    restarts = [reference_of(name).restarts for name in RUNS]
    corrections = {row[1] for name in RUNS for row in reference_of(name).rows}
    assert sum(count > 0 for count in restarts) >= 4
    assert corrections >= {1, 2, 3, 4, 5, 6, 7, 8}


# --- order, and exact solutions of the discrete equations -----------------------------------


def fixed(step, **scheme):
    """Return a scheme of equal steps, solved as well as can be."""
    return Scheme(iterations=100, tolerance=1e-14, first_step=step, max_step=step, **scheme)


def state(simulation):
    return np.concatenate([simulation.position, simulation.velocity, simulation.per_atom("omega")])


SMOOTH = Scene(
    law=Law(stiffness=3e7, exponent=2.0, damping=2e4),
    near_field=(0.5, 1.0, 0.01, 2.0),
    electric=(1.0, -2.0, 0.5),
    magnetic=(3.0, -6.0, 7.0),
    drag=DragLaw("stokes", 0.0, 30.0),
)


@pytest.mark.parametrize(("phi", "order"), [(0.5, 2), (0.0, 1), (0.3, 1), (1.0, 1)])
@pytest.mark.parametrize("solved", [False, True])
def test_order_of_convergence(simulate, phi, order, solved):
    particles = colliding_particles()
    ends = []
    for step in (1e-4, 5e-5, 2.5e-5, 1.25e-5):
        scheme = fixed(step, phi=phi, solved=solved)
        simulation = start_simulation(simulate, SMOOTH, scheme, particles, interval=0.02)
        simulation.commands("run 1")
        ends.append(state(simulation))
    changes = [np.abs(a - b).max() for a, b in pairwise(ends)]
    assert np.log2(np.divide(changes[:-1], changes[1:])) == pytest.approx([order] * 2, abs=0.1)


def test_small_steps_agree_with_the_structure_preserving_integrator(simulate):
    particles = colliding_particles()
    simulation = simulate(particles)
    electric = "{!r} {!r} {!r}".format(*SMOOTH.electric)
    simulation.commands(f"""
        {SYSTEM_OF_PAIRS}
        timestep 1.0e-7
        {SMOOTH.pair_commands}
        fix integrate all nve/sphere/lorentz {SMOOTH.external_words}
        fix electric all efield {electric}
        run 200000
    """)
    expected = state(simulation)
    errors = []
    for step in (4e-5, 2e-5):
        simulation = start_simulation(simulate, SMOOTH, fixed(step), particles, interval=0.02)
        simulation.commands("run 1")
        errors.append(np.abs(state(simulation) - expected).max())
    assert errors[1] < 2e-4
    assert np.log2(errors[0] / errors[1]) == pytest.approx(2, abs=0.1)


@pytest.mark.parametrize("solved", [False, True])
def test_trapezoid_turns_velocities_by_its_own_angle_and_keeps_their_energy(simulate, solved):
    """At phi = 1/2 a step turns by 2 atan(omega dt/2): exactly, and without any magnetic work."""
    step, steps, field_strength = 0.01, 50, 10.0
    particles = make_particles([0.0, 0, 0], velocity=[0.6, 1.0, 0.0])
    scene = Scene(magnetic=(field_strength, 0.0, 0.0))
    scheme = replace(fixed(step), solved=solved, iterations=200)
    simulation = start_simulation(simulate, scene, scheme, particles, interval=step * steps)
    simulation.commands("run 1")
    angle = 2 * steps * np.arctan(10.0 * field_strength * step / 2)
    expected = [0.6, np.cos(angle), -np.sin(angle)]
    assert simulation.velocity[0] == pytest.approx(expected, abs=1e-12)
    assert abs(simulation.work()[1]) < 1e-12 * simulation.kinetic_energy
    assert simulation.position[0, 0] == pytest.approx(0.6 * step * steps, rel=1e-14)


@pytest.mark.parametrize("phi", [0.0, 0.45, 0.6, 1.0])
def test_other_phi_multiply_the_energy_of_gyration_as_theory_says(simulate, phi):
    step, steps = 0.004, 50
    particles = make_particles([0.0, 0, 0], velocity=[0.0, 1.0, 0.0])
    scene = Scene(magnetic=(10.0, 0.0, 0.0))
    scheme = replace(fixed(step, phi=phi), solved=True)
    simulation = start_simulation(simulate, scene, scheme, particles, interval=step * steps)
    simulation.commands("run 1")
    gain = trapezoid_gyration_gain(phi, 100.0 * step) ** steps
    assert np.sum(simulation.velocity**2) == pytest.approx(gain, rel=1e-11)


def test_solved_fields_converge_where_iterated_ones_cannot(simulate, tmp_path):
    """The plain iteration contracts by omega dt/2, here 2: it has to shorten the step."""
    particles = make_particles([0.0, 0, 0], velocity=[0.6, 1.0, 0.0])
    scene = Scene(magnetic=(10.0, 0.0, 0.0))
    for solved, longest, shortest in ((True, 0.04, 0.04), (False, 0.02, 0.0)):
        scheme = Scheme(first_step=0.04, max_step=0.04, solved=solved, iterations=4)
        simulation = start_simulation(simulate, scene, scheme, particles, interval=0.4)
        simulation.commands("run 1")
        step = steps_of(simulation.folder)["step"]
        assert shortest <= step.min() * (1 + 1e-9)
        assert step.max() <= longest * (1 + 1e-9)


def test_drag_that_is_solved_for_has_its_closed_form(simulate):
    """Under Stokes's law phi = 1 divides the velocity by 1 + dt/tau a step, for any step."""
    step, steps, tau = 0.5, 10, 0.1
    particles = make_particles([0.0, 0, 0], velocity=[3.0, -2.0, 6.0])
    viscosity = particles.mass[0] / (6 * np.pi * 0.05 * tau)
    scene = Scene(drag=DragLaw("stokes", 0.0, viscosity))
    scheme = replace(fixed(step, phi=1.0), solved=True)
    simulation = start_simulation(simulate, scene, scheme, particles, interval=step * steps)
    energy = simulation.kinetic_energy
    simulation.commands("run 1")
    assert simulation.velocity[0] == pytest.approx(
        np.array([3.0, -2.0, 6.0]) / (1 + step / tau) ** steps, rel=1e-12
    )
    assert simulation.kinetic_energy - energy == pytest.approx(simulation.work()[0], rel=1e-12)


# --- conservation ---------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", [Scheme(), Scheme(tolerance=1e-8, anderson=3, max_step=1e-3)])
def test_momentum_and_angular_momentum_are_conserved_however_well_it_is_solved(simulate, scheme):
    """Third law: any weighted sum of evaluations conserves momentum; with rotation also the other.

    The angular one to the error of the discrete motion, which turns lever arms in a step.
    """
    scene = Scene(law=BONDING, near_field=(0.5, 1.0, 0.01, 2.0))
    particles = colliding_particles(12)
    simulation = start_simulation(simulate, scene, scheme, particles, interval=0.02)
    mass = particles.mass[:, None]

    def momentum():
        return (mass * simulation.velocity).sum(axis=0)

    size = (particles.mass * np.linalg.norm(particles.velocity, axis=1)).sum()
    before = momentum()
    simulation.commands("run 2")
    assert np.abs(momentum() - before).max() < 1e-14 * size


def test_ledger_of_conservative_forces_is_second_order(simulate):
    scene = Scene(law=Law(stiffness=3e7, exponent=1.5), near_field=(0.5, 1.0, 0.01, 2.0))
    particles = colliding_particles()
    errors = []
    for step in (2e-4, 1e-4, 5e-5):
        simulation = start_simulation(simulate, scene, fixed(step), particles, interval=0.02)
        simulation.commands("thermo_style custom step ke pe\nrun 0 post no")
        total = energy_of(simulation)
        simulation.commands("run 1")
        errors.append(abs(energy_of(simulation) - total))
    assert errors[-1] < 1e-3 * total
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2], abs=0.2)


def energy_of(simulation):
    return sum(simulation.lammps.get_thermo(name) for name in ("ke", "pe"))


def test_ledger_with_bonds_that_form_is_second_order(simulate):
    """Damping, friction and the heat of bonds included, and what new bonds do on the way there."""
    scene = Scene(law=BONDING, near_field=(0.5, 1.0, 0.01, 2.0))
    errors = []
    for step in (4e-5, 2e-5, 1e-5):
        simulation = start_simulation(
            simulate, scene, fixed(step), colliding_particles(), 0.02,
            "fix losses all blast/losses\ncompute turning all erotate/sphere",
        )  # fmt: skip
        simulation.commands("thermo_style custom step ke pe c_turning\nrun 0 post no")
        lammps = simulation.lammps

        def total(simulation=simulation, lammps=lammps):
            lost = sum(lammps.extract_fix("losses", 0, 1, channel) for channel in range(4))
            return energy_of(simulation) + lammps.extract_compute("turning", 0, 0) + lost

        before = total()
        simulation.commands("run 2")
        errors.append(abs(total() - before))
    assert lammps.extract_fix("losses", 0, 1, 3) > 0.1
    assert errors[-1] < 5e-4
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx([2, 2], abs=0.1)


@pytest.mark.parametrize(
    ("phi", "solved", "anderson"),
    [(0.5, False, 0), (0.5, False, 2), (1.0, False, 0), (1.0, True, 2), (0.3, True, 0)],
)
def test_every_joule_of_a_loosely_solved_run_has_its_account(simulate, phi, solved, anderson):
    """The work of each force in the discrete motion, summed, is the change of kinetic energy.

    That of the electric field is taken from its potential, which is the same thing at phi = 1/2.
    """
    scene = EVERYTHING if phi == 0.5 else replace(EVERYTHING, electric=(0.0, 0.0, 0.0))
    scheme = Scheme(phi=phi, tolerance=1e-2, max_step=2e-3, anderson=anderson, solved=solved)
    simulation = start_simulation(
        simulate, scene, scheme, colliding_particles(), 0.02,
        "fix losses all blast/losses work yes\ncompute turning all erotate/sphere",
    )  # fmt: skip
    simulation.commands("thermo_style custom step ke pe c_turning\nrun 0 post no")
    lammps = simulation.lammps

    def accounts():
        kinetic = lammps.get_thermo("ke") + lammps.extract_compute("turning", 0, 0)
        pair_work = lammps.extract_fix("losses", 0, 1, 4)
        electric_work = -lammps.extract_fix("electric", 0, 0) if any(scene.electric) else 0.0
        return kinetic, pair_work + electric_work + simulation.work().sum()

    kinetic, work = accounts()
    simulation.commands("run 2")
    kinetic_later, work_later = accounts()
    assert abs(kinetic_later - kinetic) > 0.05 * kinetic
    assert kinetic_later - kinetic == pytest.approx(work_later - work, abs=1e-12 * kinetic)


# --- within LAMMPS: intervals, lists, bonds, ranks, restarts -----------------------------------


def test_steps_are_cut_to_hit_intervals_and_grow_on_as_if_they_were_not(simulate):
    """0.3 ms steps in intervals of 1 ms: three whole ones and a short one, again and again."""
    scheme = Scheme(first_step=1e-4, max_step=3e-4)
    simulation = start_simulation(
        simulate, ATTRACTING, scheme, colliding_particles(), interval=1e-3
    )
    simulation.commands("run 5")
    steps = steps_of(simulation.folder)
    whole = np.arange(1, 6) * 1e-3
    hit = np.abs(steps["time"][:, None] - whole).min(axis=0)
    assert hit.max() < 1e-15
    np.testing.assert_allclose(steps["step"][:5], [1e-4, 3e-4, 3e-4, 3e-4, 3e-4])
    np.testing.assert_allclose(steps["step"][-4:], [3e-4, 3e-4, 3e-4, 1e-4], rtol=1e-9)
    assert simulation.lammps.extract_fix("integrate", 0, 1, 2) == pytest.approx(3e-4)
    assert simulation.lammps.get_thermo("time") == pytest.approx(5e-3, rel=1e-12)


def test_forces_after_a_step_are_those_of_the_accepted_state(simulate):
    """With all external ones in LAMMPS's array, and velocities of the whole step."""
    scene, scheme = replace(EVERYTHING, law=replace(BONDING, bond=(0,) * 4)), Scheme()
    simulation = start_simulation(simulate, scene, scheme, colliding_particles(), interval=0.01)
    simulation.commands("run 3")
    particles = colliding_particles()
    reference = Reference(scene, scheme, particles)
    step = steps_of(simulation.folder)["step"][-1]
    forces = reference.evaluate(
        simulation.position, simulation.velocity, simulation.per_atom("omega"), step
    )
    total = forces[0] + forces[2] + forces[3]
    assert simulation.per_atom("f") == pytest.approx(total, abs=1e-10 * np.abs(total).max())
    largest = np.abs(forces[1]).max()
    assert simulation.per_atom("torque") == pytest.approx(forces[1], abs=1e-10 * largest)


CLOUD_SCHEME = "iterations 4 tolerance 1e-6 first_step 1e-5 max_step 1e-3 safety 0.95"
CLOUD_FIELDS = "magnetic 3 -6 7 drag chow density 100 viscosity 0.1"


def cloud_deck(run, *, skin=0.02, newton="on", start=None, scheme=CLOUD_SCHEME, law=BONDING):
    """Return a deck of the rushing cloud, from its data file or from a restart file."""
    system = SYSTEM.replace("units si", f"units si\nnewton {newton}")
    if start:
        system = f"units si\nnewton {newton}\nread_restart {start}\nreset_timestep $(step)"
    return f"""
        {system}
        neighbor {skin} bin
        neigh_modify every 1 delay 0 check yes
        comm_modify cutoff 0.0 vel yes
        timestep 2.0e-3
        pair_style hybrid/overlay blast/contact rotation yes blast/nearfield 0.2 mass switch 0.05
        pair_coeff * * blast/contact {law.words}
        pair_coeff * * blast/nearfield 0.5 1 0.01 2
        fix losses all blast/losses
        fix integrate all nve/implicit {scheme} {CLOUD_FIELDS} append steps.csv
        fix electric all efield 1.0 -2.0 0.5
        compute pair all pair blast/contact
        thermo_style custom step ke pe c_pair[4]
        thermo_modify norm no
        fix ledger all print 1 "$(f_integrate[3]:%.17g) $(f_integrate[1]:%.17g) &
$(f_losses[1]:%.17g) $(f_losses[2]:%.17g) $(f_losses[4]:%.17g) $(c_pair[4])" append ledger.txt &
          screen no title ""
        {run}
        write_dump all custom end.dump id x y z vx vy vz omegax omegay omegaz fx fy fz &
          modify sort id format float %.17g
    """


def run_cloud(folder, deck, ranks=1):
    folder.mkdir(exist_ok=True)
    write_particle_data(colliding_cloud(), folder / "particles.data")
    (folder / "in.deck").write_text(deck)
    done = lmp("-in", "in.deck", "-log", "none", folder=folder, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr
    steps = np.loadtxt(folder / "steps.csv", delimiter=",", skiprows=1)
    ledger = np.loadtxt(folder / "ledger.txt")
    return steps, ledger, np.loadtxt(folder / "end.dump", skiprows=9)


def test_ranks_and_newton_take_the_same_decisions(tmp_path):
    alone = run_cloud(tmp_path / "alone", cloud_deck("run 25"))
    steps, ledger, end = alone
    assert len(steps) > 50
    assert steps[-1, 4] > 0  # restarts
    assert len(set(steps[:, 2])) > 3  # corrections
    assert ledger[-1, -1] > 20  # bonds
    for ranks, newton in ((2, "on"), (3, "off")):
        folder = tmp_path / f"{ranks} {newton}"
        others = run_cloud(folder, cloud_deck("run 25", newton=newton), ranks)
        np.testing.assert_array_equal(others[0][:, [2, 4, 5]], steps[:, [2, 4, 5]])
        np.testing.assert_allclose(others[0][:, 1], steps[:, 1], rtol=1e-6)
        np.testing.assert_allclose(others[1], ledger, rtol=1e-6, atol=1e-9)
        np.testing.assert_allclose(others[2][:, :10], end[:, :10], atol=1e-7)


def test_lists_that_do_not_reach_far_shorten_steps_but_change_nothing_else(tmp_path):
    """Particles move up to 0.3 mm in a step; with a skin of 0.2 mm lists are renewed all the time.

    Without friction, which depends on the step.
    """
    setting = {
        "scheme": "iterations 30 tolerance 1e-9 max_step 1e-4",
        "law": replace(BONDING, friction=(0.0, 0.0, 0.0), bond=(1e6, 1.0, 0.05, 0.0)),
    }
    far = run_cloud(tmp_path / "far", cloud_deck("run 15", skin=0.1, **setting))
    assert far[1][-1, -1] > 5  # bonds
    for ranks in (1, 2):
        folder = tmp_path / f"near {ranks}"
        near = run_cloud(folder, cloud_deck("run 15", skin=2e-4, **setting), ranks)
        assert len(near[0]) > 1.5 * len(far[0])
        np.testing.assert_allclose(near[2][:, 1:4], far[2][:, 1:4], atol=1e-5)
        assert near[1][-1, -1] == far[1][-1, -1]


def lattice_deck(skin):
    """Return a deck of spheres in a periodic box, which a field throws forward for two steps.

    Four steps cross an interval. The throw comes when lists are no longer fresh.
    """
    system = SYSTEM.replace("sort 0 0.0", "sort 1 0.0")
    law = replace(BONDING, stiffness=1e6, bond=(1e5, 1.0, 0.01, 1e3))
    return f"""
        {system}
        change_box all x final -0.21 0.21 y final -0.21 0.21 z final -0.21 0.21 boundary p p p
        neighbor {skin} bin
        neigh_modify every 1 delay 0 check yes
        comm_modify cutoff 0.0 vel yes
        timestep 2.0e-3
        pair_style hybrid/overlay blast/contact rotation yes blast/nearfield 0.12 mass switch 0.05
        pair_coeff * * blast/contact {law.words}
        pair_coeff * * blast/nearfield 0.05 1 0.001 2
        fix integrate all nve/implicit iterations 40 tolerance 1e-10 first_step 5e-4 max_step 5e-4 &
          magnetic 0.3 -0.6 0.7 file steps.csv
        variable thrown equal (abs(time-0.0035)<1e-6)-(abs(time-0.004)<1e-6)
        variable push equal 12000*v_thrown
        fix electric all efield v_push 0 0
        compute pair all pair blast/contact
        thermo_style custom step c_pair[4]
        thermo_modify norm no
        run 5
        fix ledger all print 1 "$(f_integrate[2]) $(c_pair[4])" append ledger.txt title ""
        run 0
        write_dump all custom end.dump id xu yu zu vx vy vz omegax omegay omegaz fx fy fz &
          modify sort id format float %.17g
    """


def drifting_lattice():
    rng = np.random.default_rng(8)
    place = np.stack(np.unravel_index(np.arange(64), (4, 4, 4)), axis=1) * 0.105 - [
        0.1065,
        0.1575,
        0.1575,
    ]
    return make_particles(
        place + rng.uniform(-0.002, 0.002, place.shape),
        velocity=[1.0, 0.1, 0.0],
        spin=5 * rng.normal(size=place.shape),
        radius=0.0525 * np.exp(rng.uniform(-0.05, 0.05, 64)),
        charge=1.0,
    )


def test_lists_that_prove_too_short_in_a_step_are_renewed_at_its_beginning(tmp_path):
    """The step stays as long, and what it leads to the same.

    Forces are evaluated twice more: at the beginning, and for the correction that led too far.
    Particles cross the boundary meanwhile, and change their order.
    """
    ends = {}
    for name, skin, ranks in (("far", 0.05, 1), ("near", 8.2e-3, 1), ("near too", 8.2e-3, 2)):
        folder = tmp_path / name
        folder.mkdir()
        write_particle_data(drifting_lattice(), folder / "particles.data")
        (folder / "in.deck").write_text(lattice_deck(skin))
        done = lmp("-in", "in.deck", "-log", "none", folder=folder, ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        ends[name] = steps_of(folder), np.loadtxt(folder / "end.dump", skiprows=9)
    far, end = ends["far"]
    assert np.abs(end[:, 1]).max() > 0.21  # beyond the box
    for name in ("near", "near too"):
        steps, state = ends[name]
        np.testing.assert_allclose(steps["step"], far["step"], rtol=1e-9)
        extra = np.diff(steps["evaluations"] - far["evaluations"], prepend=0)
        assert list(np.flatnonzero(extra)) == [6]
        assert extra[6] == 2
        np.testing.assert_allclose(state[:, :10], end[:, :10], atol=1e-10)
        np.testing.assert_allclose(
            state[:, 10:], end[:, 10:], atol=1e-8 * np.abs(end[:, 10:]).max()
        )


@pytest.mark.parametrize("several", [False, True])
def test_bonds_form_at_accepted_states_only(simulate, several):
    """A long step presses two spheres beyond E* and is taken again, a shorter one does not."""
    particles = make_particles(
        [[-0.0495, 0, 0], [0.0495, 0, 0]], velocity=[[0.15, 0, 0], [-0.15, 0, 0]], charge=0.0
    )
    scene = Scene(law=Law(bond=(1e6, 1.0, 0.05, 0.0)), rotation=False)
    scheme = Scheme(iterations=3, tolerance=1e-6, first_step=2e-2, max_step=2e-2)
    run = reference_run(scene, scheme, particles, interval=0.02, intervals=1)
    assert run.restarts > 0
    simulation = simulate(particles)
    commands = scene.pair_commands
    if several:
        commands = (
            "pair_style hybrid/overlay blast/contact rotation no blast/contact rotation no\n"
            f"pair_coeff * * blast/contact 1 {scene.law.words}\n"
            "pair_coeff * * blast/contact 2 stiffness 1e-30 exponent 1"
        )
    simulation.commands(f"""
        {SYSTEM_OF_PAIRS}
        timestep 0.02
        {commands}
        fix integrate all nve/implicit {scheme.words} file steps.csv
        run 1
    """)
    steps = steps_of(simulation.folder)
    assert steps["evaluations"][-1] == run.evaluations - 1  # but for that after the last step
    assert simulation.velocity == pytest.approx(run.v, abs=1e-8)


def test_a_force_that_changes_in_time_is_that_of_the_state_it_acts_on(simulate):
    """In whole and inner steps alike: the exact motion under E = sin(omega t)."""
    omega, duration = 2 * np.pi / 0.1, 0.07
    particles = make_particles([0.0, 0, 0], charge=10.0)
    simulation = simulate(particles)
    simulation.commands(f"""
        timestep 0.01
        variable field equal sin({omega!r}*time)
        fix integrate all nve/implicit max_step 1.0e-4
        fix electric all efield v_field 0 0
        run 7
    """)
    speed = 10.0 / omega * (1 - np.cos(omega * duration))
    place = 10.0 / omega * (duration - np.sin(omega * duration) / omega)
    assert simulation.velocity[0, 0] == pytest.approx(speed, rel=1e-5)
    assert simulation.position[0, 0] == pytest.approx(place, rel=1e-5)


def test_resumed_run_goes_on_with_the_same_steps_bonds_and_accounts(tmp_path):
    """In the middle of collisions, with the step well below its limit; on other ranks, too."""
    whole = run_cloud(tmp_path / "whole", cloud_deck("run 20\nwrite_restart half.restart\nrun 20"))
    assert whole[0][:, 1].min() < 5e-4
    for ranks in (1, 2):
        folder = tmp_path / f"resumed {ranks}"
        folder.mkdir()
        shutil.copy(tmp_path / "whole" / "half.restart", folder)
        steps, ledger, end = run_cloud(folder, cloud_deck("run 20", start="half.restart"), ranks)
        rest = whole[0][-len(steps) :]
        assert rest[0, 0] > 0.04 > rest[0, 0] - rest[0, 1] - 1e-9
        np.testing.assert_array_equal(steps[:, [2, 4]], rest[:, [2, 4]])
        np.testing.assert_allclose(steps[:, 1], rest[:, 1], rtol=1e-6)
        np.testing.assert_allclose(ledger[-1], whole[1][-1], rtol=1e-6)
        np.testing.assert_allclose(end[:, :10], whole[2][:, :10], atol=1e-7)


def test_atoms_outside_the_group_stay_where_they_are(simulate):
    """Yet they push: as if they were of infinite mass."""
    particles = make_particles([[0.0, 0, 0], [0.12, 0, 0]], velocity=[[1.0, 0, 0], [0.5, 0, 0]])
    simulation = simulate(particles)
    simulation.commands(f"""
        {SYSTEM_OF_PAIRS}
        timestep 0.01
        {ELASTIC.pair_commands}
        group light id 1
        fix integrate light nve/implicit {fixed(1e-5).words}
        run 15
    """)
    assert simulation.position[1] == pytest.approx([0.12, 0, 0], abs=0)
    assert simulation.velocity == pytest.approx(np.array([[-1.0, 0, 0], [0.5, 0, 0]]), abs=1e-6)


def test_periodic_images_are_one_particle(simulate):
    """A pair that meets across a boundary does what one in the middle does."""
    ends = []
    for shift in (0.0, 0.5):
        particles = make_particles(
            [[-0.06, 0, 0], [0.06, 0, 0]], velocity=[[1.0, 0.1, 0], [-1.0, 0, 0]], charge=0.0
        )
        simulation = simulate(particles)
        simulation.commands(f"""
            change_box all x final -0.5 0.5 boundary p s s
            displace_atoms all move {shift} 0 0
            neighbor 0.02 nsq
            neigh_modify every 1 delay 0 check yes
            comm_modify cutoff 0.0 vel yes
            timestep 0.02
            {Scene(law=Law(damping=1e5)).pair_commands}
            fix integrate all nve/implicit {fixed(1e-4).words}
            run 10
        """)
        ends.append(simulation.velocity)
    assert np.abs(ends[0][:, 0]).max() < 0.99  # they have met
    assert ends[1] == pytest.approx(ends[0], abs=1e-12)


@pytest.mark.parametrize("ranks", [1, 2])
def test_a_system_that_cannot_converge_ends_with_the_worst_particle(tmp_path, ranks):
    """Damping too strong for any step: as soon as two move apart it throws them back."""
    particles = make_particles([[0.0, 0, 0], [0.0999, 0, 0], [1, 0, 0]])
    write_particle_data(particles, tmp_path / "particles.data")
    (tmp_path / "in.deck").write_text(f"""
        {SYSTEM}
        {SYSTEM_OF_PAIRS}
        timestep 0.01
        pair_style blast/contact
        pair_coeff * * stiffness 1e7 exponent 2 damping 1e40
        fix integrate all nve/implicit max_step 1e-3
        run 10
    """)
    done = lmp("-in", "in.deck", "-log", "none", folder=tmp_path, ranks=ranks)
    assert done.returncode != 0
    text = " ".join((done.stdout + done.stderr).split())
    assert re.search(
        r"Fix nve/implicit: no convergence: the error is \S+ after \d+ corrections at time \S+ "
        r"with a step of \S+ s; atom [12] moves most, by \S+ m in the last correction, under a "
        r"force of \(\S+, \S+, \S+\) N, \(0, 0, 0\) N of it drag and \(0, 0, 0\) N magnetic",
        text,
    )


def test_lists_without_a_skin_end_the_run_with_a_word_of_it(simulate):
    particles = make_particles([[0.0, 0, 0], [0.2, 0, 0]], velocity=[[1.0, 0, 0], [0, 0, 0]])
    simulation = start_simulation(simulate, ELASTIC, Scheme(), particles, interval=0.01)
    simulation.commands("neighbor 0.0 nsq")
    with pytest.raises(Exception, match="beyond half the skin of the neighbor lists, 0 m"):
        simulation.commands("run 1")


def test_after_an_error_the_clock_of_lammps_shows_intervals_again(simulate):
    """Whoever catches the error and cures its cause goes on with whole intervals."""
    particles = make_particles([[0.0, 0, 0], [0.0999, 0, 0]])
    simulation = simulate(particles)
    simulation.commands(f"""
        {SYSTEM_OF_PAIRS}
        timestep 0.01
        pair_style blast/contact
        pair_coeff * * stiffness 1e7 exponent 2 damping 1e40
        fix integrate all nve/implicit max_step 1e-3
    """)
    with pytest.raises(Exception, match="no convergence"):
        simulation.commands("run 10")
    assert simulation.lammps.extract_global("dt") == 0.01
    simulation.commands("pair_coeff * * stiffness 1e7 exponent 2 damping 10\nrun 2")
    assert simulation.lammps.get_thermo("time") == pytest.approx(0.02)


def test_a_step_history_begins_with_its_header_however_it_is_opened(simulate):
    particles = make_particles([0.0, 0, 0], velocity=[1.0, 0, 0])
    simulation = simulate(particles)
    simulation.commands("""
        timestep 0.01
        fix integrate all nve/implicit max_step 1e-2 append steps.csv
        run 2
        unfix integrate
        fix integrate all nve/implicit max_step 1e-2 append steps.csv
        run 1
    """)
    assert steps_of(simulation.folder)["time"] == pytest.approx([0.01, 0.02, 0.03])
    simulation.commands("unfix integrate")
    with pytest.raises(Exception, match="Unknown"):
        simulation.commands("fix integrate all nve/implicit max_step 1 file steps.csv wrong 1")
    assert len(steps_of(simulation.folder)["time"]) == 3


@pytest.mark.parametrize("phi", [0.0, 0.5])
def test_a_state_that_is_no_number_ends_the_run(simulate, phi):
    particles = make_particles([[0.0, 0, 0]], velocity=[1e300, 1e300, 0])
    simulation = start_simulation(simulate, FREE_FLIGHT, Scheme(phi=phi), particles, interval=0.01)
    with pytest.raises(Exception, match=r"no convergence: the error is -?(nan|inf)"):
        simulation.commands("run 1")


def test_steps_cut_by_the_reach_of_lists_are_told_of_once(tmp_path):
    (tmp_path / "run").mkdir()
    write_particle_data(colliding_cloud(), tmp_path / "run" / "particles.data")
    (tmp_path / "run" / "in.deck").write_text(cloud_deck("run 5", skin=2e-4))
    done = lmp("-in", "in.deck", "-log", "none", folder=tmp_path / "run")
    text = " ".join(done.stdout.split())
    assert text.count("Fix nve/implicit halves steps in which particles move beyond half") == 1
    assert re.search(
        r"skin of the neighbor lists, 0.0002 m, the first at time \S+ with \S+ s", text
    )


def test_watch_sees_every_step_within_an_interval(simulate):
    """A sphere that a field throws through another in an inner step, and the advice is of it."""
    particles = make_particles([[0.0, 0, 0], [3.0, 0, 0]], charge=[10.0, 0.0])
    simulation = start_simulation(
        simulate, ELASTIC, Scheme(first_step=1e-3, max_step=1e-3), particles, 0.1,
        "fix watch all blast/watch 1",
    )  # fmt: skip
    simulation.commands("""
        variable field equal 20000*(time<0.0015)
        fix electric all efield v_field 0 0
    """)
    message = (
        r"atom 1 moves by \S+ of its radius in a step at time 0.00[12].*try a smaller max_step"
    )
    with pytest.raises(Exception, match=message):
        simulation.commands("run 1")


FIX = "fix f all nve/implicit max_step 1e-4"
CONTACT = "pair_style blast/contact\npair_coeff * * stiffness 1e7 exponent 2"
BAD_COMMANDS = {
    "fix f all nve/implicit": "needs the keyword max_step",
    f"{FIX} phi": "Illegal Fix nve/implicit phi command: missing argument",
    f"{FIX} phi -0.1": "phi must be from 0 to 1: -0.1",
    f"{FIX} phi 1.1": "phi must be from 0 to 1: 1.1",
    f"{FIX} phi half": "half",
    f"{FIX} iterations 0": "iterations must be at least 1: 0",
    f"{FIX} iterations 2.5": "2.5",
    f"{FIX} tolerance 0": "tolerance must be above zero: 0",
    f"{FIX} tolerance 1": "tolerance must be below 1: 1",
    f"{FIX} tolerance nan": "instead of 'nan'",
    f"{FIX} first_step 0": "first_step must be above zero: 0",
    f"{FIX} first_step 2e-4": "first_step must not be longer than max_step",
    "timestep 1\nfix f all nve/implicit max_step 1e-10\nrun 1000": "max_step is below 1e-09 s",
    "fix f all nve/implicit max_step -1": "max_step must be above zero: -1",
    f"{FIX} safety 0": "safety must be above zero: 0",
    f"{FIX} safety 1.5": "safety must be at most 1: 1.5",
    f"{FIX} fields perhaps": "fields must be iterated or solved: perhaps",
    f"{FIX} anderson 6": "anderson must be from 0 to 5: 6",
    f"{FIX} file no/such/folder.csv": "cannot open no/such/folder.csv",
    f"{FIX} step 1": "Unknown Fix nve/implicit keyword: step",
    f"{FIX} drag chow": "needs the keyword density",
    f"{FIX}\nrun_style respa 2 2\nrun 0": "run_style respa",
    f"{FIX}\nfix other all nve/sphere\nrun 0": "only fix that integrates: remove fix other",
    f"{FIX}\nfix other all lorentz/drag magnetic 1 0 0\nrun 0": "remove fix other",
    f"{FIX}\npair_style granular\npair_coeff * * hertz/material 1e7 0 0.3 tangential "
    "mindlin NULL 0 0.4\nrun 0": "contacts that remember how far they have slipped",
    f"{FIX}\npair_style granular\npair_coeff * * jkr 1e7 0 0.3 1.0 tangential "
    "linear_nohistory 0 0\nrun 0": "contacts that remember how far they have slipped",
    f"{FIX}\nfix wall all wall/gran hooke 1e5 NULL 0 NULL 0.5 0 zplane -5 NULL\nrun 0":
        "contacts that remember how far they have slipped (fix wall)",
}  # fmt: skip


@pytest.mark.parametrize("command", BAD_COMMANDS)
def test_bad_arguments_and_companions_are_refused_by_name(simulate, command):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.2, 0, 0]]))
    simulation.commands("neighbor 0.01 nsq\ncomm_modify cutoff 0.0 vel yes")
    with pytest.raises(Exception, match=re.escape(BAD_COMMANDS[command])):
        simulation.commands(command)


def test_stock_contacts_without_memory_can_be_tried(simulate):
    """Hertz's law head on: the energy comes back."""
    particles = make_particles([[-0.06, 0, 0], [0.06, 0, 0]], velocity=[[1.0, 0, 0], [-1.0, 0, 0]])
    simulation = simulate(particles)
    simulation.commands(f"""
        {SYSTEM_OF_PAIRS}
        timestep 0.01
        pair_style granular
        pair_coeff * * hertz/material 1e7 0 0.3 tangential linear_nohistory 0 0
        fix integrate all nve/implicit {fixed(2e-5).words}
        run 10
    """)
    expected = np.array([[-1.0, 0, 0], [1.0, 0, 0]])
    assert simulation.velocity == pytest.approx(expected, abs=1e-6)
