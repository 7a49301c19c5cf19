"""Many lines or points in one call of the painter, straight from an array: a Python object for each would cost more."""

from __future__ import annotations

from typing import cast

import numpy as np
from PySide6.QtCore import QLineF, QPointF
from PySide6.QtGui import QPainter
from shiboken6 import Shiboken

from skelgen.model.arrays import Floats


def draw_lines(painter: QPainter, ends: Floats) -> None:
    """Draw lines with the painter's pen.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    ends : ndarray, shape (n_lines, 2, 2), px
        Both ends of each line as x and y; finite.
    """
    if len(ends):
        ends = np.ascontiguousarray(ends, dtype=np.float64)
        # A QLineF is four doubles. The wrapper owns nothing, and lives no longer than this call.
        first = cast(QLineF, Shiboken.wrapInstance(ends.ctypes.data, QLineF))
        painter.drawLines(first, len(ends))


def draw_points(painter: QPainter, points: Floats) -> None:
    """Draw points with the painter's pen: discs of its width, if its caps are round.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    points : ndarray, shape (n_points, 2), px
        Places as x and y; finite.
    """
    if len(points):
        points = np.ascontiguousarray(points, dtype=np.float64)
        first = cast(QPointF, Shiboken.wrapInstance(points.ctypes.data, QPointF))
        painter.drawPoints(first, len(points))
