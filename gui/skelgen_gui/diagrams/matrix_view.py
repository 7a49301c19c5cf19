"""The matrix of distance deviations, ordered by limb: where limbs are rigid, blocks on the diagonal glow."""

from collections.abc import Iterable
from itertools import pairwise

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QColor,
    QContextMenuEvent,
    QFontMetricsF,
    QImage,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPalette,
    QPen,
    QWheelEvent,
)
from PySide6.QtWidgets import QWidget

from skelgen.app.drawing.measures import DeviationMatrix, find_deviation_matrix
from skelgen.app.drawing.scales import ramp_rgba
from skelgen.app.drawing.wording import plain
from skelgen_gui.model.matrix import PlacedRegion, Region, cell_sentence
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import ZOOM, blended, colour_of_limb, image_of, notches, paint_words, show_tip
from skelgen_gui.widgets.shortcuts import ARROW_KEYS

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
        placed.append(PlacedRegion(region, left, _TOP, side, n))
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
        self._square = QRectF(placed.left, placed.top, placed.side, placed.side)
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


_CLICK = 4.0  # px, that the pointer may move in a click
_STEPS = {Qt.Key.Key_Up: (-1, 0), Qt.Key.Key_Down: (1, 0), Qt.Key.Key_Left: (0, -1), Qt.Key.Key_Right: (0, 1)}


class MatrixView(QWidget):
    """Shows how much the distance between each two markers varies.

    Hover or arrow keys name a pair, a click or Return selects both markers (Control: these as well), dragging a square
    or the wheel zooms, a double click or 0 shows all.

    Attributes
    ----------
    region : Region
        The part that is in sight.

    Parameters
    ----------
    session : Session
        What is shown.
    """

    own_keys = ARROW_KEYS | {Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus, Qt.Key.Key_0}

    def __init__(self, session: Session, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self._matrix: DeviationMatrix | None = None
        self._image = QImage()
        self.region, self._n_rows = Region.whole(1), 0
        self._cell: tuple[int, int] | None = None
        self._pressed: QPointF | None = None
        self._dragged: QPointF | None = None
        put_texts(self)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        session.project_changed.connect(self._follow_project)
        session.selection_changed.connect(self.update)
        self._follow_project()

    def sizeHint(self) -> QSize:
        """Return a square and what stands beside it."""
        return QSize(560, 480)

    def cell_place(self, row: int, column: int) -> QPointF:
        """Return the middle of a cell in this widget; rows and columns are ordered by limb.

        Parameters
        ----------
        row, column : int
            The cell.
        """
        return QRectF(*self._placed.block((row, row + 1), (column, column + 1))).center()

    def tip_at(self, place: QPointF) -> str:
        """Describe a place: the pair of markers, and how much its distance varies."""
        cell = self._cell_at(place)
        if self._matrix is None or cell is None:
            return self.tr("Click: select both markers · drag: zoom · wheel: zoom · double click: show all")
        return cell_sentence(self._matrix, *cell)

    def event(self, event: QEvent) -> bool:
        """Name the pair under the pointer."""
        if event.type() == QEvent.Type.Leave:
            self._point_at(None)
        return show_tip(self, event, self.tip_at) or super().event(event)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Begin a click or a square."""
        if event.button() == Qt.MouseButton.LeftButton and self._cell_at(event.position()) is not None:
            self._pressed = self._dragged = event.position()

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Name the pair, or draw the square."""
        if self._pressed is not None:
            self._dragged = event.position()
            self.update()
        self._point_at(self._cell_at(event.position()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """Select the pair, or show the square."""
        pressed, self._pressed, self._dragged = self._pressed, None, None
        if pressed is None:
            return
        if (event.position() - pressed).manhattanLength() <= _CLICK:
            self._point_at(self._cell_at(pressed))
            self._select(event.modifiers())
        else:
            self._show(Region.around(self._index_at(pressed), self._index_at(event.position())))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Ask for a menu for what is selected; the pair under the pointer is selected first."""
        cell = self._cell_at(QPointF(event.pos()))
        if event.reason() is QContextMenuEvent.Reason.Mouse and cell is not None and self._matrix is not None:
            self._point_at(cell)
            if not {int(self._matrix.markers[index]) for index in cell} <= self._session.selection.markers:
                self._select(Qt.KeyboardModifier.NoModifier)
        self._session.menu_requested.emit(event.globalPos())

    def mouseDoubleClickEvent(self, event: QMouseEvent) -> None:
        """Show all."""
        self._show(Region.whole(self._n))

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom about the pointer."""
        self._show(self.region.zoomed(ZOOM ** notches(event)[1], *self._index_at(event.position())))
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move from cell to cell, select, zoom."""
        key = Qt.Key(event.key())
        if key in _STEPS and self._n:
            self._step(*_STEPS[key])
        elif key in {Qt.Key.Key_Return, Qt.Key.Key_Enter}:
            self._select(event.modifiers())
        elif key in {Qt.Key.Key_Plus, Qt.Key.Key_Equal, Qt.Key.Key_Minus}:
            row, column = self._cell or (self._n // 2, self._n // 2)
            self._show(self.region.zoomed(ZOOM ** (-2 if key == Qt.Key.Key_Minus else 2), row + 0.5, column + 0.5))
        elif key in {Qt.Key.Key_0, Qt.Key.Key_Escape}:
            self._show(Region.whole(self._n))
        else:
            super().keyPressEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint cells, limbs, names, the bar of colours, and what is marked."""
        with QPainter(self) as painter:
            if self._matrix is None:
                words = self.tr("Run the step Limbs to see how much distances between markers vary")
                paint_words(painter, QRectF(self.rect()), words, self.palette())
            else:
                painting = MatrixPainting(painter, self._matrix, self._placed, self.palette())
                painting.cells(self._image)
                painting.limbs()
                painting.names()
                painting.selected(self._session.selection.markers)
                painting.pointed(self._cell)
                painting.colour_bar()
                if self._pressed is not None and self._dragged is not None:
                    painting.rubber_band(self._pressed, self._dragged)

    def _follow_project(self) -> None:
        project = self._session.project
        before = self._n_rows
        self._matrix = find_deviation_matrix(project) if project is not None and project.has("limbs") else None
        self._cell, self._pressed = None, None
        if self._matrix is not None:
            self._image = image_of(self._matrix.pixels)
            self.region = self.region.within(self._n) if self._n == before else Region.whole(self._n)
            self._n_rows = self._n
        self.update()

    @property
    def _n(self) -> int:
        return 0 if self._matrix is None else self._matrix.n

    def _show(self, region: Region) -> None:
        self.region = region.within(self._n)
        self.update()

    def _point_at(self, cell: tuple[int, int] | None) -> None:
        if cell != self._cell:
            self._cell = cell
            self.update()

    def _step(self, down: int, right: int) -> None:
        """Go to the next cell, and bring it into sight."""
        row, column = self._cell or (int(self.region.row), int(self.region.column))
        last = self._n - 1
        row, column = min(max(row + down, 0), last), min(max(column + right, 0), last)
        top = min(max(self.region.row, row + 1 - self.region.size), float(row))
        left = min(max(self.region.column, column + 1 - self.region.size), float(column))
        self._show(Region(top, left, self.region.size))
        self._point_at((row, column))

    def _select(self, modifiers: Qt.KeyboardModifier) -> None:
        if self._matrix is None or self._cell is None:
            return
        markers = frozenset(int(self._matrix.markers[index]) for index in self._cell)
        more = bool(modifiers & Qt.KeyboardModifier.ControlModifier)
        self._session.select(Selection(markers | self._session.selection.markers if more else markers))

    def _cell_at(self, place: QPointF) -> tuple[int, int] | None:
        return self._placed.cell_at(place.x(), place.y())

    def _index_at(self, place: QPointF) -> tuple[float, float]:
        return self._placed.index_at(place.x(), place.y())

    @property
    def _placed(self) -> PlacedRegion:
        return place_matrix(self.region, self._n, self.width(), self.height())
