"""The stretch of the take that lanes and curves show, which they share."""

from __future__ import annotations

import math

from PySide6.QtCore import QObject, Signal

from skelgen.model import Take
from skelgen_gui.session import Session

FEWEST_FRAMES = 8.0
"""Frames that are shown at the largest zoom."""

_LEAD = 0.1  # part of the stretch before a frame that was brought into sight: most people go on forward


class VisibleSpan(QObject):
    """Which frames are in sight; frame f lies from f to f + 1.

    Parameters
    ----------
    session : Session
        A take that is opened is shown whole; the session's frame is kept in sight.

    Signals
    -------
    changed()
        Other frames are in sight.
    """

    changed = Signal()

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._take: Take | None = None
        self._first, self._end = 0.0, 1.0
        session.project_changed.connect(self._follow_project)
        session.frame_changed.connect(self._reveal)
        self._follow_project()

    @property
    def first(self) -> float:
        """Where the stretch begins [frames]."""
        return self._first

    @property
    def end(self) -> float:
        """Where it ends [frames]."""
        return self._end

    def show_all(self) -> None:
        """Show the whole take."""
        self.show(0.0, float(self._n_frames))

    def show(self, first: float, end: float) -> None:
        """Show a stretch, moved and cut so that it lies in the take."""
        whole = float(self._n_frames)
        length = min(max(end - first, FEWEST_FRAMES), whole)
        first = min(max(first, 0.0), whole - length)
        if (first, first + length) != (self._first, self._end):
            self._first, self._end = first, first + length
            self.changed.emit()

    def zoom(self, factor: float, about: float) -> None:
        """Show a stretch that is shorter by a factor, with the frame `about` where it was."""
        self.show(about - (about - self._first) / factor, about + (self._end - about) / factor)

    def pan(self, frames: float) -> None:
        """Show what lies some frames later, or earlier if negative."""
        self.show(self._first + frames, self._end + frames)

    def place(self, frame: float, left: float, width: float) -> float:
        """Return where a frame begins in a picture [px]; half a frame more is its middle."""
        return left + (frame - self._first) * width / (self._end - self._first)

    def frame_at(self, x: float, left: float, width: float) -> int:
        """Return the frame at a place of a picture [px]; beyond its ends the first or last of the take."""
        frame = math.floor(self._first + (x - left) * (self._end - self._first) / max(width, 1.0))
        return min(max(frame, 0), self._n_frames - 1)

    @property
    def _n_frames(self) -> int:
        return max(self._session.n_frames, 1)

    def _follow_project(self) -> None:
        take = None if self._session.project is None else self._session.project.take
        if take is not self._take:
            self._take = take
            self.show_all()
            self.changed.emit()

    def _reveal(self, frame: int) -> None:
        if not self._first <= frame < self._end:
            length = self._end - self._first
            self.show(frame - _LEAD * length, frame + (1 - _LEAD) * length)
