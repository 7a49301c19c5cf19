"""Tracks vote for markers: every point of a track counts for the markers whose predicted places explain it."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats, Ints

Scores = NDArray[np.floating[Any]]
"""How well markers explain points; short numbers do."""

CHUNK_PAIRS = 100_000
"""Distances between points and markers held at once: less than 1 MB, which the processor keeps at hand."""

FAR = 1e15
"""mm; where a marker is put whose place is not known: its square is still a number."""

PERSISTENT = 7
"""Frames for which another marker must explain a track better before the track is cut."""


def point_scores(points: Floats, frames: Ints, predicted: Floats, gates: Floats) -> Scores:
    """How well each marker explains each point, 1 - (distance / gate)^2, 0 outside the gate.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Measured points.
    frames : ndarray of intp, shape (n_points,)
        Frame of each.
    predicted : ndarray, shape (n_frames, n_markers, 3), mm
        Where markers must be; NaN where nothing is known.
    gates : ndarray, shape (n_frames, n_markers), mm
        Largest distances that are explained, above 0.

    Returns
    -------
    ndarray of float32, shape (n_points, n_markers)
    """
    n_markers = predicted.shape[1]
    scores = np.zeros((len(points), n_markers), dtype=np.float32)
    if not len(points) or not n_markers:
        return scores
    places = np.where(np.isnan(predicted), FAR, predicted).transpose(2, 0, 1).copy()
    factor = -1.0 / gates**2
    step = max(1, CHUNK_PAIRS // n_markers)
    for start in range(0, len(points), step):
        part = slice(start, start + step)
        squares = np.zeros((len(points[part]), n_markers))
        for axis in range(3):
            offset = places[axis].take(frames[part], axis=0)
            offset -= points[part, axis, np.newaxis]
            offset *= offset
            squares += offset
        squares *= factor.take(frames[part], axis=0)
        squares += 1.0
        np.maximum(squares, 0.0, out=scores[part], casting="same_kind")
    return scores


def split_where_marker_changes(owner: Ints, scores: Scores) -> Ints:
    """Cut tracks at which one marker stops to explain the points and another begins to.

    Parameters
    ----------
    owner : ndarray of intp, shape (n_points,)
        Track of each point in order of frames, -1 for none.
    scores : ndarray, shape (n_points, n_markers)
        From `point_scores`.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Finer tracks, numbered from 0; -1 for points of none.
    """
    best = scores.argmax(axis=1)
    best[np.take_along_axis(scores, best[:, np.newaxis], axis=1)[:, 0] <= 0.0] = -1
    order = np.argsort(owner, kind="stable")
    order = order[owner[order] >= 0]
    pieces = np.full(len(owner), -1, dtype=np.intp)
    if not len(order):
        return pieces
    track, voted = owner[order], best[order]
    heard = np.flatnonzero(voted >= 0)
    steady = _steady(track[heard], voted[heard])
    held = _carried(track, heard, steady)
    new = np.ones(len(order), dtype=bool)
    new[1:] = (track[1:] != track[:-1]) | (held[1:] != held[:-1])
    pieces[order] = np.cumsum(new) - 1
    return pieces


def _steady(track: Ints, voted: Ints) -> Ints:
    """Votes of a track in order, runs shorter than `PERSISTENT` replaced by the run before (or after, at the start)."""
    if not len(voted):
        return voted
    starts = np.flatnonzero(np.concatenate([[True], (track[1:] != track[:-1]) | (voted[1:] != voted[:-1])]))
    lengths = np.diff(np.concatenate([starts, [len(voted)]]))
    owner, values, is_short = track[starts].tolist(), voted[starts].tolist(), (lengths < PERSISTENT).tolist()
    for run in range(1, len(starts)):
        if is_short[run] and owner[run - 1] == owner[run]:
            values[run] = values[run - 1]
    for run in range(len(starts) - 2, -1, -1):
        is_first = run == 0 or owner[run - 1] != owner[run]
        if is_short[run] and is_first and owner[run + 1] == owner[run]:
            values[run] = values[run + 1]
    return np.repeat(np.array(values, dtype=np.intp), lengths)


def _carried(track: Ints, heard: Ints, steady: Ints) -> Ints:
    """The steady vote at every point of a track: that of the last point that voted, or of the next one at the start."""
    held = np.full(len(track), -1, dtype=np.intp)
    if not len(heard):
        return held
    index = np.searchsorted(heard, np.arange(len(track)), side="right") - 1
    before = np.clip(index, 0, len(heard) - 1)
    after = np.clip(index + 1, 0, len(heard) - 1)
    use = np.where((index >= 0) & (track[heard[before]] == track), before, after)
    same = track[heard[use]] == track
    held[same] = steady[use[same]]
    return held


def assign_tracks(pieces: Ints, frames: Ints, scores: Scores, n_frames: int) -> Ints:
    """Give tracks to markers, the best explained first; a marker has one point in a frame.

    Parameters
    ----------
    pieces : ndarray of intp, shape (n_points,)
        Track of each point, -1 for none.
    frames : ndarray of intp, shape (n_points,)
        Frame of each point.
    scores : ndarray, shape (n_points, n_markers)
        From `point_scores`.
    n_frames : int
        Number of frames.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """
    n_pieces = int(pieces.max(initial=-1)) + 1
    marker_of_point = np.full(len(pieces), -1, dtype=np.intp)
    if n_pieces == 0:
        return marker_of_point
    order = np.argsort(pieces, kind="stable")[int((pieces < 0).sum()) :]
    starts = np.searchsorted(pieces[order], np.arange(n_pieces + 1))
    votes = np.stack([scores[order[start:end]].sum(axis=0) for start, end in itertools.pairwise(starts)])
    taken = np.zeros((n_frames, scores.shape[1]), dtype=bool)
    candidates = np.argwhere(votes > 0)
    ranking = np.argsort(-votes[votes > 0], kind="stable")
    placed = np.zeros(n_pieces, dtype=bool)
    for piece, marker in candidates[ranking].tolist():
        if placed[piece]:
            continue
        members = order[starts[piece] : starts[piece + 1]]
        clash = taken[frames[members], marker]
        if clash.mean() > 0.5:
            continue
        kept = members[~clash]
        marker_of_point[kept] = marker
        taken[frames[kept], marker] = True
        placed[piece] = True
    return marker_of_point


def fill_single_points(marker_of_point: Ints, frames: Ints, scores: Scores, n_frames: int) -> Ints:
    """Give points that no track brought to the markers that explain them and have none, the best first."""
    result = marker_of_point.copy()
    taken = np.zeros((n_frames, scores.shape[1]), dtype=bool)
    owned = result >= 0
    taken[frames[owned], result[owned]] = True
    free = np.flatnonzero(~owned)
    rows, markers = np.nonzero(scores[free] > 0)
    ranking = np.argsort(-scores[free[rows], markers], kind="stable")
    for row, marker in zip(free[rows[ranking]].tolist(), markers[ranking].tolist(), strict=True):
        if result[row] < 0 and not taken[frames[row], marker]:
            result[row] = marker
            taken[frames[row], marker] = True
    return result
