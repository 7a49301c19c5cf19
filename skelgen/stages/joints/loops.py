"""Joints that the tree does not use: limbs that form a ring are held together once more than a tree can say."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Ints
from skelgen.stages.joints.comparable import CHANCE, JointCosts

LOOP_COST = 1.5
"""Times the median cost of the tree's joints up to which another joint closes a loop (O'Brien 2000, section 5)."""

LOOP_TURN = 0.5
"""Of the median turn of the tree's joints: limbs that turn less need no joint to stay together."""

ENOUGH_TURN = 0.2
"""rad; limbs that turn so much against each other need a joint to stay together, however far others turn."""


def loop_joints(parents: Ints, judged: JointCosts) -> tuple[tuple[int, int], ...]:
    """Return pairs of limbs that seem joined although the tree does not join them.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        The tree.
    judged : JointCosts
        Costs of all joints.
    """
    children = np.flatnonzero(parents >= 0)
    if len(children) < 2:
        return ()
    above = parents[children]
    cost = float(np.median(judged.costs[children, above]))
    turns = judged.turns[children, above]
    turn = float(np.median(turns[~np.isnan(turns)])) if not np.isnan(turns).all() else 0.0
    with np.errstate(invalid="ignore"):
        closes = (judged.costs <= LOOP_COST * cost) & (judged.squares <= CHANCE * judged.expected)
        closes &= judged.turns >= min(LOOP_TURN * turn, ENOUGH_TURN)
    closes[children, above] = closes[above, children] = False
    return tuple((int(first), int(second)) for first, second in np.argwhere(np.triu(closes, 1)))
