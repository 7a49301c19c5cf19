"""The tree of limbs: which joints span it, and what is doubtful about it."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Topology
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.topology import spanning_forest
from skelgen.stages.joints.costs import JointCosts
from skelgen.stages.joints.false_joints import ENOUGH_JOINTS, Parting, false_joints, slide_across
from skelgen.stages.joints.pairs import LEAST_TURN, LEAST_VARIANCE, MIN_COMMON, JointGuess
from skelgen.stages.joints.parameters import JointConstraints, Pair
from skelgen.stages.joints.segments import ENOUGH_FRAMES, Segment

PAST = 2.0
"""Times the usual gap of the tree's joints: a joint past a single marker may have such a gap."""

AS_LIKELY = 2.0
"""Times the cost, in the order by which the tree is chosen, of the dearest joint of a single marker that carries
others: joints past it are no dearer. Of 0, 1.5, 2.5, 5, 20, 50 and no limit at all, which parts thighs from shanks and
joins feet, 1.5 to 2.5 are best for people, real and simulated, whole, cut, without some markers, with hands held."""

KEPT = -1.0
"""Cost of an edge that a tree has in any case."""

STUCK = 10.0
"""Times the usual variance of the distances to a joint, and times noise: conjugate gradients have not found it."""


@dataclass(frozen=True, eq=False)
class Tree:
    """The tree of limbs.

    Attributes
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Comparable joint costs; NaN where two limbs cannot or may not be joined.
    cut : list of pairs of int
        Edges (parent, child) that were taken out, because they are no joints.
    slides : dict of pair to float
        Of these, those whose two parts slide along each other: the limbs that do, and how far [mm].
    """

    parents: Ints
    costs: Floats
    cut: list[Pair]
    slides: dict[Pair, tuple[Pair, float]] = field(default_factory=dict)


def find_tree(
    costs: JointCosts,
    guesses: Mapping[Pair, JointGuess],
    sizes: Sequence[int],
    constraints: JointConstraints,
    parting: Parting | None,
) -> Tree:
    """Find the tree of limbs that obeys the constraints.

    Parameters
    ----------
    costs : JointCosts
        Costs of all joints.
    guesses : mapping of pair to JointGuess
        The joints.
    sizes : sequence of int
        Number of markers on each limb.
    constraints : JointConstraints
        What the user states.
    parting : Parting, optional
        Edges that are no joints are cut. None keeps them.

    Raises
    ------
    InputError
        If the constraints contradict each other or what is seen.
    """
    allowed = constraints.applied(costs.order)
    known = np.where(np.isfinite(allowed), costs.order, np.nan)
    if constraints.parents is not None:
        _check_parents(constraints.parents, costs.order)
        return Tree(constraints.parents, known, [])
    markers = np.array(sizes, dtype=np.intp)
    parents = spanning_forest(allowed, markers, constraints.roots)
    direct = past_single_markers(parents, replace(costs, order=allowed), markers, constraints.joined)
    if direct is not None:
        parents = spanning_forest(np.where(direct, allowed, np.inf), markers, constraints.roots)
    if parting is None:
        return Tree(parents, known, [])
    false = false_joints(parents, costs, guesses, parting)
    cut = [edge for edge in false if (min(edge), max(edge)) not in constraints.joined]
    if not cut:
        return Tree(parents, known, [])
    edges = _edges_of(parents)
    for parent, child in cut:
        edges[parent, child] = edges[child, parent] = False
    slides = {edge: slide for edge in cut if (slide := slide_across(edge, parents, parting.slides))}
    return Tree(spanning_forest(np.where(edges, allowed, np.inf), markers, constraints.roots), known, cut, slides)


def past_single_markers(parents: Ints, costs: JointCosts, markers: Ints, joined: Sequence[Pair]) -> Bools | None:
    """Return the edges of a tree whose limbs of one marker are leaves, where others can be joined without them.

    A single marker keeps its distance to nearly any joint, so that trees run through it; where hands are clasped, even
    round the loop that both arms form. What it holds together is joined elsewhere where the gaps of these joints are
    at most `PAST` times those that are usual in the tree, and where they are about as likely as what they replace:
    some limbs carry one marker only, and bear others.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        The tree.
    costs : JointCosts
        Costs of all joints; those that the user refuses are infinite in `order`.
    markers : ndarray of intp, shape (n_limbs,)
        Number of markers on each limb.
    joined : sequence of pairs of int
        Joints that the user states, which stay.

    Returns
    -------
    ndarray of bool, shape (n_limbs, n_limbs), symmetric, or None
        None if the tree stays as it is.
    """
    children = np.flatnonzero(parents >= 0)
    if len(children) < ENOUGH_JOINTS:
        return None
    gaps = np.sqrt(costs.squares)
    fits = gaps <= PAST * np.median(gaps[children, parents[children]])
    edges = before = _edges_of(parents)
    for limb in np.flatnonzero(markers == 1).tolist():
        around = np.flatnonzero(edges[limb])
        if len(around) < 2 or any(limb in pair for pair in joined):
            continue
        through = np.sort(costs.order[limb, around])
        open_costs = np.where(fits & (costs.order <= AS_LIKELY * through[-1]), costs.order, np.inf)
        apart = _joined_without(limb, edges, open_costs)
        if apart is not None:
            nearest = around[costs.order[limb, around].argmin()]
            edges = apart
            edges[limb, nearest] = edges[nearest, limb] = True
    return None if np.array_equal(edges, before) else edges


def _joined_without(limb: int, edges: Bools, order: Floats) -> Bools | None:
    """A tree's edges without those of one limb, and the cheapest that hold the rest together; None if none may."""
    rest = np.arange(len(edges)) != limb
    others = rest[:, np.newaxis] & rest
    parents = spanning_forest(np.where(others, np.where(edges, KEPT, order), np.inf))
    found = _edges_of(parents)
    return None if found.sum() < edges.sum() - 2 else found


def _edges_of(parents: Ints) -> Bools:
    """Which limbs a tree joins, shape (n_limbs, n_limbs), symmetric."""
    edges = np.zeros((len(parents), len(parents)), dtype=np.bool_)
    children = np.flatnonzero(parents >= 0)
    edges[children, parents[children]] = edges[parents[children], children] = True
    return edges


def tree_notices(
    topology: Topology, costs: JointCosts, guesses: Mapping[Pair, JointGuess], tree: Tree, n_bodies: int
) -> Iterator[str]:
    """Say what is doubtful about a tree.

    Parameters
    ----------
    topology : Topology
        The tree.
    costs : JointCosts
        Its costs.
    guesses : mapping of pair to JointGuess
        The joint between each two limbs.
    tree : Tree
        With the edges that were taken out, because they are no joints.
    n_bodies : int
        Number of bodies between which no joint was sought.
    """
    for (first, second), far in tree.slides.values():
        yield (
            f"limb {first} and limb {second} slide along each other, by {far:.0f} mm: skelgen knows no joint "
            "that does so, and takes them for separate bodies"
        )
    for parent, child in [edge for edge in tree.cut if edge not in tree.slides]:
        gap = float(np.sqrt(3 * costs.squares[parent, child]))
        yield (
            f"nothing holds limb {parent} and limb {child} together: the best joint between them lies "
            f"{guesses[min(parent, child), max(parent, child)].distance:.0f} mm from the markers and wobbles by "
            f"{gap:.0f} mm; they are separate bodies"
        )
    n_never = len(topology.roots) - n_bodies - len(tree.cut)
    if n_never > 0:
        yield (
            f"{n_never + 1} limbs or groups of limbs are separate bodies: they are never seen together, or no joint "
            "between them is allowed, or lasts"
        )
    yield from _doubtful_edges(topology)
    for first, second in topology.loops:
        yield (
            f"limb {first} and limb {second} share a joint too, which the tree does not use: limbs there form a loop"
        )
    for parent, child in topology.edges.tolist():
        yield from _weak_joint(parent, child, guesses[min(parent, child), max(parent, child)])


def undetermined_limb_notices(segments: list[Segment]) -> Iterator[str]:
    """Say which limbs have points on one line only, joints included.

    Parameters
    ----------
    segments : list of Segment
        All limbs, with the joints that were found.
    """
    for limb, segment in enumerate(segments):
        if segment.is_seen.any() and not segment.shape.posed.any():
            yield f"all that is seen of limb {limb} lies on one line: how it turns about that line is not determined"


def stuck_joint_notices(joints: Mapping[int, JointGuess], parents: Ints) -> Iterator[str]:
    """Say which joints conjugate gradients have not found, although they started anew.

    Parameters
    ----------
    joints : mapping of int to JointGuess
        By child limb, found by conjugate gradients.
    parents : ndarray of intp, shape (n_limbs,)
        The tree, -1 for roots.
    """
    squares = {child: joint.square for child, joint in joints.items()}
    median = float(np.quantile(list(squares.values()), 0.5, method="lower")) if squares else 0.0
    for child, square in squares.items():
        if square > STUCK * max(median, joints[child].expected, LEAST_VARIANCE):
            yield (
                f"the descent to the joint between limb {parents[child]} and limb {child} is stuck: its distances to "
                f"markers vary by {np.sqrt(square):.2g} mm, those of other joints by {np.sqrt(median):.2g} mm; its "
                "place is wrong in many frames. The solver closed-form may find it"
            )


def _doubtful_edges(topology: Topology) -> Iterator[str]:
    if topology.edge_probability is None or topology.rival_probability is None:
        return
    for joint in topology.doubtful.tolist():
        (parent, child), (outer, inner) = topology.edges[joint].tolist(), topology.rivals[joint].tolist()
        own, other = 100 * topology.edge_probability[joint], 100 * topology.rival_probability[joint]
        if outer < 0:
            yield f"limb {child} hangs on limb {parent} ({own:.0f} %), or on nothing that is seen"
        elif inner == child:
            yield f"limb {child} hangs on limb {parent} ({own:.0f} %), but could hang on limb {outer} ({other:.0f} %)"
        else:
            yield (
                f"limb {child} hangs on limb {parent} ({own:.0f} %), but the joint could be one between limb {outer} "
                f"and limb {inner} ({other:.0f} %)"
            )


def _weak_joint(parent: int, child: int, guess: JointGuess) -> Iterator[str]:
    if guess.turn < LEAST_TURN:
        yield (
            f"limb {parent} and limb {child} hardly turn against each other ({np.rad2deg(guess.turn):.1f} deg beyond "
            "what errors of their markers explain): their motion alone says little of where their joint is"
        )
    if 0 < guess.n_frames < ENOUGH_FRAMES / 3:  # a frame of a single point counts a third
        yield f"the joint between limb {parent} and limb {child} rests on few frames; more motion would make it surer"


def _check_parents(parents: Ints, costs: Floats) -> None:
    for child in np.flatnonzero(parents >= 0):
        if not np.isfinite(costs[child, parents[child]]):
            raise InputError(
                f"limbs {parents[child]} and {child} are to be joined, but no {MIN_COMMON} frames show both of them"
            )
