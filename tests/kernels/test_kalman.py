"""The filter of a body against the textbook's matrices and exact motion."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.kalman import GROWTH, BodyState, correct, predict
from skelgen._kernels.rotations import move_pose, write_pose_error
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix

STEP = 0.02


def random_state(seed=0):
    rng = np.random.default_rng(seed)
    pose = transform_from(matrix_from_vector(rng.normal(size=3)), rng.normal(size=3))
    root = rng.normal(size=(18, 18))
    return BodyState(pose, rng.normal(size=12), root @ root.T), rng


def test_prediction_is_that_of_the_transition_matrix():
    state, rng = random_state()
    power = rng.uniform(1.0, 9.0, 6)
    ahead = predict(state, power, STEP)
    transition = np.kron([[1.0, STEP, STEP**2 / 2], [0.0, 1.0, STEP], [0.0, 0.0, 1.0]], np.eye(6))
    powers = STEP ** (5.0 - np.add.outer(np.arange(3), np.arange(3)))
    expected = transition @ state.covariance @ transition.T + np.kron(GROWTH * powers, np.diag(power))
    np.testing.assert_allclose(ahead.covariance, expected, rtol=1e-12, atol=1e-12)
    moved = (transition @ np.concatenate([np.zeros(6), state.rates]))[:6]
    np.testing.assert_allclose(ahead.pose[:3, :3], matrix_from_vector(moved[:3]) @ state.pose[:3, :3], atol=1e-14)
    np.testing.assert_allclose(ahead.pose[:3, 3], state.pose[:3, 3] + moved[3:], atol=1e-14)
    np.testing.assert_allclose(ahead.rates, (transition[6:] @ np.concatenate([np.zeros(6), state.rates])), atol=1e-14)


@pytest.mark.parametrize("angle", [0.0, 0.01, 2.0, 3.1])
def test_correction_is_that_of_the_kalman_gain(angle):
    state, rng = random_state()
    spread = np.diag(rng.uniform(0.1, 1.0, 6))
    found = transform_from(matrix_from_vector(np.array([angle, 0.0, 0.0])) @ state.pose[:3, :3], rng.normal(size=3))
    after, innovation = correct(state, found, spread)
    turn = vector_from_matrix(found[:3, :3] @ state.pose[:3, :3].T)
    error = np.concatenate([turn, found[:3, 3] - state.pose[:3, 3]])
    total = state.covariance[:6, :6] + spread
    gain = state.covariance[:, :6] @ np.linalg.inv(total)
    step = gain @ error
    np.testing.assert_allclose(after.covariance, state.covariance - gain @ state.covariance[:6], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(after.rates, state.rates + step[6:], rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(after.pose[:3, :3], matrix_from_vector(step[:3]) @ state.pose[:3, :3], atol=1e-8)
    assert innovation.deviation == pytest.approx(error @ np.linalg.solve(total, error), rel=1e-6)
    parts = [error[at] @ np.linalg.solve(total[at, at], error[at]) / 3 for at in (slice(3), slice(3, 6))]
    assert (innovation.rotation, innovation.shift) == pytest.approx(parts, rel=1e-6)


def test_a_pose_turned_by_half_a_circle_is_far_off():
    half = transform_from(np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    _, innovation = correct(BodyState(np.eye(4), np.zeros(12), np.eye(18)), half, np.eye(6))
    assert innovation.deviation == pytest.approx(np.pi**2 / 2)  # both err by 1 rad


@pytest.mark.parametrize("angle", [0.0, 1e-9, 0.1, 2.0, 3.1])
def test_a_pose_that_is_moved_by_the_error_is_the_one_that_was_found(angle):
    pose, error = random_state()[0].pose, np.empty(6)
    turn = matrix_from_vector(np.array([0.6 * angle, 0.0, 0.8 * angle]))
    found = transform_from(turn @ pose[:3, :3], np.array([1.0, 2.0, 3.0]))
    write_pose_error(pose, found, error)
    assert np.linalg.norm(error[:3]) == pytest.approx(angle, abs=1e-12)
    move_pose(pose, error)
    np.testing.assert_allclose(pose, found, atol=1e-12)
