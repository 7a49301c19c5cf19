"""What is told of a tree beside the tree: which edges are doubtful, and why."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from skelgen.model import Topology
from skelgen.stages.joints.comparable import JointCosts
from skelgen.stages.joints.pairs import ENOUGH_FRAMES, LEAST_TURN, JointGuess, Segment

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
