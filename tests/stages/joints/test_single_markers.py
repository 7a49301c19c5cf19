"""Single markers are ends of the tree: what hangs on them hangs on their neighbour, where that fits as well."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.stages.joints.costs import JointCosts
from skelgen.stages.joints.tree import past_single_markers

PARENTS = np.array([-1, 0, 1, 2, 3])
"""A chain of five limbs, whose third is a single marker."""


def costs_with(gap_past):
    """Costs of the chain: neighbours have gaps of 2 mm, limbs 1 and 3 of `gap_past` mm, others of 50 mm."""
    gaps = np.full((5, 5), 50.0)
    for limb in range(4):
        gaps[limb, limb + 1] = gaps[limb + 1, limb] = 2.0
    gaps[1, 3] = gaps[3, 1] = gap_past
    np.fill_diagonal(gaps, 0.0)
    squares = gaps**2
    return JointCosts(squares, squares, squares, np.ones((5, 5)), np.ones((5, 5)))


def pairs(edges):
    return {(int(first), int(second)) for first, second in np.argwhere(np.triu(edges))}


def test_a_joint_past_a_single_marker_is_taken_where_it_fits():
    edges = past_single_markers(PARENTS, costs_with(2.5), np.array([3, 3, 1, 3, 3]), [])
    assert pairs(edges) == {(0, 1), (1, 3), (1, 2), (3, 4)}


@pytest.mark.parametrize(
    ("gap", "markers", "joined"),
    [
        (9.0, [3, 3, 1, 3, 3], []),  # the single marker is a limb between two others
        (3.5, [3, 3, 1, 3, 3], []),  # no wider than gaps may be, but three times dearer
        (2.5, [3, 3, 2, 3, 3], []),
        (2.5, [3, 3, 1, 3, 3], [(1, 2)]),  # the user says so
    ],
)
def test_the_tree_stays_where_a_single_marker_is_a_limb(gap, markers, joined):
    assert past_single_markers(PARENTS, costs_with(gap), np.array(markers), joined) is None


def test_a_joint_that_the_user_refuses_is_not_taken_past_a_single_marker():
    costs = costs_with(2.5)
    order = costs.order.copy()
    order[1, 3] = order[3, 1] = np.inf
    assert past_single_markers(PARENTS, replace(costs, order=order), np.array([3, 3, 1, 3, 3]), []) is None


def test_clasped_hands_of_one_marker_do_not_join_the_arms():
    chest, forearms, hands = 0, (1, 4), (2, 3)
    order = np.full((5, 5), 20.0)
    for pair, cost in {(0, 1): 0.19, (0, 4): 0.15, (1, 2): 0.02, (3, 4): 0.02, (2, 3): 0.16}.items():
        order[pair] = order[pair[::-1]] = cost
    costs = JointCosts(*(np.full((5, 5), 4.0),) * 5)
    round_the_loop = np.array([-1, hands[0], hands[1], forearms[1], chest])
    edges = past_single_markers(round_the_loop, replace(costs, order=order), np.array([3, 2, 1, 1, 2]), [])
    arms = {(chest, forearms[0]), (chest, forearms[1])}
    assert pairs(edges) == arms | {(forearms[0], hands[0]), (hands[1], forearms[1])}
