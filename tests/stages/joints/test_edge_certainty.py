"""How sure edges of the tree are."""

from __future__ import annotations

import numpy as np

from skelgen.model import Limbs, Topology
from skelgen.stages.joints import JointConstraints
from skelgen.stages.joints.costs import with_certainty


def chain(rival_cost):
    """Three limbs in a row, and what the joint between the outer two costs."""
    costs = np.array([[0.0, 1.0, rival_cost], [1.0, 0.0, 1.0], [rival_cost, 1.0, 0.0]])
    return Topology([-1, 0, 1], costs, np.zeros((4, 2, 3)), [0, 0], [1.0, 1.0], 0.1)


TURNS, UNWORN = np.full((3, 3), 0.3), np.zeros((3, 3))  # rad, log odds


def limbs(*sure):
    """Limbs of two markers each that are on them so surely."""
    own = np.repeat(np.arange(len(sure)), 2)
    return limbs_of(own, np.eye(len(sure))[own] * np.repeat(sure, 2)[:, np.newaxis])


def limbs_of(own, membership=None):
    return Limbs(own, np.zeros((len(own), len(own))), membership=membership)


SURE = limbs(0.98, 0.98, 0.98)


def certain(rival_cost, turns=TURNS, constraints=None, of=SURE, worn=UNWORN):
    return with_certainty(chain(rival_cost), turns, of, constraints or JointConstraints(), worn)


def test_an_edge_is_surer_the_dearer_the_next_one_is():
    dearer = [certain(cost).edge_probability.min() for cost in (1.0, 1.5, 4.0, 50.0)]
    assert np.all(np.diff(dearer) > 0)
    assert dearer[0] < 0.5
    assert dearer[-1] > 0.98


def test_of_two_equal_edges_neither_is_likelier():
    tied = certain(1.0)
    assert tied.doubtful.tolist() == [0, 1]
    np.testing.assert_allclose(tied.rival_probability, tied.edge_probability, atol=0.02)


def test_limbs_that_hardly_turn_are_less_sure_neighbours():
    assert (certain(2.0, turns=0.1 * TURNS).edge_probability < certain(2.0).edge_probability).all()


def test_limbs_that_may_mix_others_are_less_sure_neighbours():
    of_mixed, of_clear = certain(50.0, of=limbs(0.98, 0.98, 0.6)).edge_probability[::-1]
    assert of_mixed < of_clear < certain(50.0).edge_probability.min()


def test_edges_that_what_is_worn_contradicts_are_less_sure():
    against = np.array([[0.0, -4.0, 0.0], [-4.0, 0.0, 4.0], [0.0, 4.0, 0.0]])
    contradicted, borne_out = certain(50.0, worn=against).edge_probability
    assert contradicted < 0.95 < certain(50.0).edge_probability[0] and borne_out == certain(50.0).edge_probability[1]


def test_limbs_of_one_marker_or_of_unknown_certainty_mix_nothing():
    for other in (limbs_of(np.arange(3), 0.1 * np.eye(3)), limbs_of(np.repeat(np.arange(3), 2))):
        np.testing.assert_array_equal(certain(2.0, of=other).edge_probability, certain(2.0).edge_probability)


def test_what_the_user_states_is_sure():
    joined = certain(1.0, constraints=JointConstraints(joined=((1, 2),)))
    assert joined.edge_probability[1] == 1.0
    assert joined.rival_probability[1] == 0.0
    assert joined.doubtful.tolist() == [0]
    given = certain(1.0, constraints=JointConstraints(parents=np.array([-1, 0, 1])))
    assert given.edge_probability.tolist() == [1.0, 1.0]


def test_joint_without_another_has_no_rival():
    alone = Topology([-1, 0], [[0, 3.0], [3.0, 0]], np.zeros((4, 1, 3)), [0], [1.0], 0.1)
    found = with_certainty(alone, np.full((2, 2), np.nan), limbs(0.98, 0.98), JointConstraints(), np.zeros((2, 2)))
    assert found.rival_probability.tolist() == [0.0]
    assert found.edge_probability[0] > 0.9
