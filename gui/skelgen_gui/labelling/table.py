"""All markers in a table, what needs most work first: searched, sorted, selected with the session."""

from PySide6.QtCore import (
    QAbstractTableModel,
    QItemSelection,
    QItemSelectionModel,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
    Signal,
)
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QAbstractItemView, QTableView, QWidget

from skelgen.app.drawing.wording import whole_percent
from skelgen_gui.model.labelling import MarkerRow
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import describe

_Role = Qt.ItemDataRole
_NAME = 0
_Index = QModelIndex | QPersistentModelIndex
_NOWHERE = QModelIndex()


class MarkerModel(QAbstractTableModel):
    """Markers as rows, whatever their number."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.rows: tuple[MarkerRow, ...] = ()
        tr = self.tr
        self._heads = (
            (tr("Marker"), tr("What it is called")),
            (tr("Work"), tr("Frames that are expected to be called wrongly")),
            (tr("Gaps"), tr("Number of gaps between frames in which it is seen")),
            (tr("Doubts"), tr("Number of doubtful spans")),
            (tr("Seen"), tr("Part of the frames in which it is seen")),
            (tr("Limb"), tr("The limb that it is on")),
        )

    def show_rows(self, rows: tuple[MarkerRow, ...]) -> None:
        """Show other markers."""
        self.beginResetModel()
        self.rows = rows
        self.endResetModel()

    def rowCount(self, parent: _Index = _NOWHERE) -> int:
        """Return the number of markers."""
        return 0 if parent.isValid() else len(self.rows)

    def columnCount(self, parent: _Index = _NOWHERE) -> int:
        """Return the number of columns."""
        return 0 if parent.isValid() else len(self._heads)

    def headerData(self, section: int, orientation: Qt.Orientation, role: int = _Role.DisplayRole) -> str | None:
        """Return the head of a column, and what it means."""
        if orientation == Qt.Orientation.Vertical or role not in {_Role.DisplayRole, _Role.ToolTipRole}:
            return None
        return self._heads[section][role == _Role.ToolTipRole]

    def data(self, index: _Index, role: int = _Role.DisplayRole) -> object:
        """Return what a cell shows, and by what it is sorted."""
        row, column = self.rows[index.row()], index.column()
        values = (row.name, row.work, row.gaps, row.doubts, row.seen, row.limb)
        if role == _Role.UserRole:
            return values[column]
        if role in {_Role.DisplayRole, _Role.ToolTipRole}:
            texts = (row.name, f"{row.work:.0f}", str(row.gaps), str(row.doubts), whole_percent(row.seen), row.limb)
            return texts[column] if texts[column] != "0" else ""
        if role == _Role.TextAlignmentRole and not isinstance(values[column], str):
            return Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter
        return None


class MarkerTable(QTableView):
    """The table; a click or an arrow key selects markers, Enter goes on to their name.

    Parameters
    ----------
    session : Session
        Whose selection is followed.

    Signals
    -------
    chosen()
        The selected marker is to be named.
    """

    chosen = Signal()

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session, self._is_following = session, False
        self.markers, self.filtered = MarkerModel(self), QSortFilterProxyModel(self)
        self.filtered.setSourceModel(self.markers)
        self.filtered.setSortRole(_Role.UserRole)
        self.filtered.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.setModel(self.filtered)
        self.setSortingEnabled(True)
        self.horizontalHeader().setSortIndicatorClearable(True)
        self.horizontalHeader().setHighlightSections(False)
        self.sortByColumn(-1, Qt.SortOrder.AscendingOrder)  # as the rows come: what needs most work first
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setTabKeyNavigation(False)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        tip = self.tr("What needs most work comes first; a click on a head sorts, Enter goes on to the name")
        describe(self, self.tr("Markers to label"), tip)
        self.customContextMenuRequested.connect(
            lambda place: session.menu_requested.emit(self.viewport().mapToGlobal(place))
        )
        self.selectionModel().selectionChanged.connect(self._select)
        session.selection_changed.connect(self.follow_selection)

    def show_rows(self, rows: tuple[MarkerRow, ...]) -> None:
        """Show other markers, the selected ones selected."""
        self._is_following = True
        self.markers.show_rows(rows)
        self._is_following = False
        for column in range(self.markers.columnCount()):
            self.resizeColumnToContents(column)
        self.follow_selection()

    def search(self, text: str) -> None:
        """Show only markers that have a text in their names."""
        self._is_following = True
        self.filtered.setFilterFixedString(text.strip())
        self._is_following = False
        self.follow_selection()

    def marker_after(self, marker: int) -> int | None:
        """Return the marker in the row below that of another one; None if it is the last one."""
        order = [self._marker(row) for row in range(self.filtered.rowCount())]
        below = order.index(marker) + 1 if marker in order else 0
        return order[below] if below < len(order) else None

    def follow_selection(self) -> None:
        """Select here what the session has selected."""
        if self._is_following:
            return
        wanted, found = self._session.selection.markers, QItemSelection()
        rows = [row for row in range(self.filtered.rowCount()) if self._marker(row) in wanted]
        for row in rows:
            place = self.filtered.index(row, _NAME)
            found.select(place, place)
        flags = QItemSelectionModel.SelectionFlag
        self._is_following = True
        if rows and self.currentIndex().row() not in rows:
            self.selectionModel().setCurrentIndex(self.filtered.index(rows[0], _NAME), flags.NoUpdate)
        self.selectionModel().select(found, flags.ClearAndSelect | flags.Rows)
        if rows:
            self.scrollTo(self.filtered.index(rows[0], _NAME))
        self._is_following = False

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Go on to the name by Enter."""
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.chosen.emit()
        else:
            super().keyPressEvent(event)

    def _marker(self, row: int) -> int:
        return self.markers.rows[self.filtered.mapToSource(self.filtered.index(row, _NAME)).row()].marker

    def _select(self) -> None:
        """Select in the session what is selected here."""
        if not self._is_following:
            chosen = frozenset(self._marker(place.row()) for place in self.selectionModel().selectedRows())
            self._is_following = True
            self._session.select(Selection(chosen))
            self._is_following = False
