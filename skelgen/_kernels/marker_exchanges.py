"""What is gained where two markers are exchanged for a while: their common pauses, spans between them, and evidence."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.marker_pauses import (
    MOST_PAUSES,
    CommonPauses,
    Pauses,
    find_common_pauses,
    linked_in,
    room_for_pauses,
    write_links,
)
from skelgen._kernels.tracklet_evidence import WITNESSES, ranked
from skelgen.model.arrays import Bools, Floats, Ints

EXACT = 1e-6
"""mm; keeps the deviation of exact takes above zero."""

EXISTENCE = 8.0
"""nats that a marker more costs."""

LEAST_DEVIATION = 0.02
"""Deviation of a distance on a limb that is expected beforehand, in spacings."""

LEAST_GAIN = 12.0
"""nats; what is gained by less may be chance: distances on soft limbs vary with the pose, too."""

NEAR = 2.0
"""Spacings between markers that may be exchanged unasked; others are if their points suit each other's distances."""

TRIED = 8
"""Spans in which two markers are exchanged for trial, those in which the other marker's distances suit best."""


class MarkerDistances(NamedTuple):
    """What is known of the distances between markers.

    Attributes
    ----------
    before : ndarray, shape (n_markers, n_markers, 3, n_moments + 1)
        Number of samples before each moment, their sum [mm] and their sum of squares [mm^2].
    misfits : ndarray, shape (n_markers, n_markers, n_moments), nats
        How badly the points of a marker (first) suit the usual distances of another one.
    gains : ndarray, shape (n_markers, n_markers), nats
        How well distances are explained, by `explained`.
    witnessed : ndarray, shape (2, n_markers), nats
        What the best witnesses of each marker tell, and what the last of these does, by `of_witnesses`.
    spacing : float, mm
        How far apart markers are.
    """

    before: Floats
    misfits: Floats
    gains: Floats
    witnessed: Floats
    spacing: float


class _Room(NamedTuple):
    """Where one pair after the other is weighed."""

    pauses: CommonPauses
    suits: Floats  # (n_moments + 1,) nats gained by exchanging two markers before a moment
    sides: Floats  # (n_moments + 1,) those of them that the sides of both gain
    rank: Floats  # (TRIED,)
    best: Ints  # (TRIED,)
    is_tried: Bools  # (MOST_PAUSES + 2, MOST_PAUSES + 2)
    spans: Ints  # (MOST_PAUSES + TRIED, 2)
    rows: Floats  # (MOST_PAUSES + TRIED, 2, n_markers)
    witnesses: Floats  # (WITNESSES,)


def explained(sums: Floats, spacing: float) -> Floats:
    """How well distances are explained by two markers that keep them [nats], shape as the tables; 0 for a marker alone.

    Parameters
    ----------
    sums : ndarray, shape (3, ...)
        Number, sum [mm] and sum of squares [mm^2] of distances.
    spacing : float, mm
        How far apart markers are.
    """
    gain = np.empty(sums.shape[1:])
    _write_explained(np.ascontiguousarray(sums, dtype=np.float64).reshape(3, -1), spacing, gain.reshape(-1))
    return gain


def of_witnesses(gains: Floats) -> Floats:
    """What the best witnesses of each marker tell [nats], and the last one of these, shape (2, n_markers).

    Parameters
    ----------
    gains : ndarray, shape (n_markers, n_markers), nats
        From `explained`.
    """
    told = np.empty((2, len(gains)))
    _write_witnessed(gains, np.empty(WITNESSES), told)
    return told


def weigh_exchanges(pairs: Ints, distances: MarkerDistances, pauses: Pauses, sides: Floats) -> tuple[Floats, Ints]:
    """Find where exchanging two markers gains most.

    Parameters
    ----------
    pairs : ndarray of intp, shape (n_pairs, 2)
        Markers.
    distances : MarkerDistances
        What is known.
    pauses : Pauses
        When markers pause: only between common pauses, or from one on, are two exchanged.
    sides : ndarray, shape (n_pairs, n_moments), nats
        What an exchange gains by the sides on which both lie, by `handedness.evidence_of_sides`.

    Returns
    -------
    gain : ndarray, shape (n_pairs,), nats
        How much the evidence grows, by distances, sides and gaps; -inf where nothing speaks for an exchange.
    spans : ndarray of intp, shape (n_pairs, 4)
        First moment, moment behind the last one, first frame, and frame behind the last one.
    """
    n_markers, n_ends = len(distances.gains), len(pauses.moments) + 1
    most = MOST_PAUSES + TRIED
    room = _Room(
        room_for_pauses(len(pauses.moments)),
        np.empty(n_ends),
        np.empty(n_ends),
        np.empty(TRIED),
        np.empty(TRIED, dtype=np.intp),
        np.empty((MOST_PAUSES + 2, MOST_PAUSES + 2), dtype=np.bool_),
        np.empty((most, 2), dtype=np.intp),
        np.empty((most, 2, n_markers)),
        np.empty(WITNESSES),
    )
    found = np.empty(len(pairs)), np.zeros((len(pairs), 4), dtype=np.intp)
    _weigh(pairs, distances, pauses, sides, room, found)
    return found


@kernel
def _write_explained(sums: Floats, spacing: float, gain: Floats) -> None:
    for pair in range(len(gain)):
        gain[pair] = distance_evidence(sums[0, pair], sums[1, pair], sums[2, pair], spacing)


@kernel
def _write_witnessed(gains: Floats, witnesses: Floats, told: Floats) -> None:
    for marker in range(len(gains)):
        told[0, marker] = told_by_best(gains[marker], witnesses)
        told[1, marker] = witnesses[0]


@kernel
def _weigh(
    pairs: Ints, distances: MarkerDistances, pauses: Pauses, sides: Floats, room: _Room, found: tuple[Floats, Ints]
) -> None:
    """Write what `weigh_exchanges` returns."""
    gain, spans = found
    for row in range(len(pairs)):
        one, other = pairs[row, 0], pairs[row, 1]
        gain[row] = -math.inf
        is_near = _is_near(one, other, distances)
        if not _suits(one, other, distances.misfits, sides[row], room) and not is_near:
            continue
        n_common = find_common_pauses(one, other, pauses, room.pauses)
        write_links(n_common, one, other, pauses, room.pauses)
        n_spans = _find_spans(n_common, is_near, room)
        if n_spans:
            best, gain[row] = _best_span((one, other), n_spans, distances, pauses, room)
            for side in range(2):
                moment = room.spans[best, side]
                spans[row, side] = moment
                spans[row, 2 + side] = room.pauses.frames[moment]


@kernel_part
def distance_evidence(count: float, total: float, squares: float, spacing: float) -> float:
    """Return how well distances are explained by two markers that keep them [nats].

    Parameters
    ----------
    count, total, squares : float
        Number, sum [mm] and sum of squares [mm^2] of the distances.
    spacing : float, mm
        How far apart markers are.
    """
    if total <= 0.0:
        return 0.0
    scatter = max(squares - total * total / max(count, 1.0), 0.0)
    usual = LEAST_DEVIATION * spacing
    variance = max((2.0 * usual * usual + scatter) / (2.0 + max(count - 1.0, 0.0)), EXACT * EXACT)
    if variance >= spacing * spacing:  # as most distances between limbs
        return 0.0
    return 0.5 * count * math.log(spacing * spacing / variance)


@kernel_part
def _keep_best(best: Floats, value: float) -> None:
    """Keep a value if it is above the least of the best ones, which grow."""
    if value > best[0]:
        place = 1
        while place < len(best) and best[place] < value:
            best[place - 1] = best[place]
            place += 1
        best[place - 1] = value


@kernel_part
def told_by_best(gains: Floats, best: Floats) -> float:
    """Sum of the best witnesses of one marker [nats].

    Parameters
    ----------
    gains : ndarray, shape (n_markers,), nats
        How well its distances are explained.
    best : ndarray, shape (n_witnesses,)
        Receives the best of them, the least first.
    """
    best[:] = 0.0
    for value in gains:
        _keep_best(best, value)
    total = 0.0
    for value in best:
        total += value
    return total


@kernel_part
def _is_near(one: int, other: int, distances: MarkerDistances) -> bool:
    count, total = distances.before[one, other, 0, -1], distances.before[one, other, 1, -1]
    return bool(count > 0.0 and total <= NEAR * distances.spacing * count)


@kernel_part
def _suits(one: int, other: int, misfits: Floats, of_sides: Floats, room: _Room) -> bool:
    """Write how much better points of both suit the other before each moment; whether they do for long enough."""
    run, longest, suits, sides = 0.0, 0.0, room.suits, room.sides
    suits[0] = sides[0] = 0.0
    for moment in range(len(suits) - 1):
        gain = misfits[one, one, moment] - misfits[one, other, moment]
        gain += misfits[other, other, moment] - misfits[other, one, moment] + of_sides[moment]
        sides[moment + 1] = sides[moment] + of_sides[moment]
        suits[moment + 1] = suits[moment] + gain
        run = max(run + gain, 0.0)
        longest = max(longest, run)
    return bool(longest > LEAST_GAIN)


@kernel_part
def _find_spans(n_common: int, is_near: bool, room: _Room) -> int:
    """Write the spans between common pauses in which an exchange may gain, and return how many they are.

    What begins with the take ends elsewhere: exchanging all else is the same, but for the markers' numbers.
    """
    kept, linked, suits, is_tried, count = room.pauses.kept, room.pauses.linked, room.suits, room.is_tried, 0
    for first in range(1, n_common - 1):
        for end in range(first + 1, n_common):
            is_tried[first, end] = is_near and end == n_common - 1
            inside = suits[kept[end]] - suits[kept[first]]
            gain = max(inside, suits[-1] - inside) + linked[kept[first]] + linked[kept[end]]
            if gain > 0.0:
                count = ranked(room.rank, room.best, count, gain, first * n_common + end)
    for place in range(count):
        is_tried[room.best[place] // n_common, room.best[place] % n_common] = True
    n_spans = 0
    for first in range(1, n_common - 1):
        for end in range(first + 1, n_common):
            if is_tried[first, end]:
                room.spans[n_spans, 0], room.spans[n_spans, 1] = kept[first], kept[end]
                n_spans += 1
    return n_spans


@kernel_part
def _best_span(
    pair: tuple[int, int], n_spans: int, distances: MarkerDistances, pauses: Pauses, room: _Room
) -> tuple[int, float]:
    """The span in which an exchange tells most of the two markers, and what it gains of all [nats]."""
    one, other = pair
    _write_rows(one, other, n_spans, distances, room)
    best, most = 0, -math.inf
    for span in range(n_spans):
        first, end = room.spans[span, 0], room.spans[span, 1]
        inside = room.sides[end] - room.sides[first]
        told = max(inside, room.sides[-1] - inside) + EXISTENCE * _n_fewer(one, other, (first, end), distances.before)
        told += linked_in(one, other, (first, end), pauses, room.pauses)
        for side in range(2):
            told += told_by_best(room.rows[span, side], room.witnesses)
        if told > most:
            best, most = span, told
    told, least = distances.witnessed[0], distances.witnessed[1]
    gain = most - told[one] - told[other]
    for marker in range(len(told)):
        row, new = distances.gains[marker], (room.rows[best, 0, marker], room.rows[best, 1, marker])
        if marker not in (one, other) and max(row[one], row[other], new[0], new[1]) >= least[marker]:
            gain += _told_if_exchanged(row, (one, other), new, room.witnesses) - told[marker]
    return best, gain


@kernel_part
def _told_if_exchanged(row: Floats, pair: tuple[int, int], new: tuple[float, float], best: Floats) -> float:
    """Sum of the best witnesses of another marker [nats]."""
    before = row[pair[0]], row[pair[1]]
    row[pair[0]], row[pair[1]] = new
    told = told_by_best(row, best)
    row[pair[0]], row[pair[1]] = before
    return told


@kernel_part
def _write_rows(one: int, other: int, n_spans: int, distances: MarkerDistances, room: _Room) -> None:
    """Write how well the distances of both would be explained, span by span."""
    gains, rows = distances.gains, room.rows
    for marker in range(len(gains)):
        first, second = distances.before[one, marker], distances.before[other, marker]
        for span in range(n_spans):
            if marker in (one, other):  # the distance of both stays
                rows[span, 0, marker] = gains[one, other] if marker == other else 0.0
                rows[span, 1, marker] = gains[one, other] if marker == one else 0.0
                continue
            moments = room.spans[span, 0], room.spans[span, 1]
            rows[span, 0, marker] = _explained_if_exchanged(first, second, moments, gains[one, marker], distances)
            rows[span, 1, marker] = _explained_if_exchanged(second, first, moments, gains[other, marker], distances)


@kernel_part
def _explained_if_exchanged(
    own: Floats, others: Floats, span: tuple[int, int], gain: float, distances: MarkerDistances
) -> float:
    """What a distance explains if in a span it is another one, and what it explains now [nats]."""
    first, end = span
    left, come = own[0, end] - own[0, first], others[0, end] - others[0, first]
    if left == 0.0 and come == 0.0:
        return gain
    total = own[1, -1] - (own[1, end] - own[1, first]) + (others[1, end] - others[1, first])
    squares = own[2, -1] - (own[2, end] - own[2, first]) + (others[2, end] - others[2, first])
    return distance_evidence(own[0, -1] - left + come, total, squares, distances.spacing)


@kernel_part
def _n_fewer(one: int, other: int, span: tuple[int, int], before: Floats) -> int:
    """How many markers fewer are seen if two are exchanged in a span; negative for more."""
    first, end = span
    mine, others = before[one, one, 0], before[other, other, 0]
    moved = (others[end] - others[first]) - (mine[end] - mine[first])
    n_before = int(mine[-1] > 0.0) + int(others[-1] > 0.0)
    return n_before - int(mine[-1] + moved > 0.0) - int(others[-1] - moved > 0.0)
