"""Tables whose rows come from elsewhere, all at once, whatever their number."""

from collections.abc import Sequence
from typing import Generic, TypeVar

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QObject, QPersistentModelIndex, Qt
from PySide6.QtWidgets import QAbstractItemView, QTableView

_MEASURED = 60  # rows by which the widths of columns are fitted: to measure a thousand takes 50 ms

Role = Qt.ItemDataRole
Index = QModelIndex | QPersistentModelIndex
_NOWHERE = QModelIndex()

_Row = TypeVar("_Row")


class RowModel(QAbstractTableModel, Generic[_Row]):
    """Rows of one sort; those who derive from it name the columns in `heads`, and tell what their cells show.

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


def choose_by_rows(table: QTableView) -> None:
    """Let whole rows of a table be chosen, and Tab leave it."""
    table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
    table.setTabKeyNavigation(False)
    table.setShowGrid(False)
    table.verticalHeader().hide()
    table.horizontalHeader().setHighlightSections(False)
    table.horizontalHeader().setResizeContentsPrecision(_MEASURED)
