"""How sure it is that a marker is on its limb: probabilities from what all pairs of markers say.

The mean log odds of a marker's pairs with its limb are compared with those of the limb that suits it next best, or with
0 for a limb of its own; where a person's limbs follow from the markers that people wear, these speak, too. How often
such a marker is on its limb is learned from simulated takes, whose truth is known; the other limbs share the rest by
their odds.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from skelgen.geometry.statistics import PairDistances, pair_distances
from skelgen.model import Limbs
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.progress import counted
from skelgen.stages.limbs.pair_evidence import log_odds
from skelgen.stages.limbs.parameters import MarkerConstraints
from skelgen.stages.limbs.relative_motion import pairs_within
from skelgen.stages.limbs.worn_places import worn_odds

LARGEST = 6.0
"""Log odds of one pair: more would let it speak for all others."""

MOST_DISTANCES = 5_000_000
"""Distances that are computed in all: of takes with very many markers fewer frames are used."""

LEAST_FRAMES = 20

PAIR, POSED = 2, 3
"""Markers of limbs: a pair, and the fewest that show how their limb turns."""

TINY = 1e-3
"""mm; a smaller deviation is rounding."""

MOST_NAMED = 8
"""Most doubtful markers that a notice names; nobody reads more."""

LIKE_OTHERS = 1.5
"""Times the usual deviation within larger limbs: that of a pair on one limb is hardly larger."""

OF_BEND = 3.0
"""Log odds lost for each time that a pair's deviation is e times that: phalanges of one marker each make such pairs."""

ENOUGH_PAIRS = 6
"""Pairs of markers of one limb, and of different limbs over such a length, that tell whether limbs stand out."""

SHORT = 0.95
"""Quantile of the distances within limbs up to which those between limbs are compared."""

STANDS_OUT = 0.6
"""Contrast from which limbs are rigid: of bodies that bend everywhere it is .55 at most, of others .66 at least."""

OF_CONTRAST = 6.0
"""Log odds lost where limbs do not stand out at all; none where they do, and in proportion between."""

OF_WORN = 0.5
"""Weight of what is worn beside what pairs do: it is right or wrong of all pairs at once."""

# Learned by tests/benchmarks/doubt.py
BIAS, OF_LEAD, OF_SIZE = 2.27, 0.61, -1.49
"""Of markers with mates: constant, lead over the next best limb, logarithm of the limb's size over the usual
size."""

BIAS_ALONE, OF_LEAD_ALONE = -1.84, 0.95
"""Of the only marker of a limb."""


def memberships(
    positions: Floats, groups: Ints, constraints: MarkerConstraints, stands_out: float, whole: Floats | None = None
) -> Floats:
    """Return the probability that each marker is on each limb, shape (n_markers, n_limbs).

    What lacks to 1 is the probability that the marker is on none of them.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    groups : ndarray of intp, shape (n_markers,)
        Limb of each marker, numbered without holes.
    constraints : MarkerConstraints
        Which markers share a limb and which do not.
    stands_out : float
        The `contrast` of these limbs.
    whole : ndarray, shape (n_take_frames, n_markers, 3), mm, optional
        All frames, if what is worn speaks for limbs.
    """
    is_member = groups[:, np.newaxis] == np.arange(groups.max() + 1)
    suits = limb_odds(positions, is_member, whole)
    lost = OF_CONTRAST * float(np.clip(1 - stands_out / STANDS_OUT, 0.0, 1.0))
    own = own_probability(suits, is_member, lost + OF_BEND * pair_bends(positions, is_member))
    refused = (constraints.apart @ is_member) | is_member
    others = np.where(refused, 0.0, np.exp(suits))  # 1 being a limb of its own
    rest = others.sum(axis=1) + ~is_alone(is_member)
    probability = others * ((1 - own) / np.maximum(rest, np.finfo(np.float64).tiny))[:, np.newaxis]
    probability[is_member] = np.where(rest > 0, own, 1.0)
    for block in constraints.blocks:
        if len(block) > 1:
            probability[list(block)] = is_member[list(block)]
    return np.asarray(probability)


def doubt_notices(limbs: Limbs, names: Sequence[str]) -> Iterator[str]:
    """Say which markers are perhaps on another limb, the least sure first.

    Parameters
    ----------
    limbs : Limbs
        With probabilities.
    names : sequence of str
        All markers.
    """
    rivals, shares = limbs.rivals
    for marker in limbs.doubtful[:MOST_NAMED].tolist():
        own, share = 100 * limbs.probability[marker], 100 * shares[marker]
        other = limbs.called(int(rivals[marker])) if rivals[marker] >= 0 else "a limb of its own"
        limb = limbs.called(int(limbs.limb_of_marker[marker]))
        more = ", which is likelier by its distances" if share > own else ""
        yield f"{names[marker]} is on {limb} ({own:.0f} %), but could be on {other} ({share:.0f} %){more}"
    if len(limbs.doubtful) > MOST_NAMED:
        others = counted(len(limbs.doubtful) - MOST_NAMED, "more marker is", "more markers are")
        yield f"{others} perhaps on another limb"


def limb_odds(positions: Floats, is_member: Bools, whole: Floats | None = None) -> Floats:
    """Return the mean log odds of each marker's pairs with each limb, shape (n_markers, n_limbs); 0 where it has none.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    is_member : ndarray of bool, shape (n_markers, n_limbs)
        Which marker is on which limb.
    whole : ndarray, shape (n_take_frames, n_markers, 3), mm, optional
        All frames, if what is worn speaks for limbs.
    """
    n_frames = int(np.clip(MOST_DISTANCES // len(is_member) ** 2, LEAST_FRAMES, max(len(positions), LEAST_FRAMES)))
    shown = positions[spread_frames(len(positions), n_frames)]
    odds = np.clip(log_odds(shown, bounded=True), -LARGEST, LARGEST)
    if whole is not None:
        odds = np.clip(odds + OF_WORN * worn_odds(whole, odds), -LARGEST, LARGEST)
    np.fill_diagonal(odds, 0.0)
    n_pairs = is_member.sum(axis=0) - is_member
    return np.asarray(odds @ is_member / np.maximum(n_pairs, 1))


def every_pair(positions: Floats) -> PairDistances:
    """Return the distances of each two markers, in the order of the rows above a diagonal.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    """
    return pair_distances(positions, *np.triu_indices(positions.shape[1], 1))


def contrast(pairs: PairDistances, groups: Ints) -> float:
    """Return the logarithm of how many times more the distance of two markers varies if they are on different limbs.

    That is at equal distances: both count as a power of the distance, fitted to all pairs together.

    Parameters
    ----------
    pairs : PairDistances
        From `every_pair`.
    groups : ndarray of intp, shape (n_markers,)
        Limb of each marker, -1 for none.

    Returns
    -------
    float
        Infinite where too few pairs tell.
    """
    first, second = np.triu_indices(len(groups), 1)
    known = pairs.is_known & (groups[first] >= 0) & (groups[second] >= 0)
    within = known & (groups[first] == groups[second])
    if within.sum() < ENOUGH_PAIRS:
        return np.inf
    used = known & (pairs.mean <= np.quantile(pairs.mean[within], SHORT))
    across = used & ~within
    if across.sum() < ENOUGH_PAIRS:
        return np.inf
    used |= within
    lengths, deviations = (np.log(np.maximum(of[used], TINY)) for of in (pairs.mean, pairs.deviation))
    system = np.stack([np.ones(len(lengths)), lengths, across[used]], axis=1)
    return float(np.linalg.lstsq(system, deviations, rcond=None)[0][2])


def is_alone(is_member: Bools) -> Bools:
    """Whether a marker is the only one of its limb, shape (n_markers,); `is_member` as above."""
    return np.asarray((is_member & (is_member.sum(axis=0) == 1)).any(axis=1))


def leads(suits: Floats, is_member: Bools) -> Floats:
    """Return how much better its limb suits each marker than the next best limb, or than none, shape (n_markers,).

    Parameters
    ----------
    suits : ndarray, shape (n_markers, n_limbs)
        Mean log odds.
    is_member : ndarray of bool, shape (n_markers, n_limbs)
        Which marker is on which limb.
    """
    next_best = np.where(is_member, -LARGEST, suits).max(axis=1)
    return np.asarray(np.where(is_alone(is_member), -next_best, suits[is_member] - np.maximum(next_best, 0.0)))


def relative_sizes(is_member: Bools) -> Floats:
    """Return the logarithm of the size of each marker's limb over its median, shape (n_markers,); see above."""
    sizes = is_member @ is_member.sum(axis=0)
    return np.asarray(np.log(sizes / np.median(sizes)))


def pair_bends(positions: Floats, is_member: Bools) -> Floats:
    """Return for markers of limbs of two how much more these two move against each other than markers of other limbs.

    Two limbs with a marker each look like one that bends; where larger limbs bend less, they are likely two.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    is_member : ndarray of bool, shape (n_markers, n_limbs)
        Which marker is on which limb.

    Returns
    -------
    ndarray, shape (n_markers,)
        Logarithm of the deviation over `LIKE_OTHERS` times that of the median marker on limbs of three and more, at
        least 0; 0 if there are none, and for markers of other limbs.
    """
    limb_of, sizes = is_member.argmax(axis=1), is_member.sum(axis=0)
    first, second = pairs_within(limb_of)
    pairs = pair_distances(positions, first, second)
    squares = np.bincount(limb_of[first], weights=pairs.deviation**2, minlength=len(sizes))
    deviation = np.sqrt(squares / np.maximum(np.bincount(limb_of[first], minlength=len(sizes)), 1))
    own, size = deviation[limb_of], sizes[limb_of]
    if not (size >= POSED).any():
        return np.zeros(len(limb_of))
    usual = max(float(np.median(own[size >= POSED])), TINY)
    return np.asarray(np.where(size == PAIR, np.log(np.maximum(own / (LIKE_OTHERS * usual), 1.0)), 0.0))


def own_probability(suits: Floats, is_member: Bools, less: Floats | float = 0.0) -> Floats:
    """Return the probability that each marker is on its limb, shape (n_markers,).

    Parameters
    ----------
    suits : ndarray, shape (n_markers, n_limbs)
        Mean log odds.
    is_member : ndarray of bool, shape (n_markers, n_limbs)
        Which marker is on which limb.
    less : ndarray, shape (n_markers,), optional
        Log odds that are lost.
    """
    lead = leads(suits, is_member)
    with_mates = BIAS + OF_LEAD * lead + OF_SIZE * relative_sizes(is_member)
    odds = np.where(is_alone(is_member), BIAS_ALONE + OF_LEAD_ALONE * lead, with_mates)
    return np.asarray(1 / (1 + np.exp(less - odds)))
