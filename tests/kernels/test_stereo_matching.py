"""Pairs of balls and their points: exact geometry, NaN, and the best of all lines next to the epipole."""

from __future__ import annotations

import numpy as np

from skelgen._kernels.camera import rays_of_pixels
from skelgen._kernels.stereo_matching import Geometry, View, find_pairs, triangulate

CAMERA = np.array([800.0, 800.0, 320.0, 240.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, np.inf])
ASIDE = np.array([-400.0, 0.0, 20.0])
BEHIND = np.array([3.0, 2.0, 500.0])


def geometry(shift):
    """A right camera that looks as the left one does."""
    x, y, z = shift
    return Geometry(np.eye(3), shift, np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]))


def pixels_of(points):
    """Where the camera sees points in its frame."""
    return points[:, :2] / points[:, 2:] * 800.0 + [320.0, 240.0]


def view(points, std=0.05, noise=0.0):
    """What the camera sees of points in its frame."""
    return View(*rays_of_pixels(pixels_of(points) + noise, np.full(len(points), std), CAMERA))


def points_before(n, seed=0):
    return np.random.default_rng(seed).uniform([-100, -150, 800], [350, 150, 1500], (n, 3))


def test_exact_pixels_give_their_points():
    points = points_before(8)
    both = np.stack([np.arange(8)] * 2, axis=1)
    found = triangulate(view(points), view(points + ASIDE), geometry(ASIDE), both)
    np.testing.assert_allclose(found.points, points, atol=1e-8)
    assert np.abs(found.shifts).max() < 1e-9


def test_true_pairs_are_among_those_found_and_one_off_its_line_is_not():
    points = points_before(8)
    left, right = view(points), view(points + ASIDE)
    right.rays[3, 1] += 2.0 / 800.0  # forty deviations
    pairs = {tuple(pair) for pair in find_pairs(left, right, geometry(ASIDE), 5.0).tolist()}
    assert {(ball, ball) for ball in range(8) if ball != 3} <= pairs
    assert (3, 3) not in pairs


def test_pixels_that_are_not_there_have_no_partner():
    points = points_before(4)
    left, right = view(points), view(points + ASIDE)
    left.rays[1], right.rays[2] = np.nan, np.nan
    pairs = find_pairs(left, right, geometry(ASIDE), 5.0)
    assert 1 not in pairs[:, 0] and 2 not in pairs[:, 1]
    assert np.isnan(triangulate(left, right, geometry(ASIDE), np.array([[1, 1]])).points).all()


def test_rays_that_meet_behind_the_cameras_give_no_point():
    points = points_before(2)
    found = triangulate(view(points + ASIDE), view(points), geometry(ASIDE), np.array([[0, 0]]))
    assert np.isnan(found.points).all() and np.isnan(found.covariances).all()


def test_the_covariance_is_that_of_the_slope():
    points, std = points_before(3), 0.1
    both = np.stack([np.arange(3)] * 2, axis=1)
    found = triangulate(view(points, std), view(points + ASIDE, std), geometry(ASIDE), both)
    for point, covariance in zip(points, found.covariances, strict=True):
        steps = 1e-3 * np.eye(3)
        seen = [np.concatenate([pixels_of(point + s), pixels_of(point + s + ASIDE)], axis=1) for s in (steps, -steps)]
        slope = ((seen[0] - seen[1]) / 2e-3).T / std
        np.testing.assert_allclose(covariance, np.linalg.inv(slope.T @ slope), rtol=1e-4)


def test_next_to_the_epipole_the_best_of_all_lines_is_taken():
    """One camera behind the other: both epipoles are in the middle of the image."""
    rng = np.random.default_rng(6)
    points = np.column_stack([rng.uniform(-30, 30, (20, 2)), np.full(20, 1500.0)])
    left, right = view(points, 1.0, rng.normal(size=(20, 2))), view(points + BEHIND, 1.0, rng.normal(size=(20, 2)))
    found = triangulate(left, right, geometry(BEHIND), np.stack([np.arange(20)] * 2, axis=1))
    angles = np.linspace(0, np.pi, 5000)
    across = np.stack([-np.sin(angles), np.cos(angles)])
    epipole = BEHIND[:2] / BEHIND[2]  # of both: they look the same way
    every = 800.0**2 * (((left.rays - epipole) @ across) ** 2 + ((right.rays - epipole) @ across) ** 2)
    np.testing.assert_allclose((found.shifts**2).sum(axis=1), every.min(axis=1), atol=1e-3)  # of 5000 lines
