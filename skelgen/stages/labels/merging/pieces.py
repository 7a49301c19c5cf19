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
"""nats by which another marker must be likelier. In 23 takes of six recorded people no piece of a right marker was likelier
another one's; wrong pieces were by 10 nats and more."""

LEAST_POINTS = 4
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
    points, ends = _pieces(track_of_point, marker_of_point, fixed)
    frame = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    laws, result = usual_distances(sums, spacing), marker_of_point.copy()
    moves: list[tuple[float, int, int]] = []
    for first in range(0, len(ends) - 1, PIECES_AT_ONCE):
        some = ends[first : first + PIECES_AT_ONCE + 1]
        gain, other = _best_others(cloud, marker_of_point, frame, points[_moments(some)], laws, spacing)
        found = np.flatnonzero(gain >= MOVED)
        moves += zip(gain[found].tolist(), (first + found).tolist(), other[found].tolist(), strict=True)
    for _, piece, better in sorted(moves, reverse=True):
        own = points[ends[piece] : ends[piece + 1]]
        beside = slice(*np.searchsorted(frame, (frame[own[0]], frame[own[-1]] + 1)))
        if not np.isin(frame[own], frame[beside][result[beside] == better]).any():
            result[own] = better
    if (result == marker_of_point).all():
        return marker_of_point
    return point_labels.renumbered(result, np.bincount(result[result >= 0], minlength=len(sums[0])) > 0)


def _pieces(track_of_point: Ints, marker_of_point: Ints, fixed: Bools) -> tuple[Ints, Ints]:
    """Points of tracks that are one marker's, piece by piece in order of frames, and where each piece ends."""
    owned = np.flatnonzero((marker_of_point >= 0) & (track_of_point >= 0))
    owned = owned[np.lexsort((track_of_point[owned], marker_of_point[owned]))]
    marker, track = marker_of_point[owned], track_of_point[owned]
    begins = np.ones(len(owned), dtype=bool)
    begins[1:] = (np.diff(marker) != 0) | (np.diff(track) != 0)
    piece = np.cumsum(begins) - 1
    free = np.bincount(piece) >= LEAST_POINTS
    free[piece[fixed[owned]]] = False
    owned = owned[free[piece]]
    return owned, np.concatenate([[0], np.cumsum(np.bincount(piece)[free])])


def _moments(ends: Ints) -> Ints:
    """Evenly spread points of pieces that lie between `ends`, shape (n_pieces, MOMENTS)."""
    return np.asarray(ends[:-1, np.newaxis] + np.diff(ends)[:, np.newaxis] * np.arange(MOMENTS) // MOMENTS)


def _best_others(
    cloud: PointCloud,
    marker_of_point: Ints,
    frame: Ints,
    moments: Ints,
    laws: tuple[Floats, Floats],
    spacing: float,
) -> tuple[Floats, Ints]:
    """How much more likely the best other marker is than that of each piece [nats], and which one it is."""
    n_pieces, n_markers = len(moments), len(laws[0])
    used, row = np.unique(frame[moments], return_inverse=True)
    beside = point_labels.sampled_positions(cloud, marker_of_point, used, n_markers)[row.reshape(moments.shape)]
    distance = np.linalg.norm(beside - cloud.points[moments][:, :, np.newaxis], axis=3)
    every, own = np.arange(n_pieces), marker_of_point[moments[:, 0]]
    distance[every, :, own] = np.nan
    known = ~np.isnan(distance)
    count = known.sum(axis=1).astype(np.float64)
    mean = np.where(known, distance, 0.0).sum(axis=1) / np.maximum(count, 1.0)
    evidence = evidence_of_pieces(count, mean, laws, spacing)
    kept = evidence[every, own]
    evidence[count > 0] = -np.inf  # markers that are seen meanwhile
    evidence[every, own] = -np.inf
    other = evidence.argmax(axis=1)
    best = evidence[every, other]
    return np.where(best >= EVIDENCE, best - np.where(np.isfinite(kept), kept, 0.0), -np.inf), other
