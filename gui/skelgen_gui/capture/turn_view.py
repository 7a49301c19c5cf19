"""How far one target has turned in another: two pictures of all attitudes that were taken."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from skelgen_gui.batch import draw_points
from skelgen_gui.capture.coverage_view import COVERED
from skelgen_gui.palette import blended
from skelgen_gui.theme import is_dark

if TYPE_CHECKING:
    from skelgen.capture.calibration.joints import JointMotion

_GAP = 6.0  # px, between the pictures
_STEP = 30.0  # degrees, between the rings
_LEAST_RINGS = 2
_SHARE = 0.55  # height of a picture as part of its width
_DOT = 3.0  # px


class TurnView(QWidget):
    """Dots are attitudes: turned about the main axis to the right, about the second and third one upwards.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motion: JointMotion | None = None
        self.setAccessibleName(self.tr("Attitudes in which the joint was seen"))
        self.setToolTip(
            self.tr(
                "Each dot is a pair of images: to the right it is turned about the main axis, upwards about the second "
                "one (left picture) or third one (right picture); rings are 30° apart. A hinge makes a line, a ball "
                "should fill both pictures"
            )
        )
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)

    def show_motion(self, motion: JointMotion | None) -> None:
        """Show another motion, or none."""
        self._motion = motion
        self.update()

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(340, self.heightForWidth(340))

    def heightForWidth(self, width: int) -> int:
        """Return the height that both pictures beside each other need."""
        return round((width - _GAP) / 2 * _SHARE)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint both pictures."""
        turns = np.zeros((0, 3)) if self._motion is None else self._motion.turns
        most = float(np.abs(turns).max()) if len(turns) else 0.0
        n_rings = max(_LEAST_RINGS, int(np.ceil(most / _STEP)))
        spans = (0.0, 0.0, 0.0) if self._motion is None else self._motion.spans
        width = (self.width() - _GAP) / 2
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for side in (0, 1):
                box = QRectF(side * (width + _GAP), 0, width, self.height())
                painter.save()
                painter.setClipRect(box)
                scale = box.width() / 2 / (n_rings * _STEP)
                self._paint_rings(painter, box, n_rings, scale)
                colour = COVERED[is_dark(self.palette())]
                painter.setPen(QPen(colour, _DOT, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
                middle = np.array([box.center().x(), box.center().y()])
                draw_points(painter, middle + scale * turns[:, [0, side + 1]] * [1.0, -1.0])
                painter.setPen(self.palette().color(QPalette.ColorRole.Text))
                flags = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
                text = self.tr("{0:.0f}° × {1:.0f}°").format(spans[0], spans[side + 1])
                painter.drawText(box.adjusted(6, 3, -6, -3), flags, text)
                painter.restore()

    def _paint_rings(self, painter: QPainter, box: QRectF, n_rings: int, scale: float) -> None:
        """A ground with rings and axes."""
        palette = self.palette()
        paper, ink = palette.color(QPalette.ColorRole.Base), palette.color(QPalette.ColorRole.Text)
        painter.fillRect(box, paper)
        painter.setPen(QPen(blended(ink, paper, 0.25), 1.0))
        middle = box.center()
        for ring in range(1, n_rings + 1):
            painter.drawEllipse(middle, ring * _STEP * scale, ring * _STEP * scale)
        painter.drawLine(QPointF(box.left(), middle.y()), QPointF(box.right(), middle.y()))
        painter.drawLine(QPointF(middle.x(), box.top()), QPointF(middle.x(), box.bottom()))
        painter.setPen(QPen(palette.color(QPalette.ColorRole.Mid), 1.0))
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.drawRect(box)
