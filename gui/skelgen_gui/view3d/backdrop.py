"""Paint the parts that stay the same while a take plays: background, floor grid, axes of the world."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPen

from skelgen.model.arrays import Floats
from skelgen_gui.model.picture import Canvas
from skelgen_gui.model.view_camera import N_FADES, Floor
from skelgen_gui.view3d.colours import Colours
from skelgen_gui.widgets.painting import draw_lines

AXIS_NAMES = ("X", "Y", "Z")
_TRIAD = 30.0  # px
_CORNER = 46.0  # px, of the triad's origin from the lower left corner
_LINE_ALPHA = (70, 52, 32, 12)  # of the grid, from the middle to the edge


def paint_background(painter: QPainter, canvas: Canvas, colours: Colours) -> None:
    """Fill the picture.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    canvas : Canvas
        How large the picture is.
    colours : Colours
        Colours.
    """
    sky = QLinearGradient(0, 0, 0, canvas.height)
    sky.setColorAt(0, colours.above)
    sky.setColorAt(1, colours.below)
    painter.fillRect(0, 0, canvas.width, canvas.height, sky)


def paint_floor(painter: QPainter, floor: Floor, canvas: Canvas, colours: Colours) -> None:
    """Paint the grid, and the world's axes on it where they start within it.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    floor : Floor
        The floor.
    canvas : Canvas
        From where, and how large.
    colours : Colours
        Colours.
    """
    places, _ = canvas.project(floor.lines)
    for fade in range(N_FADES):
        ink = QColor(colours.ink)
        ink.setAlpha(_LINE_ALPHA[fade])
        painter.setPen(QPen(ink, 1.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
        draw_lines(painter, places[floor.fade == fade])
    _paint_origin(painter, floor, canvas, colours)


def paint_triad(painter: QPainter, canvas: Canvas, colours: Colours) -> None:
    """Paint the directions of the world's axes in the lower left corner, the farthest first.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    canvas : Canvas
        From where, and how large.
    colours : Colours
        Colours.
    """
    basis = canvas.viewpoint.basis
    origin = QPointF(_CORNER, canvas.height - _CORNER)
    for axis in np.argsort(basis[2]).tolist():
        direction = QPointF(basis[0, axis], -basis[1, axis])
        painter.setPen(QPen(colours.axes[axis], 2.2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawLine(origin, origin + direction * _TRIAD)
        middle = origin + direction * (_TRIAD + 10)
        painter.drawText(QRectF(middle.x() - 9, middle.y() - 9, 18, 18), Qt.AlignmentFlag.AlignCenter, AXIS_NAMES[axis])


def _paint_origin(painter: QPainter, floor: Floor, canvas: Canvas, colours: Colours) -> None:
    """Two cells of the world's level axes, from its origin."""
    corners = floor.lines.reshape(-1, 3)
    for axis in (axis for axis in range(3) if axis != floor.up):
        end = floor.origin.copy()
        end[axis] += 2 * floor.spacing
        ends: Floats = np.stack([floor.origin, end])
        if not ((ends >= corners.min(axis=0) - 1e-6) & (ends <= corners.max(axis=0) + 1e-6)).all():
            continue
        places, _ = canvas.project(ends[np.newaxis])
        ink = QColor(colours.axes[axis])
        ink.setAlpha(170)
        painter.setPen(QPen(ink, 2.0))
        draw_lines(painter, places)
