"""What distances to witnesses say: whether two tracklets are one marker, and how badly points suit a marker.

Tracklets are compared by their mean distances to the same witnesses, points of a marker moment by moment with what is
usual of another marker's. The formula of the evidence stands in `skelgen.stages.labels.merging.likelihood`. What both
kinds of pairs share, rigid ones and others, cancels out of every ratio, and with it the gamma functions of Student's
distribution.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen.model.arrays import Floats, Ints

WITNESSES = 6
"""Tracklets to which distances are compared: a place has three coordinates, so more would repeat these."""

RIGID_PRIOR = 0.2
"""Prior probability that a pair is rigid."""

PRIOR_SAMPLES = 4.0
"""Weight of the usual deviation of distances, in samples."""

TRUSTED_SAMPLES = 8.0
"""More samples do not make a better witness, so that rigidity counts before duration."""

SLOW_FREEDOM = 4.0
"""Of Student's distribution for means that may rest on one pose each: heavy tails."""

MOST_ODDS = 50.0
"""nats; keeps exponentials finite."""


class DistanceTables(NamedTuple):
    """What is known of the distances between tracklets, shape (n, n) each.

    Attributes
    ----------
    samples : ndarray
        Number of samples.
    mean, scatter : ndarray, mm, mm^2
        Mean, and sum of squares about it.
    witness : ndarray
        How much each tracklet tells of another one's place, from `witness_weights`; 0 for nothing.
    """

    samples: Floats
    mean: Floats
    scatter: Floats
    witness: Floats


class UsualDeviations(NamedTuple):
    """Usual deviations of a distance [mm]: on one limb, and between any two markers; and the markers' spacing."""

    rigid: float
    loose: float
    spacing: float


def witness_weights(count: Floats, scatter: Floats, usual: UsualDeviations) -> Floats:
    """How much distances tell of a place: probability of being rigid, samples, steadiness; shape as the tables.

    Parameters
    ----------
    count, scatter : ndarray
        Number of samples of each distance, and sum of squares about their mean [mm^2].
    usual : UsualDeviations
        The take's own.
    """
    weight = np.empty(count.shape)
    _write_weights(np.ravel(count), np.ravel(scatter), usual, weight.reshape(-1))
    return weight


def evidence_of_one(
    one: int, others: Ints, tables: DistanceTables, usual: UsualDeviations, *, counts_loose: bool, is_slow: bool
) -> tuple[Floats, Floats]:
    """Evidence [nats] of distances that a tracklet is the same marker as others, and how many distances say so.

    Parameters
    ----------
    one : int
        The tracklet.
    others : ndarray of intp, shape (n_others,)
        The others.
    tables : DistanceTables
        What is known.
    usual : UsualDeviations
        The take's own.
    counts_loose : bool
        Whether distances that are not rigid count; else the number is that of rigid ones.
    is_slow : bool
        Whether what a tracklet's distances did not vary by may still be the error of their mean.

    Returns
    -------
    evidence, number : ndarray, shape (n_others,)
        Sums over the `WITNESSES` best witnesses at most.
    """
    found = np.zeros((2, len(others)))
    partners = np.flatnonzero(tables.witness[one])  # few tracklets of a long take are ever seen together
    room = np.empty(WITNESSES), np.empty(WITNESSES, dtype=np.intp)
    flags = np.array([counts_loose, is_slow])
    _add_evidence(one, others, partners, (tables, usual, flags), room, found)
    return found[0], found[1]


@kernel
def _write_weights(count: Floats, scatter: Floats, usual: UsualDeviations, weight: Floats) -> None:
    before = _log_prior_odds(usual)
    for pair in range(len(count)):
        weight[pair] = 0.0
        if count[pair] > 0.0:
            freedom = count[pair] - 1.0
            probability = _probability(_log_odds(before, freedom, scatter[pair], usual))
            variance = (PRIOR_SAMPLES * usual.rigid**2 + scatter[pair]) / (PRIOR_SAMPLES + freedom)
            weight[pair] = probability * min(count[pair], TRUSTED_SAMPLES) * usual.rigid / math.sqrt(variance)


@kernel
def _add_evidence(
    one: int,
    others: Ints,
    partners: Ints,
    known: tuple[DistanceTables, UsualDeviations, Ints],
    room: tuple[Floats, Ints],
    found: Floats,
) -> None:
    """Add evidence and number of distances of each of some others to one."""
    tables, usual, flags = known
    before, best = _log_prior_odds(usual), room[1]
    for row in range(len(others)):
        other = others[row]
        n_best = _find_witnesses(one, other, partners, tables, room)
        for place in range(n_best):
            both = tables.samples[one, best[place]], tables.samples[other, best[place]]
            scatters = tables.scatter[one, best[place]], tables.scatter[other, best[place]]
            missed = tables.mean[other, best[place]] - tables.mean[one, best[place]]
            odds = _log_odds(before, both[0] + both[1] - 2.0, scatters[0] + scatters[1], usual)
            found[0, row] += _log_ratio(missed * missed, both, scatters, (odds, usual, flags))
            found[1, row] += 1.0 if flags[0] else _probability(odds)


@kernel_part
def _find_witnesses(one: int, other: int, partners: Ints, tables: DistanceTables, room: tuple[Floats, Ints]) -> int:
    """Write the tracklets that tell most of both, of equal ones the first, and return how many they are."""
    count = 0
    for partner in partners:
        value = tables.witness[one, partner] * tables.witness[other, partner]
        if value > 0.0:
            count = ranked(room[0], room[1], count, value, partner)
    return count


@kernel_part
def ranked(rank: Floats, best: Ints, count: int, value: float, item: int) -> int:
    """Put an item among the best ones if there is room or its value is larger, of equal ones last; return their count.

    Parameters
    ----------
    rank, best : ndarray, shape (n_most,)
        Values, falling, and whose they are; the first `count` of them are set.
    count : int
        How many they are.
    value, item : float, int
        The item's value, and the item.
    """
    place = count
    while place > 0 and rank[place - 1] < value:
        place -= 1
    if place == len(best):
        return count
    count = min(count + 1, len(best))
    for later in range(count - 1, place, -1):
        rank[later], best[later] = rank[later - 1], best[later - 1]
    rank[place], best[place] = value, item
    return count


@kernel_part
def _log_prior_odds(usual: UsualDeviations) -> float:
    """Log odds that a distance is rigid before its scatter counts, with the norms of both priors of its variance."""
    return math.log(RIGID_PRIOR / (1.0 - RIGID_PRIOR)) + PRIOR_SAMPLES * math.log(usual.rigid / usual.loose)


@kernel_part
def _log_odds(before: float, freedom: float, scatter: float, usual: UsualDeviations) -> float:
    """Log odds that a distance with this scatter is rigid, from those before it counts."""
    rigid, loose = PRIOR_SAMPLES * usual.rigid**2 + scatter, PRIOR_SAMPLES * usual.loose**2 + scatter
    return before - 0.5 * (PRIOR_SAMPLES + freedom) * math.log(rigid / loose)


@kernel_part
def _probability(odds: float) -> float:
    return 1.0 / (1.0 + math.exp(-min(max(odds, -MOST_ODDS), MOST_ODDS)))


@kernel_part
def _log_sum(one: float, other: float) -> float:
    """Logarithm of the sum of two exponentials."""
    return max(one, other) + math.log1p(math.exp(-abs(one - other)))


@kernel_part
def _log_ratio(
    square: float,
    counts: tuple[float, float],
    scatters: tuple[float, float],
    known: tuple[float, UsualDeviations, Ints],
) -> float:
    """Log likelihood of one marker over two by one distance, whose odds to be rigid are known."""
    odds, usual, flags = known
    near, far = _likelihoods(square, counts, scatters, usual.rigid, usual.spacing, flags)
    loosely_near, loosely_far = _likelihoods(square, counts, scatters, usual.loose, usual.spacing, flags)
    same = _log_sum(odds + near, loosely_near if flags[0] else loosely_far)
    return same - _log_sum(odds + far, loosely_far)


@kernel_part
def _likelihoods(
    square: float, counts: tuple[float, float], scatters: tuple[float, float], tau: float, spacing: float, flags: Ints
) -> tuple[float, float]:
    """Log likelihoods that two means differ so if they are of one marker and of two, but for what both share."""
    freedom = PRIOR_SAMPLES + counts[0] + counts[1] - 2.0
    variance = (PRIOR_SAMPLES * tau * tau + scatters[0] + scatters[1]) / freedom
    narrow = variance / counts[0] + variance / counts[1]
    if flags[1]:
        narrow = max(variance / counts[0], variance - scatters[0] / counts[0])
        narrow += max(variance / counts[1], variance - scatters[1] / counts[1])
        freedom = min(freedom, SLOW_FREEDOM)
    wide = narrow + spacing * spacing
    half = 0.5 * (freedom + 1.0)
    near = -0.5 * math.log(narrow) - half * math.log1p(square / (freedom * narrow))
    return near, -0.5 * math.log(wide) - half * math.log1p(square / (freedom * wide))


MOST_MISFIT = 5.0
"""nats that one distance says at most against a point."""


@kernel
def write_misfits(
    marker: int, points: Ints, witnesses: Ints, distance: Floats, law: tuple[Floats, Floats], misfits: Floats
) -> None:
    """Write the misfits of some markers' points to one marker: sums of min(off^2 / 2, `MOST_MISFIT`) [nats].

    Parameters
    ----------
    marker : int
        The marker whose distances are usual.
    points : ndarray of intp, shape (n_points,)
        Markers whose points are looked at.
    witnesses : ndarray of intp, shape (n_witnesses,)
        Markers to which distances count; -1 for none. A marker says nothing of its own points.
    distance : ndarray, shape (n_markers, n_markers, n_moments), mm
        NaN where unseen, which says nothing.
    law : tuple of two ndarrays, shape (n_markers, n_markers), mm
        Usual distances, and how far they vary.
    misfits : ndarray, shape (n_markers, n_markers, n_moments), nats
        Receives them at ``[points, marker]``.
    """
    usual, deviation = law
    for point in points:
        for moment in range(misfits.shape[2]):
            misfits[point, marker, moment] = 0.0
        for witness in witnesses:
            if witness < 0 or witness == point:
                continue
            middle, width = usual[marker, witness], deviation[marker, witness]
            for moment in range(misfits.shape[2]):
                off = (distance[point, witness, moment] - middle) / width
                if not math.isnan(off):
                    misfits[point, marker, moment] += min(off * off / 2.0, MOST_MISFIT)
