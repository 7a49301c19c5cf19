"""What following points needs to know of a take: how far apart points are, when frames were, how good points are."""

import numpy as np
from scipy.spatial import cKDTree

from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model import PointCloud
from skelgen.model.arrays import Floats, Ints, spread_frames
from skelgen.progress import SILENT, Monitor

LONGEST_PAUSE = 1000
"""Time steps that end all tracks; longer ones would be no different."""

LEAST_WEIGHT = 0.01
"""A point that the file calls as bad as can be still has a place, with ten times the usual deviation."""


def typical_spacing(cloud: PointCloud) -> float:
    """Median distance [mm] between a point and its nearest neighbour in the same frame; 1 if there is none.

    A hundred frames spread over the take count alike, however many points they hold.
    """
    nearest = []
    for frame in spread_frames(cloud.n_frames, 100):
        points = cloud.frame(frame)
        if len(points) > 1:
            nearest.append(float(np.median(cKDTree(points).query(points, k=2)[0][:, 1])))
    spacing = float(np.median(nearest)) if nearest else 0.0
    return spacing or 1.0


def time_steps(cloud: PointCloud, monitor: Monitor = SILENT) -> Ints:
    """Return the time since the frame before in whole frame periods, shape (n_frames,).

    Frames are a period apart, however their stamps jitter; dropped frames and pauses count in time. A frame that
    repeats the stamp of the one before counts as one period later, and a notice says so.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    monitor : Monitor
        Receives the notice.
    """
    passed = np.diff(cloud.times)
    n_repeated = int((passed == 0).sum())
    if 0 < n_repeated < len(passed):
        monitor.notice(f"{n_repeated} frames repeat the time stamp of the frame before; they count as one frame later")
    periods = np.minimum(np.round(passed * cloud.rate), LONGEST_PAUSE)
    return np.concatenate([[1], np.maximum(periods, 1)])[: cloud.n_frames].astype(np.intp)


def point_weights(cloud: PointCloud) -> Floats:
    """Return the weight of each point: the usual variance of a point's position over that of this one.

    A position's deviation is taken as proportional to its reprojection error, where that is larger than the take's
    points usually have, and its variance as inverse to the number of blobs, where there are fewer than usual.

    Parameters
    ----------
    cloud : PointCloud
        The take; its attributes ``reprojection_error`` and ``n_blobs`` count.

    Returns
    -------
    ndarray, shape (n_points,)
        Between `LEAST_WEIGHT` and 1; all 1 where the file has neither, or the same for all points. Read-only.
    """
    error, n_blobs = cloud.attributes.get("reprojection_error"), cloud.attributes.get("n_blobs")
    if cloud.n_points == 0 or (error is None and n_blobs is None):
        return np.broadcast_to(np.float64(1.0), cloud.n_points)  # a long take is not filled with ones
    weights = np.ones(cloud.n_points)
    if error is not None:
        weights *= _by_error(np.abs(error))
    if n_blobs is not None:
        # Ratio of each number of blobs to the usual one; a point without any counts as one with half a blob
        usual = float(np.nanmedian(n_blobs))
        if usual > 0.0:
            weights *= np.clip(np.fmin(n_blobs, usual), 0.5, usual) / max(usual, 0.5)
    return np.asarray(np.clip(weights, LEAST_WEIGHT, 1.0))


def _by_error(error: Floats) -> Floats:
    """Squared ratio of the largest usual error, a robust deviation above the median, to each."""
    middle = float(np.nanmedian(error))
    usual = middle + SIGMA_OF_MEDIAN * float(np.nanmedian(np.abs(error - middle)))
    if not usual > 0.0:
        return np.ones(len(error))
    return np.asarray((usual / np.fmax(error, usual)) ** 2)
