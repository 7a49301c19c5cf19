"""A number that a stage finds, or that the user gives because he knows it."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QButtonGroup, QHBoxLayout, QLabel, QRadioButton, QSpinBox, QWidget

MOST = 100_000
"""The largest number that can be given."""


class FoundOrGiven(QWidget):
    """Found, or given: two buttons and a number.

    Signals
    -------
    changed()
        Another wish.

    Parameters
    ----------
    what : str
        What is counted, e.g. ``Number of limbs``.
    parent : QWidget, optional
        Qt's parent.
    """

    changed = Signal()

    def __init__(self, what: str, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._found = QRadioButton(self)
        self._given = QRadioButton(self.tr("given:"), self)
        self._number = QSpinBox(self)
        self._number.setRange(1, MOST)
        self._group = QButtonGroup(self)
        self._lay_out(QLabel(what, self))
        self._describe(what)
        self._found.setChecked(True)
        self.show_found(None)
        self._follow()
        self._given.toggled.connect(self._follow)
        self._number.valueChanged.connect(self.changed)

    def value(self) -> int | None:
        """Return the number that is given, or None if it is to be found."""
        return self._number.value() if self._given.isChecked() else None

    def set_value(self, value: int | None) -> None:
        """Give a number, or leave it to be found."""
        if value is not None:
            self._number.setValue(value)
        (self._found if value is None else self._given).setChecked(True)

    def show_found(self, number: int | None) -> None:
        """Say which number was found, and offer it as the one to give; None before the stage has run."""
        self._found.setText(self.tr("found") if number is None else self.tr("found: {0}").format(number))
        if number is not None and self.value() is None:
            self._number.setValue(number)

    def _lay_out(self, title: QLabel) -> None:
        layout = QHBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        for widget in (title, self._found, self._given, self._number):
            layout.addWidget(widget)
        layout.addStretch(1)
        self._group.addButton(self._found)
        self._group.addButton(self._given)

    def _describe(self, what: str) -> None:
        self._found.setAccessibleName(self.tr("{0}: found").format(what))
        self._found.setToolTip(self.tr("The number is found from the recording"))
        self._given.setAccessibleName(self.tr("{0}: given").format(what))
        self._given.setToolTip(self.tr("You know the number: the stage obeys it"))
        self._number.setAccessibleName(what)
        self._number.setToolTip(self.tr("The number that you know"))

    def _follow(self) -> None:
        self._number.setEnabled(self._given.isChecked())
        self.changed.emit()
