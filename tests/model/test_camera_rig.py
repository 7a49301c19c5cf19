"""Cameras of a room: what makes no rig is refused in words."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.room.simulated import room_rig
from skelgen.errors import InputError
from skelgen.model.rig import CameraRig


def test_places_are_where_cameras_stand():
    rig = room_rig(4)
    for camera, place in zip(rig.cameras, rig.places, strict=True):
        np.testing.assert_allclose(camera.camera_from_world @ [*place, 1.0], [0, 0, 0, 1.0], atol=1e-9)


def test_one_camera_is_no_rig_and_seventeen_are_too_many():
    one = room_rig(2).cameras[0]
    with pytest.raises(InputError, match="the rig has 1 cameras; it needs 2 to 16"):
        CameraRig([one])


def test_names_and_places_differ():
    one, two = room_rig(2).cameras
    with pytest.raises(InputError, match="camera"):
        CameraRig([one, replace(two, name=one.name)])
    with pytest.raises(InputError, match="'camera 1' and 'again' stand at one place"):
        CameraRig([one, two, replace(one, name="again")])
