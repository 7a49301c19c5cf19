"""All markers in a table, what needs most work first: searched, sorted, selected with the session."""

from PySide6.QtCore import (
    QItemSelection,
    QItemSelectionModel,
    QObject,
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
from skelgen_gui.widgets.layouts import Index, Role, RowModel, choose_by_rows, describe

_NAME = 0
_LEAST_ROWS = 6  # in sight, one of them for the heads


class MarkerTableModel(RowModel[MarkerRow]):
    """Markers as rows, whatever their number."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.heads = (
            (self.tr("Marker"), self.tr("What it is called")),
            (self.tr("Work"), self.tr("Frames that are expected to be called wrongly")),
            (self.tr("Gaps"), self.tr("Number of gaps between frames in which it is seen")),
            (self.tr("Doubts"), self.tr("Number of doubtful spans")),
            (self.tr("Seen"), self.tr("Part of the frames in which it is seen")),
            (self.tr("Limb"), self.tr("The limb that it is on")),
        )

    def data(self, index: Index, role: int = Role.DisplayRole) -> object:
        """Return what a cell shows, and by what it is sorted."""
        row, column = self.rows[index.row()], index.column()
        values = (row.name, row.work, row.gaps, row.doubts, row.seen, row.limb)
        if role == Role.UserRole:
            return values[column]
        if role in {Role.DisplayRole, Role.ToolTipRole}:
            texts = (row.name, f"{row.work:.0f}", str(row.gaps), str(row.doubts), whole_percent(row.seen), row.limb)
            return texts[column] if texts[column] != "0" else ""
        if role == Role.TextAlignmentRole and not isinstance(values[column], str):
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
        self.markers, self.filtered = MarkerTableModel(self), QSortFilterProxyModel(self)
        self.filtered.setSourceModel(self.markers)
        self.filtered.setSortRole(Role.UserRole)
        self.filtered.setFilterCaseSensitivity(Qt.CaseSensitivity.CaseInsensitive)
        self.setModel(self.filtered)
        self.setSortingEnabled(True)
        self.horizontalHeader().setSortIndicatorClearable(True)
        self.sortByColumn(-1, Qt.SortOrder.AscendingOrder)  # as the rows come: what needs most work first
        choose_by_rows(self)
        self.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        self.setWordWrap(False)
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        self.setMinimumHeight(_LEAST_ROWS * self.verticalHeader().defaultSectionSize())
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
