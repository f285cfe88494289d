"""Runs that are killed at random instants, again and again, and end as if they had not been.

Minutes: `python -m pytest -m slow tests/test_kills.py`.
"""

import os
import random
import signal
import subprocess
import time

import pytest
from test_restart import CASES, command, deck_of, outputs, run_well

from lammps_blast.deck import RESTARTS
from lammps_blast.lammps_program import program_environment

KILLS = 26


def long_run(name):
    """Return variables for a hundred restart files and more: kills come while one is made."""
    interval = 5e-3 if name == "implicit" else 1e-3
    return {"duration": 0.5, "restart_interval": interval, "output_interval": interval}


def kill_or_end(folder, ranks, variables, instant):
    """Run, and go on where there is a restart file; kill all ranks at an instant (s).

    Return whether that came before the end.
    """
    restart = "newest" if any((folder / name).exists() for name in RESTARTS) else "no"
    process = subprocess.Popen(
        command(ranks, restart=restart, **variables),
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


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "ranks"), [(name, 1) for name in CASES] + [("free", 2), ("tree", 2), ("stock", 2)]
)
def test_a_run_outlives_its_kills(tmp_path, name, ranks):
    instants = random.Random(f"{name} {ranks}")
    whole = deck_of(tmp_path / "whole", CASES[name])
    variables = long_run(name)
    began = time.monotonic()
    run_well(whole, ranks=ranks, **variables)
    usual = time.monotonic() - began
    expected = outputs(whole)
    kills = attempt = 0
    while kills < KILLS:
        attempt += 1
        folder = deck_of(tmp_path / f"killed{attempt}", CASES[name])
        while kill_or_end(folder, ranks, variables, instants.uniform(0.1, 0.9) * usual):
            kills += 1
        found = outputs(folder)
        assert [file for file in expected if found[file] != expected[file]] == []
    print(f"{name} on {ranks}: {kills} kills in {attempt} runs")
