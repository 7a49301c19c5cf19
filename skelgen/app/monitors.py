"""Monitors that the application puts between a stage and whoever watches."""

from __future__ import annotations

from skelgen.progress import Monitor


class CollectingMonitor:
    """Keep every notice and pass everything on.

    Parameters
    ----------
    watcher : Monitor
        Receives all calls; its `Cancelled` goes through to the stage.

    Attributes
    ----------
    notices : list of str
        What was noticed so far, without repetitions.
    """

    def __init__(self, watcher: Monitor) -> None:
        self._watcher = watcher
        self.notices: list[str] = []

    def begin(self, name: str) -> None:
        """Pass the start on."""
        self._watcher.begin(name)

    def advance(self, done: float, total: float) -> None:
        """Pass the progress on."""
        self._watcher.advance(done, total)

    def notice(self, sentence: str) -> None:
        """Keep the notice and pass it on, once."""
        if sentence not in self.notices:
            self.notices.append(sentence)
            self._watcher.notice(sentence)
