"""Pairs of particles that touch, one by one: gap, forces, bond and spin against time.

For runs of few particles, in which every pair has a history of its own to tell.

>>> from lammps_blast.analysis import Cloud
from lammps_blast.contacts import ContactFrames
>>> from lammps_blast.pair_histories import PairHistories
>>> from lammps_blast.trajectory import open_universe
>>> universe = open_universe("runs/bonded_pairs")  # doctest: +SKIP
>>> recorded = ContactFrames("runs/bonded_pairs/contacts.lammpsdump")  # doctest: +SKIP
>>> pairs = PairHistories(universe, recorded).run().results  # doctest: +SKIP
>>> print(pairs.ids.tolist(), pairs.gap[-1], pairs.bonded[-1])  # doctest: +SKIP
"""

from __future__ import annotations

import numpy as np
from MDAnalysis import Universe
from MDAnalysis.analysis.base import AnalysisBase

from lammps_blast.analysis import Cloud
from lammps_blast.contacts import ContactFrame, ContactFrames, known_radii
from lammps_blast.trajectory import TrajectoryError

# Of more particles there are too many pairs to look at one by one.
FEW_PARTICLES = 24


class PairHistories(AnalysisBase):
    """Gap, forces and spins against time of every pair that touches in any frame.

    Takes memory for all pairs of particles in all frames.

    Parameters
    ----------
    universe
        With radii.
    recorded
        Contacts that the run wrote. Without them, forces and bonds are unknown.

    Attributes
    ----------
    results.times : (T,) s
    results.pairs, results.ids : (P, 2)
        The pairs that touch, as indices and as ids of particles, in the order of the indices.
    results.gap : (T, P)
        Between the surfaces, over the sum of the radii; negative where they overlap (eq. 7.6).
    results.touching : (T, P)
        Whether the pair touches.
    results.normal_force, results.bond_force : (T, P) N, or None if they are unknown
        Elastic repulsion, and attraction of an active bond; zero without contact, NaN in a frame
        that the record lacks.
    results.bonded : (T, P) or None
        Whether the bond is active.
    results.spin : (T, P, 2) rad/s, or None if the dump has no angular velocities
        Magnitudes of the angular velocities of the two.
    results.impact_angle : (P,) rad
        Angle between the relative velocity and the line of centres at the first touch. The way
        from the last frame before it is taken as straight; NaN where it misses, where the pair
        touches from the first frame on, and without velocities.
    results.impact_speed : (P,) m/s
        Relative speed in that frame, NaN where the angle is.

    Raises
    ------
    AnalysisError
        If the dump has no radii.
    """

    def __init__(self, universe: Universe, recorded: ContactFrames | None = None) -> None:
        super().__init__(universe.trajectory)
        self.recorded = recorded
        self._radius = known_radii(Cloud.of(universe))

    def _prepare(self) -> None:
        first = self._trajectory[0].data
        count = len(self._radius)
        self._ids = first.get("id", np.arange(1, count + 1))
        self._all_pairs = np.stack(np.triu_indices(count, 1), axis=1)
        self._reach = self._radius[self._all_pairs].sum(axis=1)
        self._position = np.zeros((self.n_frames, count, 3))
        self._velocity = np.zeros((self.n_frames, count, 3)) if "velocity" in first else None
        self._spin = np.zeros((self.n_frames, count)) if "angular_velocity" in first else None
        self._gap = np.zeros((self.n_frames, len(self._all_pairs)))
        self._rows: list[ContactFrame | None] = []

    def _single_frame(self) -> None:
        frame, data = self._frame_index, self._ts.data
        first, second = data["position"][self._all_pairs.T]
        distance = np.linalg.norm(second - first, axis=1)
        self._gap[frame] = (distance - self._reach) / self._reach
        self._position[frame] = data["position"]
        if self._velocity is not None:
            self._velocity[frame] = data["velocity"]
        if self._spin is not None:
            self._spin[frame] = np.linalg.norm(data["angular_velocity"], axis=1)
        if self.recorded is not None:
            self._rows.append(self.recorded.at_step(int(data["step"])))

    def _conclude(self) -> None:
        results, touching = self.results, self._gap <= 0.0
        normal, bond = self._recorded_forces()
        touched = np.flatnonzero(touching.any(axis=0))
        results.times = self.times
        results.pairs = self._all_pairs[touched]
        results.ids = self._ids[results.pairs]
        results.gap, results.touching = self._gap[:, touched], touching[:, touched]
        results.normal_force = None if normal is None else normal[:, touched]
        results.bond_force = None if bond is None else bond[:, touched]
        results.bonded = None if bond is None else results.bond_force > 0.0
        results.spin = None if self._spin is None else self._spin[:, results.pairs]
        impacts = [self._impact(*pair) for pair in zip(touched, touching.T[touched], strict=True)]
        results.impact_angle, results.impact_speed = np.array(impacts).reshape(-1, 2).T

    def _recorded_forces(self) -> tuple[np.ndarray | None, np.ndarray | None]:
        """Return normal forces and bond forces (T, all pairs) in N; None where not recorded."""
        place = {pair: i for i, pair in enumerate(map(tuple, self._ids[self._all_pairs].tolist()))}
        normal, bond = np.full((2, *self._gap.shape), np.nan)
        for frame, rows in enumerate(self._rows):
            if rows is None:
                continue
            columns = [self._column(place, rows, pair) for pair in rows.ids.tolist()]
            for forces, column in ((normal, rows.normal_force), (bond, rows.bond_force)):
                if column is not None:
                    forces[frame] = 0.0
                    forces[frame, columns] = column
        return tuple(None if np.isnan(forces).all() else forces for forces in (normal, bond))

    def _column(
        self, place: dict[tuple[int, ...], int], rows: ContactFrame, pair: list[int]
    ) -> int:
        first, second = pair
        column = place.get((first, second), place.get((second, first)))
        if column is None:
            raise TrajectoryError(
                f"{self.recorded.path}: step {rows.step}: no two particles have the ids"
                f" {first} and {second}"
            )
        return column

    def _impact(self, pair: int, touching: np.ndarray) -> tuple[float, float]:
        """Return the angle (rad) and the relative speed (m/s) with which a pair first meets."""
        before = int(np.argmax(touching)) - 1
        if before < 0 or self._velocity is None:
            return np.nan, np.nan
        i, j = self._all_pairs[pair]
        offset = self._position[before, j] - self._position[before, i]
        approach = self._velocity[before, i] - self._velocity[before, j]
        speed = float(np.linalg.norm(approach))
        # How far the straight way passes the centre of j by, in sums of the radii.
        miss = np.linalg.norm(np.cross(offset, approach)) / (speed * self._reach[pair] or np.nan)
        if not (miss <= 1.0 and offset @ approach > 0.0):
            return np.nan, np.nan
        return float(np.arcsin(miss)), speed
