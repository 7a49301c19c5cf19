r"""Markers that were found twice: joined because a marker that nobody ever sees beside another one hardly exists.

Who stands still at first and moves later shows distances that differ by more than they varied in either part, so that
a marker is found once for each. But had there been two, one would have been hidden all the time that the other was
seen. With gaps of the mean length :math:`\bar g` in a take of :math:`n` frames, a marker more costs :math:`n / \bar g`
nats, at most `MOST_EXISTENCE`. Two markers that are never seen together are one if distances, of which those of a slow
pose count once, do not say more against it, and if neither has another such partner that is nearly as likely.
"""

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.likelihood import EVIDENCE, DistanceRecord
from skelgen.stages.labels.merging.markers import sampled_distances

MOST_EXISTENCE = 12.0
"""nats; some markers are hidden for long, whatever the mean gap."""

COMMON_FRAMES = 2
"""Frames with both that false points may cause."""


def join_duplicates(cloud: PointCloud, marker_of_point: Ints, rate: float, spacing: float) -> Ints:
    """Join markers that were found in several parts of the take under different numbers.

    Parameters
    ----------
    cloud : PointCloud
        The take.
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
    together = np.zeros((n_markers, n_markers))
    for block in point_labels.blocks_of(cloud):
        together += point_labels.seen_together(block, marker_of_point[block.points], n_markers)
    apart = together > COMMON_FRAMES
    if apart[~np.eye(n_markers, dtype=bool)].all():
        return marker_of_point
    sums = sampled_distances(cloud, marker_of_point, rate)
    record = DistanceRecord(sums[0], sums[1], sums[2], apart, spacing)
    same = _joined(record, EVIDENCE - existence(cloud, marker_of_point))
    if (same == np.arange(n_markers)).all():
        return marker_of_point
    return point_labels.joined(cloud, marker_of_point, same)


def existence(cloud: PointCloud, marker_of_point: Ints) -> float:
    """Evidence [nats] against a marker that is never seen beside another one: length of the take in mean gaps.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    last = np.full(int(marker_of_point.max(initial=-1)) + 1, -1, dtype=np.intp)
    n_gaps, n_hidden = 0, 0
    for block in point_labels.blocks_of(cloud):
        marker = marker_of_point[block.points]
        order = np.argsort(marker, kind="stable")[int((marker < 0).sum()) :]
        marker, frame = marker[order], block.first + block.frames[order]
        before = last[marker]
        again = np.flatnonzero(np.diff(marker) == 0)
        before[again + 1] = frame[again]
        hidden = (frame - before - 1)[(before >= 0) & (frame - before > 1)]
        n_gaps, n_hidden = n_gaps + len(hidden), n_hidden + int(hidden.sum())
        last[marker] = frame  # of several the last that is written, the latest
    return min(MOST_EXISTENCE, cloud.n_frames * n_gaps / n_hidden) if n_hidden else MOST_EXISTENCE


def _joined(record: DistanceRecord, least: float) -> Ints:
    """The marker that each one is a part of; the record changes."""
    n_markers = len(record.count)
    group = np.arange(n_markers)
    link = np.array([record.evidence(one, is_slow=True) for one in range(n_markers)])
    while (best := link.max(initial=-np.inf)) >= least:
        one, other = sorted(int(index) for index in np.unravel_index(int(np.argmax(link)), link.shape))
        if best - _rival(link, one, other, ~record.apart) < EVIDENCE:
            link[one, other] = link[other, one] = -np.inf
            continue
        record.merge(one, other)
        group[group == other] = one
        link[other] = link[:, other] = -np.inf
        for marker in np.flatnonzero(np.diag(record.count) > 0):
            link[marker] = record.evidence(int(marker), is_slow=True)
    return group


def _rival(link: Floats, one: int, other: int, possible: Bools) -> float:
    """Evidence of the next best partner of either."""
    rows = np.where(possible[[one, other]], link[[one, other]], -np.inf)
    rows[:, [one, other]] = -np.inf
    return float(rows.max(initial=-np.inf))
