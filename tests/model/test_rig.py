"""Cameras, targets and joints refuse what cannot be."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model.rig import BodyTarget, Camera, CaptureSettings, StereoRig, TargetJoint

MATRIX = np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]])


def camera(x=0.0):
    pose = np.eye(4)
    pose[0, 3] = -x
    return Camera(640, 480, MATRIX, camera_from_world=pose)


def test_baseline_is_the_distance_between_the_cameras():
    assert StereoRig(camera(), camera(450.0)).baseline == pytest.approx(450.0)


def test_cameras_at_one_place_are_refused():
    with pytest.raises(InputError, match="no depth"):
        StereoRig(camera(), camera())


@pytest.mark.parametrize("matrix", [np.zeros((3, 3)), MATRIX.T, -MATRIX])
def test_a_matrix_that_is_none_is_refused(matrix):
    with pytest.raises(InputError, match="focal lengths"):
        Camera(640, 480, matrix)


def test_a_mirrored_pose_is_refused():
    with pytest.raises(InputError, match="not a rotation"):
        Camera(640, 480, MATRIX, camera_from_world=np.diag([1.0, 1, -1, 1]))


def test_a_camera_out_of_this_world_is_refused():
    pose = np.eye(4)
    pose[1, 3] = 1e300
    with pytest.raises(InputError, match=r"1e\+300 mm, more than a thousand kilometres"):
        Camera(640, 480, MATRIX, camera_from_world=pose)


def test_a_joint_of_a_body_that_is_not_there_is_refused():
    rig = StereoRig(camera(), camera(450.0))
    joint = TargetJoint("elbow", "hinge", "upper", "lower", np.eye(4), np.eye(4))
    with pytest.raises(InputError, match="'lower', which is not there"):
        CaptureSettings(rig, bodies=[BodyTarget("upper", np.eye(3))], joints=[joint])


def test_two_bodies_of_one_name_are_refused():
    rig = StereoRig(camera(), camera(450.0))
    with pytest.raises(InputError, match="two targets are called"):
        CaptureSettings(rig, bodies=[BodyTarget("arm", np.eye(3)), BodyTarget("arm", np.eye(3))])
