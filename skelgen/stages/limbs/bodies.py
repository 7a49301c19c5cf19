"""Which markers belong to one body, where a take shows several: people, animals, a person and a chair.

Joined limbs have a place where they stay together: some marker of one stays near some marker of the other, at a
distance that hardly varies. Two bodies have no such place, or one that is none: feet that stand beside those of another
person keep their distance, but so they would by themselves. Markers are joined to a tree, each step as short and as
steady as it can be; every step parts the markers in two, and how likely these are two bodies depends on the pairs of
markers across that say most for one, beside the other steps of the tree. How steady they are is seen in two ways, as
bodies that go through a room together move little by themselves, and the likelier parts them. How much each says is
learned. Markers of two people who come one after the other are never seen together: they are parted before, by the
frames that they share.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from skelgen.geometry.statistics import LEAST_COMMON, pair_distances
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread
from skelgen.progress import listed

LOOKED_AT = 200
"""Frames: bodies move slowly against each other, more would repeat each other."""

LEAST_LOOKED_AT = 2 * LEAST_COMMON
"""Frames of each marker, if it is seen in so many: one that is rare must not hide what all others show."""

LEAST_MARKERS = 5
"""Markers of a body that is parted here; smaller things are found from joints, which the next stage looks for."""

STEADY = 0.1
"""Part of the usual step that is added to deviations when the tree is made, so that very steady pairs are alike."""

RIGID, STILL = 0.02, 0.05
"""Parts of a long step: deviations below the first count as this much, and the second is added to them and to what
markers move by themselves, when these are compared."""

NEAR = 3.0
"""Power of the distance that counts with its deviation: the nearer markers are, the likelier a joint is the reason."""

FREE = 1.5
"""Usual distances to the nearest from which on a marker is held by none that moves by itself; the part of that motion
that is seen counts with the distance."""

TINY = 1e-6
"""mm; keeps logarithms finite for markers in one place."""

LONG = 0.9
"""Quantile of the other steps of the tree that is taken as a long step; distances across a cut are compared with it."""

# Learned by tests/benchmarks/learn_bodies.py
BIASES = (-2.9, -2.09)
WEIGHTS = ((1.289, 5.972, 0.0), (0.0, 0.0, 2.0))


class Distances(NamedTuple):
    """How far markers are from each other, and how steadily; infinite where they are not seen together.

    Attributes
    ----------
    far : ndarray, shape (n_markers, n_markers), mm
        Distance below which two markers usually stay.
    unsteady : ndarray, shape (n_markers, n_markers), mm
        Deviation of their distance.
    spread : ndarray, shape (n_markers,), mm^2
        Variance of each marker's place in the room, in the mean of the coordinates: the distance of two markers that
        move by themselves has the variance of both together.
    """

    far: Floats
    unsteady: Floats
    spread: Floats

    def of(self, markers: Ints) -> Distances:
        """Return those of some markers."""
        block = np.ix_(markers, markers)
        return Distances(self.far[block], self.unsteady[block], self.spread[markers])


class Cuts(NamedTuple):
    """Ways to part markers in two.

    Attributes
    ----------
    is_second : ndarray of bool, shape (n_cuts, n_markers)
        Which markers are in the second part.
    features : ndarray, shape (n_cuts, 3)
        Logarithms of the least values over all pairs of markers across each cut: of distance times deviation, and of
        distance, in long steps; of distance to the power `NEAR` times deviation as a part of what it would be if both
        moved by themselves.
    """

    is_second: Bools
    features: Floats

    @property
    def odds(self) -> Floats:
        """Log odds that the two parts are two bodies, shape (n_cuts,)."""
        return np.asarray((np.array(BIASES) + self.features @ np.transpose(WEIGHTS)).max(axis=1))


def seen_together(positions: Floats, n_bodies: int = 0) -> Ints:
    """Part markers where no chain of markers that are seen together long enough leads from one to the other.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    n_bodies : int
        How many parts there may be at most; 0 for any number.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        Part of each marker, the largest first. Fewer than `LEAST_MARKERS` are a part if no frame shows them with
        others; else they are of the part with which they are seen most.
    """
    from scipy.sparse.csgraph import connected_components  # noqa: PLC0415 - heavy

    is_seen = ~np.isnan(positions[:, :, 0])
    looked_at = _common_frames(is_seen[evenly_spread(np.arange(len(is_seen)), LOOKED_AT)])
    n_parts, part = connected_components(looked_at >= LEAST_COMMON, directed=False)
    if n_parts == 1:
        return np.zeros(len(part), dtype=np.intp)
    is_of_part = np.eye(n_parts)[part]
    common = is_of_part.T @ _common_frames(is_seen) @ is_of_part
    np.fill_diagonal(common, 0.0)
    sizes = is_of_part.sum(axis=0)
    order = np.argsort(-sizes, kind="stable")
    is_body = (sizes >= LEAST_MARKERS) | ~common.any(axis=1)
    bodies = (order[is_body[order]] if is_body.any() else order[:1])[: n_bodies or None]
    nearest = common[:, bodies].argmax(axis=1)
    nearest[bodies] = np.arange(len(bodies))
    return np.asarray(nearest[part])


def with_stated_bodies(body_of_marker: Ints, stated: tuple[Ints, ...], deviation: Floats) -> Ints:
    """Return the bodies of markers where some are stated.

    Parameters
    ----------
    body_of_marker : ndarray of intp, shape (n_markers,)
        What is found.
    stated : tuple of ndarray of intp
        Markers of each body that is stated.
    deviation : ndarray, shape (n_markers, n_markers), mm
        Of distances; NaN where never seen together. Of a body that is found, a marker of which nothing is stated stays
        with the stated marker to which its distance varies least.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        The stated bodies have the first numbers; others follow in the order in which they were numbered.
    """
    bodies = body_of_marker + len(stated)
    for number, markers in enumerate(stated):
        bodies[markers] = number
    loose = np.flatnonzero(bodies >= len(stated))
    for marker in loose.tolist():
        near = np.setdiff1d(np.flatnonzero(body_of_marker == body_of_marker[marker]), loose)
        if len(near):
            bodies[marker] = bodies[near[np.nan_to_num(deviation[marker, near], nan=np.inf).argmin()]]
    return bodies


def _common_frames(is_seen: Bools) -> Floats:
    """Number of frames that show both of two markers, shape (n_markers, n_markers)."""
    seen = is_seen.astype(np.float32)
    return np.asarray(seen.T @ seen, dtype=np.float64)


def find_bodies(positions: Floats, n_bodies: int = 0, parts: Ints | None = None) -> tuple[Ints, Floats]:
    """Find the body that each marker is on.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    n_bodies : int
        How many there are; 0 finds it.
    parts : ndarray of intp, shape (n_markers,), optional
        Parts that are on different bodies in any case, numbered without holes.

    Returns
    -------
    body_of_marker : ndarray of intp, shape (n_markers,)
        Numbered in the order of their first markers.
    probability : ndarray, shape (n_bodies,)
        That each is a body of its own and no part of another one.
    """
    return bodies_by_distances(marker_distances(positions), n_bodies, parts)


def bodies_by_distances(distances: Distances, n_bodies: int = 0, parts: Ints | None = None) -> tuple[Ints, Floats]:
    """Find the body that each marker is on from how far markers are from each other, and how steadily.

    Parameters
    ----------
    distances : Distances
        Of all markers.
    n_bodies, parts
        As for `find_bodies`.

    Returns
    -------
    body_of_marker, probability
        As of `find_bodies`.
    """
    body = np.zeros(len(distances.spread), dtype=np.intp) if parts is None else parts.copy()
    odds_of = [np.inf] * (int(body.max(initial=0)) + 1)
    found = [_best_cut(np.flatnonzero(body == one), distances) for one in range(len(odds_of))]
    while len(odds_of) != n_bodies:
        best = max(range(len(found)), key=lambda one: found[one][0])
        odds, second = found[best]
        if not np.isfinite(odds) or (odds <= 0.0 and not n_bodies):
            break
        body[second] = len(odds_of)
        odds_of[best] = min(odds_of[best], odds)
        odds_of.append(odds)
        found[best], new = (_best_cut(np.flatnonzero(body == one), distances) for one in (best, len(found)))
        found.append(new)
    _, first, number = np.unique(body, return_index=True, return_inverse=True)
    order = np.argsort(first)
    sure = 1.0 / (1.0 + np.exp(-np.array(odds_of)))
    return np.argsort(order)[number], sure[order]


def kept_bodies(body_of_marker: Ints, sure: Floats) -> tuple[Ints, Floats]:
    """Return bodies numbered without holes after some became one, and how sure each is.

    Parameters
    ----------
    body_of_marker : ndarray of intp, shape (n_markers,)
        Numbers that are left.
    sure : ndarray
        Probability of each body before.
    """
    kept, body_of_marker = np.unique(body_of_marker, return_inverse=True)
    return body_of_marker, sure[kept] if len(kept) > 1 else np.ones(1)


def bodies_of_limbs(limb_of_marker: Ints, body_of_marker: Ints) -> tuple[Ints, Ints]:
    """Return the bodies that have limbs, and which of these each limb is on.

    Parameters
    ----------
    limb_of_marker, body_of_marker : ndarray of intp, shape (n_markers,)
        -1 for markers on no limb.
    """
    body_of_limb = np.zeros(limb_of_marker.max() + 1, dtype=np.intp)
    on_limb = limb_of_marker >= 0
    body_of_limb[limb_of_marker[on_limb]] = body_of_marker[on_limb]
    kept, body_of_limb = np.unique(body_of_limb, return_inverse=True)
    return kept, body_of_limb


def body_notices(body_of_marker: Ints, sure: Floats) -> Iterator[str]:
    """Say that a take shows several bodies.

    Parameters
    ----------
    body_of_marker : ndarray of intp, shape (n_markers,)
        Body of each marker that is on one.
    sure : ndarray, shape (n_bodies,)
        Probability of each.
    """
    if len(sure) > 1:
        sizes, percent = listed(map(str, np.bincount(body_of_marker).tolist())), 100 * sure.min()
        yield (
            f"the take shows {len(sure)} bodies, of {sizes} markers ({percent:.0f} % sure): nothing joins them, or "
            "they are never seen together"
        )


def cuts(distances: Distances) -> Cuts:
    """Return the ways to part markers in two along a tree of short and steady steps.

    Parameters
    ----------
    distances : Distances
        Of all markers.
    """
    n_markers, unsteady = len(distances.spread), distances.unsteady
    known = np.isfinite(distances.far) & ~np.eye(n_markers, dtype=np.bool_)
    empty = Cuts(np.zeros((0, n_markers), dtype=np.bool_), np.zeros((0, 3)))
    if n_markers < 2 * LEAST_MARKERS or not known.any(axis=1).all():
        return empty
    far = np.maximum(distances.far, TINY)
    alone = np.sqrt(distances.spread[:, np.newaxis] + distances.spread)
    usual = float(np.median(np.where(known, far, np.inf).min(axis=1)))
    tree = _tree(np.where(known, far * np.hypot(unsteady, STEADY * usual), 0.0))
    if len(tree) < n_markers - 1:
        return empty
    steps = np.array([far[one, other] for one, other in tree])
    parts, features = [], []
    for index, second in enumerate(_branches(tree, n_markers)):
        if min(np.bincount(second, minlength=2)) < LEAST_MARKERS:
            continue
        across = np.ix_(~second, second)
        long = float(np.quantile(np.delete(steps, index), LONG))
        apart, wobble = far[across] / long, np.maximum(unsteady[across] / long, RIGID)
        shown = np.hypot(unsteady[across], STILL * long) / np.hypot(alone[across], STILL * long)
        parts.append(second)
        features.append(np.log([(apart * wobble).min(), apart.min(), (apart**NEAR * shown).min()]))
    return Cuts(np.array(parts), np.array(features)) if parts else empty


def _best_cut(markers: Ints, distances: Distances) -> tuple[float, Ints]:
    """Log odds of the cut that most likely parts two bodies, and the markers of its second part."""
    found = cuts(distances.of(markers))
    if not len(found.features):
        return -np.inf, markers[:0]
    best = int(found.odds.argmax())
    return float(found.odds[best]), markers[found.is_second[best]]


def marker_distances(positions: Floats) -> Distances:
    """Return how far markers are from each other, and how steadily.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen; frames evenly over the take count.
    """
    positions = positions[_looked_at(~np.isnan(positions[:, :, 0]))]
    n_markers = positions.shape[1]
    first, second = np.triu_indices(n_markers)
    pairs = pair_distances(positions, first, second)
    far, unsteady = np.full((2, n_markers, n_markers), np.inf)
    for table, values in ((far, pairs.largest), (unsteady, pairs.deviation)):
        table[first, second] = table[second, first] = np.where(pairs.is_known, values, np.inf)
    n_seen = np.maximum((~np.isnan(positions)).sum(axis=0), 1)
    squares = np.nansum((positions - np.nansum(positions, axis=0) / n_seen) ** 2, axis=0) / n_seen
    return Distances(far, unsteady, squares.mean(axis=1))


def held_by_none(positions: Floats) -> Bools:
    """Return which markers move by themselves: near to none, or as if no joint held them there, shape (n_markers,).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    """
    distances = marker_distances(positions)
    far = distances.far + np.diag(np.full(len(distances.far), np.inf))
    usual = float(np.median(far.min(axis=1)))
    if not np.isfinite(usual):  # of most no distance is known
        return np.zeros(len(far), dtype=np.bool_)
    still = STILL * usual + TINY
    alone = np.hypot(np.sqrt(distances.spread[:, np.newaxis] + distances.spread), still)
    return np.asarray((far * np.hypot(distances.unsteady, still) / alone).min(axis=1) > FREE * usual)


def _looked_at(is_seen: Bools) -> Ints:
    """Frames evenly over the take, and those of markers that hardly any of these show."""
    frames = evenly_spread(np.arange(len(is_seen)), LOOKED_AT)
    rare = np.flatnonzero(is_seen[frames].sum(axis=0) < LEAST_LOOKED_AT).tolist()
    more = [evenly_spread(np.flatnonzero(is_seen[:, marker]), LEAST_LOOKED_AT) for marker in rare]
    return np.unique(np.concatenate([frames, *more]))


def _tree(weights: Floats) -> list[tuple[int, int]]:
    """Edges of the minimum spanning tree; 0 stands for no edge."""
    from scipy.sparse.csgraph import minimum_spanning_tree  # noqa: PLC0415 - heavy

    found = minimum_spanning_tree(weights).tocoo()
    return list(zip(found.row.tolist(), found.col.tolist(), strict=True))


def _branches(tree: list[tuple[int, int]], n_markers: int) -> Iterator[Bools]:
    """Which markers are beyond each edge of a tree, seen from the first marker."""
    neighbours: list[list[int]] = [[] for _ in range(n_markers)]
    for one, other in tree:
        neighbours[one].append(other)
        neighbours[other].append(one)
    parents, order = np.full(n_markers, -1), [0]
    for marker in order:  # grows while it is walked
        children = [other for other in neighbours[marker] if other != parents[marker]]
        parents[children] = marker
        order += children
    beyond = np.eye(n_markers, dtype=np.bool_)
    for marker in order[:0:-1]:
        beyond[parents[marker]] |= beyond[marker]
    for one, other in tree:
        yield beyond[one if parents[one] == other else other]
