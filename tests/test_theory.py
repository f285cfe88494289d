"""The closed forms against independent derivations: integrated equations of motion, quadrature,
values of 80-digit arithmetic, and the limits in which the printed formulas are 0/0."""

import json
from types import MappingProxyType

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.special import exp1

from lammps_blast import theory
from lammps_blast.case import parse_case
from lammps_blast.derived_numbers import derive_numbers
from lammps_blast.theory import DragLaw

AIR = {"density": 1.225, "viscosity": 1.8e-5}
CHOW = DragLaw("chow", **AIR)
STOKES = DragLaw("stokes", **AIR)
CONSTANT = DragLaw("constant", **AIR, coefficient=0.5)
LAWS = [DragLaw(), STOKES, CONSTANT, CHOW]
# Section 6 of the paper.
RADIUS, DENSITY, CHARGE, ENERGY, COUNT = 0.05, 7000.0, 10.0, 1.0e4, 2000
MASS = theory.sphere_mass(RADIUS, DENSITY)
SPEED = theory.pulse_speed(ENERGY, COUNT * MASS)

E_OBLIQUE, B_OBLIQUE = np.array([3.0, -2.0, 0.7]), np.array([-0.4, 1.1, 0.8])
POSITION, VELOCITY = np.array([0.1, 0.2, -0.3]), np.array([1.5, -0.4, 0.9])


def integrate(rhs, state, times, **options):
    """Solve an initial value problem to about thirteen digits; shape (len(times), states)."""
    end = np.max(times)
    solution = solve_ivp(
        rhs, (0, end), state, method="DOP853", t_eval=times, rtol=1e-13, atol=1e-15, **options
    )
    assert solution.success
    return solution.y.T


def motion(drag, charge_per_mass, electric, magnetic, radius, mass):
    """The equation of motion 6.1, written with cross products and `drag_force` only."""

    def rhs(time, state):
        v = state[3:]
        force = theory.drag_force(v, radius, drag)
        return np.concatenate([v, charge_per_mass * (electric + np.cross(v, magnetic))]) + (
            np.concatenate([np.zeros(3), force / mass])
        )

    return rhs


class TestOneParticle:
    def test_section_6_values(self):
        omega = theory.cyclotron_frequency(CHARGE, [10.0, 0, 0])
        assert omega == 100.0
        assert theory.cyclotron_radius(SPEED, omega) == pytest.approx(0.016518, rel=3e-5)
        assert theory.cyclotron_period(omega) == pytest.approx(2 * np.pi / 100)

    def test_sign_and_no_field(self):
        assert theory.cyclotron_frequency([-2.0, 2.0], [0, 3.0, 4.0]).tolist() == [-10.0, 10.0]
        assert theory.cyclotron_radius(1.0, -10.0) == 0.1
        assert theory.cyclotron_radius(1.0, 0.0) == np.inf
        assert theory.cyclotron_period([0.0, -2.0]).tolist() == [np.inf, np.pi]

    def test_equation_2_5(self):
        v0, b3, e3, q, t = 2.0, 0.5, 0.3, 4.0, 1.7
        w = q * b3
        r, v = theory.lorentz_orbit(t, [0, 0, 0], [v0, 0, 0], q, [0, 0, e3], [0, 0, b3])
        expected_v = [v0 * np.cos(w * t), -v0 * np.sin(w * t), q * e3 * t]
        expected_r = [v0 * np.sin(w * t) / w, v0 * (np.cos(w * t) - 1) / w, q * e3 * t**2 / 2]
        np.testing.assert_allclose(v, expected_v, rtol=1e-14)
        np.testing.assert_allclose(r, expected_r, rtol=1e-14)

    @pytest.mark.parametrize("charge", [2.0, -0.7, 1e-9, 0.0])
    @pytest.mark.parametrize("electric", [E_OBLIQUE, 0 * E_OBLIQUE])
    @pytest.mark.parametrize("magnetic", [B_OBLIQUE, 1e-7 * B_OBLIQUE, 0 * B_OBLIQUE])
    def test_orbit_against_integration(self, charge, electric, magnetic):
        times = np.array([0.0, 1e-5, 0.3, 4.0])
        rhs = motion(DragLaw(), charge, electric, magnetic, 1.0, 1.0)
        expected = integrate(rhs, np.concatenate([POSITION, VELOCITY]), times)
        r, v = theory.lorentz_orbit(times, POSITION, VELOCITY, charge, electric, magnetic)
        np.testing.assert_allclose(np.hstack([r, v]), expected, rtol=1e-11, atol=1e-12)

    def test_orbit_small_angles_keep_every_digit(self):
        # Deviation from a straight line, from a start at the origin at rest, by its series.
        acceleration = 3.0 * np.array([0.0, 2.0, 0.0])
        for t in np.logspace(-12, -4, 9):
            r, v = theory.lorentz_orbit(t, np.zeros(3), np.zeros(3), 3.0, [0, 2.0, 0], [0, 0, 1.0])
            angle = 3.0 * t
            turned = np.cross(acceleration, [0, 0, 1.0])
            series = (
                acceleration * (1 - angle**2 / 12) / 2,
                turned * angle * (1 - angle**2 / 20) / 6,
            )
            np.testing.assert_allclose(r, t**2 * sum(series), rtol=1e-13)
            np.testing.assert_allclose(v[1], 6.0 * t * np.sin(angle) / angle, rtol=1e-14)

    def test_orbit_is_continuous_where_its_series_takes_over(self):
        below, above = (
            theory.lorentz_orbit(t, POSITION, VELOCITY, 1.0, E_OBLIQUE, B_OBLIQUE)[0]
            for t in np.array([1 - 1e-15, 1 + 1e-15]) / np.linalg.norm(B_OBLIQUE)
        )
        np.testing.assert_allclose(below, above, rtol=1e-14)

    def test_orbit_energy_and_shapes(self):
        rng = np.random.default_rng(1)
        r0, v0, q = rng.normal(size=(5, 3)), rng.normal(size=(5, 3)), rng.normal(size=5)
        times = np.linspace(0, 50, 7)[:, None]
        r, v = theory.lorentz_orbit(times, r0, v0, q, E_OBLIQUE, B_OBLIQUE)
        assert r.shape == v.shape == (7, 5, 3)
        gain = 0.5 * (np.sum(v**2, axis=-1) - np.sum(v0**2, axis=-1))
        work = q * ((r - r0) @ E_OBLIQUE)
        np.testing.assert_allclose(gain, work, rtol=1e-11, atol=1e-11)
        one, _ = theory.lorentz_orbit(times[3, 0], r0[2], v0[2], q[2], E_OBLIQUE, B_OBLIQUE)
        np.testing.assert_allclose(r[3, 2], one, rtol=1e-14)

    def test_drift_is_electric_cross_magnetic(self):
        period = theory.cyclotron_period(theory.cyclotron_frequency(1.0, B_OBLIQUE))
        across = E_OBLIQUE - B_OBLIQUE * (E_OBLIQUE @ B_OBLIQUE) / (B_OBLIQUE @ B_OBLIQUE)
        r, _ = theory.lorentz_orbit(period, np.zeros(3), np.zeros(3), 1.0, across, B_OBLIQUE)
        drift = np.cross(E_OBLIQUE, B_OBLIQUE) / (B_OBLIQUE @ B_OBLIQUE)
        np.testing.assert_allclose(r / period, drift, rtol=1e-13, atol=1e-14)


class TestPulse:
    def test_section_6_values(self):
        assert pytest.approx(3.6652, rel=1e-5) == MASS
        assert pytest.approx(1.6518, rel=2e-5) == SPEED

    def test_kinetic_energy_is_the_blast_energy(self):
        rng = np.random.default_rng(2)
        position = rng.normal(size=(50, 3))
        mass = theory.sphere_mass(rng.uniform(0.1, 0.2, 50), 1000.0)
        directions = theory.launch_directions(position, mass)
        velocity = theory.pulse_speed(7.0, mass.sum()) * directions
        assert 0.5 * np.sum(mass * np.sum(velocity**2, axis=1)) == pytest.approx(7.0, rel=1e-14)
        centre = theory.centre_of_mass(position, mass)
        np.testing.assert_allclose(mass @ (position - centre), 0, atol=1e-10)
        np.testing.assert_allclose(np.cross(directions, position - centre), 0, atol=1e-14)

    def test_no_direction_at_the_centre(self):
        with pytest.raises(ValueError, match=r"particle 1 .* sits on the centre of mass"):
            theory.launch_directions([[-1.0, 0, 0], [0, 0, 0], [1.0, 0, 0]], [1.0, 1.0, 1.0])


class TestDrag:
    def test_section_6_values(self):
        reynolds = theory.reynolds_number(SPEED, RADIUS, **medium())
        assert reynolds == pytest.approx(1.124e4, rel=2e-4)
        assert theory.chow_drag_coefficient(reynolds) == 0.5
        constant = theory.drag_constant(0.5, AIR["density"], RADIUS, DENSITY)
        assert constant == pytest.approx(6.5625e-4, rel=1e-14)

    def test_chow_pieces_and_their_limits(self):
        reynolds = np.array([0.5, 1.0, 100.0, 400.0, 1e4, 3e5, 1e6, 2e6, 1e7])
        expected = [48, 24, 24 / 100**0.646, 24 / 400**0.646, 0.5, 0.5]
        expected += [0.000366 * 1e6**0.4275, 0.000366 * 2e6**0.4275, 0.18]
        np.testing.assert_allclose(theory.chow_drag_coefficient(reynolds), expected, rtol=1e-14)
        above = theory.chow_drag_coefficient(np.nextafter([1.0, 400.0, 3e5, 2e6], np.inf))
        np.testing.assert_allclose(above, [24, 0.5, 0.000366 * 3e5**0.4275, 0.18], rtol=1e-14)
        assert above[2] < 0.1  # the jump of the drag crisis is kept

    @pytest.mark.parametrize("drag", LAWS, ids=lambda drag: drag.kind)
    def test_rest_and_extremes_are_never_nan(self, drag):
        velocity = np.array([[0, 0, 0], [1e-300, 0, 0], [1e9, 0, 0], [0, -2.0, 0]])
        force = theory.drag_force(velocity, RADIUS, drag)
        assert np.isfinite(force).all()
        assert not force[0].any()
        assert not theory.drag_force([1.0, 2.0, 3.0], RADIUS, drag, [1.0, 2.0, 3.0]).any()
        assert (np.sum(force * velocity, axis=1) <= 0).all()

    def test_force_is_equation_3_6(self):
        velocity, wind = np.array([0.5, -1.0, 2.0]), np.array([0.1, 0.2, 0.3])
        relative = wind - velocity
        speed = np.linalg.norm(relative)
        for drag in (CONSTANT, CHOW):
            coefficient = theory.drag_coefficient(speed, RADIUS, drag)
            expected = 0.5 * 1.225 * coefficient * speed * relative * np.pi * RADIUS**2
            force = theory.drag_force(velocity, RADIUS, drag, wind)
            np.testing.assert_allclose(force, expected, rtol=1e-14)
        expected = 6 * np.pi * AIR["viscosity"] * RADIUS * relative
        force = theory.stokes_drag_force(velocity, RADIUS, AIR["viscosity"], wind)
        np.testing.assert_allclose(force, expected, rtol=1e-14)

    def test_chow_creeps_as_stokes(self):
        velocity = np.array([[1e-5, 0, 0], [0, 1e-7, 0]])
        np.testing.assert_allclose(
            theory.drag_force(velocity, [RADIUS, 1e-3], CHOW),
            theory.drag_force(velocity, [RADIUS, 1e-3], STOKES),
            rtol=1e-14,
        )

    def test_media_without_viscosity_or_density(self):
        inviscid = theory.drag_force([2.0, 0, 0], RADIUS, DragLaw("chow", density=1.225))
        assert inviscid[0] == pytest.approx(-0.5 * 1.225 * 0.18 * 4 * np.pi * RADIUS**2)
        thin = theory.drag_force([2.0, 0, 0], RADIUS, DragLaw("chow", viscosity=1.8e-5))
        assert thin[0] == pytest.approx(-6 * np.pi * 1.8e-5 * RADIUS * 2)
        assert not theory.drag_force([2.0, 0, 0], RADIUS, DragLaw("chow")).any()

    def test_ratio_of_stokes_to_quadratic(self):
        forces = (np.linalg.norm(theory.drag_force([3.0, 0, 0], 0.01, d)) for d in (STOKES, CHOW))
        coefficient = theory.drag_coefficient(3.0, 0.01, CHOW)
        ratio = theory.stokes_to_quadratic_ratio(
            3.0, 0.01, **medium(), drag_coefficient=coefficient
        )
        assert ratio == pytest.approx(next(forces) / next(forces), rel=1e-14)
        # A C_D of 24/Re makes eq. 3.6 Stokes drag.
        coefficient = theory.drag_coefficient(3.0, 0.01, STOKES)
        ratio = theory.stokes_to_quadratic_ratio(
            3.0, 0.01, **medium(), drag_coefficient=coefficient
        )
        assert ratio == pytest.approx(1.0, rel=1e-14)

    def test_quadratic_closed_forms(self):
        k, v0 = 0.8, 3.0
        times = np.array([0.2, 5.0])
        expected = integrate(lambda t, y: [y[1], -k * y[1] ** 2], [0, v0], times)
        distance = theory.quadratic_distance(times, v0, k)
        np.testing.assert_allclose(distance, expected[:, 0], rtol=1e-12)
        np.testing.assert_allclose(theory.quadratic_speed(times, v0, k), expected[:, 1], rtol=1e-12)
        at_distance = theory.quadratic_speed_at_distance(distance, v0, k)
        np.testing.assert_allclose(at_distance, expected[:, 1], rtol=1e-12)
        np.testing.assert_allclose(theory.quadratic_time(distance, v0, k), times, rtol=1e-14)

    def test_stokes_closed_forms(self):
        tau, v0 = 1.3, 3.0
        times = np.array([0.2, 5.0])
        expected = integrate(lambda t, y: [y[1], -y[1] / tau], [0, v0], times)
        distance = theory.stokes_distance(times, v0, tau)
        np.testing.assert_allclose(distance, expected[:, 0], rtol=1e-12)
        np.testing.assert_allclose(theory.stokes_speed(times, v0, tau), expected[:, 1], rtol=1e-12)
        final = theory.stokes_terminal_radius(v0, tau)
        assert final == pytest.approx(v0 * tau)
        fraction = theory.stokes_radius_fraction(times, tau)
        np.testing.assert_allclose(fraction, distance / final, rtol=1e-14)
        np.testing.assert_allclose(theory.stokes_travel_time(distance, v0, tau), times, rtol=1e-13)
        assert theory.stokes_travel_time([final, 2 * final], v0, tau).tolist() == [np.inf, np.inf]
        mass, rate = theory.sphere_mass(0.02, 900.0), 6 * np.pi * 1e-3 * 0.02
        assert theory.stokes_time(0.02, 900.0, 1e-3) == pytest.approx(mass / rate, rel=1e-14)

    def test_limits_without_drag_and_at_time_zero(self):
        assert theory.quadratic_distance(2.0, 3.0, 0.0) == 6.0
        assert theory.quadratic_distance(2.0, 3.0, 1e-18) == 6.0
        assert theory.quadratic_time(6.0, 3.0, 0.0) == 2.0
        assert theory.stokes_time(0.1, 1000.0, 0.0) == np.inf
        assert theory.stokes_distance(2.0, 3.0, np.inf) == 6.0
        assert theory.stokes_travel_time(6.0, 3.0, np.inf) == 2.0
        assert theory.quadratic_distance([0.0, 0.0], 3.0, 0.5).tolist() == [0.0, 0.0]
        assert theory.stokes_distance(0.0, 3.0, 2.0) == 0.0

    @pytest.mark.parametrize(
        "arguments",
        [
            {"kind": "newton"},
            {"kind": "constant", "density": 1.0},
            {"kind": "stokes", "viscosity": -1.0},
            {"kind": "chow", "density": np.inf},
            {"kind": "constant", "coefficient": np.nan},
        ],
    )
    def test_impossible_laws(self, arguments):
        with pytest.raises(ValueError, match=r"drag kind|coefficient|viscosity|density"):
            DragLaw(**arguments)


def medium():
    return {"medium_density": AIR["density"], "viscosity": AIR["viscosity"]}


class TestForceRatio:
    sphere = MappingProxyType({"charge_per_mass": -4.0, "radius": 0.02, "density": 3000.0})
    air = MappingProxyType({"medium_density": 1.225, "drag_coefficient": 0.4})

    def test_ratio_is_force_over_force(self):
        wind = np.array([0.3, 0.1, -0.2])
        drag = theory.drag_force(VELOCITY, 0.02, DragLaw("constant", 1.225, 0.0, 0.4), wind)
        charge = -4.0 * theory.sphere_mass(0.02, 3000.0)
        lorentz = charge * (E_OBLIQUE + np.cross(VELOCITY, B_OBLIQUE))
        fields = {"electric": E_OBLIQUE, "magnetic": B_OBLIQUE}
        ratio = theory.force_ratio(
            VELOCITY, **self.sphere, **self.air, **fields, medium_velocity=wind
        )
        expected = np.linalg.norm(lorentz) / np.linalg.norm(drag)
        assert ratio == pytest.approx(expected, rel=1e-13)
        bound = theory.force_ratio_bound(
            np.linalg.norm(VELOCITY),
            **self.sphere,
            **self.air,
            **fields,
            relative_speed=np.linalg.norm(wind - VELOCITY),
        )
        assert bound > ratio

    def test_erratum_of_equation_6_3(self):
        # The paper prints 56504.7, which is this number without the density of air.
        ratio = theory.force_ratio(
            [0, SPEED, 0],
            charge_per_mass=CHARGE,
            radius=RADIUS,
            density=DENSITY,
            electric=[0, 0, 0],
            magnetic=[10.0, 0, 0],
            medium_density=1.225,
            drag_coefficient=1.0,
        )
        assert ratio == pytest.approx(46126, abs=0.5)
        assert ratio * 1.225 == pytest.approx(56504.7, abs=0.1)

    def test_parity_fields_have_ratio_one(self):
        electric = theory.parity_electric_field(2.0, **self.sphere, **self.air)
        magnetic = theory.parity_magnetic_field(2.0, **self.sphere, **self.air)
        for fields in ([electric, 0], [0, magnetic]):
            vectors = {"electric": [0, fields[0], 0], "magnetic": [0, 0, fields[1]]}
            ratio = theory.force_ratio([2.0, 0, 0], **self.sphere, **self.air, **vectors)
            bound = theory.force_ratio_bound(2.0, **self.sphere, **self.air, **vectors)
            assert ratio == pytest.approx(1.0, rel=1e-14)
            assert bound == pytest.approx(1.0, rel=1e-14)

    def test_without_drag_or_charge(self):
        fields = {"electric": [1.0, 0, 0], "magnetic": [0, 0, 0]}
        assert theory.force_ratio(np.zeros(3), **self.sphere, **self.air, **fields) == np.inf
        neutral = self.sphere | {"charge_per_mass": 0.0}
        assert theory.parity_electric_field(1.0, **neutral, **self.air) == np.inf


def drag_of(constant):
    """A law and a particle with a given K in 1/m."""
    law = DragLaw("constant", density=constant * 8 / 3, coefficient=1.0)
    return {"drag": law, "radius": 1.0, "mass": theory.sphere_mass(1.0, 1.0)}


# omega, t and d_perpendicular for K = 1, v0 = 1 by exponential integrals of 80 digits (mpmath).
# kappa is omega here; each kappa has an angle of 1e-6, one of 5 and one of 60.
EXACT_CONSTANT_DRAG = [
    (1e-08, 100.0, (4.6151205168410145 - 9.538487948315327e-07j)),
    (1e-08, 500000000.0, (17.653435345460824 - 1.5499310564924722j)),
    (1e-08, 6000000000.0, (17.83865185138211 - 1.5867454278226272j)),
    (0.001, 0.001, (0.0009995003330833666 - 4.996669164667916e-10j)),
    (0.001, 5000.0, (6.142112606025116 - 1.5425981674322995j)),
    (0.001, 60000.0, (6.327293327237304 - 1.5794140256792382j)),
    (0.5, 2e-06, (1.9999980000023334e-06 - 9.999986666685832e-13j)),
    (0.5, 10.0, (0.49909255781948464 - 0.839053746339207j)),
    (0.5, 120.0, (0.6679161248754134 - 0.8763436953462117j)),
    (30.0, 3.3333333333333334e-08, (3.333333277777223e-08 - 1.6666666296294917e-14j)),
    (30.0, 0.16666666666666666, (-0.02648011669424929 - 0.02594770925838184j)),
    (30.0, 2.0, (-0.002164593523297791 - 0.04387757637100256j)),
    (45.0, 2.222222222222222e-08, (2.222222197530494e-08 - 1.1111110946501132e-14j)),
    (45.0, 0.1111111111111111, (-0.01878403205647951 - 0.016914332277125202j)),
    (45.0, 1.3333333333333333, (-0.002323714386823108 - 0.03129699087639441j)),
    (1000.0, 9.999999999999999e-10, (9.999999994998331e-10 - 4.999999996666249e-16j)),
    (1000.0, 0.005, (-0.0009534324688127094 - 0.0007186970289420455j)),
    (1000.0, 0.06, (-0.0002857090442389948 - 0.0018987704913439381j)),
    (100000000.0, 1e-14, (9.999999999998283e-15 - 4.99999999999955e-21j)),
    (100000000.0, 5e-08, (-9.589242195535486e-09 - 7.163378383091241e-09j)),
    (100000000.0, 6e-07, (-3.0481041869183276e-09 - 1.9524124120158138e-08j)),
]


class TestSpheroid:
    @pytest.mark.parametrize("drag", LAWS, ids=lambda drag: drag.kind)
    @pytest.mark.parametrize("charge", [3.0, -3.0])
    def test_theorem_against_motion_of_launch_directions(self, drag, charge):
        radius, mass, speed, launch_radius = 0.05, 2e-3, 20.0, 0.7
        omega = theory.cyclotron_frequency(charge, B_OBLIQUE)
        times = np.array([0.01, 0.4, 2.5])
        parallel, perpendicular = theory.launch_displacement(
            times, speed, omega, radius=radius, mass=mass, drag=drag
        )
        history = theory.speed_history(times, speed, radius=radius, mass=mass, drag=drag)
        axis = B_OBLIQUE / np.linalg.norm(B_OBLIQUE)
        axes = theory.spheroid_semi_axes(launch_radius, parallel, perpendicular)
        rhs = motion(drag, charge, np.zeros(3), B_OBLIQUE, radius, mass)
        directions = np.random.default_rng(3).normal(size=(4, 3))
        for n in directions / np.linalg.norm(directions, axis=1, keepdims=True):
            state = integrate(rhs, np.concatenate([launch_radius * n, speed * n]), times)
            along, across = (n @ axis) * axis, n - (n @ axis) * axis
            moved = np.multiply.outer(parallel, along) + (
                np.multiply.outer(perpendicular.real, across)
                + np.multiply.outer(perpendicular.imag, np.cross(axis, across))
            )
            np.testing.assert_allclose(state[:, :3], launch_radius * n + moved, atol=1e-11)
            np.testing.assert_allclose(np.linalg.norm(state[:, 3:], axis=1), history, rtol=1e-11)
            height = state[:, :3] @ axis
            width = np.linalg.norm(np.cross(axis, state[:, :3]), axis=1)
            spheroid = (height / axes[0]) ** 2 + (width / axes[1]) ** 2
            np.testing.assert_allclose(spheroid, 1.0, rtol=1e-10)

    @pytest.mark.parametrize(("omega", "time", "expected"), EXACT_CONSTANT_DRAG)
    def test_constant_drag_to_twelve_digits(self, omega, time, expected):
        _, got = theory.launch_displacement(time, 1.0, omega, **drag_of(1.0))
        assert abs(got - expected) < 1e-13 * abs(expected)

    def test_constant_drag_at_many_turns(self):
        # The angle, and with it the answer, is known to rounding times the angle.
        kappa, time = 1e8, 0.3
        _, got = theory.launch_displacement(time, 1.0, kappa, **drag_of(1.0))
        tail = (1 - 1 / (1j * kappa)) / (1j * kappa)
        end = 1j * kappa * (1 + time)
        tail_end = (1 - 1 / end) / end
        assert abs(got - (tail - np.exp(-1j * kappa * time) * tail_end)) < 1e-20

    def test_constant_drag_is_a_difference_of_exponential_integrals(self):
        times, omega, constant, speed = np.array([0.5, 2.0, 40.0]), 3.0, 0.7, 2.0
        kappa, growth = omega / (constant * speed), 1 + constant * speed * times
        turn = np.exp(1j * kappa) / constant
        expected = turn * (exp1(1j * kappa) - exp1(1j * kappa * growth))
        _, got = theory.launch_displacement(times, speed, omega, **drag_of(constant))
        np.testing.assert_allclose(got, expected, rtol=1e-12)

    @pytest.mark.parametrize("power", [1.0, 1 / 0.354, 1 / 1.4275])
    def test_both_routes_agree_where_they_meet(self, power):
        # omega t about 40: quadrature alone below, asymptotic tails above.
        for omega in (0.1, 30.0, 1e3):
            change = 1e-13
            times = theory.ASYMPTOTIC_PHASE / omega * np.array([1 - change, 1 + change])
            below, above = theory._turned_decay(times, 1.0, power, omega)
            step = 2 * change * times[0] * (1 + times[0]) ** -power
            assert abs(above - below) < step + 1e-12 * abs(below)

    @pytest.mark.parametrize("drag", LAWS, ids=lambda drag: drag.kind)
    def test_no_field_and_time_zero(self, drag):
        times = np.array([0.0, 1e-14, 1e-3, 1.0, 1e3])
        sphere = {"radius": RADIUS, "mass": 1e-3, "drag": drag}
        parallel, perpendicular = theory.launch_displacement(times, 3.0, 0.0, **sphere)
        np.testing.assert_allclose(perpendicular.real, parallel, rtol=1e-13)
        assert not perpendicular.imag.any()
        assert parallel[0] == 0.0
        assert parallel[1] == pytest.approx(3e-14, rel=1e-12)
        _, slow = theory.launch_displacement(times, 3.0, 1e-18, **sphere)
        np.testing.assert_allclose(slow, perpendicular, rtol=1e-12)
        single = theory.launch_displacement(1.0, 3.0, 5.0, **sphere)
        assert single[0].shape == single[1].shape == ()

    @pytest.mark.parametrize("kind", ["constant", "stokes", "chow"])
    def test_vanishing_drag_is_no_drag(self, kind):
        times = np.array([1e-6, 0.3, 9.0, 200.0])
        thin = DragLaw(kind, 1e-30, 1e-30, 0.5 if kind == "constant" else None)
        none = theory.launch_displacement(times, 2.0, 7.0, radius=0.1, mass=1.0, drag=DragLaw())
        expected = 2.0 * (1 - np.exp(-7j * times)) / 7j
        np.testing.assert_allclose(none[1][1:], expected[1:], rtol=1e-12)
        got = theory.launch_displacement(times, 2.0, 7.0, radius=0.1, mass=1.0, drag=thin)
        for part in range(2):
            np.testing.assert_allclose(got[part], none[part], rtol=1e-12)

    def test_parallel_part_is_the_closed_form(self):
        times = np.logspace(-10, 6, 9)
        sphere = {"radius": RADIUS, "mass": MASS}
        k = theory.drag_constant(0.5, 1.225, RADIUS, DENSITY)
        parallel, _ = theory.launch_displacement(times, SPEED, 5.0, **sphere, drag=CONSTANT)
        np.testing.assert_allclose(parallel, theory.quadratic_distance(times, SPEED, k), rtol=1e-14)
        speed = theory.speed_history(times, SPEED, **sphere, drag=CONSTANT)
        np.testing.assert_allclose(speed, theory.quadratic_speed(times, SPEED, k), rtol=1e-14)
        tau = theory.stokes_time(RADIUS, DENSITY, AIR["viscosity"])
        parallel, _ = theory.launch_displacement(times, SPEED, 5.0, **sphere, drag=STOKES)
        np.testing.assert_allclose(parallel, theory.stokes_distance(times, SPEED, tau), rtol=1e-14)
        speed = theory.speed_history(times, SPEED, **sphere, drag=STOKES)
        np.testing.assert_allclose(speed, theory.stokes_speed(times, SPEED, tau), rtol=1e-14)

    def test_chow_through_all_its_pieces(self):
        # From Re = 5e6 to creeping flow, integrated piece by piece between the kinks of C_D.
        radius, mass, speed, omega = 0.05, 1e-3, 735.0, 0.5
        per_speed = theory.reynolds_number(1.0, radius, 1.225, 1.8e-5)
        state, times = np.array([speed, 0.0, 0.0, 0.0]), [0.0]
        sphere = {"radius": radius, "mass": mass, "drag": CHOW}
        for limit in (2e6, 3e5, 400.0, 1.0, 0.2):

            def rhs(t, y, slowest=limit / per_speed):
                # The piece's own C_D also just past its end, where the solver looks for it.
                v = max(y[0], np.nextafter(slowest, np.inf))
                resistance = theory.drag_resistance(v, radius, CHOW)
                return [-resistance * y[0] / mass, y[0], y[0] * np.cos(omega * t),
                        -y[0] * np.sin(omega * t)]  # fmt: skip

            def reached(t, y, slowest=limit / per_speed):
                return y[0] - slowest

            reached.terminal = True
            solution = solve_ivp(
                rhs, (times[-1], 1e6), state, method="DOP853", rtol=1e-13, atol=1e-16,
                events=reached,
            )  # fmt: skip
            state = solution.y[:, -1]
            times.append(solution.t[-1])
            got = theory.launch_displacement(times[-1], speed, omega, **sphere)
            assert float(got[0]) == pytest.approx(state[1], rel=1e-12)
            assert abs(got[1] - (state[2] + 1j * state[3])) < 2e-12 * abs(got[1])
            history = theory.speed_history(times[-1], speed, **sphere)
            assert float(history) == pytest.approx(state[0], rel=3e-12)
        assert len(theory.slowing_phases(speed, **sphere)) == 5

    def test_displacement_is_the_integral_of_the_speed_history(self):
        sphere = {"radius": 0.01, "mass": 1e-4, "drag": CHOW}

        def speed(t):
            return theory.speed_history(t, 5.0, **sphere)

        parallel, perpendicular = theory.launch_displacement(2.0, 5.0, 4.0, **sphere)
        options = {"epsabs": 0, "epsrel": 1e-13, "limit": 200}
        real, _ = quad(lambda t: speed(t) * np.cos(4 * t), 0, 2, **options)
        imaginary, _ = quad(lambda t: -speed(t) * np.sin(4 * t), 0, 2, **options)
        assert float(parallel) == pytest.approx(quad(speed, 0, 2, **options)[0], rel=1e-12)
        assert complex(perpendicular) == pytest.approx(real + 1j * imaginary, rel=1e-12)

    @pytest.mark.parametrize("drag", [STOKES, CHOW], ids=lambda drag: drag.kind)
    def test_terminal_spheroid_is_the_late_one(self, drag):
        sphere = {"radius": 0.01, "mass": 1e-5, "drag": drag}
        for omega in (0.0, 0.3, -40.0):
            late = theory.launch_displacement(1e4, 2.0, omega, **sphere)
            final = theory.terminal_displacement(2.0, omega, **sphere)
            assert float(late[0]) == pytest.approx(final[0], rel=1e-12)
            assert abs(late[1] - final[1]) < 1e-12 * abs(final[1])
            axes = theory.terminal_spheroid(0.5, 2.0, omega, **sphere)
            assert axes == pytest.approx((0.5 + final[0], abs(0.5 + final[1])), rel=1e-14)

    def test_terminal_spheroid_of_a_point_under_stokes_drag(self):
        tau, omega, mass = 2.5, 1.4, 0.3
        drag = DragLaw("stokes", viscosity=mass / tau / (6 * np.pi * 0.1))
        axes = theory.terminal_spheroid(0.0, 3.0, omega, radius=0.1, mass=mass, drag=drag)
        assert axes[0] == pytest.approx(3.0 * tau, rel=1e-14)
        assert axes[0] / axes[1] == pytest.approx(np.hypot(1, omega * tau), rel=1e-14)

    @pytest.mark.parametrize("drag", [DragLaw(), CONSTANT, DragLaw("stokes")])
    def test_no_terminal_spheroid(self, drag):
        with pytest.raises(ValueError, match="travels without limit"):
            theory.terminal_spheroid(1.0, 2.0, 3.0, radius=0.1, mass=1.0, drag=drag)

    @pytest.mark.parametrize(
        ("time", "speed", "radius", "message"),
        [(-1.0, 1.0, 1.0, "times"), (1.0, -1.0, 1.0, "speed"), (1.0, 1.0, 0.0, "radius")],
    )
    def test_impossible_input(self, time, speed, radius, message):
        with pytest.raises(ValueError, match=message):
            theory.launch_displacement(time, speed, 1.0, radius=radius, mass=1.0, drag=CHOW)

    def test_nothing_launched_goes_nowhere(self):
        for drag in LAWS:
            got = theory.launch_displacement([0.0, 5.0], 0.0, 2.0, radius=1, mass=1, drag=drag)
            assert not got[0].any()
            assert not got[1].any()


def section_6(**changes):
    content = {
        "name": "magnetic_blast",
        "particles": {
            "count": COUNT,
            "radius": RADIUS,
            "density": DENSITY,
            "charge_per_mass": CHARGE,
            "packing": {"method": "rsa", "domain_radius": 1.0},
        },
        "blast": {"energy": ENERGY},
        "fields": {"electric": [0.0, 0.0, 0.0], "magnetic": [10.0, 0.0, 0.0]},
        "medium": {**AIR, "drag": "chow"},
        "time": {"duration": 1.0, "step": 1.0e-4},
    }
    return content | changes


def numbers_of(folder="", **changes):
    return derive_numbers(parse_case(section_6(**changes), folder))


def few(**changes):
    return section_6()["particles"] | {"count": 30} | changes


class TestDerivedNumbers:
    def test_section_6(self):
        numbers = numbers_of()
        expected = {
            "particle_count": 2000,
            "particle_mass": 3.6652,
            "volume_fraction": 0.25,
            "pulse_speed": 1.6518,
            "cyclotron_frequency": 100.0,
            "cyclotron_radius": 0.016518,
            "reynolds_number": 11241,
            "drag_coefficient": 0.5,
            "drag_length": 1 / 6.5625e-4,
            "force_ratio": 2 * 46126,
            "force_ratio_unit_coefficient": 46126,
            "steps_per_gyration": 2 * np.pi * 100,
        }
        for name, value in expected.items():
            assert numbers[name].value == pytest.approx(value, rel=3e-5), name
        radius = numbers["launch_radius"].value
        # The outermost centre is 0.95 m from the origin, and the centre of mass a little off it.
        assert 0.93 < radius < 0.97
        # One second is 100 rad: the cloud is long along B and hardly wider than it was.
        assert numbers["semi_axis_parallel"].value == pytest.approx(radius + 1.651, abs=1e-3)
        assert numbers["semi_axis_perpendicular"].value == pytest.approx(radius, abs=0.034)
        assert numbers["terminal_semi_axis_parallel"].value > 1000

    def test_large_clouds_are_not_packed(self):
        particles = few(count=10**9, radius=1e-4, positive_fraction=0.5)
        numbers = numbers_of(particles=particles)
        assert numbers["launch_radius"].value == 1.0 - 1e-4
        assert "estimate" in numbers["launch_radius"].note
        assert numbers["cyclotron_frequency"].value == (-100.0, 100.0)
        assert numbers["semi_axis_parallel"].value > 1.0

    def test_absent_quantities_say_why(self):
        still = {"fields": {}, "medium": {}, "particles": few(charge_per_mass=0.0)}
        case = section_6(**still)
        del case["blast"]
        numbers = derive_numbers(parse_case(case, ""))
        present = {row.name for row in numbers.rows if row.value is not None}
        cloud = {"particle_count", "particle_mass", "total_mass", "volume_fraction"}
        assert present == cloud | {"launch_radius"}
        assert all(row.note for row in numbers.rows if row.value is None)
        assert numbers["pulse_speed"].note == "no blast"
        assert numbers["cyclotron_period"].note == "no magnetic field"
        assert numbers["reynolds_number"].note == "no drag"

    def test_particles_of_several_kinds_give_ranges(self, tmp_path):
        rows = ["x,y,z,radius,density,charge_per_mass", "-1,0,0,0.1,1000,2", "2,0,0,0.2,1000,-2"]
        (tmp_path / "two.csv").write_text("\n".join(rows) + "\n")
        numbers = numbers_of(tmp_path, particles={"file": "two.csv"})
        low, high = numbers["particle_mass"].value
        assert high == pytest.approx(8 * low)
        assert numbers["cyclotron_frequency"].value == (-20.0, 20.0)
        assert numbers["cyclotron_period"].value == pytest.approx(np.pi / 10)
        assert isinstance(numbers["reynolds_number"].value, tuple)
        assert numbers["volume_fraction"].value is None
        assert "size" in numbers["semi_axis_parallel"].note
        # Without drag, size does not matter, and neither does the sign of the charge.
        free = numbers_of(tmp_path, particles={"file": "two.csv"}, medium={})
        assert free["semi_axis_parallel"].value > 2.0

    def test_moving_particles_and_wind(self, tmp_path):
        header = "x,y,z,radius,density,charge_per_mass,vx,vy,vz"
        rows = [header, "-1,0,0,0.1,1000,2,0,0,1", "1,0,0,0.1,1000,2,0,0,0"]
        (tmp_path / "two.csv").write_text("\n".join(rows) + "\n")
        numbers = numbers_of(tmp_path, particles={"file": "two.csv"})
        low, high = numbers["cyclotron_radius"].value
        assert high > low > 0
        assert numbers["semi_axis_parallel"].note == "the particles move before the pulse"
        wind = {**AIR, "drag": "chow", "velocity": [0.0, 0.0, 2.0]}
        numbers = numbers_of(particles=few(), medium=wind)
        low, high = numbers["reynolds_number"].value
        assert high > low
        assert "medium moves" in numbers["semi_axis_parallel"].note
        assert numbers["force_ratio"].value is None

    def test_electric_field(self):
        fields = {"electric": [0.0, 3.0, 0.0], "magnetic": [0.0, 0.0, 2.0]}
        numbers = numbers_of(particles=few(), fields=fields)
        assert numbers["drift_speed"].value == pytest.approx(1.5)
        assert "not linear in the speed" in numbers["semi_axis_parallel"].note
        speed = numbers["pulse_speed"].value
        # Launched along -x, v x B adds to E.
        parity = numbers["parity_electric_field"].value
        assert numbers["force_ratio"].value == pytest.approx((3 + 2 * speed) / parity)
        linear = numbers_of(particles=few(), fields=fields, medium={})
        assert "centre that moves" in linear["semi_axis_parallel"].note
        assert linear["semi_axis_parallel"].value > 1.0
        mixed = numbers_of(particles=few(positive_fraction=0.5), fields=fields, medium={})
        assert mixed["semi_axis_parallel"].value == linear["semi_axis_parallel"].value

    def test_verlet_is_warned_about(self):
        verlet = {"duration": 1.0, "step": 1e-4, "integrator": "verlet"}
        note = numbers_of(particles=few(), time=verlet)["steps_per_gyration"].note
        assert "2.72" in note
        assert "WARNING" not in note
        coarse = {"duration": 1.0, "step": 1e-2, "integrator": "verlet"}
        note = numbers_of(particles=few(), time=coarse)["steps_per_gyration"].note
        assert note.startswith("WARNING: fewer than 20 steps")
        lorentz = {"duration": 1.0, "step": 1e-2}
        assert numbers_of(particles=few(), time=lorentz)["steps_per_gyration"].note == ""

    @pytest.mark.parametrize("drag", ["none", "constant", "chow", "stokes"])
    @pytest.mark.parametrize("fields", [{}, {"magnetic": [0.0, 1.0, 0.0]}])
    def test_json_is_finite_for_every_law(self, drag, fields):
        content = {"drag": drag} | (AIR if drag in ("constant", "chow") else {"viscosity": 1e-5})
        content |= {"drag_coefficient": 0.4} if drag == "constant" else {}
        numbers = json.loads(numbers_of(particles=few(), medium=content, fields=fields).to_json())
        absent = [name for name, value in numbers.items() if value is None]
        assert all(numbers["notes"][name] for name in absent)
        assert numbers["units"]["pulse_speed"] == "m/s"


YAML = """
name: few
particles: {count: 30, radius: 0.05, density: 7000.0, charge_per_mass: 10.0,
            packing: {domain_radius: 1.0}}
blast: {energy: 1.0e4}
fields: {magnetic: [10, 0, 0]}
medium: {drag: chow, density: 1.225, viscosity: 1.8e-5}
time: {duration: 1.0, step: 1.0e-4}
"""


class TestCommand:
    def test_table(self, tmp_path, capsys):
        (tmp_path / "case.yaml").write_text(YAML)
        assert theory.main([str(tmp_path / "case.yaml")]) == 0
        shown = capsys.readouterr().out
        assert "pulse speed" in shown
        assert "eq. 3.4" in shown

    def test_json(self, tmp_path, capsys):
        (tmp_path / "case.yaml").write_text(YAML)
        assert theory.main([str(tmp_path / "case.yaml"), "--json"]) == 0
        numbers = json.loads(capsys.readouterr().out)
        assert numbers["case"] == "few"
        assert numbers["cyclotron_frequency"] == 100.0
        assert numbers["equations"]["cyclotron_frequency"] == "eq. 2.5"
        assert numbers["drift_speed"] is None
        assert "electric" in numbers["notes"]["drift_speed"]

    @pytest.mark.parametrize("text", [None, "name: few\n", YAML.replace("1.225", "-1")])
    def test_invalid_case(self, tmp_path, capsys, text):
        if text is not None:
            (tmp_path / "case.yaml").write_text(text)
        assert theory.main([str(tmp_path / "case.yaml"), "--json"]) == 2
        output = capsys.readouterr()
        assert output.out == ""
        assert output.err.strip()
