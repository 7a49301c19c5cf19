"""Menus, tool bar and keys of the window, and what they do; recent files, preferences, and the first steps."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

from PySide6.QtCore import QObject, QUrl, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QDockWidget,
    QMainWindow,
    QMenu,
    QMessageBox,
    QTextBrowser,
    QToolBar,
    QWidget,
)

from skelgen_gui.model.selection import Selection
from skelgen_gui.page_stack import PageStack
from skelgen_gui.pages.steps import StagePage
from skelgen_gui.project.context import Context
from skelgen_gui.project.corrections import CorrectionActions
from skelgen_gui.project.file_actions import SampleMenu
from skelgen_gui.project.other_files import ParameterFiles, SubjectActions
from skelgen_gui.view3d.view import View3D
from skelgen_gui.widgets.errors import versions
from skelgen_gui.widgets.forms import stage_form
from skelgen_gui.widgets.layouts import answer_buttons, column, put_texts
from skelgen_gui.widgets.painting import as_rich_text
from skelgen_gui.widgets.preferences import Preferences, PreferenceValues
from skelgen_gui.widgets.shortcuts import ShortcutsDialog, fill_menu_bar, fill_tool_bar

_MOST_LETTERS = 60  # of what is undone, in the menu
_WITH_DIGIT = 9  # recent files that a digit key chooses
_WIDTH = 420  # px, of the dialog of preferences: the help fits into its lines


class WindowCommands(QObject):
    """Fills menus and tool bar of the window, and carries the commands out.

    Parameters
    ----------
    window : QMainWindow
        The window, whose docks exist already.
    actions : dict of str to QAction
        One action for each command, by its id.
    context : Context
        The project, and what happens to it.
    pages : PageStack
        The pages.
    view3d : View3D
        Its commands are in the menu View.
    corrections : CorrectionActions
        Fill the menu of corrections.
    """

    def __init__(
        self,
        window: QMainWindow,
        actions: dict[str, QAction],
        context: Context,
        pages: PageStack,
        view3d: View3D,
        corrections: CorrectionActions,
    ) -> None:
        super().__init__(window)
        self._window, self.actions, self._context = window, actions, context
        self._pages, self._view3d, self._corrections = pages, view3d, corrections
        self.parameter_files = ParameterFiles(context.runner, context.report_error, window)
        self.subjects = SubjectActions(context.document, context.jobs, context.runner, context.report_error, window)
        self.subjects.applied.connect(lambda: pages.page("skeleton"))
        menus = fill_menu_bar(window.menuBar(), actions)
        recent = RecentMenu(context.preferences, window)
        recent.chosen.connect(context.files.open)
        menus["&File"].insertMenu(actions["compare"], recent)
        menus["&File"].insertMenu(actions["compare"], SampleMenu(context.files, window))
        self._fill_edit(menus["&Edit"])
        self._fill_view(menus["&View"])
        bar = QToolBar(self.tr("Main tool bar"), window)
        bar.setObjectName("tools")
        fill_tool_bar(bar, actions)
        window.addToolBar(bar)
        for name, act in self._acts().items():
            actions[name].triggered.connect(act)
        stack = context.document.undo_stack
        for name, changed in (("undo", stack.canUndoChanged), ("redo", stack.canRedoChanged)):
            actions[name].setEnabled(False)  # nothing was changed yet
            changed.connect(actions[name].setEnabled)
            actions[name].triggered.connect(context.runner.catch_up)  # after the change
        for name, words, changed in (
            ("undo", self.tr("&Undo: {0}"), stack.undoTextChanged),
            ("redo", self.tr("&Redo: {0}"), stack.redoTextChanged),
        ):
            action = actions[name]
            changed.connect(partial(_say_what, action, words, action.text(), action.toolTip()))
        context.jobs.begun.connect(self._follow)
        context.jobs.ended.connect(self._follow)
        context.session.state_changed.connect(self._follow)
        context.session.other_changed.connect(self._follow)
        self._follow()

    def _fill_edit(self, menu: QMenu) -> None:
        menu.addSeparator()
        self.correct_menu = menu.addMenu(self.tr("&Correct"))
        self.correct_menu.setToolTipsVisible(True)
        self.correct_menu.aboutToShow.connect(lambda: self._corrections.fill(self.correct_menu))
        self._corrections.fill(self.correct_menu)

    def _fill_view(self, menu: QMenu) -> None:
        commands = self._view3d.commands
        menu.addSeparator()
        menu.addActions(list(commands.moves.values()))
        menu.addSeparator()
        menu.addActions(list(commands.hiding.values()))
        menu.addSeparator()
        commands.fill(menu)
        cameras = menu.addAction(self.tr("Cameras of a capture…"), self._context.cameras.choose)
        cameras.setToolTip(self.tr("Show the cameras in the settings of a capture that this recording was made with"))
        cameras.setStatusTip(cameras.toolTip())
        menu.addSeparator()
        for dock in self._window.findChildren(QDockWidget):
            menu.addAction(dock.toggleViewAction())

    def _acts(self) -> dict[str, Callable[[], object]]:
        """What each command does, by its id."""
        window, context, pages, undo_stack = self._window, self._context, self._pages, self._context.document.undo_stack
        return {
            "open": context.files.choose,
            "open_with": context.files.choose_with_options,
            "compare": context.files.choose_other,
            "compare_none": lambda: context.session.compare_with(None),
            "save": lambda: context.files.save(None),
            "save_as": lambda: context.files.save_as(None),
            "export": lambda: pages.page("export"),
            "quit": window.close,
            "undo": undo_stack.undo,
            "redo": undo_stack.redo,
            "select_all": self._select_all,
            "select_none": lambda: context.session.select(Selection()),
            "preferences": lambda: PreferencesDialog(context.preferences, window).open(),
            "run_step": self._run_step,
            "run_all": self.run_all,
            "subject": self.subjects.choose,
            "cancel": context.jobs.cancel,
            "load_parameters": self.parameter_files.choose,
            "save_parameters": self.parameter_files.save_as,
            "clear_parameters": self.parameter_files.clear,
            "next_page": lambda: pages.turn(1),
            "previous_page": lambda: pages.turn(-1),
            "tutorial": self._show_tutorial,
            "shortcuts": lambda: ShortcutsDialog((*self.actions.values(), *self._view3d.actions()), window).open(),
            "about": lambda: QMessageBox.about(window, self.tr("About skelgen"), versions()),
        }

    def run_all(self) -> None:
        """Run all that is missing, with the numbers that are given on the pages."""
        for page in self._pages.findChildren(StagePage):
            page.apply_number()
        self._context.runner.run_all()

    def _show_tutorial(self) -> None:
        for dock in self._window.findChildren(QDockWidget, "tutorial"):
            dock.show()
            dock.raise_()

    def _run_step(self) -> None:
        entry = self._pages.current
        page = self._pages.page(entry.key)
        if isinstance(page, StagePage):
            page.start()

    def _select_all(self) -> None:
        project = self._context.session.project
        if project is not None and project.has("labels"):
            self._context.session.select(Selection(frozenset(range(project.trajectories.n_markers))))

    def _follow(self) -> None:
        """Enable what can be done now."""
        session, is_busy = self._context.session, self._context.jobs.is_busy
        is_open = session.project is not None
        for name in ("save", "save_as", "export", "compare", "select_all", "run_step", "run_all", "subject"):
            self.actions[name].setEnabled(is_open and not is_busy)
        self.actions["compare_none"].setEnabled(session.other is not None)
        for name in ("open", "open_with"):
            self.actions[name].setEnabled(not is_busy)
        self.actions["cancel"].setEnabled(is_busy)


def _say_what(action: QAction, words: str, plain: str, tip: str, what: str) -> None:
    """Let a command of the menu say what it would change, in few words.

    Parameters
    ----------
    action : QAction
        The command.
    words : str
        Its text, with a place for what is changed.
    plain, tip : str
        Text and tool tip without that.
    what : str
        What would be changed; empty if nothing would be.
    """
    short = what if len(what) <= _MOST_LETTERS else what[: _MOST_LETTERS - 1] + "…"
    action.setText(words.format(short.replace("&", "&&")) if what else plain)
    action.setIconText(plain.replace("&", ""))  # in the tool bar, where there is no room
    action.setToolTip(as_rich_text(f"{tip}\n{what}") if what else tip)


class RecentMenu(QMenu):
    """Recent files, the last one first.

    Signals
    -------
    chosen(Path)
        The user wants this file.

    Parameters
    ----------
    preferences : Preferences
        Knows the files.
    parent : QWidget, optional
        Qt's parent.
    """

    chosen = Signal(object)

    def __init__(self, preferences: Preferences, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._preferences = preferences
        self.setTitle(self.tr("Open &recent"))
        self.setToolTipsVisible(True)
        self.aboutToShow.connect(self.fill)
        self.triggered.connect(self._choose)
        preferences.recent_changed.connect(self.fill)
        self.fill()

    def fill(self) -> None:
        """List the files as they are now."""
        self.clear()
        recent = self._preferences.recent
        for number, path in enumerate(recent, start=1):
            self.addAction(self._entry(number, path))
        self.addSeparator()
        clear = self.addAction(self.tr("&Clear this list"))
        clear.setToolTip(self.tr("Forget these names; the files stay"))
        clear.setEnabled(bool(recent))
        self.menuAction().setEnabled(bool(recent))

    def _entry(self, number: int, path: Path) -> QAction:
        name = path.name.replace("&", "&&")  # a single one would mark a key
        entry = QAction(f"&{number} {name}" if number <= _WITH_DIGIT else name, self)
        is_there = path.exists()
        entry.setEnabled(is_there)
        entry.setToolTip(as_rich_text(str(path) if is_there else self.tr("{0}: no longer there").format(path)))
        entry.setData(path)
        return entry

    def _choose(self, entry: QAction) -> None:
        path = entry.data()
        if isinstance(path, Path):
            self.chosen.emit(path)
        else:
            self._preferences.forget_recent()


class PreferencesDialog(QDialog):
    """Changes preferences when it is accepted.

    Parameters
    ----------
    preferences : Preferences
        What is changed.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, preferences: Preferences, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._preferences = preferences
        self.form = stage_form(PreferenceValues, self)
        self.buttons = answer_buttons(self, QDialogButtonBox.StandardButton.Ok)
        self.setWindowTitle(self.tr("Preferences"))
        self.setMinimumWidth(_WIDTH)
        column(self, (self.form, self.buttons))
        self.form.changed.connect(self._follow)
        self.form.set_values(preferences.values.as_mapping())

    def accept(self) -> None:
        """Keep what is entered."""
        self._preferences.change(PreferenceValues.from_mapping(self.form.values()))
        super().accept()

    def _follow(self) -> None:
        self.buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(not self.form.problem())


_TEXT = Path(__file__).with_name("tutorial.md")


class Tutorial(QTextBrowser):
    """Shows the first steps.

    Parameters
    ----------
    parent : QWidget, optional
        Qt's parent.

    Signals
    -------
    asked(str, str)
        A link was followed: what kind it is, ``do`` or ``sample``, and the command or sample that it names.
    """

    asked = Signal(str, str)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setOpenLinks(False)
        self.setMarkdown(_TEXT.read_text(encoding="utf-8"))
        put_texts(self)
        self.anchorClicked.connect(self._follow)

    def _follow(self, address: QUrl) -> None:
        self.asked.emit(address.scheme(), address.path())
