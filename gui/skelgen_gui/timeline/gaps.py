"""The list of gaps, how one is filled, with the deviation of each way, and smoothing."""

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QDoubleSpinBox,
    QLabel,
    QPushButton,
    QTableView,
    QWidget,
)

from skelgen.model.corrections import FILL_METHODS
from skelgen_gui.model import translate
from skelgen_gui.model.marker_curves import GapRow
from skelgen_gui.timeline.span import clock
from skelgen_gui.widgets.fields import set_up_number
from skelgen_gui.widgets.layouts import Index, Role, RowModel, bare_column, choose_by_rows, put_texts, row_of

_TIME_STEP = 0.01  # s
_CUTOFF, _MOST_CUTOFF = 10.0, 1000.0  # Hz


class GapModel(RowModel[GapRow]):
    """Gaps as rows, whatever their number."""

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        names = self.tr("Marker"), self.tr("Begins"), self.tr("Frames"), self.tr("Filled by")
        self.heads = [(name, None) for name in names]
        self._rate = 1.0

    def show_gaps(self, rows: tuple[GapRow, ...], rate: float) -> None:
        """Show other gaps.

        Parameters
        ----------
        rows : tuple of GapRow
            In their order.
        rate : float, Hz
            Of the take.
        """
        self._rate = rate
        self.show_rows(rows)

    def data(self, index: Index, role: int = Role.DisplayRole) -> object:
        """Return what a cell shows."""
        if role != Role.DisplayRole:
            return None
        row = self.rows[index.row()]
        begins = clock(row.first / self._rate, _TIME_STEP)
        return (row.name, begins, str(row.last - row.first + 1), fill_words(row.stated))[index.column()]


def fill_words(method: str) -> str:
    """Return what a way of filling is called; nothing for none."""
    words = {
        "skeleton": translate("Gaps", "skeleton"),
        "rigid": translate("Gaps", "rigid mates"),
        "spline": translate("Gaps", "spline"),
        "pattern": translate("Gaps", "pattern"),
    }
    return words.get(method, "")


class GapTable(QTableView):
    """The gaps; Enter fills the one that is chosen, 1 to 4 choose the way.

    Signals
    -------
    fill_wanted()
        Enter was pressed.
    way_wanted(int)
        Number of a way, from 0.
    """

    fill_wanted = Signal()
    way_wanted = Signal(int)
    own_keys = frozenset({Qt.Key.Key_1, Qt.Key.Key_2, Qt.Key.Key_3, Qt.Key.Key_4})

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.gaps = GapModel(self)
        self.setModel(self.gaps)
        choose_by_rows(self)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.verticalHeader().setDefaultSectionSize(self.fontMetrics().height() + 6)
        self.horizontalHeader().setStretchLastSection(True)
        put_texts(self)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Fill, or choose the way."""
        if event.key() in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self.fill_wanted.emit()
        elif event.key() in self.own_keys:
            self.way_wanted.emit(event.key() - Qt.Key.Key_1)
        else:
            super().keyPressEvent(event)


class _Cutoff(QDoubleSpinBox):
    """The field of the cutoff; as it gets the focus, the window shows what smoothing does."""

    asked = Signal()

    def focusInEvent(self, event: QFocusEvent) -> None:
        """Ask."""
        super().focusInEvent(event)
        self.asked.emit()


class GapTools(QWidget):
    """The list of gaps, and what can be done with the chosen one.

    Signals
    -------
    changed()
        Another way or donor is chosen.
    smoothing_asked()
        Another frequency is chosen, or about to be.
    """

    changed, smoothing_asked = Signal(), Signal()

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.table, self.way, self.donor = GapTable(self), QComboBox(self), QComboBox(self)
        self.words, self.fill = QLabel(self), QPushButton(self.tr("Fill"), self)
        self.fill_all = QPushButton(self.tr("Fill all of it"), self)
        self.cutoff, self.smooth = _Cutoff(self), QPushButton(self.tr("Smooth"), self)
        for method in FILL_METHODS:
            self.way.addItem(self.tr("By {0}").format(fill_words(method)), method)
        self.words.setWordWrap(True)
        set_up_number(self.cutoff, (0.1, _MOST_CUTOFF), 1, self.tr(" Hz"))
        self.cutoff.setValue(_CUTOFF)
        put_texts(self)
        rows = (row_of(self.way, self.donor), self.words, row_of(self.fill, self.fill_all))
        bare_column(self, (self.table, *rows, row_of(self.cutoff, self.smooth))).setStretchFactor(self.table, 1)
        self.table.way_wanted.connect(self.way.setCurrentIndex)
        self.way.currentIndexChanged.connect(self._follow_way)
        self.donor.currentIndexChanged.connect(lambda _: self.changed.emit())
        self.cutoff.asked.connect(self.smoothing_asked)
        self.cutoff.valueChanged.connect(lambda _: self.smoothing_asked.emit())
        self._follow_way()

    @property
    def method(self) -> str:
        """The way that is chosen."""
        return str(self.way.currentData())

    @property
    def row(self) -> GapRow | None:
        """The gap that is chosen."""
        row = self.table.currentIndex().row()
        return self.table.gaps.rows[row] if 0 <= row < len(self.table.gaps.rows) else None

    def _follow_way(self) -> None:
        self.donor.setVisible(self.method == "pattern")
        self.changed.emit()
