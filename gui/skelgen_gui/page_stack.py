"""The list of pages, and the pages.

A page is built when it is first shown, because stages take long to load; while the window is idle, stages are loaded
and pages are built ahead.
"""

import importlib
import threading
from enum import Enum

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QPointF, QRectF, QSize, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QIcon, QPainter, QPalette, QPen, QPolygonF
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QStackedWidget, QWidget

from skelgen.app.configuration import parameters_class
from skelgen.app.stage_summary import has_doubts
from skelgen.model.project import STAGES
from skelgen_gui.project.context import HOME, Context, PageEntry
from skelgen_gui.widgets.layouts import column, put_texts
from skelgen_gui.widgets.painting import as_rich_text, doubt_colour, drawn_pixmap

WIDTH, _LEAST_WIDTH = 400, 350  # px, where there is room, and at least
_LINE = 22  # px, the least height of a line of the list

SIZE = 16.0
"""px, of the sign with what is free about it."""

_RATIO = 3.0  # pixels per point: sharp on any screen
_RING = QRectF(2.5, 2.5, 11.0, 11.0)
_DONE, _FAILED = "#2b8a3e", "#c92a2a"  # green and red, the same on both grounds
_THIN, _THICK = 1.2, 1.8
_Role = QPalette.ColorRole


class _State(Enum):
    """State of the result of a step, in words."""

    OPEN = "{0}: not done yet"
    STALE = "{0}: to be run again, since something before it has changed"
    FAILED = "{0}: ended with an error"
    DONE = "{0}: done"
    DOUBTFUL = "{0}: done, with doubtful results"


_TICK = ((5.0, 8.2), (7.2, 10.4), (11.2, 5.8))
_CROSS = ((5.4, 5.4), (10.6, 10.6)), ((10.6, 5.4), (5.4, 10.6))
_EXCLAMATION = ((8.0, 4.6), (8.0, 8.4)), ((8.0, 11.3), (8.0, 11.4))
_STROKES = {_State.STALE: (_TICK,), _State.DONE: (_TICK,), _State.FAILED: _CROSS, _State.DOUBTFUL: _EXCLAMATION}


class PageStack(QWidget):
    """All pages of the table, one of them shown.

    Parameters
    ----------
    entries : tuple of PageEntry
        The table.
    context : Context
        What pages are given.

    Attributes
    ----------
    home : int
        Place of the page that is shown first.

    Signals
    -------
    shown(str)
        Another page is shown; its key.
    """

    shown = Signal(str)

    def __init__(self, entries: tuple[PageEntry, ...], context: Context) -> None:
        super().__init__()
        self.entries, self._context = entries, context
        self.list, self._stack = QListWidget(self), QStackedWidget(self)
        self._pages: dict[str, QWidget] = {}
        put_texts(self)
        for entry in entries:
            item = QListWidgetItem(QCoreApplication.translate("Pages", entry.title), self.list)
            item.setToolTip(QCoreApplication.translate("Pages", entry.tip))
            item.setSizeHint(QSize(0, max(_LINE, self.list.fontMetrics().height() + 4)))
        self.list.setFixedHeight(self.list.sizeHintForRow(0) * len(entries) + 2 * self.list.frameWidth())
        column(self, (self.list, self._stack)).setStretchFactor(self._stack, 1)
        self.setMinimumWidth(_LEAST_WIDTH)
        self.list.currentRowChanged.connect(self._show)
        keys = [entry.key for entry in entries]
        self.home = keys.index(HOME) if HOME in keys else 0
        self.list.setCurrentRow(self.home)
        context.session.project_changed.connect(self._mark_done)
        context.runner.failed_changed.connect(self._mark_done)
        self._mark_done()

    @property
    def current(self) -> PageEntry:
        """The entry of the page that is shown."""
        return self.entries[self.list.currentRow()]

    def page(self, key: str) -> QWidget:
        """Show a page, and return it."""
        keys = [entry.key for entry in self.entries]
        self.list.setCurrentRow(keys.index(key))
        return self._pages[key]

    def turn(self, step: int) -> None:
        """Show the page that many places further down; the first or last one where the list ends."""
        self.list.setCurrentRow(min(max(self.list.currentRow() + step, 0), len(self.entries) - 1))

    def prepare(self) -> bool:
        """Build the next page that was not shown yet; whether any is left after it."""
        missing = [entry for entry in self.entries if entry.key not in self._pages]
        if missing:
            self._make(missing[0])
        return len(missing) > 1

    def sizeHint(self) -> QSize:
        """Return the same width for every page: what is beside does not jump when another one is shown."""
        return QSize(WIDTH, super().sizeHint().height())

    def changeEvent(self, event: QEvent) -> None:
        """Follow the colours of the window."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange:
            self._mark_done()

    def _mark_done(self) -> None:
        """Tick the steps whose results are there; doubtful, stale and failed ones get other signs."""
        for row, entry in enumerate(self.entries):
            item = self.list.item(row)
            state = self._state(entry.stage)
            item.setIcon(_step_icon(state, self.palette()))
            state_words = item.text() if state is None else self.tr(state.value).format(item.text())
            item.setData(Qt.ItemDataRole.AccessibleTextRole, state_words)
            tip = QCoreApplication.translate("Pages", entry.tip)
            item.setToolTip(tip if state is None else as_rich_text(f"{tip}\n{state_words}"))

    def _state(self, stage: str) -> _State | None:
        session = self._context.session
        project = session.project
        if not stage:
            return None
        if project is not None and project.has(stage):
            return _State.DOUBTFUL if has_doubts(project, stage) else _State.DONE
        if stage == self._context.runner.failed:
            return _State.FAILED
        return _State.STALE if stage in session.stale else _State.OPEN

    def _show(self, row: int) -> None:
        entry = self.entries[row]
        if entry.key not in self._pages:
            self._make(entry)
        self._stack.setCurrentWidget(self._pages[entry.key])
        self.shown.emit(entry.key)

    def _make(self, entry: PageEntry) -> None:
        self._pages[entry.key] = entry.make(self._context)
        self._stack.addWidget(self._pages[entry.key])


def _step_icon(state: _State | None, palette: QPalette) -> QIcon:
    """Return the sign of a page; it is blank for pages that no step belongs to.

    Parameters
    ----------
    state : _State or None
        Of the result that the page shows; None for pages of no step.
    palette : QPalette
        Of the list.
    """
    pixmap = drawn_pixmap(SIZE, _RATIO, lambda painter: None if state is None else _paint(painter, state, palette))
    icon = QIcon()
    for mode in (QIcon.Mode.Normal, QIcon.Mode.Selected):  # Qt would tint it where the line is chosen
        icon.addPixmap(pixmap, mode)
    return icon


def _paint(painter: QPainter, state: _State, palette: QPalette) -> None:
    if state is _State.OPEN:
        painter.setPen(QPen(palette.color(_Role.PlaceholderText), _THIN))
        painter.drawEllipse(_RING)
    elif state is _State.STALE:
        painter.setPen(QPen(QColor(_DONE), _THICK, Qt.PenStyle.DotLine))
        painter.drawEllipse(_RING)
    else:
        painter.setPen(Qt.PenStyle.NoPen)
        brushes = {_State.DONE: QColor(_DONE), _State.FAILED: QColor(_FAILED)}
        painter.setBrush(brushes.get(state, doubt_colour(palette)))
        painter.drawEllipse(_RING)
        painter.setPen(QPen(Qt.GlobalColor.white, _THICK, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
    for stroke in _STROKES.get(state, ()):
        painter.drawPolyline(QPolygonF([QPointF(*place) for place in stroke]))


_INTERVAL = 50  # ms between two looks, and between two pages


class Preloading(QObject):
    """Loads stages on a thread of its own; then builds one page after the other.

    Parameters
    ----------
    pages : PageStack
        Whose pages are built.
    parent : QObject, optional
        Owner.

    Signals
    -------
    ended()
        All is loaded and built.
    """

    ended = Signal()

    def __init__(self, pages: PageStack, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._pages = pages
        self._thread = threading.Thread(target=_load, name="preloading", daemon=True)
        self._timer = QTimer(self, interval=_INTERVAL)
        self._timer.timeout.connect(self._go_on)

    @property
    def is_busy(self) -> bool:
        """Whether something is still to be loaded or built."""
        return self._timer.isActive()

    def begin(self) -> None:
        """Begin to load."""
        self._thread.start()
        self._timer.start()

    def end(self) -> None:
        """Build no more pages, and wait for what is being loaded."""
        self._timer.stop()
        if self._thread.ident is not None:
            self._thread.join()

    def _go_on(self) -> None:
        if not self._thread.is_alive() and not self._pages.prepare():
            self._timer.stop()
            self.ended.emit()


def _load() -> None:
    for name in STAGES:
        parameters_class(name)
    importlib.import_module("skelgen_gui.capture.page")
