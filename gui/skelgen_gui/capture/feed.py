"""The newest result of a capture, handed from its thread to the window's: what nobody has looked at is replaced."""

from __future__ import annotations

import threading
import time
from typing import Generic, TypeVar

from PySide6.QtCore import QObject, Signal

T = TypeVar("T")

INTERVAL = 1 / 40
"""s between two results that the window is told of: more pictures a second than that cost time and show nothing."""


class Feed(QObject, Generic[T]):
    """Holds one result, and the sentences that were said since somebody looked.

    Signals
    -------
    arrived()
        There is something new; emitted once until it is taken.
    """

    arrived = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._lock = threading.Lock()
        self._newest: T | None = None
        self._said: list[str] = []
        self._is_told = False
        self._told_at = 0.0

    def put(self, newest: T) -> None:
        """Replace the result; from any thread."""
        with self._lock:
            self._newest = newest
            now = time.monotonic()
            tells = not self._is_told and now - self._told_at >= INTERVAL
            if tells:
                self._is_told, self._told_at = True, now
        if tells:
            self.arrived.emit()

    def say(self, sentence: str) -> None:
        """Add a sentence, which waits until it is taken; from any thread."""
        with self._lock:
            self._said.append(sentence)

    def take(self) -> tuple[T | None, tuple[str, ...]]:
        """Return the newest result, None if it was taken already, and what was said since."""
        with self._lock:
            newest, said = self._newest, tuple(self._said)
            self._newest, self._is_told = None, False
            self._said.clear()
        return newest, said

    @property
    def is_waited_for(self) -> bool:
        """Whether the window would be told of a result now: others need not be made."""
        with self._lock:
            return not self._is_told and time.monotonic() - self._told_at >= INTERVAL
