from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.calibration.joints import calibrate_joints
from skelgen.capture.target_joints import find_angles
from skelgen.capture.values import FoundBody, JointRequest
from skelgen.errors import InputError
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import TargetJoint

SHOULDER = np.array([20.0, -150.0, 30.0]), np.array([-10.0, 140.0, 15.0])
ELBOW_AXIS = np.array([0.2, 0.1, 1.0]) / np.linalg.norm([0.2, 0.1, 1.0])
COVARIANCE = np.diag([0.002, 0.002, 0.001, 0.1, 0.1, 0.3]) ** 2
NAMES = ("torso", "upper", "lower")


def hinge_frame(place, axis):
    x = np.cross([0.0, 1.0, 0.0], axis)
    x /= np.linalg.norm(x)
    return transform_from(np.stack([x, np.cross(axis, x), axis], axis=1), place)


TRUE_JOINTS = {
    "shoulder": (transform_from(np.eye(3), SHOULDER[0]), transform_from(np.eye(3), SHOULDER[1])),
    "elbow": (
        hinge_frame(np.array([5.0, -160.0, 0.0]), ELBOW_AXIS),
        hinge_frame(np.array([0.0, 120.0, 8.0]), np.array([0.0, 0.0, 1.0])),
    ),
}


def moving_arm(seed, n_frames=120, swing=1.0, covariance=COVARIANCE, hidden=0.0):
    """Torso, upper and lower arm, joined by a ball and a hinge that turn by 60 degrees, seen with known errors."""
    rng = np.random.default_rng(seed)
    frames = []
    for _ in range(n_frames):
        torso = transform_from(matrix_from_vector(rng.uniform(-0.3, 0.3, 3)), np.array([0, 0, 1000.0]))
        ball = transform_from(matrix_from_vector(rng.uniform(-swing, swing, 3)), np.zeros(3))
        hinge = transform_from(matrix_from_vector(np.array([0, 0, rng.uniform(-swing, swing)])), np.zeros(3))
        upper = torso @ TRUE_JOINTS["shoulder"][0] @ ball @ np.linalg.inv(TRUE_JOINTS["shoulder"][1])
        lower = upper @ TRUE_JOINTS["elbow"][0] @ hinge @ np.linalg.inv(TRUE_JOINTS["elbow"][1])
        bodies = []
        for name, pose in zip(NAMES, (torso, upper, lower), strict=True):
            error = rng.multivariate_normal(np.zeros(6), covariance)
            seen = transform_from(matrix_from_vector(error[:3]) @ pose[:3, :3], pose[:3, 3] + error[3:])
            if rng.uniform() >= hidden:
                bodies.append(FoundBody(name, seen, covariance, np.arange(5), 0.3))
        frames.append(bodies)
    return frames


WISHES = (JointRequest("shoulder", "torso", "upper", "ball"), JointRequest("elbow", "upper", "lower", "hinge"))


def place_errors(joint: TargetJoint):
    """Errors of the places in parent and child, across the axis of a hinge, shape (2, 3)."""
    parent, child = TRUE_JOINTS[joint.name]
    errors = np.stack([joint.parent_from_joint[:3, 3] - parent[:3, 3], joint.child_from_joint[:3, 3] - child[:3, 3]])
    if joint.kind == "hinge":
        for side, axis in enumerate((parent[:3, 2], child[:3, 2])):
            errors[side] -= axis * (errors[side] @ axis)
    return errors


def test_ball_and_hinge_are_found_where_they_are():
    done = calibrate_joints(moving_arm(0, hidden=0.05), NAMES, WISHES)
    for joint in done.joints:
        assert np.abs(place_errors(joint)).max() < 0.5  # five deviations of 0.1 mm
    elbow = done.joints[1]
    assert np.abs(elbow.parent_from_joint[:3, 2] - ELBOW_AXIS).max() < 0.003
    assert elbow.axis_std.max() < 0.001
    np.testing.assert_array_equal(
        done.joints[0].parent_from_joint[:3, :3], np.eye(3)
    )  # pure shifts, as in Gaschler (2011)
    assert done.noise == pytest.approx(1.0, abs=0.1)


def test_angles_are_zero_in_the_first_frame_that_shows_both_targets():
    frames = moving_arm(3)
    frames[0] = frames[0][:2]  # without the lower arm
    done = calibrate_joints(frames, NAMES, WISHES)
    for joint, first in zip(done.joints, frames, strict=False):
        angles = find_angles(joint, {body.name: body for body in first}).angles
        np.testing.assert_allclose(angles, 0.0, atol=1e-9)
    np.testing.assert_array_equal(done.joints[0].parent_from_joint[:3, :3], np.eye(3))


def test_stated_deviations_are_those_of_the_errors():
    ratios = []
    for seed in range(12):
        for joint in calibrate_joints(moving_arm(seed, 60), NAMES, WISHES).joints:
            ratios.append((place_errors(joint) ** 2).sum() / (joint.std**2).sum())
    # along the axis a hinge's place in the child is told beside the parent's, which is fixed: it errs less than stated
    assert np.mean(ratios) == pytest.approx(1.0, abs=0.45)


def test_chain_is_no_worse_than_its_joints_alone():
    together, alone = [], []
    for seed in range(8):
        done = calibrate_joints(moving_arm(seed, 60), NAMES, WISHES)
        together += [(place_errors(joint) ** 2).sum() for joint in done.joints]
        for joint, fit in zip(done.joints, done.fits, strict=True):
            single = TargetJoint(
                joint.name, joint.kind, joint.parent, joint.child, fit.parent_from_joint, fit.child_from_joint
            )
            alone.append((place_errors(single) ** 2).sum())
    assert np.mean(together) <= np.mean(alone) * 1.02


def test_joints_and_kinds_are_found_if_nobody_names_them():
    done = calibrate_joints(moving_arm(1), NAMES)
    assert {(frozenset((joint.parent, joint.child)), joint.kind) for joint in done.joints} == {
        (frozenset(("torso", "upper")), "ball"),
        (frozenset(("upper", "lower")), "hinge"),
    }


def test_kind_is_found_where_it_is_left_open():
    done = calibrate_joints(moving_arm(2), NAMES, [JointRequest("elbow", "upper", "lower")])
    assert done.joints[0].kind == "hinge"


def test_joint_that_does_not_move_is_refused_with_the_reason():
    with pytest.raises(InputError, match=r"joint 'elbow' is .*; move it further, or state its type"):
        calibrate_joints(moving_arm(0, swing=0.001), NAMES, [JointRequest("elbow", "upper", "lower")])


def test_unknown_body_is_named():
    with pytest.raises(InputError, match="there is no body 'uper'; bodies are torso, upper, lower"):
        calibrate_joints(moving_arm(0, 5), NAMES, [JointRequest("elbow", "uper", "lower", "hinge")])


def test_unknown_kind_is_refused():
    with pytest.raises(InputError, match="types are ball, hinge"):
        JointRequest("elbow", "upper", "lower", "saddle")


def test_bodies_that_are_never_seen_together_are_refused():
    frames = [[body for body in frame if body.name != "lower"] for frame in moving_arm(0, 10)]
    with pytest.raises(InputError, match="'upper' and 'lower' are seen together in 0 frames"):
        calibrate_joints(frames, NAMES, WISHES)


def test_few_complete_frames_are_told():
    frames = moving_arm(0, 30)
    frames = [[body for body in frame if body.name != NAMES[number % 3]] for number, frame in enumerate(frames)]
    done = calibrate_joints(frames, NAMES, WISHES)
    assert "fitted one by one" in done.notices[0]
    assert np.isnan(done.noise)


def test_verdict_says_what_joints_are_worth():
    good = calibrate_joints(moving_arm(0), NAMES, WISHES)
    assert good.verdict.grade == "good"
    assert "elbow is a hinge, turned by 11" in good.verdict.sentences[0]
    small = calibrate_joints(moving_arm(0, swing=0.1), NAMES, WISHES)
    assert small.verdict.grade != "good"
    assert "Lower turned by 11 degrees in upper; move the joint further." in small.verdict.sentences


def test_play_is_told():
    frames = moving_arm(0, covariance=COVARIANCE)
    sure = [[FoundBody(b.name, b.world_from_body, b.covariance / 16, b.points, b.rms) for b in f] for f in frames]
    done = calibrate_joints(sure, NAMES, WISHES)
    assert any("it has play, or a target bends" in notice for notice in done.notices)


def test_without_joints_the_verdict_says_so():
    still = [[body for body in frame if body.name == "torso"] for frame in moving_arm(0, 30)]
    verdict = calibrate_joints(still, NAMES[:1]).verdict
    assert (verdict.grade, verdict.sentences[0]) == ("repeat", "Repeat: no joint was found.")


def test_frames_are_chosen_by_number_or_by_index():
    frames = moving_arm(0)
    spaced = calibrate_joints(frames, NAMES, WISHES[:1], use_frames=40)
    assert len(spaced.fits[0].frames) == 40
    chosen = calibrate_joints(frames, NAMES, WISHES[:1], use_frames=range(30, 60))
    only = calibrate_joints(frames[30:60], NAMES, WISHES[:1])
    np.testing.assert_array_equal(chosen.joints[0].parent_from_joint, only.joints[0].parent_from_joint)
    with pytest.raises(InputError, match="there is no frame 120: 120 were captured, the first is 0"):
        calibrate_joints(frames, NAMES, WISHES[:1], use_frames=[0, 120])


def test_start_values_say_where_on_an_axis_a_ball_joint_is():
    """The closed form takes the place on the axis that is nearest to both bodies; the motion does not tell."""
    axis = np.array([0.0, 0.0, 1.0])
    frames = []
    for bend in np.linspace(-1.0, 1.0, 40):
        torso = transform_from(np.eye(3), np.array([0, 0, 1000.0]))
        ball = transform_from(matrix_from_vector(bend * axis), np.zeros(3))
        upper = torso @ TRUE_JOINTS["shoulder"][0] @ ball @ np.linalg.inv(TRUE_JOINTS["shoulder"][1])
        frames.append([FoundBody(n, p, COVARIANCE, np.arange(5), 0.3) for n, p in (("torso", torso), ("upper", upper))])
    near = tuple(tuple((place + np.array([0.5, -0.5, 0.0])).tolist()) for place in SHOULDER)
    for start, is_known in ((None, False), (near, True)):
        (joint,) = calibrate_joints(frames, NAMES[:2], [replace(WISHES[0], start=start)]).joints
        errors = joint.parent_from_joint[:3, 3] - SHOULDER[0], joint.child_from_joint[:3, 3] - SHOULDER[1]
        assert max(np.abs(error[:2]).max() for error in errors) < 0.01
        along = max(abs(error @ axis) for error in errors)
        assert along < 0.01 if is_known else along > 5.0
