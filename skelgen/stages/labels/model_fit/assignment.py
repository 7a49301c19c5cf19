"""Tracks vote for markers: every point of a track counts for the markers whose predicted places explain it."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.model_fit.model import Poses, steadiest_place
from skelgen.stages.labels.point_labels import Block

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


LEAST_FRAMES = 25
"""Frames that must show a track on a limb before its place there counts."""

LEAST_SHARE = 0.03
"""Of all frames that a new marker must be seen in."""

COMMON_FRAMES = 3
"""Two markers that are seen together in more frames are two."""


def same_places(together: Floats, offsets: Floats, limb_of_marker: Ints, limits: Floats) -> Ints:
    """Find markers that have one place on one limb and are never seen together.

    Parameters
    ----------
    together : ndarray, shape (n_markers, n_markers)
        Number of frames in which two markers are seen together.
    offsets : ndarray, shape (n_markers, 3), mm
        Places on the limbs.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker, -1 for none.
    limits : ndarray, shape (n_limbs,), mm
        Places on a limb that are nearer than this are one.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        The marker that each one is, itself or an earlier one.
    """
    same_limb = (limb_of_marker[:, np.newaxis] == limb_of_marker) & (limb_of_marker >= 0)
    distance = np.linalg.norm(offsets[:, np.newaxis] - offsets, axis=2)
    near = same_limb & (together <= COMMON_FRAMES) & (np.nan_to_num(distance, nan=np.inf) < limits[limb_of_marker])
    result = np.arange(len(offsets))
    used: set[int] = set()
    for first, second in np.argwhere(np.triu(near, 1)).tolist():
        if first not in used and second not in used:
            result[second] = first
            used |= {first, second}
    return result


@dataclass(eq=False)
class _Newcomer:
    """A place that tracks keep: where it is, the points, and those of the latest block with their frames."""

    place: Floats
    points: list[Ints]
    block: int
    frames: Ints

    @property
    def n_points(self) -> int:
        return sum(len(points) for points in self.points)


class Newcomers:
    """Tracks without a marker that keep a place of their own on a limb; gathered block by block.

    Parameters
    ----------
    gate : float, mm
        Places nearer than this are one.
    limits : ndarray, shape (n_limbs,), mm
        How far a track may stray from its place on each limb.
    """

    def __init__(self, gate: float, limits: Floats) -> None:
        self._gate, self._limits = gate, limits
        self._found: dict[int, list[_Newcomer]] = {}  # by limb

    def look(self, points: Floats, block: Block, free: Ints, pieces: Ints, poses: Poses) -> None:
        """Look at the free tracks of a block.

        Parameters
        ----------
        points : ndarray, shape (n_points, 3), mm
            Points of the block.
        block : Block
            Their frames, and where they are in the take.
        free : ndarray of intp
            Points that are no marker's.
        pieces : ndarray of intp, shape (n_points,)
            Track of each point, -1 for none.
        poses : Poses
            Where limbs are in the block.
        """
        order = free[pieces[free] >= 0]
        order = order[np.argsort(pieces[order], kind="stable")]
        for members in np.split(order, np.flatnonzero(np.diff(pieces[order])) + 1):
            if len(members) < LEAST_FRAMES:
                continue
            frames = block.frames[members]
            place = steadiest_place(points[members], poses.at(frames), self._limits, LEAST_FRAMES)
            if place is not None:
                self._add(place, block, members)

    def found(self, n_frames: int) -> list[Ints]:
        """Points of each new marker, of those that are seen in enough of the take's `n_frames`."""
        least = max(LEAST_FRAMES, LEAST_SHARE * n_frames)
        everybody = itertools.chain.from_iterable(self._found.values())
        return [np.concatenate(one.points) for one in everybody if one.n_points >= least]

    def _add(self, place: tuple[int, Floats], block: Block, members: Ints) -> None:
        """Add a track's points to those of its place; tracks of earlier blocks are in other frames anyway."""
        limb, position = place
        points, frames = (block.points.start + members).astype(np.int32), block.frames[members]
        others = self._found.setdefault(limb, [])
        for other in others:
            if np.linalg.norm(other.place - position) >= self._gate:
                continue
            known = other.frames if other.block == block.first else frames[:0]
            if len(np.intersect1d(frames, known)) <= COMMON_FRAMES:
                other.place = (other.place + position) / 2
                other.points.append(points)
                other.block, other.frames = block.first, np.concatenate([known, frames])
                return
        others.append(_Newcomer(position, [points], block.first, frames))
