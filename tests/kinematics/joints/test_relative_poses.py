"""Relative poses and their covariance."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.chain.schur_complement import effective_frames, effective_frames_of_both
from skelgen.kinematics.joints.relative_poses import (
    BODY_SIZE,
    default_covariance,
    noise_size,
    pose_covariance,
    relative_poses,
)
from skelgen.model import Poses


def shaken(pose, shift, turn):
    """A pose with a small error in its own frame."""
    error = np.eye(4)
    error[:3, :3], error[:3, 3] = matrix_from_vector(turn), shift
    return pose @ error


def test_covariance_is_that_of_shaken_poses(random_poses):
    random, n = np.random.default_rng(0), 20_000
    base = random_poses(2, 4)
    covariances = np.stack([pose_covariance(random.normal(size=(4, 3)) * 50, 0.2) for _ in range(2)])
    bodies = []
    for pose, covariance in zip(base, covariances, strict=True):
        errors = random.multivariate_normal(np.zeros(6), covariance, size=n)
        bodies.append(np.stack([shaken(pose, error[:3], error[3:]) for error in errors]))
    related = relative_poses(Poses(np.stack(bodies, axis=1), ("a", "b"), 1.0), "a", "b", covariances)
    exact = np.linalg.inv(base[0]) @ base[1]
    found = np.cov(related.errors(np.tile(exact[:3, :3], (n, 1, 1)), exact[:3, 3]).T)
    stated = related.covariances.mean(axis=0)
    scale = np.sqrt(np.diag(stated))
    np.testing.assert_allclose(found / np.outer(scale, scale), stated / np.outer(scale, scale), atol=0.04)


def test_six_points_know_position_and_rotation_by_their_number_and_distance():
    covariance = default_covariance(50.0)
    np.testing.assert_allclose(covariance, np.diag([1 / 6] * 3 + [1 / (4 * 50**2)] * 3))


@pytest.mark.parametrize("size", [60.0, 300.0])
def test_ratio_of_errors_is_seen_in_neighbouring_frames(size):
    random, n = np.random.default_rng(1), 2000
    times = np.linspace(0, 20, n)
    covariance = default_covariance(size)
    bodies = np.tile(np.eye(4), (n, 2, 1, 1))
    for body in range(2):
        bodies[:, body, :3, :3] = matrix_from_vector(np.stack([np.sin(times + body), np.cos(times), 0 * times], axis=1))
        bodies[:, body, :3, 3] = 500 * np.stack([np.cos(times), np.sin(2 * times), times], axis=1)
        errors = 5 * random.normal(size=(n, 6)) * np.sqrt(np.diag(covariance))
        bodies[:, body] = np.stack(
            [shaken(*one) for one in zip(bodies[:, body], errors[:, :3], errors[:, 3:], strict=True)]
        )
    bodies[100:200, 1] = np.nan
    assert noise_size(Poses(bodies, ("a", "b"), 100.0)) == pytest.approx(size, rel=0.1)


def test_too_few_frames_leave_the_usual_ratio(random_poses):
    assert noise_size(Poses(random_poses(5, 0)[:, None], ("a",), 100.0)) == BODY_SIZE


def test_points_on_a_line_have_no_covariance():
    with pytest.raises(InputError, match="one line"):
        pose_covariance(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]), 1.0)


@pytest.mark.parametrize("lasting", [1, 10])
def test_residuals_that_last_count_once(lasting):
    residuals = np.repeat(np.random.default_rng(3).normal(size=(2000 // lasting, 3)), lasting, axis=0)
    assert effective_frames(residuals) == pytest.approx(2000 / lasting, rel=0.15)


def test_squares_forget_faster():
    random = np.random.default_rng(5)
    residuals = np.zeros((4000, 1))
    for frame in range(1, 4000):
        residuals[frame] = 0.9 * residuals[frame - 1] + random.normal()
    assert effective_frames(residuals) == pytest.approx(4000 * 0.1 / 1.9, rel=0.3)
    assert effective_frames_of_both(residuals)[1] == pytest.approx(4000 * 0.19 / 1.81, rel=0.3)
