"""Arguments that no style of the plugin knows: LAMMPS refuses each, and lives on."""

import contextlib
import json
import os
import select
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest
from conftest import SYSTEM, random_cloud
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lammps_blast.deck import write_particle_data
from lammps_blast.engine import start_lammps

PATIENCE = 60.0  # s
FIELDS = "magnetic 1 2 3 drag chow density 1.2 viscosity 1e-5 velocity 0 0 1"
CONTACT = (
    "pair_coeff * * stiffness 1e5 exponent 2 damping 10 friction 1e5 0.4 0.3"
    " bond 1e4 2 0.05 10 contact thermal 300 500 1 1e3"
)
MOVE = "fix move all nve/sphere"
# Commands that are right, the first of them of the plugin, and how many words of it are names.
RIGHT = {
    "fix lorentz/drag": (4, f"fix f all lorentz/drag {FIELDS}", MOVE),
    "fix nve/sphere/lorentz": (
        4,
        "fix f all nve/sphere/lorentz magnetic 1 2 3 drag constant 0.4 density 1.2 velocity 0 0 1",
    ),
    "fix nve/implicit": (
        4,
        "fix f all nve/implicit phi 0.5 iterations 10 tolerance 1e-3 first_step 1e-5 max_step 1e-4"
        f" safety 0.9 fields solved anderson 2 {FIELDS}",
    ),
    "fix blast/losses": (4, "fix f all blast/losses work yes", MOVE),
    "fix blast/watch": (4, "fix f all blast/watch 2 strain 0.9 advice 1e-5", MOVE),
    "fix blast/restart": (4, "fix f all blast/restart", MOVE),
    # Its file may be called anything.
    "fix blast/table": (6, "fix f all blast/table 2 table.csv v_one", MOVE),
    "fix BLAST/BONDS": (4, "fix f all BLAST/BONDS", MOVE),
    "pair_style blast/contact": (2, "pair_style blast/contact rotation yes", CONTACT, MOVE),
    "pair_style blast/nearfield": (
        2,
        "pair_style blast/nearfield 0.5 mass switch 0.1",
        "pair_coeff * * 1e-3 1 1e-4 2",
        MOVE,
    ),
    "pair_style blast/nearfield all": (
        2,
        "pair_style blast/nearfield all charge method auto accuracy 1e-3",
        "pair_coeff 1 1 1e-3 1 1e-4 2",
        MOVE,
    ),
    "compute lorentz/drag/atom": (4, f"compute c all lorentz/drag/atom {FIELDS}", MOVE),
    "compute blast/contact/local": (4, "compute c all blast/contact/local", MOVE),
    "blast_pulse": (1, "blast_pulse all 10.0 seed 7", MOVE),
    # Those of restart files, which may be called anything.
    "blast_new_run": (4, "blast_new_run state.1 lock state.lock", MOVE),
    "blast_write_restart": (
        3,
        "blast_write_restart state.1 state.2 outputs output.csv logs output.csv values one",
        MOVE,
    ),
    "blast_read_restart": (
        4,
        "blast_read_restart state.1 lock state.lock step 1e-4 upto 10",
        MOVE,
    ),
    # Of pair_coeff, with the pair style that comes before it.
    "pair_coeff blast/contact": (1, CONTACT, MOVE),
    "pair_coeff blast/nearfield": (1, "pair_coeff * * 1e-3 1 1e-4 2", MOVE),
}
BEFORE = {
    "pair_coeff blast/contact": "pair_style blast/contact",
    "pair_coeff blast/nearfield": "pair_style blast/nearfield 0.5 mass",
    "fix blast/table": "variable one equal 1",
    "blast_write_restart": "variable one equal 1",
    "blast_read_restart": "blast_write_restart state.1 state.2\nclear",
    "compute blast/contact/local": f"pair_style blast/contact\n{CONTACT}",
}
NO_NUMBERS = (
    "nan",
    "inf",
    "-inf",
    "1e400",
    "1e",
    "0x10",
    "1.0.0",
    "abc",
    "''",
    "-",
    "99999999999999999999x",
)
WORDS = sorted(
    {word for commands in RIGHT.values() for text in commands[1:] for word in text.split()}
)
WORDS += [
    *NO_NUMBERS,
    "-1",
    "0",
    "1e300",
    "-1e300",
    "1e-300",
    "9223372036854775808",
    "*1",
    "2*1",
    "1*2",
]
WORDS += [
    "none",
    "stokes",
    "tree",
    "direct",
    "file",
    "append",
    "energy",
    "v_none",
    "signs",
    "i_none",
]
# No single quotation mark: it never reaches a style, and LAMMPS 22Jul2025 words its complaint from
# memory that it has given back.
WORDS += ["é", "x" * 300, "&", "#", '""', "${none}", "$(1/0)", "\\"]


def serve():
    """Obey lists of commands, each in a system of its own, and answer with the error if any."""
    os.chdir(tempfile.mkdtemp())
    write_particle_data(random_cloud(12, seed=3, radius=0.4, charge=1.0), Path("particles.data"))
    Path("output.csv").touch()
    lammps = start_lammps(log="none")
    # Bins of neighbours take for ever where particles have flown far apart.
    system = SYSTEM.replace("bin", "nsq") + "comm_modify vel yes\ntimestep 1e-4\n"
    for line in sys.stdin:
        done, failure = 0, None
        lammps.commands_string(f"clear\n{system}")
        try:
            for command in json.loads(line):
                lammps.command(command)
                done += 1
        except Exception as error:
            failure = str(error)
        print(json.dumps([done, failure]), flush=True)


class Server:
    """LAMMPS in a process of its own, which may die without taking the tests with it."""

    def __init__(self):
        self.process = subprocess.Popen(
            [sys.executable, __file__],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            text=True,
        )

    def ask(self, *commands):
        """Return how many of the commands were obeyed, and the error at the next one if any."""
        self.process.stdin.write(json.dumps(commands) + "\n")
        self.process.stdin.flush()
        ready, _, _ = select.select([self.process.stdout], [], [], PATIENCE)
        assert ready, f"no answer within {PATIENCE} s to {commands}"
        answer = self.process.stdout.readline()
        assert answer, f"LAMMPS died ({self.process.wait()}) of {commands}"
        return json.loads(answer)

    def close(self):
        self.process.kill()
        self.process.wait()
        for stream in (self.process.stdin, self.process.stdout):
            with contextlib.suppress(BrokenPipeError):
                stream.close()


@pytest.fixture(scope="module")
def server():
    running = Server()
    yield running
    running.close()


def before(name):
    return BEFORE[name].split("\n") if name in BEFORE else []


def is_number(word):
    return word.replace(".", "").replace("e-", "").replace("e", "").isdecimal()


def wrong_commands(name):
    """Yield commands that differ from the right one by a word that makes no sense."""
    names, right = RIGHT[name][:2]
    words = right.split()
    yield [*words, "nonsense"]
    for place in range(names, len(words)):
        substitutes = NO_NUMBERS if is_number(words[place]) else ("nonsense", "''")
        for word in substitutes:
            yield [*words[:place], word, *words[place + 1 :]]
    if len(words) > names:
        yield words[:-1]


@pytest.mark.parametrize("name", RIGHT)
def test_each_wrong_word_is_refused_where_it_stands(server, name):
    _, *right = RIGHT[name]
    done, failure = server.ask(*before(name), *right, "run 2")
    assert failure is None
    for words in wrong_commands(name):
        done, failure = server.ask(*before(name), " ".join(words))
        assert failure is not None, f"accepted: {' '.join(words)}"
        assert done == len(before(name))
        assert failure.startswith("ERROR")


@pytest.mark.parametrize(("again", "turns"), [("", False), (" rotation yes", True)])
def test_settings_given_again_are_all_of_them(server, again, turns):
    """A pair style without its keyword has the default, whatever was set before."""
    _, failure = server.ask(
        "pair_style blast/contact rotation yes",
        f"pair_style blast/contact{again}",
        CONTACT,
        "set group all omega 9 9 9",
        "compute torque all property/atom tqx",
        "compute most all reduce maxabs c_torque",
        "thermo_style custom step c_most",
        "run 0",
        'if "$(c_most) > 0.0" then "spheres turn"',
    )
    assert (failure is not None and "spheres turn" in failure) == turns, failure


def search(server, count):
    @settings(
        max_examples=count,
        derandomize=True,
        database=None,
        deadline=None,
        suppress_health_check=list(HealthCheck),
    )
    @given(
        st.sampled_from(sorted(RIGHT)),
        st.lists(
            st.tuples(st.integers(0, 40), st.integers(0, 2), st.sampled_from(WORDS)),
            min_size=1,
            max_size=6,
        ),
    )
    def try_one(name, changes):
        _, right, *rest = RIGHT[name]
        words = right.split()
        for place, lost, word in changes:
            at = 1 + place % len(words)
            words[at : at + lost] = [word]
        server.ask(*before(name), " ".join(words), *rest, "run 2")

    try_one()
    assert server.ask(MOVE, "run 2") == [2, None]


def test_arguments_at_random_kill_no_lammps(server):
    search(server, 200)


@pytest.mark.slow
def test_many_arguments_at_random_kill_no_lammps(server):
    search(server, 20_000)


if __name__ == "__main__":
    serve()
