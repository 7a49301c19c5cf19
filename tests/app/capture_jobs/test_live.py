"""A capture as a job: what it hands over, how it ends, what it records."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from skelgen_formats.capture_settings import write_settings

import skelgen
from skelgen.app.capture_jobs.collecting import BodyCollector
from skelgen.app.capture_jobs.live import LiveCapture, open_stream
from skelgen.app.capture_jobs.messages import CaptureControl, CaptureOptions, Feed
from skelgen.capture.room.sources import open_room_source
from skelgen.capture.simulated_rig import simulated_rig
from skelgen.errors import InputError
from skelgen.model.rig import CaptureSettings
from skelgen.progress import SILENT

N_FRAMES = 12
ROOM_ARM = "room:arm?cameras=4&frames=6"
SHORT = f"simulated:arm?frames={N_FRAMES}"


def run(options, control=None):
    """Capture to the end: how it ended, the newest result, and the notices."""
    feed = Feed(lambda: None)
    ended = LiveCapture(options, control or CaptureControl(), feed).run(SILENT)
    return ended, *feed.take()


@pytest.mark.parametrize("predicts", [False, True])
def test_the_simulated_rig_is_captured_to_its_end(predicts):
    ended, shot, notices = run(CaptureOptions("", SHORT, predicts))
    assert (ended.n_frames, ended.n_dropped, ended.error) == (N_FRAMES, 0, None)
    assert notices == ()
    assert set(shot.found.bodies) == {"torso", "upper arm", "lower arm"}
    assert set(shot.angles) == {"upper arm", "lower arm"}
    assert (shot.found.groups >= 0).sum() >= 12
    left, _ = shot.images
    assert sorted(left.groups[left.groups >= 0].tolist()) == sorted(shot.found.groups[shot.found.groups >= 0].tolist())


def test_settings_files_are_read_and_name_their_source(tmp_path):
    known = simulated_rig("arm", n_frames=1).settings
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(known.rig, known.bodies, known.joints, SHORT), path)
    ended, shot, _ = run(CaptureOptions(str(path), ""))
    assert ended.n_frames == N_FRAMES
    np.testing.assert_allclose(shot.settings.rig.left.matrix, known.rig.left.matrix)


def test_cameras_of_which_nothing_is_known_are_refused(tmp_path):
    with pytest.raises(InputError, match="choose the settings file that their calibration wrote"):
        open_stream(CaptureOptions("", "simulated:board?frames=2"))


@pytest.mark.parametrize("suffix", [".mfml", ".c3d"])
def test_everything_is_recorded_that_was_captured_meanwhile(tmp_path, suffix):
    control = CaptureControl(record=tmp_path / f"take{suffix}")
    ended, _, _ = run(CaptureOptions("", SHORT), control)
    (recorded,) = ended.recorded
    assert recorded.n_frames == N_FRAMES == skelgen.read(recorded.path).n_frames


def test_a_recording_that_cannot_be_written_is_told_and_the_capture_goes_on(tmp_path):
    ended, _, notices = run(CaptureOptions("", SHORT), CaptureControl(record=tmp_path / "take.txt"))
    assert (ended.n_frames, ended.recorded, ended.error) == (N_FRAMES, (), None)
    assert "cannot be recorded: its suffix must be one of .mfml, .c3d" in notices[0]


def test_a_rig_that_sees_nothing_is_told_in_a_sentence(tmp_path):
    cv2 = pytest.importorskip("cv2")
    for name in ("left1.png", "right1.png", "left2.png", "right2.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((480, 640), np.uint8))
    path = tmp_path / "rig.xml"
    known = simulated_rig("arm", n_frames=1).settings
    write_settings(CaptureSettings(known.rig, known.bodies, known.joints), path)
    ended, shot, notices = run(CaptureOptions(str(path), f"folder:{tmp_path}"))
    assert ended.n_frames == 2
    assert len(shot.found.points) == 0
    assert any("left image" in sentence for sentence in notices)


def test_images_of_another_size_than_the_settings_say_end_it_with_a_sentence(tmp_path):
    cv2 = pytest.importorskip("cv2")
    for name in ("left1.png", "right1.png"):
        cv2.imwrite(str(tmp_path / name), np.zeros((100, 200), np.uint8))
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(simulated_rig("arm", n_frames=1).rig), path)
    ended, _, _ = run(CaptureOptions(str(path), f"folder:{tmp_path}"))
    assert "these settings are of another rig" in str(ended.error)
    assert ended.n_frames == 0


def test_a_room_is_captured_from_its_settings_and_recorded(tmp_path):
    source = open_room_source(ROOM_ARM)
    path, control = tmp_path / "room.xml", CaptureControl(record=tmp_path / "take.mfml")
    write_settings(replace(source.settings, source=ROOM_ARM), path)
    ended, shot, notices = run(CaptureOptions(str(path), ""), control)
    assert (ended.n_frames, ended.n_dropped, ended.error, notices) == (6, 0, None, ())
    assert set(shot.found.bodies) == {"torso", "upper arm", "lower arm"}
    assert set(shot.angles) == {"upper arm", "lower arm"}
    assert len(shot.images) == 4
    for body in range(3):  # in the pictures as in space
        assert sum((image.groups == body).sum() for image in shot.images) >= 8
    assert skelgen.read(ended.recorded[0].path).n_frames == 6


def test_a_simulated_room_needs_no_settings():
    ended, shot, _ = run(CaptureOptions("", "room:human?cameras=3&frames=4&width=480"))
    assert ended.n_frames == 4
    assert [len(image.places) > 10 for image in shot.images] == [True, True, True]


def test_other_cameras_than_those_of_the_settings_are_told(tmp_path):
    path = tmp_path / "room.xml"
    write_settings(open_room_source(ROOM_ARM).settings, path)
    ended, _, _ = run(CaptureOptions(str(path), "room:arm?cameras=3"))
    assert "has 3 cameras" in str(ended.error)
    assert ended.n_frames == 0


def test_a_target_is_taken_by_the_cameras_of_a_room():
    feed = Feed(lambda: None)
    options = CaptureOptions("", "room:arm?cameras=4&frames=24&rate=8&show=lower arm")
    collector = BodyCollector(options, CaptureControl(), feed, "lower arm", None)
    collector.run("taking", SILENT)
    shot, _ = feed.take()
    assert len(shot.images) == len(shot.rig.cameras) == 4
    assert shot.progress.n_balls == 5
    assert shot.progress.n_alone == shot.progress.n_frames == 24
    assert len(collector.calibrate("lower arm", None, SILENT).target.points) == 5
