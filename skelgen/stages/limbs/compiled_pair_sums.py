"""Compiled loops that sum distances between each two markers; `pair_sums` is the NumPy twin and says what they return.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats
from skelgen.stages.limbs.pair_sums import CLIPPINGS, FAR, FAR_PART

_Moments = tuple[float, float, float]


@compile_function
def pair_sums(positions: Floats, shift: Floats) -> tuple[Floats, Floats]:
    """Number, sum and sum of squares of all distances, above the diagonal, with and without those that are far."""
    n_frames, n_markers = positions.shape[:2]
    sums, steady_sums = np.zeros((3, n_markers, n_markers)), np.zeros((3, n_markers, n_markers))
    values = np.empty(n_frames)
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
                    sums[row, first, second], steady_sums[row, first, second] = plain[row], steady[row]
    return sums, steady_sums


@compile_function
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


@compile_function
def _steady_moments(values: Floats, plain: _Moments) -> _Moments:
    """Return the moments of what is not far from the others; those of all where much would be."""
    steady = plain
    for _ in range(CLIPPINGS):
        count = max(steady[0], 1.0)
        mean = steady[1] / count
        steady = _moments(values, mean, FAR**2 * max(steady[2] / count - mean**2, 0.0))
    return steady if steady[0] >= (1 - FAR_PART) * plain[0] else plain


@compile_function
def _moments(values: Floats, middle: float, limit: float) -> _Moments:
    """Number, sum and sum of squares of the values whose squared distance from a middle is within a limit."""
    count, total, squares = 0.0, 0.0, 0.0
    for value in values:
        used = 1.0 if (value - middle) ** 2 <= limit else 0.0
        count += used
        total += used * value
        squares += used * value * value
    return count, total, squares
