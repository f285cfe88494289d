"""What theory says about a case before it runs: its derived numbers, each with unit and equation.

A quantity that has no single meaning for a case is a range, or is absent with the reason; there is
never a number that stands for something else, and never NaN or infinity.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any, TextIO, TypeAlias

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from lammps_blast import interactions, theory
from lammps_blast.case import Case, PackedParticles
from lammps_blast.pairs import (
    PairKinds,
    equilibrium_overlaps,
    near_field_law,
    near_field_sources,
    pair_kinds,
    softened_stiffness,
)
from lammps_blast.particles import create_particles
from lammps_blast.spheroid import drag_law, spheroid_theory
from lammps_blast.step_advice import (
    STEPS_PER_GYRATION,
    TimeScale,
    advised_step,
    contact_scales,
    expected_strain,
    launch_speed,
)
from lammps_blast.theory import DragLaw, Floats

Value: TypeAlias = int | float | tuple[float, float] | None

# Above this, packing a cloud only to learn its outermost centre takes noticeable time.
LARGEST_PACKED_COUNT = 20_000
BEYOND_RANGE = "infinite, or beyond the range of floating-point numbers"
# Quantities of one input value differ from each other by rounding.
SAME = 1e-12


@dataclass(frozen=True)
class DerivedNumber:
    """One quantity of a case.

    Attributes
    ----------
    name
        In snake_case; the key in JSON.
    symbol
        As in the paper, in ASCII.
    value
        A number, a pair (smallest, largest) where particles differ, or None where the case has no
        such quantity.
    unit
        SI; empty for a pure number.
    source
        Equation of the paper or section of `theory` that it comes from.
    note
        The reason for a None, or a remark.
    """

    name: str
    symbol: str
    value: Value
    unit: str
    source: str
    note: str = ""


@dataclass(frozen=True)
class DerivedNumbers:
    """The derived numbers of one case, in the order of the table."""

    case_name: str
    rows: tuple[DerivedNumber, ...]

    def __getitem__(self, name: str) -> DerivedNumber:
        """Return the row of this name; KeyError if there is none."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(name)

    def to_json(self) -> str:
        """Return a JSON object: `case`, a key per quantity, `units`, `equations` and `notes`.

        A range is a list [smallest, largest]; an absent quantity is null, with its reason in
        `notes`.
        """
        content: dict[str, Any] = {"case": self.case_name}
        content |= {row.name: row.value for row in self.rows}
        content["units"] = {row.name: row.unit for row in self.rows}
        content["equations"] = {row.name: row.source for row in self.rows}
        content["notes"] = {row.name: row.note for row in self.rows if row.note}
        return json.dumps(content, indent=2, allow_nan=False)

    def print_table(self, file: TextIO | None = None) -> None:
        """Print the numbers as a table, to standard output or to a text file."""
        table = Table(title=f"Derived numbers of {self.case_name}", title_justify="left")
        for heading in ("quantity", "symbol", "value", "unit", "source"):
            table.add_column(heading, overflow="fold")
        for row in self.rows:
            cells = (row.name.replace("_", " "), row.symbol, _shown(row), row.unit, row.source)
            table.add_row(*map(escape, cells))
        console = Console(file=file, highlight=False)
        console.print(table)
        for row in self.rows:
            if row.note and row.value is not None:
                console.print(f"{row.name.replace('_', ' ')}: {row.note}", markup=False)


def _shown(row: DerivedNumber) -> str:
    if row.value is None:
        return f"n/a: {row.note}"
    if isinstance(row.value, tuple):
        return f"{row.value[0]:.6g} to {row.value[1]:.6g}"
    return f"{row.value:.6g}" if isinstance(row.value, float) else f"{row.value:d}"


def derive_numbers(case: Case) -> DerivedNumbers:
    """Return everything that theory says about a case.

    Raises
    ------
    CaseError
        If the particles cannot be made.
    """
    # Absurd magnitudes overflow; `_row` reports what is not finite as absent.
    with np.errstate(all="ignore"):
        launch = _launch(case)
        groups: Iterable[Iterator[DerivedNumber]] = (
            _cloud_rows(launch),
            _pulse_rows(launch),
            _gyration_rows(launch),
            _drag_rows(launch),
            _force_rows(launch),
            _spheroid_rows(launch),
            _terminal_rows(launch),
            _contact_rows(launch),
            _near_field_rows(launch),
            _step_rows(launch),
        )
        return DerivedNumbers(case.name, tuple(row for group in groups for row in group))


@dataclass(frozen=True)
class _Launch:
    """A case right after its pulse; arrays hold a value per particle, or one for equal ones."""

    case: Case
    drag: DragLaw
    count: int
    radius: Floats  # m
    density: Floats  # kg/m3
    charge_per_mass: Floats  # C/kg
    total_mass: float  # kg
    pulse_speed: float | None  # m/s
    speed: Floats | str  # |v| in m/s, or why it is not known
    relative_speed: Floats | str  # |v_f - v| in m/s, or why it is not known
    at_rest_before: bool
    launch_radius: float  # m, of the centres
    launch_radius_note: str
    largest_speed: float  # m/s, that no particle exceeds
    pairs: PairKinds | None  # None of a single particle
    advice: tuple[float, TimeScale] | str  # a step in s and what limits it, or why there is none

    @property
    def electric(self) -> Floats:
        return np.array(self.case.fields.electric)

    @property
    def magnetic(self) -> Floats:
        return np.array(self.case.fields.magnetic)

    @property
    def wind(self) -> bool:
        return any(self.case.medium.velocity) and self.drag.kind != "none"


def _launch(case: Case) -> _Launch:
    medium = case.medium
    drag = drag_law(medium)
    packed = case.particles
    if isinstance(packed, PackedParticles) and packed.count > LARGEST_PACKED_COUNT:
        return _launch_of_many(case, packed, drag)
    particles = create_particles(case)
    offset = particles.position - theory.centre_of_mass(particles.position, particles.mass)
    total_mass = float(np.sum(particles.mass))
    pulse = _pulse_speed(case, total_mass)
    at_rest = not np.any(particles.velocity)
    velocity: Floats | str = particles.velocity
    if pulse is not None and not (at_rest and not any(medium.velocity)):
        try:
            directions = theory.launch_directions(particles.position, particles.mass)
            velocity = particles.velocity + pulse * directions
        except ValueError as error:
            velocity = str(error)
    speed, relative = _speeds(velocity, np.array(medium.velocity))
    if at_rest and not any(medium.velocity):
        speed = relative = np.array([pulse or 0.0])
    elif at_rest:
        speed = np.array([pulse or 0.0])
    sources = near_field_sources(
        case, particles.radius, particles.mass, particles.charge, particles.sign
    )
    return _Launch(
        case=case,
        drag=drag,
        count=len(particles.radius),
        radius=np.asarray(particles.radius),
        density=np.asarray(particles.density),
        charge_per_mass=np.asarray(particles.charge_per_mass),
        total_mass=total_mass,
        pulse_speed=pulse,
        speed=speed,
        relative_speed=relative,
        at_rest_before=at_rest,
        launch_radius=float(np.linalg.norm(offset, axis=1).max()),
        launch_radius_note="",
        largest_speed=launch_speed(case, particles),
        pairs=pair_kinds(particles.radius, particles.mass, sources) if len(particles) > 1 else None,
        advice=advised_step(case, particles) or "nothing limits the step",
    )


def _launch_of_many(case: Case, packed: PackedParticles, drag: DragLaw) -> _Launch:
    """The launch of a cloud too large to be packed here: only positions are not known."""
    total_mass = packed.count * float(theory.sphere_mass(packed.radius, packed.density))
    pulse = _pulse_speed(case, total_mass)
    positive = round(packed.positive_fraction * packed.count)
    signs = [1.0] * (positive > 0) + [-1.0] * (positive < packed.count)
    speed = np.array([pulse or 0.0])
    charge_per_mass = packed.charge_per_mass * np.array(signs)
    relative: Floats | str = speed
    if any(case.medium.velocity):
        relative = f"not worked out for more than {LARGEST_PACKED_COUNT} particles in a wind"
    return _Launch(
        case=case,
        drag=drag,
        count=packed.count,
        radius=np.array([packed.radius]),
        density=np.array([packed.density]),
        charge_per_mass=charge_per_mass,
        total_mass=total_mass,
        pulse_speed=pulse,
        speed=speed,
        relative_speed=relative,
        at_rest_before=True,
        launch_radius=packed.packing.domain_radius - packed.radius,
        launch_radius_note=(
            "estimate, domain radius less particle radius, to which the outermost centres come "
            f"close: more than {LARGEST_PACKED_COUNT} particles are not packed for this table"
        ),
        largest_speed=pulse or 0.0,
        pairs=_pairs_of_many(case, packed, charge_per_mass),
        advice=f"not worked out for more than {LARGEST_PACKED_COUNT} particles; a run warns",
    )


def _pairs_of_many(case: Case, packed: PackedParticles, charge_per_mass: Floats) -> PairKinds:
    """The pairs of equal particles that differ in charge at most, two or more of each."""
    charge_per_mass = np.repeat(charge_per_mass, 2)
    ones = np.ones(len(charge_per_mass))
    mass = ones * theory.sphere_mass(packed.radius, packed.density)
    radius = ones * packed.radius
    sources = near_field_sources(case, radius, mass, charge_per_mass * mass, ones)
    return pair_kinds(radius, mass, sources)


def _pulse_speed(case: Case, total_mass: float) -> float | None:
    return None if case.blast is None else float(theory.pulse_speed(case.blast.energy, total_mass))


def _speeds(velocity: Floats | str, medium: Floats) -> tuple[Floats | str, Floats | str]:
    if isinstance(velocity, str):
        return velocity, velocity
    return np.linalg.norm(velocity, axis=1), np.linalg.norm(medium - velocity, axis=1)


def _row(
    name: str, symbol: str, value: Any, unit: str, source: str, note: str = ""
) -> DerivedNumber:
    """Make a row of a number, of an array (a range where it varies) or of a reason (text)."""
    if isinstance(value, str):
        return DerivedNumber(name, symbol, None, unit, source, value)
    if isinstance(value, int):
        return DerivedNumber(name, symbol, value, unit, source, note)
    smallest, largest = float(np.min(value)), float(np.max(value))
    if not (np.isfinite(smallest) and np.isfinite(largest)):
        return DerivedNumber(name, symbol, None, unit, source, BEYOND_RANGE)
    if largest - smallest <= SAME * max(abs(smallest), abs(largest)):
        return DerivedNumber(name, symbol, largest, unit, source, note)
    return DerivedNumber(name, symbol, (smallest, largest), unit, source, note)


def _differ(values: Floats) -> bool:
    return bool(np.ptp(values) > SAME * np.abs(values).max())


def _cloud_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    mass = theory.sphere_mass(launch.radius, launch.density)
    packed = launch.case.particles
    fraction: float | str = "no domain: the particles are from a file"
    if isinstance(packed, PackedParticles):
        fraction = packed.count * (packed.radius / packed.packing.domain_radius) ** 3
    yield _row("particle_count", "N", launch.count, "", "case")
    yield _row("particle_mass", "m", mass, "kg", "section 3.1")
    yield _row("total_mass", "M", launch.total_mass, "kg", "eq. 3.4")
    yield _row("volume_fraction", "N R^3/R_dom^3", fraction, "", "case")
    note = launch.launch_radius_note
    yield _row("launch_radius", "R0", launch.launch_radius, "m", "eq. 3.1", note)


def _pulse_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    pulse = "no blast" if launch.pulse_speed is None else launch.pulse_speed
    yield _row("pulse_speed", "|dv|", pulse, "m/s", "eq. 3.4")


def _gyration_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    omega = _gyration(launch)
    radius = omega if isinstance(omega, str) else _cyclotron_radius(launch.speed, omega)
    period = omega if isinstance(omega, str) else theory.cyclotron_period(omega[omega != 0])
    steps = period if isinstance(period, str) else period / launch.case.time.longest_step
    yield _row("cyclotron_frequency", "omega", omega, "rad/s", "eq. 2.5", _signs(omega))
    note = "of the launch speed, if it is all across B"
    yield _row("cyclotron_radius", "R_c", radius, "m", "eq. 2.6", note)
    yield _row("cyclotron_period", "T", period, "s", "eq. 2.10")
    note = _verlet_note(launch, omega, steps)
    yield _row("steps_per_gyration", "T/step", steps, "", "eq. 2.10", note)
    yield _row("drift_speed", "|E x B|/B^2", _drift(launch), "m/s", "E x B drift")


def _gyration(launch: _Launch) -> Floats | str:
    if not launch.magnetic.any():
        return "no magnetic field"
    omega = theory.cyclotron_frequency(launch.charge_per_mass, launch.magnetic)
    return omega if omega.any() else "no charge"


def _cyclotron_radius(speed: Floats | str, omega: Floats) -> Floats | str:
    if isinstance(speed, str):
        return speed
    if not speed.any():
        return "nothing moves at the start"
    speed, omega = np.broadcast_arrays(speed, omega)
    return theory.cyclotron_radius(speed[omega != 0], omega[omega != 0])


def _signs(omega: Floats | str) -> str:
    if isinstance(omega, str) or omega.min() >= 0 or omega.max() <= 0:
        return ""
    return "charges of both signs: they turn in opposite senses"


def _verlet_note(launch: _Launch, omega: Floats | str, steps: Floats | str) -> str:
    if isinstance(omega, str) or isinstance(steps, str):
        return ""
    if launch.case.time.integrator != "verlet":
        return ""
    turn = np.abs(omega).max() * launch.case.time.step
    growth = np.exp(min(launch.case.time.steps * np.log1p(turn**2), 700.0))
    note = f"verlet multiplies the gyration energy by about {growth:.3g} over this run"
    if steps.min() < STEPS_PER_GYRATION:
        few = f"WARNING: fewer than {STEPS_PER_GYRATION} steps do not resolve a gyration; "
        note = few + note
    return note


def _drift(launch: _Launch) -> float | str:
    if not (launch.electric.any() and launch.magnetic.any()):
        return "needs an electric and a magnetic field"
    if not launch.charge_per_mass.any():
        return "no charge"
    cross = np.cross(launch.electric, launch.magnetic)
    return float(np.linalg.norm(cross) / (launch.magnetic @ launch.magnetic))


def _drag_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    drag, radius, density = launch.drag, launch.radius, launch.density
    speed = _drag_speed(launch)
    reynolds: Any = speed
    if not isinstance(speed, str):
        reynolds = "no viscosity"
        if drag.viscosity > 0 and drag.density > 0:
            reynolds = theory.reynolds_number(speed, radius, drag.density, drag.viscosity)
        elif drag.viscosity > 0:
            reynolds = "the medium has no density"
    yield _row("reynolds_number", "Re", reynolds, "", "section 4.2", "at launch")
    yield from _quadratic_rows(launch, speed)
    tau: Any = f"not Stokes drag: {drag.kind}"
    if drag.kind in ("stokes", "chow"):
        tau = theory.stokes_time(radius, density, drag.viscosity)
    note = "at Re <= 1" if drag.kind == "chow" else ""
    yield _row("stokes_time", "tau", tau, "s", "eq. A.4", note)


def _quadratic_rows(launch: _Launch, speed: Floats | str) -> Iterator[DerivedNumber]:
    drag, radius, density = launch.drag, launch.radius, launch.density
    coefficient: Any = speed
    if not isinstance(speed, str):
        coefficient = theory.drag_coefficient(speed, radius, drag)
        if drag.kind == "stokes" and drag.density == 0:
            coefficient = "the medium has no density"
    length = ratio = coefficient
    if not isinstance(coefficient, str):
        length = 1.0 / theory.drag_constant(coefficient, drag.density, radius, density)
        ratio = "no viscosity"
        if drag.viscosity > 0:
            ratio = theory.stokes_to_quadratic_ratio(
                speed, radius, drag.density, drag.viscosity, coefficient
            )
    note = "at launch" + (": 24/Re, what Stokes drag amounts to" if drag.kind == "stokes" else "")
    yield _row("drag_coefficient", "C_D", coefficient, "", "eq. 4.2", note)
    if drag.kind == "stokes":
        length = "the law is not quadratic: Stokes drag"
    yield _row("drag_length", "1/K", length, "m", "eq. 4.3", "with C_D at launch")
    yield _row("stokes_to_drag_ratio", "|F_St|/|F|", ratio, "", "eq. 4.14", "at launch")


def _drag_speed(launch: _Launch) -> Floats | str:
    """Launch speeds relative to the medium, or why drag at launch has no meaning."""
    if launch.drag.kind == "none":
        return "no drag"
    if not isinstance(launch.relative_speed, str) and not launch.relative_speed.all():
        return "nothing moves against the medium at the start"
    return launch.relative_speed


def _force_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    unavailable = _no_force_ratio(launch)
    own: Any = unavailable or theory.drag_coefficient(
        launch.relative_speed, launch.radius, launch.drag
    )
    note = "largest over the launch directions"
    with_own = unavailable or _largest_force_ratio(launch, own)
    with_one = unavailable or _largest_force_ratio(launch, 1.0)
    yield _row("force_ratio", "lambda", with_own, "", "eq. 5.4", note)
    note = "as eq. 6.3 has it: " + note
    yield _row("force_ratio_unit_coefficient", "lambda(C_D=1)", with_one, "", "eq. 5.4", note)
    electric = unavailable or theory.parity_electric_field(
        launch.relative_speed, **_particle_and_medium(launch), drag_coefficient=own
    )
    magnetic = unavailable or theory.parity_magnetic_field(
        launch.speed, **_particle_and_medium(launch), drag_coefficient=own
    )
    note = "at launch, with C_D of the law"
    yield _row("parity_electric_field", "|E|", electric, "V/m", "eq. 5.7", note)
    yield _row("parity_magnetic_field", "|B|", magnetic, "T", "eq. 5.8", note)


def _no_force_ratio(launch: _Launch) -> str:
    """Why electromagnetic force and drag cannot be compared at launch; empty if they can."""
    speed = _drag_speed(launch)
    if isinstance(speed, str):
        return speed
    if launch.wind or not launch.at_rest_before:
        return "particles differ in speed or direction against the medium at launch"
    if not launch.charge_per_mass.all():
        return "no charge" if not launch.charge_per_mass.any() else "some particles have no charge"
    return "the medium has no density" if launch.drag.density == 0 else ""


def _particle_and_medium(launch: _Launch) -> dict[str, Any]:
    return {
        "charge_per_mass": launch.charge_per_mass,
        "radius": launch.radius,
        "density": launch.density,
        "medium_density": launch.drag.density,
    }


def _largest_force_ratio(launch: _Launch, drag_coefficient: Any) -> Floats | str:
    if not (launch.electric.any() or launch.magnetic.any()):
        return "no field"
    speed = float(np.max(launch.speed))
    return theory.force_ratio(
        speed * _strongest_direction(launch.electric, launch.magnetic),
        **_particle_and_medium(launch),
        electric=launch.electric,
        magnetic=launch.magnetic,
        drag_coefficient=drag_coefficient,
    )


def _strongest_direction(electric: Floats, magnetic: Floats) -> Floats:
    """The unit vector n for which |E + v n x B| is largest: n x B along E's part across B."""
    if not magnetic.any():
        return np.array([1.0, 0.0, 0.0])
    # A vector along B is no help; the coordinate axis farthest from B is always one across it.
    for other in (electric, np.eye(3)[np.argmin(np.abs(magnetic))]):
        across = np.cross(magnetic / np.linalg.norm(magnetic), other)
        if np.linalg.norm(across) > SAME * np.linalg.norm(other):
            break
    return across / np.linalg.norm(across)


def _spheroid_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    note = "at the end" + _spheroid_note(launch)
    parallel, perpendicular = _semi_axes(launch, launch.case.time.duration)
    yield _row("semi_axis_parallel", "a_par", parallel, "m", "spheroid theorem", note)
    yield _row("semi_axis_perpendicular", "a_perp", perpendicular, "m", "spheroid theorem", note)


def _terminal_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    note = "after infinite time" + _spheroid_note(launch)
    parallel, perpendicular = _semi_axes(launch, None)
    yield _row("terminal_semi_axis_parallel", "a_par(inf)", parallel, "m", "spheroid theorem", note)
    yield _row(
        "terminal_semi_axis_perpendicular",
        "a_perp(inf)",
        perpendicular,
        "m",
        "spheroid theorem",
        note,
    )


def _semi_axes(launch: _Launch, time: float | None) -> tuple[Any, Any]:
    """Semi-axes at a time, or after infinite time for None; or why there are none, twice."""
    if time is None and launch.drag.kind in ("none", "constant"):
        reason = f"{launch.drag.kind} drag: the particles travel without limit"
        return reason, reason
    if launch.pulse_speed is None:
        return "no blast", "no blast"
    expected = spheroid_theory(
        launch.case,
        radius=launch.radius,
        mass=theory.sphere_mass(launch.radius, launch.density),
        charge_per_mass=launch.charge_per_mass,
        speed=launch.pulse_speed if launch.at_rest_before else None,
    )
    if isinstance(expected, str):
        return expected, expected
    try:
        if time is None:
            return expected.terminal_semi_axes(launch.launch_radius)
        return expected.semi_axes(launch.launch_radius, time)
    except (ValueError, OverflowError):
        return BEYOND_RANGE, BEYOND_RANGE


def _contact_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    contact, pairs = launch.case.contact, launch.pairs
    unavailable = "no contact" if contact is None else "a single particle" if pairs is None else ""
    stiffness: Any = unavailable
    strain: Any = unavailable
    scales: dict[str, float] = {}
    if contact is not None and pairs is not None:
        stiffness = softened_stiffness(contact) if not contact.is_stock else f"law {contact.law}"
        strain = expected_strain(launch.case, pairs, launch.largest_speed)
        found = contact_scales(launch.case, pairs, launch.largest_speed)
        scales = {scale.name: scale.seconds for scale in found}
    yield _row("contact_stiffness", "K_p", stiffness, "N/m2", "eq. 7.20")
    yield _row("launch_strain", "E", strain, "", "eq. 7.5", _strain_note(strain))
    for name, symbol, scale, source, absent in (
        ("contact_time", "pi sqrt(m_eff/k)", "contact", "eq. 7.5", "no contact"),
        ("dissipation_time", "m_eff/(c_cd A)", "dissipation", "eq. 7.10", "no damping"),
        ("friction_time", "sqrt(m_eff/(K_f A))", "friction", "eq. 7.12", "no friction"),
    ):
        seconds = scales.get(scale, unavailable or absent)
        yield _row(name, symbol, seconds, "s", source, "shortest, at the strain of launch or 0.1")


def _strain_note(strain: Floats | str) -> str:
    note = "of two particles that meet head on at twice the launch speed, by energy"
    if not isinstance(strain, str) and np.max(strain) >= interactions.LARGEST_STRAIN:
        note = f"WARNING: {interactions.LARGEST_STRAIN:g} or more, too soft a contact; {note}"
    return note


def _near_field_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    section, contact, pairs = launch.case.near_field, launch.case.contact, launch.pairs
    force: Any = "no near field" if section is None else "a single particle"
    strain: Any = force
    if section is not None and pairs is not None:
        law = near_field_law(section)
        force = interactions.near_field_force(pairs.reach, pairs.source_product, law)
        strain = "no contact"
        if contact is not None:
            overlaps = equilibrium_overlaps(contact, law, pairs)
            strain = f"the contact resists at no strain below {interactions.LARGEST_STRAIN:g}"
            if None not in overlaps:
                strain = np.array(overlaps, dtype=float) / pairs.reach
    note = "positive where it attracts"
    yield _row("near_field_at_touch", "F_nf", force, "N", "eq. 7.23", note)
    note = "where contact and near field of two particles alone balance"
    yield _row("equilibrium_strain", "E_eq", strain, "", "eq. 7.5, 7.23", note)


def _step_rows(launch: _Launch) -> Iterator[DerivedNumber]:
    step: Any = launch.advice
    note = ""
    if not isinstance(launch.advice, str):
        step, scale = launch.advice
        note = f"limited by {scale.name}: 1/{scale.steps:g} of {scale.seconds:.3g} s"
    yield _row("advised_step", "dt", step, "s", "step advice", note)


def _spheroid_note(launch: _Launch) -> str:
    note = ", of the particle centres"
    if launch.case.interacts:
        note += ", as if particles did not interact"
    if launch.launch_radius_note:
        note += ", from the estimate of the launch radius"
    if launch.wind or (launch.electric.any() and launch.charge_per_mass.any()):
        note += ", about a centre that moves"
    return note
