"""While a wand is waved, what images and the room have seen of it is told."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from skelgen.capture.room.points import balls_at
from skelgen.capture.room.simulated import WAND, room_rig, wand_scene
from skelgen.capture.room.taking import WandTaking
from skelgen.errors import InputError
from tests.benchmarks.unrendered import views_of_scene

N_FRAMES = 300
NAMES = ("a", "b", "c")
SIZES = [(1280, 1024)] * 3


@pytest.fixture(scope="module")
def frames():
    rig = room_rig(3)
    return views_of_scene(wand_scene(rig, N_FRAMES, rate=30.0), rig)


def taken(frames, executor=None):
    taking = WandTaking(NAMES, WAND, executor)
    for views in frames:
        taking.add(views, SIZES)
    return taking


def test_views_and_empty_parts_of_each_image_are_counted(frames):
    progress = taken(frames).progress()
    assert progress.n_frames == N_FRAMES
    assert not progress.is_enough
    for camera in range(3):
        assert len(progress.empty[camera]) == (progress.covered[camera] < 4).sum()
        assert 0 < progress.linked[camera] <= progress.n_views[camera] <= N_FRAMES


def test_the_room_is_told_while_the_wand_is_waved(frames):
    with ThreadPoolExecutor(1) as executor:
        taking = taken(frames, executor)
    progress = taking.progress()
    assert progress.room is not None
    assert "m, where points are known to" in str(progress)
    assert taking.calibrate().scale_std <= progress.room.scale_std


def test_a_camera_that_sees_nothing_is_named_at_once(frames):
    nothing = balls_at(np.empty((0, 2)), 0.05)
    progress = taken([[views[0], nothing, views[2]] for views in frames[:20]]).progress()
    assert "b has not seen the wand" in str(progress)
    assert "a shares only" in str(progress)


def test_a_camera_without_images_is_named():
    taking = WandTaking(NAMES, WAND)
    taking.add([balls_at(np.empty((0, 2)), 0.05)] * 3, [(640, 480), None, (640, 480)])
    with pytest.raises(InputError, match="b has no image"):
        taking.calibrate()
