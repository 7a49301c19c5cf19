"""Parts of the steps that calibrate targets and joints: dots of attitudes, tables, names of joints."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import Qt
from skelgen_gui.capture.camera_views import COVERED
from skelgen_gui.capture.joint_step import Wished, WishList
from skelgen_gui.capture.measured import MotionTable, TurnView
from skelgen_gui.widgets.theme import is_dark, theme_palette

from skelgen.capture.calibration.joints import JointMotion

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
def wishes(shown):
    wishes = shown(WishList())
    wishes.show_targets(NAMES)
    return wishes


def names(qtbot, wishes, name, parent, child):
    wishes.name.setText(name)
    wishes.parent_box.setCurrentText(parent)
    wishes.child_box.setCurrentText(child)
    qtbot.mouseClick(wishes.more, Qt.MouseButton.LeftButton)


def test_joints_are_named_once_between_two_targets(qtbot, wishes):
    names(qtbot, wishes, "elbow", "upper arm", "upper arm")
    assert wishes.wishes == ()
    names(qtbot, wishes, "elbow", "upper arm", "lower arm")
    names(qtbot, wishes, "elbow", "torso", "lower arm")
    assert wishes.wishes == (Wished("elbow", "upper arm", "lower arm"),)
    assert wishes.table.item(0, 3).text() == "kind is found"


def test_joints_of_targets_that_are_gone_go_with_them(qtbot, wishes):
    names(qtbot, wishes, "elbow", "upper arm", "lower arm")
    names(qtbot, wishes, "shoulder", "torso", "upper arm")
    with qtbot.waitSignal(wishes.changed):
        wishes.show_targets(NAMES[:2])
    assert [wish.name for wish in wishes.wishes] == ["shoulder"]
    assert wishes.parent_box.currentText() == "torso"


def test_the_chosen_joint_is_taken_away(qtbot, wishes):
    names(qtbot, wishes, "elbow", "upper arm", "lower arm")
    assert not wishes.less.isEnabled()
    wishes.table.selectRow(0)
    qtbot.mouseClick(wishes.less, Qt.MouseButton.LeftButton)
    assert wishes.wishes == ()
    assert wishes.table.isHidden()
