"""The compiled loop that follows points from frame to frame; `plain` is its NumPy twin.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
Both twins move tracks by the same operations in the same order, so that their results agree bit for bit.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.compiled_matching import compile_function, find_doubts, find_pairs, match
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


@compile_function
def _end_tracks(tracks: _State, step: int, max_gap: int) -> None:
    """Drop the tracks that were last seen too long ago."""
    motion, counters, totals = tracks
    n_kept = 0
    for track in range(totals[ALIVE]):
        if counters[track, MISSED] + step <= min(max_gap, counters[track, AGE]) + 1:
            motion[n_kept] = motion[track]
            counters[n_kept] = counters[track]
            n_kept += 1
    totals[ALIVE] = n_kept


@compile_function
def _expect(motion: Floats, counters: Ints, step: int, rules: Rules) -> tuple[Floats, Floats]:
    """Where each track is expected; and its reach, gain there, squared width, and exponent."""
    n_tracks = len(motion)
    expected, terms = np.empty((n_tracks, 3)), np.empty((n_tracks, 4))
    for track in range(n_tracks):
        ahead = counters[track, MISSED] + step
        for axis in range(3):
            expected[track, axis] = motion[track, LEVEL, axis] + ahead * motion[track, SLOPE, axis]
        row = SETTLED if counters[track, AGE] > 1 else LONE if motion[track, CALM, 2] > 0.0 else NEWBORN
        half = (rules.tails[row] + 3.0) / 2.0
        ratio = (rules.habit + motion[track, CALM, 0]) / (rules.habit + motion[track, CALM, 1])
        width = rules.tails[row] * rules.scales[row, ahead] * rules.scales[row, ahead] * ratio
        reach = rules.reaches[row, ahead]
        if rules.is_given:
            gain = half * math.log1p(reach * reach / width)
        else:
            gain = rules.gains[row, ahead] - 1.5 * math.log(ratio)
            reach = min(reach, math.sqrt(width * math.expm1(max(gain, 0.0) / half)))
        terms[track, 0], terms[track, 1], terms[track, 2], terms[track, 3] = reach, gain, width, half
    return expected, terms


@compile_function
def _move(
    motion: Floats, counters: Ints, expected: Floats, point: Floats, weight: float, step: int, rules: Rules
) -> float:
    """Move one track onto its point; returns the squared distance from where it was expected."""
    ahead = counters[MISSED] + step
    level_gain, slope_gain = weight * rules.level_gain, weight * rules.slope_gain
    if counters[AGE] == 1:
        level_gain, slope_gain = 1.0, 1.0 if rules.slope_gain > 0.0 else 0.0
    squared = 0.0
    for axis in range(3):
        error = point[axis] - expected[axis]
        squared += error * error
        motion[LEVEL, axis] = expected[axis] + level_gain * error
        motion[SLOPE, axis] += slope_gain * error / ahead
    if counters[AGE] > 1 and ahead == 1:
        scale = rules.scales[SETTLED, 0]
        motion[CALM, 0] = FADE * motion[CALM, 0] + squared * weight / (3.0 * scale * scale)
        motion[CALM, 1] = FADE * motion[CALM, 1] + 1.0
    counters[AGE] += 1
    counters[MISSED] = 0
    return squared


@compile_function
def _own(counters: Ints) -> int:
    """Identity that the track gives to its point of this frame: -1 while it is muted."""
    if counters[MUTED] > 0:
        counters[MUTED] -= 1
        return -1
    return int(counters[IDENTITY])


@compile_function
def _miss(counters: Ints, step: int) -> None:
    """Note that tracks are not seen."""
    counters[:, MISSED] += step


@compile_function
def _continue_tracks(
    points: Floats,
    weights: Floats,
    tracks: _State,
    step: int,
    expected: Floats,
    point_of_track: Ints,
    doubtful: Bools,
    rules: Rules,
    owner: Ints,
    surprise: Floats,
    told: Floats,
) -> bool:
    """Move the tracks that are alive onto their points; returns whether a track that was just seen is lost."""
    motion, counters, totals = tracks
    n_kept, jumped = 0, False
    for track in range(totals[ALIVE]):
        point = point_of_track[track]
        seen_before = counters[track, AGE] > 1 and counters[track, MISSED] == 0
        if point >= 0:
            if doubtful[track]:
                counters[track, IDENTITY] = totals[GIVEN]
                totals[GIVEN] += 1
            squared = _move(motion[track], counters[track], expected[track], points[point], weights[point], step, rules)
            surprise[point] = squared if seen_before and step == 1 else np.nan
            owner[point] = _own(counters[track])
            if len(told):
                told[point, :3] = motion[track, SLOPE]
                told[point, 3:] = motion[track, CALM, :2]
        else:
            jumped = jumped or seen_before
            counters[track, MISSED] += step
            if counters[track, MISSED] > min(rules.max_gap, counters[track, AGE]):
                continue
        motion[n_kept] = motion[track]
        counters[n_kept] = counters[track]
        n_kept += 1
    totals[ALIVE] = n_kept
    return jumped


@compile_function
def _has_double(point: Floats, points: Floats, order: Ints, sorted_x: Floats, placed: Bools, near: float) -> bool:
    """Whether a point with a track is so near that this one is the same marker."""
    for rank in range(np.searchsorted(sorted_x, point[0] - near), len(order)):
        if sorted_x[rank] > point[0] + near:
            break
        other = order[rank]
        x, y, z = points[other, 0] - point[0], points[other, 1] - point[1], points[other, 2] - point[2]
        if placed[other] and x * x + y * y + z * z < near * near:
            return True
    return False


@compile_function
def _begin(motion: Floats, counters: Ints, n_old: int, track: int, point: Floats, slope_gain: float) -> None:
    """Begin a track at a point, with the slope of the nearest track that is seen and has a slope."""
    nearest, least = -1, np.inf
    for other in range(n_old):
        if counters[other, AGE] > 1 and counters[other, MISSED] == 0:
            x = motion[other, LEVEL, 0] - point[0]
            y = motion[other, LEVEL, 1] - point[1]
            z = motion[other, LEVEL, 2] - point[2]
            if x * x + y * y + z * z < least:
                nearest, least = other, x * x + y * y + z * z
    motion[track] = 0.0
    motion[track, LEVEL] = point
    if nearest >= 0 and slope_gain > 0.0:
        motion[track, SLOPE] = motion[nearest, SLOPE]
        motion[track, CALM] = motion[nearest, CALM]
    motion[track, CALM, 2] = 1.0 if nearest < 0 else 0.0
    counters[track, AGE] = 1
    counters[track, MISSED] = 0


@compile_function
def _begin_tracks(
    points: Floats, order: Ints, placed: Bools, jumped: bool, tracks: _State, rules: Rules, owner: Ints
) -> None:
    """Begin a track at each point that has none and is not the double of one that has."""
    motion, counters, totals = tracks
    n_old = totals[ALIVE]
    sorted_x = points[order, 0]
    for point in range(len(points)):
        if placed[point] or _has_double(points[point], points, order, sorted_x, placed, rules.duplicate):
            continue
        track = totals[ALIVE]
        _begin(motion, counters, n_old, track, points[point], rules.slope_gain)
        counters[track, MUTED] = rules.mute if jumped else 0
        counters[track, IDENTITY] = totals[GIVEN]
        owner[point] = _own(counters[track])
        placed[point] = True
        totals[ALIVE] += 1
        totals[GIVEN] += 1


@compile_function
def follow_frames(
    points: Floats,
    frame_starts: Ints,
    tracks: _State,
    rules: Rules,
    owner: Ints,
    surprise: Floats,
    weights: Floats,
    steps: Ints,
    told: Floats,
) -> None:
    """Follow all points through some frames; arguments as `plain.follow_frames`."""
    motion, counters, totals = tracks
    for frame in range(len(frame_starts) - 1):
        first, last = frame_starts[frame], frame_starts[frame + 1]
        own, step = points[first:last], steps[frame]
        owner[first:last] = -1
        surprise[first:last] = np.nan
        _end_tracks(tracks, step, rules.max_gap)
        n_tracks = totals[ALIVE]
        expected, terms = _expect(motion[:n_tracks], counters[:n_tracks], step, rules)
        order = np.argsort(own[:, 0], kind="mergesort")
        pairs, gains, is_crowded = find_pairs(expected, terms, own, weights[first:last], order)
        if is_crowded:
            totals[CROWDED] += 1
            _miss(counters[:n_tracks], step)
            continue
        point_of_track = match(pairs, gains, n_tracks, last - first, rules.optimal)
        track_of_point = np.full(last - first, -1, dtype=np.intp)
        for track in range(n_tracks):
            if point_of_track[track] >= 0:
                track_of_point[point_of_track[track]] = track
        doubtful = find_doubts(pairs, gains, point_of_track, track_of_point, expected, terms, own, rules)
        jumped = _continue_tracks(
            own,
            weights[first:last],
            tracks,
            step,
            expected,
            point_of_track,
            doubtful,
            rules,
            owner[first:last],
            surprise[first:last],
            told[first:last],
        )
        _begin_tracks(own, order, track_of_point >= 0, jumped, tracks, rules, owner[first:last])
