"""The graph of limbs, its spanning forest, and what the tree leaves out."""

from __future__ import annotations

import pickle

import numpy as np
import pytest
from scipy.sparse.csgraph import minimum_spanning_tree

from skelgen.model import Topology
from skelgen.model.topology import spanning_forest


def symmetric(costs):
    """Costs given above the diagonal; infinite pairs cannot be joined."""
    upper = np.triu(costs, 1)
    return upper + upper.T


@pytest.fixture
def topology():
    """Limbs 0-1-2-3 in a row, a loop between 0 and 3, and limb 4 by itself."""
    costs = np.full((5, 5), np.nan)
    np.fill_diagonal(costs, 0.0)
    for first, second, cost in ((0, 1, 1.0), (1, 2, 2.0), (2, 3, 3.0), (0, 3, 4.0), (0, 2, 9.0)):
        costs[first, second] = costs[second, first] = cost
    return Topology(
        parents=np.array([1, -1, 1, 2, -1]),
        joint_costs=costs,
        raw_joint_positions=np.zeros((1, 3, 3)),
        n_iterations=np.zeros(3, dtype=np.intp),
        values=np.zeros(3),
        alpha=0.1,
        loops=((0, 3),),
    )


def test_graph_holds_every_possible_joint_with_its_cost(topology):
    assert sorted(topology.graph.edges(data="cost")) == [
        (0, 1, 1.0),
        (0, 2, 9.0),
        (0, 3, 4.0),
        (1, 2, 2.0),
        (2, 3, 3.0),
    ]


def test_graph_tells_joints_of_the_tree_from_those_that_close_loops(topology):
    assert sorted(topology.tree.edges) == [(0, 1), (1, 2), (2, 3)]
    assert [pair[:2] for pair in topology.graph.edges(data="closes_loop") if pair[2]] == [(0, 3)]


def test_limbs_of_a_tree_are_those_that_hang_together(topology):
    assert topology.limbs_of_tree(3) == {0, 1, 2, 3}
    assert topology.limbs_of_tree(4) == {4}


def test_topology_is_pickled_after_its_graph_was_asked_for(topology):
    assert topology.limbs_of_tree(0)
    assert pickle.loads(pickle.dumps(topology)).graph.edges == topology.graph.edges


@pytest.mark.parametrize("seed", range(5))
def test_no_forest_costs_less(seed):
    random = np.random.default_rng(seed)
    costs = symmetric(random.uniform(1.0, 2.0, (12, 12)))
    costs[costs > 1.8] = np.inf
    parents = spanning_forest(costs)
    children = np.flatnonzero(parents >= 0)
    finite = np.where(np.isfinite(costs), costs, 0.0)
    assert costs[children, parents[children]].sum() == pytest.approx(minimum_spanning_tree(finite).sum())


def test_root_is_the_limb_with_most_joints_then_the_largest_unless_it_is_given():
    chain = symmetric(np.array([[0, 1, 9, 9], [0, 0, 1, 9], [0, 0, 0, 1], [0, 0, 0, 0.0]]))
    assert spanning_forest(chain).tolist() == [1, -1, 1, 2]
    assert spanning_forest(chain, np.array([1, 1, 5, 1])).tolist() == [1, 2, -1, 2]
    assert spanning_forest(chain, roots=(3,)).tolist() == [1, 2, 3, -1]


@pytest.mark.parametrize("n_fingers", [0, 3, 5])
def test_root_is_the_pelvis_however_many_fingers_are_seen(n_fingers):
    pelvis, chest, hand = 0, 1, 3
    edges = [(pelvis, chest), (chest, 2), (chest, hand), (chest, 4), (pelvis, 5), (5, 6), (pelvis, 7), (7, 8)]
    edges += [(hand, 9 + finger) for finger in range(n_fingers)]
    costs = np.full((9 + n_fingers,) * 2, np.inf)
    for first, second in edges:
        costs[first, second] = costs[second, first] = 1.0
    sizes = np.array([4, 5, 3, 4, 4, 3, 6, 3, 6] + [1] * n_fingers)
    assert np.flatnonzero(spanning_forest(costs, sizes) < 0).tolist() == [pelvis]


def test_limbs_that_nothing_joins_are_trees_of_their_own():
    assert spanning_forest(np.full((3, 3), np.inf)).tolist() == [-1, -1, -1]
