from __future__ import annotations

import threading
from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.bodies.prediction import PredictionParameters
from skelgen.capture.live import MotionCapture
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.capture.values import FrameSet
from skelgen.errors import InputError, ParameterError, SkelgenError
from skelgen.model.rig import CaptureSettings


@pytest.fixture(scope="module")
def source():
    """The reference arm before the reference rig."""
    return simulated_rig("arm", n_frames=60)


@pytest.fixture(scope="module")
def pairs(source):
    return [source.render(index)[0] for index in range(0, 60, 12)]


def test_images_become_balls_points_bodies_and_angles(source, pairs):
    with MotionCapture(source.settings) as capture:
        first = next(capture.run(pairs))
    assert set(first.bodies) == {"torso", "upper arm", "lower arm"}
    assert set(first.angles) == {"upper arm", "lower arm"}
    assert first.bodies["torso"].rms < 0.5
    assert first.angles["lower arm"].residual < 1.0
    assert first.angles["lower arm"].std[0] < np.deg2rad(0.3)
    assert first.latency > 0
    assert first.notices == ()


@pytest.mark.parametrize("prediction", [None, PredictionParameters()])
def test_threads_change_nothing(source, pairs, prediction):
    with (
        MotionCapture(source.settings, prediction=prediction, threads=True) as many,
        MotionCapture(source.settings, prediction=prediction, threads=False) as one,
    ):
        for first, second in zip(many.run(pairs), one.run(pairs), strict=True):
            assert first.bodies.keys() == second.bodies.keys()
            for name, body in first.bodies.items():
                np.testing.assert_array_equal(body.world_from_body, second.bodies[name].world_from_body)


@pytest.mark.parametrize("threads", [True, False])
def test_threads_begin_with_the_first_pair_and_end_with_the_capture(source, pairs, threads):
    def running():
        return [thread for thread in threading.enumerate() if thread.name.startswith("capture")]

    with MotionCapture(source.settings, threads=threads) as capture:
        assert len(capture.see(pairs[0]).bodies) == 3
        assert (len(running()) > 1) is threads
    assert not running()


def test_lost_pairs_are_told(source, pairs):
    with MotionCapture(source.settings, threads=False) as capture:
        captured = capture.see(replace(pairs[0], dropped=3))
        assert captured.notices == ("3 pairs were lost before frame 0",)
        assert capture.see(replace(pairs[1], dropped=1)).notices == (f"1 pair was lost before frame {pairs[1].index}",)


def test_pairs_before_a_break_are_delivered(source, pairs):
    def breaking():
        yield pairs[0]
        raise SkelgenError("the left camera was unplugged")

    seen = []
    with MotionCapture(source.settings) as capture, pytest.raises(SkelgenError, match="unplugged"):
        seen.extend(captured.pair.index for captured in capture.run(breaking()))
    assert seen == [0]


def test_images_of_another_size_are_refused(source):
    small = np.zeros((240, 320), dtype=np.uint8)
    pair = FrameSet((small, small), 0.0, 7)
    with MotionCapture(source.settings) as capture, pytest.raises(InputError) as error:
        capture.see(pair)
    assert "the left camera sends 320 x 240 pixels, and its calibration is for 640 x 480" in str(error.value)


def test_images_that_are_not_grey_are_refused(source, pairs):
    coloured = np.stack([pairs[0].left] * 3, axis=2)
    with MotionCapture(source.settings) as capture, pytest.raises(InputError, match="grey images of 8 bits are needed"):
        capture.see(replace(pairs[0], images=(coloured, pairs[0].right)))


def test_black_image_is_told_once_and_stops_nothing(source, pairs):
    black = np.zeros_like(pairs[0].left)
    with MotionCapture(source.settings) as capture:
        told = [capture.see(FrameSet((black, pair.right), pair.time, pair.index)).notices for pair in pairs]
    assert told[0][0].startswith("left image: ")
    assert told[1:] == [()] * (len(pairs) - 1)


def test_swapped_cameras_are_told(source):
    pairs = [source.render(index)[0] for index in range(60)]
    swapped = [FrameSet((pair.right, pair.left), pair.time, pair.index) for pair in pairs]
    with MotionCapture(source.settings) as capture:
        told = [notice for captured in capture.run([*swapped, *swapped]) for notice in captured.notices]
    assert told == ["hardly any ball fits both images, but they do if exchanged: the cameras are swapped"]


def test_unknown_parameter_of_the_detection_is_refused(source):
    settings = CaptureSettings(source.settings.rig, detection={"glow": 1.0})
    with pytest.raises(ParameterError, match="detection has no parameter 'glow'"):
        MotionCapture(settings)


def test_settings_without_bodies_give_points_alone(source, pairs):
    with MotionCapture(CaptureSettings(source.settings.rig)) as capture:
        captured = capture.see(pairs[0])
    assert len(captured.points) == 15
    assert (captured.bodies, captured.angles) == ({}, {})
