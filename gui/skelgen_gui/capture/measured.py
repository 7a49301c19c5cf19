"""What the calibrations of targets and joints measured: tables, and pictures of how far joints were moved."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from skelgen_gui.capture.camera_views import COVERED
from skelgen_gui.capture.results import ValueTable
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import blended, draw_points, is_dark

if TYPE_CHECKING:
    from skelgen.capture.calibration.body import BodyCalibration
    from skelgen.capture.calibration.joints import JointCalibration, JointMotion

_MOST_ROWS = 9
_JOINT_ROWS = 3  # its name, and its place in both targets

_GAP = 6.0  # px, between the pictures
_STEP = 30.0  # degrees, between the rings
_LEAST_RINGS = 2
_SHARE = 0.55  # height of a picture as part of its width
_DOT = 3.0  # px


class RowTable(ValueTable):
    """A table as high as its rows, up to a limit; hidden while it has none."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.hide()

    def show_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Show other rows, each a name and its numbers."""
        super().show_rows(rows)
        n_shown = min(len(rows), _MOST_ROWS)
        height = self.horizontalHeader().sizeHint().height() + 2 * self.frameWidth()
        self.setFixedHeight(height + n_shown * self.verticalHeader().defaultSectionSize())
        self.setVisible(bool(rows))


class BallTable(RowTable):
    """The balls of a target."""

    def show_calibration(self, done: BodyCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.table import ball_rows  # noqa: PLC0415 - only where there is a result

        self.show_rows([[str(value) for value in row.values()] for row in ball_rows(done.target)])


class JointTable(RowTable):
    """Where joints are: a row for the place in each of both targets."""

    def show_calibration(self, done: JointCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.table import place_texts  # noqa: PLC0415

        rows: list[list[str]] = []
        self.clearSpans()
        for joint, fit in zip(done.joints, done.fits, strict=True):
            kind = self.tr("ball") if joint.kind == "ball" else self.tr("hinge")
            rows.append([self.tr("{0}: {1}, gap {2:.2f} mm").format(joint.name, kind, fit.gap), "", "", ""])
            for name, texts in zip((joint.parent, joint.child), place_texts(joint), strict=True):
                rows.append([f"   {name}", *texts])
        self.show_rows(rows)
        for row in range(0, len(rows), _JOINT_ROWS):
            self.setSpan(row, 0, 1, self.columnCount())


class MotionTable(RowTable):
    """How far targets have moved against each other."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motions: tuple[JointMotion, ...] = ()

    @property
    def chosen(self) -> JointMotion | None:
        """The motion whose row is chosen, the first one if none is."""
        row = max(self.currentRow(), 0)
        return self._motions[row] if row < len(self._motions) else None

    def show_motions(self, motions: Sequence[JointMotion]) -> None:
        """Show motions; the rows stay while their numbers change."""
        names = [(motion.parent, motion.child) for motion in motions]
        is_other = names != [(motion.parent, motion.child) for motion in self._motions]
        self._motions = tuple(motions)
        rows = []
        for motion in motions:
            turned = " · ".join(f"{span:.0f}" for span in motion.spans) if motion.n_frames else ""
            rows.append((f"{motion.parent} – {motion.child}", str(motion.n_frames), turned))
        if is_other:
            self.show_rows(rows)
            return
        for row, (_, *texts) in enumerate(rows):
            self.show_row(row, texts)


class TurnView(QWidget):
    """Attitudes of one target in another as dots: to the right turned about the main axis, upwards about the others.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motion: JointMotion | None = None
        put_texts(self)
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
