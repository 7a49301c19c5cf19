"""What calibrations show: coverage of images, views, verdicts, tables of results, and how far joints were moved."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPalette, QPen
from PySide6.QtWidgets import QLabel, QSizePolicy, QWidget

from skelgen.app.capture_jobs.images import CollectedView, sides
from skelgen.capture.calibration.chessboard import LEAST_CORNERS, BoardView, coverage
from skelgen.capture.calibration.verdict import REPEAT, Verdict
from skelgen.model.arrays import Floats
from skelgen_gui.capture.results import ValueTable
from skelgen_gui.widgets.layouts import put_texts, wrap
from skelgen_gui.widgets.painting import PROBLEM_ROLE, blended, draw_points, is_dark

if TYPE_CHECKING:
    from skelgen.capture.calibration.body import BodyCalibration
    from skelgen.capture.calibration.joints import JointCalibration, JointMotion
    from skelgen.capture.calibration.stereo import StereoCalibration

COVERED = {False: QColor("#2b8a3e"), True: QColor("#69db7c")}
"""Of ninths in which there are corners, on light and on dark windows."""

_PARTS = 3
_GAP = 6.0  # px, between the images
_SHARE = 0.30  # of the colour, in a ninth that is covered
_DOT = 2.0  # px

Fit = tuple[float, float, bool]
"""Distance [px] of the corners from where they are expected, left and right, and whether the view was used."""

_LIST_HEIGHT = 130  # px: five views


class _PicturePair(QWidget):
    """Two pictures beside each other, as wide as there is room."""

    flatness = 0.75
    """Height of a picture as part of its width."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        put_texts(self)
        policy = QSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Preferred)
        policy.setHeightForWidth(True)
        self.setSizePolicy(policy)

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(340, self.heightForWidth(340))

    def heightForWidth(self, width: int) -> int:
        """Return the height that both pictures side by side need."""
        return round((width - _GAP) / 2 * self.flatness)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint both pictures."""
        width = (self.width() - _GAP) / 2
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            for side in (0, 1):
                box = QRectF(side * (width + _GAP), 0, width, self.height())
                title = self.paint_picture(painter, box, side)
                painter.setPen(self.palette().color(QPalette.ColorRole.Text))
                flags = Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop
                painter.drawText(box.adjusted(6, 3, -6, -3), flags, title)

    def paint_picture(self, painter: QPainter, box: QRectF, side: int) -> str:
        """Paint the left picture, 0, or the right one, 1; return its title."""
        raise NotImplementedError


class CoverageView(_PicturePair):
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

    def show_views(self, views: Sequence[CollectedView]) -> None:
        """Show what views cover."""
        self._corners = sides(views)
        if views:
            self._size = views[0].size
            self.flatness = self._size[1] / self._size[0]
        self.update()

    def mark_views(self, views: Sequence[CollectedView]) -> None:
        """Let the corners of some views stand out."""
        self._marked = sides(views)
        self.update()

    def paint_picture(self, painter: QPainter, box: QRectF, side: int) -> str:
        """Paint an image with its parts and corners."""
        self._paint_parts(painter, box, self._corners[side])
        self._paint_corners(painter, box, self._corners[side], COVERED[is_dark(self.palette())])
        self._paint_corners(painter, box, self._marked[side], self.palette().color(QPalette.ColorRole.Highlight))
        return self.tr("right") if side else self.tr("left")

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


class ViewList(ValueTable):
    """One row for each view; Delete takes the chosen ones away.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setFixedHeight(_LIST_HEIGHT)
        self._views: tuple[CollectedView, ...] = ()

    def show_views(self, views: Sequence[CollectedView], fits: Mapping[str, Fit]) -> None:
        """Show views, with how they fit where that is known.

        Parameters
        ----------
        views : sequence of CollectedView
            The views.
        fits : mapping of str to Fit
            How well views fit, by their names, where that is known.
        """
        self._views, rows = tuple(views), []
        for view in views:
            left, right, is_used = fits.get(view.name, (math.nan, math.nan, None))
            used = "" if is_used is None else self.tr("yes") if is_used else self.tr("no")
            rows.append((view.name, self._cell(view.left, left), self._cell(view.right, right), used))
        self.show_rows(rows)
        if views:
            self.scrollToBottom()

    @property
    def selected_views(self) -> list[CollectedView]:
        """The chosen views."""
        rows = sorted({index.row() for index in self.selectedIndexes()})
        return [self._views[row] for row in rows if row < len(self._views)]

    def _cell(self, side: BoardView | None, rms: float) -> str:
        if side is None:
            return self.tr("no board")
        return self.tr("board") if math.isnan(rms) else f"{rms:.2f}"


class VerdictLabel(QLabel):
    """The verdict on a calibration, or why there is none.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        wrap(self, self.tr("Verdict on the calibration"))
        self.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)

    def show_verdict(self, verdict: Verdict) -> None:
        """Show a verdict."""
        role = PROBLEM_ROLE if verdict.grade == REPEAT else QPalette.ColorRole.WindowText
        self.setForegroundRole(role)
        self.setText("\n".join(verdict.sentences))

    def show_problem(self, sentence: str) -> None:
        """Show why there is no calibration."""
        self.setForegroundRole(PROBLEM_ROLE)
        self.setText(sentence)


_JOINT_ROWS = 3  # its name, and its place in both targets

_STEP = 30.0  # degrees, between the rings
_LEAST_RINGS = 2
_ATTITUDE = 3.0  # px


class RowTable(ValueTable):
    """A table as high as its rows, up to a limit; hidden while it has none."""

    most_rows = 9

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.hide()

    def show_rows(self, rows: Sequence[Sequence[str]]) -> None:
        """Show other rows, each a name and its numbers."""
        super().show_rows(rows)
        n_shown = min(len(rows), self.most_rows)
        height = self.horizontalHeader().sizeHint().height() + 2 * self.frameWidth()
        self.setFixedHeight(height + n_shown * self.verticalHeader().defaultSectionSize())
        self.setVisible(bool(rows))


class CameraTable(RowTable):
    """The numbers of both cameras."""

    most_rows = 20

    def show_calibration(self, found: StereoCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.stereo import camera_rows  # noqa: PLC0415 - only where there is a result

        self.show_rows(camera_rows(found))


class BallTable(RowTable):
    """The balls of a target."""

    def show_calibration(self, done: BodyCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.body import ball_rows  # noqa: PLC0415 - only where there is a result

        self.show_rows([[str(value) for value in row.values()] for row in ball_rows(done.target)])


class JointTable(RowTable):
    """Where joints are: a row for the place in each of both targets."""

    def show_calibration(self, done: JointCalibration) -> None:
        """Show what was found."""
        from skelgen.capture.calibration.joints import place_texts  # noqa: PLC0415

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
        self._motions = tuple(motions)
        rows = []
        for motion in motions:
            turned = " · ".join(f"{span:.0f}" for span in motion.spans) if motion.n_frames else ""
            rows.append((f"{motion.parent} – {motion.child}", str(motion.n_frames), turned))
        self.show_rows(rows)


class TurnView(_PicturePair):
    """Attitudes of one target in another as dots: to the right turned about the main axis, upwards about the others.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    flatness = 0.55

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._motion: JointMotion | None = None

    def show_motion(self, motion: JointMotion | None) -> None:
        """Show another motion, or none."""
        self._motion = motion
        self.update()

    def paint_picture(self, painter: QPainter, box: QRectF, side: int) -> str:
        """Paint rings, and the attitudes as dots."""
        turns = np.zeros((0, 3)) if self._motion is None else self._motion.turns
        most = float(np.abs(turns).max()) if len(turns) else 0.0
        n_rings = max(_LEAST_RINGS, int(np.ceil(most / _STEP)))
        spans = (0.0, 0.0, 0.0) if self._motion is None else self._motion.spans
        painter.setClipRect(box)
        scale = box.width() / 2 / (n_rings * _STEP)
        self._paint_rings(painter, box, n_rings, scale)
        colour = COVERED[is_dark(self.palette())]
        painter.setPen(QPen(colour, _ATTITUDE, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        middle = np.array([box.center().x(), box.center().y()])
        draw_points(painter, middle + scale * turns[:, [0, side + 1]] * [1.0, -1.0])
        return self.tr("{0:.0f}° × {1:.0f}°").format(spans[0], spans[side + 1])

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
