"""Both cameras' pictures side by side, with what was found in them."""

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QImage, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QWidget

from skelgen.app.capture_jobs.messages import NO_BODY, CameraImage
from skelgen.app.drawing.colours import limb_colour
from skelgen.model.arrays import Floats
from skelgen_gui.widgets.painting import draw_lines

LOOSE = QColor("#f2c94c")
"""Of balls that belong to no body; pictures are dark on light desktops too."""

BOARD = QColor("#3ddc84")
"""Of the corners of a board."""

_GROUND, _FRAME, _TEXT = QColor("#111316"), QColor("#4a515b"), QColor("#e6e8eb")
_GAP = 6.0  # px, between the pictures
_RING, _CORNER = 6.0, 2.5  # px, radii of marks on the screen
_INK = 1.6  # px


def group_colour(group: int) -> QColor:
    """Return the colour of a body in pictures and in space, or that of what belongs to none."""
    return LOOSE if group == NO_BODY else QColor(limb_colour(group, dark=True))


class PicturePair(QWidget):
    """The newest pictures of both cameras.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._images: tuple[CameraImage, CameraImage] | None = None
        self.setAccessibleName(self.tr("Pictures of both cameras"))
        self.setToolTip(self.tr("Rings are balls that were found, in the colours of their bodies"))
        self.setAttribute(Qt.WidgetAttribute.WA_OpaquePaintEvent)

    def show_pair(self, left: CameraImage, right: CameraImage) -> None:
        """Show other pictures; they replace those before.

        Parameters
        ----------
        left, right : CameraImage
            What both cameras see.
        """
        self._images = left, right
        self.update()

    def clear(self) -> None:
        """Show none."""
        self._images = None
        self.update()

    def place_of(self, side: int, x: float, y: float) -> QPointF:
        """Return where a place [px] in the left (0) or right (1) picture is in this widget.

        Parameters
        ----------
        side : int
            0 is the left picture, 1 the right one.
        x, y : float, px
            The place in the picture.
        """
        seen = self._images[side] if self._images is not None else None
        box, scale = self._box(side, seen)
        return box.topLeft() + QPointF((x + 0.5) * scale, (y + 0.5) * scale)

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(900, 340)

    def minimumSizeHint(self) -> QSize:
        """Return the least useful size."""
        return QSize(240, 90)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint both pictures."""
        with QPainter(self) as painter:
            painter.fillRect(self.rect(), _GROUND)
            if self._images is None:
                painter.setPen(_TEXT)
                flags = Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap
                words = self.tr("Pictures of both cameras are shown here")
                painter.drawText(self.rect().adjusted(12, 12, -12, -12), flags, words)
                return
            for side, title in enumerate((self.tr("left"), self.tr("right"))):
                box, scale = self._box(side, self._images[side])
                painter.save()
                painter.setClipRect(box)
                _paint_image(painter, self._images[side], box, scale)
                painter.setPen(_TEXT)
                painter.drawText(box.adjusted(8, 5, -8, -5), Qt.AlignmentFlag.AlignLeft, title)
                painter.restore()

    def _box(self, side: int, seen: CameraImage | None) -> tuple[QRectF, float]:
        """Where a picture lies in the widget, and how many pixels of the widget one of its pixels takes."""
        height, width = (480, 640) if seen is None else seen.image.shape
        half = (self.width() - _GAP) / 2
        scale = min(half / width, self.height() / height)
        left = side * (half + _GAP) + (half - scale * width) / 2
        return QRectF(left, (self.height() - scale * height) / 2, scale * width, scale * height), scale


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
    for label in seen.labels:
        painter.setPen(group_colour(label.group))
        place = box.topLeft() + QPointF((label.x + 0.5) * scale, (label.y + 0.5) * scale)
        shift = QPointF(-painter.fontMetrics().horizontalAdvance(label.text) / 2, -2 * _RING)
        painter.drawText(place + shift, label.text)


def _paint_board(painter: QPainter, places: Floats) -> None:
    """Corners, and lines from one to the next, so that their order can be seen."""
    painter.setPen(QPen(BOARD, _INK / 2))
    draw_lines(painter, np.stack([places[:-1], places[1:]], axis=1))
    painter.setPen(QPen(BOARD, _INK))
    for x, y in places.tolist():
        painter.drawEllipse(QPointF(x, y), _CORNER, _CORNER)
