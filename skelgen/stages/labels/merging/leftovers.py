"""Tracks that the skeleton left without a marker, heard once more: by their distances to the markers seen beside them.

Where two of a limb's three markers are hidden, its pose is not known, and with it no place for the third; yet its
distances to what is seen tell it apart. Such a track is laid beside the markers as if it were one of its own, and is
joined to the one that it is by the likelihood of their distances (`likeness`). What joins none stays without a marker.
"""

from __future__ import annotations

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Ints
from skelgen.stages.labels.point_labels import blocks_of, seen_together

LEAST_POINTS = 8
"""Frames that a track must last: false points hardly ever do."""

MOST_HEARD = 400
"""Tracks that are heard at once, the longest: bounds the work."""


def with_left_out(cloud: PointCloud, owner: Ints, marker_of_point: Ints) -> Ints:
    """Give every lasting track of points without a marker a number of its own, behind those of the markers.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    free = np.flatnonzero((marker_of_point < 0) & (owner >= 0))
    tracks, place, counts = np.unique(owner[free], return_inverse=True, return_counts=True)
    heard = np.argsort(-counts, kind="stable")[:MOST_HEARD]
    heard = heard[counts[heard] >= LEAST_POINTS]
    number = np.full(len(tracks), -1, dtype=marker_of_point.dtype)
    number[heard] = marker_of_point.max(initial=-1) + 1 + np.arange(len(heard))
    result = marker_of_point.copy()
    result[free] = number[place]
    return result


def seen_at_once(cloud: PointCloud, marker_of_point: Ints, n_markers: int) -> Bools:
    """Tell which markers are ever seen in one frame, shape (n_markers, n_markers).

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_markers : int
        Number of markers.
    """
    together = np.zeros((n_markers, n_markers), dtype=bool)
    for block in blocks_of(cloud):
        together |= seen_together(block, marker_of_point[block.points], n_markers) > 0
    return together
