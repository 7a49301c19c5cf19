"""Matching of tracks and points: who is in reach of whom, the best assignment, and which links are doubtful."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
from skelgen._kernels.tracks import MOST_OPTIMAL_PAIRS, MOST_PAIRS, Rules
from skelgen.model.arrays import Bools, Floats, Ints


class Links(NamedTuple):
    """Tracks and points that may be linked, and those that are.

    Attributes
    ----------
    pairs : ndarray of intp, shape (n_pairs, 2)
        Track and point of all within reach, track by track.
    gains : ndarray, shape (n_pairs,), nats
        What each link gains.
    point_of_track : ndarray of intp, shape (n_tracks,)
        As matched; -1 for none.
    track_of_point : ndarray of intp, shape (n_points,)
        The same of each point.
    """

    pairs: Ints
    gains: Floats
    point_of_track: Ints
    track_of_point: Ints


@array_kernel
def rising_order(values: Floats) -> Ints:
    """Return the order, shape (n,), that sorts numbers, equal ones as they come: a merge sort, from the bottom up.

    Parameters
    ----------
    values : ndarray, shape (n,)
        None of them NaN.
    """
    n_values = len(values)
    order, room = np.arange(n_values), np.empty(n_values, dtype=np.intp)
    width = 1
    while width < n_values:
        for start in range(0, n_values, 2 * width):
            middle, end = min(start + width, n_values), min(start + 2 * width, n_values)
            left, right = start, middle
            for place in range(start, end):
                if right == end or (left < middle and values[order[left]] <= values[order[right]]):
                    room[place] = order[left]
                    left += 1
                else:
                    room[place] = order[right]
                    right += 1
        order, room = room, order
        width *= 2
    return order


@kernel
def first_not_below(points: Floats, order: Ints, x: float) -> int:
    """Rank of the first point, in the order of their x, that is not below.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Of one frame.
    order : ndarray of intp, shape (n_points,)
        Sorts the points by their x.
    x : float, mm
        The bound.
    """
    low, high = 0, len(order)
    while low < high:
        middle = (low + high) // 2
        if points[order[middle], 0] < x:
            low = middle + 1
        else:
            high = middle
    return low


@array_kernel
def find_pairs(
    expected: Floats, terms: Floats, points: Floats, weights: Floats, order: Ints
) -> tuple[Ints, Floats, bool]:
    """Track and point of all pairs within reach, track by track, their gains, and whether there are too many.

    Parameters
    ----------
    expected : ndarray, shape (n_tracks, 3), mm
        Where each track is expected.
    terms : ndarray, shape (n_tracks, 4)
        Reach [mm], gain there [nats], squared width [mm^2], and exponent.
    points : ndarray, shape (n_points, 3), mm
        Of one frame.
    weights : ndarray, shape (n_points,)
        How far to believe each point, at most 1.
    order : ndarray of intp, shape (n_points,)
        Sorts the points by their x.
    """
    room = 4 * (len(points) + len(expected))
    pairs, gains = np.empty((room, 2), dtype=np.intp), np.empty(room)
    n_pairs = 0
    for track in range(len(expected)):
        reach = terms[track, 0]
        for rank in range(first_not_below(points, order, expected[track, 0] - reach), len(points)):
            point = order[rank]
            if points[point, 0] > expected[track, 0] + reach:
                break
            gain = _gain_of(points, point, weights[point], expected, track, terms)
            if gain <= 0.0:
                continue
            if n_pairs == MOST_PAIRS:
                return pairs[:0], gains[:0], True
            if n_pairs == len(gains):
                pairs, gains = _with_more_room(pairs, gains)
            pairs[n_pairs, 0], pairs[n_pairs, 1], gains[n_pairs] = track, point, gain
            n_pairs += 1
    return pairs[:n_pairs], gains[:n_pairs], False


@array_part
def _with_more_room(pairs: Ints, gains: Floats) -> tuple[Ints, Floats]:
    """The same pairs in arrays of twice the size."""
    more_pairs, more_gains = np.empty((2 * len(pairs), 2), dtype=np.intp), np.empty(2 * len(gains))
    for pair in range(len(pairs)):
        more_pairs[pair, 0], more_pairs[pair, 1], more_gains[pair] = pairs[pair, 0], pairs[pair, 1], gains[pair]
    return more_pairs, more_gains


@kernel
def _gain_of(points: Floats, point: int, weight: float, expected: Floats, track: int, terms: Floats) -> float:
    """Gain [nats] of linking a track to a point; not above 0 out of reach."""
    squared = squared_distance(points, point, expected, track)
    if squared > terms[track, 0] * terms[track, 0]:
        return 0.0
    loss = terms[track, 3] * math.log1p(squared * weight / terms[track, 2])
    return float(terms[track, 1] + 1.5 * math.log(weight) - loss)


@array_kernel
def match(pairs: Ints, gains: Floats, n_tracks: int, n_points: int, optimal: bool) -> Ints:
    """Point of each track, or -1: the best assignment within each cluster of tracks that compete for points.

    Parameters
    ----------
    pairs : ndarray of intp, shape (n_pairs, 2)
        Track and point of all within reach, track by track.
    gains : ndarray, shape (n_pairs,), nats
        What each link gains.
    n_tracks, n_points : int
        How many there are.
    optimal : bool
        Match for the largest sum of gains rather than largest gain first.
    """
    point_of_track = np.full(n_tracks, -1, dtype=np.intp)
    root = _clusters(pairs, n_tracks, n_points)
    starts, order = _by_root(pairs, root)
    places = np.full(n_tracks, -1, dtype=np.intp), np.full(n_points, -1, dtype=np.intp)
    for cluster in range(n_tracks):
        start, stop = starts[cluster], starts[cluster + 1]
        if stop == start + 1:
            point_of_track[pairs[order[start], 0]] = pairs[order[start], 1]
        elif stop > start:
            _match_cluster(pairs, gains, order[start:stop], places, optimal, point_of_track)
    return point_of_track


@array_part
def _clusters(pairs: Ints, n_tracks: int, n_points: int) -> Ints:
    """A track for each track that those which compete share, directly or through others."""
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
    return parent


@array_part
def _by_root(pairs: Ints, root: Ints) -> tuple[Ints, Ints]:
    """Where each cluster's pairs begin among all, in `order`, which keeps them as they come."""
    starts = np.zeros(len(root) + 2, dtype=np.intp)
    for pair in range(len(pairs)):
        starts[root[pairs[pair, 0]] + 2] += 1
    for cluster in range(len(root)):
        starts[cluster + 1] += starts[cluster]
    order = np.empty(len(pairs), dtype=np.intp)
    for pair in range(len(pairs)):
        cluster = root[pairs[pair, 0]]
        order[starts[cluster + 1]] = pair
        starts[cluster + 1] += 1
    return starts, order


@array_part
def _match_cluster(
    pairs: Ints, gains: Floats, own: Ints, places: tuple[Ints, Ints], optimal: bool, point_of_track: Ints
) -> None:
    """Assign the points of one cluster, which has the pairs `own`, to its tracks; both maps are room to work in."""
    row_of_track, column_of_point = places
    tracks, points = np.empty(len(own), dtype=np.intp), np.empty(len(own), dtype=np.intp)
    n_tracks, n_points = 0, 0
    for pair in own:
        track, point = pairs[pair, 0], pairs[pair, 1]
        if row_of_track[track] < 0:
            row_of_track[track], tracks[n_tracks] = n_tracks, track
            n_tracks += 1
        if column_of_point[point] < 0:
            column_of_point[point], points[n_points] = n_points, point
            n_points += 1
    if not optimal or n_tracks * n_points > MOST_OPTIMAL_PAIRS:
        _match_greedy(pairs, gains, own, point_of_track, column_of_point)
        return
    turned = n_tracks > n_points
    gain = np.zeros((min(n_tracks, n_points), max(n_tracks, n_points)))
    for pair in own:
        row, column = row_of_track[pairs[pair, 0]], column_of_point[pairs[pair, 1]]
        if turned:
            row, column = column, row
        gain[row, column] = gains[pair]
    row_of_column = _assign(gain)
    for column in range(gain.shape[1]):
        row = row_of_column[column]
        if row >= 0 and gain[row, column] > 0.0:
            point_of_track[tracks[column if turned else row]] = points[row if turned else column]


@array_part
def _match_greedy(pairs: Ints, gains: Floats, own: Ints, point_of_track: Ints, taken: Ints) -> None:
    """Pair tracks with points, largest gain first; `taken` is room to note who is."""
    losses = np.empty(len(own))
    for rank in range(len(own)):
        losses[rank] = -gains[own[rank]]
        taken[pairs[own[rank], 1]] = -1
    for rank in rising_order(losses):
        track, point = pairs[own[rank], 0], pairs[own[rank], 1]
        if point_of_track[track] < 0 and taken[point] < 0:
            point_of_track[track] = point
            taken[point] = track


@array_part
def _assign(gain: Floats) -> Ints:
    """Pair rows with columns for the largest total gain: the Hungarian method by shortest augmenting paths.

    Rows whose best column nobody wants before them have it to begin with; only the others need paths. Needs at least as
    many columns as rows; returns the row of each column or -1.
    """
    n_rows, n_columns = gain.shape
    row_price, column_price = np.empty(n_rows), np.zeros(n_columns + 1)
    # The extra column stands for the row that is being placed.
    row_of_column = np.full(n_columns + 1, -1, dtype=np.intp)
    placed = np.zeros(n_rows, dtype=np.bool_)
    for row in range(n_rows):
        best = 0
        for column in range(1, n_columns):
            if gain[row, column] > gain[row, best]:
                best = column
        row_price[row] = -gain[row, best]
        if row_of_column[best] < 0:
            row_of_column[best] = row
            placed[row] = True
    for row in range(n_rows):
        if not placed[row]:
            _place(row, gain, row_price, column_price, row_of_column)
    return row_of_column[:n_columns]


@array_part
def _place(start: int, gain: Floats, row_price: Floats, column_price: Floats, row_of_column: Ints) -> None:
    """Give one more row a column by the shortest path along which others change theirs."""
    n_columns = gain.shape[1]
    came_from, slack = np.empty(n_columns, dtype=np.intp), np.full(n_columns, np.inf)
    visited = np.zeros(n_columns + 1, dtype=np.bool_)
    row_of_column[n_columns] = start
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


@array_kernel
def find_doubts(links: Links, expected: Floats, terms: Floats, points: Floats, rules: Rules) -> Bools:
    """Return for each track whether its link is hardly better than another explanation, shape (n_tracks,).

    Other explanations are a track that takes a free point (but not a double of its own), a track without a point that
    takes this one, and two tracks that exchange their points. Neighbours are surprised by the same acceleration, which
    an exchange does not change: it is judged by the vector between the two, kept or turned round.

    Parameters
    ----------
    links : Links
        What may be linked, and what is.
    expected : ndarray, shape (n_tracks, 3), mm
        Where each track is expected.
    terms : ndarray, shape (n_tracks, 4)
        Reach [mm], gain there [nats], squared width [mm^2], and exponent.
    points : ndarray, shape (n_points, 3), mm
        Of one frame.
    rules : Rules
        How much better a link must be.
    """
    pairs, gains, point_of_track, track_of_point = links
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
            if other >= 0 and gain_of_track[other] - gain < rules.evidence:
                doubtful[other] = True
        elif other < 0:
            apart = squared_distance(points, point, points, other_point) >= rules.duplicate * rules.duplicate
            if apart and gain_of_track[track] - gain < rules.evidence:
                doubtful[track] = True
        else:
            kept, exchanged = _surprises(points, point, other_point, expected, track, other)
            width = rules.relative * (terms[track, 2] + terms[other, 2]) / 2.0
            if 1.0 + exchanged / width < rules.exchange * (1.0 + kept / width):
                doubtful[track] = doubtful[other] = True
    return doubtful


@kernel_part
def _surprises(
    points: Floats, point: int, other_point: int, expected: Floats, track: int, other: int
) -> tuple[float, float]:
    """Squared change [mm^2] of the vector between two tracks, as they are linked and if they exchange their points."""
    kept, exchanged = 0.0, 0.0
    for axis in range(3):
        apart = points[point, axis] - points[other_point, axis]
        ahead = expected[track, axis] - expected[other, axis]
        kept += (apart - ahead) * (apart - ahead)
        exchanged += (apart + ahead) * (apart + ahead)
    return kept, exchanged
