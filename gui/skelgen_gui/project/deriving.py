"""Derives what a widget shows of a project: on a thread, as long takes need more time than the window may wait; or only
while the widget is seen.

The threads are Python's. A thread pool of Qt would wait for its threads in its destructor while it holds Python's lock,
so that neither could go on.
"""

from __future__ import annotations

import contextlib
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QShowEvent
from PySide6.QtWidgets import QWidget
from shiboken6 import Shiboken

from skelgen.errors import SkelgenError

_T = TypeVar("_T")

_PAINT_FIRST = 15  # ms before a thread begins, so that changes are painted first, without waiting for Python's lock

# Held while something is derived: a change may start many threads, and the window competes with one only
_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class _Failure:
    error: Exception


class _Courier(QObject):
    """Carries results to the window's thread; unlike a deriver it is never deleted while a thread runs."""

    arrived = Signal(object, object, object)

    def __init__(self) -> None:
        super().__init__()
        self.arrived.connect(self._deliver)

    def _deliver(self, reference: weakref.ref[Deriver], number: int, result: object) -> None:
        deriver = reference()
        if deriver is not None and Shiboken.isValid(deriver):
            deriver.hand_over(number, result)


_the_courier = cache(_Courier)  # made in the window's thread


class Deriver(QObject):
    """Calls pure functions on a thread, one at a time in the whole window, and hands the last one's result over.

    The result is handed over in the window's thread.

    Signals
    -------
    finished()
        A result was handed over, and no other is awaited.
    """

    finished = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._request: tuple[int, Callable[[], object]] | None = None
        self._number = 0
        self._then: Callable[[Any], None] | None = None
        self._failed: Callable[[SkelgenError], None] | None = None
        self._soon = QTimer(self, interval=_PAINT_FIRST, singleShot=True)
        self._soon.timeout.connect(self._begin)
        self._courier = _the_courier()

    @property
    def is_busy(self) -> bool:
        """Whether a result is awaited."""
        return self._then is not None

    def derive(
        self,
        function: Callable[[], _T],
        then: Callable[[_T], None],
        failed: Callable[[SkelgenError], None] | None = None,
    ) -> None:
        """Call a function in the background; an earlier request that is not done yet is forgotten.

        Parameters
        ----------
        function : callable
            Pure, without Qt.
        then : callable
            Is called with its result; an error is raised in the window's thread instead.
        failed : callable, optional
            Is called with an error that the user can act on, which is not raised then.
        """
        self.forget()
        self._then, self._failed = then, failed
        with self._lock:
            self._request = (self._number, function)
        self._soon.start()

    def forget(self) -> None:
        """Forget the request that is not done yet."""
        with self._lock:
            self._request = None
        self._number += 1
        self._then = None

    def wait(self) -> None:
        """Wait until nothing runs any more."""
        with self._lock:
            self._request = None
            thread = self._thread
        if thread is not None:
            thread.join()

    def _begin(self) -> None:
        """Start a thread for the request; by now all widgets have followed the change, and are painted."""
        with self._lock:
            if self._thread is None and self._request is not None:
                self._thread = threading.Thread(target=self._work, name="deriving", daemon=True)
                self._thread.start()

    def _work(self) -> None:
        """Do the last request when it is its turn, until there is none."""
        while True:
            with _ONE_AT_A_TIME:
                with self._lock:
                    if self._request is None:
                        self._thread = None
                        return
                    number, function = self._request
                    self._request = None
                self._run(number, function)

    def _run(self, number: int, function: Callable[[], object]) -> None:
        result: object
        try:
            result = function()
        except Exception as error:  # all: a bug must reach the window's error dialog
            result = _Failure(error)
        with contextlib.suppress(RuntimeError):  # the window is gone, and with it the deriver
            self._courier.arrived.emit(weakref.ref(self), number, result)

    def hand_over(self, number: int, result: object) -> None:
        """Pass a result on, in the window's thread, unless there was another request since.

        Parameters
        ----------
        number : int
            Number of the request.
        result : object
            What the function returned, or a failure.
        """
        if number == self._number and self._then is not None:
            then, self._then = self._then, None
            if not isinstance(result, _Failure):
                then(result)
            elif self._failed is not None and isinstance(result.error, SkelgenError):
                self._failed(result.error)
            else:
                raise result.error
            self.finished.emit()


class PanelWhileSeen(QWidget):
    """A panel that lists a project only while it is seen, and catches up when it is shown.

    Docks behind the tab of another one count as visible for Qt, which only puts them out of sight; whoever makes the
    dock connects its `visibilityChanged` with `come_into_sight`.
    """

    def __init__(self) -> None:
        super().__init__()
        self._is_stale = True

    @property
    def is_seen(self) -> bool:
        """Whether any of it is in sight."""
        return self.isVisible() and not self.visibleRegion().isEmpty()

    def come_into_sight(self, is_seen: bool = True) -> None:
        """List what there is by now, if it is seen again."""
        if is_seen:
            self._catch_up()

    def showEvent(self, event: QShowEvent) -> None:
        """List what there is by now."""
        super().showEvent(event)
        self.come_into_sight()

    def _follow_project(self) -> None:
        self._is_stale = True
        if self.is_seen:
            self._catch_up()

    def _catch_up(self) -> None:
        """List what there is by now, if that is not done yet."""
        if self._is_stale:
            self._is_stale = False
            self._list_project()

    def _list_project(self) -> None:
        """List the project as it is by now."""
        raise NotImplementedError
