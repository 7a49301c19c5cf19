"""What a press of a mouse button becomes: a click, or one of three ways to drag."""

from __future__ import annotations

from enum import Enum

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtWidgets import QApplication


class DragKind(Enum):
    """What is going on while a button is down."""

    CLICK = "click"
    """The pointer has not moved yet, or only trembled."""
    TURN = "turn"
    SHIFT = "shift"
    BAND = "band"


class Drag:
    """A button that is down.

    Attributes
    ----------
    button : Qt.MouseButton
        Which.
    kind : DragKind
        What it has become.

    Parameters
    ----------
    place : QPointF
        Where it was pressed.
    button : Qt.MouseButton
        Which.
    """

    def __init__(self, place: QPointF, button: Qt.MouseButton) -> None:
        self.button = button
        self.kind = DragKind.CLICK
        self._start = self._last = place

    @property
    def band(self) -> QRectF:
        """The rectangle between where it was pressed and where it is."""
        return QRectF(self._start, self._last).normalized()

    def moved_to(self, place: QPointF, wants_band: bool) -> QPointF:
        """Follow the pointer and return the step that it made.

        Parameters
        ----------
        place : QPointF
            Where it is.
        wants_band : bool
            Whether the left button draws a rectangle, should this become a drag now.
        """
        if self.kind is DragKind.CLICK:
            if (place - self._start).manhattanLength() < QApplication.startDragDistance():
                return QPointF()
            left = DragKind.BAND if wants_band else DragKind.TURN
            self.kind = left if self.button == Qt.MouseButton.LeftButton else DragKind.SHIFT
        step = place - self._last
        self._last = place
        return step
