from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.error_propagation import angle_covariance
from skelgen.capture.target_joints import angle_names, find_angles
from skelgen.capture.values import FoundBody
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model.rig import TargetJoint

COVARIANCE = np.diag([0.003, 0.002, 0.001, 0.1, 0.1, 0.3]) ** 2


def transform(seed):
    rng = np.random.default_rng(seed)
    return transform_from(matrix_from_vector(rng.normal(size=3)), rng.normal(size=3) * 100)


def joint_of(kind):
    frames = transform(1), transform(2)
    if kind == "ball":
        frames = tuple(transform_from(np.eye(3), frame[:3, 3]) for frame in frames)
    return TargetJoint("joint", kind, "parent", "child", *frames)


def bodies_at(joint, vector, error=None):
    """Both bodies, the joint turned by a rotation vector; optionally with errors (turn, shift) of both."""
    parent = transform(3)
    turn = transform_from(matrix_from_vector(np.asarray(vector, float)), np.zeros(3))
    child = parent @ joint.parent_from_joint @ turn @ np.linalg.inv(joint.child_from_joint)
    errors = np.zeros((2, 6)) if error is None else error
    poses = [
        transform_from(matrix_from_vector(one[:3]) @ pose[:3, :3], pose[:3, 3] + one[3:])
        for pose, one in zip((parent, child), errors, strict=True)
    ]
    names = ("parent", "child")
    return {name: FoundBody(name, pose, COVARIANCE, np.arange(5), 0.0) for name, pose in zip(names, poses, strict=True)}


@pytest.mark.parametrize("vector", [(0.3, -0.8, 1.2), (0, 0, 0), (2.9, 0.1, -0.5)])
def test_ball_has_the_rotation_vector_of_the_child_against_the_parent(vector):
    joint = joint_of("ball")
    found = find_angles(joint, bodies_at(joint, vector))
    np.testing.assert_allclose(found.angles, vector, atol=1e-9)
    assert found.residual == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("angle", [-3.0, -0.4, 0.0, 1.5, 3.1])
def test_hinge_has_the_angle_about_z(angle):
    joint = joint_of("hinge")
    found = find_angles(joint, bodies_at(joint, [0, 0, angle]))
    np.testing.assert_allclose(found.angles, [angle], atol=1e-9)
    assert found.residual == pytest.approx(0.0, abs=1e-9)


def test_a_hinge_that_is_torn_far_apart_has_the_least_squares_angle():
    joint = joint_of("hinge")
    bodies = bodies_at(joint, [0.1, -0.05, 0.7])  # tilted by far more than the poses err: the joint has play
    found = find_angles(joint, bodies)
    wanted = matrix_from_vector(np.array([0.1, -0.05, 0.7]))
    trials = np.linspace(-0.1, 0.1, 2001) + found.angles[0]
    turned = matrix_from_vector(trials[:, np.newaxis] * [0.0, 0.0, 1.0])
    squares = ((turned - wanted)[:, :2, :2] ** 2).sum(axis=(1, 2))
    assert abs(trials[squares.argmin()] - found.angles[0]) < 2e-4
    assert found.residual > 1.0  # the tilt, 100 mm away


def errors_of(joint, vector, count, seed=0):
    """Errors of a joint's angles, shape (count, n_angles), and what is stated of each."""
    rng = np.random.default_rng(seed)
    errors = rng.multivariate_normal(np.zeros(6), COVARIANCE, (count, 2))
    found = [find_angles(joint, bodies_at(joint, vector, error)) for error in errors]
    true = vector if joint.kind == "ball" else vector[2:]
    return np.array([one.angles for one in found]) - true, np.array([one.std for one in found])


@pytest.mark.parametrize(("kind", "vector"), [("ball", (0.4, -0.9, 0.3)), ("hinge", (0.0, 0.0, 0.8))])
def test_angles_err_by_the_propagated_bound_of_bodies_that_the_joint_holds(kind, vector):
    joint = joint_of(kind)
    poses = tuple(body.world_from_body for body in bodies_at(joint, vector).values())
    alone, held = (
        np.trace(angle_covariance(joint, poses, (COVARIANCE, COVARIANCE), is_joined=is_joined))
        for is_joined in (False, True)
    )
    off, _ = errors_of(joint, vector, 2000)
    if kind == "ball":  # the bound is of small turns, not of the vector
        turned = matrix_from_vector(off + vector) @ matrix_from_vector(np.array(vector)).T
        off = vector_from_matrix(turned)
    rms = np.sqrt((off**2).sum(axis=1).mean())
    assert rms == pytest.approx(np.sqrt(held), rel=0.05)
    assert rms < 0.95 * np.sqrt(alone)


@pytest.mark.parametrize(("kind", "vector"), [("ball", (0.4, -0.9, 0.3)), ("hinge", (0.0, 0.0, 0.8))])
def test_stated_deviations_cover_the_truth(kind, vector):
    off, std = errors_of(joint_of(kind), vector, 2000, seed=1)
    assert 0.935 < (np.abs(off) < 1.96 * std).mean() < 0.965  # three deviations of a share among 2000


def test_the_more_a_joint_is_torn_apart_the_less_it_is_believed():
    joint = joint_of("ball")
    apart = np.zeros((2, 6))
    stated = []
    for gap in (0.0, 1.0, 5.0, 100.0):
        apart[1, 3] = gap
        stated.append(find_angles(joint, bodies_at(joint, [0.1, 0.2, 0.3], apart)).std)
    assert (np.diff(stated, axis=0) > -1e-5).all()  # rad: the angles move a little as well
    alone = angle_covariance(
        joint, tuple(one.world_from_body for one in bodies_at(joint, [0, 0, 0]).values()), (COVARIANCE,) * 2
    )
    assert np.square(stated[-1]).sum() == pytest.approx(np.trace(alone), rel=0.05)  # the vector's, not the turn's
    assert find_angles(joint, bodies_at(joint, [0.1, 0.2, 0.3], apart)).angles == pytest.approx(
        [0.1, 0.2, 0.3], abs=5e-3
    )


def test_an_uncertain_joint_is_believed_less():
    sure = joint_of("ball")
    bodies = bodies_at(sure, [0.1, 0.2, 0.3])
    unsure = replace(sure, std=np.full((2, 3), 10.0))
    assert (find_angles(unsure, bodies).std > find_angles(sure, bodies).std).all()


def test_residual_of_a_ball_is_the_gap_of_its_centre():
    joint = joint_of("ball")
    error = np.zeros((2, 6))
    error[1, 3:] = [1.0, 2.0, 2.0]
    assert find_angles(joint, bodies_at(joint, [0.1, 0.2, 0.3], error)).residual == pytest.approx(3.0)


def test_missing_body_gives_no_angle():
    joint = joint_of("ball")
    bodies = bodies_at(joint, [0, 0, 0])
    assert find_angles(joint, {"parent": bodies["parent"]}) is None
    assert find_angles(joint, {}) is None


def test_names_of_angles():
    assert angle_names(joint_of("hinge")) == ("joint",)
    assert angle_names(joint_of("ball")) == ("joint.x", "joint.y", "joint.z")


def test_turned_world_changes_no_angle():
    joint, world = joint_of("ball"), transform(9)
    bodies = bodies_at(joint, [0.3, 0.2, -0.4])
    moved = {
        name: FoundBody(name, world @ body.world_from_body, body.covariance, body.points, 0.0)
        for name, body in bodies.items()
    }
    one, other = find_angles(joint, bodies), find_angles(joint, moved)
    np.testing.assert_allclose(one.angles, other.angles, atol=1e-12)
    assert np.abs(vector_from_matrix(world[:3, :3])).max() > 0.1
