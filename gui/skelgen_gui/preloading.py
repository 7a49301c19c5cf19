"""Loads what the stages need while the window is idle, then builds its pages, so that the user need not wait later."""

from __future__ import annotations

import importlib
import threading

from PySide6.QtCore import QObject, QTimer, Signal

from skelgen.app.configuration import parameters_class
from skelgen.model.project import STAGES
from skelgen_gui.page_stack import PageStack

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
