"""One editor for each type of declared value; each shows whatever it is given, allowed or not.

`entered` returns what stands in an editor, and the declaration checks it: a value that is not allowed can be typed, is
marked as wrong, and is not silently replaced. Parameters and their choices are called as a person says them; what has
no such words here is plain already. Files, command line and documentation keep the names: they stand in the tool tip.
"""

import math
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QCoreApplication, QEvent, QObject, Qt, Signal
from PySide6.QtGui import QValidator
from PySide6.QtWidgets import (
    QAbstractSpinBox,
    QButtonGroup,
    QCheckBox,
    QComboBox,
    QDoubleSpinBox,
    QFileDialog,
    QLabel,
    QLineEdit,
    QPushButton,
    QRadioButton,
    QSpinBox,
    QToolButton,
    QWidget,
)

from skelgen.files import read_table
from skelgen.parameters import Declaration
from skelgen_gui.widgets.layouts import bare_column, describe, row_of

_DIGITS = 12  # of a number that was stepped to: hides that 0.1 + 0.2 is not 0.3
_EXACT = 1e15  # whole numbers below are shown with all their digits
_FINENESS = 1  # a step changes the second digit of a number: 0.8 -> 0.81, 100 -> 110
_STEP_FROM_ZERO = 0.1

_WORDS = read_table(__file__, "words")
_MOST = 100_000  # the largest number that can be given


class _NumberBox(QAbstractSpinBox):
    """A number with arrows; unlike Qt's own it shows 1e-12 as such and lets a value out of bounds stand."""

    edited = Signal()

    def __init__(self, declaration: Declaration, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._declaration = declaration
        self.lineEdit().textChanged.connect(self.edited)

    def entered(self) -> Any:
        """Return what stands in the box, as text."""
        return self.text()

    def show_value(self, value: Any) -> None:
        """Show a number, or whatever else is given as its text."""
        is_whole = isinstance(value, float) and value.is_integer() and abs(value) < _EXACT
        self.lineEdit().setText(f"{value:.0f}" if is_whole else str(value))

    def stepBy(self, steps: int) -> None:
        """Go up or down, within the bounds; a text that is no number stays."""
        try:
            value = float(self.text())
        except ValueError:
            return
        self.show_value(stepped(self._declaration, value, steps))
        self.selectAll()

    def stepEnabled(self) -> QAbstractSpinBox.StepEnabledFlag:
        """Let both arrows work."""
        return QAbstractSpinBox.StepEnabledFlag.StepUpEnabled | QAbstractSpinBox.StepEnabledFlag.StepDownEnabled

    def validate(self, text: str, position: int) -> tuple[QValidator.State, str, int]:
        """Let every text be typed; the form shows what is wrong with it."""
        return QValidator.State.Acceptable, text, position


_LETTERS = 4  # of a choice, at least: the options of an export fit into the narrowest window


class ChoiceBox(QComboBox):
    """One of several choices, in plain words; the tool tip of each says its name in files."""

    edited = Signal()

    def __init__(self, declaration: Declaration, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        for choice in declaration.choices:
            self.addItem(choice_of(declaration, choice), choice)
            self.setItemData(self.count() - 1, choice, Qt.ItemDataRole.ToolTipRole)
        keep_narrow(self, _LETTERS)
        self.currentTextChanged.connect(self.edited)

    def entered(self) -> Any:
        """Return the name of what is chosen."""
        return self.currentData()

    def show_value(self, value: Any) -> None:
        """Choose by name; one that is unknown is added, and the form shows that it is not allowed."""
        if self.findData(str(value)) < 0:
            self.addItem(str(value), str(value))
        self.setCurrentIndex(self.findData(str(value)))


class _SwitchBox(QCheckBox):
    """Yes or no."""

    edited = Signal()

    def __init__(self, declaration: Declaration, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.toggled.connect(self.edited)

    def entered(self) -> Any:
        """Return whether it is checked."""
        return self.isChecked()

    def show_value(self, value: Any) -> None:
        """Check or uncheck."""
        self.setChecked(bool(value))


class _TextLine(QLineEdit):
    """A free text."""

    edited = Signal()

    def __init__(self, declaration: Declaration, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.textChanged.connect(self.edited)

    def entered(self) -> Any:
        """Return the text."""
        return self.text()

    def show_value(self, value: Any) -> None:
        """Show a text."""
        self.setText(str(value))


Editor = _NumberBox | ChoiceBox | _SwitchBox | _TextLine


def editor_for(declaration: Declaration, parent: QWidget) -> Editor:
    """Return the editor of a declared value, with its default; the wheel only turns it while it has the focus.

    Parameters
    ----------
    declaration : Declaration
        The value.
    parent : QWidget
        The form.
    """
    kinds: dict[type, type[Editor]] = {bool: _SwitchBox, str: _TextLine}
    kind = ChoiceBox if declaration.choices else kinds.get(declaration.kind, _NumberBox)
    editor = kind(declaration, parent)
    editor.show_value(declaration.default)
    editor.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
    editor.installEventFilter(_WheelGuard(editor))
    return editor


def stepped(declaration: Declaration, value: float, steps: int) -> float:
    """Return a number some steps up or down, within the declared bounds.

    Parameters
    ----------
    declaration : Declaration
        Whole numbers go by 1, others by one of their second digit.
    value : float
        Where to start.
    steps : int
        How many, negative for down.
    """
    step = 1.0 if declaration.kind is int else _step_of(value, down=steps < 0)
    result = float(f"{value + steps * step:.{_DIGITS}g}")
    low = -math.inf if declaration.low is None else declaration.low
    high = math.inf if declaration.high is None else declaration.high
    return min(max(result, low), high)


def _step_of(value: float, *, down: bool) -> float:
    if value == 0 or not math.isfinite(value):
        return _STEP_FROM_ZERO
    size = math.log10(abs(value))
    decade = math.floor(size)
    if size == decade and down == (value > 0):
        decade -= 1  # from 1 down to 0.99, as from 0.99 up to 1
    return float(10.0 ** (decade - _FINENESS))


class _WheelGuard(QObject):
    """Leaves the wheel to the page that is scrolled, unless the editor under the mouse has the focus."""

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Hold back wheel events."""
        if event.type() == QEvent.Type.Wheel and isinstance(watched, QWidget) and not watched.hasFocus():
            event.ignore()
            return True
        return False


class Expander(QToolButton):
    """A button that shows and hides what most do not need; it is hidden at first.

    Parameters
    ----------
    box : QWidget
        What is shown and hidden.
    tip : str
        What it does.
    parent : QWidget
        Qt's parent.
    """

    def __init__(self, box: QWidget, tip: str, parent: QWidget) -> None:
        super().__init__(parent)
        self._box = box
        self.setCheckable(True)
        self.setAutoRaise(True)
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        self.setToolTip(tip)
        self.toggled.connect(self._show_box)
        self._show_box(False)

    def show_text(self, text: str) -> None:
        """Show another text."""
        self.setText(text)
        self.setAccessibleName(text)

    def _show_box(self, shown: bool) -> None:
        self.setArrowType(Qt.ArrowType.DownArrow if shown else Qt.ArrowType.RightArrow)
        self._box.setVisible(shown)


def keep_narrow(box: QComboBox, letters: int) -> None:
    """Let a box be as wide as some letters; the list that opens shows all.

    Parameters
    ----------
    box : QComboBox
        The box.
    letters : int
        How many it has room for at least.
    """
    box.setSizeAdjustPolicy(QComboBox.SizeAdjustPolicy.AdjustToMinimumContentsLengthWithIcon)
    box.setMinimumContentsLength(letters)


def choose_button(line: QLineEdit, title: str, kinds: str = "", place: Callable[[], str] = str) -> QPushButton:
    """Return a button that asks for a file and writes its path into a line.

    Parameters
    ----------
    line : QLineEdit
        Where the path stands.
    title : str
        Of the dialog.
    kinds : str
        Filter of the files; without one a folder is asked for.
    place : callable () -> str
        Where to begin if the line is empty.
    """
    button = QPushButton(QCoreApplication.translate("Fields", "Choose…"), line.parentWidget())

    def choose() -> None:
        start = line.text().strip() or place()
        if kinds:
            name, _ = QFileDialog.getOpenFileName(button, title, start, kinds)
        else:
            name = QFileDialog.getExistingDirectory(button, title, start)
        line.setText(name or line.text())

    button.clicked.connect(choose)
    return button


def set_up_number(box: QDoubleSpinBox, within: tuple[float, float], decimals: int, suffix: str) -> None:
    """Set up the box of a number.

    Parameters
    ----------
    box : QDoubleSpinBox
        The box.
    within : tuple of float
        Least and largest number.
    decimals : int
        Digits behind the point.
    suffix : str
        The unit.
    """
    box.setRange(*within)
    box.setDecimals(decimals)
    box.setSuffix(suffix)


class FoundOrGiven(QWidget):
    """Found, or given: two buttons and a number.

    Signals
    -------
    changed()
        Another choice, or another number.

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
        self._number.setRange(1, _MOST)
        self._group = QButtonGroup(self)
        self._group.addButton(self._found)
        self._group.addButton(self._given)
        bare_column(self, (QLabel(what, self), row_of(self._found, self._given, self._number, room=True)))
        describe(self._found, self.tr("{0}: found").format(what), self.tr("The number is found from the recording"))
        describe(self._given, self.tr("{0}: given").format(what), self.tr("You know the number, and the stage uses it"))
        describe(self._number, what, self.tr("The number that you know"))
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
        """Show the number that was found, and propose it as the one to give; None if none was found."""
        self._found.setText(self.tr("found") if number is None else self.tr("found: {0}").format(number))
        if number is not None and self.value() is None:
            self._number.setValue(number)

    def _follow(self) -> None:
        self._number.setEnabled(self._given.isChecked())
        self.changed.emit()


def title_of(declaration: Declaration) -> str:
    """Return what a parameter is called in a form."""
    title = _WORDS["parameters"].get(declaration.name, declaration.name.replace("_", " ").capitalize())
    return QCoreApplication.translate("Parameters", title)


def choice_of(declaration: Declaration, choice: str) -> str:
    """Return what a choice is called in a form.

    Parameters
    ----------
    declaration : Declaration
        Whose choice it is.
    choice : str
        Its name in files.
    """
    is_of_stage = declaration.name in _WORDS["parameters"]  # other forms use some of these words otherwise
    words = _WORDS["choices"].get(choice, choice) if is_of_stage else choice
    return QCoreApplication.translate("Parameters", words)
