"""Two video files as a frame source."""

from __future__ import annotations

import pytest

from skelgen.capture.sources import open_source
from skelgen.errors import CaptureError, FormatError, ParameterError


@pytest.fixture
def videos(tmp_path, save_video):
    """Write a pair of videos and return the text of their source."""

    def write(n_left, n_right, right_size=(24, 16), right_rate=50.0):
        save_video(tmp_path / "left.avi", n_left, 1)
        save_video(tmp_path / "right.avi", n_right, 2, right_size, right_rate)
        return f"video:{tmp_path / 'left.avi'},{tmp_path / 'right.avi'}"

    return write


def test_frames_come_in_pairs_with_the_rate_of_the_files(videos, marks):
    source = open_source(videos(4, 4))
    assert (source.size, source.rate, source.n_frames) == ((24, 16), 50.0, 4)
    assert marks(source) == [(index, 10 * index + 1, 10 * index + 2) for index in range(4)]


def test_times_follow_the_rate_that_is_given(videos):
    with open_source(videos(3, 3) + "?rate=25") as source:
        assert [pair.time for pair in source] == [0, 1 / 25, 2 / 25]


def test_a_shorter_video_is_told_after_all_whole_pairs(videos):
    seen = []
    with (
        open_source(videos(5, 4)) as source,
        pytest.raises(FormatError, match=r"right.avi:frame 4: ends after 4 frames"),
    ):
        seen.extend(pair.index for pair in source)
    assert seen == [0, 1, 2, 3]


def test_a_shorter_video_can_be_taken_as_far_as_it_goes(videos, marks):
    assert len(marks(open_source(videos(5, 4) + "?frames=4"))) == 4


def test_a_video_that_breaks_off_is_told(videos, tmp_path):
    text = videos(60, 60)
    for name in ("left.avi", "right.avi"):
        whole = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FormatError, match=r"left.avi"), open_source(text) as source:
        list(source)


def test_videos_of_different_sizes_are_refused(videos):
    with pytest.raises(CaptureError, match=r"left.avi 24 x 16, .*right.avi 32 x 16"):
        open_source(videos(3, 3, right_size=(32, 16)))


def test_videos_of_different_rates_are_refused(videos):
    with pytest.raises(CaptureError, match=r"50 and .*right.avi 25 frames a second"):
        open_source(videos(3, 3, right_rate=25.0))


def test_what_is_no_video_is_refused(tmp_path, save_video):
    save_video(tmp_path / "left.avi", 2, 1)
    (tmp_path / "right.avi").write_text("no video")
    with pytest.raises(FormatError, match=r"right.avi: is no video"):
        open_source(f"video:{tmp_path / 'left.avi'},{tmp_path / 'right.avi'}")
    with pytest.raises(FormatError, match=r"gone.avi: no such file"):
        open_source(f"video:{tmp_path / 'gone.avi'},{tmp_path / 'right.avi'}")


def test_a_single_video_is_refused():
    with pytest.raises(ParameterError, match="names 1 where left and right belong"):
        open_source("video:left.avi")
