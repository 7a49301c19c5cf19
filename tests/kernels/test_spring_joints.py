"""Limbs with joints like springs: normal equations against differences, solutions and covariances against matrices."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.spring_joints import (
    LimbPoses,
    SeenMarkers,
    SpringBody,
    Springs,
    add_joints,
    add_markers,
    fit_poses,
    move_limbs,
    predict_markers,
)
from skelgen._kernels.tree_equations import NormalEquations, Tree, invert, solve
from skelgen.geometry.rotations import cross_matrix, matrix_from_vector

N_LIMBS, N_BODIES = 3, 5
STEP = 1e-6  # rad and mm
BY_DIFFERENCES = 1e-6  # of central differences with this step
SPRINGS, ROBUST = Springs(np.ones((N_LIMBS, 6)), np.array([9.0, 25.0]), 4.0), 2.0


@pytest.fixture
def body() -> SpringBody:
    """Three limbs, of which the second hangs at the third and the third at the first, with five markers."""
    rng = np.random.default_rng(0)
    limbs, tree = np.array([0, 0, 1, 2, 2]), Tree(np.array([0]), np.array([[0, 2], [2, 1]]))
    return SpringBody(limbs, rng.normal(size=(5, 3)), np.arange(1.0, 6.0), tree, rng.normal(size=(2, 6)))


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


def equations() -> NormalEquations:
    return NormalEquations(*map(np.zeros, ((N_LIMBS, 6, 6), (2, 6, 6), (N_LIMBS, 6), (N_LIMBS, 6, 6))))


def whole_matrix(equations: NormalEquations, tree: Tree) -> np.ndarray:
    n_bodies = len(equations.bodies)
    out = np.zeros((n_bodies, 6, n_bodies, 6))
    out[np.arange(n_bodies), :, np.arange(n_bodies)] = equations.bodies
    for block, (parent, child) in zip(equations.joints, tree.joints, strict=True):
        out[child, :, parent], out[parent, :, child] = block, block.T
    return out.reshape(6 * n_bodies, -1)


@pytest.mark.parametrize("robust", [np.inf, ROBUST])
def test_equations_of_markers_are_those_of_their_derivatives(body, robust):
    poses, markers = random_poses(), np.array([4, 0, 2])
    points = places(poses, body.limbs, body.offsets)[markers] + np.random.default_rng(2).normal(size=(3, 3))
    normal = equations()
    add_markers(body, poses, SeenMarkers(points, markers, ROBUST), robust, normal)
    error = points - places(poses, body.limbs, body.offsets)[markers]
    weights = (1 + (error**2).sum(axis=1) / (body.variances[markers] * robust**2)) ** -2 / body.variances[markers]
    by_pose = derivative(lambda at: places(at, body.limbs, body.offsets)[markers].ravel(), poses)
    weighted = by_pose.T * np.repeat(weights, 3)
    np.testing.assert_allclose(whole_matrix(normal, body.tree), weighted @ by_pose, atol=BY_DIFFERENCES)
    np.testing.assert_allclose(normal.gradient.ravel(), weighted @ error.ravel(), atol=BY_DIFFERENCES)


def test_equations_of_joints_are_those_of_their_derivatives(body):
    poses = random_poses()
    normal = equations()
    add_joints(body, poses, SPRINGS, normal)

    def apart(at: LimbPoses) -> np.ndarray:
        parents, children = body.tree.joints.T
        return (places(at, children, body.places[:, 3:]) - places(at, parents, body.places[:, :3])).ravel()

    by_pose = derivative(apart, poses)
    turns = np.zeros((2, 3, N_LIMBS, 6))
    for joint, (parent, child) in enumerate(body.tree.joints):
        turns[joint, :, child, :3], turns[joint, :, parent, :3] = np.eye(3), -np.eye(3)
    turns = turns.reshape(6, -1)
    expected = SPRINGS.weight * by_pose.T @ by_pose + (turns.T * np.repeat(SPRINGS.stiffness, 3)) @ turns
    np.testing.assert_allclose(whole_matrix(normal, body.tree), expected, atol=10 * BY_DIFFERENCES)
    np.testing.assert_allclose(
        normal.gradient.ravel(), -SPRINGS.weight * by_pose.T @ apart(poses), atol=10 * BY_DIFFERENCES
    )


@pytest.mark.parametrize("joints", [[[0, 2], [2, 1], [0, 3]], [[4, 0], [1, 3]], []])
def test_trees_are_solved_as_whole_matrices_are(joints):
    rng, joints = np.random.default_rng(5), np.reshape(joints, (-1, 2)).astype(np.intp)
    tree = Tree(np.setdiff1d(np.arange(N_BODIES), joints[:, 1]), joints)
    blocks = 40 * np.tile(np.eye(6), (N_BODIES, 1, 1))  # more than all that bodies share
    shared, gradient = rng.normal(size=(len(joints), 6, 6)), rng.normal(size=(N_BODIES, 6))
    equations = NormalEquations(blocks, shared, gradient, np.empty(blocks.shape))
    matrix, right = whole_matrix(equations, tree), gradient.ravel().copy()
    inverse = np.linalg.inv(matrix).reshape(N_BODIES, 6, N_BODIES, 6)
    solve(tree, equations)
    np.testing.assert_allclose(gradient.ravel(), np.linalg.solve(matrix, right), atol=1e-14)
    found = np.empty(blocks.shape)
    invert(tree, equations, found)
    np.testing.assert_allclose(found, inverse[np.arange(N_BODIES), :, np.arange(N_BODIES)], atol=1e-14)


def test_a_body_is_brought_to_where_its_markers_are(body):
    true, rng = random_poses(), np.random.default_rng(6)
    free = SPRINGS._replace(prior=np.full((N_LIMBS, 6), 1e-9), stiffness=np.full(2, 1e-9), weight=1e-9)
    limbs = np.repeat(np.arange(N_LIMBS), 4)
    held = body._replace(limbs=limbs, offsets=rng.normal(size=(12, 3)), variances=np.ones(12))
    start = moved(true, 0.01 * rng.normal(size=6 * N_LIMBS))
    points = places(true, limbs, held.offsets)
    fit_poses(held, free, SeenMarkers(points, np.arange(12), 4.0), start, equations(), np.empty((N_LIMBS, 6, 6)))
    np.testing.assert_allclose(places(start, limbs, held.offsets), points, atol=1e-7)


def test_limbs_turn_about_the_axes_of_the_world_and_shift():
    poses, change = random_poses(), np.random.default_rng(3).normal(size=6 * N_LIMBS)
    change[:3] = 0.0  # one does not turn
    expected = moved(poses, change)
    move_limbs(poses, change.reshape(-1, 6))
    np.testing.assert_allclose(poses.rotations, expected.rotations, atol=1e-14)
    np.testing.assert_allclose(poses.origins, expected.origins, atol=1e-14)


def test_markers_are_predicted_with_the_covariance_of_their_limb_and_their_own(body):
    poses, root = random_poses(), np.random.default_rng(4).normal(size=(N_LIMBS, 6, 6))
    covariance = root @ root.swapaxes(1, 2)
    positions, spread = np.empty((5, 3)), np.empty((5, 3, 3))
    predict_markers(body, poses, np.triu(covariance), positions, spread)
    np.testing.assert_allclose(positions, places(poses, body.limbs, body.offsets), atol=1e-14)
    for marker, limb in enumerate(body.limbs):
        by_pose = np.hstack([-cross_matrix(poses.rotations[limb] @ body.offsets[marker]), np.eye(3)])
        expected = by_pose @ covariance[limb] @ by_pose.T + body.variances[marker] * np.eye(3)
        np.testing.assert_allclose(spread[marker], expected, atol=1e-12)
