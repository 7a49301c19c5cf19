"""The loop that follows points from frame to frame, in plain NumPy: the twin of `compiled`, and its meaning.

Both twins do the same operations in the same order, so that their results agree bit for bit.
"""

from __future__ import annotations

import itertools

import numpy as np
from scipy.optimize import linear_sum_assignment

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.tracks import AGE, IDENTITY, MISSED, MUTED, NEWBORN_REACH, Rules


def follow_frames(
    points: Floats,
    frame_starts: Ints,
    tracks: tuple[Floats, Ints, Ints],
    rules: Rules,
    owner: Ints,
    surprise: Floats,
) -> None:
    """Follow all points through some frames; the last three arguments are written to.

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
        Receives the identity of each point's track, -1 while that is muted.
    surprise : ndarray, shape (n_points,), mm^2
        Receives the squared distance between each point and where it was expected; NaN where nothing was expected.
    """
    for first, last in itertools.pairwise(frame_starts):
        span = slice(first, last)
        begun, jumped = _continue_tracks(points[span], tracks, rules, owner[span], surprise[span])
        _begin_tracks(points[span], begun, jumped, tracks, rules, owner[span])


def _continue_tracks(
    points: Floats, tracks: tuple[Floats, Ints, Ints], rules: Rules, owner: Ints, surprise: Floats
) -> tuple[Ints, bool]:
    """Move the tracks that are alive; returns the points that nobody claims and whether a track jumped."""
    motion, counters, totals = tracks
    motion, counters = motion[: totals[0]], counters[: totals[0]]
    ahead = counters[:, MISSED] + 1
    expected = motion[:, 0] + ahead[:, np.newaxis] * motion[:, 1]
    reaches = rules.reach * np.where(counters[:, AGE] == 1, NEWBORN_REACH, 1.0)
    seen_before = (counters[:, AGE] > 1) & (counters[:, MISSED] == 0)
    rows, columns = _match(_gains(expected, reaches, points), rules.optimal)
    lost = np.ones(len(motion), dtype=np.bool_)
    lost[rows] = False

    error = points[columns] - expected[rows]
    _correct(motion, rows, expected[rows], error, counters, rules)
    squared = error[:, 0] * error[:, 0] + error[:, 1] * error[:, 1] + error[:, 2] * error[:, 2]
    surprise[:] = np.nan
    surprise[columns] = np.where(seen_before[rows], squared, np.nan)
    owner[columns] = _own(counters, rows)
    counters[lost, MISSED] += 1
    kept = ~(lost & (counters[:, MISSED] > np.minimum(rules.max_gap, counters[:, AGE])))
    _keep(motion, counters, totals, kept)
    unclaimed = np.ones(len(points), dtype=np.bool_)
    unclaimed[columns] = False
    return np.flatnonzero(unclaimed), bool((lost & seen_before).any())


def _gains(expected: Floats, reaches: Floats, points: Floats) -> Floats:
    """How much nearer each point is to each track than the track's reach, in squares; 0 out of reach."""
    apart = points[np.newaxis] - expected[:, np.newaxis]
    x, y, z = apart[..., 0], apart[..., 1], apart[..., 2]
    gains: Floats = np.maximum((reaches * reaches)[:, np.newaxis] - (x * x + y * y + z * z), 0.0)
    return gains


def _match(gain: Floats, optimal: bool) -> tuple[Ints, Ints]:
    """Tracks and their points, pair by pair."""
    rows, columns = linear_sum_assignment(gain, maximize=True) if optimal else _assign_greedy(gain)
    useful = gain[rows, columns] > 0.0
    return rows[useful], columns[useful]


def _assign_greedy(gain: Floats) -> tuple[Ints, Ints]:
    """Pair rows with columns, largest gain first."""
    rows, columns = np.nonzero(gain)
    order = np.argsort(-gain[rows, columns], kind="stable")
    column_of_row: dict[int, int] = {}
    taken: set[int] = set()
    for row, column in zip(rows[order].tolist(), columns[order].tolist(), strict=True):
        if row not in column_of_row and column not in taken:
            column_of_row[row] = column
            taken.add(column)
            if len(taken) == min(gain.shape):
                break
    pairs = np.array(list(column_of_row.items()), dtype=np.intp).reshape(-1, 2)
    return pairs[:, 0], pairs[:, 1]


def _correct(motion: Floats, rows: Ints, expected: Floats, error: Floats, counters: Ints, rules: Rules) -> None:
    """Move tracks onto their points."""
    new = counters[rows, AGE] == 1
    level_gain = np.where(new, 1.0, rules.level_gain)[:, np.newaxis]
    slope_gain = np.where(new, float(rules.slope_gain > 0.0), rules.slope_gain)[:, np.newaxis]
    motion[rows, 0] = expected + level_gain * error
    motion[rows, 1] += slope_gain * error / (counters[rows, MISSED] + 1)[:, np.newaxis]
    counters[rows, AGE] += 1
    counters[rows, MISSED] = 0


def _own(counters: Ints, rows: Ints) -> Ints:
    """Identities that tracks give to their points of this frame: -1 while they are muted."""
    muted = counters[rows, MUTED] > 0
    counters[rows, MUTED] -= muted
    identities: Ints = np.where(muted, -1, counters[rows, IDENTITY])
    return identities


def _keep(motion: Floats, counters: Ints, totals: Ints, kept: Bools) -> None:
    """Drop the tracks that are dead, in place."""
    n_kept = int(kept.sum())
    motion[:n_kept] = motion[kept]
    counters[:n_kept] = counters[kept]
    totals[0] = n_kept


def _begin_tracks(
    points: Floats, begun: Ints, jumped: bool, tracks: tuple[Floats, Ints, Ints], rules: Rules, owner: Ints
) -> None:
    """Begin a track at each unclaimed point, with the slope of the nearest track that is seen and has a slope."""
    motion, counters, totals = tracks
    new = np.arange(totals[0], totals[0] + len(begun))
    motion[new, 0] = points[begun]
    motion[new, 1] = 0.0
    known = np.flatnonzero((counters[: totals[0], AGE] > 1) & (counters[: totals[0], MISSED] == 0))
    if len(known) and rules.slope_gain > 0.0:
        apart = motion[known, 0] - points[begun][:, np.newaxis]
        x, y, z = apart[..., 0], apart[..., 1], apart[..., 2]
        motion[new, 1] = motion[known[np.argmin(x * x + y * y + z * z, axis=1)], 1]
    counters[new, AGE] = 1
    counters[new, MISSED] = 0
    counters[new, MUTED] = rules.mute if jumped else 0
    counters[new, IDENTITY] = totals[1] + np.arange(len(begun))
    owner[begun] = _own(counters, new)
    totals += len(begun)
