"""The loop that follows points from frame to frame."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
from skelgen._kernels.track_matching import Links, find_doubts, find_pairs, first_not_below, match, rising_order
from skelgen._kernels.tracks import (
    AGE,
    ALIVE,
    CROWDED,
    FADE,
    GIVEN,
    IDENTITY,
    LEVEL,
    LONE,
    MISSED,
    MUTED,
    N_COUNTERS,
    N_MOTION,
    NEWBORN,
    RECENT_ERROR,
    SETTLED,
    SLOPE,
    Rules,
    TrackedPoints,
)
from skelgen.model.arrays import Bools, Floats, Ints

_State = tuple[Floats, Ints, Ints]


@kernel_part
def _end_tracks(tracks: _State, step: int, max_gap: int) -> None:
    """Drop the tracks that were last seen too long ago."""
    motion, counters, totals = tracks
    n_kept = 0
    for track in range(totals[ALIVE]):
        if counters[track, MISSED] + step <= min(max_gap, counters[track, AGE]) + 1:
            _keep_as(motion, counters, track, n_kept)
            n_kept += 1
    totals[ALIVE] = n_kept


@kernel_part
def _keep_as(motion: Floats, counters: Ints, track: int, place: int) -> None:
    """Move a track's state to another place."""
    for row in range(N_MOTION):
        for axis in range(3):
            motion[place, row, axis] = motion[track, row, axis]
    for column in range(N_COUNTERS):
        counters[place, column] = counters[track, column]


@array_part
def _expect(tracks: _State, step: int, rules: Rules) -> tuple[Floats, Floats]:
    """Where each track is expected; and its reach, gain there, squared width, and exponent."""
    motion, counters, totals = tracks
    n_tracks = totals[ALIVE]
    expected, terms = np.empty((n_tracks, 3)), np.empty((n_tracks, 4))
    for track in range(n_tracks):
        ahead = counters[track, MISSED] + step
        for axis in range(3):
            expected[track, axis] = motion[track, LEVEL, axis] + ahead * motion[track, SLOPE, axis]
        row = SETTLED if counters[track, AGE] > 1 else LONE if motion[track, RECENT_ERROR, 2] > 0.0 else NEWBORN
        half = (rules.tails[row] + 3.0) / 2.0
        ratio = (rules.prior_weight + motion[track, RECENT_ERROR, 0]) / (
            rules.prior_weight + motion[track, RECENT_ERROR, 1]
        )
        width = rules.tails[row] * rules.scales[row, ahead] * rules.scales[row, ahead] * ratio
        reach = rules.reaches[row, ahead]
        if rules.is_given:
            gain = half * math.log1p(reach * reach / width)
        else:
            gain = rules.gains[row, ahead] - 1.5 * math.log(ratio)
            reach = min(reach, math.sqrt(width * math.expm1(max(gain, 0.0) / half)))
        terms[track, 0], terms[track, 1], terms[track, 2], terms[track, 3] = reach, gain, width, half
    return expected, terms


@kernel_part
def _move(tracks: _State, track: int, expected: Floats, points: TrackedPoints, point: int, rules: Rules) -> float:
    """Move one track onto its point; returns the squared distance from where it was expected."""
    motion, counters, _ = tracks
    ahead, weight = counters[track, MISSED], points.weights[point]
    level_gain, slope_gain = weight * rules.level_gain, weight * rules.slope_gain
    if counters[track, AGE] == 1:
        level_gain, slope_gain = 1.0, 1.0 if rules.slope_gain > 0.0 else 0.0
    squared = 0.0
    for axis in range(3):
        error = points.positions[point, axis] - expected[track, axis]
        squared += error * error
        motion[track, LEVEL, axis] = expected[track, axis] + level_gain * error
        motion[track, SLOPE, axis] += slope_gain * error / ahead
    if counters[track, AGE] > 1 and ahead == 1:
        scale = rules.scales[SETTLED, 0]
        motion[track, RECENT_ERROR, 0] = FADE * motion[track, RECENT_ERROR, 0] + squared * weight / (
            3.0 * scale * scale
        )
        motion[track, RECENT_ERROR, 1] = FADE * motion[track, RECENT_ERROR, 1] + 1.0
    counters[track, AGE] += 1
    counters[track, MISSED] = 0
    return squared


@kernel_part
def _own(counters: Ints, track: int) -> int:
    """Identity that the track gives to its point of this frame: -1 while it is muted."""
    if counters[track, MUTED] > 0:
        counters[track, MUTED] -= 1
        return -1
    return int(counters[track, IDENTITY])


@array_part
def _continue_tracks(
    points: TrackedPoints, tracks: _State, step: int, expected: Floats, point_of_track: Ints, rules: Rules
) -> Bools:
    """Move the tracks that are alive onto their points; returns which are lost that were just seen."""
    motion, counters, totals = tracks
    lost = np.zeros(totals[ALIVE], dtype=np.bool_)
    n_kept = 0
    for track in range(totals[ALIVE]):
        point = point_of_track[track]
        seen_before = counters[track, AGE] > 1 and counters[track, MISSED] == 0
        counters[track, MISSED] += step
        if point >= 0:
            squared = _move(tracks, track, expected, points, point, rules)
            points.surprise[point] = squared if seen_before and step == 1 else np.nan
            points.identities[point] = _own(counters, track)
            states = points.states
            if len(states):
                for axis in range(3):
                    states[point, axis] = motion[track, SLOPE, axis]
                states[point, 3], states[point, 4] = motion[track, RECENT_ERROR, 0], motion[track, RECENT_ERROR, 1]
        else:
            lost[track] = seen_before
            if counters[track, MISSED] > min(rules.max_gap, counters[track, AGE]):
                continue
        _keep_as(motion, counters, track, n_kept)
        n_kept += 1
    totals[ALIVE] = n_kept
    return lost


@kernel_part
def _has_double(points: Floats, point: int, order: Ints, placed: Bools, near: float) -> bool:
    """Whether a point with a track is so near that this one is the same marker."""
    for rank in range(first_not_below(points, order, points[point, 0] - near), len(order)):
        other = order[rank]
        if points[other, 0] > points[point, 0] + near:
            break
        if placed[other] and squared_distance(points, other, points, point) < near * near:
            return True
    return False


@kernel_part
def _begin(tracks: _State, n_old: int, track: int, points: Floats, point: int, slope_gain: float) -> None:
    """Begin a track at a point, with the slope of the nearest track that is seen and has a slope."""
    motion, counters, _ = tracks
    nearest, least = -1, np.inf
    for other in range(n_old):
        if counters[other, AGE] > 1 and counters[other, MISSED] == 0:
            away = squared_distance(motion[other], LEVEL, points, point)
            if away < least:
                nearest, least = other, away
    for axis in range(3):
        motion[track, LEVEL, axis] = points[point, axis]
        motion[track, SLOPE, axis] = motion[track, RECENT_ERROR, axis] = 0.0
    if nearest >= 0 and slope_gain > 0.0:
        for axis in range(3):
            motion[track, SLOPE, axis] = motion[nearest, SLOPE, axis]
            motion[track, RECENT_ERROR, axis] = motion[nearest, RECENT_ERROR, axis]
    motion[track, RECENT_ERROR, 2] = 1.0 if nearest < 0 else 0.0
    counters[track, AGE] = 1
    counters[track, MISSED] = 0


@array_part
def _begin_tracks(points: Floats, order: Ints, placed: Bools, tracks: _State, rules: Rules, identities: Ints) -> Ints:
    """Begin a track at each point that has none and is not the double of one that has; returns these points."""
    _, counters, totals = tracks
    n_old, n_begun = totals[ALIVE], 0
    begun = np.empty(len(points), dtype=np.intp)
    for point in range(len(points)):
        if placed[point] or _has_double(points, point, order, placed, rules.duplicate):
            continue
        track = totals[ALIVE]
        _begin(tracks, n_old, track, points, point, rules.slope_gain)
        counters[track, MUTED] = 0
        counters[track, IDENTITY] = totals[GIVEN]
        identities[point] = totals[GIVEN]
        placed[point] = True
        begun[n_begun] = point
        n_begun += 1
        totals[ALIVE] += 1
        totals[GIVEN] += 1
    return begun[:n_begun]


@kernel_part
def _mute_jumps(points: TrackedPoints, begun: Ints, expected: Floats, lost: Bools, tracks: _State, mute: int) -> None:
    """Mute, for each lost track, the begun one that is nearest to where that was expected: the same marker, perhaps."""
    _, counters, totals = tracks
    if mute == 0 or len(begun) == 0:
        return
    for track in range(len(lost)):
        if not lost[track]:
            continue
        nearest, least = 0, np.inf
        for rank in range(len(begun)):
            away = squared_distance(points.positions, begun[rank], expected, track)
            if away < least:
                nearest, least = rank, away
        counters[totals[ALIVE] - len(begun) + nearest, MUTED] = mute - 1
        points.identities[begun[nearest]] = -1


@array_kernel
def follow_frames(points: TrackedPoints, frame_starts: Ints, steps: Ints, tracks: _State, rules: Rules) -> None:
    """Follow all points through some frames; `points` and `tracks` are written to.

    Parameters
    ----------
    points : TrackedPoints
        All points of the take.
    frame_starts : ndarray of intp, shape (n_frames + 1,)
        Points of the frames to follow; a slice of the take's.
    steps : ndarray of intp, shape (n_frames,)
        Steps of time since the frame before.
    tracks : tuple of ndarray
        The arrays of `Tracks`: motion, counters, totals; carried on from the frames before.
    rules : Rules
        How to follow.
    """
    _, counters, totals = tracks
    for frame in range(len(frame_starts) - 1):
        first, last = frame_starts[frame], frame_starts[frame + 1]
        step = steps[frame]
        own = TrackedPoints(
            points.positions[first:last],
            points.weights[first:last],
            points.identities[first:last],
            points.surprise[first:last],
            points.states[first:last],
        )
        for point in range(last - first):
            own.identities[point], own.surprise[point] = -1, np.nan
        _end_tracks(tracks, step, rules.max_gap)
        n_tracks = totals[ALIVE]
        expected, terms = _expect(tracks, step, rules)
        order = rising_order(own.positions[:, 0])
        pairs, gains, is_crowded = find_pairs(expected, terms, own.positions, own.weights, order)
        if is_crowded:
            totals[CROWDED] += 1
            for track in range(n_tracks):
                counters[track, MISSED] += step
            continue
        point_of_track = match(pairs, gains, n_tracks, last - first, rules.optimal)
        track_of_point = np.full(last - first, -1, dtype=np.intp)
        for track in range(n_tracks):
            if point_of_track[track] >= 0:
                track_of_point[point_of_track[track]] = track
        links = Links(pairs, gains, point_of_track, track_of_point)
        doubtful = find_doubts(links, expected, terms, own.positions, rules)
        for track in range(n_tracks):
            if doubtful[track]:
                counters[track, IDENTITY] = totals[GIVEN]
                totals[GIVEN] += 1
        lost = _continue_tracks(own, tracks, step, expected, point_of_track, rules)
        placed = np.empty(last - first, dtype=np.bool_)
        for point in range(last - first):
            placed[point] = track_of_point[point] >= 0
        begun = _begin_tracks(own.positions, order, placed, tracks, rules, own.identities)
        _mute_jumps(own, begun, expected, lost, tracks, rules.mute)
