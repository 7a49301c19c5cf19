"""A reference video beside the views: the picture of the frame that is shown."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_gui.timeline.player import VideoPane

from skelgen.capture.sources.video import ReferenceVideo
from skelgen.errors import FormatError

RATE = 25.0  # Hz, of the video; the recording has 100
N_PICTURES = 20


@pytest.fixture
def film(tmp_path):
    """A video whose picture number n is 10 n bright, without loss."""
    cv2 = pytest.importorskip("cv2", reason="OpenCV is not installed")
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"FFV1"), RATE, (32, 24), True)
    if not writer.isOpened():
        pytest.skip("this OpenCV cannot write FFV1")
    for index in range(N_PICTURES):
        writer.write(np.full((24, 32, 3), 10 * index, dtype=np.uint8))
    writer.release()
    return path


def number_of(pane: VideoPane) -> int | None:
    """Which picture is shown."""
    return None if pane.picture.image is None else round(pane.picture.image.pixelColor(5, 5).red() / 10)


def test_pictures_come_in_any_order(film):
    video = ReferenceVideo(film)
    assert (video.rate, video.n_frames) == (RATE, N_PICTURES)
    for index in (0, 1, 7, 3, 19, 0):
        assert np.abs(video.picture(index).astype(int) - 10 * index).max() <= 2  # what colours lose as YUV
    assert video.picture(-1) is None
    assert video.picture(N_PICTURES) is None


def test_what_is_no_video_is_told(tmp_path):
    pytest.importorskip("cv2", reason="OpenCV is not installed")
    (tmp_path / "film.mp4").write_text("no video")
    with pytest.raises(FormatError, match=r"film\.mp4: is no video that can be read"):
        ReferenceVideo(tmp_path / "film.mp4")


def test_the_picture_follows_the_frame_by_rate_and_offset(window, person, rods, film):
    person.opens(rods)
    window.video.show_video(ReferenceVideo(film))
    cases = ((0, 0.0, RATE, 0), (40, 0.0, RATE, 10), (40, 0.2, RATE, 15), (4, 0.0, 100.0, 4))
    for frame, offset, rate, number in cases:
        window.video.offset.setValue(offset)
        window.video.rate.setValue(rate)
        window.session.show_frame(frame)
        person.waits(lambda number=number: number_of(window.video) == number)
    window.video.offset.setValue(-3.0)
    person.waits(lambda: number_of(window.video) is None)
    assert window.video.picture.sentence == "The video has no picture at this time"


def test_a_project_keeps_its_video_even_while_the_file_is_away(window, person, rods, film, tmp_path):
    person.opens(rods)
    window.video.show_video(ReferenceVideo(film))
    window.video.offset.setValue(0.2)
    path = tmp_path / "rods.skelgen"
    person.saves_as(path)
    person.opens(rods)
    assert window.video.kept is None
    person.opens(path)
    person.waits(lambda: number_of(window.video) == 5)
    assert not window.video_dock.isHidden()
    kept = window.video.kept
    film.unlink()
    person.opens(path)
    assert "film.avi: no such file" in window.video.picture.sentence
    assert window.video.kept == kept
