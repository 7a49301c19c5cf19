from __future__ import annotations

import numpy as np

from skelgen.capture.bodies import resolved_points
from skelgen.capture.values import FoundBody, StereoPoints


def candidates(left, right, distances):
    n = len(left)
    covariance = np.tile(np.eye(3), (n, 1, 1))
    return StereoPoints(
        np.zeros((n, 3)), covariance, np.array(left), np.array(right), np.array(distances), np.zeros(n, bool)
    )


def test_every_ball_is_used_once_by_the_pair_that_fits_best():
    points = candidates([0, 0, 1], [0, 1, 1], [0.2, 0.05, 0.1])
    np.testing.assert_array_equal(resolved_points(points, []), [1])
    points = candidates([0, 0, 1], [0, 1, 1], [0.05, 0.2, 0.1])
    np.testing.assert_array_equal(resolved_points(points, []), [0, 2])


def test_points_of_bodies_are_real():
    points = candidates([0, 0, 1, 2], [0, 1, 1, 2], [0.2, 0.01, 0.1, 0.3])
    body = FoundBody("hand", np.eye(4), np.eye(6), np.array([0, -1, 2]), 0.1)
    np.testing.assert_array_equal(resolved_points(points, [body]), [0, 2, 3])


def test_no_points_are_left_of_none():
    assert len(resolved_points(candidates([], [], []), [])) == 0
