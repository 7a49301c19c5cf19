"""The account of a labelling: confidence, doubtful spans, tracklets and where they went, points that are left out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Bools, Ints
from skelgen.model.labelling import Agreement, Finding, Labelling, Tracklets
from skelgen.stages.labels.blocks import LONG_BLOCK_FRAMES, Block, blocks_of
from skelgen.stages.labels.confidence import LABELS_FOUND, identity_confidence
from skelgen.stages.labels.doubts import doubtful_spans, repaired_spans

SEED_METHOD = "sets"
"""The method of the labels stage that is the seed's own."""


@dataclass(frozen=True, eq=False)
class Origin:
    """What labelled markers were made of.

    Attributes
    ----------
    cloud : PointCloud
        The points as they were labelled.
    owner : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker that each point became, -1 for none.
    by_sets : ndarray of intp, shape (n_points,), or None
        Marker of each point by the seed's method, -1 for none, where another method came after it.
    stated : ndarray of bool, shape (n_points,), or None
        Points whose marker the user has stated.
    """

    cloud: PointCloud
    owner: Ints
    marker_of_point: Ints
    by_sets: Ints | None = None
    stated: Bools | None = None


@dataclass(frozen=True, eq=False)
class History:
    """What the account needs of how points became markers; small, whatever the number of points.

    Attributes
    ----------
    changes : ndarray of bool, shape (n_frames, n_markers)
        Frames in which a marker's point is of another track than in the frame before.
    stated : ndarray of bool, shape (n_frames, n_markers), or None
        Frames in which the user says that the marker is the one that it is called.
    left_out : ndarray of intp, shape (n_frames,)
        Points of each frame that became no marker.
    tracklets : Tracklets
        Tracks in the parts that went to one marker each.
    seed_method : Agreement or None
        What the seed's method gave.
    """

    changes: Bools
    stated: Bools | None
    left_out: Ints
    tracklets: Tracklets
    seed_method: Agreement | None


def history_of(origin: Origin, n_markers: int) -> History:
    """Gather what the account needs, so that the points may be forgotten."""
    changes = np.zeros((origin.cloud.n_frames, n_markers), dtype=np.bool_)
    stated = None if origin.stated is None else np.zeros_like(changes)
    left_out = np.zeros(origin.cloud.n_frames, dtype=np.intp)
    parts = []
    for block in blocks_of(origin.cloud, LONG_BLOCK_FRAMES):
        frames = slice(block.first, block.first + block.n_frames)
        marker = origin.marker_of_point[block.points]
        owner = origin.owner[block.points]
        changes[frames] = _track_changes(block, marker, owner, n_markers)
        if origin.stated is not None and stated is not None:
            stated[frames] = _stated(block, marker, origin.stated[block.points], n_markers)
        left_out[frames] = np.bincount(block.frames[marker < 0], minlength=block.n_frames)
        parts.append(_parts(owner, marker, block.frames + block.first))
    agreement = None if origin.by_sets is None else _agreement(origin.by_sets, origin.marker_of_point, n_markers)
    return History(changes, stated, left_out, _joined(parts), agreement)


def labelling_of_cloud(trajectories: Trajectories, history: History) -> Labelling:
    """Judge markers that were found in an unlabelled take.

    Parameters
    ----------
    trajectories : Trajectories
        The markers; each position is that of a point.
    history : History
        How points became markers.
    """
    certainty = identity_confidence(trajectories, history.changes, history.stated, LABELS_FOUND)
    return Labelling(
        certainty.confidence,
        doubtful_spans(trajectories, certainty),
        certainty.twins,
        history.left_out,
        history.tracklets,
        history.seed_method,
    )


def labelling_of_markers(trajectories: Trajectories, file: Trajectories, findings: Iterable[Finding] = ()) -> Labelling:
    """Judge markers that came with labels.

    Parameters
    ----------
    trajectories : Trajectories
        The markers, perhaps repaired.
    file : Trajectories
        As they were read.
    findings : iterable of Finding
        Errors of their labels.
    """
    certainty = identity_confidence(trajectories)
    doubts = (*repaired_spans(file, trajectories, certainty.confidence), *doubtful_spans(trajectories, certainty))
    nothing = np.zeros(trajectories.n_frames, dtype=np.intp)
    ordered = tuple(sorted(doubts, key=lambda doubt: doubt.first_frame))
    return Labelling(certainty.confidence, ordered, certainty.twins, nothing, findings=tuple(findings))


def _track_changes(block: Block, marker: Ints, owner: Ints, n_markers: int) -> Bools:
    """Frames in which a marker's point is of another track than in the frame before, shape (n_frames, n_markers)."""
    track = np.full((block.n_frames, n_markers), -1, dtype=np.intp)
    used = marker >= 0
    track[block.frames[used], marker[used]] = owner[used]
    seen = np.zeros(track.shape, dtype=np.bool_)
    seen[block.frames[used], marker[used]] = True
    changes = np.zeros(track.shape, dtype=np.bool_)  # nothing is said where two blocks meet
    changes[1:] = seen[1:] & ((track[1:] != track[:-1]) | (track[1:] < 0))
    return changes


def _stated(block: Block, marker: Ints, stated: Bools, n_markers: int) -> Bools:
    """Frames in which the user says that the marker is the one that it is called."""
    result = np.zeros((block.n_frames, n_markers), dtype=np.bool_)
    told = stated & (marker >= 0)
    result[block.frames[told], marker[told]] = True
    return result


def tracklets_of(cloud: PointCloud, owner: Ints, marker_of_point: Ints) -> Tracklets:
    """Cut tracks into the parts that went to one marker each."""
    frame_of_point = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    return _joined([_parts(owner, marker_of_point, frame_of_point)])


def _parts(owner: Ints, marker_of_point: Ints, frame_of_point: Ints) -> Ints:
    """Track, marker, first and last frame and number of points of each part, shape (5, n_parts)."""
    order = np.argsort(owner, kind="stable")
    order = order[owner[order] >= 0]
    track, marker, frame = owner[order], marker_of_point[order], frame_of_point[order]
    starts = np.flatnonzero(_begins(track, marker))
    ends = np.append(starts[1:], len(order)) - 1 if len(starts) else starts
    return np.stack([track[starts], marker[starts], frame[starts], frame[ends], ends - starts + 1])


def _joined(parts: list[Ints]) -> Tracklets:
    """Put the parts of successive frames together; those of one track and marker become one."""
    track, marker, first, last, n_points = np.concatenate(parts, axis=1) if parts else np.empty((5, 0), dtype=np.intp)
    order = np.lexsort((first, track))
    track, marker, first, last, n_points = (values[order] for values in (track, marker, first, last, n_points))
    starts = np.flatnonzero(_begins(track, marker))
    if not len(starts):
        return Tracklets(track, marker, first, last, n_points)
    ends = np.append(starts[1:], len(track)) - 1
    numbered = np.unique(track[starts], return_inverse=True)[1].reshape(-1)
    return Tracklets(numbered, marker[starts], first[starts], last[ends], np.add.reduceat(n_points, starts))


def _begins(track: Ints, marker: Ints) -> Bools:
    new = np.ones(len(track), dtype=np.bool_)
    new[1:] = (track[1:] != track[:-1]) | (marker[1:] != marker[:-1])
    return new


def _agreement(by_sets: Ints, found: Ints, n_markers: int) -> Agreement:
    """Compare with what the seed's method gave."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    n_theirs = int(by_sets.max(initial=-1)) + 1
    both = (by_sets >= 0) & (found >= 0)
    counts = np.bincount(by_sets[both] * n_markers + found[both], minlength=n_theirs * n_markers)
    counts = counts.reshape(n_theirs, n_markers)
    same = int(counts[linear_sum_assignment(counts, maximize=True)].sum())
    either = int(((by_sets >= 0) | (found >= 0)).sum())
    return Agreement(SEED_METHOD, n_theirs, int((by_sets >= 0).sum()), same / max(either, 1))
