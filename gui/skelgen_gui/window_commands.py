"""Menus, tool bar and keys of the window, and what they do."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from PySide6.QtCore import QObject
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QDockWidget, QMenu, QMessageBox, QToolBar

from skelgen_gui.pages.stage import StagePage
from skelgen_gui.project.file_actions import RecentMenu
from skelgen_gui.project.session import Selection
from skelgen_gui.widgets.dialogs import PreferencesDialog, ShortcutsDialog
from skelgen_gui.widgets.errors import versions
from skelgen_gui.widgets.shortcuts import fill_menu_bar, fill_tool_bar

if TYPE_CHECKING:
    from skelgen_gui.window import Window


class Commanding(QObject):
    """Everything that the window can be told.

    Parameters
    ----------
    window : Window
        The window, whose parts exist already.
    """

    def __init__(self, window: Window) -> None:
        super().__init__(window)
        self._window = window
        self.actions = window.actions_by_id
        menus = fill_menu_bar(window.menuBar(), self.actions)
        self._fill_file(menus["&File"])
        self._fill_edit(menus["&Edit"])
        window.menuBar().insertMenu(menus["&Play"].menuAction(), self._view_menu())
        bar = QToolBar(self.tr("Main tool bar"), window)
        bar.setObjectName("tools")
        fill_tool_bar(bar, self.actions)
        window.addToolBar(bar)
        for name, act in self._acts().items():
            self.actions[name].triggered.connect(act)
        self._follow_undo()
        window.jobs.begun.connect(self._follow)
        window.jobs.ended.connect(self._follow)
        window.session.state_changed.connect(self._follow)
        window.session.other_changed.connect(self._follow)
        self._follow()

    def _fill_file(self, menu: QMenu) -> None:
        recent = RecentMenu(self._window.preferences, self._window)
        recent.chosen.connect(self._window.open)
        menu.insertMenu(self.actions["compare"], recent)

    def _fill_edit(self, menu: QMenu) -> None:
        menu.addSeparator()
        self.correct_menu = menu.addMenu(self.tr("&Correct"))
        self.correct_menu.setToolTipsVisible(True)
        self.correct_menu.aboutToShow.connect(self._fill_corrections)
        self._fill_corrections()

    def _fill_corrections(self) -> None:
        self._window.corrections.fill(self.correct_menu)

    def _view_menu(self) -> QMenu:
        menu = QMenu(self.tr("&View"), self._window)
        menu.setToolTipsVisible(True)
        commands = self._window.view3d.commands
        menu.addActions([commands.fit, commands.fit_take, commands.front, commands.side, commands.top])
        menu.addSeparator()
        commands.fill(menu)
        menu.addAction(self._cameras_action(menu))
        menu.addSeparator()
        for dock in self._window.findChildren(QDockWidget):
            menu.addAction(dock.toggleViewAction())
        return menu

    def _cameras_action(self, menu: QMenu) -> QAction:
        action = QAction(self.tr("Cameras of a capture…"), menu)
        action.setToolTip(self.tr("Show the cameras in the settings of a capture that this recording was made with"))
        action.setStatusTip(action.toolTip())
        action.triggered.connect(self._window.cameras.choose)
        return action

    def _acts(self) -> dict[str, Callable[[], object]]:
        """What the commands of the table do, by their ids."""
        window = self._window
        return {
            "open": window.care.choose,
            "compare": window.care.choose_other,
            "compare_none": lambda: window.session.compare_with(None),
            "save": self._save,
            "save_as": self._save_as,
            "export": lambda: window.pages.page("export"),
            "quit": window.close,
            "undo": window.document.undo_stack.undo,
            "redo": window.document.undo_stack.redo,
            "select_all": self._select_all,
            "select_none": lambda: window.session.select(Selection()),
            "preferences": lambda: PreferencesDialog(window.preferences, window).open(),
            "run_step": self._run_step,
            "run_all": self.run_all,
            "cancel": window.jobs.cancel,
            "next_page": lambda: window.pages.turn(1),
            "previous_page": lambda: window.pages.turn(-1),
            "shortcuts": self._show_keys,
            "about": lambda: QMessageBox.about(window, self.tr("About skelgen"), versions()),
        }

    def _save(self) -> None:
        self._window.care.save()

    def _save_as(self) -> None:
        self._window.care.save_as()

    def run_all(self) -> None:
        """Run all that is missing, with the numbers that the pages were told."""
        for page in self._window.pages.findChildren(StagePage):
            page.obey_number()
        self._window.runner.run_all()

    def _run_step(self) -> None:
        entry = self._window.pages.current
        page = self._window.pages.page(entry.key)
        if isinstance(page, StagePage):
            page.start()

    def _select_all(self) -> None:
        project = self._window.session.project
        if project is not None and project.has("labels"):
            self._window.session.select(Selection(frozenset(range(project.trajectories.n_markers))))

    def _show_keys(self) -> None:
        window = self._window
        ShortcutsDialog(dict.fromkeys((*self.actions.values(), *window.view3d.actions())), window).open()

    def _follow_undo(self) -> None:
        stack = self._window.document.undo_stack
        for name, told, is_possible in (
            ("undo", stack.canUndoChanged, stack.canUndo()),
            ("redo", stack.canRedoChanged, stack.canRedo()),
        ):
            told.connect(self.actions[name].setEnabled)
            self.actions[name].setEnabled(is_possible)

    def _follow(self) -> None:
        """What is possible depends on whether a project is open and whether something runs."""
        session, is_busy = self._window.session, self._window.jobs.is_busy
        is_open = session.project is not None
        for name in ("save", "save_as", "export", "compare", "select_all", "run_step", "run_all"):
            self.actions[name].setEnabled(is_open and not is_busy)
        self.actions["compare_none"].setEnabled(session.other is not None)
        self.actions["open"].setEnabled(not is_busy)
        self.actions["cancel"].setEnabled(is_busy)
