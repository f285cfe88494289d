"""The particles that a case starts from: packed at random in a sphere, or read from a CSV file."""

from __future__ import annotations

import csv
import difflib
import math
from array import array
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import NDArray
from scipy.constants import speed_of_light as SPEED_OF_LIGHT  # noqa: N812
from scipy.spatial import cKDTree

from lammps_blast import theory
from lammps_blast.case import (
    Case,
    CaseError,
    PackedParticles,
    is_of_sane_size,
    shown,
    shown_path,
)
from lammps_blast.input_files import lines_of_numbers, regular_files_only
from lammps_blast.resource_limits import BYTES_TO_PACK, memory_shortage, most_particles

FloatArray = NDArray[np.float64]

DENSEST_PACKING = math.pi / math.sqrt(18)
RSA_SATURATION = 0.38
# Up to this volume fraction random sequential addition places spheres with ease, so that spheres to
# be relaxed start from it.
EASY_FRACTION = 0.30
# Centres nearer than this part of the sum of radii have no line between them to speak of.
COINCIDENCE_TOLERANCE = 1e-12
# Spheres read from a file may overlap by this part of the sum of their radii: their coordinates
# were rounded when they were written.
TOUCHING_TOLERANCE = 1e-9

_RANDOM_CLOSE_PACKING, _LOSS_AT_WALL, _DENSEST_RELAXED = 0.64, 0.8, 0.60
_SLACK = 1 + 1e-9  # for volume fractions, whose radii a user has rounded
_ROUNDING = 8 * np.finfo(float).eps
_MOST_PROBLEMS = 20
_POSITION = ("x", "y", "z")
_VELOCITY = ("vx", "vy", "vz")
_ANGULAR_VELOCITY = ("wx", "wy", "wz")
_REQUIRED = (*_POSITION, "radius", "density", "charge_per_mass")
_SIGN = "sign"
_COLUMNS = (*_REQUIRED, *_VELOCITY, *_ANGULAR_VELOCITY, _SIGN)


class PackingError(CaseError):
    """The particles asked for do not fit into the domain."""


class ParticleFileError(CaseError):
    """A particle file that cannot be used as it stands."""


@dataclass(frozen=True, eq=False)
class Particles:
    """N spheres in SI units.

    Attributes
    ----------
    position : (N, 3) array, m
    velocity : (N, 3) array, m/s
    angular_velocity : (N, 3) array, rad/s
    radius : (N,) array, m
    density : (N,) array, kg/m3
    charge_per_mass : (N,) array, C/kg
    sign : (N,) array, 1 or -1
        Signs in the near field (c in section 7); all 1 if left out.
    """

    position: FloatArray
    velocity: FloatArray
    angular_velocity: FloatArray
    radius: FloatArray
    density: FloatArray
    charge_per_mass: FloatArray
    sign: FloatArray = None  # type: ignore[assignment]  # never None: see __post_init__

    def __post_init__(self) -> None:
        if self.sign is None:
            object.__setattr__(self, "sign", np.ones(len(self)))

    def __len__(self) -> int:
        return len(self.position)

    @property
    def mass(self) -> FloatArray:
        """Masses of the spheres, (N,) array in kg (section 3.1)."""
        return theory.sphere_mass(self.radius, self.density)

    @property
    def charge(self) -> FloatArray:
        """Charges of the spheres, (N,) array in C."""
        return self.charge_per_mass * self.mass


def create_particles(case: Case) -> Particles:
    """Return the particles of a case before the pulse.

    Raises
    ------
    PackingError
        If the particles do not fit into the domain.
    ParticleFileError
        If the particle file cannot be used.
    CaseError
        If there is not memory enough, a mass or a charge is out of the range of floating-point
        numbers, the near field has
        nothing to act on or attracts without bound, or the pulse would launch particles faster than
        light.
    """
    try:
        return _particles_of(case)
    except MemoryError:
        text = "particles: they need more memory than there is; take fewer, or a larger machine"
        raise CaseError(text) from None


def _particles_of(case: Case) -> Particles:
    section = case.particles
    if isinstance(section, PackedParticles):
        if shortage := memory_shortage(section.count, BYTES_TO_PACK):
            raise PackingError(f"particles.count: {shortage}")
        _check_magnitudes(section.radius, section.density, section.charge_per_mass)
        particles = _pack(section, np.random.default_rng(case.seed))
    else:
        file = case.folder / section.file
        particles = read_particles(file, section.allow_overlap, case.interacts)
        _check_magnitudes(particles.radius, particles.density, particles.charge_per_mass)
        _check_near_field(case, particles)
    _check_launch_speed(case, particles)
    return particles


def _check_launch_speed(case: Case, particles: Particles) -> None:
    """Refuse a pulse (eq. 3.4) beyond the speed of light: the model is not relativistic."""
    if case.blast is None:
        return
    speed = theory.pulse_speed(case.blast.energy, particles.mass.sum())
    if speed >= SPEED_OF_LIGHT:
        raise CaseError(
            f"blast.energy: {case.blast.energy:g} J would launch the particles at {speed:.3g} m/s, "
            "faster than light, and the model is not relativistic; check the units"
        )


def _check_near_field(case: Case, particles: Particles) -> None:
    """Refuse what the case alone cannot tell, because it depends on signs or charges."""
    near_field = case.near_field
    if near_field is None:
        return
    by_charge = near_field.scaling == "charge"
    sign = np.sign(particles.charge_per_mass) if by_charge else particles.sign
    if not sign.any():
        raise CaseError(
            "near_field.scaling: 'charge' needs charged particles, and charge_per_mass is 0 in "
            "every line of particles.file"
        )
    positive, negative = int(np.sum(sign > 0)), int(np.sum(sign < 0))
    problem = None if case.contact else near_field.divergence(positive, negative)
    if problem:
        key, text = problem
        raise CaseError(f"near_field.{'.'.join(key)}: {text}")


def _check_magnitudes(
    radius: FloatArray | float, density: FloatArray | float, charge_per_mass: FloatArray | float
) -> None:
    with np.errstate(all="ignore"):
        mass = np.asarray(density) * np.asarray(radius) ** 3
        charge = mass * np.asarray(charge_per_mass)
    if not (np.all(mass > 0) and np.all(np.isfinite(mass)) and np.all(np.isfinite(charge))):
        raise CaseError(
            "particles: the mass (density times radius cubed) or the charge of a particle is "
            "beyond the range of floating-point numbers; check the units"
        )


def _pack(section: PackedParticles, rng: np.random.Generator) -> Particles:
    count = section.count
    place = place_for_relaxation if section.packing.relax else pack_spheres
    position = place(count, section.radius, section.packing.domain_radius, rng)
    positive = rng.permutation(count) < section.positive_count
    return Particles(
        position=position,
        velocity=np.zeros((count, 3)),
        angular_velocity=np.zeros((count, 3)),
        radius=np.full(count, section.radius),
        density=np.full(count, section.density),
        charge_per_mass=np.where(positive, 1.0, -1.0) * section.charge_per_mass,
    )


def pack_spheres(
    count: int, radius: float, domain_radius: float, rng: np.random.Generator
) -> FloatArray:
    """Pack equal spheres into a spherical domain by random sequential addition (RSA).

    Spheres are added one after the other. Each is placed uniformly at random among all places
    where it lies wholly inside the domain and overlaps none of those before it, and never moves
    again. The order of the rows is the order of addition.

    Candidates are drawn in rounds and tested against a k-d tree of the accepted centres; those
    that conflict within a round are settled in the order of drawing. When many have been drawn,
    the region to draw from is narrowed to small cells that no single sphere blocks wholly. That
    discards only places that would be refused, so the result is as without it, and once no cell is
    left the packing is known to be saturated.

    Parameters
    ----------
    count
        Number of spheres.
    radius
        Radius of the spheres in m.
    domain_radius
        Radius in m of the domain, a sphere about the origin.
    rng
        Source of the random numbers; only uniform variates are drawn, so the same generator
        gives the same packing on every machine.

    Returns
    -------
    (count, 3) array
        Centres in m, no two nearer than 2 `radius`, none farther out than
        `domain_radius - radius`.

    Raises
    ------
    PackingError
        If the spheres do not fit.
    """
    asked = count * (radius / domain_radius) ** 3
    if radius > domain_radius or (count > 1 and asked > DENSEST_PACKING):
        raise PackingError(
            f"particles.count: {count} spheres of radius {radius:g} would fill {asked:.3g} of the "
            f"domain's volume, and no packing of equal spheres fills more than "
            f"{DENSEST_PACKING:.2f}; {_remedy(count, asked)}"
        )
    placed = _add_sequentially(count, _Room.of_domain(radius, domain_radius), rng)
    if len(placed) < count:
        reached = len(placed) * (radius / domain_radius) ** 3
        raise PackingError(
            f"particles.count: only {len(placed)} of {count} spheres of radius {radius:g} could be "
            f"placed, then no room was left for another (volume fraction {reached:.3f} reached, "
            f"{asked:.3f} asked); {_remedy(count, asked)}"
        )
    return placed


def place_for_relaxation(
    count: int, radius: float, domain_radius: float, rng: np.random.Generator
) -> FloatArray:
    """Place equal spheres for a relaxation to push apart; whole spheres lie inside the domain.

    Up to a volume fraction of :data:`EASY_FRACTION` they are placed as by :func:`pack_spheres`. In
    denser clouds the spheres are shrunk to that fraction while they are placed, so that at their
    full radius they overlap. Where few particles saturate earlier, they are shrunk further.

    Parameters
    ----------
    count, radius, domain_radius, rng
        As for :func:`pack_spheres`; `radius` is the full one.

    Returns
    -------
    (count, 3) array
        Centres in m, no two in one place, none farther out than `domain_radius - radius`.

    Raises
    ------
    PackingError
        If there are more spheres than :func:`densest_relaxed` says can be pushed apart.
    """
    if count == 1:
        return pack_spheres(count, radius, domain_radius, rng)
    asked = count * (radius / domain_radius) ** 3
    if not _can_be_relaxed(count, asked):
        raise PackingError(
            f"particles.count: {count} spheres of radius {radius:g} would fill {asked:.3g} of the "
            f"domain's volume, and relaxation reaches {densest_relaxed(count):.3g} at most (random "
            f"close packing is near {_RANDOM_CLOSE_PACKING:g}, and the wall costs some); use a "
            "smaller particles.radius or particles.count, or a larger "
            "particles.packing.domain_radius"
        )
    room = _Room.of_domain(radius, domain_radius)
    placed_radius = radius
    if asked > EASY_FRACTION * _SLACK:
        # Small spheres with these centres lie in a domain of radius `room.reach + placed_radius`.
        part = (EASY_FRACTION / count) ** (1 / 3)
        placed_radius = room.reach * part / (1 - part)
    while True:
        shrunk = replace(room, exclusion=2 * placed_radius * (1 + _ROUNDING))
        placed = _add_sequentially(count, shrunk, rng)
        if len(placed) == count:
            return placed
        placed_radius *= 0.9


def densest_relaxed(count: int) -> float:
    """Return the volume fraction beyond which spheres in a sphere cannot be pushed apart.

    Random close packing, less what the layer at the wall loses: a little less than damped
    relaxation was found to reach, from 0.25 with 2 spheres and 0.53 with 60 to 0.60 with 2000.
    """
    return min(_DENSEST_RELAXED, _RANDOM_CLOSE_PACKING * (1 - _LOSS_AT_WALL * count ** (-1 / 3)))


def _can_be_relaxed(count: int, asked: float) -> bool:
    return asked <= densest_relaxed(count) * _SLACK


def _add_sequentially(count: int, room: _Room, rng: np.random.Generator) -> FloatArray:
    """Return `count` centres in the order of addition, fewer if no more find a place.

    A candidate is accepted if it keeps away from all that were accepted before it, in earlier
    rounds and in its own, so that of the same stream of candidates one-at-a-time addition accepts
    the same ones. A stream is uniform over a room that holds all free places; the accepted
    candidate is then uniform over the free places, whatever the room, and however it was divided.
    """
    placed = np.empty((0, 3))
    drawn = 0
    while len(placed) < count and len(room.corners):
        draws = max(64, min(count, room.draws_per_round))
        candidates = room.draw(draws, rng)
        candidates = candidates[_apart_from(placed, candidates, room.exclusion)]
        candidates = candidates[_apart_in_order(candidates, room.exclusion)]
        placed = np.concatenate([placed, candidates])[:count]
        drawn += draws
        # Dividing costs about one draw per cell that it makes: by dividing when as much has been
        # spent on draws, no more than twice the least possible effort is ever spent.
        if drawn >= room.cells_when_divided and len(placed) < count:
            room, drawn = room.divided(placed), 0
    return placed


def _remedy(count: int, asked: float) -> str:
    relax = ", or particles.packing.relax: true" if _can_be_relaxed(count, asked) else ""
    return (
        "use a smaller particles.radius or particles.count, or a larger "
        f"particles.packing.domain_radius{relax} (random sequential packing saturates near a "
        f"volume fraction of {RSA_SATURATION:g}, in small domains earlier)"
    )


@dataclass(frozen=True)
class _Room:
    """Equal cubes that together hold every place where another centre may still be put.

    `corners` is the (M, 3) array of their lowest corners and `edge` their edge. A centre must lie
    within `reach` of the origin and at least `exclusion` away from every other centre.
    """

    corners: FloatArray
    edge: float
    reach: float
    exclusion: float

    _PARENTS_AT_ONCE = 2**15
    _MOST_DRAWS = 2**21

    @classmethod
    def of_domain(cls, radius: float, domain_radius: float) -> _Room:
        # The margins of a few ulp keep the promises true however a reader computes distances.
        reach = (domain_radius - radius) * (1 - _ROUNDING)
        return cls(np.full((1, 3), -reach), 2 * reach, reach, 2 * radius * (1 + _ROUNDING))

    @property
    def _parts(self) -> int:
        """Into how many parts the next division cuts an edge: at first down to the exclusion."""
        return max(2, math.ceil(self.edge / self.exclusion))

    @property
    def cells_when_divided(self) -> int:
        return len(self.corners) * self._parts**3

    @property
    def draws_per_round(self) -> int:
        """As many as fill the region about once, so that conflicts in a round stay few."""
        return min(self.cells_when_divided // 8, self._MOST_DRAWS)

    def draw(self, draws: int, rng: np.random.Generator) -> FloatArray:
        """Draw points uniformly from the cells, and return those within reach."""
        variates = rng.random((draws, 4))
        cell = (variates[:, 3] * len(self.corners)).astype(np.intp)
        points = self.corners[cell] + self.edge * variates[:, :3]
        return points[np.sqrt(np.sum(points**2, axis=1)) <= self.reach]

    def divided(self, placed: FloatArray) -> _Room:
        """Cut every cell into smaller ones and keep those that may hold another centre."""
        parts = self._parts
        edge = self.edge / parts
        # Cells this small have no room that survives rounding.
        if edge < 1e-9 * self.exclusion:
            return _Room(np.empty((0, 3)), edge, self.reach, self.exclusion)
        tree = cKDTree(placed)
        steps = np.arange(parts)
        offsets = edge * np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), -1)
        offsets = offsets.reshape(-1, 3)
        kept = []
        for start in range(0, len(self.corners), self._PARENTS_AT_ONCE):
            parents = self.corners[start : start + self._PARENTS_AT_ONCE]
            children = (parents[:, None] + offsets).reshape(-1, 3)
            kept.append(children[self._may_hold_a_centre(children, edge, tree)])
        return _Room(np.concatenate(kept), edge, self.reach, self.exclusion)

    def _may_hold_a_centre(self, corners: FloatArray, edge: float, tree: cKDTree) -> NDArray:
        """Tell which cells are neither wholly out of reach nor wholly blocked by one sphere."""
        middle = corners + edge / 2
        nearest_point = np.maximum(np.abs(middle) - edge / 2, 0)
        # Cells are kept when in doubt: rounding must not lose a place.
        slack = 1 + 1e-12
        possible = np.sum(nearest_point**2, axis=1) <= slack * self.reach**2
        inside = np.flatnonzero(possible)
        distance, sphere = tree.query(middle[inside], distance_upper_bound=self.exclusion)
        near = np.isfinite(distance)
        to_sphere = np.abs(middle[inside[near]] - tree.data[sphere[near]])
        farthest_corner = np.sum((to_sphere + edge / 2) ** 2, axis=1)
        possible[inside[near]] = slack * farthest_corner >= self.exclusion**2
        return possible


def _apart_from(placed: FloatArray, candidates: FloatArray, exclusion: float) -> NDArray[np.bool_]:
    """Tell which candidates keep the exclusion distance from all placed centres."""
    if not len(placed) or not len(candidates):
        return np.ones(len(candidates), dtype=bool)
    # Neighbours one after the other find their part of the tree in the processor's cache.
    order = _tree(candidates).indices
    distance, _ = _tree(placed).query(candidates[order], distance_upper_bound=exclusion)
    apart = np.empty(len(candidates), dtype=bool)
    apart[order] = np.isinf(distance)
    return apart


def _tree(points: FloatArray) -> cKDTree:
    """Return a k-d tree that is halved in space: for points this even, it is the quickest."""
    return cKDTree(points, balanced_tree=False, compact_nodes=False)


def _apart_in_order(candidates: FloatArray, exclusion: float) -> NDArray[np.bool_]:
    """Tell which candidates are accepted when they are tried against each other in order."""
    accepted = [True] * len(candidates)
    if len(candidates) < 2:
        return np.array(accepted, dtype=bool)
    pairs = cKDTree(candidates).query_pairs(exclusion, output_type="ndarray")
    # Sorted by the earlier of the two, whose own fate is then settled when its turn comes.
    for earlier, later in pairs[np.argsort(pairs[:, 0], kind="stable")].tolist():
        if accepted[earlier]:
            accepted[later] = False
    return np.array(accepted, dtype=bool)


def read_particles(path: Path, allow_overlap: bool = False, interacting: bool = False) -> Particles:
    """Read particles from a CSV file with a header line.

    Columns, in any order: `x,y,z` (m), `radius` (m), `density` (kg/m3), `charge_per_mass` (C/kg),
    and if wanted `vx,vy,vz` (m/s) and `wx,wy,wz` (rad/s), which are zero otherwise, and `sign`
    (1 or -1), which is 1 otherwise.

    Parameters
    ----------
    path
        The file.
    allow_overlap
        Accept spheres that overlap.
    interacting
        Refuse two particles at one place even so: forces between them have no direction.

    Raises
    ------
    ParticleFileError
        If the file cannot be read, a value is missing or out of range, or spheres overlap. It
        names the line and the column.
    """
    path = Path(path)
    try:
        with open(path, encoding="utf-8-sig", newline="", opener=regular_files_only) as stream:
            table = _read_table(stream)
    except UnicodeDecodeError:
        raise _file_error(path, "not a text file in UTF-8") from None
    except (OSError, ValueError) as error:
        if isinstance(error, CaseError):
            raise _file_error(path, *error.problems) from None
        reason = getattr(error, "strerror", None) or error
        raise _file_error(path, f"cannot be read: {reason}") from None
    particles = table.particles()
    coincident = coincident_pair(particles.position, particles.radius) if interacting else None
    if coincident:
        raise _file_error(path, _coincidence_problem(table.lines, coincident))
    overlap = None if allow_overlap else deepest_overlap(particles.position, particles.radius)
    if overlap:
        raise _file_error(path, _overlap_problem(particles, table.lines, overlap))
    return particles


def _file_error(path: Path, *problems: str) -> ParticleFileError:
    return ParticleFileError(
        *(f"particles.file: {shown_path(path)}: {problem}" for problem in problems)
    )


@dataclass(frozen=True)
class _Table:
    """The numbers of a particle file, (N, columns), and the line in the file of every row."""

    columns: Sequence[str]
    values: FloatArray
    lines: Sequence[int]

    def particles(self) -> Particles:
        return Particles(
            position=self._vectors(_POSITION),
            velocity=self._vectors(_VELOCITY),
            angular_velocity=self._vectors(_ANGULAR_VELOCITY),
            radius=self._column("radius"),
            density=self._column("density"),
            charge_per_mass=self._column("charge_per_mass"),
            sign=self._column(_SIGN, default=1.0),
        )

    def _column(self, name: str, default: float = 0.0) -> FloatArray:
        if name not in self.columns:
            return np.full(len(self.values), default)
        return np.ascontiguousarray(self.values[:, self.columns.index(name)])

    def _vectors(self, names: Sequence[str]) -> FloatArray:
        return np.stack([self._column(name) for name in names], axis=1)


def _read_table(stream: TextIO) -> _Table:
    """Read header and rows; raise CaseError with the problems found."""
    reader = csv.reader(lines_of_numbers(stream), strict=True)
    most = most_particles(BYTES_TO_PACK)
    try:
        header = [name.strip() for name in next(reader, [])]
        problems = list(_header_problems(header))
        if problems:
            raise CaseError(*problems)
        values, lines = array("d"), array("q")
        for fields in reader:
            if not fields:
                continue
            row = _numbers(fields)
            if len(row) == len(header) and _is_in_range(row, header):
                values.extend(row)
                lines.append(reader.line_num)
                if len(lines) > most and (shortage := memory_shortage(len(lines), BYTES_TO_PACK)):
                    raise CaseError(shortage)
            else:
                problems += (
                    f"line {reader.line_num}: {text}" for text in _row_problems(fields, header)
                )
            if len(problems) >= _MOST_PROBLEMS:
                problems.append("further lines were not checked")
                break
    except csv.Error as error:
        raise CaseError(f"line {reader.line_num}: not CSV: {error}") from None
    if problems:
        raise CaseError(*problems)
    if not lines:
        raise CaseError("no particles below the header")
    return _Table(header, np.frombuffer(values).reshape(len(lines), len(header)), lines)


def _header_problems(header: Sequence[str]) -> Iterator[str]:
    if not header:
        yield f"line 1: must be a header such as {','.join(_REQUIRED)}"
        return
    for name in dict.fromkeys(header):
        if name not in _COLUMNS:
            nearest = difflib.get_close_matches(name, _COLUMNS, n=1)
            hint = f"did you mean '{nearest[0]}'?" if nearest else f"known: {', '.join(_COLUMNS)}"
            yield f"line 1: column {shown(name)}: unknown column, {hint}"
        elif header.count(name) > 1:
            yield f"line 1: column '{name}': given {header.count(name)} times"
    for name in _REQUIRED:
        if name not in header:
            yield f"line 1: column '{name}': missing"
    for group in (_VELOCITY, _ANGULAR_VELOCITY):
        missing = [name for name in group if name not in header]
        if 0 < len(missing) < len(group):
            yield (f"line 1: column '{missing[0]}': missing; give all of {','.join(group)} or none")


def _numbers(fields: Sequence[str]) -> list[float]:
    """Return the numbers of a row, none at all if one of them is not a number."""
    try:
        return [_number(field) for field in fields]
    except ValueError:
        return []


def _number(field: str) -> float:
    if "_" in field:  # float() takes 1_000 for a number
        raise ValueError
    return float(field)


def _is_in_range(row: Sequence[float], header: Sequence[str]) -> bool:
    return all(
        math.isfinite(value)
        and is_of_sane_size(value)
        and (value > 0 or name not in {"radius", "density"})
        and (abs(value) == 1 or name != _SIGN)
        for name, value in zip(header, row, strict=True)
    )


def _row_problems(fields: Sequence[str], header: Sequence[str]) -> Iterator[str]:
    if len(fields) != len(header):
        yield f"must have {len(header)} fields as the header has, got {len(fields)}"
        return
    for name, field in zip(header, fields, strict=True):
        numbers = _numbers([field])
        if not numbers:
            yield f"column '{name}': must be a number, got {shown(field)}"
        elif not math.isfinite(numbers[0]):
            yield f"column '{name}': must be a finite number, got {shown(field)}"
        elif not is_of_sane_size(numbers[0]):
            yield f"column '{name}': is beyond any size in SI units, got {shown(field)}"
        elif name == _SIGN and abs(numbers[0]) != 1:
            yield f"column '{name}': must be 1 or -1, got {shown(field)}"
        elif not _is_in_range(numbers, [name]):
            yield f"column '{name}': must be greater than 0, got {shown(field)}"


def _overlap_problem(particles: Particles, lines: Sequence[int], pair: tuple[int, int]) -> str:
    first, second = sorted(pair)
    distance = math.dist(particles.position[first], particles.position[second])
    reach = particles.radius[first] + particles.radius[second]
    return (
        f"lines {lines[first]} and {lines[second]}: the spheres overlap (the deepest overlap in "
        f"the file): distance {distance:g} m, sum of radii {reach:g} m; move them apart or set "
        "particles.allow_overlap: true"
    )


def _coincidence_problem(lines: Sequence[int], pair: tuple[int, int]) -> str:
    first, second = sorted(pair)
    return (
        f"lines {lines[first]} and {lines[second]}: the particles are at one place, so that the "
        "force between them has no direction; move them apart"
    )


def coincident_pair(position: FloatArray, radius: FloatArray) -> tuple[int, int] | None:
    """Return two spheres whose centres are at one place, None if there are no such two.

    Centres nearer to each other than :data:`COINCIDENCE_TOLERANCE` of the sum of the radii count as
    at one place. Of each sphere only the nearest other one is looked at.

    Parameters
    ----------
    position : (N, 3) array, m
    radius : (N,) array, m
    """
    if len(position) < 2:
        return None
    # Sorting finds exact copies; k-d trees are slow on points in one place.
    order = np.lexsort(position.T)
    same = np.flatnonzero(np.all(position[order[1:]] == position[order[:-1]], axis=1))
    if len(same):
        return int(order[same[0]]), int(order[same[0] + 1])
    distance, nearest = cKDTree(position).query(position, k=2)
    reach = radius + radius[nearest[:, 1]]
    (near,) = np.nonzero(distance[:, 1] < COINCIDENCE_TOLERANCE * reach)
    return (int(near[0]), int(nearest[near[0], 1])) if len(near) else None


def overlap_depth(particles: Particles) -> float:
    """Return by what length the two spheres that overlap most do so, m; zero if none overlap."""
    pair = deepest_overlap(particles.position, particles.radius)
    if pair is None:
        return 0.0
    first, second = pair
    distance = math.dist(particles.position[first], particles.position[second])
    return float(particles.radius[first] + particles.radius[second] - distance)


def deepest_overlap(position: FloatArray, radius: FloatArray) -> tuple[int, int] | None:
    """Return the two spheres that overlap by the greatest length, None if no two overlap.

    Spheres that touch, to within :data:`TOUCHING_TOLERANCE` of the sum of their radii, do not
    overlap.

    Parameters
    ----------
    position : (N, 3) array, m
    radius : (N,) array, m
    """
    relevant = _two_largest_of_each_place(position, radius)
    search = _OverlapSearch(position[relevant], radius[relevant] * (1 - TOUCHING_TOLERANCE))
    pair = search.deepest()
    return None if pair is None else (int(relevant[pair[0]]), int(relevant[pair[1]]))


def _two_largest_of_each_place(position: FloatArray, radius: FloatArray) -> NDArray[np.intp]:
    """Return the spheres left when only the two largest of those with one centre are kept.

    The others cannot overlap anything more deeply, and k-d trees are slow on points in one place.
    """
    order = np.lexsort((-radius, *position.T))
    third = np.all(position[order[2:]] == position[order[:-2]], axis=1)
    return np.concatenate([order[:2], order[2:][~third]])


class _OverlapSearch:
    """Search for the deepest overlap among spheres of any sizes.

    Spheres are sorted into classes by size, within which radii differ by less than a factor of
    two, and every sphere is tested against the classes not above its own. So a huge sphere among
    many small ones does not widen the search around the small ones.
    """

    _SPHERES_AT_ONCE = 64

    def __init__(self, position: FloatArray, radius: FloatArray) -> None:
        self.position = position
        self.radius = radius
        self.depth = 0.0
        self.pair: tuple[int, int] | None = None

    def deepest(self) -> tuple[int, int] | None:
        size_class = np.frexp(self.radius)[1]
        searches = []
        for size in np.unique(size_class):
            small = np.flatnonzero(size_class == size)
            large = np.flatnonzero(size_class >= size)
            tree = cKDTree(self.position[small])
            searches.append((tree, small, large, self._meet_nearest(tree, small, large)))
        # The depth known by now bounds the search: spheres at one place would otherwise make
        # every pair a hit.
        for tree, small, large, nearest in searches:
            self._meet_all_deeper(tree, small, large, nearest)
        return self.pair

    def _meet_nearest(self, tree: cKDTree, small: NDArray, large: NDArray) -> FloatArray:
        """Test each large sphere against its nearest small one; return the distances."""
        distance, neighbour = tree.query(self.position[large], k=2)
        known = np.isfinite(distance)
        other = small[np.where(known, neighbour, 0)]
        distance = np.where(known & (other != large[:, None]), distance, np.inf)
        nearest = np.argmin(distance, axis=1)
        row = np.arange(len(large))
        self._meet(large, other[row, nearest], distance[row, nearest])
        return distance[row, nearest]

    def _meet_all_deeper(
        self, tree: cKDTree, small: NDArray, large: NDArray, nearest: FloatArray
    ) -> None:
        """Test the large spheres against all small ones that may overlap them more deeply."""
        largest = self.radius[small].max()
        candidates = np.flatnonzero(nearest < self.radius[large] + largest - self.depth)
        # The largest first: what they find spares the others most of the search.
        candidates = candidates[np.argsort(-self.radius[large[candidates]], kind="stable")]
        for start in range(0, len(candidates), self._SPHERES_AT_ONCE):
            some = candidates[start : start + self._SPHERES_AT_ONCE]
            reach = self.radius[large[some]] + largest - self.depth
            hopeful = nearest[some] < reach
            if not hopeful.any():
                continue
            chosen, reach = large[some[hopeful]], reach[hopeful]
            found = tree.query_ball_point(self.position[chosen], reach)
            sphere = np.repeat(chosen, [len(indices) for indices in found])
            other = small[np.concatenate([np.asarray(indices, int) for indices in found])]
            distance = np.linalg.norm(self.position[sphere] - self.position[other], axis=1)
            self._meet(sphere, other, np.where(sphere == other, np.inf, distance))

    def _meet(self, sphere: NDArray, other: NDArray, distance: FloatArray) -> None:
        if not len(sphere):
            return
        depth = self.radius[sphere] + self.radius[other] - distance
        deepest = int(np.argmax(depth))
        if depth[deepest] > self.depth:
            self.depth = float(depth[deepest])
            self.pair = int(sphere[deepest]), int(other[deepest])
