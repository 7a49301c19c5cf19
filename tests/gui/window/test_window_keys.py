"""Keys work wherever the focus is in the window, and lists, buttons and fields keep those that they need."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QPoint, Qt
from PySide6.QtWidgets import QApplication
from skelgen_gui.project.corrections import CorrectionList

Key = Qt.Key


@pytest.fixture
def active(active, person, rods):
    """The window with a recording open, and the keys going to it."""
    person.opens(rods)
    return active


@pytest.fixture
def presses(qtbot):
    def press(*keys):
        for key in keys:
            qtbot.keyClick(QApplication.focusWidget(), key)

    return press


def test_play_and_views_obey_keys_before_any_view_was_clicked(active, presses):
    active.pages.list.setFocus(Qt.FocusReason.MouseFocusReason)
    presses(Key.Key_Space)
    assert active.timeline.player.is_playing
    presses(Key.Key_Space)
    assert not active.timeline.player.is_playing
    active.view3d.look_from_side()
    side = active.view3d.viewpoint.azimuth
    presses(Key.Key_1)
    assert active.view3d.viewpoint.azimuth != side
    presses(Key.Key_3)
    assert active.view3d.viewpoint.azimuth == side


def test_next_doubt_is_found_by_its_key_while_a_list_has_the_focus(active, presses, doubted):
    active.document.open(doubted)
    active.pages.list.setFocus(Qt.FocusReason.MouseFocusReason)
    presses(Key.Key_D)
    assert active.session.frame == 3
    assert active.session.selection.markers == {1}


def test_space_presses_a_button_reached_by_tab_and_plays_after_a_click(qtbot, active, presses):
    listed = active.findChild(CorrectionList)
    listed.entries.setFocus()
    presses(Key.Key_Tab)
    assert QApplication.focusWidget() is listed.at_once
    presses(Key.Key_Space)
    assert not listed.at_once.isChecked()
    assert not active.timeline.player.is_playing
    place = QPoint(8, listed.at_once.height() // 2)
    qtbot.mouseClick(listed.entries.viewport(), Qt.MouseButton.LeftButton)
    qtbot.mouseClick(listed.at_once, Qt.MouseButton.LeftButton, pos=place)
    presses(Key.Key_Space)
    assert listed.at_once.isChecked()
    assert active.timeline.player.is_playing


def test_lists_graph_and_fields_keep_the_keys_that_they_need(qtbot, active, person, presses):
    active.pages.list.setFocus()
    row = active.pages.list.currentRow()
    presses(Key.Key_Down)
    assert active.pages.list.currentRow() == row + 1
    presses(Key.Key_End)
    assert (active.pages.list.currentRow(), active.session.frame) == (active.pages.list.count() - 1, 0)
    active.timeline.transport.frame.setFocus()
    active.timeline.transport.frame.selectAll()
    presses(Key.Key_7, Key.Key_1, Key.Key_Return)
    assert active.session.frame == 71
    person.runs_all()
    active.tabs.setCurrentWidget(active.graph)
    person.waits(lambda: active.graph.graph is not None)
    active.graph.setFocus()
    presses(Key.Key_Down)
    assert active.session.selection.limb is not None
    active.tabs.setCurrentWidget(active.matrix)
    active.matrix.setFocus()
    presses(Key.Key_Right, Key.Key_Right)
    assert active.session.frame == 71
