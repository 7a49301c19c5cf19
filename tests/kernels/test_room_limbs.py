"""Hidden markers against truth: distances and a ball of one camera place them."""

from __future__ import annotations

import numpy as np

from skelgen._kernels.room_limbs import Kept, carry

OTHERS = np.array([[[0.0, 0, 0], [100, 0, 0], [0, 100, 0]]])
TRUE = np.array([30.0, 40, 80])


def carried(start, true=TRUE, variance=1.0):
    """A marker that is expected elsewhere, and its distances from three others."""
    distances = np.linalg.norm(OTHERS - true, axis=2)
    states, covariances = np.array([[*start, 0.0, 0, 0]]), np.diag([25.0, 25, 25, 1e4, 1e4, 1e4])[np.newaxis].copy()
    agree = carry(states, covariances, Kept(OTHERS, distances, np.full((1, 3), variance)), np.array([0.01]), 1e3, 5.0)
    return states[0], covariances[0], bool(agree[0])


def test_distances_bring_a_marker_to_where_it_is():
    state, covariance, agrees = carried(TRUE + np.array([4.0, -3, 5]), variance=0.01)
    assert agrees
    np.testing.assert_allclose(state[:3], TRUE, atol=0.5)  # one step of a curved problem
    assert np.sqrt(np.trace(covariance[:3, :3])) < 1.0


def test_distances_that_are_not_kept_do_not_agree():
    assert not carried(TRUE, true=TRUE + 60.0)[2]


def test_speed_carries_on_where_no_distance_is_known():
    states, covariances = np.array([[1.0, 2, 3, 100, 0, -100]]), np.eye(6)[np.newaxis].copy()
    nothing = Kept(np.full((1, 3, 3), np.nan), np.zeros((1, 3)), np.ones((1, 3)))
    agree = carry(states, covariances, nothing, np.array([0.1]), 10.0, 5.0)
    assert not agree[0]
    np.testing.assert_allclose(states[0], [11, 2, -7, 100, 0, -100])
    change = np.array([0.1**2 / 2, 0.1]) * 10.0
    expected = [1 + 0.1**2 + change[0] ** 2, 1 + change[1] ** 2]
    np.testing.assert_allclose(np.diag(covariances[0])[[0, 3]], expected)
