"""Sums over frames of the distances between each two markers, with and without those that are far, in NumPy.

`compiled_pair_sums` does the same in compiled loops; this is its meaning.
"""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats

FAR = 3.0
"""Standard deviations beyond which a distance is far from the others."""

FAR_PART = 0.05
"""Part of the distances that may be left out as far: a joint that moves for longer is a joint."""

CLIPPINGS = 3
"""Turns of leaving out what is far: wrong labels hide behind the deviation that they make themselves."""


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
    n_markers = positions.shape[1]
    sums, steady_sums = np.zeros((2, 3, n_markers, n_markers))
    places = np.ascontiguousarray(positions.transpose(2, 1, 0))
    shown = ~np.isnan(places[0])
    places[:, ~shown] = 0.0
    for marker in range(n_markers - 1):
        later = slice(marker + 1, None)
        both = shown[later] & shown[marker]
        distance = np.sqrt(((places[:, later] - places[:, marker : marker + 1]) ** 2).sum(axis=0))
        new = np.isnan(shift[marker, later]) & both.any(axis=1)
        first = distance[np.arange(len(both)), both.argmax(axis=1)]
        shift[marker, later] = np.where(new, first, shift[marker, later])
        distance = np.where(both, distance - shift[marker, later, np.newaxis], 0.0)
        sums[:, marker, later] = _moments(distance, both)
        steady_sums[:, marker, later] = _moments(distance, _without_far(distance, both))
    return sums, steady_sums


def _moments(values: Floats, used: Bools) -> Floats:
    """Number, sum and sum of squares of the used values of each row, shape (3, n_rows)."""
    weights = used.astype(np.float64)
    weighted = values * weights
    return np.stack([weights.sum(axis=1), weighted.sum(axis=1), np.einsum("mf,mf->m", weighted, values)])


def _without_far(values: Floats, used: Bools) -> Bools:
    """Leave out values that are far from the others of their row; where they are many, they are motion and stay."""
    kept = used
    for _ in range(CLIPPINGS):
        count, total, squares = _moments(values, kept)
        count = np.maximum(count, 1)
        mean = total / count
        limit = FAR**2 * np.maximum(squares / count - mean**2, 0.0)
        kept = used & ((values - mean[:, np.newaxis]) ** 2 <= limit[:, np.newaxis])
    few = kept.sum(axis=1) >= (1 - FAR_PART) * used.sum(axis=1)
    return np.where(few[:, np.newaxis], kept, used)
