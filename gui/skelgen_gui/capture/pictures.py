"""The pictures of two or more cameras beside each other, with what was found in them.

They are a widget, and a window beside ``skelgen motion-capture``, which runs the loop.
"""

import time
from collections.abc import Sequence
from typing import Self

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QApplication, QWidget

from skelgen.app.capture_jobs.images import NO_BODY, CameraImage, camera_images_of
from skelgen.app.drawing.scales import limb_colour
from skelgen.capture.live import Captured
from skelgen.model.arrays import Bools, Floats
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import draw_lines, draw_names

LOOSE = QColor("#f2c94c")
"""Of balls that belong to no body; pictures are dark on light desktops too."""

BOARD = QColor("#3ddc84")
"""Of the corners of a board, and of the parts of a picture in which a wand has been."""

_GROUND, _FRAME, _TEXT = QColor("#111316"), QColor("#4a515b"), QColor("#e6e8eb")
_GAP = 6.0  # px, between the pictures
_RING, _CORNER = 6.0, 2.5  # px, radii of marks on the screen
_INK = 1.6  # px
_VEIL = 0.18  # how much of the colour lies over parts that are covered
TWO = 2
"""Pictures that always stand side by side."""


def group_colour(group: int) -> QColor:
    """Return the colour of a body in pictures and in space, or that of what belongs to none."""
    return LOOSE if group == NO_BODY else QColor(limb_colour(group, dark=True))


class Pictures(QWidget):
    """The newest pictures of all cameras, as large as there is room for.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._images: tuple[CameraImage, ...] = ()
        self._titles: tuple[str, ...] = ()
        self._covered: tuple[Bools, ...] = ()
        put_texts(self)
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def show_images(
        self, images: Sequence[CameraImage], titles: Sequence[str] = (), covered: Sequence[Bools] = ()
    ) -> None:
        """Show other pictures; they replace those before.

        Parameters
        ----------
        images : sequence of CameraImage
            What all cameras see.
        titles : sequence of str
            What they are called; by default they are the left and the right one.
        covered : sequence of ndarray of bool, shape (rows, columns)
            In which parts of each picture a wand has been, if that is to be seen.
        """
        self._images, self._covered = tuple(images), tuple(covered)
        self._titles = tuple(titles) or (self.tr("left"), self.tr("right"))
        self.update()

    def clear(self) -> None:
        """Show none."""
        self._images = ()
        self.update()

    def place_of(self, camera: int, x: float, y: float) -> QPointF:
        """Return where a place [px] in a picture is in this widget.

        Parameters
        ----------
        camera : int
            Which picture; of two, 0 is the left one, 1 the right one.
        x, y : float, px
            The place in the picture.
        """
        box, scale = self._box(camera)
        return box.topLeft() + QPointF((x + 0.5) * scale, (y + 0.5) * scale)

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(900, 340)

    def minimumSizeHint(self) -> QSize:
        """Return the least useful size."""
        return QSize(240, 90)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint all pictures."""
        with QPainter(self) as painter:
            painter.fillRect(self.rect(), _GROUND)
            if not self._images:
                painter.setPen(_TEXT)
                flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
                words = self.tr("Pictures of the cameras are shown here")
                painter.drawText(self.rect().adjusted(12, 12, -12, -12), flags, words)
                return
            for camera, (seen, title) in enumerate(zip(self._images, self._titles, strict=True)):
                box, scale = self._box(camera)
                painter.save()
                painter.setClipRect(box)
                _paint_image(painter, seen, box, scale)
                if self._covered:
                    _paint_covered(painter, box, self._covered[camera])
                painter.setPen(_TEXT)
                painter.drawText(box.adjusted(8, 5, -8, -5), Qt.AlignmentFlag.AlignLeft, title)
                painter.restore()

    def _box(self, camera: int) -> tuple[QRectF, float]:
        """Where a picture lies in the widget, and how many pixels of the widget one of its pixels takes."""
        shapes = [seen.image.shape for seen in self._images] or [(480, 640)]
        height, width = shapes[camera] if camera < len(shapes) else shapes[0]
        columns, cell = _grid(max(len(shapes), camera + 1), width / height, (self.width(), self.height()))
        scale = min(cell[0] / width, cell[1] / height)
        row, column = divmod(camera, columns)
        left = column * (cell[0] + _GAP) + (cell[0] - scale * width) / 2
        top = row * (cell[1] + _GAP) + (cell[1] - scale * height) / 2
        return QRectF(left, top, scale * width, scale * height), scale


def _grid(count: int, ratio: float, size: tuple[int, int]) -> tuple[int, tuple[float, float]]:
    """Return the number of columns with which pictures are largest, and the room for each."""
    best, largest = (count, (1.0, 1.0)), 0.0
    for columns in range(count, 0, -1):
        rows = -(-count // columns)
        cell = (size[0] - (columns - 1) * _GAP) / columns, (size[1] - (rows - 1) * _GAP) / rows
        shown = min(cell[0], cell[1] * ratio)
        if shown >= largest and (count != TWO or columns == TWO):
            best, largest = (columns, cell), shown
    return best


def _paint_covered(painter: QPainter, box: QRectF, covered: Bools) -> None:
    """Parts of a picture in which a wand has been in colour, the others framed."""
    rows, columns = covered.shape
    for row in range(rows):
        for column in range(columns):
            colour = QColor(BOARD)
            colour.setAlphaF(_VEIL if covered[row, column] else 0.0)
            painter.setBrush(colour)
            painter.setPen(_FRAME)
            width, height = box.width() / columns, box.height() / rows
            painter.drawRect(QRectF(box.left() + column * width, box.top() + row * height, width, height))
    painter.setBrush(Qt.BrushStyle.NoBrush)


def _paint_image(painter: QPainter, seen: CameraImage, box: QRectF, scale: float) -> None:
    image = np.ascontiguousarray(seen.image)  # kept in a name: the picture shares its memory
    painter.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform)
    height, width = image.shape
    painter.drawImage(box, QImage(image.data, width, height, width, QImage.Format.Format_Grayscale8))
    painter.setPen(_FRAME)
    painter.drawRect(box.adjusted(0, 0, -1, -1))
    painter.setRenderHint(QPainter.RenderHint.Antialiasing)
    places = np.array([box.left(), box.top()]) + (seen.places + 0.5) * scale
    if seen.is_board:
        _paint_board(painter, places)
        return
    for (x, y), group in zip(places.tolist(), seen.groups.tolist(), strict=True):
        painter.setPen(QPen(group_colour(group), _INK))
        painter.drawEllipse(QPointF(x, y), _RING, _RING)
    names = []
    for label in seen.labels:
        place = box.topLeft() + QPointF((label.x + 0.5) * scale, (label.y + 0.5) * scale)
        shift = QPointF(-painter.fontMetrics().horizontalAdvance(label.text) / 2, -2 * _RING)
        names.append((label.text, place + shift, group_colour(label.group)))
    draw_names(painter, names)


def _paint_board(painter: QPainter, places: Floats) -> None:
    """Corners, and lines from one to the next, so that their order can be seen."""
    painter.setPen(QPen(BOARD, _INK / 2))
    draw_lines(painter, np.stack([places[:-1], places[1:]], axis=1))
    painter.setPen(QPen(BOARD, _INK))
    for x, y in places.tolist():
        painter.drawEllipse(QPointF(x, y), _CORNER, _CORNER)


INTERVAL = 0.04
"""s between two pictures: more would only delay the capture."""


LEISURE = 3.0
"""Pause after a picture, as a multiple of the time that it took: many large images must not hold the capture up."""


class LivePictures:
    """The newest pictures with what was found in them; a context manager, whose window closes at its end.

    Parameters
    ----------
    names : sequence of str
        All targets, in the order of their colours.
    cameras : sequence of str
        Those of a room; none are the left and the right one.
    """

    def __init__(self, names: Sequence[str], cameras: Sequence[str] = ()) -> None:
        self._app = QApplication.instance() or QApplication(["skelgen"])
        self._names, self._cameras = tuple(names), tuple(cameras)
        self._shown_at, self._pause = -INTERVAL, INTERVAL
        self.view = Pictures()
        self.view.setWindowTitle(self.view.tr("Cameras"))

    def __enter__(self) -> Self:
        """Open the window."""
        self.view.show()
        self._app.processEvents()
        return self

    def __exit__(self, *exception: object) -> None:
        """Close the window."""
        self.view.close()
        self._app.processEvents()

    def show(self, captured: Captured) -> None:
        """Show the pictures of one moment, unless others are just shown; nothing once the window is closed."""
        now = time.monotonic()
        if now - self._shown_at < self._pause or not self.view.isVisible():
            return
        self._shown_at = now
        found = captured.bodies
        bodies = {group: found[name] for group, name in enumerate(self._names) if name in found}
        images = camera_images_of(captured, bodies)
        self.view.show_images(images, self._cameras)
        self._app.processEvents()
        self._pause = max(INTERVAL, LEISURE * (time.monotonic() - now))
