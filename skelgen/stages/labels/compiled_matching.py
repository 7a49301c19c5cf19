"""Compiled matching of tracks and points: who is in reach of whom, the best assignment, and which links are doubtful.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeVar, cast

import numba
import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.tracks import MOST_OPTIMAL_PAIRS, MOST_PAIRS, Rules

_Function = TypeVar("_Function", bound=Callable[..., Any])


def compile_function(function: _Function) -> _Function:
    """Return the function compiled; kept on disk for the next time."""
    return cast(_Function, numba.njit(cache=True, nogil=True)(function))


@compile_function
def find_pairs(
    expected: Floats, terms: Floats, points: Floats, weights: Floats, order: Ints
) -> tuple[Ints, Floats, bool]:
    """Track and point of all pairs within reach, track by track, their gains, and whether there are too many.

    `order` sorts the points by their x.
    """
    sorted_x = points[order, 0]
    room = 4 * (len(points) + len(expected))
    pairs, gains = np.empty((room, 2), dtype=np.intp), np.empty(room)
    n_pairs = 0
    for track in range(len(expected)):
        reach = terms[track, 0]
        for rank in range(np.searchsorted(sorted_x, expected[track, 0] - reach), len(points)):
            if sorted_x[rank] > expected[track, 0] + reach:
                break
            point = order[rank]
            gain = gain_of(points[point], weights[point], expected[track], terms[track])
            if gain <= 0.0:
                continue
            if n_pairs == MOST_PAIRS:
                return pairs[:0], gains[:0], True
            if n_pairs == len(gains):
                pairs, gains = np.concatenate((pairs, pairs)), np.concatenate((gains, gains))
            pairs[n_pairs, 0], pairs[n_pairs, 1], gains[n_pairs] = track, point, gain
            n_pairs += 1
    return pairs[:n_pairs], gains[:n_pairs], False


@compile_function
def gain_of(point: Floats, weight: float, expected: Floats, terms: Floats) -> float:
    """Gain [nats] of linking a track to a point; not above 0 out of reach."""
    x, y, z = point[0] - expected[0], point[1] - expected[1], point[2] - expected[2]
    squared = x * x + y * y + z * z
    if squared > terms[0] * terms[0]:
        return 0.0
    loss = terms[3] * math.log1p(squared * weight / terms[2])
    return float(terms[1] + 1.5 * math.log(weight) - loss)


@compile_function
def match(pairs: Ints, gains: Floats, n_tracks: int, n_points: int, optimal: bool) -> Ints:
    """Point of each track, or -1: the best assignment within each cluster of tracks that compete for points."""
    point_of_track = np.full(n_tracks, -1, dtype=np.intp)
    root = _clusters(pairs, n_tracks, n_points)
    order = np.argsort(root[pairs[:, 0]], kind="mergesort")
    row_of_track = np.empty(n_tracks, dtype=np.intp)
    column_of_point = np.empty(n_points, dtype=np.intp)
    start = 0
    while start < len(order):
        stop = start + 1
        while stop < len(order) and root[pairs[order[stop], 0]] == root[pairs[order[start], 0]]:
            stop += 1
        own = order[start:stop]
        if len(own) == 1:
            point_of_track[pairs[own[0], 0]] = pairs[own[0], 1]
        else:
            _match_cluster(pairs[own], gains[own], row_of_track, column_of_point, optimal, point_of_track)
        start = stop
    return point_of_track


@compile_function
def _clusters(pairs: Ints, n_tracks: int, n_points: int) -> Ints:
    """A number for each track that tracks which compete share, directly or through others."""
    parent = np.arange(n_tracks + n_points)
    for pair in range(len(pairs)):
        one, other = pairs[pair, 0], n_tracks + pairs[pair, 1]
        while parent[one] != one:
            parent[one] = parent[parent[one]]
            one = parent[one]
        while parent[other] != other:
            parent[other] = parent[parent[other]]
            other = parent[other]
        parent[max(one, other)] = min(one, other)
    for index in range(n_tracks):  # a parent comes before its children
        parent[index] = parent[parent[index]]
    return parent[:n_tracks]


@compile_function
def _match_cluster(
    pairs: Ints, gains: Floats, row_of_track: Ints, column_of_point: Ints, optimal: bool, point_of_track: Ints
) -> None:
    """Assign the points of one cluster to its tracks."""
    tracks, points = np.unique(pairs[:, 0]), np.unique(pairs[:, 1])
    if not optimal or len(tracks) * len(points) > MOST_OPTIMAL_PAIRS:
        _match_greedy(pairs, gains, point_of_track, column_of_point)
        return
    row_of_track[tracks] = np.arange(len(tracks))
    column_of_point[points] = np.arange(len(points))
    gain = np.zeros((len(tracks), len(points)))
    for pair in range(len(pairs)):
        gain[row_of_track[pairs[pair, 0]], column_of_point[pairs[pair, 1]]] = gains[pair]
    if len(tracks) > len(points):
        row_of_column = _assign(np.ascontiguousarray(gain.T))
        for row in range(len(tracks)):
            if row_of_column[row] >= 0 and gain[row, row_of_column[row]] > 0.0:
                point_of_track[tracks[row]] = points[row_of_column[row]]
    else:
        row_of_column = _assign(gain)
        for column in range(len(points)):
            row = row_of_column[column]
            if row >= 0 and gain[row, column] > 0.0:
                point_of_track[tracks[row]] = points[column]


@compile_function
def _match_greedy(pairs: Ints, gains: Floats, point_of_track: Ints, taken: Ints) -> None:
    """Pair tracks with points, largest gain first; `taken` is room to note who is."""
    taken[pairs[:, 1]] = -1
    for pair in np.argsort(-gains, kind="mergesort"):
        track, point = pairs[pair, 0], pairs[pair, 1]
        if point_of_track[track] < 0 and taken[point] < 0:
            point_of_track[track] = point
            taken[point] = track


@compile_function
def _assign(gain: Floats) -> Ints:
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


@compile_function
def find_doubts(
    pairs: Ints,
    gains: Floats,
    point_of_track: Ints,
    track_of_point: Ints,
    expected: Floats,
    terms: Floats,
    points: Floats,
    rules: Rules,
) -> Bools:
    """Whether the link of each track is hardly better than another explanation, as `plain_matching.find_doubts`."""
    gain_of_track = np.zeros(len(point_of_track))
    for pair in range(len(pairs)):
        if point_of_track[pairs[pair, 0]] == pairs[pair, 1]:
            gain_of_track[pairs[pair, 0]] = gains[pair]
    doubtful = np.zeros(len(point_of_track), dtype=np.bool_)
    for pair in range(len(pairs)):
        track, other_point, gain = pairs[pair, 0], pairs[pair, 1], gains[pair]
        point, other = point_of_track[track], track_of_point[other_point]
        if other == track:
            continue
        if point < 0:
            doubtful[other] |= other >= 0 and gain_of_track[other] - gain < rules.evidence
        elif other < 0:
            close = gain_of_track[track] - gain < rules.evidence
            doubtful[track] |= close and _squared(points[point], points[other_point]) >= rules.duplicate**2
        else:
            apart, ahead = points[point] - points[other_point], expected[track] - expected[other]
            width = rules.relative * (terms[track, 2] + terms[other, 2]) / 2.0
            kept, exchanged = _squared(apart, ahead) / width, _squared(apart, -ahead) / width
            if 1.0 + exchanged < rules.exchange * (1.0 + kept):
                doubtful[track] = doubtful[other] = True
    return doubtful


@compile_function
def _squared(one: Floats, other: Floats) -> float:
    x, y, z = one[0] - other[0], one[1] - other[1], one[2] - other[2]
    return float(x * x + y * y + z * z)
