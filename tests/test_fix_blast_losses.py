"""Fix blast/losses: energies of contacts, bonds and near field with their losses add up."""

import re
from dataclasses import dataclass

import numpy as np
import pytest
from conftest import SYSTEM, lmp, make_particles

from lammps_blast.deck import write_particle_data

CHANNELS = ("damping", "friction", "bond friction", "bond formation", "pair work")

LAWS = {
    "elastic": "",
    "damping": "damping 1.0e5",
    "friction": "friction 1.0e7 0.4 0.3",
    "bond friction": "bond 0 2 0.05 1.0e6 contact",
    "bond formation": "bond 1.0e6 2 0.05 0 contact",
}
PAPER = "damping 1.0e5 friction 1.0e7 0.4 0.3 bond 1.0e6 2 0.05 1.0e3 contact"

FIELDS = "magnetic 3 -6 7 drag chow density 100 viscosity 0.1"
INTEGRATORS = {
    "nve": "fix integrate all nve/sphere",
    "lorentz": f"fix integrate all nve/sphere/lorentz {FIELDS}",
    # Two steps of its own in each of LAMMPS's.
    "implicit": "fix integrate all nve/implicit max_step {half} iterations 50 tolerance 1e-9 "
    f"{FIELDS}",
}
NEAR_FIELDS = {"none": None, "cut": "0.2 mass switch 0.08", "all": "all mass"}
DURATION = 0.1
FRAMES = 50


def pair_commands(law, near_field):
    """Return contact by a law and, overlaid, a near field."""
    contact = f"stiffness 1.5e7 exponent 2 {law}"
    settings = NEAR_FIELDS[near_field]
    if settings is None:
        return f"pair_style blast/contact rotation yes\npair_coeff * * {contact}"
    return f"""
        pair_style hybrid/overlay blast/contact rotation yes blast/nearfield {settings}
        pair_coeff * * blast/contact {contact}
        pair_coeff * * blast/nearfield 0.5 1 0.01 2
    """


def colliding_cloud():
    """Return 64 turning spheres of both charges that rush together: some 100 contacts in 0.1 s."""
    rng = np.random.default_rng(31)
    lattice = np.stack(np.unravel_index(np.arange(64), (4, 4, 4)), axis=1) * 0.115 - 0.1725
    return make_particles(
        lattice + rng.uniform(-0.005, 0.005, lattice.shape),
        velocity=0.5 * rng.normal(size=lattice.shape) - 6 * lattice,
        spin=10 * rng.normal(size=lattice.shape),
        radius=0.05 * np.exp(rng.uniform(-0.1, 0.1, 64)),
        charge=rng.choice([-10.0, 10.0], 64),
    )


def ledger_commands(law, near_field, integrator, step):
    """Return a whole deck that leaves a row of the ledger, for each frame, in ledger.txt."""
    steps = round(DURATION / step)
    losses = " ".join(f"$(f_losses[{n}]:%.17g)" for n in range(1, 6))
    field_work = "0" if integrator == "nve" else "f_integrate[1]+f_integrate[2]"
    return f"""
        {SYSTEM}
        neighbor 0.01 nsq
        neigh_modify every 1 delay 0 check yes
        comm_modify cutoff 0.0 vel yes
        timestep {step!r}
        {pair_commands(law, near_field)}
        fix losses all blast/losses work yes
        {INTEGRATORS[integrator].format(half=step / 2)}
        compute pair all pair blast/contact
        compute rotational all erotate/sphere
        variable field_work equal {field_work}
        thermo_style custom step ke pe c_rotational c_pair c_pair[4]
        thermo_modify norm no
        fix ledger all print {steps // FRAMES} "$(ke:%.17g) $(c_rotational:%.17g) $(pe:%.17g) &
{losses} $(v_field_work:%.17g) $(c_pair[4])" screen no title "" file ledger.txt
        run {steps}
    """


@dataclass(frozen=True)
class Ledger:
    """Columns of a run, one row a frame, J."""

    kinetic: np.ndarray  # rotational too
    potential: np.ndarray
    losses: np.ndarray  # (frames, 4)
    pair_work: np.ndarray
    field_work: np.ndarray  # of drag and magnetic force
    bonds: np.ndarray

    @classmethod
    def read(cls, path):
        columns = np.loadtxt(path).T
        return cls(
            kinetic=columns[0] + columns[1],
            potential=columns[2],
            losses=columns[3:7].T,
            pair_work=columns[7],
            field_work=columns[8],
            bonds=columns[9],
        )

    @property
    def error(self):
        """Largest departure of the total from its start, a part of the energy that was about."""
        total = self.kinetic + self.potential + self.losses.sum(axis=1) - self.field_work
        return np.abs(total - total[0]).max() / self.turnover

    @property
    def turnover(self):
        return self.kinetic.max() + self.losses[-1].sum()


@pytest.fixture
def keep_ledger(simulate, tmp_path):
    """Return a function that runs the cloud and returns its Ledger."""

    def run(law, near_field, integrator, step):
        simulation = simulate(colliding_cloud())
        commands = ledger_commands(law, near_field, integrator, step)
        simulation.commands("clear\n" + commands.replace("ledger.txt", f"{tmp_path}/ledger.txt"))
        return Ledger.read(tmp_path / "ledger.txt")

    return run


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("near_field", NEAR_FIELDS)
@pytest.mark.parametrize("law", ["elastic", "damping", "friction", "bond friction"])
def test_the_ledger_closes_at_second_order(keep_ledger, law, near_field, integrator):
    """What is lost is counted on the discrete motion, so the error is that of the potentials."""
    coarse, fine = (keep_ledger(LAWS[law], near_field, integrator, step) for step in (1e-4, 5e-5))
    # Friction jumps from stick to slip, but at whole steps.
    tolerance = 0.5 if law == "friction" else 0.1
    assert coarse.error / fine.error == pytest.approx(4.0, abs=tolerance)
    assert coarse.error < 3e-4
    assert (np.diff(coarse.losses, axis=0) >= 0).all()
    for channel, loss in zip(CHANNELS, coarse.losses[-1], strict=False):
        assert loss > 1e-3 * coarse.turnover if channel == law else loss == 0


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("near_field", NEAR_FIELDS)
def test_the_ledger_of_all_losses_closes(keep_ledger, near_field, integrator):
    ledger = keep_ledger(PAPER, near_field, integrator, 1e-4)
    assert (ledger.losses[-1] > 0).all()
    assert (np.diff(ledger.losses, axis=0) >= 0).all()
    assert ledger.bonds[-1] > 20
    assert ledger.error < 1e-4


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("near_field", NEAR_FIELDS)
def test_pair_work_is_what_moves_the_particles(keep_ledger, near_field, integrator):
    """To rounding; and it is what potentials and losses give, to the error of the ledger."""
    ledger = keep_ledger(PAPER, near_field, integrator, 1e-4)
    gain = ledger.kinetic - ledger.kinetic[0] - ledger.field_work
    assert np.abs(gain).max() > 1e-3 * ledger.turnover
    assert np.abs(gain - ledger.pair_work).max() < 1e-12 * ledger.turnover
    given = ledger.potential[0] - ledger.potential - ledger.losses.sum(axis=1)
    assert np.abs(ledger.pair_work - given).max() < 1e-4 * ledger.turnover


@pytest.mark.parametrize("integrator", ["nve", "implicit"])
def test_formation_of_bonds_is_counted_at_second_order(keep_ledger, integrator):
    """A bond that forms at the end of a step pulls for half of that step already."""
    law = LAWS["bond formation"]
    coarse, fine = (keep_ledger(law, "none", integrator, step) for step in (1e-4, 5e-5))
    assert coarse.losses[-1].tolist() == [0, 0, 0, coarse.losses[-1, 3]]
    heat = coarse.losses[-1, 3] / coarse.turnover
    assert coarse.error < 0.1 * heat
    assert coarse.error / fine.error == pytest.approx(4.0, abs=0.1)


def test_bonds_of_the_start_are_no_loss(simulate):
    """Whether or not a `run 0` comes first: the ledger begins with their potential."""
    for before in ("", "run 0"):
        simulation = simulate(make_particles([[0.0, 0, 0], [0.09, 0, 0]]))
        simulation.commands(f"""
            neighbor 0.02 nsq
            comm_modify cutoff 0.0 vel yes
            pair_style blast/contact
            pair_coeff * * stiffness 1.0e7 exponent 2 {LAWS["bond formation"]}
            compute pair all pair blast/contact
            thermo_style custom step c_pair
            fix losses all blast/losses
            fix integrate all nve/sphere
            timestep 1.0e-6
            {before}
            run 10
        """)
        bonds = simulation.lammps.numpy.extract_compute("pair", 0, 1)[3]
        losses = [simulation.lammps.extract_fix("losses", 0, 1, n) for n in range(5)]
        assert bonds == 1
        assert losses == [0, 0, 0, 0, 0]


def test_ranks_agree(tmp_path):
    ledgers = []
    for ranks in (1, 2):
        folder = tmp_path / str(ranks)
        folder.mkdir()
        write_particle_data(colliding_cloud(), folder / "particles.data")
        (folder / "in.deck").write_text(ledger_commands(PAPER, "cut", "lorentz", 1e-4))
        done = lmp("-in", "in.deck", "-log", "none", folder=folder, ranks=ranks)
        assert done.returncode == 0, done.stdout + done.stderr
        ledgers.append(Ledger.read(folder / "ledger.txt"))
    alone, together = ledgers
    np.testing.assert_allclose(together.losses, alone.losses, rtol=1e-8)
    np.testing.assert_allclose(together.pair_work, alone.pair_work, rtol=1e-8)


def test_near_field_alone_has_work_but_no_losses(simulate):
    particles = colliding_cloud()
    simulation = simulate(particles)
    simulation.commands("""
        neighbor 0.01 nsq
        comm_modify cutoff 0.0
        timestep 1.0e-4
        pair_style blast/nearfield all mass
        pair_coeff * * 0.5 1 0.01 2
        fix losses all blast/losses work yes
        fix integrate all nve/sphere
        run 50
    """)
    *losses, work = (simulation.lammps.extract_fix("losses", 0, 1, n) for n in range(5))
    assert losses == [0, 0, 0, 0]
    start = 0.5 * np.sum(particles.mass[:, None] * particles.velocity**2)
    assert simulation.kinetic_energy - start == pytest.approx(work, rel=1e-11)


CONTACT = "pair_style blast/contact\npair_coeff * * stiffness 1e7 exponent 2"
BAD_COMMANDS = {
    "fix f all blast/losses work": "no arguments but: work yes or no",
    "fix f all blast/losses labour yes": "no arguments but: work yes or no",
    "fix f all blast/losses work maybe": "maybe",
    "group g id 1\nfix f g blast/losses": "requires group all",
    "fix f all blast/losses\nrun 0": "requires pair style blast/contact, or the keyword: work yes",
    "{contact}\nfix i all nve/sphere\nfix f all blast/losses\nrun 0": "before fix i",
    "{contact}\nfix f all blast/losses\nrun_style respa 2 2\nrun 0": "run_style respa",
}


@pytest.mark.parametrize("command", BAD_COMMANDS)
def test_bad_arguments_are_refused_by_name(simulate, command):
    simulation = simulate(make_particles([[0.0, 0, 0], [0.2, 0, 0]]))
    simulation.commands("neighbor 0.01 nsq\ncomm_modify cutoff 0.0 vel yes")
    with pytest.raises(Exception, match=re.escape(BAD_COMMANDS[command])):
        simulation.commands(command.format(contact=CONTACT))
