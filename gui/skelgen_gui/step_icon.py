"""The sign before a step in the list: a tick once its result is there, an empty ring before."""

from __future__ import annotations

from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QIcon, QPainter, QPalette, QPen, QPixmap, QPolygonF

SIZE = 16.0
"""px, of the sign with what is free about it."""

_RATIO = 3.0  # pixels per point: sharp on any screen
_RING = QRectF(2.5, 2.5, 11.0, 11.0)
_TICK = ((5.0, 8.2), (7.2, 10.4), (11.2, 5.8))
_DONE = "#2b8a3e"  # green, with a white tick: the same on both grounds
_THIN, _THICK = 1.2, 1.8
_Role = QPalette.ColorRole


def step_icon(*, is_step: bool, is_done: bool, palette: QPalette) -> QIcon:
    """Return the sign of a page; nothing but room for pages that no step belongs to.

    Parameters
    ----------
    is_step : bool
        Whether the page shows the result of a step.
    is_done : bool
        Whether that result is there.
    palette : QPalette
        Of the list.
    """
    pixmap = QPixmap(round(SIZE * _RATIO), round(SIZE * _RATIO))
    pixmap.setDevicePixelRatio(_RATIO)
    pixmap.fill(Qt.GlobalColor.transparent)
    if is_step:
        with QPainter(pixmap) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            _paint(painter, is_done, palette)
    icon = QIcon()
    for mode in (QIcon.Mode.Normal, QIcon.Mode.Selected):  # Qt would tint it where the line is chosen
        icon.addPixmap(pixmap, mode)
    return icon


def _paint(painter: QPainter, is_done: bool, palette: QPalette) -> None:
    if is_done:
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(_DONE))
        painter.drawEllipse(_RING)
        painter.setPen(QPen(Qt.GlobalColor.white, _THICK, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawPolyline(QPolygonF([QPointF(*place) for place in _TICK]))
    else:
        painter.setPen(QPen(palette.color(_Role.PlaceholderText), _THIN))
        painter.drawEllipse(_RING)
