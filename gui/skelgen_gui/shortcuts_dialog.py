"""The list of all keys, with a line to search it."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction, QKeySequence
from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QDialogButtonBox,
    QHeaderView,
    QLineEdit,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from skelgen_gui.shortcuts import COMMANDS, Command, plain_text

_SIZE = (640, 560)  # px


class ShortcutsDialog(QDialog):
    """What every key does.

    Parameters
    ----------
    actions : mapping of str to QAction
        From `make_actions`; their keys may differ from the table's defaults.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, actions: Mapping[str, QAction], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setWindowTitle(self.tr("Keyboard shortcuts"))
        self.search = QLineEdit(self)
        self.table = QTableWidget(0, 3, self)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, parent=self)
        buttons.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        for widget in (self.search, self.table, buttons):
            layout.addWidget(widget)
        self._describe()
        for command in COMMANDS:
            if command.id in actions and not actions[command.id].shortcut().isEmpty():
                self._add(command, actions[command.id])
        self.table.resizeColumnsToContents()
        self.resize(*_SIZE)

    def _describe(self) -> None:
        self.search.setPlaceholderText(self.tr("Search"))
        self.search.setAccessibleName(self.tr("Search the shortcuts"))
        self.search.setToolTip(self.tr("Part of a command or a key"))
        self.search.setClearButtonEnabled(True)
        self.search.textChanged.connect(self._filter)
        self.table.setHorizontalHeaderLabels([self.tr("Command"), self.tr("Key"), self.tr("What it does")])
        self.table.horizontalHeader().setSectionResizeMode(2, QHeaderView.ResizeMode.Stretch)
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.table.setAlternatingRowColors(True)
        self.table.setTabKeyNavigation(False)
        self.table.setAccessibleName(self.tr("Keyboard shortcuts"))
        self.table.setToolTip(self.tr("Single letters work while the 3-D view or the timeline has the focus"))

    def _add(self, command: Command, action: QAction) -> None:
        row = self.table.rowCount()
        self.table.insertRow(row)
        key = action.shortcut().toString(QKeySequence.SequenceFormat.NativeText)
        for column, text in enumerate((plain_text(command), key, action.statusTip())):
            item = QTableWidgetItem(text)
            item.setFlags(Qt.ItemFlag.ItemIsEnabled | Qt.ItemFlag.ItemIsSelectable)
            self.table.setItem(row, column, item)

    def _filter(self, text: str) -> None:
        for row in range(self.table.rowCount()):
            cells = (self.table.item(row, column) for column in range(self.table.columnCount()))
            self.table.setRowHidden(row, not any(text.lower() in cell.text().lower() for cell in cells if cell))
