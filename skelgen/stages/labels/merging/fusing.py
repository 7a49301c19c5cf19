"""The best of two ways to label a take, part by part.

Where two labellings with the same markers differ, they differ in a few spans of time, and there on a few markers: an
arm after it was hidden, two markers on a foot. Each such part may be taken from either, and is taken from the one that
explains the whole take better, as fusion moves do (Lempitsky et al., IEEE TPAMI 32 (2010) 1392-1405).
"""

from dataclasses import replace

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from skelgen.model.arrays import Ints
from skelgen.stages.labels.merging.followed import FollowedCloud

NEAR = 3
"""Frames: parts are of one span if no more lie between them."""

MOST_PARTS = 40
"""Of them, the largest, each of which is judged by the whole take."""


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
    for part in sorted(_parts(take, best, other), key=len, reverse=True)[:MOST_PARTS]:
        tried = best.copy()
        tried[part] = other[part]
        if (explained := judge.evidence(tried)[0]) > evidence:
            best, evidence = tried, explained
    return best


def _parts(take: FollowedCloud, found: Ints, other: Ints) -> list[Ints]:
    """Points of each part: of spans in which labels differ, those of markers that are exchanged with each other."""
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
    order = np.argsort(part, kind="stable")
    return np.split(points[order], np.flatnonzero(np.diff(part[order])) + 1)
