"""Curves of the selected markers, with the list of their gaps: what would fill one is drawn before it is stated."""

from collections.abc import Callable
from functools import partial

from PySide6.QtWidgets import QComboBox, QHBoxLayout, QWidget

from skelgen.model import Project
from skelgen.model.corrections import Correction
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
from skelgen_gui.timeline.gaps import GapTools
from skelgen_gui.timeline.plot_view import PlotView
from skelgen_gui.timeline.span import VisibleSpan
from skelgen_gui.widgets.layouts import bare_column, put_texts

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
