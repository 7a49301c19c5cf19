"""What postures and proportions of people do to the distances of their markers.

They do alike to many pairs of markers, so that few ways to vary (principal components of simulated people, from
``tables/worn_sets.npz``) explain most of it; which posture a person takes is found by robust least squares.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from skelgen._kernels.distance_statistics import LARGEST, MOTION_WEIGHT, UNKNOWN, move_to_posture, ways_of_pairs
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames

MOST_PAIRS = 400
"""Of markers, by whose distances a posture is found: many times what is unknown of it."""

ROUNDS = 3
"""Of robust weights by which a posture is found."""

NEAR = 2.0
"""Standard deviations at which a distance counts half."""

INDEPENDENT = 0.1
"""Part of the distances that are independent, where it counts how well a posture is known: one misplaced marker is off
from all others."""

SIZE_SPREAD = 1e3
"""Standard deviation of the logarithm of the size: anything is as likely."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Distances of a set's markers in postures and proportions of people.

    Attributes
    ----------
    mean : ndarray, shape (2, n_markers, n_markers)
        Logarithms of the usual distances, of no unit, and of how much they vary.
    ways : ndarray, shape (n_markers, n_ways, 2, n_markers)
        By how much these differ where a posture is one standard deviation off in one way.
    spread : ndarray, shape (2, n_markers, n_markers)
        Standard deviations of what no posture explains.
    """

    mean: Floats
    ways: Floats
    spread: Floats

    def assumed(self, take: Floats, of_set: Ints) -> Assumed:
        """Return the usual distances and motions in the posture and size that suit some markers best.

        Parameters
        ----------
        take : ndarray, shape (2, n_matched, n_matched)
            Logarithms of distances and of how much they vary; NaN where unknown.
        of_set : ndarray of intp, shape (n_matched,)
            Markers of the set that they are taken for.
        """
        first, second = np.triu_indices(len(of_set), 1)
        known = np.flatnonzero(~np.isnan(take[0, first, second]))
        used = known[spread_frames(len(known), MOST_PAIRS)]
        first, second = first[used], second[used]
        pairs = np.stack([of_set[first], of_set[second]])
        spread = self.spread[:, pairs[0], pairs[1]] / np.sqrt([[1.0], [MOTION_WEIGHT]])
        away = take[:, first, second] - self.mean[:, pairs[0], pairs[1]]
        prior = np.diag([1.0] * self.ways.shape[1] + [SIZE_SPREAD**-2])
        ways = (ways_of_pairs(self.ways, pairs) / spread[..., np.newaxis]).reshape(-1, len(prior))
        off = (away / spread).ravel()
        posture, information = np.zeros(len(prior)), np.zeros_like(prior)
        posture[-1] = np.median(away[0]) if len(used) else 0.0
        for _ in range(ROUNDS):
            weighted = ways / (1.0 + ((off - ways @ posture) / NEAR) ** 2)[:, np.newaxis]
            information = weighted.T @ ways
            posture = np.asarray(np.linalg.solve(information + prior, off @ weighted), dtype=np.float64)
        return Assumed(posture, self, np.asarray(INDEPENDENT * information + prior))


@dataclass(frozen=True, eq=False)
class Assumed:
    """Distances of a set's markers in the posture that some of them show.

    Attributes
    ----------
    posture : ndarray, shape (n_ways + 1,)
        How far it is off in each way, and the logarithm of the size.
    of : Postures
        All postures.
    precision : ndarray, shape (n_ways + 1, n_ways + 1)
        Inverse covariance of the ways in which postures differ, and of the size: arms may be anywhere where only legs
        are known.
    """

    posture: Floats
    of: Postures
    precision: Floats

    @cached_property
    def _moved(self) -> tuple[Bools, Floats]:
        return np.zeros(len(self.of.ways), dtype=np.bool_), self.of.mean.copy()

    def mean(self, of_set: Ints) -> Floats:
        """Logarithms of the distances, and of how much they vary, shape (2, n_markers, n_markers).

        Parameters
        ----------
        of_set : ndarray of intp
            Markers whose rows are right, at least.
        """
        known, mean = self._moved
        move_to_posture(self.of.ways, self.posture, of_set, known, mean)
        return mean

    @cached_property
    def spread(self) -> Floats:
        """Standard deviations of both, with what is unknown of the posture, shape (2, n_markers, n_markers)."""
        covariance = np.linalg.inv(self.precision)[:-1, :-1]
        n_markers, n_ways = self.of.ways.shape[:2]
        ways = np.linalg.cholesky(covariance).T @ self.of.ways.reshape(n_markers, n_ways, -1)
        unknown = (ways**2).sum(axis=1).reshape(n_markers, 2, n_markers)
        return np.asarray(np.sqrt(self.of.spread**2 + unknown.swapaxes(0, 1)))

    @cached_property
    def widening(self) -> Floats:
        """Cost of each pair of markers for being less known, as of normal variables, shape (n_markers, n_markers)."""
        of_distances, of_motions = 2.0 * np.log(self.spread / self.of.spread)
        return np.asarray(np.nan_to_num(of_distances + MOTION_WEIGHT * of_motions))


def own_misfits(take: Floats, mean: Floats, spread: Floats, of_set: Ints) -> Floats:
    """Return the mean square of how far the distances of each matched marker are off, shape (n_matched,).

    Parameters
    ----------
    take : ndarray, shape (2, n_matched, n_matched)
        Logarithms of distances and of how much they vary; NaN where unknown.
    mean, spread : ndarray, shape (2, n_of_set, n_of_set)
        The same of the set, and their standard deviations.
    of_set : ndarray of intp, shape (n_matched,)
        What the markers are taken for.
    """
    mean, spread = (values[:, of_set][..., of_set] for values in (mean, spread))
    off = ((take - mean) / spread) ** 2
    squares = np.minimum(np.nan_to_num(off[0] + MOTION_WEIGHT * off[1], nan=UNKNOWN), LARGEST)
    np.fill_diagonal(squares, 0.0)
    return np.asarray(squares.sum(axis=1) / max(len(of_set) - 1, 1))
