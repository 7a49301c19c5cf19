"""Pieces of tracks that went to a wrong marker: moved to the one whose distances they keep.

A marker that comes back where another one was just lost may go on as that one for a moment. The piece is too short to
change the evidence of the whole take, and it is in the way: what it belongs to is not seen then, and the marker that
has it cannot be joined with its other part, as both are seen at once. But the piece keeps the distances of its own
marker (`leftovers`). It is moved there if that marker is not seen meanwhile and is more likely by `MOVED` nats than the
one that has the piece; which counts as even where too few of that one's distances are known.
"""

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.leftovers import evidence_of_pieces, usual_distances
from skelgen.stages.labels.merging.likelihood import EVIDENCE

MOVED = 6.0
"""nats by which another marker must be likelier. In 23 takes of six recorded people no piece of a right marker was
likelier another one's; wrong pieces were by 10 nats and more."""

SHORTEST = 4
"""Frames that a piece must last."""

MOMENTS = 8
"""Moments of a piece whose distances are compared, evenly spread."""

PIECES_AT_ONCE = 500
"""Pieces that are compared with all markers at once."""


def move_pieces(
    cloud: PointCloud, track_of_point: Ints, marker_of_point: Ints, sums: Floats, spacing: float, fixed: Bools
) -> Ints:
    """Move pieces of tracks to markers that are more likely, those that gain most first.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point, marker_of_point : ndarray of intp, shape (n_points,)
        Track and marker of each point, -1 for none.
    sums : ndarray, shape (3, n_markers, n_markers)
        Number, sum [mm] and sum of squares [mm^2] of the markers' distances.
    spacing : float, mm
        Typical distance of neighbouring markers.
    fixed : ndarray of bool, shape (n_points,)
        Points that keep their marker.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes; the given array if nothing is moved.
    """
    moments = _moments_of_pieces(track_of_point, marker_of_point, len(sums[0]), fixed)
    frame = np.repeat(np.arange(cloud.n_frames, dtype=np.int32), cloud.points_per_frame)
    laws, result = usual_distances(sums, spacing), marker_of_point.copy()
    moves: list[tuple[float, int, int]] = []
    for first in range(0, len(moments), PIECES_AT_ONCE):
        some = moments[first : first + PIECES_AT_ONCE]
        gain, other = _best_others(cloud, marker_of_point, frame, some, laws, spacing)
        found = np.flatnonzero(gain >= MOVED)
        moves += zip(gain[found].tolist(), some[found, 0].tolist(), other[found].tolist(), strict=True)
    for _, point, better in sorted(moves, reverse=True):
        track, marker = track_of_point[point], marker_of_point[point]
        own = np.flatnonzero((track_of_point == track) & (marker_of_point == marker))
        beside = slice(*np.searchsorted(frame, (frame[own[0]], frame[own[-1]] + 1)))
        if not np.isin(frame[own], frame[beside][result[beside] == better]).any():
            result[own] = better
    if (result == marker_of_point).all():
        return marker_of_point
    return point_labels.renumbered(result, np.bincount(result[result >= 0], minlength=len(sums[0])) > 0)


def _moments_of_pieces(track_of_point: Ints, marker_of_point: Ints, n_markers: int, fixed: Bools) -> Ints:
    """Evenly spread points of each piece that lasts, its first point first, shape (n_pieces, MOMENTS)."""
    found = [np.zeros((0, MOMENTS), dtype=np.intp)]
    for marker in range(n_markers):
        points = np.flatnonzero((marker_of_point == marker) & (track_of_point >= 0))
        if not len(points):
            continue
        points = points[np.argsort(track_of_point[points], kind="stable")]
        starts = np.flatnonzero(np.diff(track_of_point[points], prepend=-1))
        lengths = np.diff(starts, append=len(points))
        used = (lengths >= SHORTEST) & ~np.logical_or.reduceat(fixed[points], starts)
        along = lengths[used, np.newaxis] * np.arange(MOMENTS) // MOMENTS
        found.append(points[starts[used, np.newaxis] + along])
    return np.concatenate(found)


def _best_others(
    cloud: PointCloud,
    marker_of_point: Ints,
    frame: Ints,
    moments: Ints,
    laws: tuple[Floats, Floats],
    spacing: float,
) -> tuple[Floats, Ints]:
    """How much more likely the best other marker is than that of each piece [nats], and which one it is."""
    every, own = np.arange(len(moments)), marker_of_point[moments[:, 0]]
    points = moments.ravel()
    used, row = np.unique(frame[points], return_inverse=True)
    beside = point_labels.sampled_positions(cloud, marker_of_point, used, len(laws[0]))[row]
    distance = np.linalg.norm(beside - cloud.points[points][:, np.newaxis], axis=2)
    distance[np.arange(len(points)), np.repeat(own, MOMENTS)] = np.nan
    evidence = evidence_of_pieces(distance, every * MOMENTS, laws, spacing)
    kept = evidence[every, own]
    evidence[every, own] = -np.inf
    other = evidence.argmax(axis=1)
    best = evidence[every, other]
    return np.where(best >= EVIDENCE, best - np.where(np.isfinite(kept), kept, 0.0), -np.inf), other
