"""Matching of tracks and points in plain NumPy: the twin of `compiled_matching`, and its meaning."""

from __future__ import annotations

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.tracks import MOST_OPTIMAL_PAIRS, MOST_PAIRS, Rules

_BLOCK_PAIRS = 1_000_000  # distances held at once


def find_pairs(expected: Floats, terms: Floats, points: Floats, weights: Floats) -> tuple[Ints, Floats, bool]:
    """Return track and point of all pairs within reach, track by track, their gains, and whether there are too many.

    Parameters
    ----------
    expected : ndarray, shape (n_tracks, 3), mm
        Where tracks are expected.
    terms : ndarray, shape (n_tracks, 4)
        Reach [mm], gain [nats] at the expected place, squared width [mm^2] and exponent of the t distribution.
    points : ndarray, shape (n_points, 3), mm
        Points of the frame.
    weights : ndarray, shape (n_points,)
        How far to believe each.
    """
    pairs, gains = [np.empty((0, 2), dtype=np.intp)], [np.empty(0)]
    step, n_pairs = max(1, _BLOCK_PAIRS // max(1, len(points))), 0
    for start in range(0, len(expected), step):
        block = slice(start, start + step)
        gain = _gains(expected[block], terms[block], points, weights)
        tracks, columns = np.nonzero(gain > 0.0)
        n_pairs += len(tracks)
        if n_pairs > MOST_PAIRS:
            return pairs[0], gains[0], True
        pairs.append(np.column_stack([tracks + start, columns]))
        gains.append(gain[tracks, columns])
    return np.concatenate(pairs), np.concatenate(gains), False


def _gains(expected: Floats, terms: Floats, points: Floats, weights: Floats) -> Floats:
    """Gain [nats] of linking each track to each point; 0 out of reach."""
    apart = points[np.newaxis] - expected[:, np.newaxis]
    x, y, z = apart[..., 0], apart[..., 1], apart[..., 2]
    squared = x * x + y * y + z * z
    reach, most, width, half = terms[:, :1], terms[:, 1], terms[:, 2], terms[:, 3]
    gain = np.zeros(squared.shape)
    near = squared <= reach * reach
    row, column = np.nonzero(near)
    loss = half[row] * np.log1p(squared[near] * weights[column] / width[row])
    gain[near] = most[row] + 1.5 * np.log(weights[column]) - loss
    return gain


def match(pairs: Ints, gains: Floats, n_tracks: int, n_points: int, optimal: bool) -> Ints:
    """Return the point of each track or -1: the best assignment within each cluster of tracks that compete."""
    point_of_track = np.full(n_tracks, -1, dtype=np.intp)
    if not optimal:
        _match_greedy(pairs, gains, point_of_track)
    elif n_tracks * n_points <= MOST_OPTIMAL_PAIRS:
        _match_optimal(pairs, gains, point_of_track)
    else:
        links = coo_matrix(
            (np.ones(len(pairs)), (pairs[:, 0], n_tracks + pairs[:, 1])), shape=(n_tracks + n_points,) * 2
        )
        cluster = connected_components(links, directed=False)[1][pairs[:, 0]]
        order = np.argsort(cluster, kind="stable")
        for own in np.split(order, np.flatnonzero(np.diff(cluster[order])) + 1):
            size = len(np.unique(pairs[own, 0])) * len(np.unique(pairs[own, 1]))
            assign = _match_optimal if size <= MOST_OPTIMAL_PAIRS else _match_greedy
            assign(pairs[own], gains[own], point_of_track)
    return point_of_track


def _match_optimal(pairs: Ints, gains: Floats, point_of_track: Ints) -> None:
    """Pair tracks with points for the largest sum of gains."""
    tracks, row = np.unique(pairs[:, 0], return_inverse=True)
    points, column = np.unique(pairs[:, 1], return_inverse=True)
    gain = np.zeros((len(tracks), len(points)))
    gain[row, column] = gains
    rows, columns = linear_sum_assignment(gain, maximize=True)
    useful = gain[rows, columns] > 0.0
    point_of_track[tracks[rows[useful]]] = points[columns[useful]]


def _match_greedy(pairs: Ints, gains: Floats, point_of_track: Ints) -> None:
    """Pair tracks with points, largest gain first."""
    taken: set[int] = set()
    for track, point in pairs[np.argsort(-gains, kind="stable")].tolist():
        if point_of_track[track] < 0 and point not in taken:
            point_of_track[track] = point
            taken.add(point)


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
    """Return for each track whether its link is hardly better than another explanation, shape (n_tracks,).

    Other explanations are a track that takes a free point (but not a double of its own), a track without a point that
    takes this one, and two tracks that exchange their points. Neighbours are surprised by the same acceleration, which
    an exchange does not change: it is judged by the vector between the two, kept or turned round.
    """
    gain_of_track = np.zeros(len(point_of_track))
    linked = point_of_track[pairs[:, 0]] == pairs[:, 1]
    gain_of_track[pairs[linked, 0]] = gains[linked]
    track, other_point, gain = pairs[~linked, 0], pairs[~linked, 1], gains[~linked]
    point, other = point_of_track[track], track_of_point[other_point]
    doubtful = np.zeros(len(point_of_track), dtype=np.bool_)

    takes = (point < 0) & (other >= 0)
    doubtful[other[takes & (gain_of_track[other] - gain < rules.evidence)]] = True
    is_other = _squared(points[other_point] - points[point]) >= rules.duplicate * rules.duplicate
    leaves = (point >= 0) & (other < 0) & is_other
    doubtful[track[leaves & (gain_of_track[track] - gain < rules.evidence)]] = True

    both = (point >= 0) & (other >= 0)
    track, other, point, other_point = track[both], other[both], point[both], other_point[both]
    apart, ahead = points[point] - points[other_point], expected[track] - expected[other]
    width = rules.relative * (terms[track, 2] + terms[other, 2]) / 2.0
    kept, exchanged = _squared(apart - ahead) / width, _squared(apart + ahead) / width
    close = 1.0 + exchanged < rules.exchange * (1.0 + kept)
    doubtful[track[close]] = True
    doubtful[other[close]] = True
    return doubtful


def _squared(vectors: Floats) -> Floats:
    x, y, z = vectors[:, 0], vectors[:, 1], vectors[:, 2]
    return np.asarray(x * x + y * y + z * z)
