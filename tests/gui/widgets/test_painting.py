"""Lines and points in one call look as if they were drawn one by one."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QLineF, QPointF
from PySide6.QtGui import QColor, QImage, QPainter, QPen
from skelgen_gui.widgets.painting import draw_lines, draw_points


def painted(paint):
    image = QImage(120, 90, QImage.Format.Format_RGB32)
    image.fill(QColor("white"))
    with QPainter(image) as painter:
        painter.setPen(QPen(QColor("black"), 2.0))
        paint(painter)
    return image


@pytest.fixture
def places(qtbot):
    """Ends of 50 lines, a view into a larger array."""
    return np.random.default_rng(0).uniform(0, 90, (50, 2, 3))[..., :2]


def test_lines_are_those_that_are_drawn_one_by_one(places):
    def one_by_one(painter):
        for (x1, y1), (x2, y2) in places.tolist():
            painter.drawLine(QLineF(x1, y1, x2, y2))

    assert painted(lambda painter: draw_lines(painter, places)) == painted(one_by_one)


def test_points_are_those_that_are_drawn_one_by_one(places):
    def one_by_one(painter):
        for x, y in places[:, 0].tolist():
            painter.drawPoint(QPointF(x, y))

    assert painted(lambda painter: draw_points(painter, places[:, 0])) == painted(one_by_one)


def test_nothing_is_drawn_of_nothing(qtbot):
    def paint(painter):
        draw_lines(painter, np.zeros((0, 2, 2)))
        draw_points(painter, np.zeros((0, 2)))

    assert painted(paint) == painted(lambda painter: None)
