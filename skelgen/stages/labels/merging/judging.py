"""Which of two ways to label a take explains it better: as a whole, or part by part.

Its evidence tells, and how many markers that needs. Where two labellings with the same markers differ, they differ in a
few spans of time, and there on a few markers: an arm after it was hidden, two markers on a foot. Each such part may be
taken from either, and is taken from the one that explains the whole take better, as fusion moves do (Lempitsky et al.,
IEEE TPAMI 32 (2010) 1392-1405).
"""

from dataclasses import replace

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Ints, rows_of_each
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.followed import FollowedCloud

MOST_EXISTENCE = 24.0
"""nats; some markers are hidden for long, whatever the mean gap. Skin that moves as a body leaves its first pose says
up to 18 nats against one marker, in recorded people."""

MARKER_COST = 2.0
"""Times the evidence against a marker that is never seen beside another one (`existence`): what each marker more must
explain, as skin that moves when a posture is left explains itself by a second one."""

FULLEST = 0.99
"""Part of the frames that show no more points than are seen at once; the others show false ones."""

TOO_MANY = 1.1
"""Times the points that are seen at once: of more markers many are parts of others."""

NEAR = 3
"""Frames: parts in which labellings differ are of one span if no more lie between them."""

MOST_PARTS = 40
"""Of them, the largest, each of which is judged by the whole take."""


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


def better_labels(take: FollowedCloud, found: Ints, other: Ints, least: float = 0.0) -> Ints:
    """Return other labels if they explain changes of posture better, markers counted; else those found.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    found, other : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    least : float, nats
        How much more they must explain.
    """
    judge, n_more = replace(take, by_posture=True), int(other.max(initial=-1)) - int(found.max(initial=-1))
    least += MARKER_COST * existence(take.cloud, found) * n_more
    return other if judge.evidence(other)[0] > judge.evidence(found)[0] + least else found


def has_too_many(take: FollowedCloud, found: Ints) -> bool:
    """Return whether far more markers were found than are ever seen at once, so that many are parts of others.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    found : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    return int(found.max(initial=-1)) + 1 > TOO_MANY * _n_at_once(take)


def explains_more(take: FollowedCloud, found: Ints, other: Ints, *, counts_markers: bool) -> bool:
    """Return whether other labels explain a take better than by chance.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    found, other : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    counts_markers : bool
        Whether they must have fewer markers, but enough for what is seen at once, and what each less is worth counts.
    """
    evidence, chance = take.evidence(found)
    if not counts_markers:
        return bool(take.evidence(other)[0] > evidence + chance)
    n_markers = int(other.max(initial=-1)) + 1
    if n_markers > int(found.max(initial=-1)) or TOO_MANY * n_markers < _n_at_once(take):
        return False
    return better_labels(take, found, other, chance) is other


def _n_at_once(take: FollowedCloud) -> float:
    return float(np.quantile(take.cloud.points_per_frame, FULLEST))


def fused_labels(take: FollowedCloud, found: Ints, other: Ints) -> Ints:
    """Return labels that are those found or others in each part in which they differ, whichever explains more.

    Parameters
    ----------
    take : FollowedCloud
        The take; points whose marker is stated keep it.
    found, other : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; a marker has the same number in both.
    """
    judge = replace(take, by_posture=True)
    best, evidence = found, judge.evidence(found)[0]
    if not take.is_fixed.any() and (of_other := judge.evidence(other)[0]) > evidence:
        best, other, evidence = other, found, of_other
    for part in parts_that_differ(take, best, other):
        tried = best.copy()
        tried[part] = other[part]
        if (explained := judge.evidence(tried)[0]) > evidence:
            best, evidence = tried, explained
    return best


def parts_that_differ(take: FollowedCloud, found: Ints, other: Ints) -> list[Ints]:
    """Return points of each part in which labels differ, the largest ones, at most `MOST_PARTS`.

    Parts are of spans of time, and in these the markers that are exchanged with each other.

    Parameters
    ----------
    take : FollowedCloud
        The take; points whose marker is stated are of no part.
    found, other : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; a marker has the same number in both.
    """
    from scipy.sparse import coo_array  # noqa: PLC0415 - heavy
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - heavy

    points = np.flatnonzero((found != other) & ~take.is_fixed)
    if not len(points):
        return []
    frames = take.frame_of_point()[points]
    span = np.concatenate([[0], np.cumsum(np.diff(frames) > NEAR)])
    n_markers = int(max(found.max(), other.max())) + 1
    one, two = found[points], other[points]
    pairs = [span * n_markers + np.where(own >= 0, own, theirs) for own, theirs in ((one, two), (two, one))]
    size = int(span[-1] + 1) * n_markers
    linked = coo_array((np.ones(len(points)), tuple(pairs)), shape=(size, size))
    part = connected_components(linked, directed=False)[1][pairs[0]]
    return sorted((points[rows] for rows in rows_of_each(part)), key=len, reverse=True)[:MOST_PARTS]
