"""The loop that follows points from frame to frame, in plain NumPy: the twin of `compiled`, and its meaning.

Both twins move tracks by the same operations in the same order, so that their results agree bit for bit.
"""

from __future__ import annotations

import itertools

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.plain_matching import find_doubts, find_pairs, match
from skelgen.stages.labels.tracks import (
    AGE,
    ALIVE,
    CALM,
    CROWDED,
    FADE,
    GIVEN,
    IDENTITY,
    LEVEL,
    LONE,
    MISSED,
    MUTED,
    NEWBORN,
    SETTLED,
    SLOPE,
    Rules,
)

_State = tuple[Floats, Ints, Ints]


def follow_frames(
    points: Floats,
    frame_starts: Ints,
    tracks: _State,
    rules: Rules,
    owner: Ints,
    surprise: Floats,
    weights: Floats | None = None,
    steps: Ints | None = None,
    told: Floats | None = None,
) -> None:
    """Follow all points through some frames; `tracks`, `owner`, `surprise` and `told` are written to.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        All points of the take.
    frame_starts : ndarray of intp, shape (n_frames + 1,)
        Points of the frames to follow; a slice of the take's.
    tracks : tuple of ndarray
        The arrays of `Tracks`: motion, counters, totals; carried on from the frames before.
    rules : Rules
        How to follow.
    owner : ndarray of intp, shape (n_points,)
        Receives the identity of each point's track; -1 while that is muted, for doubles, and in frames left out.
    surprise : ndarray, shape (n_points,), mm^2
        Receives the squared distance between each point and where it was expected; NaN where nothing was expected.
    weights : ndarray, shape (n_points,), optional
        How far to believe each point, at most 1; 1 if left out.
    steps : ndarray of intp, shape (n_frames,), optional
        Steps of time since the frame before; 1 if left out.
    told : ndarray, shape (n_points, 5), optional
        Receives slope [mm] and calm of each point's track after it; nothing is told if it is left out or empty.
    """
    for frame, (first, last) in enumerate(itertools.pairwise(frame_starts)):
        span = slice(first, last)
        own = np.ones(last - first) if weights is None else weights[span]
        step = 1 if steps is None else int(steps[frame])
        heard = np.empty((0, 5)) if told is None or not len(told) else told[span]
        _follow_frame(points[span], own, step, tracks, rules, (owner[span], surprise[span], heard))


def _follow_frame(
    points: Floats, weights: Floats, step: int, tracks: _State, rules: Rules, results: tuple[Ints, Floats, Floats]
) -> None:
    """Follow all points of one frame."""
    motion, counters, totals = tracks
    owner, surprise, _ = results
    owner[:], surprise[:] = -1, np.nan
    alive = slice(totals[ALIVE])
    _keep(tracks, counters[alive, MISSED] + step <= np.minimum(rules.max_gap, counters[alive, AGE]) + 1)
    alive = slice(totals[ALIVE])
    expected, terms = _expect(motion[alive], counters[alive], step, rules)
    pairs, gains, is_crowded = find_pairs(expected, terms, points, weights)
    if is_crowded:
        totals[CROWDED] += 1
        counters[alive, MISSED] += step
        return
    point_of_track = match(pairs, gains, len(expected), len(points), rules.optimal)
    rows = np.flatnonzero(point_of_track >= 0)
    track_of_point = np.full(len(points), -1, dtype=np.intp)
    track_of_point[point_of_track[rows]] = rows
    doubtful = find_doubts(pairs, gains, point_of_track, track_of_point, expected, terms, points, rules)
    _rename(counters, totals, rows[doubtful[rows]])
    lost = _continue_tracks(points, weights, tracks, step, expected, point_of_track, rules, results)
    begun = _begin_tracks(points, track_of_point >= 0, tracks, rules, owner)
    _mute_jumps(points, begun, expected[lost], tracks, rules.mute, owner)


def _keep(tracks: _State, kept: Bools) -> None:
    """Drop the tracks that are dead, in place."""
    motion, counters, totals = tracks
    n_kept = int(kept.sum())
    motion[:n_kept] = motion[: len(kept)][kept]
    counters[:n_kept] = counters[: len(kept)][kept]
    totals[ALIVE] = n_kept


def _expect(motion: Floats, counters: Ints, step: int, rules: Rules) -> tuple[Floats, Floats]:
    """Where each track is expected; and its reach, gain there, squared width, and exponent."""
    ahead = counters[:, MISSED] + step
    expected = motion[:, LEVEL] + ahead[:, np.newaxis] * motion[:, SLOPE]
    newborn = np.where(motion[:, CALM, 2] > 0.0, LONE, NEWBORN)
    row = np.where(counters[:, AGE] == 1, newborn, SETTLED)
    half = (rules.tails[row] + 3.0) / 2.0
    ratio = (rules.habit + motion[:, CALM, 0]) / (rules.habit + motion[:, CALM, 1])
    scale, reach = rules.scales[row, ahead], rules.reaches[row, ahead]
    width = rules.tails[row] * scale * scale * ratio
    if rules.is_given:
        gain = half * np.log1p(reach * reach / width)
    else:
        gain = rules.gains[row, ahead] - 1.5 * np.log(ratio)
        reach = np.minimum(reach, np.sqrt(width * np.expm1(np.maximum(gain, 0.0) / half)))
    return expected, np.column_stack([reach, gain, width, half])


def _rename(counters: Ints, totals: Ints, cut: Ints) -> None:
    """Give new identities to tracks whose link is doubtful."""
    counters[cut, IDENTITY] = totals[GIVEN] + np.arange(len(cut))
    totals[GIVEN] += len(cut)


def _continue_tracks(
    points: Floats,
    weights: Floats,
    tracks: _State,
    step: int,
    expected: Floats,
    point_of_track: Ints,
    rules: Rules,
    results: tuple[Ints, Floats, Floats],
) -> Bools:
    """Move the tracks that are alive onto their points; returns which are lost that were just seen."""
    motion, counters, totals = tracks
    motion, counters = motion[: totals[ALIVE]], counters[: totals[ALIVE]]
    owner, surprise, told = results
    seen_before = (counters[:, AGE] > 1) & (counters[:, MISSED] == 0)
    rows = np.flatnonzero(point_of_track >= 0)
    columns = point_of_track[rows]
    squared = _move(motion, counters, rows, expected[rows], points[columns], weights[columns], step, rules)
    surprise[columns] = np.where(seen_before[rows] & (step == 1), squared, np.nan)
    owner[columns] = _own(counters, rows)
    if len(told):
        told[columns, :3], told[columns, 3:] = motion[rows, SLOPE], motion[rows, CALM, :2]
    lost = point_of_track < 0
    counters[lost, MISSED] += step
    _keep(tracks, ~(lost & (counters[:, MISSED] > np.minimum(rules.max_gap, counters[:, AGE]))))
    return np.asarray(lost & seen_before)


def _move(
    motion: Floats,
    counters: Ints,
    rows: Ints,
    expected: Floats,
    points: Floats,
    weights: Floats,
    step: int,
    rules: Rules,
) -> Floats:
    """Move tracks onto their points; returns the squared distances from where they were expected."""
    error = points - expected
    ahead = counters[rows, MISSED] + step
    new = counters[rows, AGE] == 1
    level_gain = np.where(new, 1.0, weights * rules.level_gain)[:, np.newaxis]
    slope_gain = np.where(new, float(rules.slope_gain > 0.0), weights * rules.slope_gain)[:, np.newaxis]
    motion[rows, LEVEL] = expected + level_gain * error
    motion[rows, SLOPE] += slope_gain * error / ahead[:, np.newaxis]
    squared = error[:, 0] * error[:, 0] + error[:, 1] * error[:, 1] + error[:, 2] * error[:, 2]
    settled = ~new & (ahead == 1)
    calmed, scale = rows[settled], rules.scales[SETTLED, 0]
    motion[calmed, CALM, 0] = FADE * motion[calmed, CALM, 0] + (squared * weights)[settled] / (3.0 * scale * scale)
    motion[calmed, CALM, 1] = FADE * motion[calmed, CALM, 1] + 1.0
    counters[rows, AGE] += 1
    counters[rows, MISSED] = 0
    return np.asarray(squared)


def _own(counters: Ints, rows: Ints) -> Ints:
    """Identities that tracks give to their points of this frame: -1 while they are muted."""
    muted = counters[rows, MUTED] > 0
    counters[rows, MUTED] -= muted
    identities: Ints = np.where(muted, -1, counters[rows, IDENTITY])
    return identities


def _begin_tracks(points: Floats, placed: Bools, tracks: _State, rules: Rules, owner: Ints) -> Ints:
    """Begin a track at each point that has none and is not the double of one that has; returns these points."""
    motion, counters, totals = tracks
    begun = _without_doubles(points, placed, rules.duplicate)
    known = np.flatnonzero((counters[: totals[ALIVE], AGE] > 1) & (counters[: totals[ALIVE], MISSED] == 0))
    new = np.arange(totals[ALIVE], totals[ALIVE] + len(begun))
    motion[new] = 0.0
    motion[new, LEVEL] = points[begun]
    motion[new, CALM, 2] = 0.0 if len(known) else 1.0
    for track in new if len(known) and rules.slope_gain > 0.0 else ():
        apart = motion[known, LEVEL] - motion[track, LEVEL]
        x, y, z = apart[:, 0], apart[:, 1], apart[:, 2]
        nearest = known[np.argmin(x * x + y * y + z * z)]
        motion[track, SLOPE], motion[track, CALM, :2] = motion[nearest, SLOPE], motion[nearest, CALM, :2]
    counters[new, AGE] = 1
    counters[new, MISSED] = 0
    counters[new, MUTED] = 0
    counters[new, IDENTITY] = totals[GIVEN] + np.arange(len(begun))
    totals[ALIVE] += len(begun)
    totals[GIVEN] += len(begun)
    owner[begun] = counters[new, IDENTITY]
    return begun


def _mute_jumps(points: Floats, begun: Ints, expected: Floats, tracks: _State, mute: int, owner: Ints) -> None:
    """Mute, for each lost track, the begun one that is nearest to where that was expected: the same marker, perhaps."""
    _, counters, totals = tracks
    if mute == 0 or len(begun) == 0:
        return
    for place in expected:
        apart = points[begun] - place
        x, y, z = apart[:, 0], apart[:, 1], apart[:, 2]
        nearest = int(np.argmin(x * x + y * y + z * z))
        counters[totals[ALIVE] - len(begun) + nearest, MUTED] = mute - 1
        owner[begun[nearest]] = -1


def _without_doubles(points: Floats, placed: Bools, near: float) -> Ints:
    """Points without a track that are not within `near` of one that has one or gets one."""
    begun = []
    for point in np.flatnonzero(~placed):
        apart = points[placed] - points[point]
        x, y, z = apart[:, 0], apart[:, 1], apart[:, 2]
        if not (x * x + y * y + z * z < near * near).any():
            begun.append(point)
            placed[point] = True
    return np.array(begun, dtype=np.intp)
