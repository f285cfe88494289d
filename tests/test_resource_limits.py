"""What cannot be held in memory or on the disk is refused before it is begun."""

import os
import resource

import pytest
from conftest import blast
from test_hostile_input import CASE, CSV

from lammps_blast import resource_limits
from lammps_blast.case import CaseError, dump_case, parse_case
from lammps_blast.particles import ParticleFileError, read_particles
from lammps_blast.resource_limits import (
    BYTES_TO_PACK,
    check_room,
    memory_limit,
    memory_shortage,
    output_bytes,
)


def crowd(count, folder):
    text = CASE.replace("count: 3", f"count: {count}")
    return parse_case(text.replace("domain_radius: 1.0", "domain_radius: 1.0e4"), folder)


@pytest.mark.skipif(
    "asan" in os.environ.get("LD_PRELOAD", ""),
    reason="AddressSanitizer itself asks for terabytes of addresses",
)
def test_particles_beyond_the_memory_are_refused_before_any_is_placed(tmp_path):
    """A thousand million on a limit of 1 GiB, as `ulimit -v` sets it."""
    (tmp_path / "case.yaml").write_text(dump_case(crowd(10**9, tmp_path)))
    gibibyte = 2**30
    done = blast(
        "deck", "case.yaml", "-o", "deck", folder=tmp_path,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_AS, (gibibyte, gibibyte)),
    )  # fmt: skip
    assert done.returncode == 2
    expected = (
        "particles.count: 1000000000 particles need at least 205 GiB of memory, and 1 GiB can"
    )
    assert expected in done.stderr
    assert "Traceback" not in done.stderr
    assert not (tmp_path / "deck").exists()


def test_a_particle_file_beyond_the_memory_is_refused(tmp_path, monkeypatch):
    (tmp_path / "p.csv").write_text(CSV)
    monkeypatch.setattr(resource_limits, "memory_limit", lambda: 2 * BYTES_TO_PACK - 1)
    with pytest.raises(ParticleFileError, match=r"p\.csv: 2 particles need at least 440 bytes"):
        read_particles(tmp_path / "p.csv")


def test_the_least_limit_of_memory_counts(tmp_path, monkeypatch):
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    groups = tmp_path / "groups"
    monkeypatch.setattr(resource_limits, "_CGROUPS", groups)
    monkeypatch.setattr(resource_limits, "_OWN_CGROUPS", tmp_path / "own")
    assert memory_limit() <= machine
    outer, old = groups / "batch" / "job", groups / "memory" / "job"
    for folder in (outer / "step", old):
        folder.mkdir(parents=True)
    (outer / "step" / "memory.max").write_text("max\n")
    (outer / "memory.max").write_text("9000\n")
    (tmp_path / "own").write_text("0::/batch/job/step\n")
    assert memory_limit() == 9000
    (old / "memory.limit_in_bytes").write_text("8000\n")
    (tmp_path / "own").write_text("0::/batch/job/step\n4:cpu,memory:/job\n")
    assert memory_limit() == 8000
    told = memory_shortage(37, BYTES_TO_PACK)
    assert told.startswith("37 particles need at least 7.95 KiB of memory, and 7.81 KiB can be had")
    assert memory_shortage(36, BYTES_TO_PACK) is None


def test_frames_beyond_the_room_are_refused(tmp_path):
    case, nowhere_yet = crowd(10**9, tmp_path), tmp_path / "not" / "yet"
    with pytest.raises(
        CaseError, match=r"output\.interval: 3 frames of 4611686018427387904 .* free"
    ):
        check_room(case, 2**62, nowhere_yet)
    check_room(case, 3, nowhere_yet)
    assert output_bytes(case, 10) == 3 * 10 * 100
