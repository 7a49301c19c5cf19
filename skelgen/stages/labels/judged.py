"""The account of a labelling: confidence, doubtful spans, tracklets and where they went, points that are left out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.labelling import Agreement, Labelling, Tracklets
from skelgen.stages.labels.confidence import identity_confidence
from skelgen.stages.labels.doubts import doubtful_spans, repaired_spans

SEED_METHOD = "sets"
"""The method of the labels stage that is the seed's own."""

_MIXERS = tuple(np.uint64(value) for value in (0x9E3779B97F4A7C15, 0xC2B2AE3D27D4EB4F, 0x165667B19E3779F9))
"""Odd numbers that scatter the bits of coordinates over a key."""

_FRAME_MIXER = np.uint64(0xD6E8FEB86659FD93)


@dataclass(frozen=True, eq=False)
class Origin:
    """What labelled markers were made of.

    Attributes
    ----------
    cloud : PointCloud
        The points as they were labelled.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    by_sets : Trajectories or None
        What the seed's method gave, where another one came after it.
    stated : ndarray of bool, shape (n_points,), or None
        Points whose marker the user has stated.
    """

    cloud: PointCloud
    owner: Ints
    by_sets: Trajectories | None
    stated: Bools | None = None


def labelling_of_cloud(cloud: PointCloud, trajectories: Trajectories, origin: Origin) -> Labelling:
    """Judge markers that were found in an unlabelled take.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    trajectories : Trajectories
        The markers; each position is that of a point.
    origin : Origin
        What they were made of.
    """
    marker_of_point = find_points(origin.cloud, trajectories.positions)
    changes = _track_changes(origin, marker_of_point, trajectories.seen)
    certainty = identity_confidence(trajectories, changes, _stated(origin, marker_of_point, trajectories.seen))
    left_out = np.maximum(cloud.points_per_frame - trajectories.seen.sum(axis=1), 0)
    return Labelling(
        certainty.confidence,
        doubtful_spans(trajectories, certainty),
        certainty.twins,
        left_out,
        tracklets_of(origin.cloud, origin.owner, marker_of_point),
        _agreement(origin, marker_of_point) if origin.by_sets is not None else None,
    )


def labelling_of_markers(trajectories: Trajectories, file: Trajectories) -> Labelling:
    """Judge markers that came with labels.

    Parameters
    ----------
    trajectories : Trajectories
        The markers, perhaps repaired.
    file : Trajectories
        As they were read.
    """
    certainty = identity_confidence(trajectories)
    doubts = (*repaired_spans(file, trajectories, certainty.confidence), *doubtful_spans(trajectories, certainty))
    nothing = np.zeros(trajectories.n_frames, dtype=np.intp)
    ordered = tuple(sorted(doubts, key=lambda doubt: doubt.first_frame))
    return Labelling(certainty.confidence, ordered, certainty.twins, nothing)


def _track_changes(origin: Origin, marker_of_point: Ints, seen: Bools) -> Bools:
    """Frames in which a marker's point is of another track than in the frame before, shape (n_frames, n_markers)."""
    track = np.full(seen.shape, -1, dtype=np.intp)
    frame_of_point = np.repeat(np.arange(origin.cloud.n_frames), origin.cloud.points_per_frame)
    used = marker_of_point >= 0
    track[frame_of_point[used], marker_of_point[used]] = origin.owner[used]
    changes = np.zeros(seen.shape, dtype=np.bool_)
    changes[1:] = seen[1:] & ((track[1:] != track[:-1]) | (track[1:] < 0))
    return changes


def _stated(origin: Origin, marker_of_point: Ints, seen: Bools) -> Bools:
    """Frames in which the user has stated that a point is the marker, shape (n_frames, n_markers)."""
    result = np.zeros(seen.shape, dtype=np.bool_)
    if origin.stated is not None:
        frame_of_point = np.repeat(np.arange(origin.cloud.n_frames), origin.cloud.points_per_frame)
        told = origin.stated & (marker_of_point >= 0)
        result[frame_of_point[told], marker_of_point[told]] = True
    return result


def find_points(cloud: PointCloud, positions: Floats) -> Ints:
    """Find which marker each point became, from positions that are exactly those of points.

    Parameters
    ----------
    cloud : PointCloud
        The points.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Of the markers, NaN where unseen.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        -1 for points that are no marker's.
    """
    frame, marker = np.nonzero(~np.isnan(positions[:, :, 0]))
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    wanted = _keys(frame, positions[frame, marker])
    keys = _keys(frame_of_point, cloud.points)
    order = np.argsort(keys, kind="stable")
    turn = np.argsort(wanted, kind="stable")
    place = np.searchsorted(keys[order], wanted[turn]) + _occurrence(wanted[turn])
    found = place < len(keys)
    point = order[np.minimum(place, len(keys) - 1)] if len(keys) else place
    if len(keys):
        found &= keys[point] == wanted[turn]
    marker_of_point = np.full(cloud.n_points, -1, dtype=np.intp)
    marker_of_point[point[found]] = marker[turn][found]
    return marker_of_point


def _keys(frames: Ints, points: Floats) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    """One number for each point of each frame; equal numbers mean equal points, but for one case in 2^64."""
    bits = np.ascontiguousarray(points + 0.0).view(np.uint64)  # + 0.0: minus zero is zero
    key = frames.astype(np.uint64) * _FRAME_MIXER
    for axis, mixer in enumerate(_MIXERS):
        key = (key ^ bits[:, axis]) * mixer
        key ^= key >> np.uint64(29)
    return key


def _occurrence(ordered: np.ndarray[tuple[int], np.dtype[np.uint64]]) -> Ints:
    """How many equal values stand before each one of a sorted array."""
    new = np.concatenate([[True], ordered[1:] != ordered[:-1]])[: len(ordered)]
    starts = np.flatnonzero(new)
    return np.asarray(np.arange(len(ordered)) - starts[np.cumsum(new) - 1]) if len(ordered) else np.empty(0, np.intp)


def tracklets_of(cloud: PointCloud, owner: Ints, marker_of_point: Ints) -> Tracklets:
    """Cut tracks into the parts that went to one marker each."""
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    order = np.argsort(owner, kind="stable")
    order = order[owner[order] >= 0]
    track, marker, frame = owner[order], marker_of_point[order], frame_of_point[order]
    new = np.ones(len(order), dtype=np.bool_)
    new[1:] = (track[1:] != track[:-1]) | (marker[1:] != marker[:-1])
    starts = np.flatnonzero(new)
    ends = np.append(starts[1:], len(order)) - 1 if len(starts) else starts
    numbered = np.unique(track[starts], return_inverse=True)[1].reshape(-1)
    return Tracklets(numbered, marker[starts], frame[starts], frame[ends], ends - starts + 1)


def _agreement(origin: Origin, marker_of_point: Ints) -> Agreement | None:
    """Compare with what the seed's method gave."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    if origin.by_sets is None:
        return None
    theirs = find_points(origin.cloud, origin.by_sets.positions)
    n_markers = origin.by_sets.n_markers
    both = (theirs >= 0) & (marker_of_point >= 0)
    counts = np.zeros((n_markers, int(marker_of_point.max(initial=-1)) + 1), dtype=np.intp)
    np.add.at(counts, (theirs[both], marker_of_point[both]), 1)
    same = int(counts[linear_sum_assignment(counts, maximize=True)].sum())
    either = int(((theirs >= 0) | (marker_of_point >= 0)).sum())
    return Agreement(SEED_METHOD, n_markers, int((theirs >= 0).sum()), same / max(either, 1))
