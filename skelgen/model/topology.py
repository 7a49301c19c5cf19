"""How limbs are joined: a graph of limbs with its spanning tree.

networkx takes a fifth of a second to import: it is imported where a graph is asked for.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints, check_fields, check_ints, check_probabilities, set_fields
from skelgen.model.joint_spans import JointSpan
from skelgen.model.limbs import DOUBTFUL

if TYPE_CHECKING:
    from networkx import Graph


@dataclass(frozen=True, eq=False)
class Topology:
    """The spanning tree over limbs.

    Attributes
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent limb of each limb, -1 for a root.
    joint_costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Symmetric cost of a joint between each two limbs; infinite costs are NaN (never seen together, or refused by
        the user), the diagonal is 0.
    raw_joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        World positions of the joints before the fit of rigid limbs; NaN where unknown. Joints are in the order
        of `children`.
    n_iterations : ndarray of intp, shape (n_joints,)
        Iterations that the minimisation of each joint took.
    values : ndarray, shape (n_joints,), mm^2
        Joint cost at each solution over all frames, with the weight `final_alpha`.
    alpha : float
        Weight of the mean marker-joint distance in `joint_costs`.
    loops : tuple of pairs of int
        Pairs of limbs that seem joined although the tree does not join them: they close kinematic loops.
    final_alpha : float
        Weight of the mean marker-joint distance in `values`, with which joints are placed.
    spans : tuple of JointSpan
        Joints beyond the tree that hold for a part of the take only.
    edge_probability, rival_probability : ndarray, shape (n_joints,), or None
        Probability that the two limbs of each joint are neighbours, and that those of its rival are instead; 1 and 0
        where the user states the joint; None where it was not estimated.
    """

    parents: Ints
    joint_costs: Floats
    raw_joint_positions: Floats
    n_iterations: Ints
    values: Floats
    alpha: float
    loops: tuple[tuple[int, int], ...] = ()
    final_alpha: float = 0.0
    edge_probability: Floats | None = None
    rival_probability: Floats | None = None
    spans: tuple[JointSpan, ...] = ()

    def __post_init__(self) -> None:
        parents = check_ints(self.parents, (None,), "parents")
        n_limbs = len(parents)
        check_forest(parents)
        n_joints = int((parents >= 0).sum())
        raw: tuple[int | None, ...] = (None, n_joints, 3)
        check_fields(self, {"joint_costs": (n_limbs, n_limbs), "raw_joint_positions": raw, "values": (n_joints,)})
        n_iterations = check_ints(self.n_iterations, (n_joints,), "n_iterations")
        set_fields(self, parents=parents, n_iterations=n_iterations, alpha=float(self.alpha), spans=tuple(self.spans))
        for name in ("edge_probability", "rival_probability"):
            if getattr(self, name) is not None:
                set_fields(self, **{name: check_probabilities(getattr(self, name), (n_joints,), name)})
        for pair in (*self.loops, *(span.limbs for span in self.spans)):
            if len(pair) != 2 or not all(0 <= limb < n_limbs for limb in pair):
                raise InputError(f"a loop, or a joint for a span, joins two of {n_limbs} limbs, not {pair}")

    @property
    def graph(self) -> Graph:
        """All joints that are possible, as a `networkx.Graph`, built when it is asked for.

        Nodes are limbs. An edge has its ``cost`` [mm^2]; ``in_tree`` says whether the spanning tree uses it, and
        ``closes_loop`` whether the limbs seem joined although the tree does not join them.
        """
        from networkx import set_edge_attributes  # noqa: PLC0415 - see the module's docstring

        graph = _graph_of_costs(self.joint_costs)
        edges = [(parent, child) for parent, child in self.edges.tolist()]
        costs = self.joint_costs
        graph.add_weighted_edges_from(((a, b, float(costs[a, b])) for a, b in (*edges, *self.loops)), weight="cost")
        for name, pairs in (("in_tree", edges), ("closes_loop", self.loops)):
            set_edge_attributes(graph, False, name)
            set_edge_attributes(graph, dict.fromkeys(pairs, True), name)
        return graph

    @property
    def tree(self) -> Graph:
        """All limbs and the joints of the spanning tree, as a `networkx.Graph`, built when it is asked for."""
        from networkx import Graph  # noqa: PLC0415 - see the module's docstring

        tree = Graph()
        tree.add_nodes_from(range(self.n_limbs))
        tree.add_edges_from(self.edges.tolist())
        return tree

    @property
    def bodies(self) -> tuple[Ints, ...]:
        """The limbs of each body, that is of each tree; see `limbs_of_bodies`."""
        return limbs_of_bodies(self.parents)

    def limbs_of_tree(self, limb: int) -> set[int]:
        """Return the limbs of the tree that a limb belongs to."""
        return next(set(body.tolist()) for body in self.bodies if limb in body)

    def for_take(self, n_frames: int) -> Topology:
        """Return the same tree for another take, where joints were not sought frame by frame, nor those of a span."""
        return replace(self, raw_joint_positions=np.full((n_frames, self.n_joints, 3), np.nan), spans=())

    @property
    def n_limbs(self) -> int:
        """Number of limbs."""
        return len(self.parents)

    @property
    def n_joints(self) -> int:
        """Number of joints: one per limb that is not a root."""
        return len(self.children)

    @property
    def roots(self) -> Ints:
        """Limbs without a parent."""
        return np.flatnonzero(self.parents < 0)

    @property
    def children(self) -> Ints:
        """The child limb of each joint, from the roots outward (breadth first), shape (n_joints,)."""
        return joint_children(self.parents)

    @property
    def edges(self) -> Ints:
        """Parent and child limb of each joint, shape (n_joints, 2)."""
        children = self.children
        return np.stack([self.parents[children], children], axis=1)

    @property
    def rivals(self) -> Ints:
        """The cheapest other joint between the two parts that each joint connects, shape (n_joints, 2).

        The limb on the parent's side first; -1 where there is no other.
        """
        found = cheapest_rivals(self.parents, self.joint_costs)
        return np.array([found[int(child)][0] for child in self.children], dtype=np.intp).reshape(-1, 2)

    @property
    def doubtful(self) -> Ints:
        """Indices of the joints whose limbs are perhaps no neighbours, the least sure first."""
        if self.edge_probability is None:
            return np.zeros(0, dtype=np.intp)
        order = np.argsort(self.edge_probability, kind="stable")
        return order[self.edge_probability[order] < DOUBTFUL]

    @property
    def margins(self) -> Floats:
        """How much worse [mm^2] the best tree without each joint is, shape (n_joints,); NaN where there is no other."""
        found = cheapest_rivals(self.parents, self.joint_costs)
        parents, children = self.parents[self.children], self.children
        return np.array([found[int(child)][1] for child in children]) - self.joint_costs[parents, children]


def _graph_of_costs(costs: Floats) -> Graph:
    """Return limbs and possible joints as a graph, whose edges have a ``cost``.

    Parameters
    ----------
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Symmetric joint costs; NaN or infinite where two limbs cannot be joined.
    """
    from networkx import Graph  # noqa: PLC0415 - see the module's docstring

    graph = Graph()
    graph.add_nodes_from(range(len(costs)))
    first, second = np.nonzero(np.triu(np.isfinite(costs), 1))
    edges = zip(first.tolist(), second.tolist(), costs[first, second].tolist(), strict=True)
    graph.add_weighted_edges_from(edges, weight="cost")
    return graph


def spanning_forest(costs: Floats, sizes: Ints | None = None, roots: Sequence[int] = ()) -> Ints:
    """Return the parent of each limb in the minimum spanning forest over joint costs, by Prim's algorithm (1957).

    Parameters
    ----------
    costs : ndarray, shape (n_limbs, n_limbs)
        Symmetric joint costs; NaN or infinite where two limbs cannot be joined.
    sizes : ndarray of intp, shape (n_limbs,), optional
        Number of markers on each limb. The root of a tree is the limb from which most branches hang that are alike in
        their number of markers, of several the one with most markers, and never one of a single marker if there are
        others. Without them every limb counts as one.
    roots : sequence of int, optional
        Limbs that are the roots of their trees in any case; the first of several that are in one tree.

    Returns
    -------
    ndarray of intp, shape (n_limbs,)
        -1 for a root; limbs that no finite cost connects belong to separate trees.

    Examples
    --------
    >>> spanning_forest(np.array([[0.0, 3.0, 1.0], [3.0, 0.0, 2.0], [1.0, 2.0, 0.0]]))
    array([ 2,  2, -1])
    """
    from networkx import bfs_edges, minimum_spanning_tree  # noqa: PLC0415 - see the module's docstring

    tree = minimum_spanning_tree(_graph_of_costs(costs), weight="cost", algorithm="prim")
    sizes = np.full(len(costs), 1, dtype=np.intp) if sizes is None else sizes
    branches = _branch_numbers(tree, sizes)
    parents = np.full(len(costs), -1, dtype=np.intp)
    placed: set[int] = set()
    given = {limb: rank - len(roots) for rank, limb in reversed(list(enumerate(roots)))}
    ranks = {limb: (given.get(limb, 0), sizes[limb] == 1, -branches[limb], -sizes[limb], limb) for limb in tree}
    for start in sorted(tree, key=lambda limb: ranks[limb]):
        if start not in placed:
            placed.add(start)
            for parent, child in bfs_edges(tree, start):
                parents[child] = parent
                placed.add(child)
    return parents


def _branch_numbers(forest: Graph, sizes: Ints) -> Floats:
    """How many branches hang from each limb, those that count being alike, shape (n_limbs,).

    The square of the sum over the sum of squares of their numbers of markers: a limb with most joints near the middle
    of the body has most, and a marker more or less at the end of a branch hardly changes it.

    Parameters
    ----------
    forest : networkx.Graph
        Limbs and joints without loops.
    sizes : ndarray of intp, shape (n_limbs,)
        Number of markers on each limb.
    """
    from networkx import connected_components, dfs_edges  # noqa: PLC0415 - see the module's docstring

    total, squares = np.zeros((2, len(sizes)), dtype=np.intp)
    for limbs in connected_components(forest):
        everything, borne = int(sizes[list(limbs)].sum()), sizes.copy()
        for parent, child in reversed(list(dfs_edges(forest, min(limbs)))):
            borne[parent] += borne[child]
            for limb, branch in ((parent, borne[child]), (child, everything - borne[child])):
                total[limb] += branch
                squares[limb] += branch**2
    return np.asarray(total**2 / np.maximum(squares, 1))


def outward_order(parents: Ints) -> Ints:
    """Limbs sorted from the roots outward, breadth first and by index within a level.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root; without cycles.
    """
    order: list[int] = [int(root) for root in np.flatnonzero(parents < 0)]
    for limb in order:  # the list grows while it is walked: that is the breadth-first search
        order.extend(int(child) for child in np.flatnonzero(parents == limb))
    return np.array(order, dtype=np.intp)


def limbs_of_bodies(parents: Ints) -> tuple[Ints, ...]:
    """Return the limbs of each body, that is of each tree, rising; the body with most limbs first.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.

    Examples
    --------
    >>> [limbs.tolist() for limbs in limbs_of_bodies(np.array([-1, -1, 1, 2]))]
    [[1, 2, 3], [0]]
    """
    root = np.arange(len(parents))
    for child in joint_children(parents).tolist():
        root[child] = root[parents[child]]
    bodies = [np.flatnonzero(root == one) for one in np.unique(root)]
    return tuple(sorted(bodies, key=lambda limbs: (-len(limbs), int(limbs[0]))))


def joint_children(parents: Ints) -> Ints:
    """Return the child limb of each joint, from the roots outward, shape (n_joints,); `parents` as above."""
    return outward_order(parents)[(parents < 0).sum() :]


def branches(parents: Ints) -> Bools:
    """Return the limbs of the branch that each limb bears, itself included, shape (n_limbs, n_limbs).

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.

    Examples
    --------
    >>> branches(np.array([-1, 0, 1])).sum(axis=1)
    array([3, 2, 1])
    """
    borne = np.eye(len(parents), dtype=np.bool_)
    for limb in joint_children(parents)[::-1].tolist():
        borne[parents[limb]] |= borne[limb]
    return borne


def cheapest_rivals(parents: Ints, costs: Floats) -> dict[int, tuple[tuple[int, int], float]]:
    """Return the cheapest other edge, and its cost, between the two parts that each edge of a forest connects.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Symmetric; NaN where two limbs cannot be joined.

    Returns
    -------
    dict
        By child: the limb on the parent's side and that on the child's, with the cost; (-1, -1) and NaN if there is no
        other.
    """
    root, inside = np.arange(len(parents)), branches(parents)
    for limb in joint_children(parents).tolist():
        root[limb] = root[parents[limb]]
    found = {}
    for child in np.flatnonzero(parents >= 0).tolist():
        rest = (root == root[child]) & ~inside[child]
        allowed = rest[:, np.newaxis] & inside[child] & ~np.isnan(costs)
        allowed[parents[child], child] = False
        if not allowed.any():
            found[child] = ((-1, -1), float("nan"))
            continue
        open_costs = np.where(allowed, costs, np.inf)
        outer, inner = np.unravel_index(int(open_costs.argmin()), costs.shape)
        found[child] = ((int(outer), int(inner)), float(open_costs.min()))
    return found


def parents_from_names(names: tuple[str, ...], parents: Mapping[str, str | None]) -> Ints:
    """Return the parents of bodies by index, -1 for roots; bodies that are not mentioned are roots.

    Parameters
    ----------
    names : tuple of str
        The bodies.
    parents : mapping of str to str or None
        The parent of each body by name; None or empty for a root.

    Raises
    ------
    InputError
        If a name is unknown, or the parents form a cycle.
    """
    for child, parent in parents.items():
        for name in (child, parent):
            if name and name not in names:
                known = ", ".join(names)
                raise InputError(f"the hierarchy names {name!r}, which is not in the take; there are {known}")
    index = np.array([names.index(parent) if (parent := parents.get(name)) else -1 for name in names], dtype=np.intp)
    if len(outward_order(index)) != len(names):
        raise InputError("the hierarchy goes round in a circle: following the parents must end at a root")
    return index


def check_forest(parents: Ints) -> None:
    """Check that following the parents of limbs ends at a root.

    Parameters
    ----------
    parents : ndarray of intp, shape (n_limbs,)
        Parent of each limb, -1 for a root.

    Raises
    ------
    InputError
        If a parent is no limb, or the parents form a circle.
    """
    if ((parents < -1) | (parents >= len(parents))).any():
        raise InputError("a parent index names no limb")
    if len(outward_order(parents)) != len(parents):
        raise InputError("the parents form a cycle")
