"""A monitor that tells a widget of one job's progress, and lets that widget cancel it."""

from __future__ import annotations

import threading

from PySide6.QtCore import QObject, Signal

from skelgen.errors import Cancelled
from skelgen.progress import Monitor


class Watched(QObject):
    """Stands between a job and the monitor that it is given; may be called from any thread.

    Signals
    -------
    progressed(float)
        Share of the current work that is done.
    """

    progressed = Signal(float)

    def __init__(self, parent: QObject) -> None:
        super().__init__(parent)
        self._stop = threading.Event()
        self._monitor: Monitor | None = None

    def watching(self, monitor: Monitor) -> Monitor:
        """Return itself as the monitor of a job, which passes everything on."""
        self._monitor = monitor
        return self

    def cancel(self) -> None:
        """Ask the job to stop at the next chance."""
        self._stop.set()

    def begin(self, name: str) -> None:
        """Tell that a part of the work starts."""
        self._look()
        if self._monitor is not None:
            self._monitor.begin(name)

    def advance(self, done: float, total: float) -> None:
        """Tell how much of the part is done."""
        self._look()
        self.progressed.emit(min(done / total, 1.0) if total else 1.0)
        if self._monitor is not None:
            self._monitor.advance(done, total)

    def notice(self, sentence: str) -> None:
        """Pass a sentence on."""
        if self._monitor is not None:
            self._monitor.notice(sentence)

    def _look(self) -> None:
        if self._stop.is_set():
            raise Cancelled
