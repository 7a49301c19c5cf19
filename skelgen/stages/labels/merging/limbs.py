r"""Tracklets merged limb by limb, with many hypotheses kept.

While two tracklets are seen together, the deviation of their distance tells whether they are on one limb, even in a
tenth of a second if the body moves. Tracklets are parted into limbs by the sum of these odds (greedy edge contraction;
Keuper et al. 2015, *Efficient decomposition of image and mesh graphs by lifted multicuts*). On each limb the most
probable markers of all its tracklets are sought at once (`skelgen._kernels.tracklet_labels`), so that three of a
limb's five markers that come back together are recognised by the distances between them, where one by one each could be
any. A limb that was not seen for a moment is found again by its shape.
"""

from __future__ import annotations

import itertools
from functools import cache
from typing import NamedTuple

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.distance_statistics import sums_of_distances
from skelgen._kernels.marker_exchanges import EXACT, EXISTENCE
from skelgen._kernels.tracklet_labels import FREEDOM, LabelLaw, LimbTracklets, most_probable_labels
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Floats, Ints
from skelgen.model.tracklets import TrackletPoints
from skelgen.stages.labels.merging.likelihood import SAMPLE_SECONDS
from skelgen.stages.labels.merging.windows import continuity_evidence

LEAST_TOGETHER = 8
"""Frames that show two tracklets together before their distance tells anything."""

STEADY_TOGETHER = 25
"""Frames from which the least deviations of distances are those of limbs."""

SPANS = (LEAST_TOGETHER, 12, 18, 27, 40, 60, 90, 135, 200, 10**9)
"""Frames by which pairs are parted: the deviation of a distance between limbs grows with time."""

RIGID_PRIOR = 0.1
"""Prior probability that two tracklets are on one limb."""

OUTLIERS = 1e-3
"""Density of deviations (natural logarithm) that are of neither kind."""

MOST_ODDS = 6.0
"""nats that one pair says at most."""

MOST_CONTINUITY = 8.0
"""nats that a prediction over a gap says at most."""

HYPOTHESES = 100
"""Hypotheses that are kept for each limb."""

MOST_MARKERS = 16
"""Markers of a limb; what moves together and has more, such as a person who stands still, is left alone."""

MOST_OVERLAPS = 64
"""Tracklets of a limb that one of them may overlap."""

ANCHORS = 8
"""Markers of other limbs that help to tell a limb's markers apart, those whose distances vary least."""

ANCHOR_MOMENTS = 6.0
"""Independent moments that show an anchor with a marker before it counts."""

ANCHOR_SPACINGS = 1.0
"""Of the spacing of markers: a distance that varies by more tells little."""

TURNS = 2
"""Turns in which each limb is labelled by what the others are."""

SHAPE_MARKERS = 6
"""Markers by which shapes are compared, those that are seen most."""

LEAST_SHAPE = 3
"""Fewer markers have no shape."""

SAME_LIMB = 1.0
"""nats beyond those of chance with which two sets of tracklets are one limb that was not seen for a moment: more limbs
than can be seen at once hardly exist."""


class PairTables(NamedTuple):
    """Tracklets, how long two are seen together (in independent moments), their mean distances [mm], odds that they
    are on one limb [nats], evidence that one goes on where another ended [nats], and the law of distances.
    """

    tracklets: TrackletPoints
    weight: Floats
    distance: Floats
    odds: Floats
    continuity: Floats
    deviation: float
    spacing: float
    variance: Floats


class _Anchors(NamedTuple):
    """Tracklets of other limbs whose markers are known: members, markers from 0, how distances to these vary [mm]."""

    members: Ints
    labels: Ints
    deviation: Floats


NO_ANCHORS = _Anchors(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))


def merge_on_limbs(pairs: PairTables, known: Ints) -> Ints:
    """Group tracklets into markers.

    Parameters
    ----------
    pairs : PairTables
        Tracklets, and what their distances say; from `measure_pairs`.
    known : ndarray of intp, shape (n_tracklets,)
        Groups of tracklets that are on one limb; from `main_groups`.

    Returns
    -------
    ndarray of intp, shape (n_tracklets,)
        Group of each tracklet, from 0 without holes; tracklets of one group never overlap in time.
    """
    among = _table(known)
    part = _parted(among.T @ pairs.odds @ among)[np.unique(known, return_inverse=True)[1]]
    limbs = [np.flatnonzero(part == number) for number in range(part.max() + 1)]
    marker, limb = np.full((2, len(known)), -1, dtype=np.intp)
    for number, (members, labels) in enumerate(_joined(pairs, [(part, _labelled(pairs, part)) for part in limbs])):
        marker[members], limb[members] = marker.max(initial=-1) + 1 + labels, number
    for _ in range(TURNS):
        for number in range(limb.max() + 1):
            members = np.flatnonzero(limb == number)
            if 2 < len(np.unique(marker[members])) < len(members):
                found = _labelled(pairs, members, _anchors(pairs, members, marker))
                marker[members] = marker.max() + 1 + found
        marker = np.unique(marker, return_inverse=True)[1]
    return marker


def main_groups(label: Ints, tracklet: Ints) -> Ints:
    """Return the label that most points of each tracklet have; of those without labels a number of its own.

    Parameters
    ----------
    label : ndarray of intp, shape (n,)
        Label of each point, -1 for none.
    tracklet : ndarray of intp, shape (n,)
        Its tracklet; each has a point.
    """
    n_labels = int(label.max(initial=-1)) + 1
    counts = np.zeros((int(tracklet.max(initial=-1)) + 1, n_labels + 1), dtype=np.intp)
    np.add.at(counts, (tracklet, np.where(label < 0, n_labels, label)), 1)
    most = counts.argmax(axis=1)
    return np.where(most < n_labels, most, n_labels + np.arange(len(most)))


def _anchors(pairs: PairTables, members: Ints, marker: Ints) -> _Anchors:
    """The markers of other limbs whose distances to a limb's markers vary least."""
    outside = np.setdiff1d(np.arange(len(marker)), members)
    among = [_table(marker[members]), _table(marker[outside])]
    block = np.ix_(members, outside)
    weight, mean = pairs.weight[block], pairs.distance[block]
    total = among[0].T @ weight @ among[1]
    middle = among[0].T @ (weight * mean) @ among[1] / np.maximum(total, 1.0)
    squares = among[0].T @ (weight * (mean**2 + pairs.variance[block])) @ among[1] / np.maximum(total, 1.0)
    known = total >= ANCHOR_MOMENTS
    deviation = np.sqrt(np.maximum(squares - middle**2, pairs.deviation**2))
    deviation[~known] = np.nan
    usual = np.full(deviation.shape[1], np.inf)
    usual[known.any(axis=0)] = np.nanmedian(deviation[:, known.any(axis=0)], axis=0)
    chosen = np.argsort(usual, kind="stable")[:ANCHORS]
    chosen = chosen[usual[chosen] < ANCHOR_SPACINGS * pairs.spacing]
    which = np.full(len(usual), -1, dtype=np.intp)
    which[chosen] = np.arange(len(chosen))
    label = which[np.unique(marker[outside], return_inverse=True)[1]]
    return _Anchors(outside[label >= 0], label[label >= 0], usual[chosen])


def _table(labels: Ints) -> Floats:
    """Which tracklets are which of the markers that these have, shape (n, n_markers)."""
    return np.asarray(labels[:, np.newaxis] == np.unique(labels), dtype=np.float64)


def measure_pairs(points: Floats, tracklets: TrackletPoints, rate: float, spacing: float) -> PairTables:
    """Measure all distances between tracklets.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    tracklets : TrackletPoints
        What to group.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.
    """
    order = np.argsort(tracklets.frames, kind="stable")
    starts = np.searchsorted(tracklets.frames[order], np.arange(tracklets.n_frames + 1))
    arrays = points[tracklets.points[order]], tracklets.tracklet_of_point[order].astype(np.intp), starts
    weights = np.ones(tracklets.n_frames)
    count, total, squares = sums_of_distances(len(tracklets), *contiguous(*arrays, weights))
    np.fill_diagonal(count, 0.0)
    several = np.maximum(count, 1.0)
    mean = total / several
    deviation = np.sqrt(np.maximum(squares - several * mean**2, 0.0) / np.maximum(count - 1.0, 1.0))
    odds, rigid = rigid_odds(count, np.maximum(deviation, EXACT))
    continuity = np.zeros(count.shape)
    before, after, evidence = continuity_evidence(points, tracklets, rate, spacing)
    continuity[before, after] = np.clip(evidence, -MOST_CONTINUITY, MOST_CONTINUITY)
    weight = np.where(count > 0.0, 1.0 + count / (SAMPLE_SECONDS * rate), 0.0)
    return PairTables(tracklets, weight, mean, odds, continuity, rigid, spacing, deviation**2)


def rigid_odds(count: Floats, deviation: Floats) -> tuple[Floats, float]:
    """Logarithm of the odds [nats] that tracklets are on one limb, shape (n, n), and the usual deviation there [mm].

    On a limb deviations are what the two steadiest partners of tracklets have; else they are what pairs that are seen
    together as long usually have, most of which are on different limbs.

    Parameters
    ----------
    count : ndarray, shape (n, n)
        Frames that show two together.
    deviation : ndarray, shape (n, n), mm
        Deviation of their distance, above 0.
    """
    width = np.log(deviation)
    steadiest = np.sort(np.where(count >= STEADY_TOGETHER, width, np.inf), axis=1)[:, :2]
    steadiest = steadiest[np.isfinite(steadiest).all(axis=1)].ravel()
    if not len(steadiest):
        return np.zeros(count.shape), EXACT
    middle, spread = _middle_and_spread(steadiest, 0.1)
    odds = np.zeros(count.shape)
    for least, most in itertools.pairwise(SPANS):
        some = (count >= least) & (count < most)
        if not some.any():
            continue
        usual, scatter = _middle_and_spread(width[some], 0.3)
        own = np.hypot(spread, np.sqrt(0.5 / (least - 1)))
        rigid = -0.5 * (np.maximum(width[some] - middle, 0.0) / own) ** 2 - np.log(own)
        loose = np.logaddexp(-0.5 * ((width[some] - usual) / scatter) ** 2 - np.log(scatter), np.log(OUTLIERS))
        odds[some] = np.clip(rigid - loose + np.log(RIGID_PRIOR), -MOST_ODDS, MOST_ODDS)
    return odds, float(np.exp(middle))


def _middle_and_spread(values: Floats, least: float) -> tuple[float, float]:
    """Median and robust deviation, at least so much."""
    middle = float(np.median(values))
    return middle, max(SIGMA_OF_MEDIAN * float(np.median(np.abs(values - middle))), least)


def _parted(odds: Floats) -> Ints:
    """Parts with the largest sums of odds, greedily: the limb of each tracklet, from 0 without holes."""
    odds = odds.copy()
    np.fill_diagonal(odds, -np.inf)
    part = np.arange(len(odds))
    best, value = odds.argmax(axis=1), odds.max(axis=1, initial=-np.inf)
    while len(part) and value.max() > 0.0:
        one = int(value.argmax())
        other = int(best[one])
        odds[one] += odds[other]
        odds[:, one] = odds[one]
        odds[one, one] = -np.inf
        odds[other] = odds[:, other] = -np.inf
        part[part == other] = one
        value[other] = -np.inf
        changed = np.flatnonzero((best == one) | (best == other) | (odds[one] >= value))
        changed = np.union1d(changed, one)
        best[changed] = odds[changed].argmax(axis=1)
        value[changed] = odds[changed, best[changed]]
    return np.asarray(np.unique(part, return_inverse=True)[1], dtype=np.intp)


def _labelled(pairs: PairTables, members: Ints, anchors: _Anchors = NO_ANCHORS) -> Ints:
    """Markers of a limb's tracklets, from 0; each one by itself where there are too many."""
    tracklets = pairs.tracklets
    overlaps = pairs.tracklets.first[members][:, np.newaxis] <= pairs.tracklets.last[members]
    if (overlaps & overlaps.T).sum(axis=1).max() > MOST_OVERLAPS:
        return np.arange(len(members))
    n_found = min(len(members), MOST_MARKERS)
    all_members = np.concatenate([members, anchors.members])
    given = np.concatenate([np.full(len(members), -1, dtype=np.intp), n_found + anchors.labels])
    order = np.argsort(tracklets.first[all_members], kind="stable")
    chosen = all_members[order]
    spans = np.stack([tracklets.first[chosen], tracklets.last[chosen]], axis=1).astype(np.intp)
    block = np.ix_(chosen, chosen)
    limb = LimbTracklets(
        *contiguous(spans, given[order], pairs.weight[block], pairs.distance[block], pairs.continuity[block])
    )
    deviation = np.concatenate([np.full(n_found, pairs.deviation), anchors.deviation])
    law = LabelLaw(deviation, pairs.spacing, EXISTENCE, n_found, HYPOTHESES)
    found = np.empty(len(chosen), dtype=np.intp)
    found[order] = most_probable_labels(limb, law)
    found = found[: len(members)]
    missing = np.flatnonzero(found < 0)
    found[missing] = found.max(initial=-1) + 1 + np.arange(len(missing))
    return found


class _Shape(NamedTuple):
    """Distances between the markers of a limb that are seen most [mm], and their weights."""

    weight: Floats
    distance: Floats


def _joined(pairs: PairTables, limbs: list[tuple[Ints, Ints]]) -> list[tuple[Ints, Ints]]:
    """Join limbs of one shape that are not seen together: members and labels of each limb."""
    found = dict(enumerate(limbs))
    shapes = {number: _shape(pairs, *limb) for number, limb in found.items()}
    shapes = {number: shape for number, shape in shapes.items() if len(shape.weight) >= LEAST_SHAPE}
    evidence: dict[tuple[int, int], float] = {}
    new = list(itertools.combinations(shapes, 2))
    while True:
        for one, other in new:
            value = _evidence(pairs, (found[one], found[other]), (shapes[one], shapes[other]))
            if value >= SAME_LIMB:
                evidence[one, other] = value
        if not evidence:
            return list(found.values())
        one, other = max(evidence, key=lambda both: evidence[both])
        members = np.concatenate([found[one][0], found.pop(other)[0]])
        found[one] = members, _labelled(pairs, members)
        shapes[one] = _shape(pairs, *found[one])
        del shapes[other]
        evidence = {both: value for both, value in evidence.items() if one not in both and other not in both}
        new = [(one, third) for third in shapes if third != one]


def _shape(pairs: PairTables, members: Ints, labels: Ints) -> _Shape:
    """The markers of a limb that are seen most."""
    among = (labels[:, np.newaxis] == np.arange(labels.max() + 1)).astype(np.float64)
    block = np.ix_(members, members)
    weight = among.T @ pairs.weight[block] @ among
    total = among.T @ (pairs.weight[block] * pairs.distance[block]) @ among
    seen = np.sort(np.argsort(-weight.sum(axis=1), kind="stable")[:SHAPE_MARKERS])
    block = np.ix_(seen, seen)
    return _Shape(weight[block], total[block] / np.maximum(weight[block], 1.0))


def _evidence(
    pairs: PairTables, limbs: tuple[tuple[Ints, Ints], tuple[Ints, Ints]], shapes: tuple[_Shape, _Shape]
) -> float:
    """Evidence [nats] that two sets of tracklets are one limb, by their shapes, over all ways in which they may fit."""
    few, many = sorted(shapes, key=lambda shape: len(shape.weight))
    n_few = len(few.weight)
    odds = float(pairs.odds[np.ix_(limbs[0][0], limbs[1][0])].sum())
    if odds < -MOST_ODDS:
        return -np.inf
    ways = _ways(n_few, len(many.weight))
    first, second = np.triu_indices(n_few, 1)
    weight, distance = (table[ways[:, first], ways[:, second]] for table in many)
    known = (few.weight[first, second] > 0.0) & (weight > 0.0)
    narrow = 1.0 / np.maximum(few.weight[first, second], 1.0) + 1.0 / np.maximum(weight, 1.0)
    narrow *= pairs.deviation**2
    wide = narrow + pairs.spacing**2
    squares = (few.distance[first, second] - distance) ** 2 / FREEDOM
    gain = 0.5 * np.log(wide / narrow) + (FREEDOM + 1.0) / 2 * (np.log1p(squares / wide) - np.log1p(squares / narrow))
    return float(np.logaddexp.reduce(np.where(known, gain, 0.0).sum(axis=1)) - np.log(len(ways))) + min(odds, 0.0)


@cache
def _ways(few: int, many: int) -> Ints:
    """Ways in which few markers may be some of many, shape (n_ways, few)."""
    return np.array(list(itertools.permutations(range(many), few)), dtype=np.intp)
