"""One declared value in a form: its name, editor and unit, what is wrong with it, and a way back to the default."""

from __future__ import annotations

import html
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, Signal
from PySide6.QtWidgets import QGridLayout, QLabel, QToolButton, QWidget

from skelgen.errors import ParameterError
from skelgen.parameters import Declaration
from skelgen_gui.fields import editor_for
from skelgen_gui.theme import CHANGED_ROLE, PROBLEM_ROLE

Check = Callable[[Declaration, Any], Any]
"""Returns the clean value of what was entered for a declaration, or raises `ParameterError`."""

NAME_COLUMN, EDITOR_COLUMN, UNIT_COLUMN, RESET_COLUMN = range(4)
"""Columns of the grid that a row fills."""

CHANGED_MARK = "• "
"""Stands before the name of a value that is not the default."""


def title_of(declaration: Declaration) -> str:
    """Return the name as a person reads it."""
    return QCoreApplication.translate("Parameters", declaration.name.replace("_", " ").capitalize())


class FormRow(QObject):
    """One declared value in a form.

    Signals
    -------
    edited()
        The user, or the form, entered something.
    looked_at()
        The user came to the editor, with the keyboard or the mouse.

    Parameters
    ----------
    declaration : Declaration
        What is asked for.
    check : callable (declaration, entered) -> value
        Judges what is entered.
    grid : QGridLayout
        Gets the row's widgets.
    line : int
        First of the two lines of the grid that are filled.
    parent : QWidget
        The form.
    """

    edited = Signal()
    looked_at = Signal()

    def __init__(self, declaration: Declaration, check: Check, grid: QGridLayout, line: int, parent: QWidget) -> None:
        super().__init__(parent)
        self.declaration = declaration
        self._title = title_of(declaration)
        self._check = check
        self._is_changed = False
        self.editor = editor_for(declaration, parent)
        self.label = QLabel(parent)
        self.reset_button = QToolButton(parent)
        self._unit = QLabel(declaration.unit, parent)
        self._problem = QLabel(parent)
        self._place(grid, line)
        self._describe()
        self.editor.edited.connect(self._follow)
        self.editor.installEventFilter(self)
        self.reset_button.clicked.connect(self.reset)
        self._follow()

    @property
    def problem(self) -> str:
        """What is wrong with what is entered; empty if nothing is."""
        return self._problem.text()

    @property
    def is_changed(self) -> bool:
        """Whether it differs from the default, or is wrong."""
        return self._is_changed

    def value(self) -> Any:
        """Return the value, or raise `ParameterError`."""
        return self._check(self.declaration, self.editor.entered())

    def show_value(self, value: Any) -> None:
        """Show a value, allowed or not."""
        self.editor.show_value(value)

    def reset(self) -> None:
        """Return to the default."""
        self.show_value(self.declaration.default)

    def help_text(self) -> str:
        """Return what the value means, what is allowed, and its default."""
        declaration = self.declaration
        help_ = QCoreApplication.translate("Parameters", declaration.help)
        sentences = [help_[:1].upper() + help_[1:].rstrip(".") + "."]
        if declaration.bounds and not declaration.choices:
            bounds = declaration.bounds.replace(" .. inf", self.tr(" or more"))
            sentences.append(self.tr("Allowed: {0}.").format(f"{bounds} {declaration.unit}".rstrip()))
        if declaration.default != "":
            sentences.append(self.tr("Default: {0}.").format(self._default_text()))
        return " ".join(sentences)

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Tell the form which editor is looked at."""
        if event.type() in {QEvent.Type.FocusIn, QEvent.Type.Enter}:
            self.looked_at.emit()
        return False

    def _place(self, grid: QGridLayout, line: int) -> None:
        for column, widget in enumerate((self.label, self.editor, self._unit, self.reset_button)):
            grid.addWidget(widget, line, column)
        grid.addWidget(self._problem, line + 1, EDITOR_COLUMN, 1, RESET_COLUMN - EDITOR_COLUMN + 1)
        policy = self.reset_button.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.reset_button.setSizePolicy(policy)

    def _describe(self) -> None:
        help_ = self.help_text()
        for widget in (self.editor, self.label):
            widget.setToolTip(f"<qt>{html.escape(help_)}</qt>")  # as rich text, so that Qt wraps it
            widget.setWhatsThis(help_)
        self.editor.setAccessibleName(self._title)
        self.editor.setObjectName(self.declaration.name)
        self.label.setBuddy(self.editor)
        self.reset_button.setText("↺")
        self.reset_button.setAutoRaise(True)
        self.reset_button.setAccessibleName(self.tr("Reset {0}").format(self._title))
        self.reset_button.setToolTip(self.tr("Back to the default, {0}").format(self._default_text()))
        self._problem.setWordWrap(True)
        self._problem.setForegroundRole(PROBLEM_ROLE)
        self._problem.setTextFormat(Qt.TextFormat.PlainText)

    def _default_text(self) -> str:
        default = self.declaration.default
        if isinstance(default, bool):
            return self.tr("yes") if default else self.tr("no")
        if default == "":
            return self.tr("empty")
        number = f"{default:g}" if isinstance(default, float) else str(default)
        return f"{number} {self.declaration.unit}".rstrip()

    def _follow(self) -> None:
        """Say what is wrong, and mark what is changed."""
        try:
            self._is_changed = bool(self.value() != self.declaration.default)
            self._problem.clear()
        except ParameterError as error:
            self._is_changed = True
            self._problem.setText(str(error))
        changed = self._is_changed
        self._problem.setVisible(bool(self.problem))
        self.label.setText((CHANGED_MARK if changed else "") + self._title)
        self.label.setForegroundRole(CHANGED_ROLE if changed else self.editor.foregroundRole())
        self.editor.setAccessibleDescription(self.problem or (self.tr("changed") if changed else ""))
        self.reset_button.setVisible(changed)
        self.edited.emit()
