"""Distances between many pairs of markers at once."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats, Ints


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
