"""Where the board has been in both images: a picture of the corners, and of the ninths that are still empty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from skelgen.capture.calibration.board import LEAST_CORNERS, coverage
from skelgen.model.arrays import Floats
from skelgen_gui.batch import draw_points
from skelgen_gui.capture.views import View, sides
from skelgen_gui.palette import blended
from skelgen_gui.theme import is_dark

COVERED = {False: QColor("#2b8a3e"), True: QColor("#69db7c")}
"""Of ninths in which there are corners, on light and on dark windows."""

_PARTS = 3
_GAP = 6.0  # px, between the images
_SHARE = 0.30  # of the colour, in a ninth that is covered
_DOT = 2.0  # px


class CoverageView(QWidget):
    """Both images, small; the ninths where the board has been are coloured.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._size = (640, 480)
        self._corners = self._marked = sides(())
        self.setAccessibleName(self.tr("Where the board has been in both images"))
        self.setToolTip(self.tr("Dots are corners of the board; coloured parts are covered, the others wait for it"))
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)

    def show_views(self, views: Sequence[View]) -> None:
        """Show what views cover."""
        self._corners = sides(views)
        if views:
            self._size = views[0].size
        self.update()

    def mark_views(self, views: Sequence[View]) -> None:
        """Let the corners of some views stand out."""
        self._marked = sides(views)
        self.update()

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(340, self.heightForWidth(340))

    def heightForWidth(self, width: int) -> int:
        """Return the height that both images side by side need."""
        return round((width - _GAP) / 2 * self._size[1] / self._size[0])

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint both images."""
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            width = (self.width() - _GAP) / 2
            for side, title in enumerate((self.tr("left"), self.tr("right"))):
                box = QRectF(side * (width + _GAP), 0, width, self.height())
                self._paint_parts(painter, box, self._corners[side])
                self._paint_corners(painter, box, self._corners[side], COVERED[is_dark(self.palette())])
                self._paint_corners(
                    painter, box, self._marked[side], self.palette().color(QPalette.ColorRole.Highlight)
                )
                painter.setPen(self.palette().color(QPalette.ColorRole.Text))
                flags = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
                painter.drawText(box.adjusted(6, 3, -6, -3), flags, title)

    def _paint_parts(self, painter: QPainter, box: QRectF, corners: list[Floats]) -> None:
        """Ninths, those that are covered in colour."""
        palette = self.palette()
        paper, colour = palette.color(QPalette.ColorRole.Base), COVERED[is_dark(palette)]
        counts = coverage(corners, self._size)
        part = box.width() / _PARTS, box.height() / _PARTS
        painter.setPen(QPen(palette.color(QPalette.ColorRole.Mid), 1.0))
        for row in range(_PARTS):
            for column in range(_PARTS):
                is_covered = counts[row, column] >= LEAST_CORNERS
                painter.setBrush(blended(colour, paper, _SHARE) if is_covered else paper)
                painter.drawRect(QRectF(box.left() + column * part[0], box.top() + row * part[1], *part))

    def _paint_corners(self, painter: QPainter, box: QRectF, corners: list[Floats], colour: QColor) -> None:
        painter.setPen(QPen(colour, _DOT, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        every = np.concatenate([np.zeros((0, 2)), *corners])
        scale = np.array([box.width() / self._size[0], box.height() / self._size[1]])
        draw_points(painter, np.array([box.left(), box.top()]) + every * scale)
