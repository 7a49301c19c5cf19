"""Doubtful spans: where the confidence in a marker is low, why, and where labels of the file were changed."""

from __future__ import annotations

import numpy as np

from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.labelling import Doubt, seen_runs
from skelgen.stages.labels.confidence import CORRELATED_SECONDS, Certainty

DOUBTFUL = 0.9
"""Confidence below which a marker is doubtful."""

ENOUGH_MATES = 3
"""Mates whose distances fix a point in space."""


def doubtful_spans(trajectories: Trajectories, certainty: Certainty) -> tuple[Doubt, ...]:
    """List the spans in which confidence is low, in the order of their first frames.

    Spans of one marker are joined where it is trusted for less than a tenth of a second between them.

    Parameters
    ----------
    trajectories : Trajectories
        The markers.
    certainty : Certainty
        What is known of them.
    """
    low: Bools = certainty.confidence < DOUBTFUL
    trusted = trajectories.seen & ~low
    bridged = max(1, round(CORRELATED_SECONDS * trajectories.rate))
    spans = zip(*(values.tolist() for values in _joined(low, trusted, bridged)), strict=True)
    doubts = [_doubt(trajectories, certainty, marker, first, last) for marker, first, last in spans]
    return tuple(sorted(doubts, key=lambda doubt: (doubt.first_frame, doubt.marker)))


def repaired_spans(file: Trajectories, repaired: Trajectories, confidence: Floats) -> tuple[Doubt, ...]:
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


def _doubt(trajectories: Trajectories, certainty: Certainty, marker: int, first: int, last: int) -> Doubt:
    span = slice(first, last + 1)
    confidence = certainty.confidence[span, marker]
    low = confidence < DOUBTFUL
    kind, rival = _cause(certainty, marker, span, low)
    names = trajectories.names
    own, other = names[marker], names[rival] if rival >= 0 else ""
    mates = int(np.median(certainty.n_mates[span, marker][low]))
    share = 1.0 - np.isnan(trajectories.positions[:, marker, 0]).mean()
    reason = {
        "piece": f"{own} lies where {other} belongs and is not seen together with it: the two may be one marker",
        "alone": f"{own} is seen too little to know its distance to any other marker",
        "rare": f"{own} is seen in {100 * share:.0f} % of the frames only: it may be a piece of another one",
        "rival": f"the distances of {own} to others fit {other} at least as well, or nearly",
        "misfit": f"the distances of {own} to others are not what they usually are",
        "unsupported": f"{_beside(mates)} of the markers beside {own} are seen, and it was lost before",
    }[kind]
    return Doubt(marker, first, last, kind, rival, float(np.nanmin(confidence)), reason)


def _cause(certainty: Certainty, marker: int, span: slice, low: Bools) -> tuple[str, int]:
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


def _beside(count: int) -> str:
    return ("none", "only one", "only two")[count] if count < ENOUGH_MATES else str(count)
