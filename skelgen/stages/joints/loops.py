"""Joints beyond the tree that close kinematic loops (O'Brien 2000, section 5).

Not every joint that the tree leaves out closes a loop. Where the axes of two hinges of one limb meet, as in the wrist
of a robot, or are one, as those of two wheels, the limbs on either side share a point as well. This point is at rest in
the limb between them, too: the tree holds them together there already.
"""

from collections.abc import Sequence

import numpy as np

from skelgen.kinematics.hierarchy import tree_path
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.joints.costs import CHANCE, JointCosts
from skelgen.stages.joints.pairs import Guessing, guess_joint
from skelgen.stages.joints.parameters import Pair
from skelgen.stages.joints.segments import Segment, typical_variance

LOOP_COST = 1.5
"""Times the median cost of the tree's joints up to which another joint closes a loop."""

LOOP_TURN = 0.5
"""Of the median turn of the tree's joints: limbs that turn less need no joint to stay together."""

ENOUGH_TURN = 0.2
"""rad; limbs that turn so much against each other need a joint to stay together, however far others turn."""

ENOUGH_SWING = 10.0
"""Times what noise lets expect of a gap: where markers swing so far about a joint, as on the rocker of a crank that is
short, limbs that turn less need one, too."""


def loop_joints(parents: Ints, costs: JointCosts, n_markers: Sequence[int]) -> tuple[Pair, ...]:
    """Return pairs of limbs that seem joined although the tree does not join them.

    How a limb with one marker turns is not seen, so that nothing tells what it is joined to beside its parent.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        The tree.
    costs : JointCosts
        Costs of all joints.
    n_markers : sequence of int, length n_limbs
        Of each limb.
    """
    children = np.flatnonzero(parents >= 0)
    if len(children) < 2:
        return ()
    above = parents[children]
    median = float(np.median(costs.comparable[children, above]))
    turns = costs.turns[children, above]
    turn = float(np.median(turns[~np.isnan(turns)])) if not np.isnan(turns).all() else 0.0
    with np.errstate(invalid="ignore"):
        closes = (costs.comparable <= LOOP_COST * median) & (costs.squares <= CHANCE * costs.expected)
        swings = costs.turns * costs.distances >= ENOUGH_SWING * np.sqrt(costs.expected)
        closes &= (costs.turns >= min(LOOP_TURN * turn, ENOUGH_TURN)) | swings
    closes[children, above] = closes[above, children] = False
    alone = np.flatnonzero(np.asarray(n_markers) < 2)
    closes[alone] = closes[:, alone] = False
    return tuple((int(first), int(second)) for first, second in np.argwhere(np.triu(closes, 1)))


def closing_loops(
    pairs: Sequence[Pair], parents: Ints, segments: Sequence[Segment], expected: Floats, how: Guessing
) -> tuple[Pair, ...]:
    """Return those pairs of limbs whose joint moves against some limb between them: only these close a loop.

    Parameters
    ----------
    pairs : sequence of pairs of int
        From `loop_joints`.
    parents : ndarray of intp, shape (n_limbs,)
        The tree.
    segments : sequence of Segment
        All limbs, with the joints that give them poses, in sampled frames.
    expected : ndarray, shape (n_limbs, n_limbs), mm^2
        What noise lets expect of the mean square gap of each joint; more is expected where joints gave the limbs poses.
    how : Guessing
        How joints are found.
    """
    typical = typical_variance(segments)
    kept = []
    for first, second in pairs:
        joint = guess_joint(segments[first], segments[second], how, typical, how.parameters.alpha)
        wanders = max(float(expected[first, second]), float(np.nan_to_num(joint.expected)))
        chance = CHANCE * (wanders + typical)
        between = tree_path(parents, first, second)[1:-1]
        if not between or any(_moves(joint.positions, segments[limb].markers, chance) for limb in between):
            kept.append((first, second))
    return tuple(kept)


def _moves(place: Floats, markers: Floats, chance: float) -> bool:
    """Whether the distances of a place from the markers of a limb vary beyond chance [mm^2], or are not known."""
    gaps = np.linalg.norm(markers - place[:, np.newaxis], axis=2)
    is_shown: Bools = np.isfinite(gaps).sum(axis=0) > 1
    return not is_shown.any() or float(np.nanvar(gaps[:, is_shown], axis=0).mean()) > chance
