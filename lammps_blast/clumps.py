"""Clumps: connected pieces of a cloud, how large they are, and how they lie to the field.

Particles that attract each other gather in clumps (figure 9 of the paper). Two spheres belong to
one piece when their surfaces touch or nearly touch; a clump is a piece of two spheres or more.

>>> from lammps_blast.clumps import Clumps
>>> from lammps_blast.trajectory import open_universe
>>> universe = open_universe("runs/clumping_blast")  # doctest: +SKIP
>>> clumps = Clumps(universe, axis=[1, 0, 0]).run().results  # doctest: +SKIP
>>> print(clumps.pieces[0], clumps.pieces[-1], clumps.sizes[:10])  # doctest: +SKIP
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from MDAnalysis import Universe
from MDAnalysis.analysis.base import AnalysisBase
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from lammps_blast.analysis import AnalysisError, Cloud
from lammps_blast.contacts import known_radii
from lammps_blast.neighbours import close_pairs, pair_blocks

# Largest gap between the surfaces of two spheres of one piece, in sums of their radii.
GAP = 0.02
# A clump of fewer spheres has no shape: three centres always lie in a plane.
SMALLEST_SHAPED = 4
# Sums of radii up to which pairs are counted, and the bins a sum of radii.
PAIR_REACH = 5.0
PAIR_BINS = 20

CLUMP_NUMBERS = (
    "pieces",
    "clumps",
    "largest",
    "largest_fraction",
    "mean_size",
    "mass_mean_size",
    "along_over_across",
)


def label_pieces(position: np.ndarray, radius: np.ndarray, gap: float = GAP) -> np.ndarray:
    """Return the number of the piece that each sphere belongs to; the largest piece is number 0.

    Of pieces of one size, that with the first sphere comes first.

    Parameters
    ----------
    position : (N, 3) m
    radius : (N,) m
    gap
        Two spheres are connected when the gap between their surfaces is at most so many sums of
        their radii (their mean diameter).

    Returns
    -------
    (N,) integers; -1 for a sphere without a finite position, which belongs to no piece.
    """
    count = len(position)
    pairs, _ = close_pairs(position, radius, 1.0 + gap)
    graph = coo_array((np.ones(len(pairs), dtype=np.int8), pairs.T), shape=(count, count))
    _, found = connected_components(graph, directed=False)
    labels = np.full(count, -1)
    finite = np.isfinite(position).all(axis=1)
    _, first, members, size = np.unique(
        found[finite], return_index=True, return_inverse=True, return_counts=True
    )
    rank = np.empty(len(size), dtype=np.int64)
    rank[np.lexsort((first, -size))] = np.arange(len(size))
    labels[finite] = rank[members]
    return labels


def piece_sizes(labels: np.ndarray) -> np.ndarray:
    """Return the number of spheres in each piece (P,), largest first, from labels (N,)."""
    return np.bincount(labels[labels >= 0])


@dataclass(frozen=True)
class ClumpShapes:
    """Shapes of C clumps from their gyration tensors, weighted by mass.

    The tensor is that of homogeneous spheres: with the share R^2/5 of each sphere about its own
    centre, so that no clump is infinitely thin.

    Attributes
    ----------
    size : (C,)
        Number of spheres.
    mass : (C,) kg
    radius_of_gyration : (C,) m
    along, across : (C,) m
        Gyration radius along the axis, and a direction across it: root of the tensor's component,
        and of the mean of the two components across.
    asphericity : (C,)
        From 0 for a ball to 1 for an infinitely thin line: 3/2 of the sum of squares of the
        eigenvalues' deviations from their mean, over the square of their sum.
    """

    size: np.ndarray
    mass: np.ndarray
    radius_of_gyration: np.ndarray
    along: np.ndarray
    across: np.ndarray
    asphericity: np.ndarray

    def __len__(self) -> int:
        """Return the number of clumps."""
        return len(self.size)

    @property
    def along_over_across(self) -> np.ndarray:
        """Ratio of the gyration radii along and across the axis (C,)."""
        return self.along / self.across

    @property
    def alignment(self) -> float:
        """The same ratio for all clumps together, their squares weighted by mass.

        One if the clumps prefer no direction, however long they are; NaN without clumps.
        """
        if len(self) == 0:
            return np.nan
        return float(np.sqrt(self.mass @ self.along**2 / (self.mass @ self.across**2)))


def clump_shapes(
    position: np.ndarray,
    radius: np.ndarray,
    mass: np.ndarray,
    labels: np.ndarray,
    axis: Sequence[float],
) -> ClumpShapes:
    """Return the shapes of all clumps of four spheres or more, largest first.

    Parameters
    ----------
    position : (N, 3) m
    radius : (N,) m
    mass : (N,) kg
    labels : (N,)
        As from :func:`label_pieces`.
    axis : (3,)
        Direction of B, any length.
    """
    sizes = piece_sizes(labels)
    count = int(np.count_nonzero(sizes >= SMALLEST_SHAPED))
    member = (labels >= 0) & (labels < count)  # the largest pieces come first
    label, position, radius, mass = labels[member], position[member], radius[member], mass[member]

    total = np.bincount(label, mass, count)
    share = mass / total[label]
    centre = np.zeros((count, 3))
    np.add.at(centre, label, share[:, None] * position)
    offset = position - centre[label]
    tensor = np.zeros((count, 3, 3))
    np.add.at(tensor, label, share[:, None, None] * offset[:, :, None] * offset[:, None, :])
    tensor += np.bincount(label, share * radius**2 / 5.0, count)[:, None, None] * np.eye(3)

    direction = np.asarray(axis, dtype=float)
    direction = direction / np.linalg.norm(direction)
    trace = np.trace(tensor, axis1=1, axis2=2)
    along = np.einsum("i,cij,j->c", direction, tensor, direction)
    deviation = tensor - trace[:, None, None] / 3.0 * np.eye(3)
    return ClumpShapes(
        size=sizes[:count],
        mass=total,
        radius_of_gyration=np.sqrt(trace),
        along=np.sqrt(along),
        across=np.sqrt(0.5 * (trace - along)),
        asphericity=1.5 * np.sum(deviation**2, axis=(1, 2)) / trace**2,
    )


class Clumps(AnalysisBase):
    """Number, sizes and shapes of the connected pieces of a cloud against time.

    Parameters
    ----------
    universe
        With radii.
    gap
        Two spheres are connected when the gap between their surfaces is at most so many sums of
        their radii (their mean diameter).
    axis
        Direction of B, shape (3,), any length.
    cloud
        The first frame, where it has been read already.

    Attributes
    ----------
    results.times : (T,) s
    results.pieces, results.clumps : (T,)
        Number of connected pieces, and of those of two spheres or more.
    results.largest, results.largest_fraction : (T,)
        Number of spheres in the largest piece, and their share of all spheres.
    results.mean_size : (T,)
        Mean number of spheres in a piece.
    results.mass_mean_size : (T,)
        Mean number of spheres in the piece that a unit of mass belongs to.
    results.along_over_across : (T,)
        :attr:`ClumpShapes.alignment`; NaN without clumps of four spheres or more.
    results.labels : (N,)
        Piece of each particle in the last frame, as from :func:`label_pieces`.
    results.sizes : (P,)
        Number of spheres of each piece in the last frame, largest first.
    results.shapes : ClumpShapes
        Of the clumps of four spheres or more in the last frame.

    Raises
    ------
    AnalysisError
        If the dump has no radii, the gap is negative or `axis` has no direction.
    """

    def __init__(
        self,
        universe: Universe,
        gap: float = GAP,
        axis: Sequence[float] = (1.0, 0.0, 0.0),
        cloud: Cloud | None = None,
    ) -> None:
        super().__init__(universe.trajectory)
        cloud = cloud or Cloud.of(universe)
        self.gap = gap
        self._axis = np.asarray(axis, dtype=float)
        self._radius, self._mass = known_radii(cloud), cloud.mass
        if not 0.0 <= gap < np.inf:
            raise AnalysisError(f"the gap between connected spheres must not be negative: {gap}")
        if self._axis.shape != (3,) or not 0.0 < np.linalg.norm(self._axis) < np.inf:
            raise AnalysisError(f"the axis of clumps must be a direction, not {axis}")

    def _prepare(self) -> None:
        for name in CLUMP_NUMBERS:
            self.results[name] = np.full(self.n_frames, np.nan)

    def _single_frame(self) -> None:
        frame, results, position = self._frame_index, self.results, self._ts.data["position"]
        labels = label_pieces(position, self._radius, self.gap)
        sizes = piece_sizes(labels)
        shapes = clump_shapes(position, self._radius, self._mass, labels, self._axis)
        results.labels, results.sizes, results.shapes = labels, sizes, shapes
        results.pieces[frame] = len(sizes)
        results.clumps[frame] = np.count_nonzero(sizes >= 2)
        results.along_over_across[frame] = shapes.alignment
        if len(sizes):
            results.largest[frame] = sizes[0]
            results.largest_fraction[frame] = sizes[0] / len(position)
            results.mean_size[frame] = sizes.mean()
            mass = np.bincount(labels[labels >= 0], self._mass[labels >= 0])
            results.mass_mean_size[frame] = sizes @ mass / mass.sum()

    def _conclude(self) -> None:
        self.results.times = self.times


class PairDistances(AnalysisBase):
    """How far particles are from each other, distances in sums of the two radii.

    The sum of two radii is the mean diameter of the pair, and a distance of one is touch. Counts
    are not divided by an ideal density, as those of a radial distribution function are: an
    expanding cloud has none.

    Parameters
    ----------
    universe
        With radii. Run it on a few frames: `PairDistances(universe).run(frames=[0, 50, 100])`.
    reach
        Largest distance that is counted.
    bins
        Number of shells a sum of radii.
    cloud
        The first frame, where it has been read already.

    Attributes
    ----------
    results.times : (T,) s
    results.edges : (K + 1,)
        Of the shells, from zero to `reach`.
    results.neighbours : (T, K)
        Mean number of neighbours a particle in each shell, over the volume of the shell: how many
        a volume of the cube of the mean diameter holds.
    results.nearest_gap : (T, N)
        Gap between a particle's surface and that of its nearest neighbour, negative where they
        overlap; infinite where there is no neighbour within `reach`.

    Raises
    ------
    AnalysisError
        If the dump has no radii, or there is nothing to count.
    """

    def __init__(
        self,
        universe: Universe,
        reach: float = PAIR_REACH,
        bins: int = PAIR_BINS,
        cloud: Cloud | None = None,
    ) -> None:
        super().__init__(universe.trajectory)
        self._radius = known_radii(cloud or Cloud.of(universe))
        shells = round(reach * bins) if 0.0 < reach < np.inf else 0
        if shells < 1:
            raise AnalysisError(f"no shells to count pairs in: reach {reach}, {bins} bins")
        self._edges = np.linspace(0.0, reach, shells + 1)

    def _prepare(self) -> None:
        self.results.edges = self._edges
        self.results.neighbours = np.zeros((self.n_frames, len(self._edges) - 1))
        self.results.nearest_gap = np.full((self.n_frames, len(self._radius)), np.inf)

    def _single_frame(self) -> None:
        count = np.zeros(len(self._edges) - 1)
        nearest = np.full(len(self._radius), np.inf)
        blocks = pair_blocks(self._ts.data["position"], self._radius, self._edges[-1])
        for pairs, closeness in blocks:
            count += np.histogram(closeness, self._edges)[0]
            np.minimum.at(nearest, pairs, closeness[:, None])
        # Each pair is a neighbour to both of its particles.
        volume = 4.0 / 3.0 * np.pi * np.diff(self._edges**3)
        self.results.neighbours[self._frame_index] = 2.0 * count / len(nearest) / volume
        self.results.nearest_gap[self._frame_index] = nearest - 1.0

    def _conclude(self) -> None:
        self.results.times = self.times
