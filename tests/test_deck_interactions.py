"""Decks of interacting particles: what a case says of them is what LAMMPS computes."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pytest
from conftest import lmp
from scipy.optimize import brentq

from lammps_blast.analysis import EnergyLedger
from lammps_blast.case import CaseError, Contact, dump_case, load_case, parse_case
from lammps_blast.deck import DECK, ENERGY_ACCOUNTS, ENERGY_TABLE, deck_text, write_deck
from lammps_blast.particles import create_particles
from lammps_blast.stock_contacts import energy_reserve
from lammps_blast.trajectory import open_universe

STEP = 1e-6
ZOHDI = {"law": "zohdi", "stiffness": 1.0e7, "exponent": 2, "damping": 1.0e5}
HOOKE = {"law": "hooke", "stiffness": 2.0e5, "damping": 30.0}
HERTZ = {"law": "hertz", "youngs_modulus": 1.0e7, "poisson_ratio": 0.3, "damping": 30.0}
JKR = HERTZ | {"law": "jkr", "surface_energy": 20.0}
DMT = JKR | {"law": "dmt"}
THERMAL = {"temperature": 300.0, "reference": 500.0, "sensitivity": 1.0, "floor": 1.0e6}
BOND = {"stiffness": 3.0e7, "exponent": 1.5, "activation_strain": 0.04, "tangential_stiffness": 1e3}
NEAR_FIELD = {
    "scaling": "mass",
    "attraction": {"strength": 0.5, "exponent": 1},
    "repulsion": {"strength": 0.01, "exponent": 2},
    "cutoff": 0.15,
}


@dataclass(frozen=True)
class Pair:
    """Two spheres on a line along x; speeds in m/s, lengths in m, charges in C/kg."""

    distance: float
    closing: float = 0.0
    slip: float = 0.0
    radius: tuple[float, float] = (0.05, 0.04)
    charge: tuple[float, float] = (10.0, 10.0)
    sign: tuple[int, int] = (1, 1)

    @property
    def overlap(self):
        return sum(self.radius) - self.distance

    @property
    def strain(self):
        return self.overlap / sum(self.radius)

    @property
    def mass(self):
        return [7000.0 * 4 / 3 * np.pi * radius**3 for radius in self.radius]

    @property
    def area(self):
        """Return the area of the lens, from the chord that two circles share."""
        first, second = self.radius
        arm = (self.distance**2 + first**2 - second**2) / (2 * self.distance)
        return np.pi * (first**2 - arm**2)

    def rows(self, place):
        """Return the lines of a particle file, with the middle of the pair at y = `place`."""
        half = 0.5 * np.array([-1.0, 1.0])
        columns = (
            self.distance * half,
            [place, place],
            [0.0, 0.0],
            self.radius,
            [7000.0, 7000.0],
            self.charge,
            -self.closing * half,
            self.slip * half,
            [0.0, 0.0],
            self.sign,
        )
        return [",".join(map(repr, map(float, row))) for row in zip(*columns, strict=True)]


def run_pairs(folder, sections, pairs, *, duration=STEP, step=STEP, frames=1, ranks=1):
    """Run the deck of a case of pairs and return its trajectory."""
    columns = "x,y,z,radius,density,charge_per_mass,vx,vy,vz,sign"
    rows = [row for place, pair in enumerate(pairs) for row in pair.rows(float(place))]
    folder.mkdir(exist_ok=True)
    (folder / "particles.csv").write_text("\n".join([columns, *rows]) + "\n")
    case = {
        "name": "pairs",
        "particles": {"file": "particles.csv", "allow_overlap": True},
        "time": {"duration": duration, "step": step},
        "output": {"interval": duration / frames, "forces": True},
    }
    case = parse_case(case | sections, folder)
    (folder / "case.yaml").write_text(dump_case(case))
    write_deck(case, create_particles(case), folder)
    done = lmp("-in", DECK, folder=folder, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr
    return open_universe(folder).trajectory


def state(trajectory, frame):
    """Return columns of a frame, each with the two particles of a pair in its second axis."""
    data = trajectory[frame].data
    names = ("position", "velocity", "force", "torque", "mass")
    return {name: data[name].reshape(-1, 2, *data[name].shape[1:]).copy() for name in names}


def zohdi(pair, contact, bond=None):
    """Return the force that pushes a pair apart, eq. 7.5, 7.10, 7.16 and 7.18, N."""
    if pair.overlap < 0.0:
        return 0.0
    stiffness = contact["stiffness"]
    if thermal := contact.get("thermal"):
        heat = thermal["temperature"] / thermal["reference"] - 1
        softened = stiffness * np.exp(-thermal["sensitivity"] * heat)
        stiffness = max(softened, thermal["floor"])
    force = stiffness * pair.strain ** contact["exponent"] + contact["damping"] * pair.closing
    if bond and pair.strain >= bond["activation_strain"]:
        force -= bond["stiffness"] * pair.strain ** bond["exponent"]
    return force * pair.area


def stock(pair, contact):
    """Return the force of appendix B.2 that pushes a pair apart, N."""
    if pair.overlap < 0.0:
        return 0.0
    damping = contact["damping"] * pair.closing
    if contact["law"] == "hooke":
        return contact["stiffness"] * pair.overlap + damping
    first, second = pair.radius
    radius = first * second / (first + second)
    modulus = contact["youngs_modulus"] / (2 * (1 - contact["poisson_ratio"] ** 2))
    energy = contact.get("surface_energy", 0.0)
    if contact["law"] == "jkr":
        a = contact_radius(pair, contact)
        adhesion = 2 * np.pi * a**2 * np.sqrt(4 * energy * modulus / (np.pi * a))
        return 4 * modulus * a**3 / (3 * radius) - adhesion + damping
    hertz = 4 / 3 * modulus * np.sqrt(radius) * pair.overlap**1.5
    return hertz - 4 * np.pi * energy * radius + damping


def contact_radius(pair, contact):
    """Return the radius of the disk of contact, Hertz's or that of `jkr`, m."""
    radius = pair.radius[0] * pair.radius[1] / sum(pair.radius)
    hertz = np.sqrt(radius * pair.overlap)
    if contact["law"] != "jkr":
        return hertz
    modulus = contact["youngs_modulus"] / (2 * (1 - contact["poisson_ratio"] ** 2))
    wide = np.pi * contact["surface_energy"] / modulus

    def misfit(a):
        return a**2 / radius - 2 * np.sqrt(wide * a) - pair.overlap

    return brentq(misfit, hertz, radius, xtol=1e-16)


def near_field(pair, field):
    """Return the force of eq. 7.23 that pulls a pair together, N."""
    if field["cutoff"] != "all" and pair.distance >= field["cutoff"]:
        return 0.0
    first, second = pair.radius
    product = {
        "mass": pair.mass[0] * pair.mass[1],
        "area": (4 * np.pi * first * second) ** 2,
        "volume": (4 / 3 * np.pi) ** 2 * (first * second) ** 3,
        "charge": pair.mass[0] * pair.mass[1] * pair.charge[0] * pair.charge[1],
    }[field["scaling"]]
    if field["scaling"] != "charge":
        product *= pair.sign[0] * pair.sign[1]
    attraction, repulsion = (
        field.get(term, {"strength": 0.0, "exponent": 0.0}) for term in ("attraction", "repulsion")
    )
    force = attraction["strength"] * pair.distance ** -attraction["exponent"]
    force -= repulsion["strength"] * pair.distance ** -repulsion["exponent"]
    if width := field.get("switch_width"):
        x = np.clip((pair.distance - field["cutoff"]) / width + 1, 0, 1)
        force *= 1 - x**3 * (10 - 15 * x + 6 * x**2)
    return product * force


# Just touching and deep, closing and parting; then not touching.
TOUCHING = [
    Pair(0.08999, closing=0.01),
    Pair(0.089, closing=0.3),
    Pair(0.085, closing=-0.2),
    Pair(0.088, radius=(0.06, 0.03), closing=0.1),
]
APART = [Pair(0.0901, closing=1.0), Pair(0.135), Pair(0.1495), Pair(0.1501)]
SIGNED = [replace(pair, sign=signs) for pair in APART for signs in ((1, 1), (1, -1), (-1, -1))]
CHARGED = [replace(pair, charge=charge) for pair in APART for charge in ((3.0, 2.0), (3.0, -2.0))]

LAWS = {
    "zohdi": {"contact": ZOHDI},
    "zohdi, soft": {"contact": ZOHDI | {"exponent": 0.5, "thermal": THERMAL}},
    "zohdi, at the floor": {"contact": ZOHDI | {"thermal": THERMAL | {"floor": 5.0e7}}},
    "bond": {"contact": ZOHDI, "bond": BOND},
    "bond without memory": {"contact": ZOHDI, "bond": BOND | {"memory": "none"}},
    "hooke": {"contact": HOOKE},
    "hertz": {"contact": HERTZ},
    "jkr": {"contact": JKR},
    "dmt": {"contact": DMT},
    "zohdi and near field": {"contact": ZOHDI, "near_field": NEAR_FIELD},
    "hertz and near field": {"contact": HERTZ, "near_field": NEAR_FIELD},
    "bond and near field": {"contact": ZOHDI, "bond": BOND, "near_field": NEAR_FIELD},
}
FIELDS = {
    "near field": (NEAR_FIELD, SIGNED),
    "switched": (NEAR_FIELD | {"switch_width": 0.03}, SIGNED),
    "by area": (NEAR_FIELD | {"scaling": "area"}, SIGNED),
    "by volume": (NEAR_FIELD | {"scaling": "volume"}, APART),
    "by charge": (NEAR_FIELD | {"scaling": "charge"}, CHARGED),
    "repulsion alone": ({k: v for k, v in NEAR_FIELD.items() if k != "attraction"}, SIGNED),
    "odd exponents": (
        NEAR_FIELD
        | {"attraction": {"strength": 0.3, "exponent": 0.7}}
        | {"repulsion": {"strength": 2.0, "exponent": 0}},
        APART,
    ),
}  # fmt: skip


def force_apart(pair, sections):
    contact, bond = sections.get("contact"), sections.get("bond")
    field = sections.get("near_field")
    force = 0.0
    if contact:
        force += zohdi(pair, contact, bond) if contact["law"] == "zohdi" else stock(pair, contact)
    return force - (near_field(pair, field) if field else 0.0)


@pytest.mark.parametrize("integrator", ["lorentz", "verlet"])
@pytest.mark.parametrize("name", LAWS)
def test_forces_of_pairs_are_those_of_the_law(tmp_path, name, integrator):
    pairs = TOUCHING + APART
    time = {"duration": STEP, "step": STEP, "integrator": integrator}
    force = state(run_pairs(tmp_path, LAWS[name] | {"time": time}, pairs), 0)["force"]
    expected = np.array([force_apart(pair, LAWS[name]) for pair in pairs])
    assert force[:, 0, 0] == pytest.approx(-expected, rel=1e-10, abs=1e-12)
    assert force[:, 1] == pytest.approx(-force[:, 0], rel=1e-14)
    assert np.abs(force[:, :, 1:]).max() < 1e-12
    assert np.abs(expected[: len(TOUCHING)]).min() > 1e-3


@pytest.mark.parametrize("contact", [None, ZOHDI, HERTZ], ids=["no contact", "zohdi", "hertz"])
@pytest.mark.parametrize("name", FIELDS)
def test_near_fields_of_pairs_are_those_of_eq_7_23(tmp_path, name, contact):
    field, pairs = FIELDS[name]
    sections = {"near_field": field} | ({"contact": contact} if contact else {})
    if not contact and name != "repulsion alone":
        # Without contact only a field that does not diverge is a case.
        sections["near_field"] = field | {"attraction": field["attraction"] | {"exponent": 0}}
        sections["near_field"]["repulsion"] = field["repulsion"] | {"exponent": 0}
    if not contact and name == "repulsion alone":
        pairs = [replace(pair, sign=(1, 1)) for pair in pairs]
    force = state(run_pairs(tmp_path, sections, pairs), 0)["force"]
    expected = np.array([near_field(pair, sections["near_field"]) for pair in pairs])
    assert force[:, 0, 0] == pytest.approx(expected, rel=1e-12, abs=1e-13)
    assert np.count_nonzero(expected) >= 3
    assert np.count_nonzero(expected) < len(pairs)


@pytest.mark.parametrize("scaling", ["mass", "charge"])
def test_near_field_of_all_pairs_reaches_everything(tmp_path, scaling):
    signs = [(1, 1), (1, -1 if scaling == "mass" else 1)]
    first, second = (Pair(0.3, charge=(2.0, -1.0), sign=sign) for sign in signs)
    sections = {"contact": ZOHDI, "near_field": NEAR_FIELD | {"scaling": scaling, "cutoff": "all"}}
    data = state(run_pairs(tmp_path, sections, [first, second]), 0)
    position, force = data["position"].reshape(4, 3), data["force"].reshape(4, 3)
    source = data["mass"].ravel() * [1.0, 1.0, 1.0, -1.0]
    if scaling == "charge":
        source = data["mass"].ravel() * [2.0, -1.0, 2.0, -1.0]
    offset = position[None] - position[:, None]
    distance = np.linalg.norm(offset, axis=2) + np.eye(4)
    size = np.outer(source, source) * (0.5 / distance - 0.01 / distance**2)
    assert force == pytest.approx((size[..., None] * offset / distance[..., None]).sum(axis=1))


SLIDING = [Pair(0.089, slip=1.0), Pair(0.0985, slip=0.8, radius=(0.05, 0.05), closing=0.01)]


def slid_pairs(folder, contact, duration):
    """Slide pairs and return the pull on the first of each, along and across the line, and spins.

    The line of centres turns as they slide.
    """
    contact = contact | {"damping": 0.0, "rotation": True}
    data = state(run_pairs(folder, {"contact": contact}, SLIDING, duration=duration), -1)
    line = np.diff(data["position"], axis=1)[:, 0]
    distance = np.linalg.norm(line, axis=1)
    line /= distance[:, None]
    force = data["force"][:, 0]
    along = np.einsum("pk,pk->p", force, line)
    across = np.linalg.norm(force - along[:, None] * line, axis=1)
    assert (force[:, 1] > 0.0).all()
    return along, across, distance, data["torque"][..., 2]


def test_stock_friction_is_a_spring_that_slips_at_the_limit_of_coulomb(tmp_path):
    contact = HOOKE | {"friction": {"stiffness": 1.0e5, "static": 0.5, "dynamic": 0.5}}
    # Over ten steps of a microsecond the speed of the slip hardly changes.
    _, across, _, torque = slid_pairs(tmp_path / "early", contact, 1e-5)
    assert across == pytest.approx([1.0e5 * pair.slip * 1e-5 for pair in SLIDING], rel=1e-3)
    radius = np.array([pair.radius for pair in SLIDING])
    arms = radius - 0.5 * np.array([[pair.overlap] for pair in SLIDING])
    assert torque == pytest.approx(arms * across[:, None], rel=1e-3)
    along, across, distance, _ = slid_pairs(tmp_path / "late", contact, 3e-3)
    touch = radius.sum(axis=1)
    assert along == pytest.approx(-2.0e5 * (touch - distance), rel=1e-9)
    assert across == pytest.approx(0.5 * np.abs(along), rel=1e-9)


@pytest.mark.parametrize("law", ["hertz", "jkr", "dmt"])
def test_material_friction_is_mindlins_spring(tmp_path, law):
    contact = {"hertz": HERTZ, "jkr": JKR, "dmt": DMT}[law]
    contact = contact | {"friction": {"static": 5.0, "dynamic": 5.0}}
    _, across, *_ = slid_pairs(tmp_path, contact, 1e-5)
    shear = contact["youngs_modulus"] / (4 * (2 - 0.3) * (1 + 0.3))
    expected = [8 * shear * contact_radius(pair, contact) * pair.slip * 1e-5 for pair in SLIDING]
    assert across == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("rotation", [True, False])
def test_spins_slip_only_with_rotation(tmp_path, rotation):
    """Two spheres that spin the same way on each other, friction far from its limit."""
    friction = {"stiffness": 1.0e9, "static": 9.0, "dynamic": 9.0}
    sections = {"contact": ZOHDI | {"friction": friction, "rotation": rotation}}
    rows = "x,y,z,radius,density,charge_per_mass,wx,wy,wz\n"
    rows += "-0.0445,0,0,0.05,7000,1,0,0,3\n0.0445,0,0,0.05,7000,1,0,0,3\n"
    (tmp_path / "particles.csv").write_text(rows)
    case = parse_case(
        sections
        | {
            "name": "spins",
            "particles": {"file": "particles.csv", "allow_overlap": True},
            "time": {"duration": STEP, "step": STEP},
            "output": {"forces": True},
        },
        tmp_path,
    )
    write_deck(case, create_particles(case), tmp_path)
    assert lmp("-in", DECK, folder=tmp_path).returncode == 0
    data = state(open_universe(tmp_path).trajectory, 0)
    # Each edge moves at 3 rad/s times the arm, half the distance; eq. 7.12 and 7.13.
    area = np.pi * (0.05**2 - 0.0445**2)
    stick = 1.0e9 * (2 * 3.0 * 0.0445) * area * STEP * rotation
    assert data["force"][0, :, 1] == pytest.approx([-stick, stick], rel=1e-12)
    assert data["torque"][0, :, 2] == pytest.approx([-0.0445 * stick] * 2, rel=1e-12)
    assert (stick > 0.0) == rotation


@pytest.mark.parametrize(
    ("offsets", "boundaries"),
    [
        ([[1, 0, 0]], "s m m"),
        ([[0, 1, 0]], "m s m"),
        ([[0, 0, 1]], "m m s"),
        ([[1, 0, 0], [0, 1, 0]], "s s m"),
        ([[1, 0, 0], [0, 1, 0], [0, 0, 1]], "s s s"),
        ([], "m m m"),
    ],
    ids=["x", "y", "z", "plane", "space", "one particle"],
)
@pytest.mark.parametrize("ranks", [1, 2])
def test_thin_clouds_run_and_keep_their_particles(tmp_path, offsets, boundaries, ranks):
    """Spheres hit one at rest, each along an axis, and stop; it goes on with what they had."""
    directions = np.array([[0, 0, 0], *offsets], dtype=float)
    rows = np.column_stack([0.11 * directions, -directions])
    (tmp_path / "particles.csv").write_text(
        "x,y,z,vx,vy,vz,radius,density,charge_per_mass\n"
        + "".join(",".join(map(repr, map(float, row))) + ",0.05,7000,1\n" for row in rows)
    )
    case = parse_case(
        {
            "name": "thin",
            "particles": {"file": "particles.csv"},
            "contact": {"stiffness": 1.0e9, "exponent": 0},
            "time": {"duration": 0.06, "step": 1e-5},
        },
        tmp_path,
    )
    particles = create_particles(case)
    assert f"\nboundary {boundaries}\n" in deck_text(case, particles)
    write_deck(case, particles, tmp_path)
    done = lmp("-in", DECK, folder=tmp_path, ranks=ranks)
    assert done.returncode == 0, done.stdout + done.stderr
    end = open_universe(tmp_path).trajectory[-1].data
    velocity = np.zeros_like(directions)
    velocity[0] = -directions.sum(axis=0)
    assert end["velocity"] == pytest.approx(velocity, abs=0.01)
    assert end["position"] == pytest.approx(0.1 * directions + 0.05 * velocity, abs=1e-3)


@pytest.mark.parametrize("name", ["zohdi", "hooke", "hertz", "jkr", "dmt", "bond and near field"])
def test_energy_table_and_thermo_output_have_every_account(tmp_path, name):
    run_pairs(tmp_path, LAWS[name], TOUCHING, duration=10 * STEP)
    header, first, *_ = (tmp_path / ENERGY_TABLE).read_text().splitlines()
    assert tuple(header.split(",")) == ("time", *ENERGY_ACCOUNTS)
    log = (tmp_path / "log.lammps").read_text()
    (thermo,) = re.findall(r"^ +Step +Time +(v_kinetic.*)\n +0 +0 +(.*)$", log, re.M)
    assert thermo[0].split() == [f"v_{account}" for account in ENERGY_ACCOUNTS]
    told = [float(value) for value in thermo[1].split()]
    assert told == pytest.approx([float(value) for value in first.split(",")[1:]], rel=1e-9)


def test_what_the_springs_of_a_stock_law_hold_is_in_its_loss(tmp_path):
    """Hooke's law: the loss swings with the spring, k overlap^2/2, and comes back."""
    pair = Pair(0.091, closing=0.5)
    contact = HOOKE | {"damping": 0.0}
    time = {"duration": 0.02, "step": 1e-5, "frames": 200}
    trajectory = run_pairs(tmp_path, {"contact": contact}, [pair], **time)
    ledger = EnergyLedger.read(tmp_path / ENERGY_TABLE)
    distance = [np.ptp(frame.data["position"][:, 0]) for frame in trajectory]
    held = 0.5 * 2.0e5 * np.maximum(0.09 - np.array(distance), 0.0) ** 2
    brought = 0.5 * pair.mass[0] * pair.mass[1] / sum(pair.mass) * 0.5**2
    assert max(held) == pytest.approx(brought, rel=1e-3)
    assert ledger.contact_loss == pytest.approx(held, rel=0, abs=1e-5 * brought)
    assert np.abs(ledger.contact_loss[-1]) < 1e-5 * brought
    assert not ledger.potential.any()


@pytest.mark.parametrize("law", ["hooke", "hertz", "jkr", "dmt"])
@pytest.mark.parametrize("field", [None, NEAR_FIELD | {"switch_width": 0.03}], ids=["", "field"])
def test_ledger_of_stock_laws_closes_and_their_losses_stay(tmp_path, law, field):
    """Oblique collisions with dissipation and friction, until the spheres are apart again."""
    contact = {"hooke": HOOKE, "hertz": HERTZ, "jkr": JKR, "dmt": DMT}[law]
    friction = {"static": 0.3, "dynamic": 0.3} | ({"stiffness": 1e5} if law == "hooke" else {})
    sections = {"contact": contact | {"friction": friction, "rotation": True}}
    if field:
        sections["near_field"] = field
    pairs = [Pair(0.091, closing=2.0, slip=slip) for slip in (0.0, 0.5, 3.0)]
    trajectory = run_pairs(tmp_path, sections, pairs, duration=0.06, step=2e-5, frames=60)
    ledger = EnergyLedger.read(tmp_path / ENERGY_TABLE)
    assert np.abs(ledger.residual).max() < 1e-5 * ledger.launch_energy
    end = state(trajectory, -1)["position"]
    assert (np.linalg.norm(np.diff(end, axis=1)[:, 0], axis=1) > 0.091).all()
    assert ledger.rotational[-1] > 0.01 * ledger.launch_energy
    assert 0.1 < ledger.contact_loss[-1] / ledger.launch_energy < 0.9
    assert ledger.contact_loss[-1] == pytest.approx(ledger.contact_loss[-5], rel=1e-6)
    if field:
        assert np.ptp(ledger.near_field_energy) > 1e-3


GIVING = {
    "hooke, pressed": (HOOKE, Pair(0.089)),
    "hertz, pressed": (HERTZ, Pair(0.089)),
    "dmt, slow": (DMT, Pair(0.09001, closing=1e-3)),
    "jkr, slow": (JKR, Pair(0.09001, closing=1e-3)),
}


@pytest.mark.parametrize("name", GIVING)
def test_stock_contacts_may_give_what_they_hold_and_their_adhesion_does(tmp_path, name):
    """Springs that are pressed at the start and surfaces that stick are no instability."""
    contact, pair = GIVING[name]
    contact = contact | {"damping": 0.0}
    run_pairs(tmp_path, {"contact": contact}, [pair], duration=0.04, step=4e-6, frames=1000)
    case = load_case(tmp_path / "case.yaml")
    particles = create_particles(case)
    reserve = energy_reserve(case.contact, particles.position, particles.radius)
    given = -EnergyLedger.read(tmp_path / ENERGY_TABLE).contact_loss.min()
    # That of adhesion is for the largest spheres: it goes with R*^(4/3), here 2/45 m.
    if "surface_energy" in contact:
        reserve *= (np.prod(pair.radius) / sum(pair.radius) / 0.025) ** (4 / 3)
    assert given == pytest.approx(reserve, rel=2e-3)
    assert given > 10 * 0.5 * pair.mass[0] * pair.closing**2


def test_the_reserve_is_that_of_every_pair_however_unequal():
    """A sphere as large as the cloud, in it, is no more work than any other."""
    rng = np.random.default_rng(4)
    position = np.vstack([rng.uniform(-1, 1, (300, 3)), [[2.0, 0, 0]]])
    radius = np.append(0.1 * np.exp(rng.uniform(-1, 1, 300)), 1.5)
    i, j = np.triu_indices(len(radius), 1)
    overlap = radius[i] + radius[j] - np.linalg.norm(position[i] - position[j], axis=1)
    held = 0.5 * HOOKE["stiffness"] * np.sum(np.maximum(overlap, 0.0) ** 2)
    contact = Contact.model_validate(HOOKE)
    assert energy_reserve(contact, position, radius) == pytest.approx(held, rel=1e-12)


def test_a_stock_contact_that_makes_energy_stops_the_run(tmp_path):
    """A step that is four times too long for the spring."""
    with pytest.raises(AssertionError, match="came from nothing"):
        run_pairs(
            tmp_path, {"contact": HOOKE | {"damping": 0.0}}, [Pair(0.0901, closing=2.0)],
            duration=1.2, step=6e-3, frames=200,
        )  # fmt: skip


@pytest.mark.parametrize("field", [None, NEAR_FIELD | {"scaling": "charge"}], ids=["", "charge"])
def test_signs_that_nothing_uses_do_no_harm(tmp_path, field):
    sections = {"contact": ZOHDI} | ({"near_field": field} if field else {})
    pairs = [replace(pair, sign=(1, -1)) for pair in TOUCHING]
    force = state(run_pairs(tmp_path, sections, pairs), 0)["force"]
    expected = [-force_apart(pair, sections) for pair in pairs]
    assert force[:, 0, 0] == pytest.approx(expected, rel=1e-10)


NAMES = ["a;shell touch hacked", "a\nshell touch hacked", "a b", "$(run)", "a&", "A", "../a", '"a"']


@pytest.mark.parametrize("name", NAMES)
def test_names_that_a_deck_could_obey_are_refused(tmp_path, name):
    case = {"name": name, "particles": {"file": "p.csv"}, "time": {"duration": 1.0, "step": 0.5}}
    with pytest.raises(CaseError, match="name"):
        parse_case(case, tmp_path)


def test_no_text_of_a_case_but_its_name_is_in_the_deck(tmp_path):
    evil = "shell touch hacked"
    (tmp_path / f"{evil}.csv").write_text(
        "x,y,z,radius,density,charge_per_mass,sign\n0,0,0,0.1,1000,1,1\n1,0,0,0.1,1000,1,-1\n"
    )
    case = parse_case(
        {
            "name": "harmless",
            "title": f"$({evil}) & {evil}",
            "particles": {"file": f"{evil}.csv"},
            "contact": ZOHDI | {"thermal": THERMAL},
            "bond": BOND,
            "near_field": NEAR_FIELD,
            "output": {"contacts": True, "forces": True},
            "time": {"duration": 1.0, "step": 0.5},
        },
        tmp_path,
    )
    text = deck_text(case, create_particles(case))
    assert "shell touch" not in text
    assert re.findall("^# Case (.*), in SI", text) == ["harmless"]
    for key, value in {"law": "zohdi\nshell ls", "exponent": "2 shell"}.items():
        with pytest.raises(CaseError, match=key):
            parse_case(case.model_dump(mode="json") | {"contact": ZOHDI | {key: value}}, tmp_path)
