"""Which tracklets of a limb are the same marker: the most probable labels, with many hypotheses kept.

Tracklets come in the order in which they begin. In each hypothesis the next one is one of the markers so far that is
not seen meanwhile, or a new marker; its distances to the tracklets that are seen with it say how likely that is, by
what the hypothesis knows of the distances of these markers. The best hypotheses go on, so that what several explain
as well is decided by what comes later (Reid 1979, *An algorithm for tracking multiple targets*).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, kernel_part
from skelgen.model.arrays import Floats, Ints

FREEDOM = 4.0
"""Of Student's distribution, which has heavier tails than the normal one."""

IMPOSSIBLE = -1e300
"""Score of what cannot be."""

UNLIKELY = 25.0
"""nats; hypotheses that are worse than the best one by more do not go on."""


class LimbTracklets(NamedTuple):
    """Tracklets in rising order of their first frames.

    Attributes
    ----------
    spans : ndarray of intp, shape (n, 2)
        First and last frame of each.
    given : ndarray of intp, shape (n,)
        Marker of tracklets that are known, behind those that may be found; -1 for those to be labelled.
    weight : ndarray, shape (n, n)
        Independent moments that show two together; 0 where none does.
    distance : ndarray, shape (n, n), mm
        Their mean distance.
    prior : ndarray, shape (n, n), nats
        Other evidence that the second goes on where the first ended.
    """

    spans: Ints
    given: Ints
    weight: Floats
    distance: Floats
    prior: Floats


class LabelLaw(NamedTuple):
    """What is taken as probable.

    Attributes
    ----------
    deviation : ndarray, shape (n_markers,), mm
        Usual deviation of a distance to each marker; those that are given come last.
    spacing : float, mm
        How far apart markers are.
    existence : float, nats
        Cost of a marker more.
    n_found : int
        Markers that may be found.
    n_hypotheses : int
        Hypotheses that go on.
    """

    deviation: Floats
    spacing: float
    existence: float
    n_found: int
    n_hypotheses: int


class _Hypotheses(NamedTuple):
    """Per hypothesis: markers of tracklets, samples and sums of distances between markers, the latest tracklet of
    each marker, the number of markers, and the score [nats].
    """

    labels: Ints
    samples: Floats
    total: Floats
    latest: Ints
    used: Ints
    score: Floats


@array_kernel
def most_probable_labels(limb: LimbTracklets, law: LabelLaw) -> Ints:
    """Return the marker of each tracklet in the best hypothesis, shape (n,); -1 where too few may be found.

    Parameters
    ----------
    limb : LimbTracklets
        Tracklets that are on one limb, and known ones beside it.
    law : LabelLaw
        What is taken as probable.
    """
    n, most, n_found, n_markers = len(limb.spans), law.n_hypotheses, law.n_found, len(law.deviation)
    labels, latest = np.full((2, most, n), -1, dtype=np.intp), np.full((2, most, n_found), -1, dtype=np.intp)
    count, total = np.zeros((2, most, n_found, n_markers)), np.zeros((2, most, n_found, n_markers))
    used, score = np.zeros((2, most), dtype=np.intp), np.zeros((2, most))
    gains, partners = np.empty(most * n_found), np.empty(n, dtype=np.intp)
    n_kept, now = 1, 0
    for one in range(n):
        n_partners = _find_partners(one, limb.weight, partners)
        there = partners[:n_partners]
        old = _Hypotheses(labels[now], count[now], total[now], latest[now], used[now], score[now])
        if limb.given[one] >= 0:
            for row in range(n_kept):
                old.score[row] += _gain(one, limb.given[one], row, old, (limb, law, there))
                _learn(one, limb.given[one], row, old, (limb, law, there))
            continue
        then = 1 - now
        new = _Hypotheses(labels[then], count[then], total[then], latest[then], used[then], score[then])
        for row in range(n_kept):
            for marker in range(n_found):
                gains[row * n_found + marker] = old.score[row] + _gain_if_free(
                    one, marker, row, old, (limb, law, there)
                )
        n_next = _go_on(gains[: n_kept * n_found], one, old, new)
        for row in range(n_next):
            _learn(one, new.labels[row, one], row, new, (limb, law, there))
        if n_next > 0:
            n_kept, now = n_next, then
    best = 0
    for row in range(n_kept):
        if score[now, row] > score[now, best]:
            best = row
    found: Ints = labels[now, best].copy()
    return found


_Known = tuple[LimbTracklets, LabelLaw, Ints]
"""The tracklets, what is probable, and the earlier tracklets that are seen with one."""


@kernel_part
def _find_partners(one: int, weight: Floats, partners: Ints) -> int:
    """Write the earlier tracklets that are seen with one, and return how many they are."""
    count = 0
    for other in range(one):
        if weight[one, other] > 0.0:
            partners[count] = other
            count += 1
    return count


@kernel_part
def _gain_if_free(one: int, marker: int, row: int, state: _Hypotheses, known: _Known) -> float:
    """Evidence [nats] that a tracklet is a marker that may be found."""
    limb, law, _ = known
    if marker > state.used[row]:
        return IMPOSSIBLE
    if marker == state.used[row]:
        return -law.existence
    latest = state.latest[row, marker]
    if limb.spans[latest, 1] >= limb.spans[one, 0]:
        return IMPOSSIBLE
    return float(limb.prior[latest, one]) + _gain(one, marker, row, state, known)


@kernel_part
def _gain(one: int, marker: int, row: int, state: _Hypotheses, known: _Known) -> float:
    """Evidence [nats] of distances that a tracklet is this marker and no other one."""
    limb, law, partners = known
    gain = 0.0
    for other in partners:
        label = state.labels[row, other]
        low, high = min(marker, label), max(marker, label)
        if low < 0 or low >= law.n_found or state.samples[row, low, high] <= 0.0:
            continue
        missed = limb.distance[one, other] - state.total[row, low, high] / state.samples[row, low, high]
        narrow = law.deviation[high] ** 2 * (1.0 / state.samples[row, low, high] + 1.0 / limb.weight[one, other])
        wide = narrow + law.spacing**2
        gain += 0.5 * math.log(wide / narrow)
        gain -= 0.5 * (FREEDOM + 1.0) * math.log1p(missed**2 / (FREEDOM * narrow))
        gain += 0.5 * (FREEDOM + 1.0) * math.log1p(missed**2 / (FREEDOM * wide))
    return gain


@kernel_part
def _learn(one: int, marker: int, row: int, state: _Hypotheses, known: _Known) -> None:
    """Add the distances of a tracklet to what a hypothesis knows of its marker; this labels the tracklet."""
    limb, law, partners = known
    state.labels[row, one] = marker
    for other in partners:
        label = state.labels[row, other]
        low, high = min(marker, label), max(marker, label)
        if 0 <= low < law.n_found:
            state.samples[row, low, high] += limb.weight[one, other]
            state.total[row, low, high] += limb.weight[one, other] * limb.distance[one, other]


@kernel_part
def _go_on(gains: Floats, one: int, old: _Hypotheses, new: _Hypotheses) -> int:
    """Copy the best hypotheses, each with the marker that it gives to a tracklet; return how many they are."""
    n_found, n_next, first = new.latest.shape[1], 0, 0.0
    while n_next < len(new.score):
        best = 0
        for choice in range(len(gains)):
            if gains[choice] > gains[best]:
                best = choice
        if n_next == 0:
            first = gains[best]
        if gains[best] <= 0.5 * IMPOSSIBLE or gains[best] < first - UNLIKELY:
            break
        row, marker = best // n_found, best % n_found
        _copy(old, row, new, n_next)
        new.score[n_next], new.labels[n_next, one] = gains[best], marker
        new.latest[n_next, marker] = one
        new.used[n_next] = max(old.used[row], marker + 1)
        gains[best] = IMPOSSIBLE
        n_next += 1
    return n_next


@kernel_part
def _copy(old: _Hypotheses, row: int, new: _Hypotheses, place: int) -> None:
    """Write one of the old hypotheses to a place among the new ones."""
    for index in range(old.labels.shape[1]):
        new.labels[place, index] = old.labels[row, index]
    for low in range(old.samples.shape[1]):
        new.latest[place, low] = old.latest[row, low]
        for high in range(old.samples.shape[2]):
            new.samples[place, low, high] = old.samples[row, low, high]
            new.total[place, low, high] = old.total[row, low, high]
