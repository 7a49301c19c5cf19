"""Which limbs are neighbours, by how near they stay to each other: what holds in anything articulated.

Where limbs hardly turn, or carry one marker or two, the gap of a joint says little: hands that hang still, or feet that
stand, could be joined to each other. But a marker of a limb stays near some marker of its neighbour, at a distance that
hardly changes, and no third limb lies between the two. How much each of this says is learned, as log odds that two
limbs are joined.
"""

from collections.abc import Sequence

import numpy as np

from skelgen.geometry.statistics import pair_distances
from skelgen.model.arrays import Floats, Ints, evenly_spread
from skelgen.stages.joints.segments import Segment

LOOKED_AT = 200
"""Frames: soft tissue and joints are slow, more would repeat each other."""

ENOUGH_LIMBS = 6
"""Fewer say nothing of what is usual."""

SOFT = 0.5
"""Part of the usual deviation between neighbours that is added to all: smaller ones are alike."""

TINY = 1e-3
"""mm; also of what is usual."""

SUREST = 8.0
"""Largest log odds: more would leave joint costs no say."""

APART = -100.0
"""Log odds that limbs of two bodies are joined: they are not, and are not tried."""

# Learned by tests/benchmarks/learn_nearness.py
BIAS = 5.020
WEIGHTS = {
    "how far": (-1.777, -0.316),
    "how unsteady": (1.108, 0.056),
    "product": (0.235, -0.010),
    "how far / nearest of the limb that has one nearer": (-1.155, 0.078),
    "how far / nearest of the other": (0.181, -0.632),
    "how unsteady / steadiest of the limb that has one steadier": (-0.518, -0.037),
    "how unsteady / steadiest of the other": (-0.495, -0.071),
    "product / least of the limb that has one less": (-0.143, 0.036),
    "product / least of the other": (-0.284, 0.056),
    "how far / longest step of the way with the shortest steps": (-5.134, 1.010),
    "how unsteady / most unsteady step of the steadiest way": (-1.229, -0.113),
    "product / largest step of the least way": (-0.042, 0.170),
    "limbs nearer to both": (0.883, -0.266),
    "limbs steadier to both": (-1.053, 0.341),
    "limbs of less product with both": (-2.230, 0.782),
    "how far in the mean / how far": (9.330, 3.937),
    "how many have one marker": (1.119, 0.449),
    "whether both have one marker": (-0.787, -0.787),
}
"""What the columns of `neighbour_features` hold, with the weights of each and of its square: logarithms, but for the
last two. How far is the largest usual distance of the two markers for which that is least, how unsteady its deviation
likewise; the product is the square of the first times the second. All are in units of the median over limbs and their
nearest."""

TRACE = 1e-9
"""Part of the odds beyond the surest that is kept: so little changes no decision, but keeps the order of far limbs."""


def neighbour_odds(segments: Sequence[Segment], frames: Ints, body_of_limb: Ints) -> Floats:
    """Return the log odds that each two limbs are joined, by how near each other they stay.

    Parameters
    ----------
    segments : sequence of Segment
        All limbs.
    frames : ndarray of intp
        Sampled frames.
    body_of_limb : ndarray of intp, shape (n_limbs,)
        What is near and far is judged in each body.

    Returns
    -------
    ndarray, shape (n_limbs, n_limbs)
        0 where nothing is known: on the diagonal, where limbs are never seen together, and if limbs are few; `APART`
        between bodies.
    """
    odds = np.full((len(segments), len(segments)), APART)
    for body in np.unique(body_of_limb):
        limbs = np.flatnonzero(body_of_limb == body)
        odds[np.ix_(limbs, limbs)] = _odds_within([segments[limb] for limb in limbs.tolist()], frames)
    return odds


def _odds_within(segments: Sequence[Segment], frames: Ints) -> Floats:
    """The same within one body."""
    if len(segments) < ENOUGH_LIMBS:
        return np.zeros((len(segments), len(segments)))
    features = neighbour_features([segment.markers[evenly_spread(frames, LOOKED_AT)] for segment in segments])
    weights, of_squares = (np.array(column) for column in zip(*WEIGHTS.values(), strict=True))
    odds = BIAS + features @ weights + features**2 @ of_squares
    odds = np.clip(np.nan_to_num(odds + odds.T) / 2, -SUREST / TRACE, SUREST / TRACE)
    odds = np.clip(odds, -SUREST, SUREST) + TRACE * odds
    np.fill_diagonal(odds, 0.0)
    return np.asarray(odds)


def neighbour_features(markers: Sequence[Floats]) -> Floats:
    """Describe every two limbs by numbers without unit, shape (n_limbs, n_limbs, n_features).

    Limbs that are not seen together have NaN; on the diagonal are zeros.

    Parameters
    ----------
    markers : sequence of ndarray, shape (n_frames, n_markers, 3), mm
        Markers of each limb in the same frames; NaN where unseen.
    """
    far, unsteady, product, middle = _nearest_markers(markers)
    known = np.isfinite(far)
    middle, farthest = (np.maximum(np.where(known, table, 1.0), TINY) for table in (middle, far))
    ratio = np.log(middle / farthest)
    tables = _over_median(far, 0.0), _over_median(unsteady, SOFT), _over_median(product, 0.0)
    apart = np.diag(np.full(len(far), np.inf))
    features = list(tables)
    for table in tables:
        beyond = table - (table + apart).min(axis=1)[:, np.newaxis]
        features += [np.maximum(beyond, beyond.T), np.minimum(beyond, beyond.T)]
    features += [table - _bottlenecks(table) for table in tables]
    features += [_between(table) for table in (far, unsteady, 2 * tables[0] + tables[1])]
    is_single = np.array([one.shape[1] == 1 for one in markers], dtype=np.float64)
    features += [ratio, is_single[:, np.newaxis] + is_single, is_single[:, np.newaxis] * is_single]
    described = np.where(known[:, :, np.newaxis], np.stack(features, axis=-1), np.nan)
    described[np.diag_indices(len(far))] = 0.0
    return described


def _nearest_markers(markers: Sequence[Floats]) -> tuple[Floats, Floats, Floats, Floats]:
    """Largest usual distance [mm], its deviation [mm], their product [mm^3] and mean distance [mm]: least of all pairs.

    Infinite on the diagonal, and where limbs are not seen together.
    """
    places = np.concatenate(markers, axis=1)
    limb_of = np.repeat(np.arange(len(markers)), [one.shape[1] for one in markers])
    found = np.full((4, len(markers), len(markers)), np.inf)
    first, second = np.triu_indices(len(limb_of), 1)
    across = limb_of[first] != limb_of[second]
    first, second = first[across], second[across]
    pairs = pair_distances(places, first, second)
    far, unsteady = pairs.largest, pairs.deviation
    one, other = limb_of[first], limb_of[second]
    for table, value in zip(found, (far, unsteady, far**2 * unsteady, pairs.mean), strict=True):
        np.minimum.at(table, (one, other), np.where(pairs.is_known, value, np.inf))
    found = np.minimum(found, found.transpose(0, 2, 1))
    return found[0], found[1], found[2], found[3]


def _over_median(table: Floats, floor: float) -> Floats:
    """Logarithms of values over the usual one, the median over limbs of the least; `floor` is added to the ratio."""
    filled = _filled(table)
    usual = max(float(np.median(filled.min(axis=1))), TINY)
    logarithms = np.log(np.maximum(filled / usual, TINY) + floor)
    np.fill_diagonal(logarithms, np.inf)
    return np.asarray(logarithms)


def _filled(table: Floats) -> Floats:
    """The largest value where a value is not known, infinity on the diagonal."""
    known = np.isfinite(table)
    filled = np.where(known, table, table[known].max(initial=TINY))
    np.fill_diagonal(filled, np.inf)
    return filled


def _bottlenecks(table: Floats) -> Floats:
    """Return for each two limbs the largest step of the path whose largest step is smallest."""
    steps = table.copy()
    np.fill_diagonal(steps, -np.inf)
    for limb in range(len(steps)):
        np.minimum(steps, np.maximum(steps[:, [limb]], steps[limb]), out=steps)
    return steps


def _between(table: Floats) -> Floats:
    """For each pair, log(1 + number of third limbs whose values with both of them are smaller)."""
    counted = np.zeros(table.shape)
    for limb, row in enumerate(table):
        less = np.maximum(row[:, np.newaxis], row) < table
        less[limb], less[:, limb] = False, False
        counted += less
    return np.log1p(counted)
