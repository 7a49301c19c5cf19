"""All commands of the window in one table, from which menus, tool bar, keys and their list are made; and where keys go.

Keys are Qt's portable texts; Ctrl is Cmd on a Mac. They hold in the whole window: lists, buttons and fields keep the
keys that they need themselves (`KeyKeeper`). Texts are translated in the context ``Commands`` as actions are made. A
ring surrounds what has the focus.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QRectF, Qt
from PySide6.QtGui import QAction, QKeyEvent, QKeySequence, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import (
    QAbstractButton,
    QAbstractItemView,
    QAbstractSlider,
    QApplication,
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFocusFrame,
    QHeaderView,
    QLineEdit,
    QMenu,
    QMenuBar,
    QTabBar,
    QTableWidget,
    QTableWidgetItem,
    QToolBar,
    QWidget,
)

from skelgen.files import read_table
from skelgen_gui.widgets.layouts import column, put_texts

_SIZE = (640, 560)  # px, of the dialog

SEPARATOR = "-"
"""Stands for a line between the entries of a menu."""


@dataclass(frozen=True)
class Command:
    """One command of the window.

    Attributes
    ----------
    id : str
        Name in the program, e.g. ``open``; `SEPARATOR` for a line.
    menu : str
        Title of its menu.
    text : str
        Text in the menu, with ``&`` before its key.
    key : str
        Default key, empty for none; another one behind a semicolon.
    tip : str
        What it does, in one sentence.
    in_tool_bar : bool
        Whether the tool bar has it too.
    is_checkable : bool
        Whether it is on or off.
    """

    id: str
    menu: str = ""
    text: str = ""
    key: str = ""
    tip: str = ""
    in_tool_bar: bool = False
    is_checkable: bool = False


COMMANDS = tuple(
    Command(menu=menu, **entry) for menu, entries in read_table(__file__, "commands").items() for entry in entries
)
"""All commands, in the order of the menus."""


def make_actions(parent: QObject) -> dict[str, QAction]:
    """Return one action per command, by its id.

    Parameters
    ----------
    parent : QObject
        Owner of the actions.
    """
    return {command.id: make_action(command, parent) for command in COMMANDS if command.id != SEPARATOR}


def fill_menu_bar(bar: QMenuBar, actions: Mapping[str, QAction]) -> dict[str, QMenu]:
    """Fill a menu bar, and return its menus by their title in the table, to which more can be added.

    Parameters
    ----------
    bar : QMenuBar
        The menu bar.
    actions : mapping of str to QAction
        One action for each command, by its id.
    """
    menus: dict[str, QMenu] = {}
    for command in COMMANDS:
        menu = menus.get(command.menu)
        if menu is None:
            menu = menus[command.menu] = bar.addMenu(_translated(command.menu))
            menu.setToolTipsVisible(True)
        if command.id == SEPARATOR:
            menu.addSeparator()
        else:
            menu.addAction(actions[command.id])
    return menus


def fill_tool_bar(bar: QToolBar, actions: Mapping[str, QAction]) -> None:
    """Add the actions that belong into the tool bar.

    Parameters
    ----------
    bar : QToolBar
        The tool bar.
    actions : mapping of str to QAction
        One action for each command, by its id.
    """
    for command in COMMANDS:
        if command.in_tool_bar:
            bar.addAction(actions[command.id])


def make_action(command: Command, parent: QObject) -> QAction:
    """Return the action of a command.

    Parameters
    ----------
    command : Command
        What it is called, and its keys.
    parent : QObject
        Owner of the action.
    """
    action = QAction(_translated(command.text), parent)
    action.setObjectName(command.id)
    action.setCheckable(command.is_checkable)
    action.setShortcuts(QKeySequence.listFromString(command.key))
    action.setStatusTip(_translated(command.tip))
    key = _keys_of(action)
    action.setToolTip(f"{_translated(command.tip)} ({key})" if key else _translated(command.tip))
    return action


def _keys_of(action: QAction) -> str:
    return ", ".join(key.toString(QKeySequence.SequenceFormat.NativeText) for key in action.shortcuts())


def _translated(text: str) -> str:
    return QCoreApplication.translate("Commands", text)


class ShortcutsDialog(QDialog):
    """A table of all keys and what they do.

    Parameters
    ----------
    actions : iterable of QAction
        Of the window and its views; those without a key are passed over.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, actions: Iterable[QAction], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(self.tr("Keyboard shortcuts"))
        self.search = QLineEdit(self)
        self.table = QTableWidget(0, 3, self)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, parent=self)
        buttons.rejected.connect(self.reject)
        column(self, (self.search, self.table, buttons))
        self._describe()
        for action in dict.fromkeys(actions):
            if not action.shortcut().isEmpty():
                self._add(action)
        self.table.resizeColumnsToContents()
        self.resize(*_SIZE)

    def _describe(self) -> None:
        self.search.setClearButtonEnabled(True)
        self.search.textChanged.connect(self._filter)
        self.table.setHorizontalHeaderLabels([self.tr("Command"), self.tr("Key"), self.tr("What it does")])
        self.table.horizontalHeader().setSectionResizeMode(2, QHeaderView.ResizeMode.Stretch)
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.table.setSelectionBehavior(QTableWidget.SelectionBehavior.SelectRows)
        self.table.setAlternatingRowColors(True)
        self.table.setTabKeyNavigation(False)
        put_texts(self)

    def _add(self, action: QAction) -> None:
        row = self.table.rowCount()
        self.table.insertRow(row)
        name = action.text().replace("&", "").removesuffix("…")  # without its mark of a key
        key = _keys_of(action)
        for number, text in enumerate((name, key, action.statusTip() or action.toolTip())):
            item = QTableWidgetItem(text)
            item.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable)
            self.table.setItem(row, number, item)

    def _filter(self, text: str) -> None:
        for row in range(self.table.rowCount()):
            cells = (self.table.item(row, number) for number in range(self.table.columnCount()))
            self.table.setRowHidden(row, not any(text.lower() in cell.text().lower() for cell in cells if cell))


_Key = Qt.Key

ARROW_KEYS = frozenset({_Key.Key_Left, _Key.Key_Right, _Key.Key_Up, _Key.Key_Down})
"""Keys that go about."""

_MOVES = ARROW_KEYS | {_Key.Key_Home, _Key.Key_End, _Key.Key_PageUp, _Key.Key_PageDown}
_MOVED = (QAbstractItemView, QComboBox, QAbstractSlider, QTabBar)
_PRESSED = (QAbstractButton, QComboBox, QAbstractItemView)
_COMMANDS = Qt.KeyboardModifier.ControlModifier | Qt.KeyboardModifier.AltModifier | Qt.KeyboardModifier.MetaModifier


class KeyKeeper(QObject):
    """Leaves keys to the widget with the focus that would otherwise go to the window's commands.

    Lists and the like keep the keys that go about; Space presses a button that was reached by the keyboard, while after
    a click it is the window's; any widget keeps the keys of its attribute ``own_keys``. Fields for text see to theirs.
    """

    def watch(self, window: QWidget) -> None:
        """Follow the keys of a window, or of a dock that may float."""
        window.installEventFilter(self)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Accept what the widget with the focus needs: Qt then sends it the key."""
        if event.type() != QEvent.Type.ShortcutOverride or not isinstance(event, QKeyEvent):
            return False
        focus = QApplication.focusWidget()
        if focus is None or event.modifiers() & _COMMANDS or not _needs(focus, _Key(event.key())):
            return False
        event.accept()
        return True


def _needs(widget: QWidget, key: Qt.Key) -> bool:
    own: frozenset[Qt.Key] = getattr(widget, "own_keys", frozenset())
    if key in own or (key in _MOVES and isinstance(widget, _MOVED)):
        return True
    by_keyboard = widget.window().testAttribute(Qt.WidgetAttribute.WA_KeyboardFocusChange)
    return key == _Key.Key_Space and by_keyboard and isinstance(widget, _PRESSED)


_WIDTH = 2.0  # px
_ROUND = 4.0  # px


class FocusRing(QFocusFrame):
    """A ring around the widget that has the focus, shown while keys move it.

    Parameters
    ----------
    window : QWidget
        In which the focus is followed; docks of it that float are followed, too.
    """

    def __init__(self, window: QWidget) -> None:
        super().__init__(window)
        self._window = window
        self.hide()  # else it is shown with the window, around nothing
        QApplication.instance().focusChanged.connect(self._follow)  # type: ignore[union-attr]

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the ring in the colour of what is chosen: it stands out on any ground."""
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            painter.setPen(QPen(self.palette().color(QPalette.ColorRole.Highlight), _WIDTH))
            half = _WIDTH / 2
            painter.drawRoundedRect(QRectF(self.rect()).adjusted(half, half, -half, -half), _ROUND, _ROUND)

    def _follow(self, _: QWidget | None, now: QWidget | None) -> None:
        """Go to where the focus is now, if keys brought it there."""
        is_here = now is not None and (now.window() is self._window or self._window.isAncestorOf(now.window()))
        by_keys = is_here and now is not None and now.window().testAttribute(Qt.WidgetAttribute.WA_KeyboardFocusChange)
        self.setWidget(now if by_keys else None)  # type: ignore[arg-type]
