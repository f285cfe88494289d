"""The documentation: its examples run, its tables name what exists, its links lead somewhere."""

import importlib
import re
from pathlib import Path

import numpy as np
import pytest
from conftest import REPOSITORY, lmp, random_cloud
from pydantic import BaseModel

from lammps_blast import case as case_module
from lammps_blast import step_history
from lammps_blast.analyze import analyze, summarize, write_results
from lammps_blast.case import load_case, parse_case
from lammps_blast.clumps import CLUMP_NUMBERS
from lammps_blast.contacts import CONTACT_NUMBERS
from lammps_blast.deck import ENERGY_ACCOUNTS, STEP_COLUMNS, write_deck, write_resolved_case
from lammps_blast.particles import create_particles

DOCS = REPOSITORY / "docs"
README = REPOSITORY / "README.md"
PAGES = [*sorted(DOCS.rglob("*.md")), README]
SHIPPED_CASE = REPOSITORY / "lammps_inputs" / "magnetic_blast" / "case.yaml"
CASE_PAGE, STYLES_PAGE, PHYSICS_PAGE = (
    (DOCS / name).read_text(encoding="utf-8") for name in ("case.md", "styles.md", "physics.md")
)


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", text, re.M | re.S)


def name_of(path: Path) -> str:
    return str(path.relative_to(REPOSITORY))


@pytest.mark.parametrize("text", blocks(CASE_PAGE, "yaml"))
def test_cases_of_the_case_page_are_valid(text, tmp_path):
    (tmp_path / "particles.csv").write_text(blocks(CASE_PAGE, "csv")[0])
    assert len(create_particles(parse_case(text, tmp_path))) > 0


@pytest.mark.parametrize("text", blocks(README.read_text(encoding="utf-8"), "yaml"))
def test_cases_of_the_readme_are_valid(text, tmp_path):
    """What the README shows is a whole case, or lines to put into the shipped one."""
    if not text.startswith("name:"):
        own = set(re.findall(r"^(\w+):", text, re.M))
        sections = re.split(r"^(?=\w+:)", SHIPPED_CASE.read_text(encoding="utf-8"), flags=re.M)
        text += "".join(part for part in sections[1:] if part.split(":")[0] not in own)
    parse_case(text, tmp_path)


def test_examples_of_a_run_work_one_after_the_other(tmp_path, monkeypatch):
    """Deck, `lmp`, analysis and both Python examples, on the page's first case."""
    case = parse_case(blocks(CASE_PAGE, "yaml")[0], tmp_path)
    folder = tmp_path / "runs" / case.name
    folder.mkdir(parents=True)
    write_resolved_case(case, folder)
    write_deck(case, create_particles(case), folder)
    done = lmp("-in", "in.blast", folder=folder)
    assert done.returncode == 0, done.stdout

    analyses = analyze(folder)
    write_results(analyses, folder, figures=False)
    for table in ("energy", "envelope", "speeds"):
        with (folder / f"{table}.csv").open() as file:
            for column in file.readline().strip().split(","):
                assert f"`{column}`" in CASE_PAGE, f"column {column} of {table}.csv"
    summary = summarize(analyses)
    for key in [*summary, *summary["energy"], *summary["envelope"], *summary["checks"]]:
        assert f"`{key}`" in CASE_PAGE, f"key {key} of summary.json"

    monkeypatch.chdir(tmp_path)
    names: dict = {}
    for text in blocks(CASE_PAGE, "python"):
        exec(text, names)
    assert names["envelope"].results.semi_axis_parallel[-1] > 2.0


STYLE_BLOCKS = blocks(STYLES_PAGE, "lammps")
EXAMPLE_BLOCKS = re.findall(r"^### Examples\n\n```lammps\n(.*?)^```$", STYLES_PAGE, re.M | re.S)


def last_table(log: str) -> dict[str, np.ndarray]:
    """Return the columns of the last thermo output of a log."""
    header, *rows = re.findall(r"^ +Step.*\n(?: +[-\d].*\n)+", log, re.M)[-1].splitlines()
    values = np.array([row.split() for row in rows], dtype=float)
    return dict(zip(header.split(), values.T, strict=True))


def run_complete_input(title: str, folder: Path) -> str:
    (complete,) = re.findall(rf"^## {title}\n.*?```lammps\n(.*?)^```$", STYLES_PAGE, re.M | re.S)
    (folder / "in.example").write_text(complete)
    done = lmp("-in", "in.example", folder=folder)
    assert done.returncode == 0, done.stdout
    return done.stdout


def test_complete_input_runs_with_lmp_alone(tmp_path):
    log = run_complete_input("A complete input", tmp_path)
    assert re.search(r"Loop time of \S+ on 1 procs for 1000 steps with 100 atoms", log)


def test_complete_input_with_contacts_forms_bonds_and_keeps_its_ledger(tmp_path):
    """Each cube bonds within, then the two to each other."""
    table = last_table(run_complete_input("A complete input with contacts", tmp_path))
    within_the_cubes = 2 * 3 * 18
    bonds = table["c_contact[4]"]
    assert bonds[0] == 0
    assert within_the_cubes in bonds
    assert bonds[-1] == within_the_cubes + 9
    assert table["v_lost"][-1] > 100.0
    assert np.abs(table["v_created"]).max() < 2e-3 * table["KinEng"].max()


# What the examples of fixes and computes are given to act on.
PAIRS = """
variable kinetic equal ke
variable potential equal pe
neighbor 0.1 nsq
comm_modify vel yes
pair_style blast/contact
pair_coeff * * stiffness 1.0e7 exponent 2
"""


def example_pieces(text: str) -> list[str]:
    """Split a block of examples into its lines, or into pair styles with their coefficients."""
    return re.findall(r"^pair_style.*\n(?:pair_coeff.*\n)+|^(?!pair_).*\n", text, re.M)


def test_example_lines_of_the_styles_run(simulate):
    pieces = [piece for text in EXAMPLE_BLOCKS for piece in example_pieces(text)]
    # This one wants a simulation that is not there yet.
    later = [piece for piece in pieces if not piece.startswith("blast_read_restart")]
    parts = [t for t in STYLE_BLOCKS if t not in EXAMPLE_BLOCKS and not t.startswith("units")]
    assert "".join(pieces) == "".join(EXAMPLE_BLOCKS)
    assert len(EXAMPLE_BLOCKS) == 15
    assert parts
    simulation = simulate(random_cloud(10, seed=1, velocity=[1.0, 2.0, 3.0]))
    for commands in [*later, *parts]:
        simulation.commands(f"group dust id 1:5\ntimestep 1.0e-4\n{PAIRS}")
        before = simulation.velocity
        simulation.commands(f"{commands}\nrun 2")
        if commands.startswith("blast_pulse"):
            assert np.abs(simulation.velocity - before).max() > 0.1
        undo(simulation, commands)


def undo(simulation, commands):
    """Take away what some commands made and what they print, for others to follow."""
    for line in reversed(commands.splitlines()):
        kind, name = line.split()[:2]
        if kind in ("fix", "compute", "dump"):
            simulation.commands(f"un{kind} {name}")
        elif kind == "variable":
            simulation.commands(f"variable {name} delete")
        elif kind == "thermo_style":
            simulation.commands("thermo_style one")


# --- what the pages name --------------------------------------------------------------------

MODELS = [
    thing
    for thing in vars(case_module).values()
    if isinstance(thing, type) and issubclass(thing, BaseModel) and thing is not BaseModel
]


def test_every_key_of_a_case_is_on_the_case_page():
    keys = {key for model in MODELS for key in model.model_fields}
    assert {"name", "charge_per_mass", "drag_coefficient", "restart_interval"} <= keys
    in_tables = set(re.findall(r"^\| `(?:\w+\.)?(\w+)` \|", CASE_PAGE, re.M))
    assert keys <= in_tables, keys - in_tables


def test_every_choice_of_a_case_is_on_the_case_page():
    for model in MODELS:
        for key, field in model.model_fields.items():
            for choice in getattr(field.annotation, "__args__", ()):
                if isinstance(choice, str):
                    assert f"`{choice}`" in CASE_PAGE, f"{key}: {choice}"


def test_columns_of_tables_are_on_the_case_page():
    for account in ENERGY_ACCOUNTS:
        assert f"| `{account}` |" in CASE_PAGE
    for column in (*STEP_COLUMNS, *step_history.COLUMNS, *CLUMP_NUMBERS, *CONTACT_NUMBERS):
        assert f"`{column}`" in CASE_PAGE, column


def test_what_the_physics_page_names_exists():
    named = re.findall(r"`([\w/]+\.(?:h|cpp|py))::(\w+)`", PHYSICS_PAGE)
    assert len(named) > 50
    for file, name in named:
        if file.endswith(".py"):
            module = importlib.import_module(f"lammps_blast.{Path(file).stem}")
            assert hasattr(module, name), f"{file}::{name}"
        else:
            source = (REPOSITORY / "cpp_plugins" / file).read_text(encoding="utf-8")
            # Defined there: a struct, or a function that begins its line (not a call).
            assert re.search(
                rf"^struct {name}\b|^(?!\s)[\w:<> ]*[\w>] (?:\w+::)?{name}\(", source, re.M
            ), f"{file}::{name}"


def test_every_law_and_closed_form_is_on_the_physics_page():
    """Public functions of theory.py that state physics must be found from their equation."""
    theory = importlib.import_module("lammps_blast.theory")
    own = {n for n, f in vars(theory).items() if getattr(f, "__module__", "") == theory.__name__}
    helpers = {"main", "DragLaw", "SlowingPhase", "drag_coefficient", "drag_resistance"}
    helpers |= {"terminal_displacement"}
    public = {name for name in own if not name.startswith("_")} - helpers
    missing = {name for name in public if f"theory.py::{name}`" not in PHYSICS_PAGE}
    assert not missing


def test_numbers_of_the_physics_page_are_those_of_the_shipped_case():
    from lammps_blast.derived_numbers import derive_numbers

    numbers = derive_numbers(load_case(SHIPPED_CASE))
    for name, shown in {
        "particle_mass": "3.6652 kg",
        "pulse_speed": "1.6518 m/s",
        "cyclotron_radius": "0.016518 m",
        "force_ratio_unit_coefficient": "46,126",
    }.items():
        assert f"| {shown} |" in PHYSICS_PAGE
        value = float(shown.split()[0].replace(",", ""))
        assert numbers[name].value == pytest.approx(value, rel=2e-5)


def test_every_style_of_the_plugin_has_its_section():
    source = (REPOSITORY / "cpp_plugins" / "plugin.cpp").read_text(encoding="utf-8")
    added = re.findall(r'add\("(\w+)", "([^"]+)"', source)
    prefixes = {"command": "", "pair": "pair_style "}
    styles = [prefixes.get(kind, f"{kind} ") + name for kind, name in added]
    assert len(styles) >= 10
    for style in styles:
        section = re.search(rf"^## {style} command\n(.*?)(?=^## |\Z)", STYLES_PAGE, re.M | re.S)
        assert section, style
        for heading in ("Syntax", "Examples", "Description", "Restrictions", "Related", "Default"):
            assert f"### {heading}" in section.group(1), f"{style}: {heading}"


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as GitHub makes them."""
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    headings = re.findall(r"^#+ (.*)$", text, re.M)
    plain = (re.sub(r"[^\w\- ]", "", heading.strip().lower()) for heading in headings)
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=name_of)
def test_relative_links_lead_somewhere(page):
    text = re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)
    for target in re.findall(r"\]\(([^)\s]+)\)", text):
        if re.match(r"[a-z]+:", target):
            continue
        path, _, anchor = target.partition("#")
        linked = (page.parent / path).resolve() if path else page
        assert linked.exists(), f"{name_of(page)}: {target}"
        assert linked.is_relative_to(REPOSITORY), f"{name_of(page)}: {target}"
        if anchor:
            assert anchor in anchors(linked), f"{name_of(page)}: {target}"


@pytest.mark.parametrize(
    "name", [p.name for p in PAGES if p.parent == DOCS and p.stem != "reproduction"]
)
def test_lines_are_not_long(name):
    for number, line in enumerate((DOCS / name).read_text(encoding="utf-8").splitlines(), 1):
        assert len(line) <= 120 or line.startswith("|"), f"{name}, line {number}"
