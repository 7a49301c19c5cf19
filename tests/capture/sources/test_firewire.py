"""What FireWire decides without a bus: why nothing is found, which mode both cameras share, what a text may say."""

from __future__ import annotations

import os

import pytest

from skelgen.capture.sources import open_source
from skelgen.capture.sources.firewire import common_mode, library, why_no_camera
from skelgen.errors import CaptureError, ParameterError

SMALL, LARGE = (640, 480), (1024, 768)


def test_no_bus_no_right_and_no_camera_are_told_apart(tmp_path, monkeypatch):
    node = tmp_path / "fw0"
    node.touch()
    assert "no IEEE 1394 bus" in why_no_camera([])
    assert "no camera on the IEEE 1394 bus" in why_no_camera([node])
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert f"no right to open {node}" in why_no_camera([node])


@pytest.mark.parametrize(
    ("size", "rate", "expected"),
    [
        ("", 0.0, (LARGE, 30.0)),  # the largest, at 60 Hz or else as fast as it can
        ("", 60.0, (SMALL, 60.0)),
        ("640x480", 0.0, (SMALL, 60.0)),
        ("", 1.88, (SMALL, 1.875)),
        ("1024X768", 15.0, (LARGE, 15.0)),
    ],
)
def test_the_mode_is_one_that_both_cameras_have(size, rate, expected):
    left = {SMALL: (1.875, 30.0, 60.0), LARGE: (15.0, 30.0), (800, 600): (30.0,)}
    right = {SMALL: (1.875, 30.0, 60.0, 120.0), LARGE: (7.5, 15.0, 30.0)}
    assert common_mode((left, right), ("left", "right"), size, rate) == expected


def test_without_a_mode_in_common_both_lists_are_told():
    with pytest.raises(CaptureError, match="left has 640x480 at 30 Hz; right has none"):
        common_mode(({SMALL: (30.0,)}, {}), ("left", "right"), "", 0.0)


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("firewire:00accef000001000", "names 1 cameras where left and right belong"),
        ("firewire:1,1", "left and right are both 1; a pair needs two cameras"),
        ("firewire:one,two", "'one' is no camera's number"),
        ("firewire:?speed=300", "speed is 300; it must be one of 100, 200, 400, 800"),
        ("firewire:?buffers=1", "buffers is 1; it must lie in 2"),
        ("firewire:?order=oldest", "must be one of newest, every"),
    ],
)
def test_a_wrong_text_is_refused_before_any_camera_is_opened(text, sentence):
    with pytest.raises(ParameterError, match=sentence):
        open_source(text)


def test_without_the_library_the_package_is_named(monkeypatch):
    def missing(name):
        raise OSError(name)

    monkeypatch.setattr(library.ctypes, "CDLL", missing)
    library.dc1394.cache_clear()
    try:
        with pytest.raises(CaptureError, match="apt install libdc1394-25"), open_source("firewire:"):
            pass
    finally:
        library.dc1394.cache_clear()


def test_a_source_that_is_not_open_has_no_size():
    with pytest.raises(CaptureError, match="use it in a with block"):
        _ = open_source("firewire:").size
