"""The compiled loop that follows points from frame to frame; `plain` is its NumPy twin.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
Both twins do the same operations in the same order, so that their results agree bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels.tracks import AGE, IDENTITY, MISSED, MUTED, NEWBORN_REACH, Rules

_Function = TypeVar("_Function", bound=Callable[..., Any])


def _compile(function: _Function) -> _Function:
    return cast(_Function, numba.njit(cache=True, nogil=True)(function))


@_compile
def _assign_greedy(gain: Floats) -> Ints:
    """Pair rows with columns, largest gain first; returns the column of each row or -1."""
    n_columns = gain.shape[1]
    column_of_row = np.full(gain.shape[0], -1, dtype=np.intp)
    taken = np.zeros(n_columns, dtype=np.bool_)
    flat = gain.ravel()
    useful = np.flatnonzero(flat > 0.0)
    for index in useful[np.argsort(-flat[useful], kind="mergesort")]:
        row, column = index // n_columns, index % n_columns
        if column_of_row[row] < 0 and not taken[column]:
            column_of_row[row] = column
            taken[column] = True
    return column_of_row


@_compile
def _assign_optimal(gain: Floats) -> Ints:
    """Pair rows with columns for the largest total gain: the Hungarian method by shortest augmenting paths.

    Needs at least as many columns as rows; returns the row of each column or -1.
    """
    n_rows, n_columns = gain.shape
    row_price = np.zeros(n_rows)
    column_price = np.zeros(n_columns + 1)
    # The extra column stands for the row that is being placed.
    row_of_column = np.full(n_columns + 1, -1, dtype=np.intp)
    came_from = np.zeros(n_columns, dtype=np.intp)
    for start in range(n_rows):
        row_of_column[n_columns] = start
        slack = np.full(n_columns, np.inf)
        visited = np.zeros(n_columns + 1, dtype=np.bool_)
        column = n_columns
        while row_of_column[column] >= 0:
            visited[column] = True
            row = row_of_column[column]
            step, following = np.inf, n_columns
            for other in range(n_columns):
                if not visited[other]:
                    reduced = -gain[row, other] - row_price[row] - column_price[other]
                    if reduced < slack[other]:
                        slack[other], came_from[other] = reduced, column
                    if slack[other] < step:
                        step, following = slack[other], other
            for other in range(n_columns + 1):
                if visited[other]:
                    row_price[row_of_column[other]] += step
                    column_price[other] -= step
                elif other < n_columns:
                    slack[other] -= step
            column = following
        while column != n_columns:
            row_of_column[column] = row_of_column[came_from[column]]
            column = came_from[column]
    return row_of_column[:n_columns]


@_compile
def _gains(expected: Floats, reach: Floats, points: Floats) -> Floats:
    """How much nearer each point is to each track than the track's reach, in squares; 0 out of reach."""
    gain = np.zeros((len(expected), len(points)))
    for track in range(len(expected)):
        limit = reach[track] * reach[track]
        for point in range(len(points)):
            x = points[point, 0] - expected[track, 0]
            y = points[point, 1] - expected[track, 1]
            z = points[point, 2] - expected[track, 2]
            gain[track, point] = max(limit - (x * x + y * y + z * z), 0.0)
    return gain


@_compile
def _match(gain: Floats, optimal: bool) -> Ints:
    """Point of each track, or -1."""
    n_tracks, n_points = gain.shape
    if not optimal:
        return _assign_greedy(gain)
    if n_tracks > n_points:
        point_of_track = _assign_optimal(np.ascontiguousarray(gain.T))
    else:
        point_of_track = np.full(n_tracks, -1, dtype=np.intp)
        track_of_point = _assign_optimal(gain)
        for point in range(n_points):
            if track_of_point[point] >= 0:
                point_of_track[track_of_point[point]] = point
    for track in range(n_tracks):
        if point_of_track[track] >= 0 and gain[track, point_of_track[track]] <= 0.0:
            point_of_track[track] = -1
    return point_of_track


@_compile
def _expect(motion: Floats, counters: Ints, reach: float) -> tuple[Floats, Floats]:
    """Where each track is expected, and how far from there its point may lie."""
    n_tracks = len(motion)
    expected = np.empty((n_tracks, 3))
    reaches = np.empty(n_tracks)
    for track in range(n_tracks):
        ahead = counters[track, MISSED] + 1
        for axis in range(3):
            expected[track, axis] = motion[track, 0, axis] + ahead * motion[track, 1, axis]
        reaches[track] = NEWBORN_REACH * reach if counters[track, AGE] == 1 else reach
    return expected, reaches


@_compile
def _correct(motion: Floats, counters: Ints, expected: Floats, point: Floats, rules: Rules) -> float:
    """Move one track onto its point; returns the squared distance from where it was expected."""
    ahead = counters[MISSED] + 1
    level_gain, slope_gain = rules.level_gain, rules.slope_gain
    if counters[AGE] == 1:
        level_gain, slope_gain = 1.0, 1.0 if slope_gain > 0.0 else 0.0
    squared = 0.0
    for axis in range(3):
        error = point[axis] - expected[axis]
        squared += error * error
        motion[0, axis] = expected[axis] + level_gain * error
        motion[1, axis] += slope_gain * error / ahead
    counters[AGE] += 1
    counters[MISSED] = 0
    return squared


@_compile
def _begin(motion: Floats, counters: Ints, n_old: int, track: int, point: Floats, slope_gain: float) -> None:
    """Begin a track at a point, with the slope of the nearest track that is seen and has a slope."""
    nearest, least = -1, np.inf
    for other in range(n_old):
        if counters[other, AGE] > 1 and counters[other, MISSED] == 0:
            x = motion[other, 0, 0] - point[0]
            y = motion[other, 0, 1] - point[1]
            z = motion[other, 0, 2] - point[2]
            if x * x + y * y + z * z < least:
                nearest, least = other, x * x + y * y + z * z
    motion[track, 0] = point
    motion[track, 1] = 0.0
    if nearest >= 0 and slope_gain > 0.0:
        motion[track, 1] = motion[nearest, 1]
    counters[track, AGE] = 1
    counters[track, MISSED] = 0


@_compile
def _own(counters: Ints) -> int:
    """Identity that the track gives to its point of this frame: -1 while it is muted."""
    if counters[MUTED] > 0:
        counters[MUTED] -= 1
        return -1
    return int(counters[IDENTITY])


@_compile
def _continue_tracks(
    points: Floats, tracks: tuple[Floats, Ints, Ints], rules: Rules, owner: Ints, surprise: Floats
) -> tuple[int, bool, Ints]:
    """Move the tracks that are alive; returns how many stay so, whether one jumped, and the track of each point."""
    motion, counters, totals = tracks
    n_tracks = totals[0]
    expected, reaches = _expect(motion[:n_tracks], counters[:n_tracks], rules.reach)
    point_of_track = _match(_gains(expected, reaches, points), rules.optimal)
    track_of_point = np.full(len(points), -1, dtype=np.intp)
    n_kept, jumped = 0, False
    for track in range(n_tracks):
        point = point_of_track[track]
        seen_before = counters[track, AGE] > 1 and counters[track, MISSED] == 0
        if point >= 0:
            squared = _correct(motion[track], counters[track], expected[track], points[point], rules)
            surprise[point] = squared if seen_before else np.nan
            owner[point] = _own(counters[track])
            track_of_point[point] = n_kept
        else:
            jumped = jumped or seen_before
            counters[track, MISSED] += 1
            if counters[track, MISSED] > min(rules.max_gap, counters[track, AGE]):
                continue
        motion[n_kept] = motion[track]
        counters[n_kept] = counters[track]
        n_kept += 1
    return n_kept, jumped, track_of_point


@_compile
def follow_frames(
    points: Floats,
    frame_starts: Ints,
    tracks: tuple[Floats, Ints, Ints],
    rules: Rules,
    owner: Ints,
    surprise: Floats,
) -> None:
    """Follow all points through some frames; arguments as `plain.follow_frames`."""
    motion, counters, totals = tracks
    for frame in range(len(frame_starts) - 1):
        first, last = frame_starts[frame], frame_starts[frame + 1]
        n_kept, jumped, track_of_point = _continue_tracks(
            points[first:last], tracks, rules, owner[first:last], surprise[first:last]
        )
        n_alive = n_kept
        for point in range(last - first):
            if track_of_point[point] < 0:
                _begin(motion, counters, n_kept, n_alive, points[first + point], rules.slope_gain)
                counters[n_alive, MUTED] = rules.mute if jumped else 0
                counters[n_alive, IDENTITY] = totals[1]
                owner[first + point] = _own(counters[n_alive])
                surprise[first + point] = np.nan
                totals[1] += 1
                n_alive += 1
        totals[0] = n_alive
