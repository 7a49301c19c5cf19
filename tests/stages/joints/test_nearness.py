"""Limbs that stay near each other are neighbours, where gaps of joints say little."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import Limbs, Trajectories
from skelgen.model.topology import spanning_forest
from skelgen.stages.joints import find_joints
from skelgen.stages.joints.nearness import neighbour_odds
from skelgen.stages.joints.segments import make_segments


def hanging_arms(scale=1.0):
    """A trunk that sways, with two arms of three limbs of one marker or two that hardly move, 120 frames."""
    rng = np.random.default_rng(0)
    time = np.arange(120)[:, np.newaxis, np.newaxis]
    trunk = np.array([[-150.0, 0, 400], [150, 0, 400], [0, 80, 300], [0, -80, 320]])
    arms = [
        [[side * 190.0, 0, height] for height in heights]
        for side in (-1, 1)
        for heights in ((340, 250), (150, 60), (-40,))
    ]
    points = [np.tile(np.array(limb), (120, 1, 1)) for limb in (trunk, *arms)]
    for limb, one in enumerate(points):
        swing = 0.02 * np.sin(0.1 * time + limb) * np.array([[1.0, 1.0, 0.0]])
        points[limb] = one + swing * (400 - one[:, :, 2:]) + rng.normal(0, 0.5, one.shape)
    sway = 60 * np.sin(0.05 * time) * np.array([[0.0, 1.0, 0.0]])
    positions = scale * (np.concatenate(points, axis=1) + sway)
    limb_of_marker = np.repeat(np.arange(len(points)), [one.shape[1] for one in points])
    names = tuple(map(str, range(len(limb_of_marker))))
    return Trajectories(positions, names, 100.0), Limbs(limb_of_marker, np.zeros((len(names),) * 2))


def table(take, limbs):
    frames = np.arange(take.n_frames)
    segments = make_segments([take.positions[:, limbs.markers_of(k)] for k in range(limbs.n_limbs)], frames)
    return neighbour_odds(segments, frames, limbs.body_of_limb)


def test_arms_that_hang_still_are_not_joined_to_each_other():
    topology = find_joints(*hanging_arms())
    assert {frozenset(edge) for edge in topology.edges.tolist()} == {
        frozenset(pair) for pair in ((0, 1), (1, 2), (2, 3), (0, 4), (4, 5), (5, 6))
    }


def test_odds_have_no_scale_and_are_symmetric():
    one, other = table(*hanging_arms()), table(*hanging_arms(10.0))
    np.testing.assert_allclose(one, other)
    np.testing.assert_array_equal(one, one.T)
    assert one[1, 2] > one[1, 3] > one[1, 6]


@pytest.mark.parametrize("lost", [slice(0, 60), slice(0, 120)])
def test_limb_that_is_hardly_seen_has_finite_odds(lost):
    take, limbs = hanging_arms()
    positions = take.positions.copy()
    positions[lost, -1] = np.nan
    assert np.isfinite(table(Trajectories(positions, take.names, take.rate), limbs)).all()


def test_limbs_whose_markers_lie_on_each_other_have_finite_odds():
    take, limbs = hanging_arms()
    lying = take.positions.copy()
    lying[:, -1] = lying[:, 0]
    with np.errstate(all="raise"):
        assert np.isfinite(table(Trajectories(lying, take.names, take.rate), limbs)).all()


def test_of_limbs_that_are_all_far_the_nearest_can_be_told():
    positions = 1000 * np.random.default_rng(0).normal(size=(10, 60, 3))
    take = Trajectories(positions, tuple(map(str, range(60))), 100.0)
    odds = table(take, Limbs(np.arange(60), np.zeros((60, 60))))[np.triu_indices(60, 1)]
    assert len(np.unique(odds)) == len(odds)


def test_limb_of_one_marker_is_no_root():
    costs = np.full((4, 4), 9.0)
    costs[0, 1:] = costs[1:, 0] = 1.0
    assert spanning_forest(costs, np.array([1, 3, 4, 2])).tolist() == [2, 0, -1, 0]
