"""Sums over frames of the distances between each two markers, with and without those that are far."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen.model.arrays import Floats

FAR = 3.0
"""Standard deviations beyond which a distance is far from the others."""

FAR_PART = 0.05
"""Part of the distances that may be left out as far: a joint that moves for longer is a joint."""

CLIPPINGS = 3
"""Turns of leaving out what is far: wrong labels hide behind the deviation that they make themselves."""


_Moments = tuple[float, float, float]


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


@kernel_part
def _fill_known_lengths(values: Floats, positions: Floats, first: int, second: int) -> int:
    """Put the distances in frames that show both one after the other, and return how many they are."""
    n_known = 0
    for frame in range(len(positions)):
        total = 0.0
        for axis in range(3):
            away = positions[frame, second, axis] - positions[frame, first, axis]
            total += away * away
        if not math.isnan(total):
            values[n_known] = math.sqrt(total)
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
