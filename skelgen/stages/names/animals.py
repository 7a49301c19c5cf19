"""Four-legged animals, hands and chains by the shape of their trees and how they move.

An animal has two pairs of legs that point the same way, across its trunk; its front is where head and neck are: more
limbs, higher, and ahead on its way. A hand has fingers on one limb; they bend towards the palm, and the thumb begins
behind the others.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from skelgen.geometry.rotations import unit_vectors
from skelgen.model.arrays import Floats
from skelgen.stages.names.moving_tree import MovingTree, along, distance
from skelgen.stages.names.person import going

HIND, FORE = ("thigh", "shank", "hind foot"), ("upper foreleg", "forearm", "forefoot")
FINGERS = ("index", "middle", "ring", "little")

_ALIKE, _PAIRS, _TRUNK = 0.15, 0.35, 0.45
"""Deviations of the logarithms of the lengths of a pair of legs, of both pairs, and of the trunk against the legs."""

_TRUNK_OF_LEGS = 1.1
_POSTURE = 0.4  # cosines between trunk and legs, and what lacks to 1 between the pairs of legs
_MOST_MISFIT = 6.0
_NO_FINGERS = 3.0  # misfit of legs below which they are no fingers; those of hands are like legs by 3.8 and more
_FRONT, _MOST_FRONT = 3.0, 2.0  # log odds for a sign of 1, and the most that one says
_WAY = 0.3  # of another sign
_MOST_ENDS = 12  # of an animal's tree: legs, head, tail, ears and single markers
_FINGERS = 5
_PHALANGES = (2, 4)  # of a finger: least and most limbs
_LEAST_PARALLEL = 0.5  # cosine of fingers with their mean direction
_LONGEST = 2.5  # times the shortest finger
_BENDING, _MOST_BENDING = 20.0, 8.0  # log odds for a sine of 1


@dataclass(frozen=True, eq=False)
class BodyPlan:
    """What a tree is, as far as its shape tells.

    Attributes
    ----------
    segments : dict of int to str
        What limbs are called without a side.
    sides : dict of int to int
        0 for limbs on the first side, 1 on the other; others have none.
    evidence : float
        Log odds that the first side is the left one.
    """

    segments: dict[int, str]
    sides: dict[int, int]
    evidence: float


@dataclass(frozen=True, eq=False)
class _Leg:
    """A path from the trunk to an end: its limbs without the trunk's, its joints, and its length [mm]."""

    limbs: tuple[int, ...]
    joints: list[Floats]
    tip: Floats
    length: float


def find_quadruped(tree: MovingTree) -> BodyPlan | None:
    """Return the four-legged animal that a tree is, or None if it is none."""
    misfit, hubs, pairs = _likest_legs(tree)
    return None if misfit >= _MOST_MISFIT or _has_more_legs(tree, pairs) else _animal(tree, hubs, pairs)


def _likest_legs(tree: MovingTree) -> tuple[float, tuple[int, int], list[tuple[_Leg, ...]]]:
    """How little two pairs of ways to ends are like an animal's legs; the limbs where they begin, and they."""
    best: tuple[float, tuple[int, int], list[tuple[_Leg, ...]]] = np.inf, (-1, -1), []
    if len(tree.ends) > _MOST_ENDS:  # every four of them are tried
        return best
    for four in combinations(tree.ends, 4):
        for other in four[1:]:
            hind = (four[0], other)
            third, fourth = (end for end in four if end not in hind)
            fore = (third, fourth)
            hubs = tree.meeting(*hind, fore[0]), tree.meeting(*fore, hind[0])
            if hubs != (tree.meeting(*hind, fore[1]), tree.meeting(*fore, hind[1])) or {*hubs} & {*four}:
                continue
            pairs = [tuple(_leg(tree, hub, end) for end in ends) for hub, ends in zip(hubs, (hind, fore), strict=True)]
            misfit = _misfit_of_legs(pairs)
            if misfit < best[0]:
                best = misfit, hubs, pairs
    return best


def _has_more_legs(tree: MovingTree, pairs: Sequence[tuple[_Leg, ...]]) -> bool:
    """Whether two more limbs begin on the trunk and are like legs, as those of insects and robots with six."""
    legs = [leg for pair in pairs for leg in pair]
    in_legs = {limb for leg in legs for limb in leg.limbs}
    ends = [end for end in tree.ends if end not in in_legs]
    for pair in combinations(ends, 2):
        more = [_leg(tree, tree.meeting(*pair, legs[0].limbs[-1]), end) for end in pair]
        if min(len(leg.limbs) for leg in more) >= 2 and not in_legs & {limb for leg in more for limb in leg.limbs}:
            lengths = np.log([leg.length for leg in (*more, *legs)])
            terms = [np.diff(lengths[:2])[0] / _ALIKE, (lengths[:2].mean() - lengths[2:].mean()) / _PAIRS]
            alike = [max(float(np.median(along(_pointing([one]), _pointing([leg])))) for leg in legs) for one in more]
            terms += [(1.0 - cosine) / _POSTURE for cosine in alike]
            if np.square(terms).sum() < _MOST_MISFIT:
                return True
    return False


def _leg(tree: MovingTree, hub: int, end: int) -> _Leg:
    path = tree.path(hub, end)
    joints, tip = tree.joints_on(path), tree.centres[end]
    places = [*joints, tip]
    length = sum(distance(one, other) for one, other in pairwise(places))
    return _Leg(path[1:], joints, tip, max(length, 1e-9))


def _misfit_of_legs(pairs: Sequence[tuple[_Leg, ...]]) -> float:
    hind, fore = pairs
    if min(len(leg.limbs) for leg in (*hind, *fore)) < 2:
        return np.inf
    lengths = np.log([[leg.length for leg in pair] for pair in pairs])
    trunk = _middle(fore) - _middle(hind)
    directions = [_pointing(pair) for pair in pairs]
    across = [np.median(along(unit_vectors(trunk), direction)) for direction in directions]
    alike = np.median(along(*directions))
    size = max(float(np.median(np.linalg.norm(trunk, axis=1))), 1e-9)
    terms = [
        *(np.diff(lengths, axis=1)[:, 0] / _ALIKE),
        (lengths[0].mean() - lengths[1].mean()) / _PAIRS,
        (np.log(size / _TRUNK_OF_LEGS) - lengths.mean()) / _TRUNK,
        *(np.array(across) / _POSTURE),
        (1.0 - alike) / _POSTURE,
    ]
    return float(np.square(terms).sum())


def _pointing(legs: Sequence[_Leg]) -> Floats:
    """Unit vectors of where legs point together."""
    return unit_vectors(np.sum([leg.tip - leg.joints[0] for leg in legs], axis=0))


def _middle(pair: tuple[_Leg, ...]) -> Floats:
    return np.asarray((pair[0].joints[0] + pair[1].joints[0]) / 2)


def _animal(tree: MovingTree, hubs: tuple[int, int], pairs: list[tuple[_Leg, ...]]) -> BodyPlan:
    in_legs = {limb for pair in pairs for leg in pair for limb in leg.limbs}
    front = _front_evidence(tree, hubs, pairs, in_legs)
    if front < 0:
        hubs, pairs = (hubs[1], hubs[0]), pairs[::-1]
    hind, fore = pairs
    left = np.cross(_up(pairs), unit_vectors(_middle(fore) - _middle(hind)))
    segments: dict[int, str] = {}
    sides: dict[int, int] = {}
    for pair, names in ((hind, HIND), (fore, FORE)):
        across = float(np.mean(along(unit_vectors(pair[0].joints[0] - pair[1].joints[0]), left)))
        for leg, side in zip(pair, (0, 1) if across >= 0 else (1, 0), strict=True):
            for number, limb in enumerate(leg.limbs):
                segments[limb] = names[min(number * 3 // max(len(leg.limbs), 3), 2)]
                sides[limb] = side
    for limb in tree.limbs:
        if limb not in in_legs:
            segments[limb] = _part_of_trunk(tree, limb, hubs, in_legs)
    return BodyPlan(segments, sides, abs(front))


def _up(pairs: list[tuple[_Leg, ...]]) -> Floats:
    return unit_vectors(np.sum([leg.joints[0] - leg.tip for pair in pairs for leg in pair], axis=0))


def _front_evidence(tree: MovingTree, hubs: tuple[int, int], pairs: list[tuple[_Leg, ...]], in_legs: set[int]) -> float:
    """Log odds that the second hub is the front: more limbs beyond it, higher ones, and on the way."""
    up, ahead = _up(pairs), unit_vectors(_middle(pairs[1]) - _middle(pairs[0]))
    size = float(np.mean([leg.length for pair in pairs for leg in pair]))
    counts, heights = [], []
    for hub, other in (hubs, hubs[::-1]):
        beyond = [limb for limb in tree.limbs if limb not in in_legs and hub in tree.path(limb, other)[1:]]
        counts.append(len(beyond))
        high = [float(np.median(along(tree.centres[limb] - tree.centres[hub], up))) / size for limb in beyond]
        heights.append(max(high, default=-1.0))
    signs = [counts[1] - counts[0], 2 * (heights[1] - heights[0]), _WAY * going(_middle(pairs[0]), ahead, tree.rate)]
    return float(np.clip(_FRONT * np.array(signs), -_MOST_FRONT, _MOST_FRONT).sum())


def _part_of_trunk(tree: MovingTree, limb: int, hubs: tuple[int, int], in_legs: set[int]) -> str:
    """Name a limb between or beyond the legs: pelvis, trunk, tail, neck, head."""
    hind, fore = hubs
    path = tree.path(hind, fore)
    if limb in path:
        return "pelvis" if limb == hind and hind != fore else "trunk"
    to_fore = len(set(tree.path(limb, fore)) & set(path)) == 1
    if not to_fore:
        return "tail"
    is_last = all(other in in_legs or other in tree.path(limb, fore) for other in tree.neighbours[limb])
    return "head" if is_last else "neck"


def find_hand(tree: MovingTree) -> BodyPlan | None:
    """Return the hand that a tree is, or None if it is none."""
    if len(tree.ends) != _FINGERS:
        return None
    hubs = {tree.meeting(*three) for three in combinations(tree.ends, 3)}
    if len(hubs) != 1 or hubs & {*tree.ends}:
        return None
    palm = hubs.pop()
    fingers = [_leg(tree, palm, end) for end in tree.ends]
    counts, lengths = {len(finger.limbs) for finger in fingers}, [finger.length for finger in fingers]
    if min(counts) < _PHALANGES[0] or max(counts) > _PHALANGES[1] or max(lengths) > _LONGEST * min(lengths):
        return None
    directions = np.array([unit_vectors(finger.joints[1] - finger.joints[0]) for finger in fingers])
    parallel = np.median(along(directions, unit_vectors(directions.sum(axis=0))), axis=1)
    if np.sort(parallel)[1] < _LEAST_PARALLEL or _likest_legs(tree)[0] < _NO_FINGERS:  # the thumb may point elsewhere
        return None
    return _hand(palm, fingers)


def _hand(palm: int, fingers: list[_Leg]) -> BodyPlan:
    """Name the fingers: the thumb begins farthest behind the others, the index is next to it."""

    def behind(number: int) -> float:
        others = [finger for other, finger in enumerate(fingers) if other != number]
        ahead = unit_vectors(np.sum([finger.joints[1] - finger.joints[0] for finger in others], axis=0))
        bases = sum(finger.joints[0] for finger in others) / len(others)
        return float(np.median(along(bases - fingers[number].joints[0], ahead)))

    thumb = max(range(_FINGERS), key=behind)
    others = [finger for number, finger in enumerate(fingers) if number != thumb]
    first = fingers[thumb]
    outer = max(combinations(others, 2), key=lambda pair: distance(pair[0].joints[0], pair[1].joints[0]))
    index, little = sorted(outer, key=lambda finger: distance(finger.joints[0], first.joints[0]))
    radial = unit_vectors(index.joints[0] - little.joints[0])
    others.sort(key=lambda finger: -float(np.median(along(finger.joints[0] - little.joints[0], radial))))
    bones = [(one.joints[1] - one.joints[0], _after(one) - one.joints[1]) for one in others]
    bent = [np.cross(unit_vectors(first), unit_vectors(second)) for first, second in bones]
    # fingers of a right hand turn about the axis towards the thumb when they bend, those of a left hand against it
    sines = [-np.percentile(along(axis, radial), [5.0, 95.0]).sum() for axis in bent]
    evidence = float(np.clip(_BENDING * np.mean(sines), -_MOST_BENDING, _MOST_BENDING))
    segments = {palm: "hand"}
    for name, finger in zip(("thumb", *FINGERS), (first, *others), strict=True):
        segments |= {limb: f"{name} {number}" for number, limb in enumerate(finger.limbs, start=1)}
    return BodyPlan(segments, dict.fromkeys(segments, 0), evidence)


def _after(finger: _Leg) -> Floats:
    return finger.joints[2] if len(finger.joints) > 2 else finger.tip


def find_chain(tree: MovingTree) -> BodyPlan | None:
    """Return the links of a tree without branches, from the end that moves least, or None if it has some."""
    if len(tree.ends) != 2 or len(tree.limbs) < 3:
        return None
    first, last = sorted(tree.ends, key=lambda end: float(tree.centres[end].std(axis=0).sum()))
    return BodyPlan({limb: f"link {number}" for number, limb in enumerate(tree.path(first, last), start=1)}, {}, 0.0)
