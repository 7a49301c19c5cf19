"""The Capture page as a person uses it: start the simulated rig, see, record, stop, open the recording, run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMessageBox
from skelgen_formats.capture_settings import write_settings
from skelgen_gui.capture.pictures import group_colour

import skelgen
from skelgen.capture.simulated_rig import simulated_rig

WAIT = 120_000  # ms; what is compiled for the first time takes a minute
SHORT = "simulated:arm?frames=60"
ENDLESS = "simulated:arm?frames=5000&rate=1000"
N_BEFORE = 500  # pairs before a source breaks off: long enough to click on Record


@pytest.fixture
def page(window):
    return window.pages.page("capture")


@pytest.fixture
def starts(qtbot, page):
    """Start a source, and wait until its first picture is shown."""

    def start(source):
        page.live.choice.source.setEditText(source)
        with qtbot.waitSignal(page.live.shot, timeout=WAIT) as shot:
            qtbot.mouseClick(page.live.go, Qt.MouseButton.LeftButton)
        return shot.args[0]

    return start


def stops(qtbot, page):
    with qtbot.waitSignal(page.live.ended, timeout=WAIT) as ended:
        qtbot.mouseClick(page.live.go, Qt.MouseButton.LeftButton)
    return ended.args[0]


def texts(table, column):
    return [table.item(row, column).text() for row in range(table.rowCount())]


def notices(page):
    return [page.live.notices.item(row).text() for row in range(page.live.notices.count())]


def test_one_click_captures_the_simulated_rig(qtbot, window, page, has_colour):
    with qtbot.waitSignal(page.live.shot, timeout=WAIT):
        qtbot.mouseClick(page.live.choice.simulated, Qt.MouseButton.LeftButton)
    view = window.middle.currentWidget()
    assert view is page.view
    for body in range(3):
        assert has_colour(view.pictures, group_colour(body), least=20)  # rings of five balls in two pictures
    assert texts(page.live.angles, 0) == ["upper arm.x", "upper arm.y", "upper arm.z", "lower arm"]
    assert "frames/s" in page.live.numbers.text()
    stops(qtbot, page)
    assert not window.jobs.is_busy


def test_rings_are_drawn_where_the_balls_are(qtbot, window, page, starts):
    window.resize(1440, 900)
    shot = starts(SHORT)
    pictures = page.view.pictures
    image = pictures.grab().toImage()
    for x, y in shot.images[0].places.tolist():
        middle = pictures.place_of(0, x, y)
        ring = [image.pixelColor(int(middle.x() + away), int(middle.y())) for away in (5, 6, 7)]
        assert max(colour.lightness() for colour in ring) > 100  # the ground is black


def test_angles_are_those_of_the_scene_in_degrees_with_their_deviations(qtbot, page, starts):
    starts(SHORT)
    qtbot.waitUntil(lambda: not page.live.is_running, timeout=WAIT)
    angles, deviations = texts(page.live.angles, 1), texts(page.live.angles, 2)
    seen = [(float(angle), float(std)) for angle, std in zip(angles, deviations, strict=True) if angle != "–"]
    assert seen
    assert all(abs(angle) < 180 and 0 < std < 1 for angle, std in seen)
    assert any(text != "–" for text in texts(page.live.bodies, 1))


def test_what_was_recorded_while_capturing_is_opened_and_labelled(qtbot, window, page, person, starts, tmp_path):
    page.live.recorder.line.setText(str(tmp_path / "take.mfml"))
    starts("simulated:arm?frames=5000&rate=60")
    qtbot.mouseClick(page.live.recorder.record, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: page.live.numbers.text().count("recording take.mfml: ") == 1, timeout=WAIT)
    qtbot.wait(500)
    ended = stops(qtbot, page)
    (recorded,) = ended.recorded
    assert skelgen.read(recorded.path).n_frames == recorded.n_frames > 1
    with qtbot.waitSignal(window.files.opened, timeout=WAIT):
        qtbot.mouseClick(page.live.recorder.open, Qt.MouseButton.LeftButton)
    person.waits()
    assert window.pages.current.key == "labels"
    assert window.middle.currentWidget() is window.tabs
    assert len(window.cameras.shown) == 2  # the 3-D view shows who took it
    person.does("run_step")
    person.waits(lambda: window.session.project.has("labels"))
    assert window.session.project.trajectories.n_markers == 15


def test_settings_with_a_source_are_opened_like_a_take(window, person, tmp_path):
    path = tmp_path / "settings.xml"
    write_settings(replace(simulated_rig("arm", n_frames=2).settings, source="simulated:arm?frames=20"), path)
    person.opens(path)
    take = window.session.project.take
    assert (take.name, take.n_frames) == ("settings.xml", 20)
    assert take.points_per_frame.min() >= 10


def test_a_source_that_fails_is_told_in_a_sentence(qtbot, page, tmp_path):
    page.live.choice.source.setEditText(f"folder:{tmp_path / 'nowhere'}")
    with qtbot.waitSignal(page.live.ended, timeout=WAIT):
        qtbot.mouseClick(page.live.go, Qt.MouseButton.LeftButton)
    assert "no such folder" in notices(page)[0]
    assert page.live.go.isEnabled()
    assert page.live.go.text() == "Start"


def test_without_settings_and_source_the_page_says_what_to_choose(qtbot, page):
    with qtbot.waitSignal(page.live.ended, timeout=WAIT):
        qtbot.mouseClick(page.live.go, Qt.MouseButton.LeftButton)
    assert notices(page) == ["choose a settings file, or the simulated rig, which needs none"]


def test_a_source_that_breaks_off_keeps_what_was_recorded(qtbot, page, starts, tmp_path):
    cv2 = pytest.importorskip("cv2")
    rig = simulated_rig("arm", n_frames=1)
    pair, _ = rig.render(0)
    write_settings(rig.settings, tmp_path / "rig.xml")
    for side, image in (("left", pair.left), ("right", pair.right)):
        cv2.imwrite(str(tmp_path / f"{side}.png"), image)
    lines = ["left.png right.png"] * N_BEFORE
    (tmp_path / "pairs.txt").write_text("\n".join([*lines, "left.png gone.png"]), encoding="utf-8")
    page.live.choice.settings.show_path(str(tmp_path / "rig.xml"))
    page.live.recorder.line.setText(str(tmp_path / "take.c3d"))
    starts(f"list:{tmp_path / 'pairs.txt'}")
    with qtbot.waitSignal(page.live.ended, timeout=WAIT):
        qtbot.mouseClick(page.live.recorder.record, Qt.MouseButton.LeftButton)
    assert "gone.png" in notices(page)[0]
    assert 0 < skelgen.read(tmp_path / "take.c3d").n_frames <= N_BEFORE
    assert page.live.recorder.open.isEnabled()


def test_closing_the_window_while_capturing_asks_and_keeps_the_recording(qtbot, window, page, person, starts, tmp_path):
    page.live.recorder.line.setText(str(tmp_path / "take.mfml"))
    starts(ENDLESS)
    qtbot.mouseClick(page.live.recorder.record, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: "recording" in page.live.numbers.text(), timeout=WAIT)
    person.answers(QMessageBox.StandardButton.No)
    window.close()
    assert window.isVisible()
    assert page.live.is_running
    person.answers(QMessageBox.StandardButton.Yes)
    window.close()
    qtbot.waitUntil(lambda: not window.isVisible(), timeout=WAIT)
    assert not window.jobs.is_busy
    assert skelgen.read(tmp_path / "take.mfml").n_frames > 0


def test_a_capture_that_is_cancelled_before_it_begins_can_be_started_again(qtbot, window, page):
    page.live.choice.source.setEditText(SHORT)
    page.live.start()
    window.jobs.cancel()
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
    assert not page.live.is_running
    assert page.live.go.text() == "Start"
    assert page.live.go.isEnabled()


def test_cameras_are_kept_with_the_project(window, person, rods, tmp_path):
    from skelgen.capture.reference_rig import reference_rig

    person.opens(rods)
    window.cameras.show_rig(reference_rig())
    person.saves_as(tmp_path / "rods.skelgen")
    person.opens(rods)
    assert window.cameras.shown == ()
    person.opens(tmp_path / "rods.skelgen")
    assert len(window.cameras.shown) == 2


def test_an_existing_recording_is_never_overwritten(qtbot, page, starts, tmp_path):
    path = tmp_path / "take.mfml"
    path.write_bytes(b"before")
    page.live.recorder.line.setText(str(path))
    starts(ENDLESS)
    qtbot.mouseClick(page.live.recorder.record, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: "recording take-2.mfml" in page.live.numbers.text(), timeout=WAIT)
    stops(qtbot, page)
    assert path.read_bytes() == b"before"
    assert page.live.recorder.recorded == tmp_path / "take-2.mfml"


def test_docks_of_the_take_make_room_and_come_back(window):
    docks = {dock.objectName(): dock for dock in window.findChildren(QDockWidget)}
    window.pages.page("capture")
    assert docks["timeline"].isHidden()
    assert docks["corrections"].isHidden()
    assert not docks["steps"].isHidden()
    window.pages.page("open")
    assert not docks["timeline"].isHidden()
    assert not docks["corrections"].isHidden()
    assert window.middle.currentWidget() is window.tabs


def test_the_window_answers_while_it_captures(qtbot, page, starts):
    from time import perf_counter

    starts("simulated:arm?frames=5000&rate=60")
    pauses, last = [], perf_counter()
    for _ in range(100):
        qtbot.wait(5)
        pauses.append(perf_counter() - last)
        last = perf_counter()
    stops(qtbot, page)
    assert np.median(pauses) < 0.1  # s; no more, as the machine that tests may be busy
