"""The stretch of the take that ruler, lanes and curves show: its scale, and how wheel and keys change it."""

import math

from PySide6.QtCore import QEvent, QObject, QPointF, Qt, Signal
from PySide6.QtGui import QKeyEvent, QPainter, QPen, QWheelEvent
from PySide6.QtWidgets import QWidget

from skelgen_gui.project.session import Session
from skelgen_gui.widgets.painting import ZOOM, cursor_colour, notches, show_tip

_FEWEST_FRAMES = 8.0  # frames that are shown at the largest zoom

_LEAD = 0.1  # part of the stretch before a frame that was brought into sight: most people go on forward

GUTTER = 140
"""px, at the left, for names and scales."""

MARGIN = 16
"""px, at the right, for a scroll bar."""

_ROUND_SECONDS = (1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 60.0, 120.0, 300.0, 600.0, 900.0, 1800.0, 3600.0)
_TICK_ROOM = 88.0  # px, between labels of the ruler
_PAN = 0.1  # of what is in sight, per notch


class VisibleSpan(QObject):
    """The frames that are in sight; frame f lies from f to f + 1.

    Attributes
    ----------
    first : float
        Where the stretch begins [frames].
    end : float
        Where it ends [frames].

    Parameters
    ----------
    session : Session
        A take that is opened is shown whole; the session's frame is kept in sight.

    Signals
    -------
    changed()
        Other frames are in sight.
    """

    changed = Signal()

    def __init__(self, session: Session, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._session = session
        self.first, self.end = 0.0, 1.0
        session.take_changed.connect(self._follow_take)
        session.frame_changed.connect(self._reveal)
        self.show_all()

    def show_all(self) -> None:
        """Show the whole take."""
        self.show(0.0, float(self._n_frames))

    def show(self, first: float, end: float) -> None:
        """Show a stretch, moved and cut so that it lies in the take.

        Parameters
        ----------
        first, end : float
            The stretch [frames].
        """
        whole = float(self._n_frames)
        length = min(max(end - first, _FEWEST_FRAMES), whole)
        first = min(max(first, 0.0), whole - length)
        if (first, first + length) != (self.first, self.end):
            self.first, self.end = first, first + length
            self.changed.emit()

    def zoom(self, factor: float, about: float) -> None:
        """Show a stretch that is shorter by a factor, with the frame `about` where it was.

        Parameters
        ----------
        factor : float
            More than 1 enlarges.
        about : float
            The frame that stays in its place.
        """
        self.show(about - (about - self.first) / factor, about + (self.end - about) / factor)

    def pan(self, frames: float) -> None:
        """Show what lies some frames later, or earlier if negative."""
        self.show(self.first + frames, self.end + frames)

    @property
    def _n_frames(self) -> int:
        return max(self._session.n_frames, 1)

    def _follow_take(self) -> None:
        self.show_all()
        self.changed.emit()

    def _reveal(self, frame: int) -> None:
        if not self.first <= frame < self.end:
            length = self.end - self.first
            self.show(frame - _LEAD * length, frame + (1 - _LEAD) * length)


def ruler_step(span: VisibleSpan, rate: float, width: float) -> float:
    """Return the time [s] between labels of a ruler over `width` pixels.

    Parameters
    ----------
    span : VisibleSpan
        What is in sight.
    rate : float, Hz
        Frames per second.
    width : float, px
        Width of the ruler.
    """
    least = (span.end - span.first) / rate * _TICK_ROOM / width
    if least <= _ROUND_SECONDS[0]:
        power = 10.0 ** math.floor(math.log10(least))
        return next(power * factor for factor in (1.0, 2.0, 5.0, 10.0) if power * factor >= least * (1 - 1e-9))
    return next((step for step in _ROUND_SECONDS if step >= least), _ROUND_SECONDS[-1] * math.ceil(least / 3600.0))


def clock(seconds: float, step: float) -> str:
    """Return a time as a ruler shows it whose labels are `step` seconds apart.

    Parameters
    ----------
    seconds : float, s
        The time.
    step : float, s
        Time between two labels.

    Examples
    --------
    >>> clock(75.0, 5.0), clock(3.25, 0.05), clock(3725.0, 60.0)
    ('1:15', '0:03.25', '1:02:05')
    """
    decimals = min(max(0, math.ceil(-math.log10(step) - 1e-9)), 4)
    units = 10**decimals
    whole, rest = divmod(round(seconds * units), units)
    minutes, second = divmod(whole, 60)
    hours, minute = divmod(minutes, 60)
    shown = f"{hours}:{minute:02d}:{second:02d}" if hours else f"{minute}:{second:02d}"
    return shown + (f".{rest:0{decimals}d}" if decimals else "")


class SpanView(QWidget):
    """Shows the frames in sight between a gutter and a margin; the wheel zooms and pans, Ctrl with +, - and 0 zooms.

    Parameters
    ----------
    session : Session
        The take and the frame that is shown.
    span : VisibleSpan
        The frames in sight.
    parent : QWidget, optional
        Qt's parent.
    """

    def __init__(self, session: Session, span: VisibleSpan, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session, self._span = session, span
        for signal in (session.frame_changed, span.changed):
            signal.connect(self.update)

    @property
    def _plot_width(self) -> float:
        """How wide the part is that shows frames [px]."""
        return max(float(self.width() - GUTTER - MARGIN), 1.0)

    def _x_of(self, frame: float) -> float:
        """Where a frame begins [px]; half a frame more is its middle."""
        return GUTTER + (frame - self._span.first) * self._plot_width / (self._span.end - self._span.first)

    def _frame_at(self, x: float) -> int:
        """The frame at a place [px]; beyond the ends the first or last of the take."""
        frame = math.floor(self._span.first + (x - GUTTER) * (self._span.end - self._span.first) / self._plot_width)
        return min(max(frame, 0), max(self._session.n_frames, 1) - 1)

    def paint_cursor(self, painter: QPainter, bottom: int) -> None:
        """Paint the line of the frame that is shown, where it is in sight.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        bottom : int, px
            Where the line ends.
        """
        x = round(self._x_of(self._session.frame + 0.5))
        if GUTTER <= x <= self.width() - MARGIN:
            painter.setPen(QPen(cursor_colour(self.palette()), 1.0))
            painter.drawLine(x, 0, x, bottom)

    def tip_at(self, place: QPointF) -> str:
        """Describe what lies at a place; by default what the whole is."""
        return self.toolTip()

    def event(self, event: QEvent) -> bool:
        """Describe what lies under the pointer."""
        return show_tip(self, event, self.tip_at) or super().event(event)

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom about the pointer; pan with Shift, Alt or a sideways wheel."""
        across, away = notches(event)
        span, length = self._span, self._span.end - self._span.first
        if across:
            span.pan(-across * _PAN * length)
        elif event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
            span.pan(-away * _PAN * length)
        else:
            about = span.first + (event.position().x() - GUTTER) * length / self._plot_width
            span.zoom(ZOOM**away, min(max(about, span.first), span.end))
        event.accept()

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Zoom about the shown frame."""
        key, middle = event.key(), self._session.frame + 0.5
        if not event.modifiers() & Qt.KeyboardModifier.ControlModifier:
            super().keyPressEvent(event)
        elif key in {Qt.Key.Key_Plus, Qt.Key.Key_Equal}:
            self._span.zoom(ZOOM**2, middle)
        elif key == Qt.Key.Key_Minus:
            self._span.zoom(ZOOM**-2, middle)
        elif key == Qt.Key.Key_0:
            self._span.show_all()
        else:
            super().keyPressEvent(event)
