"""Label quality: confidence, doubtful spans with their reasons, tracklets and their markers, points left out."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from skelgen.model import PointCloud, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, runs_of_equal
from skelgen.model.labelling import Agreement, Doubt, Finding, Labelling, Tracklets, seen_runs
from skelgen.stages.labels.confidence.identity import (
    CORRELATED_SECONDS,
    LABELS_FOUND,
    IdentityConfidence,
    identity_confidence,
)
from skelgen.stages.labels.point_labels import LONG_BLOCK_FRAMES, Block, blocks_of

CLASSIC_METHOD = "sets"
"""The method of the labels stage that is the thesis' own."""

DOUBTFUL = 0.9
"""Confidence below which a marker is doubtful."""

ENOUGH_MATES = 3
"""Mates whose distances fix a point in space."""


@dataclass(frozen=True, eq=False)
class PointLabels:
    """Which marker each point of a take became, and how.

    Attributes
    ----------
    cloud : PointCloud
        The points as they were labelled.
    track_of_point : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker that each point became, -1 for none.
    classic : ndarray of intp, shape (n_points,), or None
        Marker of each point by the classic method, -1 for none, where it was compared.
    stated : ndarray of bool, shape (n_points,), or None
        Points whose marker the user has stated.
    """

    cloud: PointCloud
    track_of_point: Ints
    marker_of_point: Ints
    classic: Ints | None = None
    stated: Bools | None = None


@dataclass(frozen=True, eq=False)
class LabelHistory:
    """What label quality needs of how points became markers; small, whatever the number of points.

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
    classic : Agreement or None
        What the classic method gave.
    """

    changes: Bools
    stated: Bools | None
    left_out: Ints
    tracklets: Tracklets
    classic: Agreement | None


def history_of(points: PointLabels, n_markers: int) -> LabelHistory:
    """Gather what label quality needs, so that the points may be released.

    Parameters
    ----------
    points : PointLabels
        Which marker each point became.
    n_markers : int
        Number of markers.
    """
    changes = np.zeros((points.cloud.n_frames, n_markers), dtype=np.bool_)
    stated = None if points.stated is None else np.zeros_like(changes)
    left_out = np.zeros(points.cloud.n_frames, dtype=np.intp)
    parts = []
    for block in blocks_of(points.cloud, LONG_BLOCK_FRAMES):
        frames = slice(block.first, block.first + block.n_frames)
        marker = points.marker_of_point[block.points]
        track = points.track_of_point[block.points]
        changes[frames] = _track_changes(block, marker, track, n_markers)
        if points.stated is not None and stated is not None:
            sure = points.stated[block.points] & (marker >= 0)
            stated[block.first + block.frames[sure], marker[sure]] = True
        left_out[frames] = np.bincount(block.frames[marker < 0], minlength=block.n_frames)
        parts.append(_parts(track, marker, block.frames + block.first, block.points.start))
    agreement = None if points.classic is None else _agreement(points.classic, points.marker_of_point, n_markers)
    return LabelHistory(changes, stated, left_out, _tracklets_of_parts(points.cloud, parts), agreement)


def labelling_of_cloud(trajectories: Trajectories, history: LabelHistory) -> Labelling:
    """Compute the label quality of markers that were found in an unlabelled take.

    Parameters
    ----------
    trajectories : Trajectories
        The markers; each position is that of a point.
    history : LabelHistory
        How points became markers.
    """
    certainty = identity_confidence(trajectories, history.changes, history.stated, LABELS_FOUND)
    spans = doubtful_spans(trajectories, certainty)
    return Labelling(certainty.confidence, spans, certainty.twins, history.left_out, history.tracklets, history.classic)


def labelling_of_markers(trajectories: Trajectories, file: Trajectories, findings: Iterable[Finding] = ()) -> Labelling:
    """Compute the label quality of markers that came with labels.

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
    doubts = (*_repaired_spans(file, trajectories, certainty.confidence), *doubtful_spans(trajectories, certainty))
    nothing = np.zeros(trajectories.n_frames, dtype=np.intp)
    ordered = tuple(sorted(doubts, key=lambda doubt: doubt.first_frame))
    return Labelling(certainty.confidence, ordered, certainty.twins, nothing, findings=tuple(findings))


def _track_changes(block: Block, marker: Ints, track: Ints, n_markers: int) -> Bools:
    """Frames in which a marker's point is of another track than in the frame before, shape (n_frames, n_markers)."""
    followed = np.full((block.n_frames, n_markers), -1, dtype=np.intp)
    used = marker >= 0
    followed[block.frames[used], marker[used]] = track[used]
    seen = np.zeros(followed.shape, dtype=np.bool_)
    seen[block.frames[used], marker[used]] = True
    changes = np.zeros(followed.shape, dtype=np.bool_)  # unknown where two blocks meet: False
    changes[1:] = seen[1:] & ((followed[1:] != followed[:-1]) | (followed[1:] < 0))
    return changes


def _parts(track: Ints, marker_of_point: Ints, frame_of_point: Ints, n_before: int) -> Ints:
    """Track, marker, first and last frame, number of points and first point of each part, shape (6, n_parts)."""
    order = np.argsort(track, kind="stable")
    order = order[track[order] >= 0]
    track, marker, frame = track[order], marker_of_point[order], frame_of_point[order]
    starts, ends = runs_of_equal(track, marker)
    return np.stack(
        [track[starts], marker[starts], frame[starts], frame[ends], ends - starts + 1, order[starts] + n_before]
    )


def _tracklets_of_parts(cloud: PointCloud, parts: list[Ints]) -> Tracklets:
    """Put the parts of successive frames together; those of one track and marker become one."""
    found = np.concatenate(parts, axis=1) if parts else np.empty((6, 0), dtype=np.intp)
    track, marker, first, last, n_points, point = found[:, np.lexsort((found[2], found[0]))]
    starts, ends = runs_of_equal(track, marker)
    numbered = np.unique(track[starts], return_inverse=True)[1].reshape(-1)
    first, point = first[starts], point[starts]
    counts = np.add.reduceat(n_points, starts) if len(starts) else n_points
    index = point - cloud.frame_starts[first]
    return Tracklets(numbered, marker[starts], first, last[ends], counts, index, cloud.points[point])


def _agreement(classic: Ints, found: Ints, n_markers: int) -> Agreement:
    """Compare with what the classic method gave."""
    from scipy.optimize import linear_sum_assignment  # noqa: PLC0415 - heavy

    n_theirs = int(classic.max(initial=-1)) + 1
    both = (classic >= 0) & (found >= 0)
    counts = np.bincount(classic[both] * n_markers + found[both], minlength=n_theirs * n_markers)
    counts = counts.reshape(n_theirs, n_markers)
    same = int(counts[linear_sum_assignment(counts, maximize=True)].sum())
    either = int(((classic >= 0) | (found >= 0)).sum())
    return Agreement(CLASSIC_METHOD, n_theirs, int((classic >= 0).sum()), same / max(either, 1))


def doubtful_spans(trajectories: Trajectories, certainty: IdentityConfidence) -> tuple[Doubt, ...]:
    """List the spans in which confidence is low, in the order of their first frames.

    Spans of one marker are joined where it is trusted for less than a tenth of a second between them.

    Parameters
    ----------
    trajectories : Trajectories
        The markers.
    certainty : IdentityConfidence
        How sure they are.
    """
    low: Bools = certainty.confidence < DOUBTFUL
    trusted = trajectories.seen & ~low
    bridged = max(1, round(CORRELATED_SECONDS * trajectories.rate))
    spans = zip(*(values.tolist() for values in _joined(low, trusted, bridged)), strict=True)
    doubts = [_doubt(trajectories, certainty, marker, first, last) for marker, first, last in spans]
    return tuple(sorted(doubts, key=lambda doubt: (doubt.first_frame, doubt.marker)))


def _repaired_spans(file: Trajectories, repaired: Trajectories, confidence: Floats) -> tuple[Doubt, ...]:
    """List the spans in which markers carry other positions than in the file.

    Parameters
    ----------
    file : Trajectories
        As it was read.
    repaired : Trajectories
        With labels exchanged back.
    confidence : ndarray, shape (n_frames, n_markers)
        Of the repaired markers.
    """
    if repaired is file or repaired.names[: file.n_markers] != file.names:
        return ()
    same = slice(file.n_markers)  # slipped markers that were split stand behind them
    changed = repaired.seen[:, same] & (repaired.positions[:, same] != file.positions).any(axis=2)
    doubts = []
    for marker, first, last in zip(*(values.tolist() for values in seen_runs(changed)), strict=True):
        here = (file.positions[first] == repaired.positions[first, marker]).all(axis=1)
        rival = int(here.argmax()) if here.any() else -1
        was = f"was called {file.names[rival]} in the file" if rival >= 0 else "is not in the file"
        least = float(confidence[first : last + 1, marker].min())
        reason = f"{file.names[marker]} {was}: the label was given back"
        doubts.append(Doubt(marker, first, last, "repaired", rival, least, reason))
    return tuple(doubts)


def _joined(low: Bools, trusted: Bools, bridged: int) -> tuple[Ints, Ints, Ints]:
    """Runs of low confidence, joined over few trusted frames: marker, first and last frame."""
    marker, first, last = seen_runs(low)
    if not len(marker):
        return marker, first, last
    sums = np.cumsum(trusted, axis=0, dtype=np.int32)
    between: Ints = sums[first[1:], marker[1:]] - sums[last[:-1], marker[1:]]
    new = np.concatenate([[True], (marker[1:] != marker[:-1]) | (between > bridged)])
    starts = np.flatnonzero(new)
    return marker[starts], first[starts], last[np.append(starts[1:], len(marker)) - 1]


def _doubt(trajectories: Trajectories, certainty: IdentityConfidence, marker: int, first: int, last: int) -> Doubt:
    span = slice(first, last + 1)
    confidence = certainty.confidence[span, marker]
    low = confidence < DOUBTFUL
    kind, rival = _cause(certainty, marker, span, low)
    names = trajectories.names
    own, other = names[marker], names[rival] if rival >= 0 else ""
    mates = int(np.median(certainty.n_mates[span, marker][low]))
    few = ("none", "only one", "only two")[mates] if mates < ENOUGH_MATES else str(mates)
    share = 1.0 - np.isnan(trajectories.positions[:, marker, 0]).mean()
    reason = {
        "piece": f"{own} lies where {other} belongs and is not seen together with it: the two may be one marker",
        "alone": f"{own} is seen too little to know its distance to any other marker",
        "rare": f"{own} is seen in {100 * share:.0f} % of the frames only: it may be a piece of another one",
        "rival": f"the distances of {own} to others fit {other} at least as well, or nearly",
        "misfit": f"the distances of {own} to others are not what they usually are",
        "unsupported": f"{few} of the markers beside {own} are seen, and it was lost before",
    }[kind]
    return Doubt(marker, first, last, kind, rival, float(np.nanmin(confidence)), reason)


def _cause(certainty: IdentityConfidence, marker: int, span: slice, low: Bools) -> tuple[str, int]:
    """Why confidence is low, and the marker that it may be instead."""
    if certainty.original[marker] >= 0:
        return "piece", int(certainty.original[marker])
    if certainty.alone[marker]:
        return "alone", -1
    if certainty.rare[marker]:
        return "rare", -1
    evidence, rivals = certainty.evidence[span, marker][low], certainty.rival[span, marker][low]
    against = evidence < 0
    named, counts = np.unique(rivals[against] if against.any() else rivals, return_counts=True)
    rival = int(named[counts.argmax()])
    if not against.any() and np.median(certainty.n_mates[span, marker][low]) < ENOUGH_MATES:
        return "unsupported", -1
    return ("misfit", -1) if rival < 0 else ("rival", rival)
