"""The trajectory reader against dumps that LAMMPS itself wrote, whole and damaged."""

import gc
import itertools
import os
import pickle
import random
import shutil
import struct
import subprocess
import sys
import tracemalloc
import warnings
from contextlib import contextmanager, nullcontext
from pathlib import Path

import MDAnalysis
import numpy as np
import pytest
from MDAnalysis.analysis.base import AnalysisBase

from lammps_blast import text_columns
from lammps_blast.deck import BINARY_CONSTANTS, BINARY_TRAJECTORY, TEXT_TRAJECTORY
from lammps_blast.trajectory import (
    BlastDumpReader,
    TrajectoryError,
    _Binary,
    open_universe,
)

N_ATOMS, N_FRAMES, EVERY, STEP = 20, 6, 10, 1.0e-3
STATE = "x y z vx vy vz omegax omegay omegaz fx fy fz tqx tqy tqz"
COLUMNS = f"id type mass radius q {STATE}"
FULL_KEYS = {
    "position": (N_ATOMS, 3),
    "velocity": (N_ATOMS, 3),
    "angular_velocity": (N_ATOMS, 3),
    "force": (N_ATOMS, 3),
    "torque": (N_ATOMS, 3),
    "id": (N_ATOMS,),
    "type": (N_ATOMS,),
    "mass": (N_ATOMS,),
    "radius": (N_ATOMS,),
    "q": (N_ATOMS,),
    "box": (3, 2),
}
BIN = Path(sys.executable).parent

DECK = f"""
units si
atom_style hybrid sphere charge
boundary s s s
comm_modify vel yes
region cloud block -1 1 -1 1 -1 1
create_box 2 cloud
create_atoms 1 random {N_ATOMS} 12345 cloud
set type 1 diameter 0.1
set type 1 density 7000
set group all charge 36.652
set atom 3*7 type 2
set type 2 diameter 0.2
set type 2 density 7000
velocity all create 1e24 4928459
set atom * omega 0.1 -0.2 0.3
pair_style zero 0.2
pair_coeff * *
fix integrate all nve/sphere
fix push all addforce 1.0 2.0 3.0
timestep {STEP}
variable n equal {EVERY}
compute speed all property/atom vx
dump text all custom $n {TEXT_TRAJECTORY} {COLUMNS}
dump_modify text sort id time yes units yes format float %.15g
dump binary all custom $n {BINARY_TRAJECTORY} {COLUMNS}
dump_modify binary sort id time yes units yes
dump unsorted all custom $n unsorted.bin id x y z
dump_modify unsorted time yes
dump noid all custom $n noid.bin x y z
dump_modify noid time yes
dump bare all custom $n bare.txt id x y z
dump_modify bare sort id format float %.15g
dump scaled all custom $n scaled.txt id element diameter xs ys zs
dump_modify scaled sort id time yes format float %.15g
dump unwrapped all custom $n unwrapped.bin id element xu yu zu c_speed
dump_modify unwrapped sort id time yes
shell mkdir run
dump moving all custom $n run/{BINARY_TRAJECTORY} id {STATE}
dump_modify moving sort id time yes units yes
run {EVERY * (N_FRAMES - 1)}
write_dump all custom run/{BINARY_CONSTANTS} id type mass radius q modify sort id
"""


def run_lammps(folder: Path, ranks: int = 1) -> Path:
    (folder / "in.lmp").write_text(DECK)
    command = [str(BIN / "lmp"), "-in", "in.lmp", "-screen", "none"]
    if ranks > 1:
        command = [str(BIN / "mpiexec"), "-n", str(ranks), *command]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stdout + done.stderr
    return folder


@pytest.fixture(scope="module")
def dumps(tmp_path_factory):
    return run_lammps(tmp_path_factory.mktemp("one_rank"))


@pytest.fixture(scope="module")
def parallel_dumps(tmp_path_factory):
    return run_lammps(tmp_path_factory.mktemp("two_ranks"), ranks=2)


@pytest.fixture(params=[TEXT_TRAJECTORY, BINARY_TRAJECTORY], ids=["text", "binary"])
def dump(request, dumps):
    return dumps / request.param


@contextmanager
def hidden_parser():
    """Let the reader find no compiled parser of numbers."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(text_columns, "LIBRARY_FILE", "absent.so")
        text_columns.compiled_parser.cache_clear()
        yield
    text_columns.compiled_parser.cache_clear()


@pytest.fixture(params=["compiled", "numpy"])
def parser(request):
    with hidden_parser() if request.param == "numpy" else nullcontext():
        yield request.param


def written(path: Path) -> list[np.ndarray]:
    """The atom lines of a text dump, read the plain way: one (N, columns) array a frame."""
    frames = []
    for part in path.read_text().split("ITEM: ATOMS")[1:]:
        lines = part.split("\n")[1 : N_ATOMS + 1]
        frames.append(np.array([[float(field) for field in line.split()] for line in lines]))
    return frames


def snapshot(universe) -> list[dict]:
    return [dict(ts.data) for ts in universe.trajectory]


def read_quietly(path: Path, **kwargs):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        universe = open_universe(path, **kwargs)
        return universe, snapshot(universe)


def test_text_holds_exactly_the_written_numbers(dumps, parser):
    universe = open_universe(dumps / TEXT_TRAJECTORY)
    for ts, table in zip(universe.trajectory, written(dumps / TEXT_TRAJECTORY), strict=True):
        assert np.array_equal(ts.data["position"], table[:, 5:8])
        assert np.array_equal(ts.data["velocity"], table[:, 8:11])
        assert np.array_equal(ts.data["angular_velocity"], table[:, 11:14])
        assert np.array_equal(ts.data["force"], table[:, 14:17])
        assert np.array_equal(ts.data["torque"], table[:, 17:20])
        assert np.array_equal(ts.positions, table[:, 5:8].astype(np.float32))
        assert np.array_equal(ts.velocities, table[:, 8:11].astype(np.float32))
        assert np.array_equal(ts.forces, table[:, 14:17].astype(np.float32))


def test_text_and_binary_agree(dumps):
    text, binary = (
        snapshot(open_universe(dumps / n)) for n in (TEXT_TRAJECTORY, BINARY_TRAJECTORY)
    )
    assert len(text) == len(binary) == N_FRAMES
    for a, b in zip(text, binary, strict=True):
        assert a.keys() == b.keys() == FULL_KEYS.keys() | {"time", "step", "dt"}
        for key in a:
            np.testing.assert_allclose(a[key], b[key], rtol=1e-14, atol=1e-300, err_msg=key)


def test_binary_is_exact(dumps):
    """Doubles survive to the last bit: free flight under a constant force, redone in doubles."""
    data = snapshot(open_universe(dumps / BINARY_TRAJECTORY))
    mass = data[0]["mass"][:, None]
    position, velocity = data[0]["position"].copy(), data[0]["velocity"].copy()
    half = 0.5 * STEP / mass * data[-1]["force"]
    for _ in range(EVERY):
        velocity += half
        position += STEP * velocity
        velocity += half
    np.testing.assert_allclose(data[1]["position"], position, rtol=1e-15, atol=1e-15)


def test_constants_are_read_from_the_file_beside_a_dump(dumps):
    whole, moving = (open_universe(dumps / name) for name in (BINARY_TRAJECTORY, "run"))
    for a, b in zip(snapshot(whole), snapshot(moving), strict=True):
        assert a.keys() == b.keys()
        assert all(np.array_equal(a[key], b[key]) for key in a)
    assert np.array_equal(whole.atoms.masses, moving.atoms.masses)
    assert list(whole.atoms.types) == list(moving.atoms.types)
    assert (dumps / "run" / BINARY_TRAJECTORY).stat().st_size < 0.85 * (
        dumps / BINARY_TRAJECTORY
    ).stat().st_size


def test_constants_of_some_of_the_atoms_and_of_others(dumps, tmp_path):
    shutil.copy(dumps / "run" / BINARY_TRAJECTORY, tmp_path)
    alone = open_universe(tmp_path).trajectory[1].data
    assert {"mass", "radius", "q", "type"}.isdisjoint(alone)
    shutil.copy(dumps / "run" / BINARY_CONSTANTS, tmp_path)
    part = tmp_path / "part.txt"
    part.write_text(small_text(["7 0 0 0", "2 0 0 0"], ["2 0 0 0", "7 0 0 0"]))
    whole = open_universe(dumps / BINARY_TRAJECTORY).trajectory[0].data
    for ts in open_universe(part).trajectory:
        assert ts.data["mass"].tolist() == whole["mass"][[1, 6]].tolist()
    part.write_text(small_text([f"{N_ATOMS + 1} 0 0 0", "2 0 0 0"]))
    with pytest.warns(UserWarning, match="does not know all atoms"):
        assert "mass" not in open_universe(part).trajectory[0].data


@pytest.mark.parametrize(("key", "shape"), FULL_KEYS.items())
def test_data_are_doubles_of_the_stated_shape(dump, key, shape):
    value = open_universe(dump).trajectory[1].data[key]
    assert value.shape == shape
    assert value.dtype == (np.int64 if key == "id" else np.float64)


def test_box_moves_and_positions_do_not(dump):
    data = snapshot(open_universe(dump))
    boxes = np.array([d["box"] for d in data])
    assert np.abs(np.diff(boxes[:, :, 0], axis=0)).max() > 1e-3
    for before, after in itertools.pairwise(data):
        moved = after["position"] - before["position"]
        flown = 0.5 * (before["velocity"] + after["velocity"]) * EVERY * STEP
        np.testing.assert_allclose(moved, flown, atol=1e-5)
        assert np.all(after["position"] >= after["box"][:, 0])
        assert np.all(after["position"] <= after["box"][:, 1])


def test_dimensions_are_the_box(dump):
    ts = open_universe(dump).trajectory[2]
    low, high = ts.data["box"].T
    np.testing.assert_allclose(ts.dimensions, [*(high - low), 90, 90, 90], rtol=1e-6)


def test_times_and_steps(dump):
    trajectory = open_universe(dump).trajectory
    np.testing.assert_allclose(
        [ts.time for ts in trajectory], np.arange(N_FRAMES) * EVERY * STEP, rtol=1e-12
    )
    assert [ts.data["step"] for ts in trajectory] == [EVERY * i for i in range(N_FRAMES)]
    assert trajectory.dt == pytest.approx(EVERY * STEP)
    assert trajectory.totaltime == pytest.approx(EVERY * STEP * (N_FRAMES - 1))


def test_dump_without_time_needs_the_timestep(dumps):
    with pytest.raises(TrajectoryError, match=r"has no time.*timestep=1e-4") as error:
        open_universe(dumps / "bare.txt")
    assert "\n" not in str(error.value)
    trajectory = open_universe(dumps / "bare.txt", timestep=STEP).trajectory
    np.testing.assert_allclose(
        [ts.time for ts in trajectory], np.arange(N_FRAMES) * EVERY * STEP, rtol=1e-12
    )


@pytest.mark.parametrize("timestep", [0.0, -1.0, float("nan"), float("inf")])
def test_timestep_must_be_a_positive_length(dump, timestep):
    with pytest.raises(TrajectoryError, match="timestep must be a positive number"):
        open_universe(dump, timestep=timestep)


def test_absent_columns_are_absent(dumps):
    universe = open_universe(dumps / "bare.txt", timestep=STEP)
    ts = universe.trajectory[0]
    assert set(ts.data) == {"position", "id", "box", "time", "step", "dt"}
    assert not ts.has_velocities
    assert not ts.has_forces
    for name in ("masses", "charges", "radii", "types"):
        assert not hasattr(universe.atoms, name)


def test_scaled_positions_are_unscaled(dumps):
    expected = snapshot(open_universe(dumps / BINARY_TRAJECTORY))
    for a, b in zip(snapshot(open_universe(dumps / "scaled.txt")), expected, strict=True):
        np.testing.assert_allclose(a["position"], b["position"], rtol=0, atol=1e-13)
        np.testing.assert_allclose(a["radius"], b["radius"], rtol=1e-14)
        assert "element" not in a


def test_unwrapped_positions_and_other_columns(dumps):
    expected = snapshot(open_universe(dumps / BINARY_TRAJECTORY))
    for a, b in zip(snapshot(open_universe(dumps / "unwrapped.bin")), expected, strict=True):
        assert np.array_equal(a["position"], b["position"])
        assert np.array_equal(a["c_speed"], b["velocity"][:, 0])
        assert "element" not in a


def test_chunks_of_two_ranks_are_sorted_by_id(parallel_dumps):
    raw = (parallel_dumps / "unsorted.bin").read_bytes()
    start = raw.index(b"id x y z") + len(b"id x y z")
    assert struct.unpack_from("<i", raw, start) == (2,), "two chunks were to be tested"
    expected = snapshot(open_universe(parallel_dumps / BINARY_TRAJECTORY))
    for a, b in zip(
        snapshot(open_universe(parallel_dumps / "unsorted.bin")), expected, strict=True
    ):
        assert np.array_equal(a["id"], np.arange(1, N_ATOMS + 1))
        assert np.array_equal(a["position"], b["position"])


def test_no_ids_are_an_error_from_several_ranks_and_a_warning_from_one(dumps, parallel_dumps):
    with pytest.raises(TrajectoryError, match="several MPI ranks without an id column"):
        open_universe(parallel_dumps / "noid.bin")
    with pytest.warns(UserWarning, match="no id column"):
        universe = open_universe(dumps / "noid.bin")
    unsorted = open_universe(dumps / "unsorted.bin").trajectory[0].data["position"]
    found = universe.trajectory[0].data["position"]
    assert set(map(tuple, found)) == set(map(tuple, unsorted))


def test_content_not_name_decides_the_format(dumps, tmp_path):
    shutil.copy(dumps / TEXT_TRAJECTORY, tmp_path / "text.bin")
    shutil.copy(dumps / BINARY_TRAJECTORY, tmp_path / "binary.txt")
    a, b = (open_universe(tmp_path / name) for name in ("text.bin", "binary.txt"))
    assert len(a.trajectory) == len(b.trajectory) == N_FRAMES


def test_topology(dump):
    universe = open_universe(dump)
    data = universe.trajectory[0].data
    atoms = universe.atoms
    assert np.array_equal(atoms.ids, np.arange(1, N_ATOMS + 1))
    assert list(atoms.types) == ["2" if 3 <= i <= 7 else "1" for i in atoms.ids]
    assert np.array_equal(atoms.masses, data["mass"])
    assert np.array_equal(atoms.radii, data["radius"])
    assert np.array_equal(atoms.charges, data["q"])
    assert atoms.masses[0] == pytest.approx(7000 * 4 / 3 * np.pi * 0.05**3)
    assert len(universe.residues) == len(universe.segments) == 1
    assert len(universe.select_atoms("type 2")) == 5


def test_universe_by_format_name(dump):
    universe = MDAnalysis.Universe(str(dump), format="BLASTDUMP", topology_format="BLASTDUMP")
    assert isinstance(universe.trajectory, BlastDumpReader)
    assert len(universe.trajectory) == N_FRAMES


def test_universe_by_suffix(dumps):
    assert len(MDAnalysis.Universe(str(dumps / BINARY_TRAJECTORY)).trajectory) == N_FRAMES


def test_opening_and_reading_warn_of_nothing(dump):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        universe = open_universe(dump)
        snapshot(universe)
        universe.copy()


def test_random_access_slices_and_repeated_iteration(dump):
    trajectory = open_universe(dump).trajectory
    steps = [ts.data["step"] for ts in trajectory]
    assert [ts.data["step"] for ts in trajectory] == steps
    assert [ts.data["step"] for ts in trajectory[::2]] == steps[::2]
    assert [ts.data["step"] for ts in trajectory[::-1]] == steps[::-1]
    assert [ts.data["step"] for ts in trajectory[[4, 1]]] == [steps[4], steps[1]]
    assert trajectory[-1].frame == N_FRAMES - 1
    assert trajectory[3].data["step"] == steps[3]
    assert trajectory.next().frame == 4
    with pytest.raises(IndexError):
        trajectory[N_FRAMES]


def test_frames_are_independent_arrays(dump):
    trajectory = open_universe(dump).trajectory
    first = trajectory[0].data["position"]
    kept = first.copy()
    trajectory[1].data["position"][:] = -1
    assert np.array_equal(first, kept)
    assert np.array_equal(trajectory[0].data["position"], kept)


@pytest.mark.parametrize("clone", [lambda u: pickle.loads(pickle.dumps(u)), lambda u: u.copy()])
def test_pickling_and_copying_keep_the_frame(dump, clone):
    universe = open_universe(dump)
    universe.trajectory[2]
    twin = clone(universe)
    assert twin.trajectory.frame == 2
    assert np.array_equal(
        twin.trajectory.ts.data["position"], universe.trajectory[2].data["position"]
    )
    assert twin.trajectory[4].time == pytest.approx(4 * EVERY * STEP)
    assert universe.trajectory.frame == 2
    assert twin.trajectory.dt == pytest.approx(EVERY * STEP)


def test_copy_keeps_the_timestep_argument(dumps):
    twin = open_universe(dumps / "bare.txt", timestep=STEP).copy()
    assert twin.trajectory[1].time == pytest.approx(EVERY * STEP)


def long_binary(dumps, steps) -> bytes:
    """A binary dump of the first frame and then the second over and over, at the given steps."""
    raw = (dumps / BINARY_TRAJECTORY).read_bytes()
    offsets = BlastDumpReader(dumps / BINARY_TRAJECTORY)._dump.offsets
    frames = [raw[: offsets[1]]]
    for step in steps:
        frame = bytearray(raw[offsets[1] : offsets[2]])
        struct.pack_into("<q", frame, raw.index(b"DUMPCUSTOM") + 18, step)
        frames.append(bytes(frame))
    return b"".join(frames)


def test_frames_of_equal_length_are_found_without_a_scan(dumps, tmp_path, monkeypatch):
    path = tmp_path / "long.bin"
    path.write_bytes(long_binary(dumps, range(10, 5010, 10)))
    looked_at = []
    header = _Binary.header.__func__

    def counted(cls, buffer, start):
        looked_at.append(start)
        return header(cls, buffer, start)

    monkeypatch.setattr(_Binary, "header", classmethod(counted))
    trajectory = open_universe(path).trajectory
    assert len(looked_at) < 12
    assert [trajectory[i].data["step"] for i in (0, 1, 77, 500)] == [0, 10, 770, 5000]
    assert len(trajectory) == 501


@pytest.mark.parametrize("damage", ["uneven steps", "a longer frame", "cut"])
def test_frames_that_only_look_equal_are_scanned(damage, dumps, tmp_path):
    steps = list(range(10, 310, 10))
    if damage == "uneven steps":
        steps[-1] += 10
    raw = long_binary(dumps, steps)
    if damage == "a longer frame":
        # Two chunks in place of one, the first of them empty: four bytes more.
        size = (len(raw) - len(long_binary(dumps, []))) // len(steps)
        start = len(raw) - 10 * size
        columns = raw.index(b"tqz", start) + 3
        raw = raw[:columns] + struct.pack("<ii", 2, 0) + raw[columns + 4 :]
    path = tmp_path / "dump"
    path.write_bytes(raw[:-1] if damage == "cut" else raw)
    _, frames = read_quietly(path)
    wanted = [0, *steps][: -1 if damage == "cut" else None]
    assert [frame["step"] for frame in frames] == wanted


def test_close_and_context_manager(dump):
    with BlastDumpReader(dump) as reader:
        assert reader.n_frames == N_FRAMES
    reader.close()
    assert reader[1].frame == 1, "reading opens the file again"
    assert BlastDumpReader.parse_n_atoms(dump) == N_ATOMS


class CentreOfMass(AnalysisBase):
    def __init__(self, atoms, **kwargs):
        super().__init__(atoms.universe.trajectory, **kwargs)
        self.atoms = atoms

    def _prepare(self):
        self.results.centre = []

    def _single_frame(self):
        mass = self._ts.data["mass"][:, None]
        self.results.centre.append((mass * self._ts.data["position"]).sum(axis=0) / mass.sum())


def test_analysis_base(dump):
    universe = open_universe(dump)
    run = CentreOfMass(universe.atoms).run(step=2)
    np.testing.assert_allclose(run.times, [0, 2 * EVERY * STEP, 4 * EVERY * STEP], atol=1e-15)
    universe.trajectory[0]
    np.testing.assert_allclose(run.results.centre[0], universe.atoms.center_of_mass(), rtol=1e-5)


def test_run_folder(dumps, tmp_path):
    with pytest.raises(TrajectoryError, match="holds neither"):
        open_universe(tmp_path)
    shutil.copy(dumps / BINARY_TRAJECTORY, tmp_path)
    assert len(open_universe(tmp_path).trajectory) == N_FRAMES
    shutil.copy(dumps / TEXT_TRAJECTORY, tmp_path)
    with pytest.raises(TrajectoryError, match="holds both"):
        open_universe(str(tmp_path))


def test_single_frame(dump, tmp_path):
    offsets = BlastDumpReader(dump)._dump.offsets
    path = tmp_path / "one"
    path.write_bytes(dump.read_bytes()[: offsets[1]])
    universe, frames = read_quietly(path)
    assert len(frames) == 1
    assert universe.trajectory.dt == universe.trajectory.totaltime == 0.0


def test_every_cut_of_the_last_frame_leaves_the_others(dump, tmp_path):
    raw = dump.read_bytes()
    start = BlastDumpReader(dump)._dump.offsets[-2]
    expected = snapshot(open_universe(dump))[:-1]
    path = tmp_path / "cut"
    for size in [*range(start + 1, start + 60), *range(start + 60, len(raw), 97), len(raw) - 1]:
        path.write_bytes(raw[:size])
        with pytest.warns(UserWarning, match="last frame was cut off.* 5 remain"):
            universe = open_universe(path)
        frames = snapshot(universe)
        assert len(frames) == N_FRAMES - 1
    for a, b in zip(frames, expected, strict=True):
        assert np.array_equal(a["position"], b["position"])


def test_nan_and_inf_are_read(dumps, tmp_path):
    path = tmp_path / "nan"
    for name, old, new in nan_patches(dumps):
        raw = (dumps / name).read_bytes()
        path.write_bytes(raw.replace(old, new, 1))
        data = open_universe(path).trajectory[1].data["position"]
        expected = open_universe(dumps / name).trajectory[1].data["position"]
        assert np.isnan(data[0, 0])
        assert np.isinf(data[0, 1])
        assert np.array_equal(data[1:], expected[1:])


def nan_patches(dumps):
    line = (dumps / TEXT_TRAJECTORY).read_bytes().split(b"ITEM: ATOMS")[2].split(b"\n")[1]
    fields = line.split()
    patched = b" ".join([*fields[:5], b"-nan", b"inf", *fields[7:]])
    yield TEXT_TRAJECTORY, line, patched
    xy = open_universe(dumps / BINARY_TRAJECTORY).trajectory[1].data["position"][0, :2]
    yield BINARY_TRAJECTORY, xy.tobytes(), struct.pack("<2d", np.nan, np.inf)


def small_text(*frames: list[str], columns="id x y z", n_atoms=None, box="ss ss ss") -> str:
    parts = []
    for step, lines in enumerate(frames):
        parts += ["ITEM: TIME", f"{step * 0.5}", "ITEM: TIMESTEP", f"{step}"]
        parts += ["ITEM: NUMBER OF ATOMS", f"{len(lines) if n_atoms is None else n_atoms}"]
        parts += [f"ITEM: BOX BOUNDS {box}", "0 1", "0 1", "0 1", f"ITEM: ATOMS {columns}", *lines]
    return "\n".join(parts) + "\n"


GOOD = ["2 0.5 0.5 0.5", "1 0.25 0.25 0.25"]
BAD_FILES = {
    "empty": ("", "is empty"),
    "not a dump": ("hello\n", "not a LAMMPS dump"),
    "picture": ("\x89PNG\r\n", "not a LAMMPS dump"),
    "only a mark": ("ITEM: TIMESTEP\n", "ends before its first frame"),
    "first frame cut": (small_text(GOOD, n_atoms=3), "ends before its first frame"),
    "no positions": (small_text(["1 2 3"], columns="id vx vy"), "no position columns"),
    "no atoms": (small_text([]), "0 atoms"),
    "negative count": (small_text(GOOD, n_atoms=-1), "-1 atoms"),
    "count not a number": (small_text(GOOD, n_atoms="two"), "a number of atoms expected"),
    "endless step": ("ITEM: TIMESTEP\n" + "9" * 400 + small_text(GOOD)[30:], "beyond what LAMMPS"),
    "header out of order": ("ITEM: NUMBER OF ATOMS\n2\n", "'ITEM: TIMESTEP' expected"),
    "atoms change": (small_text(GOOD, [*GOOD, "3 0 0 0"]), "frame 1: 3 atoms, but 2 in frame 0"),
    "triclinic": (small_text(GOOD, box="xy xz yz pp pp pp"), "triclinic"),
    "text column": (small_text(["1 0 0 A", "2 0 0 B"]), "atom line 1 is not all numbers"),
    "short line": (small_text(["1 0 0", "2 0 0 0"]), "atom line 1 has 3 values for 4 columns"),
    "id twice": (small_text(["1 0 0 0", "1 0 0 0"]), "id 1 occurs more than once"),
    "id not whole": (small_text(["1.5 0 0 0", "1 0 0 0"]), "not an integer"),
    "id is nan": (small_text(["nan 0 0 0", "1 0 0 0"]), "not an integer"),
}


@pytest.mark.parametrize("case", BAD_FILES)
def test_bad_files_are_one_line_errors(case, tmp_path, parser):
    text, message = BAD_FILES[case]
    path = tmp_path / "dump"
    path.write_text(text, encoding="latin-1")
    with pytest.raises(TrajectoryError, match=message) as error:
        open_universe(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)


def test_binary_without_columns_or_with_an_absurd_count(tmp_path):
    path = tmp_path / "dump"
    start = struct.pack("<q", -10) + b"DUMPCUSTOM" + struct.pack("<iiq", 1, 2, 0)
    box = struct.pack("<i6i6d", 0, *[2] * 6, *[0.0, 1.0] * 3)
    no_columns = struct.pack("<iibii", 0, 0, 0, 0, 0)
    path.write_bytes(start + struct.pack("<q", 5) + box + no_columns)
    with pytest.raises(TrajectoryError, match="no columns"):
        open_universe(path)
    columns = struct.pack("<iibi", 3, 0, 0, 5) + b"x y z" + struct.pack("<ii", 1, 2**31 - 2)
    path.write_bytes(start + struct.pack("<q", 2**62) + box + columns + bytes(100))
    with pytest.raises(TrajectoryError, match="ends before its first frame"):
        open_universe(path)


def test_missing_file_and_folder_given_to_the_reader(tmp_path):
    with pytest.raises(TrajectoryError, match="no such file or folder"):
        open_universe(tmp_path / "nowhere")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        BlastDumpReader(tmp_path)


def test_other_ids_in_a_later_frame_name_the_frame(tmp_path):
    path = tmp_path / "dump"
    path.write_text(small_text(GOOD, ["3 0 0 0", "1 0 0 0"]))
    trajectory = open_universe(path).trajectory
    with pytest.raises(TrajectoryError, match="frame 1: the ids of the atoms"):
        trajectory[1]


def test_file_cut_while_open(dumps, tmp_path):
    path = tmp_path / "dump"
    shutil.copy(dumps / TEXT_TRAJECTORY, path)
    trajectory = open_universe(path).trajectory
    os.truncate(path, 100)
    with pytest.raises(TrajectoryError, match="frame 3: the file has become shorter"):
        trajectory[3]


def test_text_is_sorted_by_id_and_other_units_are_named(tmp_path):
    path = tmp_path / "dump"
    path.write_text("ITEM: UNITS\nlj\n" + small_text(GOOD))
    with pytest.warns(UserWarning, match="units 'lj'"):
        universe = open_universe(path)
    assert list(universe.trajectory[0].data["position"][:, 0]) == [0.25, 0.5]


@pytest.mark.parametrize("ending", ["\n", " \n", "\r\n"], ids=["unix", "old lammps", "windows"])
def test_line_endings(ending, tmp_path, parser):
    path = tmp_path / "dump"
    path.write_bytes(small_text(GOOD, GOOD).replace("\n", ending).encode())
    assert len(snapshot(open_universe(path))) == 2


@pytest.mark.parametrize(
    "format_", ["%.15g", "%.17g", "%.12e", "%.17e"], ids=["15g", "17g", "12e", "17e"]
)
def test_text_numbers_round_correctly(format_, tmp_path, parser):
    rng = np.random.default_rng(7)
    values = rng.normal(size=(500, 3)) * 10.0 ** rng.integers(-290, 290, size=(500, 3))
    lines = [f"{i + 1} " + " ".join(format_ % v for v in row) for i, row in enumerate(values)]
    path = tmp_path / "dump"
    path.write_text(small_text(lines))
    expected = [[float(format_ % v) for v in row] for row in values]
    assert np.array_equal(open_universe(path).trajectory[0].data["position"], expected)


def damaged(raw: bytes, rng: random.Random) -> bytes:
    kind = rng.randrange(4)
    if kind == 0:
        return raw[: rng.randrange(len(raw))]
    out = bytearray(raw)
    if kind == 1:
        out[rng.randrange(len(out))] = rng.randrange(256)
    elif kind == 2:
        # headers are where damage hurts: hit the first few hundred bytes harder
        for _ in range(3):
            out[rng.randrange(400)] = rng.choice([0, 0x7F, 0x80, 0xFF, 32, 10, 57, 91])
    else:
        start = rng.randrange(len(out))
        del out[start : start + rng.randrange(1, 50)]
    return bytes(out)


@pytest.mark.parametrize("name", [TEXT_TRAJECTORY, BINARY_TRAJECTORY, "unsorted.bin", "scaled.txt"])
def test_damage_is_read_or_refused(name, dumps, tmp_path):
    raw = (dumps / name).read_bytes()
    rng = random.Random(name)
    path = tmp_path / "dump"
    refusals = []
    tracemalloc.start()
    for _ in range(300):
        path.write_bytes(damaged(raw, rng))
        try:
            _, frames = read_quietly(path, timestep=STEP)
        except TrajectoryError as error:
            refusals.append(str(error))
            continue
        assert 1 <= len(frames) <= N_FRAMES
        assert all(frame["position"].shape == (N_ATOMS, 3) for frame in frames)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert 30 < len(refusals) < 300
    assert not [message for message in refusals if "\n" in message]
    assert peak < 20e6


def outcome(path: Path):
    """The numbers of a dump bit for bit, or what the reader says against it."""
    try:
        _, frames = read_quietly(path, timestep=STEP)
    except TrajectoryError as error:
        return str(error)
    return [{key: np.asarray(value).tobytes() for key, value in f.items()} for f in frames]


@pytest.mark.parametrize("word", ["1e400", "1e-400", "nan(1)", "1_0", "+-1", "0x10", "1\r", "\x85"])
def test_unusual_numbers_do_not_depend_on_the_parser(word, tmp_path):
    path = tmp_path / "dump"
    path.write_bytes(small_text(GOOD, [f"1 {word} 0 0", "2 0 0 0"]).encode("latin-1"))
    found = outcome(path)
    with hidden_parser():
        assert outcome(path) == found


def test_damage_does_not_depend_on_the_parser(dumps, tmp_path):
    raw = (dumps / TEXT_TRAJECTORY).read_bytes()
    rng = random.Random(5)
    path = tmp_path / "dump"
    outcomes = []
    for _ in range(300):
        path.write_bytes(damaged(raw, rng))
        outcomes.append(outcome(path))
        with hidden_parser():
            assert outcome(path) == outcomes[-1]
    assert 30 < sum(isinstance(found, str) for found in outcomes) < 300


def test_numpy_is_not_asked_where_there_is_a_compiled_parser(dumps, monkeypatch):
    monkeypatch.delattr(np, "loadtxt")
    assert len(snapshot(open_universe(dumps / TEXT_TRAJECTORY))) == N_FRAMES


def test_memory_does_not_grow_with_frames(dump, tmp_path):
    raw = dump.read_bytes()
    offsets = BlastDumpReader(dump)._dump.offsets
    path = tmp_path / "long"
    path.write_bytes(raw + 300 * raw[offsets[1] :])
    tracemalloc.start()
    reader = BlastDumpReader(path)
    for _ in reader:
        pass
    gc.collect()  # also empties the interpreter's own free lists, which are no part of this
    kept = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert reader.n_frames == N_FRAMES + 300 * (N_FRAMES - 1)
    assert kept < 60_000
    assert path.stat().st_size > 10 * kept
