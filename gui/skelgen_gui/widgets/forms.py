"""Forms that are generated from declared parameters: the basic ones at once, the others behind 'Advanced'."""

from __future__ import annotations

import html
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, Signal
from PySide6.QtWidgets import QGridLayout, QLabel, QPushButton, QToolButton, QWidget

from skelgen.errors import ParameterError
from skelgen.parameters import Declaration, ParameterValue, StageParameters
from skelgen_gui.widgets.fields import Expander, choice_of, editor_for, title_of
from skelgen_gui.widgets.layouts import bare_column, put_texts, wrap
from skelgen_gui.widgets.painting import CHANGED_ROLE, PROBLEM_ROLE

# Returns the clean value of what was entered for a declaration, or raises `ParameterError`
_Check = Callable[[Declaration, Any], Any]

_NAME_COLUMN, _EDITOR_COLUMN, _UNIT_COLUMN, _RESET_COLUMN = range(4)  # columns of the grid that a row fills

_CHANGED_MARK = "• "  # stands before the name of a value that is not the default


_LINES_PER_ROW = 2  # the editor, and what is wrong with it
_HELP_LINES = 4


class FormRow(QObject):
    """One declared value in a form.

    Signals
    -------
    edited()
        The user, or the form, entered something.
    looked_at()
        The user came to the editor, with the keyboard or the mouse.

    Attributes
    ----------
    is_changed : bool
        Whether it differs from the default, or is wrong.

    Parameters
    ----------
    declaration : Declaration
        What is asked for.
    check : callable (declaration, entered) -> value
        Checks what is entered.
    grid : QGridLayout
        Gets the row's widgets.
    line : int
        First of the two lines of the grid that are filled.
    parent : QWidget
        The form.
    """

    edited = Signal()
    looked_at = Signal()

    def __init__(self, declaration: Declaration, check: _Check, grid: QGridLayout, line: int, parent: QWidget) -> None:
        super().__init__(parent)
        self.declaration = declaration
        self._title = title_of(declaration)
        self._check = check
        self.is_changed = False
        self.editor = editor_for(declaration, parent)
        self.label = QLabel(parent)
        self.reset_button = QToolButton(parent)
        self._unit = QLabel(declaration.unit, parent)
        self._problem = QLabel(parent)
        for column, widget in enumerate((self.label, self.editor, self._unit, self.reset_button)):
            grid.addWidget(widget, line, column)
        grid.addWidget(self._problem, line + 1, _EDITOR_COLUMN, 1, _RESET_COLUMN - _EDITOR_COLUMN + 1)
        policy = self.reset_button.sizePolicy()
        policy.setRetainSizeWhenHidden(True)
        self.reset_button.setSizePolicy(policy)
        self._describe()
        self.editor.edited.connect(self._follow)
        self.editor.installEventFilter(self)
        self.reset_button.clicked.connect(self.reset)
        self._follow()

    @property
    def problem(self) -> str:
        """What is wrong with what is entered; empty if nothing is."""
        return self._problem.text()

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
        """Notify the form which editor the user looks at."""
        if event.type() in {QEvent.Type.FocusIn, QEvent.Type.Enter}:
            self.looked_at.emit()
        return False

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
        wrap(self._problem)
        self._problem.setForegroundRole(PROBLEM_ROLE)

    def _default_text(self) -> str:
        default = self.declaration.default
        if self.declaration.choices:
            return choice_of(self.declaration, str(default))
        if isinstance(default, bool):
            return self.tr("yes") if default else self.tr("no")
        if default == "":
            return self.tr("empty")
        number = f"{default:g}" if isinstance(default, float) else str(default)
        return f"{number} {self.declaration.unit}".rstrip()

    def _follow(self) -> None:
        """Show what is wrong, and mark what is changed."""
        try:
            self.is_changed = bool(self.value() != self.declaration.default)
            self._problem.clear()
        except ParameterError as error:
            self.is_changed = True
            self._problem.setText(str(error))
        changed = self.is_changed
        self._problem.setVisible(bool(self.problem))
        self.label.setText((_CHANGED_MARK if changed else "") + self._title)
        self.label.setForegroundRole(CHANGED_ROLE if changed else self.editor.foregroundRole())
        self.editor.setAccessibleDescription(self.problem or (self.tr("changed") if changed else ""))
        self.reset_button.setVisible(changed)
        self.edited.emit()


def stage_form(declared: type[StageParameters], parent: QWidget | None = None) -> ParameterForm:
    """Return the form of a stage's parameters; it checks values as the stage does, beyond single bounds.

    Parameters
    ----------
    declared : type of StageParameters
        The parameters of the stage.
    parent : QWidget, optional
        Qt's parent.
    """

    def check(declaration: Declaration, entered: Any) -> Any:
        return getattr(declared.from_mapping({declaration.name: entered}), declaration.name)

    return ParameterForm(declared.declarations(), parent, check)


class ParameterForm(QWidget):
    """One line for each declared value, with errors beside it.

    Signals
    -------
    changed()
        Something is entered, allowed or not; ask `problem`.

    Parameters
    ----------
    declarations : iterable of Declaration
        What is asked for; if none is basic, all are shown at once.
    parent : QWidget, optional
        Qt's parent.
    check : callable (declaration, entered) -> value, optional
        Checks what is entered; by default the declaration does.
    """

    changed = Signal()

    def __init__(
        self, declarations: Iterable[Declaration], parent: QWidget | None = None, check: _Check = Declaration.check
    ) -> None:
        super().__init__(parent)
        declarations = tuple(declarations)
        basic = [entry for entry in declarations if entry.basic] or list(declarations)
        self._is_filling = False
        wide = self.fontMetrics().horizontalAdvance  # names and units are as wide in both parts of the form
        self._name_width = max((wide(_CHANGED_MARK + title_of(entry)) for entry in declarations), default=0)
        self._unit_width = max((wide(entry.unit) for entry in declarations), default=0)
        self._boxes = QWidget(self), QWidget(self)
        self._basic = self._filled(self._boxes[0], basic, check)
        tip = self.tr("Show or hide the parameters that most takes do not need")
        self._expander = Expander(self._boxes[1], tip, self)  # each when it is its turn: Tab goes in this order
        self._advanced = self._filled(self._boxes[1], [entry for entry in declarations if entry not in basic], check)
        self._help = QLabel(self)
        wrap(self._help, self.tr("What the chosen parameter means"))
        self._help.setAlignment(Qt.AlignmentFlag.AlignTop)
        self._help.setMinimumHeight(_HELP_LINES * self._help.fontMetrics().lineSpacing())  # the form does not jump
        self._reset_all = QPushButton(self.tr("Reset all"), self)
        self._lay_out()
        self._help.setText(self._basic[0].help_text() if self._basic else "")
        self._follow()

    @property
    def rows(self) -> dict[str, FormRow]:
        """The lines of the form by name."""
        return {row.declaration.name: row for row in (*self._basic, *self._advanced)}

    def values(self) -> dict[str, ParameterValue]:
        """Return the value of every name, or raise the first `ParameterError`."""
        return {name: row.value() for name, row in self.rows.items()}

    def set_values(self, values: Mapping[str, object]) -> None:
        """Show some values, allowed or not; names that the form does not have, as older files hold, are passed over."""
        rows = self.rows
        self._is_filling = True
        for name in values.keys() & rows.keys():
            rows[name].show_value(values[name])
        self._is_filling = False
        self._follow()

    def problem(self) -> str:
        """Return the first sentence on what is wrong, empty if all is well."""
        return next((row.problem for row in self.rows.values() if row.problem), "")

    @property
    def defaults(self) -> dict[str, ParameterValue]:
        """The default of every name."""
        return {name: row.declaration.default for name, row in self.rows.items()}

    def reset(self) -> None:
        """Return to all defaults."""
        self.set_values(self.defaults)

    def _filled(self, widget: QWidget, declarations: Iterable[Declaration], check: _Check) -> list[FormRow]:
        grid = QGridLayout(widget)
        grid.setColumnStretch(1, 1)
        grid.setContentsMargins(0, 0, 0, 0)
        grid.setColumnMinimumWidth(_NAME_COLUMN, self._name_width)
        grid.setColumnMinimumWidth(_UNIT_COLUMN, self._unit_width)
        rows = [FormRow(entry, check, grid, _LINES_PER_ROW * index, widget) for index, entry in enumerate(declarations)]
        for row in rows:
            row.edited.connect(self._follow_edit)
            row.looked_at.connect(lambda row=row: self._help.setText(row.help_text()))
        return rows

    def _lay_out(self) -> None:
        layout = bare_column(self, (self._boxes[0], self._expander, self._boxes[1], self._help))
        layout.addWidget(self._reset_all, alignment=Qt.AlignmentFlag.AlignRight)
        layout.addStretch(1)
        put_texts(self)
        self._reset_all.clicked.connect(self.reset)
        self._expander.setVisible(bool(self._advanced))

    def _follow_edit(self) -> None:
        if not self._is_filling:
            self._follow()

    def _follow(self) -> None:
        self._reset_all.setEnabled(any(row.is_changed for row in self.rows.values()))
        n_changed = sum(row.is_changed for row in self._advanced)
        counts = self.tr("{0}, {1} changed") if n_changed else "{0}"
        counts = counts.format(len(self._advanced), n_changed)
        self._expander.show_text(self.tr("Advanced ({0})").format(counts))
        if any(row.problem for row in self._advanced):
            self._expander.setChecked(True)
        self.changed.emit()
