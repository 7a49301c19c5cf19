"""The step that calibrates cameras, as a person uses it: collect views, calibrate, save, capture with it."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog
from skelgen_gui.capture.pictures import BOARD

WAIT = 120_000  # ms; a loaded machine finds a dozen boards in seconds
BOARDS = Path(__file__).parents[4] / "shared" / "data" / "stereo_chessboard"
MOVING = "simulated:board?rate=4&frames=14"  # still in every third and fourth pair of a second


@pytest.fixture
def page(window):
    page = window.pages.page("capture")
    page.tabs.setCurrentWidget(page.camera_step)
    return page


@pytest.fixture
def gathers(qtbot, window, page):
    """Look at a source until it ends or fails."""

    def gather(source):
        page.camera_step.form.source.show_source(source)
        qtbot.mouseClick(page.camera_step.go, Qt.MouseButton.LeftButton)
        qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
        return page.camera_step.collection.views

    return gather


@pytest.fixture
def few_boards(tmp_path):
    """A folder with six of the real pairs."""
    if not BOARDS.exists():
        pytest.skip("the chessboards are not here: ../shared/data is absent")
    for number in ("01", "02", "03", "04", "05", "06"):
        for side in ("left", "right"):
            name = f"{side}{number}.jpg"
            (tmp_path / name).write_bytes((BOARDS / name).read_bytes())
    return tmp_path


def calibrates(qtbot, window, page):
    qtbot.mouseClick(page.camera_step.calibrate, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)


def test_real_boards_are_drawn_calibrated_judged_and_saved(
    qtbot, window, page, gathers, few_boards, has_colour, monkeypatch
):
    views = gathers(f"folder:{few_boards}")
    camera_step = page.camera_step
    assert [view.name for view in views] == [f"left0{number}.jpg" for number in range(1, 7)]
    assert has_colour(page.view.pictures, BOARD, least=50)
    assert "6 good views" in camera_step.state.text()
    assert "Still empty in the left image" in camera_step.state.text()
    calibrates(qtbot, window, page)
    assert "6 pairs are few" in camera_step.verdict.text()
    assert camera_step.cameras.item(0, 0).text() == "fx [px]"
    assert abs(float(camera_step.cameras.item(0, 1).text().split(" ± ")[0]) - 533) < 5  # of 13 pairs
    saved = few_boards / "rig.xml"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *args: (str(saved), ""))
    qtbot.mouseClick(camera_step.save, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
    assert saved.exists()
    assert page.live.choice.settings.path == str(saved)


def test_a_moving_board_gives_a_view_where_it_is_held_still(page, gathers):
    views = gathers(MOVING)
    assert len(views) == 3
    assert all(view.is_whole for view in views)
    assert page.camera_step.views.rowCount() == 3


def test_the_simulated_board_gives_the_rig_that_sees_it(qtbot, window, page, gathers):
    from skelgen.capture.reference_rig import reference_rig

    gathers("simulated:board?rate=4&frames=36")
    calibrates(qtbot, window, page)
    found = page.camera_step.found
    assert abs(found.rig.baseline - reference_rig().baseline) < 4 * found.baseline_std
    assert page.camera_step.views.item(0, 3).text() == "yes"
    assert page.view.space.accessibleName()


def test_a_view_is_taken_at_once_if_the_person_says_so(qtbot, window, page):
    page.camera_step.form.source.show_source("simulated:board?rate=30&frames=3000")
    qtbot.mouseClick(page.camera_step.go, Qt.MouseButton.LeftButton)
    qtbot.mouseClick(page.camera_step.take, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: len(page.camera_step.collection.views) > 0, timeout=WAIT)
    qtbot.mouseClick(page.camera_step.go, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: not window.jobs.is_busy, timeout=WAIT)
    assert page.camera_step.go.text() == "Start"


def test_another_size_of_the_squares_keeps_the_views_and_another_board_does_not(page, gathers):
    gathers(MOVING)
    page.camera_step.form.square.setValue(30.0)
    assert len(page.camera_step.collection.views) == 3
    page.camera_step.form.rows.setValue(7)
    assert page.camera_step.collection.views == ()


def test_other_images_show_nothing_of_those_before(qtbot, window, page, gathers, has_colour):
    gathers(MOVING)
    calibrates(qtbot, window, page)
    assert has_colour(page.view.pictures, BOARD)
    assert len(page.view.space._frustums)
    qtbot.mouseClick(page.camera_step.clear, Qt.MouseButton.LeftButton)
    assert not has_colour(page.view.pictures, BOARD)
    assert not len(page.view.space._frustums)
    assert not page.camera_step.cameras.isVisible()


def test_a_chosen_view_stands_out_in_the_coverage(page, gathers, has_colour):
    gathers(MOVING)
    colour = page.palette().color(page.palette().ColorRole.Highlight)
    assert not has_colour(page.camera_step.coverage, colour)
    page.camera_step.views.selectRow(0)
    assert has_colour(page.camera_step.coverage, colour, least=10)


def test_views_are_taken_away_by_key_and_all_at_once(qtbot, page, gathers):
    gathers(MOVING)
    page.camera_step.views.selectRow(1)
    qtbot.keyClick(page.camera_step.views, Qt.Key.Key_Delete)
    assert [view.name for view in page.camera_step.collection.views] == ["1", "3"]
    qtbot.mouseClick(page.camera_step.clear, Qt.MouseButton.LeftButton)
    assert page.camera_step.collection.views == ()
    assert not page.camera_step.calibrate.isEnabled()


def test_another_board_than_the_one_that_is_there_gives_a_sentence(qtbot, page, gathers):
    page.camera_step.form.columns.setValue(11)
    page.camera_step.form.rows.setValue(8)
    views = gathers("simulated:board?frames=2")
    assert not any(view.is_whole for view in views)
    assert "but one of 9x6 is there: count the corners" in page.camera_step.verdict.text()
    assert not page.camera_step.save.isEnabled()


def test_views_of_another_size_are_not_mixed_in(page, gathers, tmp_path):
    cv2 = pytest.importorskip("cv2")
    for side in ("left1.png", "right1.png"):
        cv2.imwrite(str(tmp_path / side), np.zeros((100, 200), np.uint8))
    gathers("simulated:board?rate=4&frames=8")
    n_views = len(page.camera_step.collection.views)
    gathers(f"folder:{tmp_path}")
    assert "another size than those of the views before" in page.camera_step.verdict.text()
    assert len(page.camera_step.collection.views) == n_views > 0


def test_too_few_views_give_a_sentence(qtbot, window, page, gathers):
    gathers("simulated:board?rate=4&frames=4")
    calibrates(qtbot, window, page)
    assert "at least 3 pairs are needed" in page.camera_step.verdict.text()
    assert page.camera_step.found is None


def test_without_opencv_the_assistant_says_which_extra_to_install(page, gathers, monkeypatch):
    monkeypatch.setitem(sys.modules, "cv2", None)
    gathers("simulated:board?frames=2")
    assert "needs OpenCV: pip install 'skelgen-mocap[capture]'" in page.camera_step.verdict.text()


def test_a_source_that_is_not_there_gives_a_sentence(page, gathers, tmp_path):
    gathers(f"folder:{tmp_path / 'nowhere'}")
    assert "no such folder" in page.camera_step.verdict.text()


def test_without_a_source_the_assistant_says_what_to_choose(page, gathers):
    gathers("")
    assert page.camera_step.verdict.text().startswith("Choose where the images come from")
