"""The cameras of a recording: kept in the project, known of what was captured, read from settings; never in the way."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtWidgets import QFileDialog, QWidget
from skelgen_formats.capture_settings import write_settings
from skelgen_gui.model.viewpoint import DOWN
from skelgen_gui.project.cameras import VIEW, Cameras, cameras_from_view
from skelgen_gui.project.deriving import Deriver

from skelgen.capture.reference_rig import reference_rig
from skelgen.model import Project
from skelgen.model.project import Source
from skelgen.model.rig import CaptureSettings, StereoRig


@pytest.fixture
def told():
    return []


@pytest.fixture
def cameras(qtbot, told):
    window = QWidget()
    qtbot.addWidget(window)
    cameras = Cameras(told.append, window)
    cameras.window = window
    return cameras


@pytest.fixture
def reads(qtbot, cameras):
    """Wait until what was to be read is read."""

    def wait():
        reader = cameras.findChild(Deriver)
        assert reader.is_busy  # nothing is read on the window's thread
        qtbot.waitUntil(lambda: not reader.is_busy, timeout=10_000)

    return wait


@pytest.fixture
def project(walked):
    return Project(walked[0].take)


def test_cameras_survive_the_project_file(cameras, project):
    cameras.show_rig(reference_rig())
    kept = json.loads(json.dumps({VIEW: cameras.as_view()}))
    before = cameras.frustums(None)
    cameras.begin_with(project)
    assert cameras.shown == ()
    cameras.begin_with(replace(project, view=kept))
    for lines, same in zip(before, cameras.frustums(None), strict=True):
        np.testing.assert_allclose(same, lines)


@pytest.mark.parametrize(
    "kept", [5, "no", [{}], [{"pose": [1.0] * 16, "size": [1, 1], "focal": [1, 1]}], [{"pose": "x"}], [None]]
)
def test_what_is_no_camera_is_left_out(kept):
    assert cameras_from_view(kept) == ()


def test_a_camera_without_size_is_left_out():
    pose = np.eye(4).ravel().tolist()
    assert cameras_from_view([{"pose": pose, "size": [640, 0], "focal": [800, 800]}]) == ()
    assert len(cameras_from_view([{"pose": pose, "size": [640, 480], "focal": [800, 800]}])) == 1


def test_a_recording_that_was_captured_here_has_its_cameras(cameras, project, tmp_path):
    path = tmp_path / "take.mfml"
    cameras.remember(path, reference_rig())
    cameras.begin_with(replace(project, source=Source(str(path), "mfml")))
    assert len(cameras.shown) == 2


def test_a_stereo_recording_has_the_cameras_of_its_settings(cameras, reads, project, tmp_path):
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(reference_rig()), path)
    stereo = replace(project, source=Source(str(path), "stereo"))
    cameras.begin_with(stereo)
    reads()
    assert len(cameras.shown) == 2
    path.write_text("<capture/>")
    cameras.begin_with(stereo)
    reads()
    assert cameras.shown == ()


def test_cameras_of_a_project_that_was_left_meanwhile_are_not_shown(qtbot, cameras, project, tmp_path):
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(reference_rig()), path)
    cameras.begin_with(replace(project, source=Source(str(path), "stereo")))
    cameras.begin_with(project)
    qtbot.wait(100)
    assert cameras.shown == ()


def test_pyramids_are_a_third_as_long_as_what_they_see_is_far(cameras):
    cameras.show_rig(reference_rig())
    near, far = (cameras.frustums(np.array([[0.0, 0.0, distance]])) for distance in (900.0, 1800.0))
    assert near[0][0, 1, 2] == pytest.approx(300.0)
    assert far[0][0, 1, 2] == pytest.approx(600.0)


def test_cameras_that_stand_upright_say_which_axis_points_down(cameras):
    assert cameras.up is None
    cameras.show_rig(reference_rig())  # whose world is the left camera's, with y down in its image
    assert cameras.up == DOWN + 1
    rig = reference_rig()
    standing = np.array([[1.0, 0, 0, 0], [0, 0, -1, 0], [0, 1, 0, 0], [0, 0, 0, 1]])  # world with z up
    cameras.show_rig(
        StereoRig(*(replace(eye, camera_from_world=eye.camera_from_world @ standing) for eye in (rig.left, rig.right)))
    )
    assert cameras.up == 2


def test_cameras_are_chosen_from_settings_and_others_are_refused(cameras, reads, told, tmp_path, monkeypatch):
    path = tmp_path / "rig.xml"
    monkeypatch.setattr(QFileDialog, "getOpenFileName", lambda *args: (str(path), ""))
    write_settings(CaptureSettings(reference_rig()), path)
    cameras.choose()
    reads()
    assert len(cameras.shown) == 2
    path.write_text("nothing")
    cameras.choose()
    reads()
    assert len(told) == 1
    assert len(cameras.shown) == 2
