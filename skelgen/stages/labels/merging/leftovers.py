"""Markers, and tracks that the skeleton left without one, merged by the likelihood of their distances.

Where two of a limb's three markers are hidden, its pose is not known, and with it no place for the third; yet its
distances to what is seen tell it apart. Such a track counts as one more marker, and is merged into the one that it is
(`likelihood`). What is merged into none stays without a marker.
"""

from __future__ import annotations

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Ints
from skelgen.stages.labels.merging.likelihood import DistanceRecord, distance_sums, sample_frames
from skelgen.stages.labels.merging.pauses import merge_across_pauses
from skelgen.stages.labels.point_labels import (
    blocks_of,
    one_point_a_frame,
    renumbered,
    sampled_positions,
    seen_together,
)

LEAST_POINTS = 8
"""Frames that a track must last: false points hardly ever do."""

MOST_TRACKS = 400
"""Tracks that are merged at once, the longest: bounds the work."""

FRAMES_AT_ONCE = 600
"""Frames whose positions are held at once."""


def merge_again(cloud: PointCloud, track_of_point: Ints, marker_of_point: Ints, rate: float, spacing: float) -> Ints:
    """Merge markers, and tracks without one, by the likelihood of their distances; each turn knows more of these.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Markers found so far, -1 for none.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; numbered without holes.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    extended = with_leftovers(track_of_point, marker_of_point)
    n_extended = int(extended.max(initial=-1)) + 1
    frames = sample_frames(rate, 0, cloud.n_frames)
    sums = np.zeros((3, n_extended, n_extended))
    for start in range(0, len(frames), FRAMES_AT_ONCE):
        sums += distance_sums(sampled_positions(cloud, extended, frames[start : start + FRAMES_AT_ONCE]))
    apart = sums[0] > 0
    if n_extended > n_markers:  # short tracks may lie between the sampled frames
        meeting = seen_at_once(cloud, extended, n_extended)
        meeting[:n_markers, :n_markers] = False
        apart |= meeting
    merged = merge_across_pauses(DistanceRecord(sums[0], sums[1], sums[2], apart, spacing))
    merged[merged >= n_markers] = -1
    if (merged[:n_markers] == np.arange(n_markers)).all() and (merged[n_markers:] < 0).all():
        return marker_of_point
    found = one_point_a_frame(cloud, np.append(merged, -1).astype(np.int32)[extended])
    return renumbered(found, np.bincount(found[found >= 0], minlength=n_markers) > 0)


def with_leftovers(track_of_point: Ints, marker_of_point: Ints) -> Ints:
    """Give every lasting track of points without a marker a number of its own, behind those of the markers.

    Parameters
    ----------
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    free = np.flatnonzero((marker_of_point < 0) & (track_of_point >= 0))
    tracks, place, counts = np.unique(track_of_point[free], return_inverse=True, return_counts=True)
    chosen = np.argsort(-counts, kind="stable")[:MOST_TRACKS]
    chosen = chosen[counts[chosen] >= LEAST_POINTS]
    number = np.full(len(tracks), -1, dtype=marker_of_point.dtype)
    number[chosen] = marker_of_point.max(initial=-1) + 1 + np.arange(len(chosen))
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
