"""How mouse, wheel and keys move the viewer: what a press of a button becomes, and what it does to the viewpoint."""

import math
from enum import Enum

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QApplication, QWidget

from skelgen_gui.model.viewpoint import Viewpoint

ARROWS = {Qt.Key.Key_Left: (-1, 0), Qt.Key.Key_Right: (1, 0), Qt.Key.Key_Up: (0, -1), Qt.Key.Key_Down: (0, 1)}
"""Directions of the arrow keys: right, down."""

ZOOMS = {Qt.Key.Key_Plus: 1.2, Qt.Key.Key_Equal: 1.2, Qt.Key.Key_Minus: 1 / 1.2}
"""Factors of the keys that zoom."""

KEY_TURN = math.radians(6)
"""rad, for each press of an arrow key."""

KEY_SHIFT = 40.0
"""px, for each press of an arrow key."""

_TURN = math.radians(0.4)  # per pixel dragged
_WHEEL = 1.0012  # per eighth of a degree: a notch, 120, is 15 %


class DragKind(Enum):
    """The act of a drag while a button is down."""

    CLICK = "click"
    """The pointer has not moved yet, or only trembled."""
    TURN = "turn"
    SHIFT = "shift"
    BAND = "band"


class Drag:
    """A drag of the mouse: the button that is down, and what it moves.

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


def dragged(viewpoint: Viewpoint, kind: DragKind, step: QPointF, height: float) -> Viewpoint:
    """Turn or shift the viewpoint by a step of the pointer.

    Parameters
    ----------
    viewpoint : Viewpoint
        Before the step.
    kind : DragKind
        What the drag does; others than turning and shifting leave the viewpoint.
    step : QPointF, px
        How far the pointer went.
    height : float, px
        Height of the picture.
    """
    if kind is DragKind.TURN:
        return viewpoint.orbited(-_TURN * step.x(), _TURN * step.y())
    return viewpoint.panned(step.x(), step.y(), height) if kind is DragKind.SHIFT else viewpoint


def wheeled(viewpoint: Viewpoint, event: QWheelEvent, widget: QWidget) -> Viewpoint:
    """Zoom the viewpoint at the pointer.

    Parameters
    ----------
    viewpoint : Viewpoint
        Before the wheel was turned.
    event : QWheelEvent
        How far it was turned.
    widget : QWidget
        Shows the picture.
    """
    place = event.position() - QPointF(widget.width() / 2, widget.height() / 2)
    return viewpoint.zoomed(_WHEEL ** event.angleDelta().y(), place.x(), place.y(), widget.height())
