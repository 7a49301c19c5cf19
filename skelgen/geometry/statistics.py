"""Middle and spread that a few wild values do not spoil, and the distances they are taken of."""

from collections.abc import Iterator

import numpy as np

from skelgen.model.arrays import Floats, Ints

SORTED_AT_ONCE = 1_000_000
"""Distances that are sorted at once: 8 MB."""

MOST_PLACES = 4
"""Places up to which a part of the order costs less than all of it."""

SIGMA_OF_MEDIAN = 1.4826
"""Standard deviation of normal numbers with a median absolute deviation of 1."""


def median_of_known(values: Floats) -> Floats:
    """Return the median of each column without its NaN, shape (n_columns,): `numpy.nanmedian`, many times as fast.

    Parameters
    ----------
    values : ndarray, shape (n_rows, n_columns)
        NaN where unknown. Columns without any value give NaN.
    """
    ordered = np.array(values.T, order="C")
    count = values.shape[0] - np.isnan(ordered).sum(axis=1)
    lower, upper = np.maximum(count - 1, 0) // 2, np.minimum(count // 2, max(len(values) - 1, 0))
    places = np.unique([lower, upper])
    if len(values) and len(places) <= MOST_PLACES:
        ordered.partition(places, axis=1)
    else:
        ordered.sort(axis=1)
    columns = np.arange(len(ordered))
    return np.asarray((ordered[columns, lower] + ordered[columns, upper]) / 2)


def quantile_of(values: Floats, part: float) -> float:
    """Return what a part of some numbers does not exceed, as `numpy.quantile` does, many times as fast.

    Parameters
    ----------
    values : ndarray, shape (n,)
        At least one, none NaN.
    part : float
        Between 0 and 1.
    """
    place = part * (len(values) - 1)
    below = int(place)
    above = min(below + 1, len(values) - 1)
    ordered = np.partition(values, (below, above))
    low, high, way = float(ordered[below]), float(ordered[above]), place - below
    return low + (high - low) * way if way < 0.5 else high - (high - low) * (1 - way)


def lengths_of(vectors: Floats) -> Floats:
    """Return the lengths of vectors, shape (...): `numpy.linalg.norm` of the last axis, many times as fast.

    Parameters
    ----------
    vectors : ndarray, shape (..., 3)
        NaN gives NaN.
    """
    x, y, z = np.moveaxis(vectors, -1, 0)
    squares = np.asarray(x * x)
    squares += y * y
    squares += z * z
    return np.asarray(np.sqrt(squares))


def pair_lengths(positions: Floats, first: Ints, second: Ints) -> Floats:
    """Return the distances of pairs of markers [mm], shape (n_pairs, n_frames): a row per pair, for sorting.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    first, second : ndarray of intp, shape (n_pairs,)
        Indices of markers.

    Examples
    --------
    >>> pair_lengths(np.array([[[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]]), np.array([0]), np.array([1]))
    array([[5.]])
    """
    squares = np.zeros((len(first), len(positions)))
    for coordinate in np.ascontiguousarray(positions.transpose(2, 1, 0)):
        away = coordinate[first] - coordinate[second]
        squares += away * away
    return np.sqrt(squares, out=squares)


def sorted_pair_lengths(positions: Floats, first: Ints, second: Ints) -> Iterator[tuple[slice, Floats]]:
    """Sort the distances of pairs of markers over all frames, some pairs after the other.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    first, second : ndarray of intp, shape (n_pairs,)
        Indices of markers.

    Yields
    ------
    part : slice
        Which pairs.
    lengths : ndarray, shape (n_frames, n_part), mm
        Their distances, rising down each column; NaN last.
    """
    step = max(1, SORTED_AT_ONCE // max(1, len(positions)))
    for start in range(0, len(first), step):
        part = slice(start, start + step)
        yield part, np.ascontiguousarray(np.sort(pair_lengths(positions, first[part], second[part]), axis=1).T)
