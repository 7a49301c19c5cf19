"""How far points are to be believed, by what the file says of them."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.model import PointCloud
from skelgen.model.arrays import Floats

LEAST_WEIGHT = 0.01
"""A point that the file calls as bad as can be still has a place, with ten times the usual deviation."""


def point_weights(cloud: PointCloud) -> Floats:
    """Return the weight of each point: the usual variance of a point's position over that of this one.

    A position's deviation is taken as proportional to its reprojection error, where that is larger than the take's
    points usually have, and its variance as inverse to the number of blobs, where there are fewer than usual.

    Parameters
    ----------
    cloud : PointCloud
        The take; its attributes ``reprojection_error`` and ``n_blobs`` are looked at.

    Returns
    -------
    ndarray, shape (n_points,)
        Between `LEAST_WEIGHT` and 1; all 1 where the file says nothing, or the same of all points. Read-only.
    """
    error, n_blobs = cloud.attributes.get("reprojection_error"), cloud.attributes.get("n_blobs")
    if cloud.n_points == 0 or (error is None and n_blobs is None):
        return np.broadcast_to(np.float64(1.0), cloud.n_points)  # a long take is not filled with ones
    weights = np.ones(cloud.n_points)
    if error is not None:
        weights *= _by_error(np.abs(error))
    if n_blobs is not None:
        weights *= _by_blobs(n_blobs)
    return np.asarray(np.clip(weights, LEAST_WEIGHT, 1.0))


def _by_error(error: Floats) -> Floats:
    """Squared ratio of the largest usual error, a robust deviation above the median, to each."""
    middle = float(np.nanmedian(error))
    usual = middle + SIGMA_OF_MEDIAN * float(np.nanmedian(np.abs(error - middle)))
    if not usual > 0.0:
        return np.ones(len(error))
    return np.asarray((usual / np.fmax(error, usual)) ** 2)


def _by_blobs(n_blobs: Floats) -> Floats:
    """Ratio of each number of blobs to the usual one; a point without any counts as one with half a blob."""
    usual = float(np.nanmedian(n_blobs))
    if not usual > 0.0:
        return np.ones(len(n_blobs))
    return np.asarray(np.clip(np.fmin(n_blobs, usual), 0.5, usual) / max(usual, 0.5))
