"""What a widget shows of a project, derived in the background: long takes need more time than a window may wait.

The threads are Python's: a pool of Qt's would wait for them in its destructor, which runs with the interpreter locked
when a widget goes, so that neither could go on.
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
from shiboken6 import Shiboken

_T = TypeVar("_T")

PAINT_FIRST = 15
"""ms before a thread begins: what changed is painted first, since Python's lock then need not be waited for."""

_ONE_AT_A_TIME = threading.Lock()
"""Held while something is derived: of the many threads that a change starts, the window waits for one only."""


@dataclass(frozen=True)
class _Failure:
    error: Exception


@dataclass(frozen=True)
class _Letter:
    """A result on its way."""

    deriver: weakref.ref[Deriver]
    number: int
    result: object


class _Post(QObject):
    """Carries results to the window's thread. It is never deleted: a deriver may be, while its thread hands over."""

    arrived = Signal(object)

    def __init__(self) -> None:
        super().__init__()
        self.arrived.connect(self._deliver)

    def _deliver(self, letter: _Letter) -> None:
        deriver = letter.deriver()
        if deriver is not None and Shiboken.isValid(deriver):
            deriver.hand_over(letter.number, letter.result)


@cache
def _the_post() -> _Post:
    """Return the one post, made in the window's thread."""
    return _Post()


class Deriver(QObject):
    """Calls pure functions in a thread, one at a time in all the window, and hands over the last one's result.

    What it calls with the result, it calls in the window's thread.

    Signals
    -------
    settled()
        A result was handed over, and nothing is awaited any more.
    """

    settled = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None
        self._wished: tuple[int, Callable[[], object]] | None = None
        self._number = 0
        self._then: Callable[[Any], None] | None = None
        self._soon = QTimer(self, interval=PAINT_FIRST, singleShot=True)
        self._soon.timeout.connect(self._begin)
        self._post = _the_post()

    @property
    def is_busy(self) -> bool:
        """Whether a result is awaited."""
        return self._then is not None

    def derive(self, function: Callable[[], _T], then: Callable[[_T], None]) -> None:
        """Call a function in the background; what was wished before and is not there yet is forgotten.

        Parameters
        ----------
        function : callable
            Pure, without Qt.
        then : callable
            Is called with its result; an error is raised in the window's thread instead.
        """
        self.forget()
        self._then = then
        with self._lock:
            self._wished = (self._number, function)
        self._soon.start()

    def forget(self) -> None:
        """Do not hand over what was wished and is not there yet."""
        with self._lock:
            self._wished = None
        self._number += 1
        self._then = None

    def wait(self) -> None:
        """Wait until nothing runs any more."""
        with self._lock:
            self._wished = None
            thread = self._thread
        if thread is not None:
            thread.join()

    def _begin(self) -> None:
        """Start a thread for what is wished; by now all that follow a signal have heard of it, and are painted."""
        with self._lock:
            if self._thread is None and self._wished is not None:
                self._thread = threading.Thread(target=self._work, name="deriving", daemon=True)
                self._thread.start()

    def _work(self) -> None:
        """Do what was wished last, until nothing is."""
        while self._do_one():
            pass

    def _do_one(self) -> bool:
        """Do what is wished, when it is its turn; whether there was anything."""
        with _ONE_AT_A_TIME:
            with self._lock:
                if self._wished is None:
                    self._thread = None
                    return False
                number, function = self._wished
                self._wished = None
            self._run(number, function)
            return True

    def _run(self, number: int, function: Callable[[], object]) -> None:
        result: object
        try:
            result = function()
        except Exception as error:  # all: a bug must reach the window's error dialog
            result = _Failure(error)
        with contextlib.suppress(RuntimeError):  # the window is gone, and with it who waits
            self._post.arrived.emit(_Letter(weakref.ref(self), number, result))

    def hand_over(self, number: int, result: object) -> None:
        """Call who waits for a result, in the window's thread, unless something else was wished since.

        Parameters
        ----------
        number : int
            Number of the request.
        result : object
            What the function returned, or a failure.
        """
        if number == self._number and self._then is not None:
            then, self._then = self._then, None
            if isinstance(result, _Failure):
                raise result.error
            then(result)
            self.settled.emit()
