"""Lines and points in one call look as if they were drawn one by one; names cover none."""

from __future__ import annotations

import numpy as np
import pytest
from PySide6.QtCore import QLineF, QPointF
from PySide6.QtGui import QColor, QImage, QPainter, QPen
from skelgen_gui.widgets.painting import draw_lines, draw_names, draw_points


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


def test_names_at_one_place_do_not_cover_each_other(qtbot):
    def rows_of(image, colour):
        return {y for y in range(image.height()) for x in range(image.width()) if image.pixelColor(x, y) == colour}

    red, blue = QColor("red"), QColor("blue")
    place = QPointF(10.0, 30.0)
    image = painted(lambda painter: draw_names(painter, [("upper arm", place, red), ("lower arm", place, blue)]))
    assert rows_of(image, red) and rows_of(image, blue)
    assert max(rows_of(image, red)) < min(rows_of(image, blue))
