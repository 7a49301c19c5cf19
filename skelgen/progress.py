"""One idea of progress and cancelling, silent by default: the last argument of every long function."""

from __future__ import annotations

from typing import Protocol

from skelgen.errors import Cancelled


class Monitor(Protocol):
    """What a long computation tells its caller, and how it is told to stop."""

    def begin(self, name: str) -> None:
        """Say that the work called `name` starts."""

    def advance(self, done: float, total: float) -> None:
        """Say that `done` of `total` units of the current work are finished; raise `Cancelled` to stop it."""

    def notice(self, sentence: str) -> None:
        """Say something that the user should know but that stops nothing."""


class SilentMonitor:
    """A monitor that says nothing and never cancels."""

    def begin(self, name: str) -> None:
        """Ignore the start."""

    def advance(self, done: float, total: float) -> None:
        """Ignore the progress."""

    def notice(self, sentence: str) -> None:
        """Ignore the notice."""


SILENT = SilentMonitor()

__all__ = ["SILENT", "Cancelled", "Monitor", "SilentMonitor"]
