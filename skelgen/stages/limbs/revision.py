"""Limbs revised by the evidence of all pairs of markers: merged, markers moved, split.

The rigid bodies that `merging` finds rest on one noise for the whole take. Where markers slide on skin, and some limbs
hardly move, pairs say more: by the mean of their log odds (`pair_evidence`) limbs are merged, markers moved and limbs
split, for as long as one of these is clearly better. What is not clear stays as it is, so that rigid plates do.
"""

from collections.abc import Sequence

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.stages.limbs.distances import Deviations
from skelgen.stages.limbs.pair_evidence import log_odds
from skelgen.stages.limbs.parameters import MarkerConstraints
from skelgen.stages.limbs.relative_motion import LOOKED_AT, STEPS, pairs_within, white_noise
from skelgen.stages.limbs.worn_places import PLACES_BEYOND_DOUBT, believed_places, worn_odds
from skelgen.stages.limbs.worn_sets import HOPELESS, belief_in_set, nearest_set

SOFT = 0.025
"""Of how neighbouring limbs move against each other: limbs that bend less are plates, which stay as they are. A racing
car with its driver has .018, people who lack every seventh marker .04 and more."""

ALIKE = 0.23
"""Standard deviation of the logarithms of how far each limb bends, up to which one noise explains all of them: rigid
bodies are the most likely limbs, and nothing is known better. Limbs of people, animals and hands have .26 to 1.9, in
all marker sets and in parts of takes, as skin is not alike everywhere; bodies with the same soft tissue on all limbs
.05 to .2."""

ENOUGH_LIMBS = 6
"""Fewer say nothing of what is usual for a pair."""

BELIEVED = 0.5
"""Belief in a marker set from which its wearer's skin moves, however alike limbs bend."""

POSED, RIGID = 3, 2.0
"""Markers that give a limb a pose, and how much larger than white noise the variance of distances on plates may be."""

SUREST = 6.0
"""Largest log odds of one pair: more would let it speak for all others."""

STATED = 1e3
"""Log odds of what the user states."""

MERGED = 1.0
"""Mean log odds across two limbs from which they are one."""

MOVED = 1.0
"""How much larger the mean log odds of a marker with another limb must be than with its own."""

SPLIT = -0.1
"""Mean log odds between two parts of a limb below which they are two."""

SPLIT_ONE = -0.5
"""The same where a part is a single marker: limbs of one are rarer."""

TINY = 1e-12
"""mm^2."""

MOST_CHANGES = 100
"""Ends a search that rounding might prolong."""


def deformation(groups: Ints, deviations: Deviations, whole: Floats) -> tuple[bool, bool]:
    """Return whether there are enough limbs and most of them bend, and whether some do so, unlike the others.

    Parameters
    ----------
    groups : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    deviations : Deviations
        Of all distances.
    whole : ndarray, shape (n_take_frames, n_markers, 3), mm
        All frames, whose white noise is no deformation.
    """
    sums = deviations.between(groups)
    several = (sums.sizes > 1) & (np.diag(sums.weights) > 0)
    if len(sums.sizes) < ENOUGH_LIMBS or several.sum() < 2:
        return False, False
    variance = np.diag(sums.sums)[several] / np.diag(sums.weights)[several]
    unlike = float(np.std(np.log(np.maximum(variance, TINY)) / 2))
    stiff = SOFT**2 * sums.neighbour_motion() + white_noise(groups, whole)
    return float(np.median(variance)) > stiff, unlike > ALIKE and float(variance.max()) > stiff


def are_plates(positions: Floats, limb_of_marker: Ints) -> bool:
    """Return whether all limbs have poses and are rigid as far as white noise can tell: then these say all there is.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    limb_of_marker : ndarray of intp, shape (n_markers,)
        Limb of each marker; -1 for those on none.
    """
    _, sizes = np.unique(limb_of_marker[limb_of_marker >= 0], return_counts=True)
    if not len(sizes) or sizes.min() < POSED:
        return False
    shown = positions[spread_frames(len(positions), LOOKED_AT)]
    first, second = pairs_within(limb_of_marker)
    gaps = np.linalg.norm(shown[:, first] - shown[:, second], axis=2)
    gaps = gaps[:, np.isfinite(gaps).sum(axis=0) >= len(STEPS)]
    if not gaps.size:
        return False
    variance = float(np.median(np.nanvar(gaps, axis=0))) / 2
    return variance <= RIGID * white_noise(limb_of_marker, positions) + TINY


def pair_odds(positions: Floats) -> Floats:
    """Return the log odds that two markers share a limb by what each pair does, shape (n_markers, n_markers).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Sampled frames; NaN where unseen.
    """
    return np.clip(log_odds(positions), -SUREST, SUREST)


def is_worn(by_motion: Floats, whole: Floats) -> bool:
    """Return whether a person wears the markers: those of a set that motion bears out, or at places beyond doubt.

    Parameters
    ----------
    by_motion : ndarray, shape (n_markers, n_markers)
        From `pair_odds`.
    whole : ndarray, shape (n_take_frames, n_markers, 3), mm
        All frames.
    """
    nearest = nearest_set(whole)
    if nearest is None or nearest[0].misfit > HOPELESS:
        return False
    if belief_in_set(*nearest, by_motion) > BELIEVED:
        return True
    places = believed_places(whole, by_motion)
    return places is not None and places.match.misfit < PLACES_BEYOND_DOUBT


def plates(groups: Ints, deviations: Deviations, whole: Floats) -> tuple[Ints, ...]:
    """Return the markers of each limb that has a pose and is rigid as far as white noise can tell.

    Parameters
    ----------
    groups, deviations, whole
        As for `deformation`.
    """
    sums, limit = deviations.between(groups), RIGID * white_noise(groups, whole) + TINY
    variance = np.diag(sums.sums) / np.maximum(np.diag(sums.weights), TINY)
    members = (np.flatnonzero(groups == limb) for limb in np.flatnonzero(variance <= limit).tolist())
    return tuple(markers for markers in members if len(markers) >= POSED)


def revised(
    groups: Ints,
    by_motion: Floats,
    constraints: MarkerConstraints,
    deviation: Floats,
    whole: Floats | None = None,
    held: Sequence[Ints] = (),
) -> Ints:
    """Return limbs that suit what all pairs of markers say.

    Parameters
    ----------
    groups : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    by_motion : ndarray, shape (n_markers, n_markers)
        From `pair_odds`.
    constraints : MarkerConstraints
        Which markers share a limb and which do not.
    deviation : ndarray, shape (n_markers, n_markers), mm
        Of all distances; NaN for markers that are not seen together.
    whole : ndarray, shape (n_take_frames, n_markers, 3), mm, optional
        All frames: the shape of a marker set that people wear adds to what pairs say. Without them pairs speak alone.
    held : sequence of ndarray of intp, optional
        Markers of plates, which stay together.
    """
    worn = worn_odds(whole, by_motion) if whole is not None else np.zeros_like(by_motion)
    rigid = _rigid_pairs(deviation) & (worn >= 0) & ~constraints.apart
    odds = by_motion + worn
    odds[constraints.apart] = -STATED
    free = np.zeros(len(odds), dtype=np.bool_)
    for block in constraints.blocks:
        odds[np.ix_(block, block)] = STATED
        free[list(block)] = len(block) == 1
    for plate in held:
        odds[np.ix_(plate, plate)] = STATED
        free[plate] = False
    np.fill_diagonal(odds, 0.0)
    for _ in range(MOST_CHANGES):
        groups = np.unique(groups, return_inverse=True)[1]
        changed = _merged(groups, odds)
        if changed is None:
            changed = _moved(groups, odds, free, rigid)
        if changed is None:
            changed = _split(groups, odds, rigid)
        if changed is None:
            break
        groups = changed
    return groups


def _rigid_pairs(deviation: Floats) -> Bools:
    """Return which distances vary no more than the steadiest ones of half of the markers do."""
    steadiest = np.nan_to_num(deviation, nan=np.inf) + np.diag(np.full(len(deviation), np.inf))
    return np.asarray(deviation <= np.median(steadiest.min(axis=1)))


def _merged(groups: Ints, odds: Floats) -> Ints | None:
    """Merge the two limbs that are most likely one."""
    members = np.eye(groups.max() + 1)[groups]
    sizes = members.sum(axis=0)
    mean = members.T @ odds @ members / np.outer(sizes, sizes)
    np.fill_diagonal(mean, -np.inf)
    first, second = np.unravel_index(int(mean.argmax()), mean.shape)
    return np.where(groups == second, first, groups) if mean[first, second] > MERGED else None


def _moved(groups: Ints, odds: Floats, free: Bools, rigid: Bools) -> Ints | None:
    """Move the marker that suits another limb most better than its own, unless it is rigid with all of its own."""
    members = np.eye(groups.max() + 1)[groups]
    sizes, every = members.sum(axis=0), np.arange(len(groups))
    total = odds @ members
    own = total[every, groups] / np.maximum(sizes[groups] - 1, 1)
    others = total / sizes
    others[every, groups] = -np.inf
    best = others.max(axis=1)
    is_held = (~rigid @ members)[every, groups] == 0
    gain = np.where(free & ~is_held & (sizes[groups] > 1) & (best > 0), best - own, -np.inf)
    marker = int(gain.argmax())
    if not gain[marker] > MOVED:
        return None
    groups = groups.copy()
    groups[marker] = others[marker].argmax()
    return groups


def _split(groups: Ints, odds: Floats, rigid: Bools) -> Ints | None:
    """Split the limb whose two parts are most likely two limbs.

    A marker that is rigid with all others of its limb stays there, however small limb and distances are.
    """
    from scipy.cluster.hierarchy import fcluster, linkage  # noqa: PLC0415 - heavy
    from scipy.spatial.distance import squareform  # noqa: PLC0415 - heavy

    least, leaving = 0.0, np.zeros(0, dtype=np.intp)
    for limb in np.flatnonzero(np.bincount(groups) > 1).tolist():
        members = np.flatnonzero(groups == limb)
        distances = STATED - odds[np.ix_(members, members)]
        np.fill_diagonal(distances, 0.0)
        if STATED - float(distances.max()) >= max(SPLIT, SPLIT_ONE):
            continue  # no two markers of it are likely of two limbs, hence no two parts
        is_second = fcluster(linkage(squareform(distances, checks=False), "average"), 2, "maxclust") == 2
        one, other = members[~is_second], members[is_second]
        if not len(other) or (min(len(one), len(other)) == 1 and rigid[np.ix_(one, other)].all()):
            continue
        below = float(odds[np.ix_(one, other)].mean()) - (SPLIT_ONE if min(len(one), len(other)) == 1 else SPLIT)
        if below < least:
            least, leaving = below, other
    if not len(leaving):
        return None
    groups = groups.copy()
    groups[leaving] = groups.max() + 1
    return groups
