"""The matrix of distance deviations, ordered by limb: where limbs are rigid, blocks on the diagonal glow."""

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QContextMenuEvent, QImage, QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QWheelEvent
from PySide6.QtWidgets import QWidget

from skelgen.app.drawing.measures import DeviationMatrix, find_deviation_matrix
from skelgen_gui.diagrams.matrix_painting import MatrixPainting, place_matrix
from skelgen_gui.model.matrix import PlacedRegion, Region, cell_sentence
from skelgen_gui.model.selection import Selection
from skelgen_gui.project.session import Session
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import ZOOM, image_of, notches, paint_words, show_tip
from skelgen_gui.widgets.shortcuts import ARROW_KEYS

_CLICK = 4.0  # px, that the pointer may move in a click
_STEPS = {Qt.Key.Key_Up: (-1, 0), Qt.Key.Key_Down: (1, 0), Qt.Key.Key_Left: (0, -1), Qt.Key.Key_Right: (0, 1)}


class MatrixView(QWidget):
    """Shows how much the distance between each two markers varies.

    Hover or arrow keys name a pair, a click or Return selects both markers (Control: these as well), dragging a square
    or the wheel zooms, a double click or 0 shows all.

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
        self._region, self._n_rows = Region.whole(1), 0
        self._cell: tuple[int, int] | None = None
        self._pressed: QPointF | None = None
        self._dragged: QPointF | None = None
        put_texts(self)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        session.project_changed.connect(self._follow_project)
        session.selection_changed.connect(self.update)
        self._follow_project()

    @property
    def region(self) -> Region:
        """The part that is in sight."""
        return self._region

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
        return QPointF(*self._placed.block((row, row + 1), (column, column + 1)).middle)

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
        self._show(self._region.zoomed(ZOOM ** notches(event)[1], *self._index_at(event.position())))
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
            self._show(self._region.zoomed(ZOOM ** (-2 if key == Qt.Key.Key_Minus else 2), row + 0.5, column + 0.5))
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
            self._region = self._region.within(self._n) if self._n == before else Region.whole(self._n)
            self._n_rows = self._n
        self.update()

    @property
    def _n(self) -> int:
        return 0 if self._matrix is None else self._matrix.n

    def _show(self, region: Region) -> None:
        self._region = region.within(self._n)
        self.update()

    def _point_at(self, cell: tuple[int, int] | None) -> None:
        if cell != self._cell:
            self._cell = cell
            self.update()

    def _step(self, down: int, right: int) -> None:
        """Go to the next cell, and bring it into sight."""
        row, column = self._cell or (int(self._region.row), int(self._region.column))
        last = self._n - 1
        row, column = min(max(row + down, 0), last), min(max(column + right, 0), last)
        top = min(max(self._region.row, row + 1 - self._region.size), float(row))
        left = min(max(self._region.column, column + 1 - self._region.size), float(column))
        self._show(Region(top, left, self._region.size))
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
        return place_matrix(self._region, self._n, self.width(), self.height())
