"""Predicted scatter against what really scatters: points, bodies, angles."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.bodies import find_bodies
from skelgen.capture.error_propagation import (
    angle_covariance,
    point_covariances,
    pose_covariances,
)
from skelgen.capture.errors_by_distance import (
    ARM,
    calibration_covariances,
    errors_by_distance,
    typical_joints,
    typical_target,
)
from skelgen.capture.optics import match_and_triangulate, project, triangulate, view_centre
from skelgen.capture.reference_rig import reference_rig
from skelgen.capture.values import Balls
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.model.rig import BodyTarget, CaptureSettings, StereoRig

N_TRIALS = 400
SCATTER = 0.15
"""Relative: the deviation of a deviation of 400 normal numbers is 0.035; four of them, and rounding up."""


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(6)


def noisy_balls(centres: np.ndarray, noise: float, rng: np.random.Generator) -> Balls:
    n = len(centres)
    seen = centres + noise * rng.normal(size=centres.shape)
    return Balls(seen, np.full(n, 20.0), np.full(n, 10.0), np.full(n, noise), np.zeros(n, dtype=bool))


def pose_at(place, turn=(0.3, -0.5, 0.8)) -> np.ndarray:
    return transform_from(matrix_from_vector(np.array(turn)), np.asarray(place, dtype=float))


def middle(distance: float = 1000.0) -> np.ndarray:
    return view_centre(reference_rig(), distance)


def random_covariance(rng) -> np.ndarray:
    """Of a pose: some tenths of a degree and of a millimetre, correlated."""
    root = rng.normal(size=(6, 6)) * np.array([2e-3, 2e-3, 2e-3, 0.3, 0.3, 0.3])[:, np.newaxis]
    return root @ root.T


def test_points_have_the_covariance_that_the_triangulation_states():
    rig, point = reference_rig(), middle()[np.newaxis]
    stated = triangulate(rig, project(rig.left, point), project(rig.right, point)).covariance
    assert np.allclose(point_covariances(rig, point), stated, rtol=1e-6)


def test_found_bodies_scatter_as_predicted(rng):
    rig, target, pose = reference_rig(), typical_target("body"), pose_at(middle())
    points = target.points @ pose[:3, :3].T + pose[:3, 3]
    left, right = project(rig.left, points), project(rig.right, points)
    errors = []
    for _ in range(N_TRIALS):
        seen = match_and_triangulate(noisy_balls(left, rig.noise, rng), noisy_balls(right, rig.noise, rng), rig)
        (found,) = find_bodies(seen, [target])
        turn = vector_from_matrix(found.world_from_body[:3, :3] @ pose[:3, :3].T)
        errors.append(np.concatenate([turn, found.world_from_body[:3, 3] - pose[:3, 3]]))
    predicted = np.sqrt(np.diag(pose_covariances(rig, target, pose)))
    assert np.sqrt(np.square(errors).mean(axis=0)) == pytest.approx(predicted, rel=SCATTER)
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(predicted, rel=0.02)  # its own, at a noisy place


def test_calibration_of_a_target_adds_to_its_error():
    target = typical_target("body")
    worn = BodyTarget("body", target.points, np.full(target.points.shape, 0.3))
    exact, uncertain = (pose_covariances(reference_rig(), one, pose_at(middle())) for one in (target, worn))
    assert (np.linalg.eigvalsh(uncertain - exact) > 0).all()


def test_poses_of_two_balls_and_of_balls_on_a_line_are_unknown():
    two = BodyTarget("two", [[-2000.0, 0.0, 0.0], [0.0, 0.0, 0.0], [40.0, 0.0, 0.0], [0.0, 2000.0, 0.0]])
    assert np.isnan(pose_covariances(reference_rig(), two, pose_at(middle()))).all()  # two are out of the images
    line = BodyTarget("line", np.outer(np.arange(4.0) * 30.0, [1.0, 0.0, 0.0]))
    assert np.isnan(pose_covariances(reference_rig(), line, pose_at(middle()))).all()


@pytest.mark.parametrize("index", [0, 1])
def test_angles_scatter_with_the_poses_as_predicted(index, rng):
    joint = typical_joints()[index]
    parent = pose_at([10.0, 20.0, 1000.0])
    bend = transform_from(matrix_from_vector(np.array([0.0, 0.0, 0.7])), np.zeros(3))
    child = parent @ joint.parent_from_joint @ bend @ np.linalg.inv(joint.child_from_joint)
    covariances = random_covariance(rng), random_covariance(rng)
    turns = [
        matrix_from_vector((rng.normal(size=(20000, 6)) @ np.linalg.cholesky(one + 1e-12 * np.eye(6)).T)[:, :3])
        for one in covariances
    ]
    axes = [
        turn @ pose[:3, :3] @ at[:3, :3]
        for turn, pose, at in zip(
            turns, (parent, child), (joint.parent_from_joint, joint.child_from_joint), strict=True
        )
    ]
    rotation = np.swapaxes(axes[0], 1, 2) @ axes[1]
    errors = vector_from_matrix(rotation @ bend[:3, :3].T)
    if joint.kind == "hinge":
        errors = np.arctan2(rotation[:, 1, 0] - rotation[:, 0, 1], rotation[:, 0, 0] + rotation[:, 1, 1])[:, None] - 0.7
    predicted = angle_covariance(joint, (parent, child), covariances)
    assert np.allclose(np.cov(errors.T).reshape(predicted.shape), predicted, rtol=0.05, atol=2e-6)


@pytest.mark.parametrize("index", [0, 1])
def test_a_joint_that_holds_is_the_most_likely_fit_of_both_bodies(index, rng):
    """The same by another way: the inverse information of the parent's pose and of the joint's turn."""
    joint = typical_joints()[index]
    parent = pose_at([10.0, 20.0, 1000.0])
    child = parent @ joint.parent_from_joint @ np.linalg.inv(joint.child_from_joint)
    covariances = random_covariance(rng), random_covariance(rng)
    n_turns = 3 if joint.kind == "ball" else 1

    def poses_after(numbers):
        moved = transform_from(matrix_from_vector(numbers[:3]) @ parent[:3, :3], parent[:3, 3] + numbers[3:6])
        bend = np.concatenate([np.zeros(3 - n_turns), numbers[6:]])
        turned = transform_from(matrix_from_vector(bend), np.zeros(3))
        other = moved @ joint.parent_from_joint @ turned @ np.linalg.inv(joint.child_from_joint)
        steps = [vector_from_matrix(pose[:3, :3] @ at[:3, :3].T) for pose, at in ((moved, parent), (other, child))]
        return np.concatenate([steps[0], moved[:3, 3], steps[1], other[:3, 3]])

    step = 1e-6
    slope = np.stack([(poses_after(s) - poses_after(-s)) / (2 * step) for s in step * np.eye(6 + n_turns)], axis=1)
    information = slope[:6].T @ np.linalg.inv(covariances[0]) @ slope[:6]
    information += slope[6:].T @ np.linalg.inv(covariances[1]) @ slope[6:]
    expected = np.linalg.inv(information)[6:, 6:]
    found = angle_covariance(joint, (parent, child), covariances, is_joined=True)
    assert np.allclose(found, expected, rtol=1e-3, atol=1e-12)
    assert np.trace(found) < np.trace(angle_covariance(joint, (parent, child), covariances))


def test_the_seeds_rig_reaches_its_figures_at_one_metre():
    errors = errors_by_distance(CaptureSettings(reference_rig()), [1000.0])
    std = {curve.what: curve.std[0] for curve in errors.curves}
    assert std["position of typical target"][3] < 0.25  # mm
    assert std["orientation of typical target"][3] < 0.3  # degrees
    assert std["angle of typical ball joint"][3] < 0.4
    assert std["angle of typical hinge"][0] < 0.3


def test_errors_grow_with_distance_and_most_of_it_in_depth():
    ball = errors_by_distance(CaptureSettings(reference_rig())).curves[0]
    assert (np.diff(ball.std, axis=0) > 0).all()
    assert (ball.std[:, 2] > 2 * ball.std[:, :2].max(axis=1)).all()


def test_errors_are_proportional_to_the_noise():
    rig = reference_rig()
    louder = StereoRig(rig.left, rig.right, 2 * rig.noise)
    once, twice = (errors_by_distance(CaptureSettings(one), [1000.0]) for one in (rig, louder))
    for one, two in zip(once.curves, twice.curves, strict=True):
        assert np.allclose(2 * one.std, two.std)


def test_bodies_and_joints_of_the_settings_are_evaluated():
    from skelgen.model.rig import TargetJoint

    arm, forearm = typical_target("arm"), typical_target("forearm")
    joint = TargetJoint("elbow", "hinge", "arm", "forearm", pose_at([0, 0, ARM]), pose_at([0, 0, -ARM]))
    errors = errors_by_distance(CaptureSettings(reference_rig(), [arm, forearm], [joint]), [1000.0])
    assert [curve.what for curve in errors.curves] == [
        "ball",
        "position of arm",
        "orientation of arm",
        "position of forearm",
        "orientation of forearm",
        "angle of elbow",
    ]
    assert np.isfinite(errors.curves[-1].std).all()


def test_what_the_cameras_do_not_see_has_no_error():
    errors = errors_by_distance(CaptureSettings(reference_rig()), [100.0])
    assert all(np.isnan(curve.std).all() for curve in errors.curves)


@pytest.mark.parametrize("distances", [[0.0], [-1.0], [], [np.nan]])
def test_distances_that_are_none_are_refused(distances):
    with pytest.raises(InputError, match="above 0"):
        errors_by_distance(CaptureSettings(reference_rig()), distances)


def test_errors_of_the_calibration_move_points_as_stated():
    """Cameras that err by their covariance see one point elsewhere, by the covariance that is stated."""
    rng, rig = np.random.default_rng(3), reference_rig()
    std = np.zeros(30)
    std[[0, 1, 15, 16]], std[[2, 3, 17, 18]], std[[4, 19]] = 0.4, 0.8, 0.003
    std[24:27], std[27:] = 0.0005, 0.3
    known = replace(rig, covariance=np.diag(std**2))
    point = view_centre(rig, 1000.0)[np.newaxis] + [[80.0, -40.0, 30.0]]
    seen, found = [project(eye, point) for eye in (rig.left, rig.right)], []
    for _ in range(400):
        error = std * rng.normal(size=30)
        eyes = []
        for eye, own in zip((rig.left, rig.right), error.reshape(2, 15), strict=True):
            matrix, pose = eye.matrix.copy(), eye.camera_from_world.copy()
            matrix[[0, 1, 0, 1], [0, 1, 2, 2]] += own[:4]
            pose[:3, :3] = matrix_from_vector(own[9:12]) @ pose[:3, :3]
            pose[:3, 3] += own[12:]
            eyes.append(replace(eye, matrix=matrix, distortion=eye.distortion + own[4:9], camera_from_world=pose))
        found.append(triangulate(StereoRig(*eyes), *seen).points[0])
    stated = calibration_covariances(known, point)[0]
    np.testing.assert_allclose(np.std(found, axis=0), np.sqrt(np.diag(stated)), rtol=0.15)
    curves = errors_by_distance(CaptureSettings(known), [1000.0]).curves
    assert [curve.what for curve in curves][:2] == ["ball", "place, by the cameras' calibration"]
