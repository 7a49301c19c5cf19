"""Which edges of a spanning tree are no joints.

A spanning tree joins whatever is seen together: two persons, a person and a chair. Such an edge wobbles as limbs do
that have nothing to do with each other; or it could as well be another edge, because no place is better than the
others, and is much dearer than joints of this take are and far from all markers, or has a gap that none of these could
have and several limbs on both sides: a single one may be of markers that were mistaken for each other. If noise does
not explain its gap, it is cut, and bodies are separate trees.
What stands in the room beside a person is cut off, too: markers on the floor fit feet that rest there.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from skelgen.kinematics.hierarchy import tree_path
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import branches, cheapest_rivals, limbs_of_bodies
from skelgen.stages.joints.costs import CHANCE, JointCosts
from skelgen.stages.joints.pairs import JointGuess
from skelgen.stages.joints.parameters import Pair
from skelgen.stages.joints.segments import Segment

LOOSE = 2.0
"""Of the usual radius of a limb: a joint whose two images are usually so far apart holds nothing together."""

DEAR = 10.0
"""Times the usual cost of a joint."""

FAR = 2.0
"""Times the usual distance between joint and markers."""

UNLIKELY = 20.0
"""Log odds against a joint by its gap, beside those of other joints: of a rider on a horse in whose joints there is
nothing but noise they are above 100, of joints of people, whose soft tissue moves, below 7."""

REPLACEABLE = 4.0
"""Ratio of the cost of the best other edge between the same two parts: above, this one is special."""

BESIDE = 3
"""Limbs on the way between two that slide along each other, if both are joined to one: a joint that goes around."""

MOST = 0.5
"""Part of the limbs of a tree that are segments of a person: then it is one, and has no base on which it stands."""

ENOUGH_JOINTS = 3
"""Fewer joints say nothing of what is usual."""


@dataclass(frozen=True, eq=False)
class Parting:
    """What is known of bodies before the tree is parted.

    Attributes
    ----------
    radius : float, mm
        Usual radius of a limb, NaN if unknown.
    of_one : ndarray of bool, shape (n_limbs, n_limbs)
        Limbs that are known to be on one body, as segments of a person are: no edge is cut that parts these.
    slides : mapping of pair to float
        Limbs that slide along each other, and how far [mm], the nearest first.
    strangers : sequence of int
        Limbs that are no part of the person beside them.
    """

    radius: float
    of_one: Bools
    slides: Mapping[Pair, float] = field(default_factory=dict)
    strangers: Sequence[int] = ()

    def beside(self, steady: Bools, parents: Ints) -> Parting:
        """Return this with limbs as strangers that are no segments of the person in whose tree they are, but the room.

        Parameters
        ----------
        steady : ndarray of bool, shape (n_limbs,)
            As `is_steady` returns.
        parents : ndarray of intp, shape (n_limbs,)
            The trees.
        """
        is_segment = np.asarray(self.of_one.any(axis=1))
        people = [limbs for limbs in limbs_of_bodies(parents) if np.mean(is_segment[limbs]) > MOST]
        strangers = [limb for limbs in people for limb in limbs[steady[limbs] & ~is_segment[limbs]].tolist()]
        return replace(self, strangers=strangers)


def false_joints(parents: Ints, costs: JointCosts, guesses: Mapping[Pair, JointGuess], parting: Parting) -> list[Pair]:
    """Return edges (parent, child) of a tree that are no joints.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    costs : JointCosts
        Costs of all joints.
    guesses : mapping of pair to JointGuess
        The joints.
    parting : Parting
        What is known of bodies.
    """
    children = np.flatnonzero(parents >= 0)
    if not len(children):
        return []
    above = parents[children]
    dear, squares = costs.comparable[children, above], costs.squares[children, above]
    pairs = [(min(pair), max(pair)) for pair in zip(children.tolist(), above.tolist(), strict=True)]
    distances = np.array([guesses[pair].distance for pair in pairs])
    false = loose = np.sqrt(3 * squares) > LOOSE * parting.radius
    unexplained = np.array([guesses[pair].is_unexplained for pair in pairs])
    borne = branches(parents)[children]
    several = np.minimum(borne.sum(axis=1), (~borne).sum(axis=1)) > 1
    if len(children) >= ENOUGH_JOINTS:
        rivals = cheapest_rivals(parents, np.where(np.isfinite(costs.comparable), costs.comparable, np.nan))
        replaceable = np.array([rivals[int(child)][1] < REPLACEABLE * dear[i] for i, child in enumerate(children)])
        unlikely = unexplained & several & (costs.surprise(children, above) > UNLIKELY)
        false = loose | replaceable & (unlikely | (_exceeds(dear, DEAR) & _exceeds(distances, FAR)))
        false &= (loose & unexplained) | (squares > costs.expected[children, above])
    else:  # of so few, each would be usual by itself
        false &= unexplained
    false |= np.isin(children, parting.strangers) | np.isin(above, parting.strangers)
    edges = list(zip(above.tolist(), children.tolist(), strict=True))
    slides = [slide_across(edge, parents, parting.slides) for edge in edges]
    false |= np.array([slide is not None for slide in slides]) & unexplained
    around = [slide is not None and len(tree_path(parents, *slide[0])) == BESIDE for slide in slides]
    false |= np.array(around) & (squares > CHANCE * costs.expected[children, above])
    false &= np.array([not parting.of_one[np.ix_(branch, ~branch)].any() for branch in borne])
    return [edge for edge, is_false in zip(edges, false.tolist(), strict=True) if is_false]


def slide_across(edge: Pair, parents: Ints, slides: Mapping[Pair, float]) -> tuple[Pair, float] | None:
    """Return the limbs that slide along each other where a tree is cut, and how far [mm]; None if none do.

    Parameters
    ----------
    edge : pair of int
        Where it is cut: parent and child.
    parents : ndarray of intp, shape (n_limbs,)
        The tree.
    slides : mapping of pair to float
        As of `Parting`.
    """
    borne = branches(parents)[edge[1]]
    across = (pair for pair in slides if borne[pair[0]] != borne[pair[1]] and not {*pair}.isdisjoint(edge))
    return next(((pair, slides[pair]) for pair in across), None)


def median_radius(segments: Sequence[Segment], frames: Ints) -> float:
    """Return the median over limbs of the root mean square distance [mm] of their markers from their middle.

    Parameters
    ----------
    segments : sequence of Segment
        All limbs.
    frames : ndarray of intp
        Sampled frames.

    Returns
    -------
    float, mm
        NaN if no limb shows all its markers, or all have one.
    """
    found = []
    for segment in segments:
        positions = segment.markers[frames]
        whole = positions[~np.isnan(positions).any(axis=(1, 2))]
        if len(whole):
            found.append(float(np.sqrt(((whole - whole.mean(axis=1, keepdims=True)) ** 2).sum(axis=2).mean())))
    extended = [radius for radius in found if radius > 0]  # limbs of one marker have none
    return float(np.median(extended)) if extended else float("nan")


def _exceeds(values: Floats, times: float) -> Bools:
    return np.asarray(values > times * np.median(values))
