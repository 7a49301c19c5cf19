r"""Short tracks without a marker, and pieces that have a wrong one: given to the marker whose distances they keep.

A track of a tenth of a second is one moment: too little to say how much its distances vary, and often between the
moments at which tracklets are compared. But when markers are known, their distances are. With the mean
:math:`\mu_{mj}` and the deviation :math:`\tau_{mj}` of marker m's distance to a marker j that is seen beside the track
at the distance d, the track is m's with the evidence

.. math:: E_m = \sum_j \log \frac{t(d - \mu_{mj};\; \tau_{mj}^2)}{t(d - \mu_{mj};\; \tau_{mj}^2 + w^2)}

over the six markers j whose distances to m vary least; w is the spacing of markers, t Student's distribution. It gets
the marker of most evidence that is not seen meanwhile, if no other has nearly as much. What lasts longer than false
points do, in a pose that was never seen before, may keep its distances badly: but were it none of them, there would be
one marker more, which is hidden whenever the most likely one is seen.

At the end, gaps speak, too: where a marker was lost a moment before and is found a moment later (`continuity`).

Pieces of tracks that went to a wrong marker are moved to the one whose distances they keep. A marker that comes back
where another one was just lost may go on as that one for a moment. The piece is too short to change the evidence of
the whole take, and it is in the way: what it belongs to is not seen then, and the marker that has it cannot be joined
with its other part, as both are seen at once. But the piece keeps the distances of its own marker. It is moved there
if that marker is not seen meanwhile and is more likely by `MOVED` nats than the one that has the piece; which counts
as even where too few of that one's distances are known.
"""

import itertools

import numpy as np

from skelgen._kernels.marker_exchanges import LEAST_DEVIATION
from skelgen._kernels.piece_evidence import distances_to_markers, evidence_of_means
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import existence
from skelgen.stages.labels.merging.likelihood import EVIDENCE, LEAST_WITNESSES, SEEN_ENOUGH
from skelgen.stages.labels.merging.markers import LEAST_POINTS

MOST_PASSES = 4
"""Over what is left at the end: what has got its marker is a witness of others."""

BOTH_SIDES = 2
"""Gaps beside a piece, before it and behind it, from which its marker may be told where distances are too few."""

LASTING = 25
"""Frames that false points hardly last: a track of so many is a marker, of those known or another one."""

TRACKS_AT_ONCE = 500
"""Tracks, or pieces of them, that are compared with all markers at once."""


def label_leftovers(take: FollowedCloud, marker_of_point: Ints, most_against: float = 0.0) -> Ints:
    """Give tracks without a marker to the markers whose distances they keep.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    most_against : float, nats
        Most that speaks against one marker more (`markers.existence`): so unlikely is it that what lasts too long for a
        false point is none of those known.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; the given array if nothing is added.
    """
    pieces = _lasting(take.track_of_point, marker_of_point, LEAST_POINTS)
    return _with_pieces(take, marker_of_point, pieces, most_against)


def label_rest(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Give all that is left without a marker, single points too, to the markers whose distances they keep.

    This is for the end: so short a piece that is given wrongly keeps parts of markers from being joined.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; the given array if nothing is added.
    """
    for _ in range(1 if take.is_very_long else MOST_PASSES):
        pieces, before = _lasting(take.track_of_point, marker_of_point, 1), marker_of_point
        marker_of_point = _with_pieces(take, before, pieces, over_gaps=True)
        if marker_of_point is before:
            break
    return marker_of_point


def _with_pieces(
    take: FollowedCloud,
    marker_of_point: Ints,
    pieces: tuple[Ints, Ints],
    most_against: float = 0.0,
    *,
    over_gaps: bool = False,
) -> Ints:
    """Marker of each point when pieces have got theirs: points, piece by piece, and the number of each one's piece."""
    points, track = pieces
    if not len(points) or marker_of_point.max() < LEAST_WITNESSES:
        return marker_of_point
    laws, another = usual_distances(take.distances(marker_of_point), take.spacing), 0.0
    if most_against > 0.0 and (np.bincount(track) >= LASTING).any():
        another = min(existence(take.cloud, marker_of_point), most_against)
    result = marker_of_point.copy()
    starts = np.searchsorted(track, np.arange(0, track[-1] + 1 + TRACKS_AT_ONCE, TRACKS_AT_ONCE))
    for begin, end in itertools.pairwise(starts):
        part = slice(begin, end)
        some = points[part], track[part] - track[begin]
        result[points[part]] = _given(take, result, some, laws, another, over_gaps=over_gaps)
    return result if (result != marker_of_point).any() else marker_of_point


def _lasting(track_of_point: Ints, marker_of_point: Ints, shortest: int) -> tuple[Ints, Ints]:
    """Points without a marker whose tracks last, track by track, and their tracks numbered from 0.

    If one point is enough, those of no track count as tracks of their own.
    """
    free = np.flatnonzero((marker_of_point < 0) & ((track_of_point >= 0) | (shortest <= 1)))
    tracks = track_of_point[free].astype(np.intp)
    alone = tracks < 0
    tracks[alone] = tracks.max(initial=-1) + 1 + np.arange(int(alone.sum()))
    _, place, counts = np.unique(tracks, return_inverse=True, return_counts=True)
    lasts = counts >= shortest
    number = np.where(lasts, np.cumsum(lasts) - 1, -1)[place]
    order = np.argsort(number, kind="stable")
    order = order[number[order] >= 0]
    return free[order], number[order]


def usual_distances(sums: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Return mean distances of markers [mm] and their variances [mm^2], infinite where hardly seen.

    Parameters
    ----------
    sums : ndarray, shape (3, n_markers, n_markers)
        Number, sum [mm] and sum of squares [mm^2] of the markers' distances.
    spacing : float, mm
        Typical distance of neighbouring markers.
    """
    count, total, squares = sums
    mean = total / np.maximum(count, 1.0)
    scatter = np.maximum(squares - count * mean**2, 0.0)
    variance = (2.0 * (LEAST_DEVIATION * spacing) ** 2 + scatter) / (2.0 + np.maximum(count - 1.0, 0.0))
    variance[(count < SEEN_ENOUGH) | np.eye(len(count), dtype=bool)] = np.inf
    return mean, variance


def _given(
    take: FollowedCloud,
    marker_of_point: Ints,
    pieces: tuple[Ints, Ints],
    laws: tuple[Floats, Floats],
    another: float,
    *,
    over_gaps: bool,
) -> Ints:
    """Marker of each point of some tracks, -1 for none."""
    points, track = pieces
    distance, row = distances_beside(take, marker_of_point, points, len(laws[0]))
    starts = np.searchsorted(track, np.arange(int(track[-1]) + 1))
    ends = np.append(starts[1:], len(track))
    evidence, is_seen = evidence_of_pieces(distance, starts, laws, take.spacing), _seen_beside(distance, starts)
    gaps = take.continuity(marker_of_point) if over_gaps else None
    if gaps:
        said, n_gaps = gaps.beside(points[starts], points[ends - 1], ~is_seen)
        evidence[np.isinf(evidence) & (n_gaps == BOTH_SIDES)] = 0.0
        evidence += said
    evidence[is_seen] = -np.inf
    best, ranked = evidence.argmax(axis=1), np.sort(evidence, axis=1)
    none = np.where(ends - starts < LASTING, 0.0, -another)
    margin = ranked[:, -1] - np.maximum(ranked[:, -2], none)
    taken = np.zeros((int(row.max()) + 1, len(laws[0])), dtype=bool)
    result = np.full(len(points), -1, dtype=marker_of_point.dtype)
    for one in np.argsort(-margin, kind="stable")[: int((margin >= EVIDENCE).sum())].tolist():
        part = slice(starts[one], ends[one])
        if not taken[row[part], best[one]].any():
            taken[row[part], best[one]] = True
            result[part] = best[one]
    return result


def distances_beside(take: FollowedCloud, marker_of_point: Ints, points: Ints, n_markers: int) -> tuple[Floats, Ints]:
    """Return how far points are from the markers of their frames, and which of the frames concerned each point is in.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point of the take, -1 for none.
    points : ndarray of intp, shape (n_chosen,)
        Which points.
    n_markers : int
        Number of markers.

    Returns
    -------
    tuple of ndarray, shapes (n_chosen, n_markers) and (n_chosen,)
        Distances [mm], NaN where markers are unseen; and a rising number of each point's frame, from 0.
    """
    cloud = take.cloud
    frames = np.searchsorted(cloud.frame_starts, points, side="right") - 1
    used, row = np.unique(frames, return_inverse=True)
    places = point_labels.sampled_positions(cloud, marker_of_point, used, n_markers)
    return distances_to_markers(cloud.points[points], places, row), row


def _seen_beside(distance: Floats, starts: Ints) -> Bools:
    """Which markers are seen beside which pieces, shape (n_pieces, n_markers)."""
    return np.asarray(np.logical_or.reduceat(~np.isnan(distance), starts))


def evidence_of_pieces(distance: Floats, starts: Ints, laws: tuple[Floats, Floats], spacing: float) -> Floats:
    """Return the evidence [nats] that each piece of a track is each marker, shape (n_pieces, n_markers).

    It is -inf where too little is known.

    Parameters
    ----------
    distance : ndarray, shape (n_points, n_markers), mm
        From points of the pieces, one piece after the other, to the markers; NaN where these are unseen.
    starts : ndarray of intp, shape (n_pieces,)
        First point of each piece.
    laws : tuple of ndarray
        From `usual_distances`.
    spacing : float, mm
        Typical distance of neighbouring markers.
    """
    known = ~np.isnan(distance)
    counts = np.add.reduceat(known.astype(np.float64), starts, axis=0)
    totals = np.add.reduceat(np.where(known, distance, 0.0), starts, axis=0)
    return evidence_of_means((counts, totals), laws, spacing, LEAST_WITNESSES)


MOVED = 6.0
"""nats by which another marker must be likelier. In 23 takes of six recorded people no piece of a right marker was
likelier another one's; wrong pieces were by 10 nats and more."""

SHORTEST = 4
"""Frames that a piece must last."""

MOMENTS = 8
"""Moments of a piece whose distances are compared, evenly spread."""


def move_pieces(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Move pieces of tracks to markers that are more likely, those that gain most first.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes; the given array if nothing is moved.
    """
    sums = take.distances(marker_of_point)
    laws, result = usual_distances(sums, take.spacing), marker_of_point.copy()
    moments = moments_of_pieces(take, marker_of_point, range(len(laws[0])))
    moves: list[tuple[float, int, int]] = []
    for first in range(0, len(moments), TRACKS_AT_ONCE):
        some = moments[first : first + TRACKS_AT_ONCE]
        gain, other = _best_others(take, marker_of_point, some, laws)
        found = np.flatnonzero(gain >= MOVED)
        moves += zip(gain[found].tolist(), some[found, 0].tolist(), other[found].tolist(), strict=True)
    frame, track = take.frame_of_point(), take.track_of_point
    for _, point, better in sorted(moves, reverse=True):
        own = np.flatnonzero((track == track[point]) & (marker_of_point == marker_of_point[point]))
        beside = slice(*np.searchsorted(frame, (frame[own[0]], frame[own[-1]] + 1)))
        if not np.isin(frame[own], frame[beside][result[beside] == better]).any():
            result[own] = better
    return point_labels.without_holes(result) if (result != marker_of_point).any() else marker_of_point


def moments_of_pieces(take: FollowedCloud, marker_of_point: Ints, markers: range) -> Ints:
    """Return evenly spread points of each piece that lasts, its first point first, shape (n_pieces, MOMENTS).

    Parameters
    ----------
    take : FollowedCloud
        The take; no piece has points that keep their marker.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    markers : range
        Markers whose pieces are looked at; -1 stands for points without one.
    """
    track = take.track_of_point
    is_among = (marker_of_point >= markers.start) & (marker_of_point < markers.stop)
    points = np.flatnonzero(is_among & (track >= 0))
    if not len(points):
        return np.zeros((0, MOMENTS), dtype=np.intp)
    piece = (marker_of_point[points].astype(np.int64) - markers.start) * (int(track.max()) + 1) + track[points]
    order = np.argsort(piece, kind="stable")
    points, starts = points[order], np.flatnonzero(np.diff(piece[order], prepend=-1))
    lengths = np.diff(starts, append=len(points))
    used = (lengths >= SHORTEST) & ~np.logical_or.reduceat(take.is_fixed[points], starts)
    along = lengths[used, np.newaxis] * np.arange(MOMENTS) // MOMENTS
    return np.asarray(points[starts[used, np.newaxis] + along])


def _best_others(
    take: FollowedCloud, marker_of_point: Ints, moments: Ints, laws: tuple[Floats, Floats]
) -> tuple[Floats, Ints]:
    """How much more likely the best other marker is than that of each piece [nats], and which one it is."""
    every, own = np.arange(len(moments)), marker_of_point[moments[:, 0]]
    distance, _ = distances_beside(take, marker_of_point, moments.ravel(), len(laws[0]))
    distance[np.arange(len(distance)), np.repeat(own, MOMENTS)] = np.nan
    starts = every * MOMENTS
    evidence = evidence_of_pieces(distance, starts, laws, take.spacing)
    evidence[_seen_beside(distance, starts)] = -np.inf
    kept = evidence[every, own]
    evidence[every, own] = -np.inf
    other = evidence.argmax(axis=1)
    best = evidence[every, other]
    return np.where(best >= EVIDENCE, best - np.where(np.isfinite(kept), kept, 0.0), -np.inf), other
