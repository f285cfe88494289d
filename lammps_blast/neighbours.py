"""Pairs of spheres that are close to each other, however unequal they are."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations_with_replacement

import numpy as np
from scipy.spatial import cKDTree

from lammps_blast.case import LARGEST_SIZE

# Spheres that are searched for neighbours at a time: it bounds the memory that pairs take.
BLOCK = 16384


def pair_blocks(
    position: np.ndarray, radius: np.ndarray, reach: float
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield all pairs of spheres nearer to each other than `reach` sums of their radii.

    Parameters
    ----------
    position : (N, 3) m
        Spheres that are nowhere, or where no distance can be squared, have no pairs.
    radius : (N,) m
        As unequal as you like; two spheres of radius zero are never a pair.
    reach
        Largest distance between centres, in sums of the two radii; 1 is touch.

    Yields
    ------
    pairs : (P, 2)
        Indices, the smaller one first; each pair once.
    closeness : (P,)
        Distance between the centres over the sum of the radii.
    """
    blocks = [
        (members, cKDTree(position[members]), radius[members].max())
        for members in _blocks(position, radius)
    ]
    for first, second in combinations_with_replacement(blocks, 2):
        (members, tree, largest), (others, other_tree, other_largest) = first, second
        found = tree.sparse_distance_matrix(
            other_tree, reach * (largest + other_largest), output_type="ndarray"
        )
        pairs = np.stack([members[found["i"]], others[found["j"]]], axis=1)
        touch = radius[pairs].sum(axis=1)
        chosen = (found["v"] <= reach * touch) & (touch > 0.0)
        if first is second:
            chosen &= pairs[:, 0] < pairs[:, 1]
        yield np.sort(pairs[chosen], axis=1), found["v"][chosen] / touch[chosen]


def _blocks(position: np.ndarray, radius: np.ndarray) -> Iterator[np.ndarray]:
    """Yield indices of spheres of like size (within a factor of two), slab by slab along x.

    Like sizes, because the largest sphere of a block decides how far its neighbours are sought.
    """
    somewhere = (np.abs(position) <= LARGEST_SIZE).all(axis=1) & (np.abs(radius) <= LARGEST_SIZE)
    known = np.flatnonzero(somewhere)
    octave = np.frexp(radius[known])[1]
    for size in np.unique(octave):
        members = known[octave == size]
        members = members[np.argsort(position[members, 0], kind="stable")]
        yield from np.array_split(members, -(-len(members) // BLOCK))


def close_pairs(
    position: np.ndarray, radius: np.ndarray, reach: float = 1.0
) -> tuple[np.ndarray, np.ndarray]:
    """Return at once what :func:`pair_blocks` yields, sorted: pairs (P, 2), closeness (P,)."""
    blocks = list(pair_blocks(position, radius, reach))
    if not blocks:
        return np.empty((0, 2), dtype=np.int64), np.empty(0)
    pairs, closeness = (np.concatenate(parts) for parts in zip(*blocks, strict=True))
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return pairs[order], closeness[order]
