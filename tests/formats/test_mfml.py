from __future__ import annotations

import struct

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from skelgen_formats.mfml import read_mfml
from skelgen_formats.mfml_stream import FRAME_HEADER, MARKER_DTYPES, iterate_mfml, write_frames
from skelgen_formats.registry import read_take, write_file

from skelgen.errors import WriteError
from skelgen.model import PointCloud

HALF_MICROSECOND = 0.5e-6 + 1e-12  # time stamps are whole microseconds

# One frame of one marker, byte by byte as the seed lists the fields; the id has 8 bytes.
ONE_FRAME = struct.pack("<IQ", 1, 2_500_000) + struct.pack("<3ffIQ", 10.0, -20.0, 30.5, 0.25, 4, 77)


def test_fields_lie_where_the_seed_puts_them(put):
    take = read_take(put("one.mfml", ONE_FRAME))
    assert take.points.tolist() == [[10.0, -20.0, 30.5]]
    assert take.times.tolist() == [2.5]
    assert {key: value.tolist() for key, value in take.attributes.items()} == {
        "reprojection_error": [0.25],
        "n_blobs": [4.0],
        "id": [77.0],
    }


def test_records_have_no_padding():
    assert FRAME_HEADER.itemsize == 12
    assert {width: dtype.itemsize for width, dtype in MARKER_DTYPES.items()} == {4: 24, 8: 28, 16: 36}


@pytest.mark.parametrize("width", ["4", "8", "16"])
def test_id_width_is_found_and_said(cloud, tmp_path, width):
    path = tmp_path / "cloud.mfml"
    write_file(cloud, path, id_width=width)
    back = read_take(path)
    assert f"ids of points as {width} bytes" in back.notices[0]
    np.testing.assert_array_equal(back.points, cloud.points)
    np.testing.assert_array_equal(back.frame_starts, cloud.frame_starts)
    np.testing.assert_allclose(back.times, cloud.times, atol=HALF_MICROSECOND)
    for key, values in cloud.attributes.items():
        np.testing.assert_array_equal(back.attributes[key], values)


@pytest.mark.parametrize(("unit", "seconds"), [("us", 2.5), ("ms", 2500.0), ("s", 2_500_000.0), ("ns", 0.0025)])
def test_unit_of_time_stamps_can_be_told(put, unit, seconds):
    assert read_take(put("one.mfml", ONE_FRAME), timestamp_unit=unit).times.tolist() == [pytest.approx(seconds)]


def test_frames_without_markers_are_kept(put):
    empty = struct.pack("<IQ", 0, 2_600_000)
    assert read_take(put("gap.mfml", ONE_FRAME + empty)).points_per_frame.tolist() == [1, 0]


def test_nothing_but_empty_frames_is_a_format_error(refused, put):
    assert "no marker is seen" in refused(put("blind.mfml", struct.pack("<IQ", 0, 5) * 3))


def test_truncated_file_says_where(refused, put):
    assert refused(put("cut.mfml", ONE_FRAME * 3 + ONE_FRAME[:-1])).startswith(":byte 120: frame 4")


def test_falling_time_stamps_are_a_format_error(refused, put):
    earlier = struct.pack("<IQ", 1, 1) + ONE_FRAME[12:]
    assert "goes back" in refused(put("back.mfml", ONE_FRAME + earlier))


def test_absurd_number_of_markers_is_refused_at_once(refused, put):
    assert "4294967295 markers" in refused(put("huge.mfml", struct.pack("<IQ", 2**32 - 1, 0) + ONE_FRAME))


@pytest.mark.parametrize("bad", [np.nan, np.inf, 3e38])
def test_number_that_is_no_position_names_the_frame(refused, put, bad):
    broken = ONE_FRAME[:12] + struct.pack("<f", bad) + ONE_FRAME[16:]
    assert refused(put("nan.mfml", ONE_FRAME + broken)).startswith(":frame 2")


def test_ids_too_large_for_plain_numbers_are_renumbered(put):
    first, second = (ONE_FRAME[:-8] + struct.pack("<Q", value) for value in (2**64 - 1, 2**64 - 2))
    take = read_take(put("wide.mfml", first + second + first))
    assert take.attributes["id"].tolist() == [1.0, 0.0, 1.0]
    assert any("renumbered" in notice for notice in take.notices)


def test_stream_yields_what_the_reader_reads(valid_file, cloud):
    frames = list(iterate_mfml(valid_file("mfml")))
    assert len(frames) == cloud.n_frames
    np.testing.assert_array_equal(np.concatenate([markers["center"] for _, markers in frames]), cloud.points)
    np.testing.assert_allclose([time for time, _ in frames], cloud.times, atol=HALF_MICROSECOND)


def test_stream_can_be_written_as_it_comes(valid_file, tmp_path):
    original, copy = valid_file("mfml"), tmp_path / "copy.mfml"
    assert write_frames(copy, iterate_mfml(original)) == 20
    assert copy.read_bytes() == original.read_bytes()


def test_markers_are_written_without_their_gaps(walk, tmp_path):
    path = tmp_path / "walk.mfml"
    write_file(walk, path)
    np.testing.assert_array_equal(read_take(path).points_per_frame, walk.seen.sum(axis=1))


def test_negative_times_cannot_be_written(tmp_path):
    early = PointCloud(np.ones((1, 3)), np.array([0, 1]), np.array([-1.0]))
    with pytest.raises(WriteError, match="times from 0 up"):
        write_file(early, tmp_path / "early.mfml")
    assert list(tmp_path.iterdir()) == []


@settings(max_examples=30, derandomize=True, deadline=None)
@given(
    counts=st.lists(st.integers(0, 4), min_size=1, max_size=6).filter(any),
    stamps=st.integers(0, 2**40),
    width=st.sampled_from(["4", "8", "16"]),
)
def test_any_cloud_survives(tmp_path_factory, counts, stamps, width):
    path = tmp_path_factory.mktemp("mfml") / "any.mfml"
    n_points = sum(counts)
    points = np.random.default_rng(n_points).normal(size=(n_points, 3)).astype(np.float32)
    times = (stamps + np.arange(len(counts)) * 10_000) * 1e-6
    write_file(PointCloud(points, np.concatenate(([0], np.cumsum(counts))), times), path, id_width=width)
    back = read_mfml(path, id_width=width)
    np.testing.assert_array_equal(back.points, points)
    assert back.points_per_frame.tolist() == counts
