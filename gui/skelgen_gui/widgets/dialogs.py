"""Two dialogs: all keyboard shortcuts with a line to search them, and the preferences."""

from __future__ import annotations

from collections.abc import Iterable

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QHeaderView, QLineEdit, QTableWidget, QTableWidgetItem, QWidget

from skelgen_gui.widgets.forms import stage_form
from skelgen_gui.widgets.layouts import column, describe
from skelgen_gui.widgets.preferences import Preferences, PreferenceValues

_SIZE = (640, 560)  # px

_WIDTH = 420  # px: the help fits into its lines


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
        self.search.setPlaceholderText(self.tr("Search"))
        describe(self.search, self.tr("Search the shortcuts"), self.tr("Part of a command or a key"))
        self.search.setClearButtonEnabled(True)
        self.search.textChanged.connect(self._filter)
        self.table.setHorizontalHeaderLabels([self.tr("Command"), self.tr("Key"), self.tr("What it does")])
        self.table.horizontalHeader().setSectionResizeMode(2, QHeaderView.ResizeMode.Stretch)
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QTableWidget.EditTrigger.NoEditTriggers)
        self.table.setSelectionBehavior(QTableWidget.SelectionBehavior.SelectRows)
        self.table.setAlternatingRowColors(True)
        self.table.setTabKeyNavigation(False)
        self.table.setAccessibleName(self.tr("Keyboard shortcuts"))
        self.table.setToolTip(self.tr("Single letters work while the 3-D view or the timeline has the focus"))

    def _add(self, action: QAction) -> None:
        row = self.table.rowCount()
        self.table.insertRow(row)
        name = action.text().replace("&", "").removesuffix("…")  # without its mark of a key
        key = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
        for number, text in enumerate((name, key, action.statusTip() or action.toolTip())):
            item = QTableWidgetItem(text)
            item.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable)
            self.table.setItem(row, number, item)

    def _filter(self, text: str) -> None:
        for row in range(self.table.rowCount()):
            cells = (self.table.item(row, number) for number in range(self.table.columnCount()))
            self.table.setRowHidden(row, not any(text.lower() in cell.text().lower() for cell in cells if cell))


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
        standard = QDialogButtonBox.StandardButton
        self.buttons = QDialogButtonBox(standard.Ok | standard.Cancel, parent=self)
        self.setWindowTitle(self.tr("Preferences"))
        self.setMinimumWidth(_WIDTH)
        column(self, (self.form, self.buttons))
        self.buttons.accepted.connect(self.accept)
        self.buttons.rejected.connect(self.reject)
        self.form.changed.connect(self._follow)
        self.form.set_values(preferences.values.as_mapping())

    def accept(self) -> None:
        """Keep what is entered."""
        self._preferences.change(PreferenceValues.from_mapping(self.form.values()))
        super().accept()

    def _follow(self) -> None:
        self.buttons.button(QDialogButtonBox.StandardButton.Ok).setEnabled(not self.form.problem())
