"""What the steps of the calibration have in common: frames are taken by a job until it is told to stop."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from threading import Event
from typing import Any

from PySide6.QtCore import Qt, QTimer, Signal
from PySide6.QtWidgets import QFrame, QHBoxLayout, QLabel, QLayout, QPushButton, QScrollArea, QVBoxLayout, QWidget

from skelgen.errors import Cancelled, SkelgenError
from skelgen_gui.capture.feed import Feed
from skelgen_gui.capture.verdict_view import VerdictLabel
from skelgen_gui.jobs import Jobs


class Step(QWidget):
    """One step: a button that starts and stops, a sentence on how far it is, a verdict.

    Signals
    -------
    shot(object)
        The newest pair of images, and what was found in it.
    saved(object)
        Settings were written; their path.

    Attributes
    ----------
    go : QPushButton
        Starts and stops.
    state : QLabel
        How far it is.
    verdict : VerdictLabel
        What came out, or what is wrong.
    results : tuple of QWidget
        What shows the numbers of it.

    Parameters
    ----------
    jobs : Jobs
        Where the work is done.
    tell_error : callable (error)
        Shows faults that nobody foresaw.
    parent : QWidget, optional
        Parent widget.
    """

    shot = Signal(object)
    saved = Signal(object)

    def __init__(self, jobs: Jobs, tell_error: Callable[[Exception], None], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._jobs, self._tell_error = jobs, tell_error
        self._stop: Event | None = None
        self.feed: Feed[Any] = Feed(self)
        self.go, self.state, self.verdict = QPushButton(self), QLabel(self), VerdictLabel(self)
        self.state.setWordWrap(True)
        self.state.setTextFormat(Qt.TextFormat.PlainText)
        self.results: tuple[QWidget, ...] = ()
        self._area = QScrollArea(self)
        self.feed.arrived.connect(self.hear)
        self.go.clicked.connect(self._start_or_stop)
        jobs.begun.connect(self.follow)
        jobs.ended.connect(self.follow)

    @property
    def is_gathering(self) -> bool:
        """Whether frames are being taken."""
        return self._stop is not None

    def start(self) -> None:
        """Take frames as the form says, unless something runs."""
        raise NotImplementedError

    def hear(self) -> None:
        """Show what came newest."""
        raise NotImplementedError

    def follow(self) -> None:
        """What can be done depends on what runs and what is there."""
        if not self._jobs.is_busy:
            self._stop = None  # one that was cancelled before it began says nothing
        self.go.setText(self.tr("Stop") if self.is_gathering else self.tr("Start"))
        self.go.setEnabled(self.is_gathering or not self._jobs.is_busy)

    def stop(self) -> None:
        """End after this pair."""
        if self._stop is not None:
            self._stop.set()
            self.go.setEnabled(False)

    def run(self, title: str, work: Callable[[Any], Any], done: Callable[[Any], None]) -> None:
        """Do some work as a job; what it cannot do is told where the verdict stands."""
        self._jobs.start(title, work, done, self._fail)

    def gather(self, title: str, stop: Event, work: Callable[[Any], Any], done: Callable[[Any], None]) -> None:
        """Take frames as a job, until `stop` is set."""

        def until_cancelled(monitor: Any) -> Any:
            try:
                return work(monitor)
            except Cancelled:  # as good an end as any: what was taken stays
                return None

        def finish(result: Any) -> None:
            self._stop = None
            self.hear()
            done(result)
            self.follow()

        self._stop = stop
        if not self._jobs.start(title, until_cancelled, finish, self._fail):
            self._stop = None
        self.follow()

    def show_end(self) -> None:
        """Scroll to what came out, the verdict before all, when the layout has made room."""

        def scroll() -> None:
            for widget in (*self.results, self.verdict):
                self._area.ensureWidgetVisible(widget)

        QTimer.singleShot(0, self, scroll)

    def lay_out(self, parts: Iterable[QWidget | QLayout]) -> None:
        """Put everything below each other, where it can be scrolled."""
        inner = QWidget(self)
        column = QVBoxLayout(inner)
        for part in parts:
            if isinstance(part, QWidget):
                column.addWidget(part)
            else:
                column.addLayout(part)
        column.addStretch(1)
        area = self._area
        area.setWidgetResizable(True)
        area.setFrameShape(QFrame.Shape.NoFrame)
        area.setFocusPolicy(Qt.FocusPolicy.NoFocus)  # what is in it is reached by Tab, and scrolled to
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(inner)
        layout = QVBoxLayout(self)
        layout.setContentsMargins(0, 0, 0, 0)
        layout.addWidget(area)

    def _start_or_stop(self) -> None:
        if self.is_gathering:
            self.stop()
        else:
            self.start()

    def _fail(self, error: Exception) -> None:
        self._stop = None
        self.hear()
        if isinstance(error, SkelgenError):
            self.verdict.show_problem(str(error))
            self.show_end()
        else:
            self._tell_error(error)
        self.follow()


def row_of(*widgets: QWidget) -> QHBoxLayout:
    """Return widgets beside each other."""
    row = QHBoxLayout()
    for widget in widgets:
        row.addWidget(widget)
    return row
