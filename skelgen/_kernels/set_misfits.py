"""How far distances of markers are off those of a marker set that people wear, for each marker as each of the set."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel
from skelgen.model.arrays import Floats, Ints

LARGEST = 9.0
"""Square of the most that one distance may be off, in standard deviations; some markers belong to no set."""

UNKNOWN = 2.5
"""The same for markers that are never seen together."""

MOTION_WEIGHT = 0.5
"""How much the deviation of a distance counts beside the distance."""


def misfits_to_set(take: Floats, mean: Floats, spread: Floats, markers: Ints, of_set: Ints) -> Floats:
    """Return the mean square of how far distances are off if a marker is one of a set, shape (n_markers, n_of_set).

    Parameters
    ----------
    take : ndarray, shape (2, n_markers, n_markers)
        Logarithms of distances and of how much they vary; NaN where unknown.
    mean, spread : ndarray, shape (2, n_of_set, n_of_set)
        The same of the set, and their standard deviations.
    markers, of_set : ndarray of intp, shape (n_matched,)
        Markers to which distances are compared, and what they are taken for.
    """
    total = np.zeros((take.shape[1], mean.shape[1]))
    _add_squares(take, mean, spread, markers, of_set, total)
    return total / max(len(markers) - 1, 1)


@kernel
def _add_squares(take: Floats, mean: Floats, spread: Floats, markers: Ints, of_set: Ints, total: Floats) -> None:
    """Add how far the distances to each matched marker are off."""
    for pair in range(len(markers)):
        marker, place = markers[pair], of_set[pair]
        for other in range(len(total)):
            if other == marker:  # a marker says nothing of where it is itself
                continue
            away, varies, before = take[0, marker, other], take[1, marker, other], total[other, place]
            for one in range(total.shape[1]):
                off = (away - mean[0, place, one]) / spread[0, place, one]
                moves = (varies - mean[1, place, one]) / spread[1, place, one]
                square = off * off + MOTION_WEIGHT * moves * moves
                if math.isnan(square):
                    square = UNKNOWN
                total[other, one] += min(square, LARGEST)
            total[other, place] = before + LARGEST  # where another marker is it is not
