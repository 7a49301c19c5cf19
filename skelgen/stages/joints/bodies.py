"""Where one body ends and the next begins: edges of the tree that are no joints.

A spanning tree joins whatever is seen together: two persons, a person and a chair. Such an edge wobbles as limbs do
that have nothing to do with each other; or it is much dearer than joints of this take are, lies far from all markers,
and could as well be another edge, because no place is better than the others.
"""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import cheapest_rivals
from skelgen.stages.joints.comparable import JointCosts
from skelgen.stages.joints.pairs import JointGuess

LOOSE = 2.0
"""Of the usual radius of a limb: a joint whose two images are usually so far apart holds nothing together."""

DEAR = 10.0
"""Times the usual cost of a joint."""

FAR = 2.0
"""Times the usual distance between joint and markers."""

REPLACEABLE = 4.0
"""Ratio of the cost of the best other edge between the same two parts: above, this one is special."""

ENOUGH_JOINTS = 3
"""Fewer joints say nothing of what is usual."""


def false_joints(
    parents: Ints, judged: JointCosts, guesses: dict[tuple[int, int], JointGuess], radius: float
) -> list[tuple[int, int]]:
    """Return edges (parent, child) of a tree that are no joints.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        The tree.
    judged : JointCosts
        Its costs.
    guesses : dict of pair to JointGuess
        The joints.
    radius : float, mm
        Usual radius of a limb; NaN if unknown.
    """
    children = np.flatnonzero(parents >= 0)
    if not len(children):
        return []
    above = parents[children]
    costs, squares = judged.costs[children, above], judged.squares[children, above]
    pairs = [(min(pair), max(pair)) for pair in zip(children.tolist(), above.tolist(), strict=True)]
    distances = np.array([guesses[pair].distance for pair in pairs])
    unexplained = squares > judged.expected[children, above]
    false = unexplained & (np.sqrt(3 * squares) > LOOSE * radius)
    if len(children) >= ENOUGH_JOINTS:
        rivals = cheapest_rivals(parents, np.where(np.isfinite(judged.costs), judged.costs, np.nan))
        replaceable = np.array([rivals[int(child)][1] < REPLACEABLE * costs[i] for i, child in enumerate(children)])
        false |= replaceable & _exceeds(costs, DEAR) & _exceeds(distances, FAR)
    return [(int(parent), int(child)) for parent, child in zip(above[false], children[false], strict=True)]


def usual_radius(tracks: list[Floats]) -> float:
    """Median over limbs of the root mean square distance [mm] of the markers from their middle; NaN if none has any.

    Parameters
    ----------
    tracks : list of ndarray, shape (n_frames, n_markers, 3), mm
        Markers of each limb, NaN where unseen.
    """
    found = []
    for positions in tracks:
        whole = positions[~np.isnan(positions).any(axis=(1, 2))]
        if len(whole):
            found.append(float(np.sqrt(((whole - whole.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean())))
    extended = [radius for radius in found if radius > 0]  # limbs of one marker have none
    return float(np.median(extended)) if extended else float("nan")


def _exceeds(values: Floats, times: float) -> Bools:
    return np.asarray(values > times * np.median(values))
