"""Cameras that run: images of one moment by their times; one that loses an image does not stop the others."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.room.live_sources import LiveSets, run_together
from skelgen.capture.room.sources import open_room_source
from skelgen.capture.sources.options import CameraOptions
from skelgen.capture.sources.pairs import Shot
from skelgen.errors import CaptureError, ParameterError

RATE = 100.0


class Camera:
    """Sends an image at each of some times, whose grey value is the number of the time."""

    capacity = None
    size = (4, 3)

    def __init__(self, name, times):
        self.name = name
        self.shots = [Shot(np.full((3, 4), round(time * RATE) % 256, dtype=np.uint8), time) for time in times]

    def take(self, timeout):
        return self.shots.pop(0) if self.shots else None


def sets_of(*cameras, **options):
    wanted = CameraOptions.from_mapping({"rate": RATE, **options}, "test")
    source = LiveSets("test", tuple(camera.name for camera in cameras), lambda stack: (cameras, RATE), wanted)
    with source as sets:
        for count, frame in enumerate(sets):
            yield [None if image is None else int(image[0, 0]) for image in frame.images], frame.index, frame.dropped
            if count == 3:
                return


def times(*numbers, late=0.0):
    return [number / RATE + late for number in numbers]


def test_images_of_one_moment_come_together():
    one, two, three = (Camera(name, times(0, 1, 2, 3, late=0.0002 * n)) for n, name in enumerate("abc"))
    assert [images for images, _, _ in sets_of(one, two, three)] == [[n] * 3 for n in range(4)]


def test_a_lost_image_of_one_camera_is_left_out():
    one, two, three = Camera("a", times(0, 1, 2, 3)), Camera("b", times(0, 2, 3)), Camera("c", times(0, 1, 2, 3))
    found = [images for images, _, _ in sets_of(one, two, three)]
    assert found == [[0, 0, 0], [1, None, 1], [2, 2, 2], [3, 3, 3]]


def test_moments_that_all_have_lost_are_counted():
    one, two = (Camera(name, times(0, 1, 4, 5)) for name in "ab")
    assert [(index, dropped) for _, index, dropped in sets_of(one, two)] == [(0, 0), (1, 0), (4, 2), (5, 0)]


def test_a_camera_that_falls_silent_does_not_stop_the_others():
    one, two = Camera("a", times(0, 1, 2, 3)), Camera("b", times(0, 1))
    assert [images[1] for images, _, _ in sets_of(one, two)] == [0, 1, None, None]


def test_a_silent_camera_is_waited_for_once():
    waits = []

    class Silent(Camera):
        def take(self, timeout):
            waits.append(timeout)
            return super().take(timeout)

    assert len(list(sets_of(Camera("a", times(0, 1, 2, 3)), Silent("b", times(0)), timeout=2.0))) == 4
    assert waits == [2.0, 2.0, 0.0, 0.0]


def test_cameras_of_several_drivers_are_together_by_their_first_images():
    def driver(late, *names):
        cameras = [Camera(name, times(0, 1, 2, 3, late=late)) for name in names]
        return LiveSets(names[0], names, lambda stack: (cameras, RATE), CameraOptions.from_mapping({}, "test"))

    source = run_together([driver(0.0, "a", "b"), driver(500.0, "c")])
    assert source.cameras == ("a", "b", "c")
    with source as sets:
        frame = next(iter(sets))
    assert all(image is not None for image in frame.images)


def test_cameras_that_all_fall_silent_are_an_error():
    with pytest.raises(CaptureError, match="no camera of test has sent an image"):
        list(sets_of(Camera("a", times(0)), Camera("b", times(0))))


def test_images_too_far_apart_name_the_camera_and_the_time():
    one, two = Camera("a", times(0, 1)), Camera("b", times(0, 1, late=0.003))
    with pytest.raises(CaptureError, match=r"the images of b are 3 ms later .* 1 ms are allowed"):
        list(sets_of(one, two))
    assert next(sets_of(Camera("a", times(0, 1)), Camera("b", times(0, 1, late=0.003)), skew=5.0))[0] == [0, 0]


def test_cameras_of_a_room_are_named():
    with pytest.raises(CaptureError, match="1 cameras; give the images of each"):
        open_room_source("gige:10.0.0.2")
    with pytest.raises(CaptureError, match="names 1 cameras; name each once"):
        open_room_source("gige:10.0.0.2,10.0.0.2")
    assert open_room_source("gige:10.0.0.2,10.0.0.3,10.0.0.4").cameras == ("10.0.0.2", "10.0.0.3", "10.0.0.4")


def test_what_no_driver_can_open_is_told_before_cameras_are_opened():
    with pytest.raises(CaptureError, match=r"gone.cti: no such GenTL producer"):
        open_room_source("gentl:gone.cti,one,two")
    with pytest.raises(ParameterError, match="speed is 5; it must be one of"):
        open_room_source("firewire:1,2?speed=5")
