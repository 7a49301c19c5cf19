"""Where one body ends and the next begins: edges of the tree that are no joints.

A spanning tree joins whatever is seen together: two persons, a person and a chair. Such an edge wobbles as limbs do
that have nothing to do with each other; or it is much dearer than joints of this take are, lies far from all markers,
and could as well be another edge, because no place is better than the others.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skelgen.model import Topology
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import cheapest_rivals
from skelgen.stages.joints.costs import CHANCE, JointCosts
from skelgen.stages.joints.pairs import LEAST_TURN, JointGuess
from skelgen.stages.joints.segments import ENOUGH_FRAMES, Segment

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


SMALL_MARGIN = 1.5
"""Ratio of the cost of the best other edge to an edge's own below which the data hardly prefer it."""


def tree_sentences(
    topology: Topology, judged: JointCosts, guesses: dict[tuple[int, int], JointGuess], cut: list[tuple[int, int]]
) -> Iterator[str]:
    """Say what is doubtful about a tree.

    Parameters
    ----------
    topology : Topology
        The tree.
    judged : JointCosts
        Its costs.
    guesses : dict of pair to JointGuess
        The joint between each two limbs.
    cut : list of pairs of int
        Edges that were taken out, because they are no joints.
    """
    for parent, child in cut:
        gap = float(np.sqrt(3 * judged.squares[parent, child]))
        yield (
            f"nothing holds limb {parent} and limb {child} together: the best joint between them lies "
            f"{guesses[min(parent, child), max(parent, child)].distance:.0f} mm from the markers and wobbles by "
            f"{gap:.0f} mm; they are separate bodies"
        )
    n_never = len(topology.roots) - 1 - len(cut)
    if n_never > 0:
        yield (
            f"{n_never + 1} limbs or groups of limbs are never seen together, or may not be joined: they are separate "
            "bodies"
        )
    yield from _doubtful_edges(topology)
    for first, second in topology.loops:
        yield (
            f"limb {first} and limb {second} share a joint too, which the tree does not use: limbs there form a ring"
        )
    for parent, child in topology.edges.tolist():
        yield from _weak_joint(parent, child, guesses[min(parent, child), max(parent, child)])


def slack_sentences(segments: list[Segment]) -> Iterator[str]:
    """Say which limbs have points on one line only, joints included.

    Parameters
    ----------
    segments : list of Segment
        All limbs, with the joints that were found.
    """
    for limb, segment in enumerate(segments):
        if segment.is_seen.any() and not segment.shape.posed.any():
            yield f"all that is seen of limb {limb} lies on one line: how it turns about that line is not determined"


def _doubtful_edges(topology: Topology) -> Iterator[str]:
    for (parent, child), (outer, inner), margin in zip(
        topology.edges.tolist(), topology.rivals.tolist(), topology.margins.tolist(), strict=True
    ):
        if np.isnan(margin) or margin > (SMALL_MARGIN - 1) * topology.joint_costs[parent, child]:
            continue
        if inner == child:
            yield f"limb {child} hangs on limb {parent}, but could as well hang on limb {outer}"
        else:
            yield (
                f"the joint between limb {parent} and limb {child} could as well be one between limb {outer} and "
                f"limb {inner}"
            )


def _weak_joint(parent: int, child: int, guess: JointGuess) -> Iterator[str]:
    if guess.turn < LEAST_TURN:
        yield (
            f"limb {parent} and limb {child} hardly turn against each other ({np.rad2deg(guess.turn):.1f} deg): where "
            "their joint is, is not determined"
        )
    if 0 < guess.n_frames < ENOUGH_FRAMES / 3:  # of a single point, a frame tells a third
        yield f"the joint between limb {parent} and limb {child} rests on few frames; more motion would make it surer"
