"""Distances between each two markers: their sums over frames, and how far they are off those of a marker set.

The sums are with and without the distances that are far. A marker set is one that people wear, and each marker is
compared as each of the set: in single precision, as what is learned of sets is good for three digits.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.small_matrices import dot, minus, vector
from skelgen.model.arrays import Bools, Floats, Ints, Singles

FAR = 3.0
"""Standard deviations beyond which a distance is far from the others."""

FAR_PART = 0.05
"""Part of the distances that may be left out as far: a joint that moves for longer is a joint."""

CLIPPINGS = 3
"""Turns of leaving out what is far: wrong labels hide behind the deviation that they make themselves."""


_Moments = tuple[float, float, float]


@kernel_part
def squared_distance(table: Floats, row: int, other: Floats, other_row: int) -> float:
    """Return the square of the distance of two points, each the first three numbers of a row of its table.

    Parameters
    ----------
    table, other : ndarray
        Numbers, row by row.
    row, other_row : int
        Rows of the points.
    """
    away = minus(vector(table, row, 0), vector(other, other_row, 0))
    return dot(away, away)


def pair_sums(positions: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Number, sum and sum of squares of all distances, above the diagonal.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    shift : ndarray, shape (n_markers, n_markers), mm
        What is subtracted from each distance, so that sums of squares stay exact; where it is NaN, the first distance
        is filled in.

    Returns
    -------
    plain, steady : ndarray, shape (3, n_markers, n_markers)
        Of all distances, and without those that are far from the others; in mm and mm^2.
    """
    n_frames, n_markers = positions.shape[:2]
    sums = np.zeros((2, 3, n_markers, n_markers))
    _write_sums(positions, shift, np.empty(n_frames), sums)
    return sums[0], sums[1]


@kernel
def _write_sums(positions: Floats, shift: Floats, values: Floats, sums: Floats) -> None:
    """Write what `pair_sums` returns; there is room for the `values` of a pair."""
    n_markers = len(shift)
    for first in range(n_markers - 1):
        for second in range(first + 1, n_markers):
            n_known = _fill_known_lengths(values, positions, first, second)
            if n_known > 0:
                if math.isnan(shift[first, second]):
                    shift[first, second] = values[0]
                for index in range(n_known):
                    values[index] -= shift[first, second]
                plain = _moments(values[:n_known], 0.0, math.inf)
                steady = _steady_moments(values[:n_known], plain)
                for row in range(3):
                    sums[0, row, first, second], sums[1, row, first, second] = plain[row], steady[row]


def sums_of_distances(n_markers: int, points: Floats, markers: Ints, starts: Ints, weights: Floats) -> Floats:
    """Weight, sum [mm] and sum of squares [mm^2] of the distances of markers that moments show, shape (3, n, n).

    On the diagonal stands the weight of each marker's own points.

    Parameters
    ----------
    n_markers : int
        Number of markers, or of tracklets.
    points : ndarray, shape (n_points, 3), mm
        Points of markers, moment after moment.
    markers : ndarray of intp, shape (n_points,)
        Marker of each.
    starts : ndarray of intp, shape (n_moments + 1,)
        Where the points of each moment begin.
    weights : ndarray, shape (n_moments,)
        How much each moment counts.
    """
    sums = np.zeros((3, n_markers, n_markers))
    _add_distances(points, markers, starts, weights, sums)
    own = sums[0].diagonal().copy()
    sums += sums.transpose(0, 2, 1).copy()
    np.fill_diagonal(sums[0], own)
    return sums


@kernel
def _add_distances(points: Floats, markers: Ints, starts: Ints, weights: Floats, sums: Floats) -> None:
    """Add what `sums_of_distances` returns, each pair on one side of the diagonal."""
    for moment in range(len(weights)):
        weight = weights[moment]
        for one in range(starts[moment], starts[moment + 1]):
            sums[0, markers[one], markers[one]] += weight
            for other in range(one + 1, starts[moment + 1]):
                distance = math.sqrt(squared_distance(points, one, points, other))
                sums[0, markers[one], markers[other]] += weight
                sums[1, markers[one], markers[other]] += weight * distance
                sums[2, markers[one], markers[other]] += weight * distance * distance


@kernel_part
def _fill_known_lengths(values: Floats, positions: Floats, first: int, second: int) -> int:
    """Put the distances in frames that show both one after the other, and return how many they are."""
    n_known = 0
    for frame in range(len(positions)):
        square = squared_distance(positions[frame], second, positions[frame], first)
        if not math.isnan(square):
            values[n_known] = math.sqrt(square)
            n_known += 1
    return n_known


@kernel_part
def _steady_moments(values: Floats, plain: _Moments) -> _Moments:
    """Return the moments of what is not far from the others; those of all where much would be."""
    steady = plain
    for _ in range(CLIPPINGS):
        count = max(steady[0], 1.0)
        mean = steady[1] / count
        steady = _moments(values, mean, FAR**2 * max(steady[2] / count - mean**2, 0.0))
    return steady if steady[0] >= (1 - FAR_PART) * plain[0] else plain


@kernel_part
def _moments(values: Floats, middle: float, limit: float) -> _Moments:
    """Number, sum and sum of squares of the values whose squared distance from a middle is within a limit."""
    count, total, squares = 0.0, 0.0, 0.0
    for value in values:
        used = 1.0 if (value - middle) ** 2 <= limit else 0.0
        count += used
        total += used * value
        squares += used * value * value
    return count, total, squares


LARGEST = 9.0
"""Square of the most that one distance may be off, in standard deviations; some markers belong to no set."""

UNKNOWN = 2.5
"""The same for markers that are never seen together."""

MOTION_WEIGHT = 0.5
"""How much the deviation of a distance counts beside the distance."""


def misfits_to_set(take: Singles, mean: Singles, precision: Singles, markers: Ints, of_set: Ints) -> Singles:
    """Return the mean square of how far distances are off if a marker is one of a set, shape (n_markers, n_of_set).

    Parameters
    ----------
    take : ndarray of float32, shape (2, n_markers, n_markers)
        Logarithms of distances and of how much they vary; NaN where unknown.
    mean, precision : ndarray of float32, shape (2, n_of_set, n_of_set)
        The same of the set, and how much their squares count, see `precision_of`.
    markers, of_set : ndarray of intp, shape (n_matched,)
        Markers to which distances are compared, and what they are taken for.
    """
    total = np.zeros((take.shape[1], mean.shape[1]), dtype=np.float32)
    _add_squares(take, mean, precision, markers, of_set, total)
    total /= max(len(markers) - 1, 1)
    return total


def own_misfits(take: Singles, mean: Singles, precision: Singles, markers: Ints, of_set: Ints) -> Floats:
    """Return the mean square of how far the distances of each matched marker to the others are off, shape (n_matched,).

    Parameters
    ----------
    take, mean, precision, markers, of_set
        As for `misfits_to_set`.
    """
    total = np.zeros(len(markers))
    _add_own_squares(take, mean, precision, markers, of_set, total)
    total /= max(len(markers) - 1, 1)
    return total


def precision_of(spread: Floats | Singles) -> Singles:
    """Return how much squares of what is off count: inverse variances, with the weight of motions.

    Parameters
    ----------
    spread : ndarray, shape (2, ...)
        Standard deviations of distances and of how much they vary.
    """
    precision = (spread**-2.0).astype(np.float32)
    precision[1] *= MOTION_WEIGHT
    return precision


@kernel
def _add_squares(take: Singles, mean: Singles, precision: Singles, markers: Ints, of_set: Ints, total: Singles) -> None:
    """Add how far the distances to each matched marker are off."""
    largest, unknown = np.float32(LARGEST), np.float32(UNKNOWN)
    for pair in range(len(markers)):
        marker, place = markers[pair], of_set[pair]
        for other in range(len(total)):
            if other == marker:  # a marker says nothing of where it is itself
                continue
            away, varies, before = take[0, marker, other], take[1, marker, other], total[other, place]
            if math.isnan(away):
                for one in range(total.shape[1]):
                    total[other, one] += unknown
            else:
                for one in range(total.shape[1]):
                    off, moves = away - mean[0, place, one], varies - mean[1, place, one]
                    square = off * off * precision[0, place, one] + moves * moves * precision[1, place, one]
                    total[other, one] += square if square < largest else largest
            total[other, place] = before + largest  # where another marker is it is not


@kernel
def _add_own_squares(
    take: Singles, mean: Singles, precision: Singles, markers: Ints, of_set: Ints, total: Floats
) -> None:
    """Add how far the distances of the matched markers are off."""
    for pair in range(len(markers)):
        marker, place = markers[pair], of_set[pair]
        for other in range(len(markers)):
            if other != pair:
                one, away = of_set[other], take[0, marker, markers[other]]
                off, moves = away - mean[0, place, one], take[1, marker, markers[other]] - mean[1, place, one]
                square = off * off * precision[0, place, one] + moves * moves * precision[1, place, one]
                total[pair] += UNKNOWN if math.isnan(square) else min(square, LARGEST)


@kernel
def move_to_posture(ways: Singles, posture: Floats, of_set: Ints, known: Bools, mean: Singles) -> None:
    """Move the usual distances of some markers of a set to all others to a posture, where that was not done before.

    Parameters
    ----------
    ways : ndarray of float32, shape (n_of_set, 2, n_ways, n_of_set)
        By how much distances of each marker and how much they vary differ in each way.
    posture : ndarray, shape (n_ways + 1,)
        How far the posture is off in each way, and the logarithm of the size.
    of_set : ndarray of intp, shape (n_matched,)
        Which markers.
    known : ndarray of bool, shape (n_of_set,)
        Where it was done; is set.
    mean : ndarray of float32, shape (2, n_of_set, n_of_set)
        Logarithms of the usual distances and of how much they vary; moved row by row.
    """
    n_ways = ways.shape[2]
    for place in of_set:
        if not known[place]:
            known[place] = True
            for other in range(len(known)):
                mean[0, place, other] += np.float32(posture[n_ways])
            for half in range(2):
                for way in range(n_ways):
                    size = np.float32(posture[way])
                    for other in range(len(known)):
                        mean[half, place, other] += size * ways[place, half, way, other]
