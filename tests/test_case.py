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
  packing: {method: rsa, domain_radius: 1.0, relax: false}
blast: {energy: 1.0e4}
fields: {electric: [0, 0, 0], magnetic: [10, 0, 1e-5]}
medium: {density: 1.225, viscosity: 1.8e-5, velocity: [0, 1, 0], drag: chow}
time: {duration: 1.0, step: 1.0e-4, integrator: verlet}
output: {interval: 0.02, forces: true, format: binary, restart_interval: 0.25}
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
    assert case.time.steps == 10_000
    assert (case.output_every, case.restart_every) == (200, 2500)
    assert case.folder == FOLDER


def test_defaults_mean_vacuum_no_fields_no_pulse_and_a_hundred_frames() -> None:
    case = parse_case(MINIMAL, FOLDER)
    assert case.blast is None
    assert case.fields.electric == case.fields.magnetic == (0.0, 0.0, 0.0)
    assert (case.medium.drag, case.medium.density, case.medium.viscosity) == ("none", 0, 0)
    assert case.time.integrator == "lorentz"
    assert (case.output.interval, case.output.restart_interval) == (0.01, 0.1)
    assert (case.output_every, case.restart_every) == (100, 1000)


def test_default_intervals_are_at_least_one_step() -> None:
    case = parse_case(changed(MINIMAL, "time", {"duration": 0.3, "step": 0.1}), FOLDER)
    assert (case.output_every, case.restart_every) == (1, 1)
    assert case.output.interval == 0.1


@pytest.mark.parametrize("base", [MINIMAL, FROM_FILE])
def test_particles_are_packed_or_from_a_file(base: dict[str, Any]) -> None:
    kind = ParticlesFromFile if base is FROM_FILE else PackedParticles
    assert isinstance(parse_case(base, FOLDER).particles, kind)


@pytest.mark.parametrize("source", [COMPLETE, MINIMAL, FROM_FILE])
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
        ("particles.packing.relax", True, "not supported yet by this version of lammps-blast"),
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
        ("time.integrator", "euler", "'lorentz' or 'verlet'"),
        ("time.integrator", "implicit", "not supported yet by this version of lammps-blast"),
        ("time.implicit", {"phi": 0.5}, "not supported yet by this version of lammps-blast"),
        ("output.format", "hdf5", "'text' or 'binary'"),
        ("output.forces", 1, "true or false"),
        ("output.interval", 2.0, "at most the duration"),
        ("output.interval", 1.5e-4, "whole number of steps of 0.0001"),
        ("output.interval", 1e-5, "whole number of steps"),
        ("output.restart_interval", 1e90, "whole number of steps"),
        ("contact", {"law": "zohdi"}, "not supported yet by this version of lammps-blast"),
        ("bond", {}, "not supported yet by this version of lammps-blast"),
        ("near_field", None, "not supported yet by this version of lammps-blast"),
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
        particles: {count: 1.5, radius: -1, density: 0, packing: {domain_radius: no, relax: true}}
        blast: {energy: .nan}
        fields: {magnetic: [1, 2]}
        medium: {drag: chow}
        contact: {}
        tme: {}
        time: {duration: 1, step: 0.4, integrator: implicit}
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
        "contact",
        "tme",
        "time.step",
        "time.integrator",
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
        ("seed: !!int x", "not valid YAML"),
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
