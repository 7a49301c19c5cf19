"""Menus, tool bar, keys and the list of keys are made from one table."""

from __future__ import annotations

from collections import Counter

import pytest
from PySide6.QtGui import QKeySequence
from PySide6.QtWidgets import QMainWindow, QToolBar
from skelgen_gui.widgets.shortcuts import (
    COMMANDS,
    SEPARATOR,
    ShortcutsDialog,
    fill_menu_bar,
    fill_tool_bar,
    make_actions,
)

ALL = [command for command in COMMANDS if command.id != SEPARATOR]


@pytest.fixture
def window(qtbot):
    window = QMainWindow()
    qtbot.addWidget(window)
    return window


@pytest.fixture
def actions(window):
    return make_actions(window)


def test_commands_have_distinct_names_and_keys():
    assert max(Counter(command.id for command in ALL).values()) == 1
    assert max(Counter(command.key for command in ALL if command.key).values()) == 1


def test_every_key_is_one_that_qt_knows(actions):
    for command in ALL:
        keys = actions[command.id].shortcuts()
        assert QKeySequence.listToString(keys, QKeySequence.SequenceFormat.PortableText) == command.key


def test_entries_of_a_menu_have_distinct_marked_letters():
    for menu in {command.menu for command in ALL}:
        letters = [command.text[command.text.index("&") + 1].lower() for command in ALL if command.menu == menu]
        assert max(Counter(letters).values()) == 1


def test_menus_hold_every_command_once(window, actions):
    menus = fill_menu_bar(window.menuBar(), actions)
    listed = [action for menu in menus.values() for action in menu.actions() if not action.isSeparator()]
    assert listed == [actions[command.id] for command in sorted(ALL, key=lambda c: list(menus).index(c.menu))]
    assert [action.text() for action in window.menuBar().actions()] == list(menus)


def test_the_tool_bar_has_what_the_table_says(window, actions):
    bar = QToolBar(window)
    fill_tool_bar(bar, actions)
    assert bar.actions() == [actions[command.id] for command in ALL if command.in_tool_bar]


def test_tool_tips_tell_the_key(actions):
    assert actions["save"].toolTip() == "Save the project (Ctrl+S)"
    assert all(action.toolTip() for action in actions.values())


def test_the_list_of_keys_shows_each_with_its_use(qtbot, actions):
    dialog = ShortcutsDialog(actions.values())
    qtbot.addWidget(dialog)
    rows = [[dialog.table.item(row, column).text() for column in range(3)] for row in range(dialog.table.rowCount())]
    assert len(rows) == sum(bool(command.key) for command in ALL)
    assert ["Run all", "Ctrl+Shift+R", "Run what is missing, or all anew"] in rows


def test_the_list_of_keys_can_be_searched(qtbot, actions):
    dialog = ShortcutsDialog(actions.values())
    qtbot.addWidget(dialog)
    dialog.show()
    qtbot.keyClicks(dialog.search, "redo")
    shown = [row for row in range(dialog.table.rowCount()) if not dialog.table.isRowHidden(row)]
    assert [dialog.table.item(row, 0).text() for row in shown] == ["Redo"]


def test_a_changed_key_is_listed_as_it_is_now(qtbot, actions):
    actions["open"].setShortcut("Ctrl+Alt+O")
    dialog = ShortcutsDialog(actions.values())
    qtbot.addWidget(dialog)
    assert dialog.table.item(0, 1).text() == "Ctrl+Alt+O"
