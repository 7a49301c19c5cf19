"""Limbs with joints like springs: normal equations against differences, steps and covariances against matrices."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.spring_joints import (
    LimbPoses,
    SeenMarkers,
    SpringBody,
    add_joints,
    add_markers,
    move_limbs,
    predict_markers,
)
from skelgen.geometry.rotations import cross_matrix, matrix_from_vector

N_LIMBS = 3
STEP = 1e-6  # rad and mm
BY_DIFFERENCES = 1e-6  # of central differences with this step
WEIGHT, STIFFNESS, ROBUST = 4.0, np.array([9.0, 25.0]), 2.0


@pytest.fixture
def body() -> SpringBody:
    """Three limbs, of which the second hangs at the third and the third at the first, with five markers."""
    rng = np.random.default_rng(0)
    limbs, joints = np.array([0, 0, 1, 2, 2]), np.array([[2, 1], [0, 2]])
    return SpringBody(limbs, rng.normal(size=(5, 3)), np.arange(1.0, 6.0), joints, rng.normal(size=(2, 6)))


def random_poses(seed: int = 1) -> LimbPoses:
    rng = np.random.default_rng(seed)
    return LimbPoses(matrix_from_vector(rng.normal(size=(N_LIMBS, 3))), rng.normal(size=(N_LIMBS, 3)))


def moved(poses: LimbPoses, change: np.ndarray) -> LimbPoses:
    return LimbPoses(
        matrix_from_vector(change.reshape(-1, 6)[:, :3]) @ poses.rotations, poses.origins + change.reshape(-1, 6)[:, 3:]
    )


def places(poses: LimbPoses, limbs: np.ndarray, offsets: np.ndarray) -> np.ndarray:
    return np.einsum("nij,nj->ni", poses.rotations[limbs], offsets) + poses.origins[limbs]


def derivative(function, poses: LimbPoses) -> np.ndarray:
    """Of a vector, by the rotations and shifts of limbs."""
    steps = STEP * np.eye(6 * N_LIMBS)
    return np.array([(function(moved(poses, step)) - function(moved(poses, -step))) / (2 * STEP) for step in steps]).T


def equations() -> tuple[np.ndarray, np.ndarray]:
    return np.zeros((6 * N_LIMBS, 6 * N_LIMBS)), np.zeros(6 * N_LIMBS)


def whole(normal: np.ndarray) -> np.ndarray:
    return np.triu(normal) + np.triu(normal, 1).T


@pytest.mark.parametrize("robust", [np.inf, ROBUST])
def test_equations_of_markers_are_those_of_their_derivatives(body, robust):
    poses, markers = random_poses(), np.array([4, 0, 2])
    points = places(poses, body.limbs, body.offsets)[markers] + np.random.default_rng(2).normal(size=(3, 3))
    normal, gradient = equations()
    add_markers(body, poses, SeenMarkers(points, markers, robust), normal, gradient)
    error = points - places(poses, body.limbs, body.offsets)[markers]
    weights = (1 + (error**2).sum(axis=1) / (body.variances[markers] * robust**2)) ** -2 / body.variances[markers]
    by_pose = derivative(lambda at: places(at, body.limbs, body.offsets)[markers].ravel(), poses)
    weighted = by_pose.T * np.repeat(weights, 3)
    np.testing.assert_allclose(whole(normal), weighted @ by_pose, atol=BY_DIFFERENCES)
    np.testing.assert_allclose(gradient, weighted @ error.ravel(), atol=BY_DIFFERENCES)


def test_equations_of_joints_are_those_of_their_derivatives(body):
    poses = random_poses()
    normal, gradient = equations()
    add_joints(body, poses, STIFFNESS, WEIGHT, normal, gradient)

    def apart(at: LimbPoses) -> np.ndarray:
        parents, children = body.joints.T
        return (places(at, children, body.places[:, 3:]) - places(at, parents, body.places[:, :3])).ravel()

    by_pose = derivative(apart, poses)
    turns = np.zeros((2, 3, N_LIMBS, 6))
    for joint, (parent, child) in enumerate(body.joints):
        turns[joint, :, child, :3], turns[joint, :, parent, :3] = np.eye(3), -np.eye(3)
    turns = turns.reshape(6, -1)
    expected = WEIGHT * by_pose.T @ by_pose + (turns.T * np.repeat(STIFFNESS, 3)) @ turns
    np.testing.assert_allclose(whole(normal), expected, atol=10 * BY_DIFFERENCES)
    np.testing.assert_allclose(gradient, -WEIGHT * by_pose.T @ apart(poses), atol=10 * BY_DIFFERENCES)


def test_limbs_turn_about_the_axes_of_the_world_and_shift():
    poses, change = random_poses(), np.random.default_rng(3).normal(size=6 * N_LIMBS)
    change[:3] = 0.0  # one does not turn
    expected = moved(poses, change)
    move_limbs(poses, change)
    np.testing.assert_allclose(poses.rotations, expected.rotations, atol=1e-14)
    np.testing.assert_allclose(poses.origins, expected.origins, atol=1e-14)


def test_markers_are_predicted_with_the_covariance_of_their_limb_and_their_own(body):
    poses, root = random_poses(), np.random.default_rng(4).normal(size=(6 * N_LIMBS, 6 * N_LIMBS))
    covariance = root @ root.T
    positions, spread = np.empty((5, 3)), np.empty((5, 3, 3))
    predict_markers(body, poses, np.triu(covariance), positions, spread)
    np.testing.assert_allclose(positions, places(poses, body.limbs, body.offsets), atol=1e-14)
    for marker, limb in enumerate(body.limbs):
        own = covariance[6 * limb : 6 * limb + 6, 6 * limb : 6 * limb + 6]
        by_pose = np.hstack([-cross_matrix(poses.rotations[limb] @ body.offsets[marker]), np.eye(3)])
        expected = by_pose @ own @ by_pose.T + body.variances[marker] * np.eye(3)
        np.testing.assert_allclose(spread[marker], expected, atol=1e-12)
