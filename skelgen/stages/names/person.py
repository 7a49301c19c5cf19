"""A person is recognised by the likeliest segments of a tree's limbs: two legs, a trunk, and perhaps two arms.

Left and right are told by what bends and points which way; a mirrored recording cannot be told from a true one. Take
the first leg for the left one: then left is from the other hip to its own, and forward is left times up. Every sign
says by how much that agrees with people, in log odds; the knees say most, since they bend one way only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import unit_vectors
from skelgen.model.arrays import Floats
from skelgen.stages.names.likely_segments import CHAINS, LABELS, STIFF_ARM, TRUNK, OfSet, likely_segments
from skelgen.stages.names.moving_tree import MovingTree, along, distance

_LEAST_ODDS = 1.0
"""Mean log odds of pairs of limbs below which a tree is no person: most have more than 1.2, others .3 in the mean."""

_LEAST_ALIKE = 0.3  # cosine between the ways across hips and shoulders, in the mean
_TOES = 0.46  # of a shank: how far the markers of toes are from the ankle; heads of metatarsals are nearer
_MOST_LIMBS = 100  # each marker of a full set on a limb of its own: what has more is no person
_LEG_OF = 2  # segments that both legs have, at least


@dataclass(frozen=True, eq=False)
class LimbChain:
    """An arm or a leg.

    Attributes
    ----------
    limbs : mapping of str to tuple of int
        Limbs of each segment that it has, from the trunk outward.
    joints : tuple of ndarray, shape (n_frames, 3), mm
        Hip, knee and ankle, or shoulder, elbow and wrist; the middle of the last limb instead of one that is missing.
    """

    limbs: Mapping[str, tuple[int, ...]]
    joints: tuple[Floats, Floats, Floats]


@dataclass(frozen=True, eq=False)
class RecognisedPerson:
    """A person by shape: two legs whose sides are not known, and the rest.

    Attributes
    ----------
    legs : tuple of LimbChain
        The first and the second side.
    arms : tuple of LimbChain
        On the same sides; none if they are not found, or if it is unsure which is on which side.
    chest : ndarray, shape (n_frames, 3), mm
        Middle of the upper trunk.
    segments : mapping of int to str
        Segments of all limbs, those of arms and legs without a side.
    sides : mapping of int to int
        0 for limbs on the side of the first leg, 1 on the other.
    """

    legs: tuple[LimbChain, LimbChain]
    arms: tuple[LimbChain, ...]
    chest: Floats
    segments: Mapping[int, str]
    sides: Mapping[int, int]


def find_person(tree: MovingTree, worn: Mapping[int, OfSet] | None = None) -> RecognisedPerson | None:
    """Return the person that a tree is, or None if it is none.

    Parameters
    ----------
    tree : MovingTree
        The limbs in motion.
    worn : mapping of int to OfSet, optional
        What limbs are by the marker set whose shape their markers have.
    """
    if not 2 * _LEG_OF <= len(tree.limbs) <= _MOST_LIMBS:
        return None
    labels = _likely_labels(tree, worn or {})
    trunk = [limb for limb, (segment, _) in labels.items() if segment in TRUNK]
    upper = [limb for limb in trunk if labels[limb][0] != "pelvis"]
    if not upper:
        return None
    legs, arms = ([_chain(tree, labels, chain, side) for side in (0, 1)] for chain in reversed(CHAINS))
    if min(len(leg.limbs) for leg in legs) < _LEG_OF:
        return None
    segments = {limb: segment for limb, (segment, _) in labels.items()}
    toes = [(leg, limb) for leg in legs for limb in leg.limbs.get("toes", ()) if limb not in (worn or {})]
    segments |= {limb: "foot" for leg, limb in toes if _is_forefoot(tree, leg, limb)}
    sides = {limb: side for limb, (_, side) in labels.items() if side >= 0}
    if min(len(arm.limbs) for arm in arms) == 0:
        arms = []
    else:
        alike = _alike(tree, legs, arms)
        in_arms = [limb for limb, segment in segments.items() if segment in CHAINS[0]]
        if abs(alike) < _LEAST_ALIKE:
            arms, sides = [], {limb: side for limb, side in sides.items() if limb not in in_arms}
        elif alike < 0:
            arms, sides = arms[::-1], sides | {limb: 1 - sides[limb] for limb in in_arms}
    return RecognisedPerson((legs[0], legs[1]), tuple(arms), tree.middle(upper), segments, sides)


def _likely_labels(tree: MovingTree, worn: Mapping[int, OfSet]) -> dict[int, tuple[str, int]]:
    """Likeliest segments and sides of limbs; none if the tree is not like a person."""
    likely = likely_segments(tree, worn)
    found = (LABELS[label] for label in likely.labels)
    between = ((CHAINS[0][1] if segment == STIFF_ARM else segment, side) for segment, side in found)
    return dict(zip(tree.limbs, between, strict=True)) if likely.odds >= _LEAST_ODDS else {}


def _chain(tree: MovingTree, labels: Mapping[int, tuple[str, int]], segments: Sequence[str], side: int) -> LimbChain:
    """The arm or leg on one side."""
    limbs = {
        segment: found
        for segment in segments
        if (found := tuple(limb for limb, label in labels.items() if label == (segment, side)))
    }
    inner = tuple(limb for limb, (segment, _) in labels.items() if segment in TRUNK)
    places = []
    for found in limbs.values():
        places.append(_meeting(tree, inner, found))
        inner = found
    places += [tree.middle(inner)] * 3
    return LimbChain(limbs, (places[0], places[1], places[2]))


def _is_forefoot(tree: MovingTree, leg: LimbChain, limb: int) -> bool:
    """Whether a limb that moves against the foot is a piece of it: toes are farther from the ankle."""
    _, knee, ankle = leg.joints
    return distance(ankle, tree.centres[limb]) < _TOES * distance(knee, ankle)


def _meeting(tree: MovingTree, inner: Sequence[int], outer: Sequence[int]) -> Floats:
    """Where two segments meet, shape (n_frames, 3): at their joint, or between their nearest markers."""
    joints = [tree.joints[one, other] for one in inner for other in outer if (one, other) in tree.joints]
    if joints:
        return joints[0]
    one, other = (np.concatenate([tree.markers[limb] for limb in limbs], axis=1) for limbs in (inner, outer))
    apart = [[distance(one[:, a], other[:, b]) for b in range(other.shape[1])] for a in range(one.shape[1])]
    a, b = np.unravel_index(np.argmin(apart), np.shape(apart))
    return np.asarray((one[:, a] + other[:, b]) / 2)


def _alike(tree: MovingTree, legs: Sequence[LimbChain], arms: Sequence[LimbChain]) -> float:
    """Mean cosine of the ways from the second to the first leg and arm."""
    ways = []
    for chains in (legs, arms):
        first, second = (tree.middle(next(iter(chain.limbs.values()))) for chain in chains)
        ways.append(unit_vectors(first - second))
    return float(along(*ways).mean())


_KNEES, _MOST_KNEES = 10.0, 6.0
_OTHERS, _MOST_OTHERS = 4.0, 2.0
"""Log odds for a sine of 1, and the most that one sign says."""

_EXTREME = 5.0  # percentile
_LEAST_STEPS = 0.5  # m/s: who goes faster goes forward, mostly


def side_evidence(tree: MovingTree, person: RecognisedPerson) -> dict[str, float]:
    """Return the log odds that the first leg is the left one, by sign: knees, feet, elbows, hands, thighs, way.

    Parameters
    ----------
    tree : MovingTree
        The limbs in motion.
    person : RecognisedPerson
        The person that it is.
    """
    legs, arms = person.legs, person.arms
    left = unit_vectors(legs[0].joints[0] - legs[1].joints[0])
    if along(left, _middle(tree, legs[0]) - _middle(tree, legs[1])).mean() < 0:  # hinges whose joints are found beyond
        left = -left
    hips = (legs[0].joints[0] + legs[1].joints[0]) / 2
    forward = unit_vectors(np.cross(left, unit_vectors(person.chest - hips)))
    found = {"knees": sum(_bending(leg, left) for leg in legs) / 2 * _KNEES}
    found["knees"] = float(np.clip(found["knees"], -_MOST_KNEES, _MOST_KNEES))
    others = {
        "feet": sum(_pointing(tree, leg, left) for leg in legs) / 2,
        "elbows": -sum(_bending(arm, left) for arm in arms) / 2,
        "hands": sum(_reaching(arm, forward) for arm in arms) / 2,
        "thighs": sum(_spread(along(unit_vectors(leg.joints[1] - leg.joints[0]), forward)) for leg in legs) / 2,
        "way": going(hips, forward, tree.rate),
    }
    return found | {name: float(np.clip(_OTHERS * sign, -_MOST_OTHERS, _MOST_OTHERS)) for name, sign in others.items()}


def _middle(tree: MovingTree, chain: LimbChain) -> Floats:
    return tree.middle(limb for limbs in chain.limbs.values() for limb in limbs)


def _bending(chain: LimbChain, left: Floats) -> float:
    """Sine of how far a knee or an elbow bends about the axis to the left, positive for knees."""
    start, middle, end = chain.joints
    return _spread(along(np.cross(unit_vectors(middle - start), unit_vectors(end - middle)), left))


def _pointing(tree: MovingTree, leg: LimbChain, left: Floats) -> float:
    """By how much a foot reaches farther forward than backward from the shank, of its length."""
    limbs = [*leg.limbs.get("foot", ()), *leg.limbs.get("toes", ())]
    if not limbs:
        return 0.0
    markers = np.concatenate([tree.markers[limb] for limb in limbs], axis=1)
    forward = np.cross(left, unit_vectors(leg.joints[1] - leg.joints[2]))
    ahead = np.einsum("fpk,fk->fp", markers - leg.joints[2][:, np.newaxis], unit_vectors(forward))
    reach = np.median(ahead, axis=0)
    length = max(float(np.ptp(reach)), float(np.abs(reach).max()))
    return float((reach.max() + reach.min()) / length) if length > 0 else 0.0


def _reaching(arm: LimbChain, forward: Floats) -> float:
    """How far a hand is before its shoulder rather than behind it, of the arm's length."""
    reach = arm.joints[2] - arm.joints[0]
    length = float(np.median(np.linalg.norm(np.diff(np.stack(arm.joints), axis=0), axis=2).sum(axis=0)))
    return _spread(along(reach, forward)) / max(length, 1e-9)


def going(hips: Floats, forward: Floats, rate: float) -> float:
    """Return how much of a way is forward, 1 if all; 0 of somebody who stays.

    Parameters
    ----------
    hips : ndarray, shape (n_frames, 3), mm
        Where the body is.
    forward : ndarray, shape (n_frames, 3)
        Where it faces.
    rate : float, Hz
        Of the frames.
    """
    steps = np.diff(hips, axis=0) * rate / 1000.0
    speed = np.linalg.norm(steps, axis=1)
    moving = speed > _LEAST_STEPS
    return float((along(unit_vectors(steps), forward[1:]) * moving).mean())


def _spread(values: Floats) -> float:
    """Sum of the extremes of what people do one way only."""
    low, high = np.percentile(values, [_EXTREME, 100.0 - _EXTREME])
    return float(low + high)
