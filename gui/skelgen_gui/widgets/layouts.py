"""What every page needs: names, tool tips, rows, scrolled columns, and tables whose rows come from elsewhere."""

from collections.abc import Iterable, Sequence
from typing import Generic, TypeVar

from PySide6.QtCore import QAbstractTableModel, QCoreApplication, QModelIndex, QObject, QPersistentModelIndex, Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QBoxLayout,
    QDialog,
    QDialogButtonBox,
    QHBoxLayout,
    QHeaderView,
    QLabel,
    QLayout,
    QScrollArea,
    QTableView,
    QVBoxLayout,
    QWidget,
)

from skelgen.files import read_table

_BESIDE_BAR = 6  # px, between what is scrolled and the scroll bar


# What sets each of the texts of a widget
_SETTERS = {
    "text": "setText",
    "name": "setAccessibleName",
    "tip": "setToolTip",
    "hint": "setPlaceholderText",
    "about": "setAccessibleDescription",
    "columns": "show_columns",
}


def put_texts(widget: QWidget) -> None:
    """Give a widget and its parts the texts of the table ``texts``, where each stands under its class and attribute."""
    every = read_table(__file__, "texts")
    kind = next(kind.__name__ for kind in type(widget).__mro__ if kind.__name__ in every)
    for part, texts in every[kind].items():
        owner = widget if part == "self" else getattr(widget, part)
        for what, text in texts.items():
            words = [QCoreApplication.translate(kind, one) for one in ([text] if isinstance(text, str) else text)]
            getattr(owner, _SETTERS[what])(words[0] if isinstance(text, str) else words)


def describe(widget: QWidget, name: str, tip: str = "") -> None:
    """Give a widget a name for screen readers, and a tool tip.

    Parameters
    ----------
    widget : QWidget
        What is described.
    name : str
        What it is.
    tip : str
        What it does; its name by default.
    """
    widget.setAccessibleName(name)
    widget.setToolTip(tip or name)


def wrap(label: QLabel, name: str = "") -> None:
    """Let a label break its lines and take its text as it is: names may look like tags.

    Parameters
    ----------
    label : QLabel
        What is described.
    name : str
        What it shows, for screen readers.
    """
    label.setWordWrap(True)
    label.setTextFormat(Qt.TextFormat.PlainText)
    label.setAccessibleName(name)


def row_of(*widgets: QWidget, room: bool = False) -> QHBoxLayout:
    """Return widgets beside each other.

    Parameters
    ----------
    *widgets : QWidget
        From left to right.
    room : bool
        Whether room is left at the right; otherwise they share the whole width.
    """
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    if room:
        row.addStretch(1)
    return row


def scrolled(parts: Iterable[QWidget | QLayout], area: QScrollArea, *, has_margin: bool = False) -> QScrollArea:
    """Put widgets below each other into an area that scrolls; what is in it is reached by Tab.

    Parameters
    ----------
    parts : iterable of QWidget or QLayout
        From above to below.
    area : QScrollArea
        Where; it loses its frame.
    has_margin : bool
        Whether there is a margin around the parts; otherwise there is only room beside the scroll bar.
    """
    inner = QWidget(area)
    layout = column(inner, parts)
    if not has_margin:
        layout.setContentsMargins(0, 0, _BESIDE_BAR, 0)
    layout.addStretch(1)
    return scrolling(inner, area)


def scrolling(inner: QWidget, area: QScrollArea) -> QScrollArea:
    """Let a widget scroll where there is too little room for it; what is in it is reached by Tab.

    Parameters
    ----------
    inner : QWidget
        It takes all room that there is.
    area : QScrollArea
        Where; it loses its frame.
    """
    area.setWidgetResizable(True)
    area.setFrameShape(QScrollArea.Shape.NoFrame)
    area.setFocusPolicy(Qt.FocusPolicy.NoFocus)
    area.setWidget(inner)
    return area


def put_behind(before: QWidget, container: QWidget) -> None:
    """Let Tab go from a widget to what is in a container that was made later, in the order in which it was made.

    Parameters
    ----------
    before : QWidget
        What Tab leaves.
    container : QWidget
        Where it goes on.
    """
    for widget in container.findChildren(QWidget):
        is_reached = widget.focusPolicy() & Qt.FocusPolicy.TabFocus and widget.focusProxy() is None
        if is_reached and widget.window() is before.window():  # lists that unfold are windows of their own
            QWidget.setTabOrder(before, widget)
            before = widget


def fill(layout: QBoxLayout, parts: Iterable[QWidget | QLayout]) -> None:
    """Put widgets and layouts behind each other.

    Parameters
    ----------
    layout : QBoxLayout
        Where.
    parts : iterable of QWidget or QLayout
        From left to right, or from above to below.
    """
    for part in parts:
        if isinstance(part, QWidget):
            layout.addWidget(part)
        else:
            layout.addLayout(part)


def answer_buttons(dialog: QDialog, accepting: QDialogButtonBox.StandardButton) -> QDialogButtonBox:
    """Return the buttons that accept a dialog and cancel it.

    Parameters
    ----------
    dialog : QDialog
        What is answered.
    accepting : QDialogButtonBox.StandardButton
        The button that accepts it.
    """
    buttons = QDialogButtonBox(accepting | QDialogButtonBox.StandardButton.Cancel, parent=dialog)
    buttons.accepted.connect(dialog.accept)
    buttons.rejected.connect(dialog.reject)
    return buttons


def column(parent: QWidget, parts: Iterable[QWidget | QLayout]) -> QVBoxLayout:
    """Lay out a widget as a column.

    Parameters
    ----------
    parent : QWidget
        The widget.
    parts : iterable of QWidget or QLayout
        What stands below each other.
    """
    layout = QVBoxLayout(parent)
    fill(layout, parts)
    return layout


def bare_column(parent: QWidget, parts: Iterable[QWidget | QLayout]) -> QVBoxLayout:
    """Lay out a widget as a column without a margin.

    Parameters
    ----------
    parent : QWidget
        The widget.
    parts : iterable of QWidget or QLayout
        From above to below.
    """
    layout = column(parent, parts)
    layout.setContentsMargins(0, 0, 0, 0)
    return layout


_MEASURED = 60  # rows by which the widths of columns are fitted: to measure a thousand takes 50 ms

Role = Qt.ItemDataRole
Index = QModelIndex | QPersistentModelIndex
_NOWHERE = QModelIndex()

_Row = TypeVar("_Row")


class RowModel(QAbstractTableModel, Generic[_Row]):
    """Model of rows of one type; subclasses name the columns in `heads`, and return the cells.

    Parameters
    ----------
    parent : QObject, optional
        Who owns it.
    """

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.rows: tuple[_Row, ...] = ()
        self.heads: Sequence[tuple[str, str | None]] = ()

    def show_rows(self, rows: tuple[_Row, ...]) -> None:
        """Show other rows."""
        self.beginResetModel()
        self.rows = rows
        self.endResetModel()

    def rowCount(self, parent: Index = _NOWHERE) -> int:
        """Return the number of rows."""
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: Index = _NOWHERE) -> int:
        """Return the number of columns."""
        return 0 if parent.isValid() else len(self.heads)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = Role.DisplayRole) -> str | None:
        """Return the head of a column, and what it means."""
        if orientation == Qt.Orientation.Vertical or role not in {Role.DisplayRole, Role.ToolTipRole}:
            return None
        return self.heads[section][role == Role.ToolTipRole]


def fit_columns(header: QHeaderView, stretched: int) -> None:
    """Make columns as wide as their contents and give one of them what is left, so that nothing scrolls sideways.

    Parameters
    ----------
    header : QHeaderView
        Of a table or a tree, with its columns.
    stretched : int
        The column that takes the rest, and is cut short where there is too little.
    """
    header.setMinimumSectionSize(header.fontMetrics().horizontalAdvance("00000"))
    header.setStretchLastSection(False)
    header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
    header.setSectionResizeMode(stretched, QHeaderView.ResizeMode.Stretch)


def choose_by_rows(table: QTableView) -> None:
    """Let whole rows of a table be chosen, and Tab leave it."""
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setTabKeyNavigation(False)
    table.setShowGrid(False)
    table.verticalHeader().hide()
    table.horizontalHeader().setHighlightSections(False)
    table.horizontalHeader().setResizeContentsPrecision(_MEASURED)
