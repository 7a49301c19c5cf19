"""Parts of the steps that calibrate targets and joints: dots of attitudes, tables, names of joints."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from skelgen_gui.capture.forms import JointForm, LiveChoice
from skelgen_gui.capture.measured import COVERED, CoverageView, MotionTable, TurnView
from skelgen_gui.capture.target_steps import RequestList
from skelgen_gui.widgets.painting import is_dark, theme_palette

from skelgen.app.capture_jobs.images import CollectedView
from skelgen.capture.calibration.chessboard import BoardView
from skelgen.capture.calibration.joints import JointMotion
from skelgen.capture.values import JointRequest

NAMES = ["torso", "upper arm", "lower arm"]


def motion(span, n=20, names=("upper arm", "lower arm")):
    return JointMotion(*names, n, np.linspace(-span / 2, span / 2, n)[:, np.newaxis] * [1.0, 0.0, 0.0])


@pytest.mark.parametrize("dark", [False, True])
def test_attitudes_are_dots_in_both_themes(shown, has_colour, dark):
    view = TurnView()
    view.setPalette(theme_palette(dark=dark))
    shown(view, 340, 100)
    colour = COVERED[is_dark(view.palette())]
    assert not has_colour(view, colour)
    view.show_motion(motion(80))
    assert has_colour(view, colour, least=20)


@pytest.mark.parametrize("span", [5, 60, 170])
def test_all_attitudes_fit_into_the_picture(shown, has_colour, span):
    view = shown(TurnView(), 340, 100)
    view.show_motion(motion(span, 2))
    assert has_colour(view, COVERED[False], least=8)  # both ends, in both pictures


def test_motions_are_rows_whose_numbers_change(qtbot, shown):
    table = shown(MotionTable())
    assert table.chosen is None
    table.show_motions([motion(10), motion(70, names=("torso", "upper arm"))])
    table.selectRow(1)
    table.show_motions([motion(30), motion(90, 40, names=("torso", "upper arm"))])
    assert [table.item(1, column).text() for column in range(3)] == ["torso – upper arm", "40", "90 · 0 · 0"]
    assert table.chosen.spans[0] == pytest.approx(90)


@pytest.fixture
def requests(shown):
    requests = shown(RequestList())
    requests.show_targets(NAMES)
    return requests


def names(qtbot, requests, name, parent, child):
    requests.name.setText(name)
    requests.parent_box.setCurrentText(parent)
    requests.child_box.setCurrentText(child)
    qtbot.mouseClick(requests.more, Qt.MouseButton.LeftButton)


def test_joints_are_named_once_between_two_targets(qtbot, requests):
    names(qtbot, requests, "elbow", "upper arm", "upper arm")
    assert requests.requests == ()
    names(qtbot, requests, "elbow", "upper arm", "lower arm")
    names(qtbot, requests, "elbow", "torso", "lower arm")
    assert requests.requests == (JointRequest("elbow", "upper arm", "lower arm"),)
    assert requests.table.item(0, 3).text() == "type is found"


def test_the_search_for_a_joint_begins_where_it_is_stated(qtbot, requests):
    requests.advanced.expander.click()
    requests.start.setText("0,0,-300:1,2")
    requests.name.setText("elbow")
    requests.parent_box.setCurrentText("upper arm")
    requests.child_box.setCurrentText("lower arm")
    assert not requests.more.isEnabled() and "X,Y,Z:X,Y,Z in mm" in requests.more.toolTip()
    requests.start.setText("0,0,-300:1,2,3")
    qtbot.mouseClick(requests.more, Qt.MouseButton.LeftButton)
    assert [request.start for request in requests.requests] == [((0.0, 0.0, -300.0), (1.0, 2.0, 3.0))]
    assert requests.start.text() == ""


def test_frames_and_prediction_stand_behind_advanced(qtbot, shown):
    joints, live = shown(JointForm()), shown(LiveChoice())
    assert not joints.use_frames.isVisible()
    joints.advanced.expander.click()
    assert joints.use_frames.isVisible()
    assert not live.options.predicts_joints
    live.advanced.expander.click()
    live.predicts_joints.click()
    assert live.options.predicts_joints and not live.options.predicts


def test_joints_of_targets_that_are_gone_go_with_them(qtbot, requests):
    names(qtbot, requests, "elbow", "upper arm", "lower arm")
    names(qtbot, requests, "shoulder", "torso", "upper arm")
    with qtbot.waitSignal(requests.changed):
        requests.show_targets(NAMES[:2])
    assert [request.name for request in requests.requests] == ["shoulder"]
    assert requests.parent_box.currentText() == "torso"


def test_the_chosen_joint_is_taken_away(qtbot, requests):
    names(qtbot, requests, "elbow", "upper arm", "lower arm")
    assert not requests.less.isEnabled()
    requests.table.selectRow(0)
    qtbot.mouseClick(requests.less, Qt.MouseButton.LeftButton)
    assert requests.requests == ()
    assert requests.table.isHidden()


def test_covered_parts_are_coloured_on_light_and_dark_windows(shown, has_colour):
    for dark in (False, True):
        corners = np.array([250, 200]) + 15.0 * np.stack(np.meshgrid(np.arange(9.0), np.arange(6.0)), axis=-1).reshape(
            -1, 2
        )
        board = BoardView(corners, 3.0)
        picture = CoverageView()
        picture.setPalette(theme_palette(dark=dark))
        shown(picture, 340, 126)
        assert not has_colour(picture, QColor(COVERED[dark]))
        picture.show_views([CollectedView("one", board, board, (640, 480))])
        assert has_colour(picture, QColor(COVERED[dark]), least=5)
