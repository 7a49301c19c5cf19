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
    import networkx  # noqa: PLC0415 - only this stage pays for its import

    graph = networkx.Graph()
    graph.add_nodes_from(range(len(costs)))
    rows, columns = np.nonzero(np.triu(np.isfinite(costs), 1))
    pairs = zip(rows.tolist(), columns.tolist(), costs[rows, columns].tolist(), strict=True)
    graph.add_weighted_edges_from(pairs)
    tree = networkx.minimum_spanning_tree(graph, algorithm="prim")
    parents = np.full(len(costs), -1, dtype=np.intp)
    for component in networkx.connected_components(tree):
        start = min(component, key=lambda limb: (limb != root, -tree.degree[limb], -sizes[limb], limb))
        for parent, child in networkx.bfs_edges(tree, start, sort_neighbors=sorted):
            parents[child] = parent
    return parents
