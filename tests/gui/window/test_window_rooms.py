"""The step that calibrates the cameras of a room, as a person uses it: wave, calibrate, find the floor, save."""

from __future__ import annotations

import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog
from skelgen_formats.capture_settings import read_any_settings, write_settings
from skelgen_gui.capture.pictures import group_colour

from skelgen.capture.room.sources import open_room_source
from skelgen.model.rig import RoomSettings

WAIT = 120_000  # ms
WAVED = "room:wand?cameras=2&frames=150&rate=8&width=320"
LYING = "room:frame?cameras=2&frames=2&width=320"


@pytest.fixture
def step(window):
    page = window.pages.page("capture")
    page.tabs.setCurrentWidget(page.room)
    return page.room


@pytest.fixture
def presses(qtbot, window):
    def press(button):
        qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
        qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)

    return press


def test_a_wand_is_waved_and_the_room_is_calibrated_and_saved(window, step, presses, tmp_path, monkeypatch):
    page = window.pages.page("capture")
    assert step.state.text().startswith("1. Wave the wand")
    assert not step.calibrate.isEnabled()
    step.form.source.show_source(WAVED)
    step.form.ground.show_source(LYING)
    presses(step.go)
    assert "150 moments taken" in step.state.text()
    assert "parts, not yet" in step.state.text() or "of 200 views" in step.state.text()
    assert len(page.view.pictures._images) == 2
    presses(step.calibrate)
    assert "balls lie" in step.verdict.text()
    assert step.state.text().startswith("2. Lay the L-frame")
    assert len(page.view.space._found.points)
    presses(step.floor)
    assert step.state.text().startswith("3. Save")
    saved = tmp_path / "room.xml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *args: (str(saved), ""))
    presses(step.save)
    assert [camera.name for camera in read_any_settings(saved).rig.cameras] == ["camera 1", "camera 2"]


def test_what_is_missing_is_told(step, presses):
    presses(step.go)
    assert "Choose where the images come from" in step.verdict.text()
    step.form.source.show_source(WAVED)
    step.form.wand.setText("500")
    presses(step.go)
    assert "two or three numbers in mm" in step.verdict.text()
    step.form.wand.setText("0, 250, 500")
    presses(step.go)
    assert "its ends look alike" in step.verdict.text()


def test_a_room_is_captured_live(qtbot, window, has_colour):
    page = window.pages.page("capture")
    page.live.choice.source.setEditText("room:arm?cameras=4&frames=300&rate=30")
    with qtbot.waitSignal(page.live.shot, timeout=WAIT):
        qtbot.mouseClick(page.live.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: page.live.angles.item(0, 1).text() != "–", timeout=WAIT)
    assert page.view.pictures._titles == ("camera 1", "camera 2", "camera 3", "camera 4")
    for body in range(3):
        assert has_colour(page.view.pictures, group_colour(body), least=20)
    assert page.view.space._rig.names == page.view.pictures._titles
    assert page.live.numbers.text().count("+") == 3  # balls of four cameras
    assert page.live.bodies.item(0, 0).text() == "torso"
    with qtbot.waitSignal(page.live.ended, timeout=WAIT):
        page.live.stop()


def test_a_target_is_calibrated_by_the_cameras_of_a_room(qtbot, window, tmp_path):
    page, seen = window.pages.page("capture"), "room:arm?cameras=4&frames=24&rate=8&show=lower arm"
    path = tmp_path / "room.xml"
    write_settings(RoomSettings(open_room_source(seen).settings.rig), path)
    page.tabs.setCurrentWidget(page.target)
    page.target.form.name.setText("lower arm")
    page.target.form.settings.show_path(str(path))
    page.target.form.source.show_source(seen)
    qtbot.mouseClick(page.target.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: page.target.found is not None and not window.jobs.is_busy, timeout=WAIT)
    assert page.view.pictures._titles == ("camera 1", "camera 2", "camera 3", "camera 4")
    qtbot.mouseClick(page.target.add, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
    assert [body.name for body in read_any_settings(path).bodies] == ["lower arm"]
    assert page.live.choice.settings.path == str(path)
