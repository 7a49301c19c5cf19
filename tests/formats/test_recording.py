from __future__ import annotations

import os
from pathlib import Path

import ezc3d
import numpy as np
import pytest
from skelgen_formats.c3d import read_c3d
from skelgen_formats.mfml import read_mfml
from skelgen_formats.recording import C3dRecorder, MfmlRecorder

from skelgen.errors import WriteError

RATE = 60.0
NAMES = ("hand:1", "hand:2", "arm:1")


def positions(n_frames):
    """Three markers on their ways, the second unseen in every third frame; f32 holds them."""
    walk = np.arange(n_frames)[:, np.newaxis, np.newaxis] * np.array([1.0, 0.5, -2.0]) + 1000
    places = walk + np.array([[0.0, 0, 0], [64, 0, 0], [0, 32, 0]])
    places[::3, 1] = np.nan
    return places


def record(path, places, rate=RATE, close=True):
    recorder = C3dRecorder(path, NAMES, rate)
    for number, frame in enumerate(places):
        recorder.add(number / RATE, frame)
    if close:
        recorder.close()
    return recorder


@pytest.mark.parametrize("n_frames", [2, 59, 60, 130])
def test_recorded_c3d_is_read_as_it_was(tmp_path, n_frames):
    places = positions(n_frames)
    record(tmp_path / "walk.c3d", places)
    take = read_c3d(tmp_path / "walk.c3d")
    np.testing.assert_array_equal(take.positions, places)
    assert (take.names, take.rate) == (NAMES, RATE)


def test_ezc3d_reads_it_too(tmp_path):
    places = positions(100)
    record(tmp_path / "walk.c3d", places)
    other = ezc3d.c3d(os.fspath(tmp_path / "walk.c3d"))
    assert tuple(other["parameters"]["POINT"]["LABELS"]["value"]) == NAMES
    assert other["parameters"]["POINT"]["RATE"]["value"][0] == RATE
    np.testing.assert_array_equal(np.moveaxis(other["data"]["points"][:3], 0, -1).swapaxes(0, 1), places)


def test_recording_that_was_never_closed_is_whole_up_to_the_last_second(tmp_path):
    places = positions(130)
    with record(tmp_path / "walk.c3d", places, close=False):
        np.testing.assert_array_equal(read_c3d(tmp_path / "walk.c3d").positions, places[:121])


def test_recording_is_there_from_its_first_frame_on_and_whole(tmp_path):
    path = tmp_path / "walk.c3d"
    with C3dRecorder(path, NAMES, RATE) as recorder:
        assert not path.exists()
        recorder.add(0.0, positions(2)[1])
        np.testing.assert_array_equal(read_c3d(path).positions, positions(2)[1:])


def test_more_frames_than_the_header_can_count(tmp_path):
    n_frames = 65_600
    recorder = C3dRecorder(tmp_path / "long.c3d", NAMES[:1], RATE)
    frame = np.array([[1.0, 2.0, 3.0]])
    with recorder:
        for number in range(n_frames):
            recorder.add(number / RATE, frame)
    assert read_c3d(tmp_path / "long.c3d").n_frames == n_frames


def test_lost_frames_are_empty_frames(tmp_path):
    places = positions(6)
    with C3dRecorder(tmp_path / "walk.c3d", NAMES, RATE) as recorder:
        recorder.add(0.0, places[1])
        recorder.add(4 / RATE, places[2], dropped=3)
    take = read_c3d(tmp_path / "walk.c3d")
    assert take.n_frames == 5
    assert np.isnan(take.positions[1:4]).all()
    np.testing.assert_array_equal(take.positions[[0, 4]], places[[1, 2]])


def test_rate_is_measured_where_nobody_knows_it(tmp_path):
    record(tmp_path / "walk.c3d", positions(50), rate=None)
    assert read_c3d(tmp_path / "walk.c3d").rate == pytest.approx(RATE, rel=1e-6)


def test_hundreds_of_markers_have_their_names(tmp_path):
    names = [f"body {number}:ball" for number in range(300)]
    with C3dRecorder(tmp_path / "many.c3d", names, RATE) as recorder:
        recorder.add(0.0, np.ones((300, 3)))
    assert read_c3d(tmp_path / "many.c3d").names == tuple(names)


def test_recorded_mfml_is_read_as_it_was(tmp_path):
    rng = np.random.default_rng(0)
    frames = [rng.normal(size=(n, 3)).astype(np.float32) * 500 for n in (4, 0, 7)]
    with MfmlRecorder(tmp_path / "walk.mfml") as recorder:
        for number, points in enumerate(frames):
            recorder.add(number / 50, points, np.full(len(points), 0.25))
    cloud = read_mfml(tmp_path / "walk.mfml")
    np.testing.assert_array_equal(cloud.points, np.concatenate(frames))
    np.testing.assert_array_equal(cloud.points_per_frame, [4, 0, 7])
    np.testing.assert_allclose(cloud.times, [0, 0.02, 0.04])
    np.testing.assert_array_equal(cloud.attributes["n_blobs"], 2)


@pytest.mark.parametrize("make", [MfmlRecorder, lambda path: C3dRecorder(path, NAMES)])
def test_recording_without_frames_leaves_no_file(tmp_path, make):
    with make(tmp_path / "nothing"):
        pass
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("make", [MfmlRecorder, lambda path: C3dRecorder(path, NAMES)])
def test_recording_that_is_there_is_not_overwritten(tmp_path, make):
    path = tmp_path / "precious"
    path.write_bytes(b"old")
    with pytest.raises(WriteError, match="there is such a recording already; choose another name"):
        make(path)
    assert path.read_bytes() == b"old"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")
def test_full_disk_is_one_sentence(tmp_path):
    recorder = MfmlRecorder(tmp_path / "walk.mfml")
    full = pytest.raises(WriteError, match="cannot be recorded: No space left on device")
    with Path("/dev/full").open("wb", buffering=0) as recorder._stream, full:
        recorder.add(0.0, np.ones((1, 3)), np.ones(1))


def test_time_before_zero_is_refused(tmp_path):
    with MfmlRecorder(tmp_path / "walk.mfml") as recorder, pytest.raises(WriteError, match="holds times from 0 up"):
        recorder.add(-1.0, np.ones((1, 3)), np.ones(1))
