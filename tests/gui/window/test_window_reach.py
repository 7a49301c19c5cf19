"""Everybody reaches everything: names for screen readers, tool tips, keys; and pages that the table adds."""

from __future__ import annotations

import pytest
from PySide6.QtCore import QSettings, Qt
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractScrollArea,
    QAbstractSpinBox,
    QComboBox,
    QDockWidget,
    QLabel,
    QLineEdit,
    QMenu,
    QProgressBar,
    QTabBar,
    QToolBar,
    QWidget,
)
from skelgen_gui.diagrams.graph_view import GraphView
from skelgen_gui.diagrams.matrix_view import MatrixView
from skelgen_gui.pages import PAGES
from skelgen_gui.project.context import PageEntry
from skelgen_gui.timeline.lane_view import LaneView
from skelgen_gui.widgets.preferences import Preferences
from skelgen_gui.window import Window

CONTROLS = (QAbstractButton, QAbstractSpinBox, QComboBox, QLineEdit, QAbstractItemView, QProgressBar)
SHOWING = (QProgressBar,)  # nobody enters anything there
TELLING = (GraphView, MatrixView, LaneView)  # their tips are about what is under the pointer
WHOLE = (QComboBox, QAbstractSpinBox, QDockWidget, QTabBar, QAbstractScrollArea)  # their parts are Qt's


@pytest.fixture
def controls(window, person, rods):
    """Whatever can be used in the window, with a project open and every page built."""
    person.opens(rods)
    for entry in window.pages.entries:
        window.pages.page(entry.key)
    return [one for one in window.findChildren(QWidget) if is_control(one)]


def is_control(widget):
    if widget.objectName().startswith("qt_") or is_part(widget):
        return False
    return isinstance(widget, CONTROLS) or (takes_tab(widget) and not isinstance(widget, QTabBar))


def is_part(widget):
    """Whether Qt made it as a part of something else."""
    parent = widget.parentWidget()
    return isinstance(parent, WHOLE) or isinstance(parent.parentWidget() if parent else None, QComboBox)


def takes_tab(widget):
    return bool(widget.focusPolicy() & Qt.FocusPolicy.TabFocus)


def test_every_control_has_a_name_for_screen_readers(controls):
    assert len(controls) > 100
    for control in controls:
        assert control.accessibleName() or getattr(control, "text", str)(), (control, control.parentWidget())


def test_every_control_has_a_tool_tip(controls):
    for control in controls:
        assert control.toolTip() or isinstance(control, TELLING) or control.accessibleName() == "Views", control


def test_every_control_is_reached_by_keys(controls):
    for control in controls:
        by_menu = isinstance(control.parentWidget(), QToolBar)  # whose commands are in the menus
        assert takes_tab(control) or by_menu or isinstance(control, SHOWING), control


def test_menus_show_the_tips_of_their_commands(window, controls):
    menus = [menu for menu in window.findChildren(QMenu) if menu.title()]
    assert menus
    for menu in menus:
        assert menu.toolTipsVisible(), menu.title()


def test_a_page_that_the_table_adds_is_shown_and_kept(qtbot, tmp_path, monkeypatch):
    made = []

    def make(context):
        made.append(context)
        return QLabel("here")

    entries = (*PAGES[:1], PageEntry("own", "Own", "Something else.", make), *PAGES[1:])
    preferences = Preferences(QSettings(str(tmp_path / "settings.ini"), QSettings.Format.IniFormat))
    window = Window(preferences, entries, tmp_path / "recovery")
    qtbot.addWidget(window)
    assert window.pages.page("own").text() == "here"
    assert window.view_state().page == "own"
    assert made[0].session is window.session
