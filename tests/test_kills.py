"""Runs that are killed at random instants, again and again, and end as if they had not been.

Minutes: `python -m pytest -m slow tests/test_kills.py`.
"""

import json
import os
import random
import signal
import subprocess
import sys
import time

import pytest
from test_restart import CASES, CLOUD, command, deck_of, outputs

from lammps_blast.deck import RESTARTS
from lammps_blast.lammps_program import program_environment

KILLS = 26


def long_run(name):
    """Return variables for a hundred restart files and more: kills come while one is made."""
    interval = 5e-3 if name == "implicit" else 1e-3
    return {"duration": 0.5, "restart_interval": interval, "output_interval": interval}


def killed(words, folder, instant=None):
    """Run a program in a folder; kill it and what it has started at an instant (s), if given.

    Return whether that came before its end.
    """
    process = subprocess.Popen(
        words,
        cwd=folder,
        env=program_environment(),
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        start_new_session=True,
    )
    try:
        said, _ = process.communicate(timeout=instant)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return True
    assert process.returncode == 0, said
    return False


def kill_again_and_again(begin, words, seed):
    """Kill runs at random instants; they must leave what one leaves that is left alone.

    Parameters
    ----------
    begin
        Makes the folder of a run, by its name.
    words
        The command that begins a run in a folder, or goes on with it.
    """
    whole = begin("whole")
    began = time.monotonic()
    assert not killed(words(whole), whole)
    usual = time.monotonic() - began
    expected = outputs(whole)
    instants = random.Random(seed)
    kills = runs = 0
    while kills < KILLS:
        runs += 1
        folder = begin(f"killed{runs}")
        # The longer a run is at it, the later it is killed: it must come to an end.
        patience = usual
        began = time.monotonic()
        while killed(words(folder), folder, instants.uniform(0.1, 0.9) * patience):
            kills += 1
            patience *= 1.1
        usual = min(usual, time.monotonic() - began)  # the first may have had a busy machine
        found = outputs(folder)
        assert [file for file in expected if found[file] != expected[file]] == []
    print(f"{seed}: {kills} kills in {runs} runs")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "ranks"), [(name, 1) for name in CASES] + [("free", 2), ("tree", 2), ("stock", 2)]
)
def test_a_deck_outlives_its_kills(tmp_path, name, ranks):
    variables = long_run(name)

    def words(folder):
        restart = "newest" if any((folder / name).exists() for name in RESTARTS) else "no"
        return command(ranks, restart=restart, **variables)

    def begin(folder):
        return deck_of(tmp_path / folder, CASES[name])

    kill_again_and_again(begin, words, seed=f"{name} on {ranks}")


@pytest.mark.slow
@pytest.mark.parametrize("name", ["binary", "contact", "implicit"])
def test_a_run_from_python_outlives_its_kills(tmp_path, name):
    """From imports to the analysis."""
    case = CLOUD | CASES[name]
    case["time"] = case["time"] | {"duration": 0.5}
    case["output"] = case["output"] | {"restart_interval": 5e-3, "interval": 5e-3}
    (tmp_path / "case.yaml").write_text(json.dumps(case))

    def begin(folder):
        (tmp_path / folder).mkdir()
        return tmp_path / folder

    def words(folder):
        run = [sys.executable, "-m", "lammps_blast.run", "../case.yaml", "--output", "."]
        return [*run, "--resume", "--no-figures"]

    kill_again_and_again(begin, words, seed=f"{name} from Python")
