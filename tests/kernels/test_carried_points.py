"""Points that their nearest neighbours carry along."""

import numpy as np

from skelgen._kernels.carried_points import LEAST_NEIGHBOURS, NEIGHBOURS, carried
from skelgen.geometry.rotations import matrix_from_vector

TURN, SHIFT = matrix_from_vector(np.array([0.3, -1.1, 0.7])), np.array([120.0, -40.0, 900.0])  # rad, mm


def limb(n_points, seed=0):
    """Points before and after a motion, one after the other; the first one is carried by the others."""
    before = np.random.default_rng(seed).uniform(0.0, 200.0, (n_points, 3))
    own = np.arange(1, n_points)[np.newaxis]
    return np.concatenate([before, before @ TURN.T + SHIFT]), np.array([0]), own, own + n_points


def test_a_rigid_limb_carries_a_point_exactly():
    for seed in range(5):
        points, begin, before, after = limb(8, seed)
        expected, misfit = carried(points, begin, before, after)
        np.testing.assert_allclose(expected[0], points[8], atol=1e-6)
        assert misfit[0] < 1e-6


def test_the_nearest_ones_alone_carry_it():
    points, begin, before, after = limb(12)
    away = np.linalg.norm(points[1:12] - points[0], axis=1)
    far = np.argsort(away)[NEIGHBOURS:]
    points[after[0, far]] += 50.0
    expected, _ = carried(points, begin, before, after)
    np.testing.assert_allclose(expected[0], points[12], atol=1e-6)


def test_the_misfit_is_the_error_of_a_coordinate():
    points, begin, before, after = limb(6)
    points = np.tile(points, (2000, 1))
    points += np.random.default_rng(1).normal(0.0, 0.5, points.shape)
    shift = 12 * np.arange(2000)[:, np.newaxis]
    _, misfit = carried(points, (begin + shift)[:, 0], before + shift, after + shift)
    np.testing.assert_allclose(np.sqrt((misfit**2).mean()), 0.5 * np.sqrt(2.0), rtol=0.03)  # noise at both times


def test_too_few_neighbours_and_those_on_one_line_carry_nothing():
    points, begin, before, after = limb(LEAST_NEIGHBOURS + 1)
    hidden = before.copy()
    hidden[0, 0] = -1
    assert np.isnan(carried(points, begin, hidden, after)[0]).all()
    points[1:4] = points[0] + np.arange(1, 4)[:, np.newaxis] * 20.0
    points[5:] = points[1:4].mean(axis=0) + np.arange(1, 4)[:, np.newaxis] * 20.0
    line = np.arange(1, 4)[np.newaxis]
    assert np.isnan(carried(points, begin, line, line + 3)[0]).all()
