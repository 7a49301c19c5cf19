"""What postures and proportions of people do to the distances of their markers.

They do alike to many pairs of markers, so that few ways to vary (principal components of simulated people, from
``tables/worn_sets.npz``) explain most of it; which posture a person takes is found by robust least squares.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen._kernels.distance_statistics import LARGEST, MOTION_WEIGHT, UNKNOWN
from skelgen.model.arrays import Floats, Ints, spread_frames

MOST_PAIRS = 400
"""Of markers, by whose distances a posture is found: many times what is unknown of it."""

ROUNDS = 3
"""Of robust weights by which a posture is found."""

NEAR = 2.0
"""Standard deviations at which a distance counts half."""

SIZE_SPREAD = 1e3
"""Standard deviation of the logarithm of the size: anything is as likely."""


@dataclass(frozen=True, eq=False)
class Postures:
    """Distances of a set's markers in postures and proportions of people.

    Attributes
    ----------
    mean : ndarray, shape (2, n_markers, n_markers)
        Logarithms of the usual distances, of no unit, and of how much they vary.
    ways : ndarray, shape (n_ways, 2, n_markers, n_markers)
        By how much these differ where a posture is one standard deviation off in one way.
    spread : ndarray, shape (2, n_markers, n_markers)
        Standard deviations of what no posture explains.
    """

    mean: Floats
    ways: Floats
    spread: Floats

    def assumed(self, take: Floats, of_set: Ints) -> Floats:
        """Return the usual distances and motions in the posture and size that suit some best, shape of `mean`.

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
        one, other = of_set[first], of_set[second]
        spread = (self.spread[:, one, other] / np.sqrt([[1.0], [MOTION_WEIGHT]])).ravel()
        off = (take[:, first, second] - self.mean[:, one, other]).ravel() / spread
        size = np.repeat([1.0, 0.0], len(one))
        ways = np.concatenate([self.ways[:, :, one, other].reshape(len(self.ways), -1), size[np.newaxis]]) / spread
        prior = np.diag([1.0] * len(self.ways) + [SIZE_SPREAD**-2])
        posture = np.zeros(len(ways))
        posture[-1] = np.median((off * spread)[: len(one)]) if len(one) else 0.0
        for _ in range(ROUNDS):
            weighted = ways / (1.0 + ((off - posture @ ways) / NEAR) ** 2)
            posture = np.asarray(np.linalg.solve(weighted @ ways.T + prior, weighted @ off), dtype=np.float64)
        found = self.mean + np.tensordot(posture[:-1], self.ways, 1)
        found[0] += posture[-1]
        return np.asarray(found)


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
