"""The tree of limbs: Prim's minimum spanning tree over joint costs, rooted at the limb with most joints (seed 4.6)."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats, Ints


def spanning_tree(costs: Floats, sizes: Ints, root: int | None = None) -> Ints:
    """Return the parent of each limb in the minimum spanning forest.

    Parameters
    ----------
    costs : ndarray, shape (n_limbs, n_limbs), mm^2
        Symmetric joint costs; infinite where two limbs cannot be joined.
    sizes : ndarray of intp, shape (n_limbs,)
        Number of markers on each limb: of two limbs with as many joints, the larger becomes the root.
    root : int, optional
        Limb that becomes the root of its tree in any case.

    Returns
    -------
    ndarray of intp, shape (n_limbs,)
        -1 for a root; limbs that no finite cost connects belong to separate trees.
    """
    edges = _cheapest_edges(np.where(np.eye(len(costs), dtype=bool), np.inf, costs))
    joined: list[list[int]] = [[] for _ in range(len(costs))]
    for first, second in edges:
        joined[first].append(second)
        joined[second].append(first)
    parents = np.full(len(costs), -1, dtype=np.intp)
    placed: set[int] = set()
    for start in sorted(range(len(costs)), key=lambda limb: (limb != root, -len(joined[limb]), -sizes[limb], limb)):
        if start in placed:
            continue
        placed.add(start)
        waiting = [start]
        for parent in waiting:  # grows as limbs are placed
            children = [child for child in joined[parent] if child not in placed]
            parents[children] = parent
            placed.update(children)
            waiting += children
    return parents


def _cheapest_edges(costs: Floats) -> list[tuple[int, int]]:
    """Edges of the minimum spanning forest, grown from one limb after the other (Prim 1957)."""
    edges: list[tuple[int, int]] = []
    cost, nearest = np.full(len(costs), np.inf), np.full(len(costs), -1, dtype=np.intp)
    waiting = np.ones(len(costs), dtype=bool)
    for _ in range(len(costs)):
        limb = int(np.argmin(np.where(waiting, cost, np.inf))) if np.isfinite(cost[waiting]).any() else -1
        if limb >= 0:
            edges.append((int(nearest[limb]), limb))
        else:
            limb = int(np.argmax(waiting))
        waiting[limb] = False
        cheaper = costs[limb] < cost
        cost[cheaper], nearest[cheaper] = costs[limb][cheaper], limb
    return edges
