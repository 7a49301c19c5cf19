"""What pictures share: how far the wheel zooms, and the words that stand where there is nothing to see yet."""

from __future__ import annotations

from PySide6.QtCore import QRectF, Qt
from PySide6.QtGui import QPainter, QPalette, QWheelEvent

ZOOM = 1.25
"""By how much a notch of the wheel enlarges."""

_NOTCH = 120.0  # eighths of a degree that most wheels turn by


def notches(event: QWheelEvent) -> tuple[float, float]:
    """Return by how many notches a wheel was turned: sideways, and away from the user."""
    turned = event.angleDelta()
    return turned.x() / _NOTCH, turned.y() / _NOTCH


def paint_words(painter: QPainter, room: QRectF, words: str, palette: QPalette) -> None:
    """Write words that say why there is nothing to see, and what to do.

    Parameters
    ----------
    painter : QPainter
        Whose pen is changed.
    room : QRectF
        In whose middle they stand.
    words : str
        Are wrapped where they are too long.
    palette : QPalette
        Of the widget.
    """
    painter.setPen(palette.color(QPalette.ColorRole.PlaceholderText))
    painter.drawText(room, Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap, words)
