"""Costs of joints weigh gaps by how well they are measured, against how near limbs stay to each other."""

import numpy as np
import pytest

from skelgen.stages.joints.costs import comparable_costs
from skelgen.stages.joints.false_joints import Parting
from skelgen.stages.joints.pairs import JointGuess
from skelgen.stages.joints.parameters import JointConstraints
from skelgen.stages.joints.tree import find_tree

N_LIMBS = 7
NOISE, GAP, ALPHA = 4.0, 40.0, 0.1  # mm^2, mm^2, mm
NOBODY = np.zeros((N_LIMBS, N_LIMBS), dtype=np.bool_)  # no two limbs are known to be of one person
FAR_ODDS, NEAR_ODDS = -3.0, 3.0


def row_of_limbs(ratios, wrong=GAP):
    """Limbs in a row; their joints have gaps of `ratios` times what noise makes, those of all others are large.

    By its gap the last limb hangs on the one before, by how near it stays on the first.
    """
    places = np.zeros((0, 3))
    guesses = {
        (first, second): JointGuess(places, 10 * wrong, NOISE, 100.0, 0.5, np.nan, 100)
        for second in range(N_LIMBS)
        for first in range(second)
    }
    for limb, ratio in enumerate(ratios):
        guesses[limb, limb + 1] = JointGuess(places, ratio * NOISE, NOISE, 100.0, 0.5, np.nan, 100)
    guesses[0, N_LIMBS - 1] = JointGuess(places, wrong, NOISE, 100.0, 0.5, np.nan, 100)
    odds = np.full((N_LIMBS, N_LIMBS), FAR_ODDS)
    for limb in range(N_LIMBS - 2):
        odds[limb, limb + 1] = odds[limb + 1, limb] = NEAR_ODDS
    odds[0, -1] = odds[-1, 0] = NEAR_ODDS
    np.fill_diagonal(odds, 0.0)
    return guesses, comparable_costs(guesses, N_LIMBS, ALPHA, odds)


@pytest.mark.parametrize(
    ("ratios", "parent"),
    [
        ((0.95, 1.0, 1.05, 1.0, 0.97, 1.02), N_LIMBS - 2),  # white noise: a gap three times as wide is no joint's
        ((0.2, 3.0, 1.0, 6.0, 0.4, 1.5), 0),  # soft tissue: such gaps are usual
    ],
)
def test_gaps_count_as_far_as_they_are_measured(ratios, parent):
    guesses, costs = row_of_limbs(ratios)
    tree = find_tree(costs, guesses, [3] * N_LIMBS, JointConstraints(roots=(0,)), None)
    assert tree.parents[-1] == parent


def test_nearness_decides_where_gaps_are_far_smaller_than_noise_makes_them():
    """Such gaps say that noise is overestimated, as of limbs of two markers, not that gaps are exact."""
    guesses, costs = row_of_limbs((0.02, 0.05, 0.03, 0.04, 0.06, 0.03), wrong=1.5 * NOISE)
    tree = find_tree(costs, guesses, [3] * N_LIMBS, JointConstraints(roots=(0,)), None)
    assert tree.parents[-1] == 0


def test_a_dear_joint_whose_gap_noise_explains_is_not_cut():
    guesses, _ = row_of_limbs((1.0,) * (N_LIMBS - 1), wrong=4e4)
    for limb in range(N_LIMBS - 1):  # the last limb is far from all others, and hardly turns
        guesses[limb, N_LIMBS - 1] = JointGuess(np.zeros((0, 3)), NOISE / 2, NOISE, 3000.0, 0.02, np.nan, 100)
    costs = comparable_costs(guesses, N_LIMBS, ALPHA)
    tree = find_tree(costs, guesses, [3] * N_LIMBS, JointConstraints(roots=(0,)), Parting(100.0, NOBODY))
    assert not tree.cut and (tree.parents < 0).sum() == 1


@pytest.mark.parametrize("known", [False, True])
def test_a_dear_joint_is_cut_unless_limbs_on_both_sides_are_of_one_person(known):
    guesses, _ = row_of_limbs((1.0,) * (N_LIMBS - 1))
    for limb in range(N_LIMBS - 1):  # no place is better than the others for the joint of the last limb
        guesses[limb, N_LIMBS - 1] = JointGuess(np.zeros((0, 3)), 100 * NOISE, NOISE, 3000.0, 0.5, np.nan, 100)
    costs = comparable_costs(guesses, N_LIMBS, ALPHA)
    of_one = NOBODY.copy()
    of_one[0, N_LIMBS - 1] = of_one[N_LIMBS - 1, 0] = known
    tree = find_tree(costs, guesses, [3] * N_LIMBS, JointConstraints(roots=(0,)), Parting(100.0, of_one))
    assert (len(tree.cut) == 0) == known
    assert (tree.parents < 0).sum() == (1 if known else 2)
