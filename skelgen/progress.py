"""One idea of progress and cancelling, silent by default: the last argument of every long function."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Protocol, TypeVar

from skelgen.errors import Cancelled

_T = TypeVar("_T")

_TOLD_EVERY = 50  # items; telling costs a call, and nobody sees smaller steps


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


def told(items: Iterable[_T], n_items: int, monitor: Monitor, every: int = _TOLD_EVERY) -> Iterator[_T]:
    """Yield items, and tell a monitor how many of them are done; it may raise `Cancelled`.

    Parameters
    ----------
    items : iterable
        What is worked on.
    n_items : int
        How many there are.
    monitor : Monitor
        Is told.
    every : int
        After how many items it is told.
    """
    for done, item in enumerate(items):
        if done % every == 0:
            monitor.advance(done, n_items)
        yield item


__all__ = ["SILENT", "Cancelled", "Monitor", "SilentMonitor", "told"]
