"""Whether two markers share a limb, as learned from people, animals and machines: log odds of each pair.

One limit in millimetres cannot serve a whole body: feet that stand still keep their distance from each other better
than the skin of a pelvis does. What counts is how a pair compares with others: with what else either marker keeps its
distance from, with the motion and the noise of the take, with how far markers are from each other and from their
neighbours, and with how many markers lie between the two.
"""

import numpy as np

from skelgen.geometry.statistics import pair_distances
from skelgen.model.arrays import Bools, Floats, spread_frames

LOOKED_AT = 200
"""Frames."""

KEPT = (0.03, 0.97)
"""Quantiles within which distances count: labels may jump."""

SMALLEST = 0.3
"""Part of the take's noise: smaller deviations of a distance count as this much."""

TINY = 1e-3
"""mm."""


FEATURES = (
    "deviation / noise",
    "deviation / motion",
    "distance / spacing",
    "distance / extent",
    "deviation / distance",
    "deviation / steadiest of the steadier marker",
    "deviation / steadiest of the other",
    "distance / nearest of the marker that has one nearer",
    "distance / nearest of the other",
    "how differently others move against both",
    "others steadier with both",
    "others nearer to both",
)
"""Logarithms of what the columns of `pair_features` hold."""

# Learned by tests/benchmarks/learn_pairs.py
BIAS = -10.951
WEIGHTS = (-0.097, -0.866, 1.451, -3.647, -4.223, -1.575, -2.148, -1.578, -1.484, 0.326, 1.209, 0.619)
SQUARE_WEIGHTS = (0.228, -0.139, -1.047, -1.302, -0.422, 0.249, 0.141, 0.271, 0.173, 0.405, -0.222, -0.430)


FINEST = 0.02
"""Part of the median deviation that those of pairs on a limb have, where the weights were learned, at least."""

FINER = 0.25
"""Power with which smaller parts count that were not learned from."""

_OF_STEADINESS = [FEATURES.index(name) for name in ("deviation / motion", "deviation / distance")]


def log_odds(positions: Floats, *, bounded: bool = False) -> Floats:
    """Return the log odds that two markers share a limb, shape (n_markers, n_markers).

    They are 0 on the diagonal, and for markers that are not seen together.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    bounded : bool
        Whether the sum of squares is kept from going on beyond what it was learned from. Of bodies that are rigid to a
        micrometre it says else that all pairs on a limb are apart, and that all others are on one.
    """
    features = pair_features(positions, bounded=bounded)
    if bounded:  # a pair that is steadier is not less likely
        turns = [-WEIGHTS[one] / (2.0 * SQUARE_WEIGHTS[one]) for one in _OF_STEADINESS]
        features[..., _OF_STEADINESS] = np.maximum(features[..., _OF_STEADINESS], turns)
    odds = BIAS + features @ np.array(WEIGHTS) + features**2 @ np.array(SQUARE_WEIGHTS)
    np.fill_diagonal(odds, 0.0)
    return np.asarray(np.nan_to_num(odds + odds.T) / 2, dtype=np.float64)


def pair_features(positions: Floats, *, bounded: bool = False) -> Floats:
    """Describe every pair of markers by numbers without unit, shape (n_markers, n_markers, n_features).

    Markers that are not seen together have NaN.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    bounded : bool
        Whether small deviations count for less than they are; see `FINEST`.
    """
    shown = positions[spread_frames(len(positions), LOOKED_AT)]
    known, unsteady, middle, far = _distances(shown)
    off = ~np.eye(len(far), dtype=bool)
    if bounded:
        least = max(FINEST * float(np.median(unsteady[off])), TINY)
        unsteady = np.where(unsteady < least, least * (np.maximum(unsteady, TINY) / least) ** FINER, unsteady)
    alone = np.diag(np.full(len(far), np.inf))
    steadiest, nearest = (unsteady + alone).min(axis=1), np.maximum((far + alone).min(axis=1), TINY)
    noise = max(float(np.median(steadiest)), TINY)
    floor = SMALLEST * noise
    deviation = np.log(np.maximum(unsteady, floor))
    away = np.log(np.maximum(far, TINY))
    motion, extent = float(np.median(deviation[off])), float(np.median(away[off]))
    apart = deviation - np.log(np.maximum(steadiest, floor))[:, np.newaxis]
    beyond = away - np.log(nearest)[:, np.newaxis]
    features = [
        deviation - np.log(noise),
        deviation - motion,
        away - np.log(np.median(nearest)),
        away - extent,
        deviation - np.log(np.maximum(middle, TINY)),
        np.maximum(apart, apart.T),
        np.minimum(apart, apart.T),
        np.maximum(beyond, beyond.T),
        np.minimum(beyond, beyond.T),
        *_between(deviation, away),
    ]
    return np.stack([np.where(known, np.where(off, one, 0.0), np.nan) for one in features], axis=-1)


def _between(deviation: Floats, away: Floats) -> list[Floats]:
    """For each pair: how differently others move against the two; how many are steadier with both; how many nearer."""
    unlike, steadier, nearer = np.zeros((3, *deviation.shape))
    for marker, (row, gap) in enumerate(zip(deviation, away, strict=True)):
        others = np.arange(len(row)) != marker
        difference = np.abs(row - deviation)[:, others]
        own = np.where(others, np.abs(row - np.diag(deviation)), 0.0)
        unlike[marker] = (difference.sum(axis=1) - own) / max(len(row) - 2, 1)
        steadier[marker] = (np.maximum(row, deviation)[:, others] < row[:, np.newaxis]).sum(axis=1)
        nearer[marker] = (np.maximum(gap, away)[:, others] < gap[:, np.newaxis]).sum(axis=1)
    return [np.log(1e-2 + unlike), np.log1p(steadier), np.log1p(nearer)]


def _distances(positions: Floats) -> tuple[Bools, Floats, Floats, Floats]:
    """Whether markers are seen together; deviation, mean and largest usual distance [mm]; the largest of all if not."""
    n_markers = positions.shape[1]
    first, second = np.triu_indices(n_markers)
    pairs = pair_distances(positions, first, second, KEPT, method="nearest", clipped=True)
    known = np.zeros((n_markers, n_markers), dtype=np.bool_)
    spread, mean, farthest = np.empty((3, n_markers, n_markers))
    tables = (known, spread, mean, farthest)
    for table, values in zip(tables, (pairs.is_known, pairs.deviation, pairs.mean, pairs.largest), strict=True):
        table[first, second] = table[second, first] = values
    spread, mean, farthest = (np.where(known, one, one[known].max(initial=TINY)) for one in (spread, mean, farthest))
    return known, spread, mean, farthest
