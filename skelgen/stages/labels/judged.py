"""The account of a labelling: confidence, doubtful spans, tracklets and where they went, points that are left out."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Bools, Ints
from skelgen.model.labelling import Agreement, Finding, Labelling, Tracklets
from skelgen.stages.labels.confidence import LABELS_FOUND, identity_confidence
from skelgen.stages.labels.doubts import doubtful_spans, repaired_spans

SEED_METHOD = "sets"
"""The method of the labels stage that is the seed's own."""

CHUNK_FRAMES = 20_000
"""Frames that are looked at together: bounds the memory for long takes."""


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
class _Portion:
    """Some frames of a take: points with their markers."""

    points: slice
    frames: slice
    frame_of_point: Ints
    marker_of_point: Ints


def labelling_of_cloud(trajectories: Trajectories, origin: Origin) -> Labelling:
    """Judge markers that were found in an unlabelled take.

    Parameters
    ----------
    trajectories : Trajectories
        The markers; each position is that of a point.
    origin : Origin
        What they were made of.
    """
    changes = np.zeros(trajectories.seen.shape, dtype=np.bool_)
    stated = None if origin.stated is None else np.zeros_like(changes)
    parts = []
    for portion in _portions(origin):
        changes[portion.frames] = _track_changes(origin, portion, trajectories.n_markers)
        if origin.stated is not None and stated is not None:
            stated[portion.frames] = _stated(origin.stated, portion, trajectories.n_markers)
        parts.append(_parts(origin.owner[portion.points], portion.marker_of_point, portion.frame_of_point))
    certainty = identity_confidence(trajectories, changes, stated, LABELS_FOUND)
    left_out = np.maximum(origin.cloud.points_per_frame - trajectories.seen.sum(axis=1), 0)
    return Labelling(
        certainty.confidence,
        doubtful_spans(trajectories, certainty),
        certainty.twins,
        left_out,
        _joined(parts),
        _agreement(origin, trajectories) if origin.by_sets is not None else None,
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


def _portions(origin: Origin) -> Iterator[_Portion]:
    cloud = origin.cloud
    for first in range(0, cloud.n_frames, CHUNK_FRAMES):
        frames = slice(first, min(first + CHUNK_FRAMES, cloud.n_frames))
        points = slice(int(cloud.frame_starts[frames.start]), int(cloud.frame_starts[frames.stop]))
        frame_of_point = np.repeat(np.arange(frames.start, frames.stop), cloud.points_per_frame[frames])
        yield _Portion(points, frames, frame_of_point, origin.marker_of_point[points])


def _track_changes(origin: Origin, portion: _Portion, n_markers: int) -> Bools:
    """Frames in which a marker's point is of another track than in the frame before, shape (n_frames, n_markers)."""
    track = np.full((portion.frames.stop - portion.frames.start, n_markers), -1, dtype=np.intp)
    used = portion.marker_of_point >= 0
    rows = portion.frame_of_point[used] - portion.frames.start
    track[rows, portion.marker_of_point[used]] = origin.owner[portion.points][used]
    seen = np.zeros(track.shape, dtype=np.bool_)
    seen[rows, portion.marker_of_point[used]] = True
    changes = np.zeros(track.shape, dtype=np.bool_)  # nothing is said where two portions meet
    changes[1:] = seen[1:] & ((track[1:] != track[:-1]) | (track[1:] < 0))
    return changes


def _stated(stated: Bools, portion: _Portion, n_markers: int) -> Bools:
    """Frames in which the user says that the marker is the one that it is called."""
    result = np.zeros((portion.frames.stop - portion.frames.start, n_markers), dtype=np.bool_)
    told = stated[portion.points] & (portion.marker_of_point >= 0)
    result[portion.frame_of_point[told] - portion.frames.start, portion.marker_of_point[told]] = True
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


def _agreement(origin: Origin, trajectories: Trajectories) -> Agreement | None:
    """Compare with what the seed's method gave."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    if origin.by_sets is None:
        return None
    n_markers = int(origin.by_sets.max(initial=-1)) + 1
    counts = np.zeros((n_markers, trajectories.n_markers), dtype=np.intp)
    either = 0
    for portion in _portions(origin):
        theirs, own = origin.by_sets[portion.points], portion.marker_of_point
        both = (theirs >= 0) & (own >= 0)
        np.add.at(counts, (theirs[both], own[both]), 1)
        either += int(((theirs >= 0) | (own >= 0)).sum())
    same = int(counts[linear_sum_assignment(counts, maximize=True)].sum())
    return Agreement(SEED_METHOD, n_markers, int((origin.by_sets >= 0).sum()), same / max(either, 1))
