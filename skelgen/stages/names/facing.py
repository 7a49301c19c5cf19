"""Left and right of a person by what bends and points which way; a mirrored recording cannot be told from a true one.

Take the first leg for the left one: then left is from the other hip to its own, and forward is left times up. Every
sign says by how much that agrees with people, in log odds; the knees say most, since they bend one way only.
"""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats
from skelgen.stages.names.moving_tree import MovingTree, along, unit
from skelgen.stages.names.person import Chain, Person

_KNEES, _MOST_KNEES = 10.0, 6.0
_OTHERS, _MOST_OTHERS = 4.0, 2.0
"""Log odds for a sine of 1, and the most that one sign says."""

_EXTREME = 5.0  # percentile
_LEAST_STEPS = 0.5  # m/s: who goes faster goes forward, mostly


def side_evidence(tree: MovingTree, person: Person) -> dict[str, float]:
    """Return the log odds that the first leg is the left one, by sign: knees, feet, elbows, hands, thighs, way.

    Parameters
    ----------
    tree : MovingTree
        The limbs in motion.
    person : Person
        The person that it is.
    """
    legs, arms = person.legs, person.arms
    left = unit(legs[0].joints[0] - legs[1].joints[0])
    if along(left, _middle(tree, legs[0]) - _middle(tree, legs[1])).mean() < 0:  # hinges whose joints are found beyond
        left = -left
    hips = (legs[0].joints[0] + legs[1].joints[0]) / 2
    forward = unit(np.cross(left, unit(person.chest - hips)))
    found = {"knees": sum(_bending(leg, left) for leg in legs) / 2 * _KNEES}
    found["knees"] = float(np.clip(found["knees"], -_MOST_KNEES, _MOST_KNEES))
    others = {
        "feet": sum(_pointing(tree, leg, left) for leg in legs) / 2,
        "elbows": -sum(_bending(arm, left) for arm in arms) / 2,
        "hands": sum(_reaching(arm, forward) for arm in arms) / 2,
        "thighs": sum(_spread(along(unit(leg.joints[1] - leg.joints[0]), forward)) for leg in legs) / 2,
        "way": going(hips, forward, tree.rate),
    }
    return found | {name: float(np.clip(_OTHERS * sign, -_MOST_OTHERS, _MOST_OTHERS)) for name, sign in others.items()}


def _middle(tree: MovingTree, chain: Chain) -> Floats:
    return tree.middle(limb for limbs in chain.limbs.values() for limb in limbs)


def _bending(chain: Chain, left: Floats) -> float:
    """Sine of how far a knee or an elbow bends about the axis to the left, positive for knees."""
    start, middle, end = chain.joints
    return _spread(along(np.cross(unit(middle - start), unit(end - middle)), left))


def _pointing(tree: MovingTree, leg: Chain, left: Floats) -> float:
    """By how much a foot reaches farther forward than backward from the shank, of its length."""
    limbs = [*leg.limbs.get("foot", ()), *leg.limbs.get("toes", ())]
    if not limbs:
        return 0.0
    markers = np.concatenate([tree.markers[limb] for limb in limbs], axis=1)
    forward = np.cross(left, unit(leg.joints[1] - leg.joints[2]))
    ahead = np.einsum("fpk,fk->fp", markers - leg.joints[2][:, np.newaxis], unit(forward))
    reach = np.median(ahead, axis=0)
    length = max(float(np.ptp(reach)), float(np.abs(reach).max()))
    return float((reach.max() + reach.min()) / length) if length > 0 else 0.0


def _reaching(arm: Chain, forward: Floats) -> float:
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
    return float((along(unit(steps), forward[1:]) * moving).mean())


def _spread(values: Floats) -> float:
    """Sum of the extremes of what people do one way only."""
    low, high = np.percentile(values, [_EXTREME, 100.0 - _EXTREME])
    return float(low + high)
