"""The ruler above the lanes: times, the range that is played, and the frame that is shown."""

import math

from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QFontMetricsF, QMouseEvent, QPainter, QPaintEvent, QPalette, QPolygonF, QWheelEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from skelgen_gui.project.session import Session
from skelgen_gui.timeline.player import Player
from skelgen_gui.timeline.span import GUTTER, VisibleSpan, clock, plot_width, ruler_step, zoom_or_pan
from skelgen_gui.widgets.theme import blended, cursor_colour

_HEIGHT = 30
_GRIP = 6.0  # px, half the width in which a handle of the range can be caught
_HANDLE = 5.0
_LABEL = 30.0  # px, that a label reaches out at the left
_MINOR = 5  # parts between two labels
_Role = QPalette.ColorRole


class Ruler(QWidget):
    """Shows times; click or drag goes to a frame, the two handles set the range.

    Parameters
    ----------
    session : Session
        Whose frame is shown.
    player : Player
        Whose range is shown.
    span : VisibleSpan
        Which frames are in sight.
    """

    def __init__(self, session: Session, player: Player, span: VisibleSpan, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session, self._player, self._span = session, player, span
        self._grip: int | None = None
        self.setAccessibleName(self.tr("Ruler"))
        self.setToolTip(self.tr("Click or drag to go to a frame; drag the two handles to set what is played"))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMouseTracking(True)
        for signal in (session.frame_changed, session.project_changed, player.settings_changed, span.changed):
            signal.connect(self.update)

    def sizeHint(self) -> QSize:
        """Return a wide and low size."""
        return QSize(400, _HEIGHT)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint ticks, the range with its handles, and the cursor's head."""
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            if self._session.n_frames:
                painter.setClipRect(QRectF(GUTTER - _LABEL, 0, self.width(), self.height()))
                self._paint_range(painter)
                self._paint_ticks(painter)
                self._paint_cursor(painter)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Take a handle, or go to a frame."""
        if event.button() == Qt.MouseButton.LeftButton and self._session.n_frames:
            self._grip = self._grip_at(event.position().x())
            self._drag(event.position().x())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Drag the handle or the frame."""
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._drag(event.position().x())
        elif self._session.n_frames:
            on_grip = self._grip_at(event.position().x()) is not None
            self.setCursor(Qt.CursorShape.SplitHCursor if on_grip else Qt.CursorShape.ArrowCursor)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom, or pan with Shift."""
        zoom_or_pan(event, self._span, plot_width(self.width()))

    def _drag(self, x: float) -> None:
        frame = self._span.frame_at(x, GUTTER, plot_width(self.width()))
        first, last = self._player.range
        if self._grip is None:
            self._session.show_frame(frame)
        elif self._grip == 0:
            self._player.set_range(min(frame, last), last)
        else:
            self._player.set_range(first, max(frame, first))

    def _grip_at(self, x: float) -> int | None:
        """The handle at a place: 0, 1 or none; the cursor's head, if it lies between, is taken instead."""
        gaps = [abs(x - place) for place in self._handles()]
        nearest = gaps.index(min(gaps))
        return nearest if gaps[nearest] <= _GRIP else None

    def _handles(self) -> tuple[float, float]:
        first, last = self._player.range
        width = plot_width(self.width())
        return self._span.place(first, GUTTER, width) - _HANDLE, self._span.place(last + 1, GUTTER, width) + _HANDLE

    def _paint_range(self, painter: QPainter) -> None:
        left, right = self._handles()
        colours = self.palette()
        tint = blended(colours.color(_Role.Highlight), colours.color(_Role.Window), 0.22)
        base = self.height() - 9.0
        painter.fillRect(QRectF(left + _HANDLE, base, right - left - 2 * _HANDLE, 9.0), tint)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(colours.color(_Role.Highlight))
        for x in (left, right):
            painter.drawRoundedRect(QRectF(x - _HANDLE, base - 3, 2 * _HANDLE, 12.0), 2.5, 2.5)

    def _paint_ticks(self, painter: QPainter) -> None:
        rate, width = self._session.rate, plot_width(self.width())
        step = ruler_step(self._span, rate, width)
        text = self.palette().color(_Role.WindowText)
        faint = blended(text, self.palette().color(_Role.Window), 0.4)
        first = math.ceil(self._span.first / rate / step * _MINOR - 1e-9)
        last = math.floor(self._span.end / rate / step * _MINOR + 1e-9)
        metrics = QFontMetricsF(self.font())
        for index in range(first, last + 1):
            seconds = index * step / _MINOR
            x = self._span.place(seconds * rate + 0.5, GUTTER, width)
            is_labelled = index % _MINOR == 0
            painter.setPen(faint)
            painter.drawLine(QPointF(x, self.height() - 9), QPointF(x, self.height() - (15 if is_labelled else 12)))
            if is_labelled:
                shown = clock(seconds, step)
                painter.setPen(text)
                painter.drawText(QPointF(x - metrics.horizontalAdvance(shown) / 2, self.height() - 18), shown)

    def _paint_cursor(self, painter: QPainter) -> None:
        x = self._span.place(self._session.frame + 0.5, GUTTER, plot_width(self.width()))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(cursor_colour(self.palette()))
        low = float(self.height())
        painter.drawPolygon(QPolygonF([QPointF(x - 5, low - 10), QPointF(x + 5, low - 10), QPointF(x, low)]))
