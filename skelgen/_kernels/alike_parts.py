"""Parts of bodies that are alike, as both legs: markers that correspond, and what exchanging them gains."""

from __future__ import annotations

import math
from typing import NamedTuple

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.marker_exchanges import distance_evidence, told_by_best
from skelgen.model.arrays import Bools, Floats, Ints

UNLIKE = 0.15
"""Deviation by which a distance differs between both sides of a body, in spacings: markers are put on by hand."""

MOST_AGAINST = 3.0
"""nats at most by which one distance speaks against a pair of markers."""

LEAST_FOR = 1.0
"""nats that must speak for a pair of markers."""

LEAST_PAIRS = 2
"""Pairs that are exchanged at once; one alone is an exchange of two markers."""


class UsualDistances(NamedTuple):
    """How far apart markers usually are.

    Attributes
    ----------
    usual : ndarray, shape (n_markers, n_markers), mm
        Usual distances; any number where two are not steady.
    variance : ndarray, shape (n_markers, n_markers), mm^2
        How they vary.
    steady : ndarray of bool, shape (n_markers, n_markers)
        Which distances count.
    spacing : float, mm
        How far apart markers are.
    """

    usual: Floats
    variance: Floats
    steady: Bools
    spacing: float


class MomentsOfPairs(NamedTuple):
    """Distances of all markers, and between which moments pairs of some may be exchanged.

    Attributes
    ----------
    before : ndarray, shape (n_moments + 1, 3, n_markers, n_markers)
        Number of samples before each moment, their sum [mm] and their sum of squares [mm^2].
    gains : ndarray, shape (n_markers, n_markers), nats
        How well distances are explained (`marker_exchanges.explained`).
    told : ndarray, shape (n_markers,), nats
        What the best witnesses of each marker tell (`marker_exchanges.of_witnesses`).
    pairs : ndarray of intp, shape (n_pairs, 2)
        Markers that correspond.
    hidden : ndarray of bool, shape (n_moments + 1, n_pairs)
        Whether both are hidden for a moment in front of each moment; behind the last one, as if the take went on so.
    spacing : float, mm
        How far apart markers are.
    """

    before: Floats
    gains: Floats
    told: Floats
    pairs: Ints
    hidden: Bools
    spacing: float


class Room(NamedTuple):
    """Where exchanges are weighed one after the other.

    Attributes
    ----------
    gains : ndarray, shape (n_markers, n_markers)
        How well the distances of markers that are exchanged would be explained.
    row : ndarray, shape (n_markers,)
        How well those of another marker would be.
    partner : ndarray of intp, shape (n_markers,)
        What each marker becomes.
    best : ndarray, shape (n_witnesses,)
        For the witnesses of one marker.
    """

    gains: Floats
    row: Floats
    partner: Ints
    best: Floats


@kernel
def grow_part(distances: UsualDistances, free: Bools, score: Floats, pairs: Ints) -> float:
    """Find markers that correspond to each other as two that are given, and return how much speaks for them [nats].

    Parameters
    ----------
    distances : UsualDistances
        Of all markers.
    free : ndarray of bool, shape (n_markers,)
        Markers that may correspond to others; those found are not free any more.
    score : ndarray, shape (n_markers, n_markers)
        Room.
    pairs : ndarray of intp, shape (n_pairs, 2)
        Begins with the two markers; receives the others, and -1 behind them.
    """
    total, n_markers = 0.0, len(free)
    for one in range(n_markers):
        for other in range(n_markers):
            score[one, other] = 0.0
    for place in range(len(pairs)):
        if place > 0:
            most = LEAST_FOR
            pairs[place, 0] = pairs[place, 1] = -1
            for one in range(n_markers):
                for other in range(n_markers):
                    if score[one, other] > most and one != other and free[one] and free[other]:
                        most = score[one, other]
                        pairs[place, 0], pairs[place, 1] = one, other
            if pairs[place, 0] < 0:
                continue
            total += most
        free[pairs[place, 0]] = free[pairs[place, 1]] = False
        _add_evidence(distances, pairs[place, 0], pairs[place, 1], score)
    return total


@kernel_part
def _add_evidence(distances: UsualDistances, first: int, second: int, score: Floats) -> None:
    """Add what distances to two markers that correspond say of all others."""
    spacing = distances.spacing
    for one in range(len(score)):
        if not distances.steady[first, one]:
            continue
        for other in range(len(score)):
            if distances.steady[second, other]:
                variance = distances.variance[first, one] + distances.variance[second, other]
                variance += (UNLIKE * spacing) ** 2
                error = distances.usual[first, one] - distances.usual[second, other]
                told = 0.5 * math.log(spacing * spacing / variance) - 0.5 * error * error / variance
                score[one, other] += max(told, -MOST_AGAINST)


@kernel
def weigh_spans(moments: MomentsOfPairs, least: float, room: Room, evidence: Floats) -> None:
    """Weigh exchanges of pairs in all spans of time that begin and end where they are hidden.

    Parameters
    ----------
    moments : MomentsOfPairs
        What is known.
    least : float, nats
        What does not explain all better than this is not weighed exactly.
    room : Room
        To work in.
    evidence : ndarray, shape (n_moments + 1, n_moments + 1), nats
        Receives how well all would be explained, by the moment with which a span begins and that behind it; -inf where
        too few pairs are exchanged, or all is not explained so well.
    """
    n_ends = len(evidence)
    for first in range(n_ends):
        for end in range(n_ends):
            evidence[first, end] = -math.inf
    for first in range(1, n_ends - 1):
        if _n_hidden(moments.hidden, first, first) >= LEAST_PAIRS:
            for end in range(first + 1, n_ends):
                if _n_hidden(moments.hidden, first, end) >= LEAST_PAIRS:
                    _write_partners(moments, first, end, room.partner)
                    evidence[first, end] = _evidence_if(moments, (first, end), least, room)


@kernel_part
def _n_hidden(hidden: Bools, first: int, end: int) -> int:
    """How many pairs are hidden at both ends."""
    count = 0
    for pair in range(hidden.shape[1]):
        if hidden[first, pair] and hidden[end, pair]:
            count += 1
    return count


@kernel_part
def _write_partners(moments: MomentsOfPairs, first: int, end: int, partner: Ints) -> None:
    """Write what each marker becomes if pairs that are hidden at both ends of a span are exchanged."""
    for marker in range(len(partner)):
        partner[marker] = marker
    for pair in range(len(moments.pairs)):
        if moments.hidden[first, pair] and moments.hidden[end, pair]:
            one, other = moments.pairs[pair, 0], moments.pairs[pair, 1]
            partner[one], partner[other] = other, one


@kernel_part
def _evidence_if(moments: MomentsOfPairs, span: tuple[int, int], least: float, room: Room) -> float:
    """How well all would be explained [nats] if markers were their partners in a span; -inf if that is below `least`.

    What markers that stay gain is at most the sum of what their distances gain.
    """
    partner, n_markers = room.partner, len(room.partner)
    total, most = 0.0, 0.0
    for one in range(n_markers):
        if partner[one] == one:
            total += moments.told[one]
            continue
        for other in range(n_markers):
            gain = _explained_if(moments, (one, other), span, partner)
            room.gains[one, other] = gain
            if partner[other] == other:
                most += max(gain - moments.gains[one, other], 0.0)
        total += told_by_best(room.gains[one], room.best)
    if total + most <= least:
        return -math.inf
    for one in range(n_markers):
        if partner[one] == one:
            for other in range(n_markers):
                stays = partner[other] == other
                room.row[other] = moments.gains[one, other] if stays else room.gains[other, one]
            total += told_by_best(room.row, room.best) - moments.told[one]
    return total if total > least else -math.inf


@kernel_part
def _explained_if(moments: MomentsOfPairs, pair: tuple[int, int], span: tuple[int, int], partner: Ints) -> float:
    """How well a distance would be explained [nats] if it were that of the partners in a span."""
    (one, other), (first, end), before = pair, span, moments.before
    there, back = partner[one], partner[other]
    last = len(before) - 1
    count = before[last, 0, one, other] - before[end, 0, one, other] + before[first, 0, one, other]
    total = before[last, 1, one, other] - before[end, 1, one, other] + before[first, 1, one, other]
    squares = before[last, 2, one, other] - before[end, 2, one, other] + before[first, 2, one, other]
    count += before[end, 0, there, back] - before[first, 0, there, back]
    total += before[end, 1, there, back] - before[first, 1, there, back]
    squares += before[end, 2, there, back] - before[first, 2, there, back]
    return distance_evidence(count, total, squares, moments.spacing)
