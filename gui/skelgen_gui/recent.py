"""The menu of recent files; those that are no longer there are grey."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QMenu, QWidget

from skelgen_gui.preferences import Preferences
from skelgen_gui.tips import rich

_WITH_DIGIT = 9  # entries that a digit key chooses


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
        entry.setToolTip(rich(str(path) if is_there else self.tr("{0}: no longer there").format(path)))
        entry.setData(path)
        return entry

    def _choose(self, entry: QAction) -> None:
        path = entry.data()
        if isinstance(path, Path):
            self.chosen.emit(path)
        else:
            self._preferences.forget_recent()
