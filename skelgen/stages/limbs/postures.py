"""What postures and proportions of people do to the distances of their markers.

They do alike to many pairs of markers, so that few ways to vary (principal components of simulated people, from
``tables/worn_sets.npz``) explain most of it; which posture a person takes is found by robust least squares.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np

from skelgen._kernels.distance_statistics import MOTION_WEIGHT, move_to_posture, precision_of
from skelgen.model.arrays import Bools, Floats, Ints, Singles, spread_frames

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
    ways : ndarray, shape (n_pairs, 2, n_ways)
        By how much these differ where a posture is one standard deviation off in one way; pairs as above a diagonal.
    left : ndarray, shape (2, n_pairs)
        Standard deviations of what no posture explains.
    """

    mean: Singles
    ways: Singles
    left: Floats

    @cached_property
    def spread(self) -> Floats:
        """Standard deviations of what no posture explains, shape (2, n_markers, n_markers)."""
        return square_of_pairs(self.left)

    @cached_property
    def precision(self) -> Singles:
        """How much squares count of what no posture explains, shape (2, n_markers, n_markers)."""
        return precision_of(self.spread)

    @cached_property
    def ways_of_markers(self) -> Singles:
        """The ways, marker by marker, shape (n_markers, 2, n_ways, n_markers); anything on the diagonal."""
        numbers = numbers_of_pairs(len(self.mean[0]))
        of_pairs = np.ascontiguousarray(self.ways.reshape(len(self.ways), -1).T)
        found = np.empty((len(numbers), len(of_pairs), len(numbers)), dtype=np.float32)
        for marker, own in enumerate(numbers):
            np.take(of_pairs, own, axis=1, out=found[marker], mode="clip")
        return found.reshape(len(numbers), 2, -1, len(numbers))

    @cached_property
    def _weights(self) -> Singles:
        """Inverse standard deviations of what no posture explains, with the weight of motions, shape (n_pairs, 2)."""
        return np.asarray(np.sqrt(precision_of(self.left)).T)

    @cached_property
    def _weighted(self) -> Singles:
        """The ways, and that of a larger body, whose distances differ alike, weighted, (n_pairs, 2, n_ways + 1)."""
        size = np.broadcast_to(np.array([[1.0], [0.0]], dtype=np.float32), (len(self.ways), 2, 1))
        weighted = np.concatenate([self.ways, size], axis=2) * self._weights[..., np.newaxis]
        return np.ascontiguousarray(weighted)  # rows are taken often

    @cached_property
    def prior(self) -> Floats:
        """Inverse covariance of the ways, and of the size, shape (n_ways + 1, n_ways + 1)."""
        return np.diag([1.0] * self.ways.shape[2] + [SIZE_SPREAD**-2])

    def assumed(self, take: Singles, markers: Ints, of_set: Ints) -> Assumed:
        """Return the usual distances and motions in the posture and size that suit some markers best.

        Parameters
        ----------
        take : ndarray, shape (2, n_in_take, n_in_take)
            Logarithms of distances and of how much they vary; NaN where unknown.
        markers, of_set : ndarray of intp, shape (n_matched,)
            Markers of the take, and those of the set that they are taken for.
        """
        first, second = above_diagonal(len(of_set))
        seen = take[:, markers[first], markers[second]]
        known = np.flatnonzero(~np.isnan(seen[0]))
        used = known[_spread_pairs(len(known))]
        pairs = of_set[first[used]], of_set[second[used]]
        numbers = numbers_of_pairs(len(self.mean[0]))[pairs]
        away = seen[:, used] - self.mean[:, *pairs]
        off = (away.T * self._weights[numbers]).ravel()
        ways = self._weighted[numbers].reshape(-1, len(self.prior))
        posture, information = np.zeros(len(self.prior)), np.zeros(self.prior.shape, dtype=np.float32)
        posture[-1] = median_of_known(away[0])
        for _ in range(ROUNDS):
            roots = 1.0 / np.sqrt(1.0 + ((off - ways @ posture.astype(np.float32)) / NEAR) ** 2)
            counted = ways * roots[:, np.newaxis]
            information = counted.T @ counted
            posture = np.asarray(np.linalg.solve(information + self.prior, (off * roots) @ counted))
        return Assumed(posture, information, self)


@dataclass(frozen=True, eq=False)
class Assumed:
    """Distances of a set's markers in the posture that some of them show.

    Attributes
    ----------
    posture : ndarray, shape (n_ways + 1,)
        How far it is off in each way, and the logarithm of the size.
    information : ndarray of float32, shape (n_ways + 1, n_ways + 1)
        What all distances that tell it say of each way, and of the size, were they independent.
    of : Postures
        All postures.
    """

    posture: Floats
    information: Singles
    of: Postures

    @cached_property
    def _moved(self) -> tuple[Bools, Singles]:
        return np.zeros(len(self.of.mean[0]), dtype=np.bool_), self.of.mean.copy()

    def mean(self, of_set: Ints) -> Singles:
        """Logarithms of the distances, and of how much they vary, shape (2, n_markers, n_markers).

        Parameters
        ----------
        of_set : ndarray of intp
            Markers whose rows are right, at least.
        """
        known, mean = self._moved
        move_to_posture(self.of.ways_of_markers, self.posture, of_set, known, mean)
        return mean

    @cached_property
    def spread(self) -> Floats:
        """Standard deviations of both, with what is unknown of the posture, shape (2, n_markers, n_markers).

        Arms may be anywhere where only legs are known.
        """
        covariance = np.linalg.inv(INDEPENDENT * self.information + self.of.prior)[:-1, :-1]
        root = np.linalg.cholesky(covariance).T
        unknown = square_of_pairs(((self.of.ways @ root.T) ** 2).sum(axis=2).T)
        return np.sqrt(self.of.spread**2 + unknown)

    @cached_property
    def widening(self) -> Floats:
        """Cost of each pair of markers for being less known, as of normal variables, shape (n_markers, n_markers)."""
        of_distances, of_motions = 2.0 * np.log(self.spread / self.of.spread)
        return np.asarray(np.nan_to_num(of_distances + MOTION_WEIGHT * of_motions))


def square_of_pairs(values: Floats) -> Floats:
    """Return values of pairs as symmetric matrices, NaN on the diagonal, shape (..., n_markers, n_markers).

    Parameters
    ----------
    values : ndarray, shape (..., n_pairs)
        In the order of the rows above the diagonal.
    """
    n_markers = (1 + math.isqrt(1 + 8 * values.shape[-1])) // 2
    square = np.full((*values.shape[:-1], n_markers, n_markers), np.nan, values.dtype)
    first, second = above_diagonal(n_markers)
    square[..., first, second] = square[..., second, first] = values
    return square


@lru_cache(maxsize=256)
def _spread_pairs(n_pairs: int) -> Ints:
    """Return which of so many pairs of markers a posture is found by."""
    return spread_frames(n_pairs, MOST_PAIRS)


def median_of_known(values: Floats) -> float:
    """Return the median of what is not NaN, zero if nothing is; of few values sooner than NumPy does."""
    known = np.sort(values[~np.isnan(values)])
    return float(known[(len(known) - 1) // 2] + known[len(known) // 2]) / 2 if len(known) else 0.0


@lru_cache(maxsize=256)
def above_diagonal(n_markers: int) -> tuple[Ints, Ints]:
    """Return the first and the second marker of each pair, shapes (n_pairs,)."""
    return np.triu_indices(n_markers, 1)


@lru_cache(maxsize=64)
def numbers_of_pairs(n_markers: int) -> Ints:
    """Return the number of each pair, on the diagonal that of any pair, shape (n_markers, n_markers)."""
    numbers = np.zeros((n_markers, n_markers), dtype=np.intp)
    first, second = above_diagonal(n_markers)
    numbers[first, second] = numbers[second, first] = np.arange(len(first))
    return numbers
