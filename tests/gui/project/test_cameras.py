"""The cameras of a recording: kept by the project, known of what was captured, read from settings."""

from __future__ import annotations

from dataclasses import replace

import pytest
from PySide6.QtWidgets import QFileDialog, QWidget
from skelgen_formats.capture_settings import write_settings
from skelgen_gui.model.viewpoint import cameras_of
from skelgen_gui.project.context import Cameras
from skelgen_gui.project.deriving import Deriver

from skelgen.capture.reference_rig import reference_rig
from skelgen.model import Project
from skelgen.model.project import Source
from skelgen.model.rig import CaptureSettings


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


def test_cameras_that_a_project_keeps_are_shown_and_go_with_it(cameras, project):
    cameras.begin_with(project, cameras_of(reference_rig()))
    assert len(cameras.shown) == 2
    cameras.begin_with(project, ())
    assert cameras.shown == ()


def test_a_recording_that_was_captured_here_has_its_cameras(cameras, project, tmp_path):
    path = tmp_path / "take.mfml"
    cameras.remember(path, reference_rig())
    cameras.begin_with(replace(project, source=Source(str(path), "mfml")), ())
    assert len(cameras.shown) == 2


def test_a_stereo_recording_has_the_cameras_of_its_settings(cameras, reads, project, tmp_path):
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(reference_rig()), path)
    stereo = replace(project, source=Source(str(path), "stereo"))
    cameras.begin_with(stereo, ())
    reads()
    assert len(cameras.shown) == 2
    path.write_text("<capture/>")
    cameras.begin_with(stereo, ())
    reads()
    assert cameras.shown == ()


def test_cameras_of_a_project_that_was_left_meanwhile_are_not_shown(qtbot, cameras, project, tmp_path):
    path = tmp_path / "rig.xml"
    write_settings(CaptureSettings(reference_rig()), path)
    cameras.begin_with(replace(project, source=Source(str(path), "stereo")), ())
    cameras.begin_with(project, ())
    qtbot.wait(100)
    assert cameras.shown == ()


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
