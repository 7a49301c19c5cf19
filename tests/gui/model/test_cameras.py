"""Frustums of cameras in the 3-D view, and the axis that cameras which stand upright point up."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_gui.model.cameras import ShownCamera, cameras_of, up_axis
from skelgen_gui.model.viewpoint import DOWN

from skelgen.capture.reference_rig import reference_rig
from skelgen.errors import InputError
from skelgen.model.rig import StereoRig


def test_frustums_are_a_third_as_long_as_what_they_see_is_far():
    left, _ = cameras_of(reference_rig())
    near, far = (left.lines_to(np.array([[0.0, 0.0, distance], [np.nan] * 3])) for distance in (900.0, 1800.0))
    assert near[0, 1, 2] == pytest.approx(300.0)
    assert far[0, 1, 2] == pytest.approx(600.0)


@pytest.mark.parametrize("points", [None, np.zeros((0, 3)), np.full((2, 3), np.nan)])
def test_frustums_are_shown_without_anything_to_see(points):
    left, _ = cameras_of(reference_rig())
    assert np.isfinite(left.lines_to(points)).all()


def test_cameras_that_stand_upright_determine_the_axis_that_points_up():
    assert up_axis(()) is None
    rig = reference_rig()  # whose world is the left camera's, with y down in its image
    assert up_axis(cameras_of(rig)) == DOWN + 1
    standing = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # world with z up
    turned = (
        replace(camera, camera_from_world=camera.camera_from_world @ standing) for camera in (rig.left, rig.right)
    )
    assert up_axis(cameras_of(StereoRig(*turned))) == 2


def test_a_camera_without_size_is_refused():
    with pytest.raises(InputError, match="above 0"):
        ShownCamera(np.eye(4), (640.0, 0.0), (800.0, 800.0))
