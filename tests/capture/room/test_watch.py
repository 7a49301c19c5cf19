"""What is wrong with one camera of four is told from ordinary frames."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.room.points import balls_at
from skelgen.capture.room.recording import RoomRecording
from skelgen.capture.room.simulated import person_scene, room_rig
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.rig import CameraRig
from tests.benchmarks.unrendered import views_of_scene

N_FRAMES = 60
EMPTY = balls_at(np.empty((0, 2)), 0.05)


@pytest.fixture(scope="module")
def rig():
    return room_rig(4)


@pytest.fixture(scope="module")
def frames(rig):
    return views_of_scene(person_scene(rig, N_FRAMES, rate=50.0), rig)


def notices(rig, frames):
    recording = RoomRecording(rig)
    for number, views in enumerate(frames):
        recording.add(views, number / 50, [len(balls) == 0 for balls in views])
    return " ".join(recording.cloud("take", 50.0).notices)


def turned(balls):
    return balls_at([1279, 1023] - balls.centres, 0.05)


def test_nothing_is_told_of_cameras_as_they_were(rig, frames):
    assert "camera" not in notices(rig, frames)


@pytest.mark.parametrize(("n_cameras", "size"), [(6, (1280, 1024)), (4, (480, 360))])
def test_exchanged_cables_are_told_of_both(n_cameras, size):
    rig = room_rig(n_cameras, size)
    frames = views_of_scene(person_scene(rig, N_FRAMES, rate=50.0), rig)
    said = notices(rig, [[views[1], views[0], *views[2:]] for views in frames])
    assert "camera 1 sends the images of camera 2" in said
    assert "camera 2 sends the images of camera 1" in said


def test_images_upside_down_are_told(rig, frames):
    assert "the images of camera 3 are upside down" in notices(
        rig, [[*views[:2], turned(views[2]), views[3]] for views in frames]
    )


@pytest.mark.parametrize("by", [3, 12])
def test_late_images_are_told_with_their_frames(rig, frames, by):
    late = [[*views[:3], frames[max(number - by, 0)][3]] for number, views in enumerate(frames)]
    assert f"the images of camera 4 are {by} frames late" in notices(rig, late)


def test_a_camera_that_was_moved_is_told_by_how_much(rig, frames):
    moved = np.eye(4)
    moved[:3, :3] = matrix_from_vector(np.array([0.0, 0.04, 0.0]))  # 40 px
    one = replace(rig.cameras[0], camera_from_world=moved @ rig.cameras[0].camera_from_world)
    said = notices(CameraRig([one, *rig.cameras[1:]], rig.noise), frames)
    assert "camera 1 looks" in said
    assert "it was moved" in said


def test_lost_images_of_one_camera_do_not_stop_the_others(rig, frames):
    said = notices(rig, [[EMPTY, *views[1:]] if number % 2 else views for number, views in enumerate(frames)])
    assert "camera 1 lost 30 of 60 images (50.0 %); the others went on" in said
