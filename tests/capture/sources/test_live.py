"""Pairs from two running cameras, on cameras that are nothing but a list of times."""

from __future__ import annotations

from contextlib import ExitStack

import numpy as np
import pytest

from skelgen.capture.sources.genicam import FrameNumber, SharedClock, grey
from skelgen.capture.sources.options import CameraOptions
from skelgen.capture.sources.pairs import LiveCamera, LivePairs, Shot, shared_rate
from skelgen.errors import CaptureError

RATE = 50.0


class Camera:
    """A camera whose images came at given times; its ring has `waiting` of them at once, then one after the other."""

    capacity = 4

    def __init__(self, name, times, waiting=1, size=(4, 3), numbers=None):
        self.name, self.size = name, size
        self._shots = [
            Shot(np.zeros(size[::-1], np.uint8), time, None if numbers is None else numbers[at])
            for at, time in enumerate(times)
        ]
        self._waiting = waiting

    def take(self, timeout):
        if not self._shots or (timeout == 0 and self._waiting <= 0):
            return None
        self._waiting -= 1
        return self._shots.pop(0)


def frames(*indices, late=0.0):
    return [index / RATE + late for index in indices]


def run(left, right, rate=RATE, closed=None, **options):
    def open_pair(stack: ExitStack) -> tuple[list[LiveCamera], float]:
        stack.callback(lambda: closed.append(True) if closed is not None else None)
        return [left, right], rate

    return LivePairs("test", open_pair, CameraOptions(**options))


def indices(source):
    with source:
        return [(pair.index, pair.dropped) for pair in source]


@pytest.mark.parametrize("numbers", [None, [7, 8, 11]])
def test_a_gap_is_counted_by_the_times_or_the_cameras_numbers(numbers):
    left, right = (Camera(name, frames(0, 1, 4), numbers=numbers) for name in "LR")
    assert indices(run(left, right, order="every", frames=3)) == [(0, 0), (1, 0), (4, 2)]


def test_a_frame_without_partner_is_left_out_and_counted():
    left, right = Camera("L", frames(0, 1, 3)), Camera("R", frames(0, 2, 3))
    source = run(left, right, order="every", frames=2)
    assert indices(source) == [(0, 0), (3, 2)]
    assert source.n_dropped == 2


def test_the_newest_of_what_waits_is_taken():
    left, right = Camera("L", frames(0, 1, 2), waiting=3), Camera("R", frames(0, 1, 2), waiting=2)
    with run(left, right, frames=1) as source:
        pair = next(iter(source))
    assert left.take(0) is right.take(0) is None  # the right one was waited for
    assert pair.index == 0


def test_of_a_full_ring_nothing_is_shown_as_newest():
    left, right = (Camera(name, frames(0, 1, 2, 3, 30), waiting=4) for name in "LR")
    taken = []
    with run(left, right, frames=1) as source:
        taken.extend(source)
    assert left.take(1) is None  # the frame 30 came after the ring was empty


def test_images_taken_apart_are_refused_and_how_far():
    left, right = Camera("L", frames(0)), Camera("R", frames(0, late=0.003))
    with pytest.raises(CaptureError, match=r"L and R are 3 ms apart, and 1 ms are allowed: .*\?skew="):
        indices(run(left, right, frames=1))


def test_the_worst_skew_is_kept():
    source = run(Camera("L", frames(0, 1)), Camera("R", [0.0004, 1 / RATE]), order="every", frames=2)
    indices(source)
    assert source.worst_skew == pytest.approx(0.0004)


def test_a_silent_camera_is_named_and_both_are_closed():
    closed = []
    with pytest.raises(CaptureError, match=r"R has sent no image for 2 s"):
        indices(run(Camera("L", frames(0, 1)), Camera("R", frames(0)), closed=closed))
    assert closed == [True]


def test_cameras_of_different_sizes_are_refused_and_closed():
    closed = []
    with pytest.raises(CaptureError, match=r"different sizes: L 4 x 3, R 4 x 5"):
        indices(run(Camera("L", []), Camera("R", [], size=(4, 5)), closed=closed))
    assert closed == [True]


def test_a_camera_whose_times_never_meet_is_refused():
    with pytest.raises(CaptureError, match="apart"):
        indices(run(Camera("L", frames(*range(300))), Camera("R", frames(*range(500, 900))), order="every"))


def test_the_shared_clock_follows_the_quickest_arrivals():
    clock = SharedClock()
    delays = [0.009, 0.002, 0.004, 0.002, 0.007]
    times = [clock.time(index * 0.02, 1000 + index * 0.02 + delay) for index, delay in enumerate(delays)]
    np.testing.assert_allclose(times[1:], 1000.002 + 0.02 * np.arange(1, 5))
    assert clock.time(None, 5.0) == 5.0


def test_frame_numbers_go_on_where_the_camera_begins_again():
    number = FrameNumber()
    assert [number.of(given) for given in (65534, 65535, 1, 3)] == [65534, 65535, 65536, 65538]


@pytest.mark.parametrize(
    ("values", "name", "expected"),
    [
        (np.uint8([[200]]), "Mono8", 200),
        (np.uint16([[0xABC]]), "Mono12Packed", 0xAB),
        (np.uint16([[0xAB12]]), "Mono16", 0xAB),
    ],
)
def test_deep_grey_keeps_its_highest_bits(values, name, expected):
    assert grey(values, name, "camera")[0, 0] == expected


@pytest.mark.parametrize("name", ["RGB8", "BayerRG8", "Mono"])
def test_colours_are_refused(name):
    with pytest.raises(CaptureError, match=f"camera sends {name} where grey is needed"):
        grey(np.zeros((2, 2), np.uint8), name, "camera")


def test_cameras_of_different_rates_are_refused():
    assert shared_rate([("L", 60.0), ("R", 60.1)]) == 60.0
    with pytest.raises(CaptureError, match="different rates: L 60 Hz, R 25 Hz"):
        shared_rate([("L", 60.0), ("R", 25.0)])
