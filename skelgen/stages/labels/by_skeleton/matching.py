"""Which point is which marker of a skeleton, by its pose.

Proposals are made: the names, where the take has some that the skeleton knows, and the pose of the skeleton followed
through the take forward and backward, names or none, as each frame tells and as all frames of a track tell together.
The one that explains most positions is kept. The skeleton is then posed in all frames, and points that no marker has
are given to markers whose place they are at.
"""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Bools, Floats, Ints, rows_of_each, spread_frames
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.by_skeleton.points import FollowedPoints
from skelgen.stages.labels.by_skeleton.posing import SkeletonPoses, pose_skeleton
from skelgen.stages.labels.online.pose_filter import PoseFilter
from skelgen.stages.labels.online.skeleton_labels import SkeletonLabels
from skelgen.stages.labels.point_labels import filled_labels
from skelgen.stages.labels.tracking.statistics import typical_spacing

GATE = 5.0
"""Deviations of a marker on its limb within which a point is at its place, as in the labels frame by frame."""

ROUNDS = 3
"""Rounds of assigning points to markers and posing: a point that is found poses its limb, which finds others."""

HELD_SHARE = 0.5
"""A track that is at a marker's place in more than this part of its frames is that marker's in between too."""

EVIDENCE_FRAMES = 200
"""Frames in which proposals are compared."""


class MatchedPoints(NamedTuple):
    """Marker of each point, -1 for none, poses of the skeleton by these, and whether names of the take decided."""

    marker_of_point: Ints
    poses: SkeletonPoses
    by_name: bool


def match_points(
    points: FollowedPoints, skeleton: Skeleton, names: tuple[str, ...] = (), monitor: Monitor = SILENT
) -> MatchedPoints:
    """Find which point is which marker of a skeleton.

    Parameters
    ----------
    points : FollowedPoints
        The take.
    skeleton : Skeleton
        The body that it shows.
    names : tuple of str, optional
        What its markers are called.
    monitor : Monitor
        Receives progress; may cancel.
    """
    proposed, by_name = propose_markers(points, skeleton, names, monitor)
    return MatchedPoints(*pose_and_reassign(points, proposed, skeleton, monitor), by_name)


def gates_of(skeleton: Skeleton) -> Floats:
    """Return within which distance of its place a point is a marker [mm], shape (n_markers,)."""
    return np.asarray(GATE * PoseFilter(skeleton).deviation)


def propose_markers(
    points: FollowedPoints, skeleton: Skeleton, names: tuple[str, ...] = (), monitor: Monitor = SILENT
) -> tuple[Ints, bool]:
    """Return markers of the points by what explains most of them, and whether that is the names of the take.

    Parameters
    ----------
    points, skeleton, names, monitor
        As `match_points`.
    """
    ways, n_markers = _followed_both_ways(points, skeleton, monitor), len(skeleton.limb_of_marker)
    proposals = [
        (filled_labels(points.cloud, ways, n_markers), False),
        (by_track_votes(points, ways, n_markers), False),
    ]
    # Markers by the names of the take, if the skeleton has any of them
    known = np.array([names.index(name) if name in names else -1 for name in points.names], dtype=np.intp)
    named = known[points.tracks] if (known >= 0).any() else None
    if named is not None:
        proposals.append((named, True))
    gates = gates_of(skeleton)
    counts = [_n_explained(points, marker_of_point, skeleton, gates) for marker_of_point, _ in proposals]
    return proposals[max(range(len(proposals)), key=lambda index: (counts[index], index))]


def _followed_both_ways(points: FollowedPoints, skeleton: Skeleton, monitor: Monitor) -> list[Ints]:
    """Markers by the pose of the skeleton, followed forward, and backward where that leaves points alone."""
    spacing, n_frames = typical_spacing(points.cloud), points.cloud.n_frames
    forward = _followed(points, skeleton, spacing, range(n_frames), monitor)
    alone = np.bincount(points.frames[forward < 0], minlength=n_frames)
    missing = n_carried(skeleton) - np.bincount(points.frames[forward >= 0], minlength=n_frames)
    if not ((alone > 0) & (missing > 0)).any():
        return [forward]
    return [forward, _followed(points, skeleton, spacing, range(n_frames - 1, -1, -1), monitor)]


def _followed(points: FollowedPoints, skeleton: Skeleton, spacing: float, frames: range, monitor: Monitor) -> Ints:
    model = SkeletonLabels(skeleton)
    starts = points.cloud.frame_starts
    marker_of_point = np.full(points.cloud.n_points, -1, dtype=np.intp)
    for count, frame in enumerate(frames):
        part = slice(int(starts[frame]), int(starts[frame + 1]))
        if part.stop > part.start:
            marker_of_point[part] = model.update(points.cloud.points[part], points.tracks[part], 1, spacing)
        if count % 100 == 0:
            monitor.advance(count, len(frames))
    return marker_of_point


def _n_explained(points: FollowedPoints, marker_of_point: Ints, skeleton: Skeleton, gates: Floats) -> int:
    """Number of positions at their places in some frames."""
    frames = spread_frames(points.cloud.n_frames, EVIDENCE_FRAMES)
    positions = points.positions(marker_of_point, len(skeleton.limb_of_marker))[frames]
    if np.isnan(positions[:, :, 0]).all():
        return 0
    off = positions - pose_skeleton(skeleton, positions).markers(skeleton)
    return int((np.linalg.norm(off, axis=2) < gates).sum())


def pose_and_reassign(
    points: FollowedPoints, marker_of_point: Ints, skeleton: Skeleton, monitor: Monitor = SILENT
) -> tuple[Ints, SkeletonPoses]:
    """Keep points that are at their marker's place, give others to markers whose place they are at, and pose again.

    A track that is at a marker's place now and then is tried as that marker in all its frames, which turns a limb that
    few markers hold to where it belongs.

    Parameters
    ----------
    points, skeleton, monitor
        As `match_points`.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    gates = gates_of(skeleton)
    marker_of_point, poses = _refined(points, marker_of_point, skeleton, gates, monitor)
    n_markers = len(skeleton.limb_of_marker)
    tried = filled_labels(
        points.cloud, [marker_of_point, by_track_votes(points, [marker_of_point], n_markers)], n_markers
    )
    if not np.array_equal(marker_of_point, tried):
        other, poses_of_other = _refined(points, tried, skeleton, gates, monitor)
        if (other >= 0).sum() > (marker_of_point >= 0).sum():
            marker_of_point, poses = other, poses_of_other
    return _with_rest_of_tracks(points, marker_of_point, poses.markers(skeleton)), poses


def _with_rest_of_tracks(points: FollowedPoints, marker_of_point: Ints, predicted: Floats) -> Ints:
    """Give a marker what its track shows in between: skin may move farther than in the calibrated take.

    The track is at the marker's place in most of its frames, and no farther from it than half the points' spacing.
    """
    if (marker_of_point < 0).all():
        return marker_of_point
    n_markers = predicted.shape[1]
    most = by_track_votes(points, [marker_of_point], n_markers)
    own = np.maximum(most, 0)
    agreed = _most_agree(points, (marker_of_point == most) & (most >= 0), points.tracks >= 0)
    away = np.linalg.norm(points.cloud.points - predicted[points.frames, own], axis=1)
    near = agreed & (away < typical_spacing(points.cloud) / 2)
    return filled_labels(points.cloud, [marker_of_point, np.where(near, most, -1)], n_markers)


def _most_agree(points: FollowedPoints, agreeing: Bools, among: Bools) -> Bools:
    """Whether more than `HELD_SHARE` of the points of its track that are among others agree, for each point."""
    tracks = np.maximum(points.tracks, 0)
    agreed, every = (np.bincount(tracks, some & (points.tracks >= 0)) for some in (agreeing & among, among))
    return np.asarray((agreed > HELD_SHARE * every)[tracks])


def with_whole_tracks(points: FollowedPoints, marker_of_point: Ints, n_markers: int) -> Ints:
    """Return labels whose tracks are that marker's from end to end which most of their points with any are.

    A pose tells frame by frame, and in some it is off: a marker is left out there, or taken for the next one. Tracks
    stay as they are where another one of the marker is seen meanwhile.

    Parameters
    ----------
    points : FollowedPoints
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    n_markers : int
        Number of markers.
    """
    voted = by_track_votes(points, [marker_of_point], n_markers)
    agreed = _most_agree(points, marker_of_point == voted, marker_of_point >= 0)
    return filled_labels(points.cloud, [np.where(agreed, voted, -1), marker_of_point], n_markers)


def _refined(
    points: FollowedPoints, marker_of_point: Ints, skeleton: Skeleton, gates: Floats, monitor: Monitor
) -> tuple[Ints, SkeletonPoses]:
    """Assign points to markers and pose, again and again, until nothing changes."""
    n_markers = len(skeleton.limb_of_marker)
    if (marker_of_point < 0).all():
        return marker_of_point, pose_skeleton(skeleton, points.positions(marker_of_point, n_markers)[:0])
    poses = pose_skeleton(skeleton, points.positions(marker_of_point, n_markers), monitor=monitor)
    for _ in range(ROUNDS):
        before, marker_of_point = marker_of_point, _reassigned(points, marker_of_point, poses.markers(skeleton), gates)
        if (marker_of_point < 0).all() or np.array_equal(before, marker_of_point):
            break
        poses = pose_skeleton(skeleton, points.positions(marker_of_point, n_markers), monitor=monitor)
    return marker_of_point, poses


def _reassigned(points: FollowedPoints, marker_of_point: Ints, predicted: Floats, gates: Floats) -> Ints:
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    own = np.maximum(marker_of_point, 0)
    away = np.linalg.norm(points.cloud.points - predicted[points.frames, own], axis=1)
    kept = np.where((marker_of_point >= 0) & (away < gates[own]), marker_of_point, -1)
    free = np.flatnonzero((kept < 0) & (points.tracks >= 0))
    taken = np.zeros(predicted.shape[:2], dtype=np.bool_)
    taken[points.frames[kept >= 0], kept[kept >= 0]] = True
    for some in (free[of_frame] for of_frame in rows_of_each(points.frames[free])):
        frame = int(points.frames[some[0]])
        markers = np.flatnonzero(~taken[frame] & ~np.isnan(predicted[frame, :, 0]))
        apart = np.linalg.norm(points.cloud.points[some, np.newaxis] - predicted[frame, markers], axis=2)
        apart /= gates[markers]
        rows, columns = linear_sum_assignment(np.minimum(apart, 1.0))
        near = apart[rows, columns] < 1.0
        kept[some[rows[near]]] = markers[columns[near]]
    return kept


def n_carried(skeleton: Skeleton) -> int:
    """Return how many markers limbs carry."""
    return int((skeleton.limb_of_marker >= 0).sum())


def by_track_votes(points: FollowedPoints, owners: Iterable[Ints], n_markers: int) -> Ints:
    """Return the marker of each point by the votes of all frames of its track.

    Each frame in which a point of a track was taken for a marker is a vote. Pairs of tracks and markers are joined,
    most votes first, unless a track of the marker is seen in the same frames.

    Parameters
    ----------
    points : FollowedPoints
        The take.
    owners : iterable of ndarray of intp, shape (n_points,)
        Markers of the points, -1 for none, from each way of following them.
    n_markers : int
        Number of markers.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for points on no track, or on one without a marker.
    """
    order = np.flatnonzero(points.tracks >= 0)
    n_tracks = int(points.tracks.max(initial=0)) + 1
    votes = np.zeros((n_tracks, n_markers), dtype=np.intp)
    for marker_of_point in owners:
        voting = order[marker_of_point[order] >= 0]
        np.add.at(votes, (points.tracks[voting], marker_of_point[voting]), 1)
    by_track = order[np.argsort(points.tracks[order], kind="stable")]
    ends = np.cumsum(np.bincount(points.tracks[by_track], minlength=n_tracks))
    frames_of = np.split(points.frames[by_track], ends[:-1])
    taken = np.zeros((n_markers, points.cloud.n_frames), dtype=np.bool_)
    marker_of_track = np.full(n_tracks, -1, dtype=np.intp)
    tracks, markers = np.nonzero(votes)
    for pair in np.argsort(-votes[tracks, markers], kind="stable").tolist():
        track, marker = tracks[pair], markers[pair]
        if marker_of_track[track] < 0 and not taken[marker, frames_of[track]].any():
            marker_of_track[track] = marker
            taken[marker, frames_of[track]] = True
    return np.where(points.tracks >= 0, marker_of_track[points.tracks], -1)
