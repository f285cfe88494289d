"""The case file: what is accepted, what is refused, and in which words."""

from __future__ import annotations

import copy
import re
from pathlib import Path
from typing import Any

import pytest

from lammps_blast.case import (
    MAX_FILE_BYTES,
    Case,
    CaseError,
    PackedParticles,
    ParticlesFromFile,
    dump_case,
    load_case,
    parse_case,
)

FOLDER = Path("somewhere")

COMPLETE = """
name: magnetic_blast
title: "A blast: with # signs, 'quotes' and ü"
seed: 2016
particles:
  count: 2000
  radius: 0.05
  density: 7000.0
  charge_per_mass: 10.0
  positive_fraction: 0.5
  packing: {method: rsa, domain_radius: 1.0, relax: true}
blast: {energy: 1.0e4}
fields: {electric: [0, 0, 0], magnetic: [10, 0, 1e-5]}
medium: {density: 1.225, viscosity: 1.8e-5, velocity: [0, 1, 0], drag: chow}
contact:
  law: zohdi
  stiffness: 1.0e7
  exponent: 2
  damping: 1.0e5
  friction: {stiffness: 1.0e6, static: 0.4, dynamic: 0.3}
  thermal: {temperature: 300, reference: 500, sensitivity: 1, floor: 1.0e5}
  rotation: true
bond:
  stiffness: 1.0e6
  exponent: 2
  tangential_stiffness: 1.0e3
  activation_strain: 0.05
  memory: none
near_field:
  scaling: mass
  attraction: {strength: 0.5, exponent: 1}
  repulsion: {strength: 0.01, exponent: 2}
  cutoff: 0.15
  switch_width: 0.02
time:
  duration: 1.0
  step: 1.0e-4
  integrator: verlet
  implicit: {phi: 0.5, iterations: 10, tolerance: 5.0e-4, first_step: 1.0e-5, max_step: 2.5e-4}
output: {interval: 0.02, forces: true, contacts: true, format: binary, restart_interval: 0.25}
"""

MINIMAL: dict[str, Any] = {
    "name": "small",
    "particles": {
        "count": 10,
        "radius": 0.05,
        "density": 7000,
        "charge_per_mass": -1,
        "packing": {"domain_radius": 1},
    },
    "time": {"duration": 1, "step": 1e-4},
}

CONTACTS: dict[str, dict[str, Any]] = {
    "zohdi": {"law": "zohdi", "stiffness": 1e7, "exponent": 2},
    "hooke": {"law": "hooke", "stiffness": 1e5, "damping": 10},
    "hertz": {"law": "hertz", "youngs_modulus": 1e7, "poisson_ratio": 0.3},
    "jkr": {"law": "jkr", "youngs_modulus": 1e7, "poisson_ratio": 0.3, "surface_energy": 0.1},
    "dmt": {"law": "dmt", "youngs_modulus": 1e7, "poisson_ratio": -0.5, "surface_energy": 0.1},
}
FRICTION = {"static": 0.4, "dynamic": 0.4}
THERMAL = {"temperature": 300, "reference": 500, "sensitivity": 1, "floor": 1e5}
BOND = {"stiffness": 1e6, "exponent": 2, "activation_strain": 0.05}
NEAR_FIELD = {
    "scaling": "mass",
    "attraction": {"strength": 0.5, "exponent": 1},
    "repulsion": {"strength": 0.01, "exponent": 2},
    "cutoff": 0.15,
}

TOUCHING: dict[str, Any] = {**MINIMAL, "contact": CONTACTS["zohdi"]}
ATTRACTING: dict[str, Any] = {**MINIMAL, "near_field": NEAR_FIELD}
FROM_FILE: dict[str, Any] = {**MINIMAL, "particles": {"file": "particles.csv"}}
ABSENT = object()


def changed(base: dict[str, Any], path: str, value: object) -> dict[str, Any]:
    """Return a case mapping with the value at a dotted path set, or removed if ABSENT."""
    mapping = copy.deepcopy(base)
    *sections, key = path.split(".")
    section = mapping
    for name in sections:
        section = section.setdefault(name, {})
    if value is ABSENT:
        del section[key]
    else:
        section[key] = value
    return mapping


def problems_of(source: str | dict[str, Any]) -> tuple[str, ...]:
    with pytest.raises(CaseError) as caught:
        parse_case(source, FOLDER)
    problems = caught.value.problems
    assert str(caught.value) == "\n".join(problems)
    assert all(problem.isprintable() for problem in problems)
    return problems


def test_complete_case_holds_the_values_of_the_file() -> None:
    case = parse_case(COMPLETE, FOLDER)
    assert case.name == "magnetic_blast"
    assert case.seed == 2016
    assert isinstance(case.particles, PackedParticles)
    assert case.particles.packing.domain_radius == 1.0
    assert case.particles.positive_fraction == 0.5
    assert case.blast is not None
    assert case.blast.energy == 1e4
    assert case.fields.magnetic == (10.0, 0.0, 1e-5)
    assert case.medium.drag == "chow"
    assert case.contact is not None
    assert (case.contact.stiffness, case.contact.exponent, case.contact.damping) == (1e7, 2, 1e5)
    assert case.contact.friction is not None
    assert (case.contact.friction.static, case.contact.friction.dynamic) == (0.4, 0.3)
    assert case.contact.thermal is not None
    assert case.contact.thermal.floor == 1e5
    assert case.bond is not None
    assert (case.bond.tangential_stiffness, case.bond.memory) == (1e3, "none")
    assert case.near_field is not None
    assert case.near_field.attraction is not None
    assert (case.near_field.attraction.strength, case.near_field.attraction.exponent) == (0.5, 1)
    assert (case.near_field.cutoff, case.near_field.switch_width) == (0.15, 0.02)
    assert case.time.steps == 10_000
    assert (case.output_every, case.restart_every) == (200, 2500)
    assert case.folder == FOLDER


def test_defaults_mean_vacuum_no_fields_no_pulse_and_a_hundred_frames() -> None:
    case = parse_case(MINIMAL, FOLDER)
    assert case.blast is None
    assert case.fields.electric == case.fields.magnetic == (0.0, 0.0, 0.0)
    assert (case.medium.drag, case.medium.density, case.medium.viscosity) == ("none", 0, 0)
    assert case.time.integrator == "lorentz"
    assert case.contact is case.bond is case.near_field is None
    assert not case.interacts
    assert (case.output.interval, case.output.restart_interval) == (0.01, 0.1)
    assert (case.output_every, case.restart_every) == (100, 1000)


def test_default_intervals_are_at_least_one_step() -> None:
    case = parse_case(changed(MINIMAL, "time", {"duration": 0.3, "step": 0.1}), FOLDER)
    assert (case.output_every, case.restart_every) == (1, 1)
    assert case.output.interval == 0.1


@pytest.mark.parametrize(
    ("steps", "output_every", "restart_every"),
    [
        (1000, 10, 100),
        (973, 7, 14 * 7),  # of 7 and 139
        (1024, 8, 13 * 8),
        (997, 10, 100),  # a prime number
        (150, 2, 8 * 2),
        (149, 1, 15),
    ],
)
def test_default_intervals_divide_the_duration_where_they_can(
    steps: int, output_every: int, restart_every: int
) -> None:
    time = {"duration": 1e-4 * steps, "step": 1e-4}
    case = parse_case(changed(MINIMAL, "time", time), FOLDER)
    assert (case.output_every, case.restart_every) == (output_every, restart_every)


@pytest.mark.parametrize("base", [MINIMAL, FROM_FILE])
def test_particles_are_packed_or_from_a_file(base: dict[str, Any]) -> None:
    kind = ParticlesFromFile if base is FROM_FILE else PackedParticles
    assert isinstance(parse_case(base, FOLDER).particles, kind)


@pytest.mark.parametrize(
    "source",
    [
        COMPLETE,
        MINIMAL,
        FROM_FILE,
        changed(ATTRACTING, "near_field.cutoff", "all"),
        *({**MINIMAL, "contact": contact} for contact in CONTACTS.values()),
    ],
)
def test_dump_loads_back_to_an_equal_case(source: str | dict[str, Any]) -> None:
    case = parse_case(source, FOLDER)
    text = dump_case(case)
    assert parse_case(text, FOLDER) == case
    assert "folder" not in text
    for key in ("seed", "electric", "drag", "integrator", "interval", "format", "restart_interval"):
        assert f"{key}:" in text


@pytest.mark.parametrize("name", ["1", "-", "_", "0x1f", "1e5", "1_0", "null", "no", "2016-01-01"])
def test_names_that_look_like_other_things_survive_a_dump(name: str) -> None:
    case = parse_case(changed(MINIMAL, "name", name), FOLDER)
    assert parse_case(dump_case(case), FOLDER).name == name


@pytest.mark.parametrize(
    ("duration", "step", "steps"),
    [(1.0, 1e-4, 10_000), (0.3, 0.1, 3), (1, 1 / 3, 3), (1.0, 3.3333333e-4, 3000), (5, 5, 1)],
)
def test_steps_fill_the_duration(duration: float, step: float, steps: int) -> None:
    case = parse_case(changed(MINIMAL, "time", {"duration": duration, "step": step}), FOLDER)
    assert case.time.steps == steps


def test_implicit_steps_default_to_the_step_and_lammps_steps_to_the_output() -> None:
    time = {"duration": 1, "step": 1e-4, "integrator": "implicit"}
    case = parse_case({**MINIMAL, "time": time}, FOLDER)
    assert case.time.implicit is not None
    assert (case.time.implicit.first_step, case.time.implicit.max_step) == (1e-4, 1e-4)
    assert (case.timestep, case.timesteps) == (0.01, 100)
    assert (case.output_every, case.restart_every) == (1, 10)

    time["implicit"] = {"first_step": 1e-5}
    output = {"interval": 0.03, "restart_interval": 0.1}
    case = parse_case({**MINIMAL, "time": time, "output": output}, FOLDER)
    assert case.time.longest_step == 1e-4
    assert (case.timestep, case.timesteps) == (0.01, 100)
    assert (case.output_every, case.restart_every) == (3, 10)

    # No step of LAMMPS holds more than a hundred, so that a run can be interrupted.
    time["implicit"] = {"max_step": 1e-5}
    case = parse_case({**MINIMAL, "time": time, "output": output}, FOLDER)
    assert (case.timestep, case.timesteps) == (pytest.approx(1e-3), 1000)
    assert (case.output_every, case.restart_every) == (30, 100)


@pytest.mark.parametrize(
    ("implicit", "message"),
    [
        ({"first_step": 1e-3}, "first_step: must be at most `time.step`, the max_step, 0.0001"),
        ({"first_step": 1e-3, "max_step": 1e-4}, "first_step: must be at most max_step, 0.0001"),
        ({"max_step": 1e-10}, "max_step: must be at least 4.66e-10, for at most 2147483647 steps"),
    ],
)
def test_implicit_steps_must_fit_together(implicit: dict[str, float], message: str) -> None:
    time = {"duration": 1, "step": 1e-4, "integrator": "implicit", "implicit": implicit}
    (problem,) = problems_of({**MINIMAL, "time": time})
    assert problem.startswith(f"time.implicit.{message}")


@pytest.mark.parametrize("law", ["zohdi", "hooke", "hertz", "dmt", "jkr"])
@pytest.mark.parametrize("friction", [None, FRICTION])
def test_implicit_steps_need_contacts_without_memory(law: str, friction: Any) -> None:
    contact = {**CONTACTS[law], "friction": friction, "rotation": True}
    if friction and law in ("zohdi", "hooke"):
        contact["friction"] = {**friction, "stiffness": 1e6}
    time = {"duration": 1, "step": 1e-4, "integrator": "implicit"}
    case = {**MINIMAL, "contact": contact, "time": time}
    if law == "zohdi" or not (friction or law == "jkr"):
        assert parse_case(case, FOLDER).contact
    else:
        (problem,) = problems_of(case)
        assert problem.startswith("time.integrator: 'implicit' does not work with `contact.law: ")


def test_a_step_that_does_not_fit_is_told_the_nearest_that_does() -> None:
    (problem,) = problems_of(changed(MINIMAL, "time.step", 3e-4))
    suggestion = float(problem.split("the nearest step that does is ")[1].split(",")[0])
    assert parse_case(changed(MINIMAL, "time.step", suggestion), FOLDER).time.steps == 3333


@pytest.mark.parametrize(
    "medium",
    [
        {"drag": "none", "velocity": [1, 2, 3]},
        {"drag": "constant", "density": 1, "drag_coefficient": 0.5},
        {"drag": "chow", "density": 1, "viscosity": 1e-5},
        {"drag": "stokes", "viscosity": 1e-5},
    ],
)
def test_each_drag_law_with_what_it_needs(medium: dict[str, Any]) -> None:
    assert parse_case({**MINIMAL, "medium": medium}, FOLDER).medium.drag == medium["drag"]


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("name", ABSENT, "missing"),
        ("name", "", "a-z"),
        ("name", "Upper", "got 'Upper'"),
        ("name", "line\n", "a-z"),
        ("name", "../up", "a-z"),
        ("name", "x" * 81, "1 to 80"),
        ("name", 12, "must be text"),
        ("title", "two\nlines", "control characters"),
        ("title", "two\u2028lines", "control characters"),
        ("title", "x" * 201, "at most 200"),
        ("seed", -1, "at least 0"),
        ("seed", 2**31, "less than 2147483648"),
        ("seed", True, "whole number, got true"),
        ("seed", 1.0, "whole number, got 1.0"),
        ("particles", ABSENT, "missing"),
        ("particles", [1], "section"),
        ("particles.count", 0, "at least 1"),
        ("particles.count", 2**31, "less than"),
        ("particles.count", "10", "whole number, got '10'"),
        ("particles.radius", ABSENT, "missing"),
        ("particles.radius", 0, "greater than 0"),
        ("particles.radius", "0.05 m", "must be a number"),
        ("particles.radius", True, "must be a number, got true"),
        ("particles.radius", None, "must be a number, got nothing"),
        ("particles.radius", [0.05], "must be a number"),
        ("particles.density", float("nan"), "finite"),
        ("particles.density", float("inf"), "finite"),
        pytest.param("particles.density", 16**6000, "must be a number", id="huge-integer"),
        ("particles.charge_per_mass", float("-inf"), "finite"),
        ("particles.positive_fraction", 1.01, "at most 1"),
        ("particles.packing", "rsa", "section"),
        ("particles.packing.method", "fcc", "'rsa', got 'fcc'"),
        ("particles.packing.domain_radius", ABSENT, "missing"),
        ("particles.packing.domain_radius", 0.01, "at least the particle radius 0.05, got 0.01"),
        ("particles.packing.relax", "no", "true or false"),
        ("particles.raduis", 1, "did you mean `radius`?"),
        ("particles.packing.domain_radiu", 1, "did you mean `domain_radius`?"),
        ("particles.allow_overlap", True, "goes with `particles.file` only"),
        ("blast", 1e4, "section"),
        ("blast", {}, "energy: missing"),
        ("blast.energy", 0, "greater than 0"),
        ("blast.enrgy", 1, "did you mean `energy`?"),
        ("fields.magnetic", [1, 2], "three numbers"),
        ("fields.magnetic", 3, "three numbers"),
        ("fields.electric", [1, 2, 3, 4], "three numbers"),
        ("medium", None, "section"),
        ("medium.drag", "newton", "'none', 'constant', 'chow' or 'stokes'"),
        ("medium.density", -1, "at least 0"),
        ("medium.drag_coefficient", 0.5, "`drag: constant` only"),
        ("time", ABSENT, "missing"),
        ("time.step", ABSENT, "missing"),
        ("time.step", 0, "greater than 0"),
        ("time.step", 2, "at most the duration"),
        ("time.step", 0.3, "nearest step that does is 0.333333333"),
        ("time.step", 1e-90, "at most 2147483647 steps"),
        ("time.integrator", "euler", "'lorentz', 'verlet' or 'implicit'"),
        ("time.implicit", 0.5, "section"),
        ("time.implicit.phi", -0.1, "at least 0"),
        ("time.implicit.phi", 1.1, "at most 1"),
        ("time.implicit.iterations", 0, "at least 1"),
        ("time.implicit.iterations", 2.5, "whole number"),
        ("time.implicit.iterations", 10**9, "at most 1000"),
        ("time.implicit.tolerance", 0, "greater than 0"),
        ("time.implicit.tolerance", 1, "less than 1"),
        ("time.implicit.max_step", 0, "greater than 0"),
        ("time.implicit.first_step", -1e-5, "greater than 0"),
        ("time.implicit", {"max_step": 1e-4, "first_step": 2e-4}, "first_step: must be at most"),
        ("time.implicit.safety", 0, "greater than 0"),
        ("time.implicit.safety", 1.5, "at most 1"),
        ("time.implicit.anderson", 6, "at most 5"),
        ("time.implicit.anderson", -1, "at least 0"),
        ("time.implicit.solve_fields", "yes", "true or false"),
        ("time.implicit.first_stp", 1e-5, "did you mean `first_step`?"),
        ("output.format", "hdf5", "'text' or 'binary'"),
        ("output.forces", 1, "true or false"),
        ("output.interval", 2.0, "at most the duration"),
        ("output.interval", 1.5e-4, "whole number of steps of 0.0001"),
        ("output.interval", 1e-5, "whole number of steps"),
        ("output.restart_interval", 1e90, "whole number of steps"),
        ("output.contacts", True, "needs `contact` with `law: zohdi`, got true"),
        ("contact", "zohdi", "section"),
        ("bond", BOND, "needs `contact` with `law: zohdi`"),
        ("near_field", {}, "near_field.cutoff: missing"),
        (
            "contact",
            {**CONTACTS["zohdi"], "thermal": {**THERMAL, "sensitivity": 2000}},
            "thermal.sensitivity: makes a stiffness of inf N/m2, got 2000",
        ),
        ("folder", "/tmp", "unknown key"),
        ("partcles", {}, "did you mean `particles`?"),
    ],
)
def test_a_bad_value_is_named_by_its_key(path: str, value: object, expected: str) -> None:
    problems = problems_of(changed(MINIMAL, path, value))
    assert any(problem.startswith(path) and expected in problem for problem in problems), problems


@pytest.mark.parametrize(
    ("medium", "keys"),
    [
        ({"drag": "chow"}, {"density", "viscosity"}),
        ({"drag": "stokes", "density": 1}, {"viscosity"}),
        ({"drag": "constant"}, {"density", "drag_coefficient"}),
        ({"drag": "constant", "density": 1, "drag_coefficient": 0}, {"drag_coefficient"}),
        ({"drag": "stokes", "viscosity": 1, "drag_coefficient": 1}, {"drag_coefficient"}),
    ],
)
def test_a_drag_law_names_all_that_it_lacks(medium: dict[str, Any], keys: set[str]) -> None:
    problems = problems_of({**MINIMAL, "medium": medium})
    assert {problem.split(":")[0] for problem in problems} == {f"medium.{key}" for key in keys}


@pytest.mark.parametrize("law", CONTACTS)
@pytest.mark.parametrize("friction", [None, FRICTION])
def test_each_contact_law_with_what_it_needs(law: str, friction: dict[str, float] | None) -> None:
    contact = {**CONTACTS[law], "friction": friction, "rotation": friction is not None}
    if friction and law in {"zohdi", "hooke"}:
        contact["friction"] = {**friction, "stiffness": 1e6}
    case = parse_case({**MINIMAL, "contact": contact}, FOLDER)
    assert case.contact is not None
    assert case.contact.law == law
    assert case.contact.is_stock == (law != "zohdi")
    assert case.interacts


@pytest.mark.parametrize("law", CONTACTS)
def test_a_contact_law_names_what_it_lacks_and_what_it_has_not(law: str) -> None:
    own = set(CONTACTS[law]) - {"law", "damping"}
    every = {key: value for contact in CONTACTS.values() for key, value in contact.items()}
    every = {**every, "thermal": THERMAL, "law": law}

    lacking = problems_of({**MINIMAL, "contact": {"law": law}})
    assert {problem.split(":")[0] for problem in lacking} == {f"contact.{key}" for key in own}
    assert all(f"`law: {law}`" in problem for problem in lacking)

    foreign = set(every) - {"law", "damping", "thermal"} - own
    if law != "zohdi":
        foreign.add("thermal")
    refused = problems_of({**MINIMAL, "contact": every})
    assert {problem.split(":")[0] for problem in refused} == {f"contact.{key}" for key in foreign}
    assert all(f"only, not with `law: {law}`" in problem for problem in refused)


@pytest.mark.parametrize(
    ("law", "friction", "rotation", "expected"),
    [
        ("zohdi", {}, False, {"stiffness": "greater than 0 with `law: zohdi`, got nothing"}),
        ("hooke", {}, True, {"stiffness": "greater than 0 with `law: hooke`, got nothing"}),
        ("hertz", {"stiffness": 1e6}, True, {"stiffness": "not with `law: hertz`, got 1000000.0"}),
        ("jkr", {"dynamic": 0.3}, True, {"dynamic": "must equal the static coefficient 0.4"}),
        (
            "hooke",
            {"dynamic": 0.3},
            True,
            {"stiffness": "greater than 0", "dynamic": "which has one coefficient, got 0.3"},
        ),
        ("dmt", {}, False, {"rotation": "must be true with `friction` and `law: dmt`"}),
        ("zohdi", {"stiffness": 0}, False, {"stiffness": "greater than 0, got 0"}),
        ("zohdi", {"stiffness": 1, "static": -1}, False, {"static": "at least 0, got -1"}),
        ("zohdi", {"stiffness": 1, "dynamic": -1}, False, {"dynamic": "at least 0, got -1"}),
        (
            "zohdi",
            {"stiffness": 1, "dynamic": 0.5},
            False,
            {"dynamic": "at most the static coefficient 0.4, got 0.5"},
        ),
    ],
)
def test_friction_that_the_law_has_not(
    law: str, friction: dict[str, float], rotation: bool, expected: dict[str, str]
) -> None:
    contact = {**CONTACTS[law], "friction": {**FRICTION, **friction}, "rotation": rotation}
    problems = dict(
        problem.split(": ", 1) for problem in problems_of({**MINIMAL, "contact": contact})
    )
    where = {"rotation": "contact.rotation"}
    assert problems.keys() == {where.get(key, f"contact.friction.{key}") for key in expected}
    for key, text in expected.items():
        assert text in problems[where.get(key, f"contact.friction.{key}")]


@pytest.mark.parametrize(
    ("path", "value", "expected"),
    [
        ("contact.law", "hook", "'zohdi', 'hooke', 'hertz', 'jkr' or 'dmt', got 'hook'"),
        ("contact.stiffness", 0, "greater than 0"),
        ("contact.exponent", -1, "at least 0"),
        ("contact.damping", -1, "at least 0"),
        ("contact.rotation", 1, "true or false"),
        ("contact.friction", {}, "contact.friction.static: missing"),
        ("contact.thermal", {}, "contact.thermal.floor: missing"),
        ("contact.thermal", {**THERMAL, "temperature": 0}, "greater than 0"),
        ("contact.thermal", {**THERMAL, "reference": 0}, "greater than 0"),
        ("contact.thermal", {**THERMAL, "sensitivity": -1}, "at least 0"),
        ("contact.thermal", {**THERMAL, "floor": 0}, "greater than 0"),
        ("contact.stifness", 1, "did you mean `stiffness`?"),
        ("contact", {**CONTACTS["hertz"], "poisson_ratio": 0.51}, "at most 0.5"),
        ("contact", {**CONTACTS["hertz"], "poisson_ratio": -1}, "greater than -1"),
        ("contact", {**CONTACTS["hertz"], "youngs_modulus": 0}, "greater than 0"),
        ("contact", {**CONTACTS["jkr"], "surface_energy": 0}, "greater than 0"),
        ("bond", {}, "bond.stiffness: missing"),
        ("bond", {}, "activation_strain: missing, must be a strain between 0 and 1: the paper"),
        ("bond", {**BOND, "activation_strain": None}, "must be a number, got nothing"),
        ("bond", {**BOND, "activation_strain": 0}, "greater than 0"),
        ("bond", {**BOND, "activation_strain": 1}, "less than 1"),
        ("bond", {**BOND, "stiffness": -1}, "at least 0"),
        ("bond", {**BOND, "exponent": -1}, "at least 0"),
        ("bond", {**BOND, "tangential_stiffness": -1}, "at least 0"),
        ("bond", {**BOND, "memory": "long"}, "'contact' or 'none', got 'long'"),
        ("near_field", {**NEAR_FIELD, "scaling": "radius"}, "'mass', 'area', 'volume' or 'charge'"),
        (
            "near_field",
            {**NEAR_FIELD, "cutoff": 0},
            "greater than 0 in m, or the word `all`, got 0",
        ),
        ("near_field", {**NEAR_FIELD, "cutoff": "al"}, "or the word `all`, got 'al'"),
        ("near_field", {**NEAR_FIELD, "cutoff": True}, "or the word `all`, got true"),
        ("near_field", {**NEAR_FIELD, "cutoff": float("inf")}, "or the word `all`, got inf"),
        ("near_field", {**NEAR_FIELD, "switch_width": 0}, "greater than 0"),
        ("near_field", {**NEAR_FIELD, "switch_width": 0.15}, "less than the cutoff 0.15"),
        ("near_field", {**NEAR_FIELD, "switch_width": 0.1, "cutoff": "all"}, "`cutoff: all`"),
        ("near_field", {"scaling": "mass", "cutoff": 1}, "repulsion: must be a section"),
        ("near_field", {**NEAR_FIELD, "repulsion": {}}, "repulsion.exponent: missing"),
        ("near_field", {**NEAR_FIELD, "attraction": {"strength": -1, "exponent": 1}}, "at least 0"),
        ("near_field", {**NEAR_FIELD, "attraction": {"strength": 1, "exponent": -1}}, "at least 0"),
    ],
)
def test_a_bad_interaction_is_named_by_its_key(path: str, value: object, expected: str) -> None:
    problems = problems_of(changed(TOUCHING, path, value))
    assert any(problem.startswith(path) and expected in problem for problem in problems), problems


@pytest.mark.parametrize("contact", [None, CONTACTS["jkr"]])
def test_bonds_and_the_list_of_contacts_need_the_law_of_the_paper(
    contact: dict[str, Any] | None,
) -> None:
    source = {**MINIMAL, "contact": contact, "bond": BOND, "output": {"contacts": True}}
    assert {problem.split(":")[0] for problem in problems_of(source)} == {"bond", "output.contacts"}
    parse_case({**source, "contact": CONTACTS["zohdi"]}, FOLDER)


def test_an_invalid_contact_is_not_taken_for_none() -> None:
    source = changed(ATTRACTING, "near_field.repulsion", ABSENT)
    source |= {"contact": {}, "bond": BOND, "output": {"contacts": True}}
    keys = {problem.split(":")[0] for problem in problems_of(source)}
    assert keys == {"contact.stiffness", "contact.exponent"}


def test_near_field_of_charge_needs_charges() -> None:
    near_field = {**NEAR_FIELD, "scaling": "charge"}
    uncharged = changed(MINIMAL, "particles.charge_per_mass", 0)
    (problem,) = problems_of({**uncharged, "near_field": near_field})
    assert problem.startswith("near_field.scaling: 'charge' needs charged particles")
    parse_case({**MINIMAL, "near_field": near_field}, FOLDER)


LIKE = {"scaling": "charge"}, 1.0
MIXED = {"scaling": "charge"}, 0.5
# Of ten particles 0.96 are all: there are no two of unlike sign.
ROUNDED = {"scaling": "charge"}, 0.96
MASSES = {"scaling": "mass"}, 0.5


@pytest.mark.parametrize(
    ("signs", "attraction", "repulsion", "diverging"),
    [
        (MASSES, (1, 1), None, "attraction"),
        (MASSES, (1, 1), (0, 2), "attraction"),
        (MASSES, (1, 2), (9, 1), "attraction"),
        (MASSES, (1, 1), (0.9, 1), "attraction"),
        (MASSES, (1, 1), (1, 1), None),
        (MASSES, (1, 1), (1e-9, 1.1), None),
        (MASSES, (1, 0), None, None),
        (MASSES, (0, 2), None, None),
        (MASSES, None, (1, 2), None),
        (LIKE, (1, 1), None, "attraction"),
        (LIKE, (1, 1), (1, 2), None),
        (ROUNDED, (1, 1), (1, 2), None),
        (MIXED, (1, 1), (1, 2), "repulsion"),
        (MIXED, (1, 2), (1, 1), "attraction"),
        (MIXED, None, (1, 2), "repulsion"),
        (MIXED, (1, 1), (1, 1), None),
        (MIXED, (0, 1), (1, 0), None),
    ],
)
def test_attraction_without_bound_needs_contact(
    signs: tuple[dict[str, str], float],
    attraction: tuple[float, float] | None,
    repulsion: tuple[float, float] | None,
    diverging: str | None,
) -> None:
    scaling, positive_fraction = signs
    near_field: dict[str, Any] = {**scaling, "cutoff": "all"}
    for key, term in (("attraction", attraction), ("repulsion", repulsion)):
        near_field[key] = term and {"strength": term[0], "exponent": term[1]}
    source = changed(MINIMAL, "particles.positive_fraction", positive_fraction)
    source["near_field"] = near_field
    if diverging:
        (problem,) = problems_of(source)
        assert problem.startswith(f"near_field.{diverging}.exponent: diverges: ")
        assert "add `contact`" in problem
        # Where both kinds of pairs exist, no exponents suit both.
        assert ("higher exponent" in problem) == (signs is not MIXED)
    else:
        parse_case(source, FOLDER)
    parse_case({**source, "contact": CONTACTS["zohdi"]}, FOLDER)


def test_packed_and_from_a_file_exclude_each_other() -> None:
    (problem,) = problems_of(changed(MINIMAL, "particles.file", "particles.csv"))
    assert problem.startswith("particles: ")
    assert "not both" in problem
    assert "`count`" in problem


def test_a_component_of_a_vector_is_named_by_its_index() -> None:
    (problem,) = problems_of(changed(MINIMAL, "fields.magnetic", [0, "x", 0]))
    assert problem == "fields.magnetic[1]: must be a number, got 'x'"


def test_all_problems_are_told_at_once() -> None:
    problems = problems_of(
        """
        name: Bad Name
        seed: -1
        particles: {count: 1.5, radius: -1, density: 0, packing: {domain_radius: no, relax: 1}}
        blast: {energy: .nan}
        fields: {magnetic: [1, 2]}
        medium: {drag: chow}
        contact: {law: hertz, stiffness: 1, friction: {static: 0.1, dynamic: 0.2}}
        bond: {memory: 3}
        near_field: {scaling: mass, cutoff: nowhere}
        tme: {}
        time: {duration: 1, step: 0.4, integrator: euler, implicit: {phi: 2}}
        output: {format: x, interval: -1}
        """
    )
    assert {problem.split(":")[0] for problem in problems} == {
        "name",
        "seed",
        "particles.count",
        "particles.radius",
        "particles.density",
        "particles.charge_per_mass",
        "particles.packing.domain_radius",
        "particles.packing.relax",
        "blast.energy",
        "fields.magnetic",
        "medium.density",
        "medium.viscosity",
        "contact.stiffness",
        "contact.friction.dynamic",
        "contact.youngs_modulus",
        "contact.poisson_ratio",
        "bond.stiffness",
        "bond.exponent",
        "bond.activation_strain",
        "bond.memory",
        "near_field.repulsion",
        "near_field.cutoff",
        "tme",
        "time.step",
        "time.integrator",
        "time.implicit.phi",
        "output.format",
        "output.interval",
    }


@pytest.mark.parametrize("key", ["a\nb", "\x1b[31m", "", "x" * 10_000])
def test_an_odd_key_stays_on_one_short_line(key: str) -> None:
    (problem,) = problems_of({**MINIMAL, key: 1})
    assert "unknown key" in problem
    assert len(problem) < 300


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "empty"),
        ("# only a comment\n", "empty"),
        ("- a\n- b\n", "mapping"),
        ("just words", "mapping"),
        ("name: a\nname: b\n", "line 2.*duplicate key"),
        ("name: a\n  seed: 1\n", "line 2"),
        ("name: [\n", "line 2"),
        ("\tname: a", "line 1"),
        ("name: a\x00", "not valid YAML"),
        ("a: 1\n---\nb: 2\n", "another document"),
        ("name: !!python/object/apply:os.getcwd []", "line 1"),
        ("{a: 1}: 2", "not valid YAML"),
        ("seed: " + "1" * 5000, "not valid YAML"),
        ("seed: !!int x", "no use for tags such as !!int"),
        ("day: 2016-99-99", "not valid YAML"),
        ("[" * 500, "nested too deeply"),
        ('"a\\e[31m": 1\n"a\\e[31m": 2', "line 2"),
        ("12: x", "a key must be text, got 12"),
    ],
)
def test_text_that_is_no_case(text: str, expected: str) -> None:
    assert re.search(expected, "\n".join(problems_of(text)))


def test_nested_aliases_are_not_expanded() -> None:
    bomb = "a0: &a0 [x, x]\n" + "".join(
        f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 40)
    )
    assert all(len(problem) < 300 for problem in problems_of(bomb + "name: *a39\nself: &s [*s]"))


def test_numbers_follow_yaml_1_2() -> None:
    case = parse_case(
        "seed: 0o17\n" + COMPLETE.replace("seed: 2016", "").replace("1.0e4", "1e4"), FOLDER
    )
    assert case.seed == 15
    assert case.blast is not None
    assert case.blast.energy == 1e4


def test_load_reads_a_file_and_remembers_its_folder(tmp_path: Path) -> None:
    path = tmp_path / "case.yaml"
    path.write_bytes(b"\xef\xbb\xbf" + COMPLETE.encode())
    case = load_case(path)
    assert case.folder == tmp_path
    assert case == parse_case(COMPLETE, tmp_path)


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        (None, "cannot be read: No such file"),
        (b"\xff\xfe\x00binary", "not a text file in UTF-8"),
        (b"#" * (MAX_FILE_BYTES + 1), "larger than"),
    ],
)
def test_files_that_cannot_be_read(tmp_path: Path, content: bytes | None, expected: str) -> None:
    path = tmp_path / "case.yaml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(CaseError, match=expected):
        load_case(path)


def test_a_folder_is_no_case_file(tmp_path: Path) -> None:
    with pytest.raises(CaseError, match="cannot be read"):
        load_case(tmp_path)


def test_a_case_cannot_be_changed() -> None:
    case: Case = parse_case(MINIMAL, FOLDER)
    with pytest.raises(ValueError, match="frozen"):
        case.seed = 2  # type: ignore[misc]
