"""What the wheel and keys do in every picture over time."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent, QWheelEvent

from skelgen_gui.pictures import ZOOM, notches
from skelgen_gui.timeline.scale import GUTTER
from skelgen_gui.timeline.span import VisibleSpan

_PAN = 0.1  # of what is in sight, per notch


def zoom_or_pan(event: QWheelEvent, span: VisibleSpan, width: float) -> None:
    """Zoom about the pointer; pan with Shift, Alt or a sideways wheel.

    Parameters
    ----------
    event : QWheelEvent
        Is accepted.
    span : VisibleSpan
        What is in sight.
    width : float, px
        Of the part of the picture that shows frames.
    """
    across, away = notches(event)
    length = span.end - span.first
    if across:
        span.pan(-across * _PAN * length)
    elif event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
        span.pan(-away * _PAN * length)
    else:
        about = span.first + (event.position().x() - GUTTER) * length / width
        span.zoom(ZOOM**away, min(max(about, span.first), span.end))
    event.accept()


def zoomed_by_key(event: QKeyEvent, span: VisibleSpan, frame: int) -> bool:
    """Zoom about the shown frame with Ctrl and plus or minus, show all with Ctrl+0; say whether it was one of these."""
    if not event.modifiers() & Qt.KeyboardModifier.ControlModifier:
        return False
    key = event.key()
    if key in {Qt.Key.Key_Plus, Qt.Key.Key_Equal}:
        span.zoom(ZOOM**2, frame + 0.5)
    elif key == Qt.Key.Key_Minus:
        span.zoom(ZOOM**-2, frame + 0.5)
    elif key == Qt.Key.Key_0:
        span.show_all()
    else:
        return False
    return True
