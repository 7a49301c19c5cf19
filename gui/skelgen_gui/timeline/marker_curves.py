"""Curves of the selected markers, with the list of their gaps: what would fill one is drawn before it is stated."""

from collections.abc import Callable
from functools import partial

from PySide6.QtCore import QObject, Qt, Signal
from PySide6.QtGui import QFocusEvent, QKeyEvent
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QTableView,
    QWidget,
)

from skelgen.model import Project
from skelgen.model.corrections import FILL_METHODS, Correction
from skelgen_gui.model import translate
from skelgen_gui.model.curves import Panel
from skelgen_gui.model.marker_curves import (
    QUANTITIES,
    FillPreview,
    GapRow,
    gap_rows,
    marker_panels,
    mates_of,
    preview_fill,
    preview_smooth,
)
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.deriving import Deriver, PanelWhileSeen
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.plot_view import PlotView
from skelgen_gui.timeline.span import VisibleSpan, clock
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


_WIDTH = 300  # px, of the gaps
_AROUND = 1.5  # lengths of a gap that are shown before and behind it
_LEAST_AROUND = 20  # frames

Found = tuple[tuple[Panel, ...], FillPreview | str | None]


class MarkerCurves(PanelWhileSeen):
    """Places, speeds and distances of the selected markers; gaps, filled in ways that are tried first; smoothing.

    Parameters
    ----------
    session : Session
        Whose selection is shown.
    span : VisibleSpan
        Which frames are in sight.
    apply : callable (*corrections)
        States what is wanted.
    """

    def __init__(self, session: Session, span: VisibleSpan, apply: Callable[..., None]) -> None:
        super().__init__()
        self._session, self._span, self._apply = session, span, apply
        self.range: tuple[int, int] | None = None  # frames to be smoothed, where the user has chosen some
        self.preview: FillPreview | None = None
        self._is_following = False
        self._smooths = False  # whether smoothing is previewed, and not what fills a gap
        self.deriver, self._lister = Deriver(self), Deriver(self)
        self.plot, self.quantity, self.tools = PlotView(session, span, self), QComboBox(self), GapTools(self)
        for quantity, words in zip(
            QUANTITIES, (self.tr("Position"), self.tr("Speed"), self.tr("Distances")), strict=True
        ):
            self.quantity.addItem(words, quantity)
        put_texts(self)
        side = QWidget(self)
        side.setFixedWidth(_WIDTH)
        bare_column(side, (self.quantity, self.tools)).setStretchFactor(self.tools, 1)
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.addWidget(self.plot, 1)
        row.addWidget(side)
        self._connect()

    def _connect(self) -> None:
        self._session.project_changed.connect(self._follow_project)
        self._session.selection_changed.connect(self._follow_selection)
        self.quantity.currentIndexChanged.connect(lambda _: self._follow())
        self.tools.table.selectionModel().currentChanged.connect(self._go_to_gap)
        self.tools.table.fill_wanted.connect(self.fill)
        self.tools.changed.connect(partial(self._try, smooths=False))
        self.tools.smoothing_asked.connect(partial(self._try, smooths=True))
        self.tools.fill.clicked.connect(self.fill)
        self.tools.fill_all.clicked.connect(self.fill_all)
        self.tools.smooth.clicked.connect(self.smooth)

    def fill(self) -> None:
        """State that the chosen gap is filled as it is previewed."""
        if self.preview is not None and not self._smooths:
            self._apply(self.preview.correction)

    def fill_all(self) -> None:
        """State that all gaps of the chosen gap's marker are filled in the chosen way."""
        if self.preview is not None and not self._smooths:
            stated = self.preview.correction
            self._apply(Correction("fill", stated.names, value=stated.value))

    def smooth(self) -> None:
        """State that the selected markers are smoothed."""
        project, markers = self._session.project, sorted(self._session.selection.markers)
        if project is None or not project.has("labels") or not markers:
            self.tools.words.setText(self.tr("Select markers first"))
            return
        self.deriver.derive(partial(preview_smooth, project, markers, *self._smoothing(project)), self._state_smooth)

    def _smoothing(self, project: Project) -> tuple[tuple[int, int], float]:
        """First and last frame that are smoothed, and the frequency [Hz]."""
        return self.range or (0, project.trajectories.n_frames - 1), self.tools.cutoff.value()

    def _try(self, *, smooths: bool) -> None:
        """Preview smoothing, or what fills the chosen gap."""
        self._smooths = smooths
        self._follow()

    def _state_smooth(self, found: FillPreview | str) -> None:
        self.tools.words.setText(found if isinstance(found, str) else found.words)
        if isinstance(found, FillPreview):
            self._apply(found.correction)

    def _list_project(self) -> None:
        project = self._session.project
        if project is None or not project.has("labels"):
            self._lister.forget()
            self._list((), ())
        else:
            names = project.trajectories.names
            self._lister.derive(partial(gap_rows, project), partial(self._list, names))

    def _list(self, names: tuple[str, ...], rows: tuple[GapRow, ...]) -> None:
        """Show other gaps, and the same one chosen if it is there again."""
        before, donor = self.tools.row, self.tools.donor.currentText()
        self._is_following = True
        self.tools.table.gaps.show_gaps(rows, self._session.rate)
        for column in range(3):
            self.tools.table.resizeColumnToContents(column)
        self.tools.donor.clear()
        self.tools.donor.addItems(list(names))
        self.tools.donor.setCurrentIndex(max(self.tools.donor.findText(donor), 0))
        same = [
            number
            for number, row in enumerate(rows)
            if before is not None and (row.name, row.first, row.last) == (before.name, before.first, before.last)
        ]
        if same:
            self.tools.table.selectRow(same[0])
        self._is_following = False
        self._follow()

    def _go_to_gap(self) -> None:
        """Select the marker of a gap, and show its frames and the best donor."""
        row = self.tools.row
        if row is None or self._is_following:
            return
        self._smooths = False
        project = self._session.project
        mates = () if project is None else mates_of(project, row.marker)
        self._is_following = True
        if mates:
            self.tools.donor.setCurrentIndex(mates[0])
        length = row.last - row.first + 1
        around = max(_AROUND * length, _LEAST_AROUND)
        self._span.show(row.first - around, row.last + 1 + around)
        self._session.show_frame(row.first)
        if row.marker not in self._session.selection.markers:
            self._session.select(Selection(frozenset({row.marker})))
        self._is_following = False
        self._follow()

    def _follow_selection(self) -> None:
        """Choose the longest gap of a marker that is selected elsewhere."""
        if self._is_following:
            return
        markers = self._session.selection.markers
        row = self.tools.row
        if markers and (row is None or row.marker not in markers):
            self._is_following = True
            rows = [number for number, one in enumerate(self.tools.table.gaps.rows) if one.marker in markers]
            if rows:
                self.tools.table.selectRow(rows[0])
            else:
                self.tools.table.setCurrentIndex(self.tools.table.gaps.index(-1, -1))
                self.tools.table.clearSelection()
            self._is_following = False
        self._follow()

    def _follow(self) -> None:
        """Draw the curves of what is selected, and what would fill the chosen gap."""
        project, row = self._session.project, self.tools.row
        if self._is_following or not self.is_seen:
            self._is_stale = self._is_stale or not self.is_seen
            return
        markers = sorted(self._session.selection.markers)
        if project is None or not project.has("labels") or not markers:
            self.deriver.forget()
            self._show((), None)
            return
        if row is not None and row.marker not in markers:
            row = None
        if row is not None:
            markers = [row.marker, *(marker for marker in markers if marker != row.marker)]
        donors = [self.tools.donor.currentIndex()] if self.tools.method == "pattern" else markers[1:]
        preview: Callable[[], FillPreview | str | None] = _nothing
        if self._smooths:
            preview = partial(preview_smooth, project, markers, *self._smoothing(project))
        elif row is not None:
            preview = partial(preview_fill, project, (row.marker, row.first, row.last), self.tools.method, donors)
        wanted = partial(_derived, project, markers, str(self.quantity.currentData()), preview)
        self.deriver.derive(wanted, lambda found: self._show(*found))

    def _show(self, panels: tuple[Panel, ...], preview: FillPreview | str | None) -> None:
        hint = "" if panels else self.tr("Select markers, or a gap in the list")
        self.plot.show_panels(panels, hint)
        self.preview = preview if isinstance(preview, FillPreview) else None
        self.tools.words.setText(preview if isinstance(preview, str) else "" if preview is None else preview.words)
        for button in (self.tools.fill, self.tools.fill_all):
            button.setEnabled(self.preview is not None and not self._smooths)
        self.tools.smooth.setEnabled(bool(self._session.selection.markers))


def _derived(
    project: Project, markers: list[int], quantity: str, preview: Callable[[], FillPreview | str | None]
) -> Found:
    """The curves, and what would be stated."""
    found = preview()
    return marker_panels(project, markers, quantity, found if isinstance(found, FillPreview) else None), found


def _nothing() -> None:
    return None
