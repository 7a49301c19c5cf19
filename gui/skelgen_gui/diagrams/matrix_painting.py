"""Paints a matrix of distance deviations with its limbs, names, and bar of colours."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QImage, QPainter, QPalette, QPen

from skelgen.app.drawing.measures import DeviationMatrix
from skelgen.app.drawing.scales import ramp_rgba
from skelgen.app.drawing.wording import plain
from skelgen_gui.model.matrix import Box, PlacedRegion, Region, cell_sentence
from skelgen_gui.widgets.painting import blended, colour_of_limb, image_of

_NAMES, _STRIP, _SPACE = 104.0, 10.0, 3.0  # px: names, strips in the limbs' colours, gap beside these
_NUMBERS, _BAR, _FOOT = 16.0, 14.0, 24.0
_TOP, _RIGHT = _NUMBERS + _STRIP + _SPACE, 76.0  # px, free above and at the right of the cells
_LEAST_NAMED = 11.0  # px, height of a cell beside which a name can be read
_MOST_MARKED = 12  # selected markers whose rows are marked; more would hide the matrix
_TINT = 0.25  # opacity of the row and column under the pointer
_SHADES = 128  # of the bar of colours
_Role = QPalette.ColorRole
_Align = Qt.AlignmentFlag


def place_matrix(region: Region, n: int, width: float, height: float) -> PlacedRegion:
    """Return where a part of a matrix lies in a widget; names have room if they can be read.

    Parameters
    ----------
    region : Region
        The part.
    n : int
        Rows of the whole matrix.
    width, height : float, px
        Size of the widget.
    """
    placed = []
    for left in (_NAMES + _STRIP + _SPACE, _STRIP + 2 * _SPACE):
        side = max(min(width - left - _RIGHT, height - _TOP - _FOOT), 1.0)
        placed.append(PlacedRegion(region, Box(left, _TOP, side, side), n))
    return placed[0] if placed[0].cell >= _LEAST_NAMED else placed[1]


class MatrixPainting:
    """One painting of a matrix.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    matrix : DeviationMatrix
        What is painted.
    placed : PlacedRegion
        Which part of it, and where.
    palette : QPalette
        Colours of texts and ground.
    """

    def __init__(self, painter: QPainter, matrix: DeviationMatrix, placed: PlacedRegion, palette: QPalette) -> None:
        self._painter, self._matrix, self._placed, self._palette = painter, matrix, placed, palette
        self._square = QRectF(*placed.square)
        self._metrics = QFontMetricsF(painter.font())

    def cells(self, image: QImage) -> None:
        """Paint the cells, a pixel of the image each, with sharp borders."""
        square, region = self._square, self._placed.region
        self._painter.fillRect(square, self._palette.color(_Role.Base))
        self._painter.drawImage(square, image, QRectF(region.column, region.row, region.size, region.size))

    def limbs(self) -> None:
        """Paint strips in the limbs' colours, their names or numbers, borders, and a frame about each block."""
        square, borders = self._square, self._matrix.borders
        pairs = list(pairwise(borders))
        self._painter.setPen(blended(self._palette.color(_Role.Text), self._palette.color(_Role.Base), 0.35))
        for _, end in pairs[:-1]:
            x, y = self._placed.corner(end, end)
            self._painter.drawLine(QPointF(x, square.top()), QPointF(x, square.bottom()))
            self._painter.drawLine(QPointF(square.left(), y), QPointF(square.right(), y))
        for first, end in pairs:
            self._limb(int(self._matrix.limbs[first]), self._block((first, end), (first, end)))

    def _limb(self, limb: int, block: QRectF) -> None:
        square, colour = self._square, colour_of_limb(limb, self._palette)
        above = QRectF(block.left(), square.top() - _STRIP - _SPACE, block.width() - 1, _STRIP)
        beside = QRectF(square.left() - _STRIP - _SPACE, block.top(), _STRIP, block.height() - 1)
        for strip in (above, beside):
            if strip.width() > 0 and strip.height() > 0:
                self._painter.fillRect(strip, colour)
        if block.width() > 0 and block.height() > 0:
            self._painter.setPen(QPen(colour, 2.0))
            self._painter.setBrush(Qt.BrushStyle.NoBrush)
            self._painter.drawRect(block)
        names = (self._matrix.limb_names[limb], str(limb)) if limb >= 0 else ("–",)
        name = next((name for name in names if self._metrics.horizontalAdvance(name) < block.width()), "")
        self._painter.setPen(self._palette.color(_Role.WindowText))
        self._painter.drawText(QRectF(block.left(), 0, block.width(), _NUMBERS), _Align.AlignCenter, name)

    def names(self) -> None:
        """Paint the markers' names beside the rows, where these are high enough."""
        if self._square.left() < _NAMES:
            return
        self._painter.setPen(self._palette.color(_Role.WindowText))
        first, size = self._placed.region.row, self._placed.region.size
        for row in range(int(first), min(int(np.ceil(first + size)), self._matrix.n)):
            line = self._row(row)
            room = QRectF(4, line.top(), _NAMES - 8, line.height())
            name = self._metrics.elidedText(self._matrix.names[row], Qt.TextElideMode.ElideMiddle, room.width())
            self._painter.drawText(room, _Align.AlignRight | _Align.AlignVCenter, name)

    def selected(self, markers: Iterable[int]) -> None:
        """Mark rows and columns of selected markers."""
        chosen = np.flatnonzero(np.isin(self._matrix.markers, list(markers))).tolist()
        self._painter.setPen(QPen(self._palette.color(_Role.Highlight), 1.5))
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        for row in chosen if len(chosen) <= _MOST_MARKED else []:
            self._outline(self._row(row))
            self._outline(self._column(row))

    def _block(self, rows: tuple[float, float], columns: tuple[float, float]) -> QRectF:
        return QRectF(*self._placed.block(rows, columns))

    def _row(self, row: int) -> QRectF:
        return self._block((row, row + 1), (0, self._matrix.n))

    def _column(self, column: int) -> QRectF:
        return self._block((0, self._matrix.n), (column, column + 1))

    def _outline(self, block: QRectF) -> None:
        if block.width() > 0 and block.height() > 0:
            self._painter.drawRect(block)

    def pointed(self, cell: tuple[int, int] | None) -> None:
        """Mark the cell under the pointer with its row and column, and describe it below."""
        if cell is None:
            return
        row, column = cell
        colour = QColor(self._palette.color(_Role.Highlight))
        self._painter.setPen(QPen(colour, 2.0))
        self._outline(self._block((row, row + 1), (column, column + 1)))
        colour.setAlphaF(_TINT)
        self._painter.fillRect(self._row(row), colour)
        self._painter.fillRect(self._column(column), colour)
        square = self._square
        room = QRectF(4, square.bottom() + 2, self._painter.viewport().width() - 8, _FOOT - 2)
        self._painter.setPen(self._palette.color(_Role.WindowText))
        self._painter.drawText(room, _Align.AlignLeft | _Align.AlignVCenter, cell_sentence(self._matrix, row, column))

    def rubber_band(self, first: QPointF, second: QPointF) -> None:
        """Paint the square that is being drawn.

        Parameters
        ----------
        first, second : QPointF, px
            Two of its corners.
        """
        colour = QColor(self._palette.color(_Role.Highlight))
        self._painter.setPen(QPen(colour, 1.5))
        colour.setAlphaF(_TINT)
        self._painter.setBrush(colour)
        self._painter.drawRect(QRectF(first, second).normalized().intersected(self._square))

    def colour_bar(self) -> None:
        """Paint what the colours mean [mm]."""
        square, scale = self._square, self._matrix.scale
        bar = QRectF(square.right() + 14, square.top(), _BAR, square.height())
        shades = ramp_rgba(np.linspace(1.0, 0.0, _SHADES)[:, np.newaxis])
        self._painter.fillRect(bar, self._palette.color(_Role.Base))
        self._painter.drawImage(bar, image_of(shades))
        self._painter.setPen(self._palette.color(_Role.WindowText))
        self._painter.setBrush(Qt.BrushStyle.NoBrush)
        self._painter.drawRect(bar)
        self._painter.drawText(QRectF(bar.left(), 0, 60, square.top() - 2), _Align.AlignLeft | _Align.AlignBottom, "mm")
        parts = (1.0,) if scale.high > 1000 * scale.low else (1.0, 2.0, 5.0)  # powers of ten where the scale is wide
        powers = range(int(np.floor(np.log10(scale.low))), int(np.ceil(np.log10(scale.high))) + 1)
        values = [part * 10.0**power for power in powers for part in parts]
        for value in (value for value in values if scale.low <= value <= scale.high):
            y = bar.bottom() - float(scale.fractions(np.array([value]))[0]) * bar.height()
            self._painter.drawLine(QPointF(bar.right(), y), QPointF(bar.right() + 4, y))
            room = QRectF(bar.right() + 6, y - 8, 54, 16)
            self._painter.drawText(room, _Align.AlignLeft | _Align.AlignVCenter, plain(value))
