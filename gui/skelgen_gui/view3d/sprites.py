"""Balls and rings, painted once and then copied: a copy costs a third of an ellipse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from enum import Enum

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPixmap, QRadialGradient

RADIUS_STEP = 0.5
"""Sprites are made for radii in steps of so many pixels."""

MOST_SPRITES = 2000
"""Sprites kept: 20 colours in 5 depths, 4 styles and 5 radii."""


class Style(Enum):
    """What a ball looks like."""

    BALL = "ball"
    DOUBTFUL = "doubtful"
    HOLLOW = "hollow"
    JOINT = "joint"
    RING = "ring"
    """Around what is selected."""


class Sprites:
    """Sprites for one resolution of the screen.

    Parameters
    ----------
    ratio : float
        Pixels of the screen per pixel of the window.
    """

    def __init__(self, ratio: float) -> None:
        self.ratio = ratio
        self._kept: dict[tuple[Style, int, int, int], QPixmap] = {}

    def draw(self, painter: QPainter, place: Sequence[float], radius: float, style: Style, *colours: QColor) -> None:
        """Draw a sprite around a place.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        place : sequence of float, px
            Its middle, x and y.
        radius : float, px
            Its size.
        style : Style
            What it looks like.
        *colours : QColor
            Of the ball or ring, and of what marks it (the ring of a doubtful one, the edge of a joint or ring).
        """
        step = max(round(radius / RADIUS_STEP), 2)
        key = (style, step, colours[0].rgba(), colours[-1].rgba())
        pixmap = self._kept.get(key)
        if pixmap is None:
            if len(self._kept) >= MOST_SPRITES:
                self._kept.clear()
            pixmap = self._kept[key] = self._made(step * RADIUS_STEP, style, colours[0], colours[-1])
        half = pixmap.width() / self.ratio / 2
        painter.drawPixmap(QPointF(place[0] - half, place[1] - half), pixmap)

    def _made(self, radius: float, style: Style, colour: QColor, mark: QColor) -> QPixmap:
        side = 2 * math.ceil(radius + 5.0)
        pixmap = QPixmap(math.ceil(side * self.ratio), math.ceil(side * self.ratio))
        pixmap.setDevicePixelRatio(self.ratio)
        pixmap.fill(Qt.GlobalColor.transparent)
        with QPainter(pixmap) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            _PAINTERS[style](painter, QPointF(side / 2, side / 2), radius, colour, mark)
        return pixmap


def _ball(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    """A ball that is lit from the upper left."""
    light = QRadialGradient(middle, radius, middle - QPointF(0.38, 0.42) * radius)
    light.setColorAt(0.0, colour.lighter(145))
    light.setColorAt(0.45, colour)
    light.setColorAt(1.0, colour.darker(128))
    painter.setPen(QPen(colour.darker(165), 0.8))
    painter.setBrush(light)
    painter.drawEllipse(middle, radius, radius)


def _doubtful(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    _ball(painter, middle, 0.72 * radius, colour, colour)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(mark, 1.8))
    painter.drawEllipse(middle, radius + 1.8, radius + 1.8)


def _hollow(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    inside = QColor(colour)
    inside.setAlpha(45)
    painter.setBrush(inside)
    painter.setPen(QPen(colour, 1.5))
    painter.drawEllipse(middle, radius - 0.5, radius - 0.5)


def _joint(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    painter.setBrush(colour)
    painter.setPen(QPen(mark, max(0.36 * radius, 1.2)))
    painter.drawEllipse(middle, 0.85 * radius, 0.85 * radius)


def _ring(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for ink, width in ((mark, 4.4), (colour, 2.2)):
        painter.setPen(QPen(ink, width))
        painter.drawEllipse(middle, radius + 3.0, radius + 3.0)


_PAINTERS = {
    Style.BALL: _ball,
    Style.DOUBTFUL: _doubtful,
    Style.HOLLOW: _hollow,
    Style.JOINT: _joint,
    Style.RING: _ring,
}
