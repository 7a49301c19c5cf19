"""The timeline: a row of buttons (play, step, speed, loop, range, frame and time), ruler, spare points, lanes.

The ruler shows times, the range that is played, and the frame that is shown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from itertools import pairwise

from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QAction,
    QColor,
    QFontMetricsF,
    QIcon,
    QMouseEvent,
    QPainter,
    QPainterPath,
    QPaintEvent,
    QPalette,
    QPolygonF,
)
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QLabel, QSizePolicy, QSpinBox, QToolButton, QWidget

from skelgen.app.drawing.wording import plain
from skelgen.files import read_table
from skelgen_gui.model.curves import Panel, count_panel
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.lane_view import LaneView, Legend
from skelgen_gui.timeline.player import SPEEDS, PlayCommands, Player
from skelgen_gui.timeline.plot_view import PlotView
from skelgen_gui.timeline.span import GUTTER, SpanView, VisibleSpan, clock, ruler_step
from skelgen_gui.widgets.layouts import bare_column, put_texts
from skelgen_gui.widgets.painting import blended, cursor_colour, drawn_pixmap
from skelgen_gui.widgets.shortcuts import make_actions

_COUNTS_HEIGHT = 36


class Timeline(QWidget):
    """Plays the take, and shows what is known of every marker in every frame.

    Parameters
    ----------
    session : Session
        What is shown.
    actions : mapping of str to QAction, optional
        The window's, from `make_actions`; those of the menu Play are obeyed. Without them the timeline makes its own.

    Attributes
    ----------
    player : Player
        What plays.
    span : VisibleSpan
        Which frames are in sight; give it to `Curves` to keep both together.
    """

    def __init__(self, session: Session, actions: Mapping[str, QAction] | None = None) -> None:
        super().__init__()
        self._session = session
        if actions is None:
            actions = make_actions(self)
            self.addActions(list(actions.values()))
        self.player = Player(session, self)
        self.span = VisibleSpan(session, self)
        self.commands = PlayCommands(session, self.player, actions, self)
        self.transport = Transport(session, self.player, actions, self)
        self.ruler = Ruler(session, self.player, self.span, self)
        self.counts = PlotView(session, self.span, self)
        self.lane_view = LaneView(session, self.span, self)
        self.deriver = Deriver(self)
        put_texts(self)
        self.counts.setFixedHeight(_COUNTS_HEIGHT)
        column = bare_column(self, (self.transport, self.ruler, self.counts, self.lane_view, Legend(self)))
        column.setSpacing(0)
        column.setStretchFactor(self.lane_view, 1)
        session.project_changed.connect(self._follow_project)
        self._follow_project()

    def _follow_project(self) -> None:
        project = self._session.project
        if project is None:
            self.deriver.forget()
            self._take_counts(None)
        else:
            self.deriver.derive(partial(count_panel, project), self._take_counts)

    def _take_counts(self, panel: Panel | None) -> None:
        self.counts.setVisible(panel is not None)
        self.counts.show_panels((panel,) if panel is not None else ())


_TIME_STEP = 0.01  # s, to which the time of a frame is shown
_GAP = 10
_MOVES = ("first_frame", "previous_frame", "play", "next_frame", "last_frame")
_RANGES = ("range_from", "range_to", "range_all")

_SIZE = 16.0
_RATIO = 3.0  # pixels per point: sharp on any screen
_SIGNS = read_table(__file__, "signs")


class Transport(QWidget):
    """Buttons that play the take.

    Parameters
    ----------
    session : Session
        Whose frame is moved.
    player : Player
        What moves it.
    actions : mapping of str to QAction
        What `skelgen_gui.widgets.shortcuts.make_actions` gives; they are given signs and buttons here.
    """

    def __init__(
        self, session: Session, player: Player, actions: Mapping[str, QAction], parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._session, self._player, self._actions = session, player, actions
        self._make_controls()
        self._arrange()
        self._draw_icons()
        for signal in (session.project_changed, session.frame_changed):
            signal.connect(self._follow)
        for signal in (player.playing_changed, player.settings_changed):
            signal.connect(self._follow_player)
        self._follow_player()
        self._follow()

    def changeEvent(self, event: QEvent) -> None:
        """Draw the signs anew in the colours of another palette."""
        if event.type() == QEvent.Type.PaletteChange:
            self._draw_icons()
        super().changeEvent(event)

    def _make_controls(self) -> None:
        self.frame = QSpinBox(self)
        self.frame.setKeyboardTracking(False)
        self.frame.setMinimumWidth(84)
        self.frame.valueChanged.connect(self._session.show_frame)
        self._time = QLabel(self)
        self._time.setContentsMargins(_GAP // 2, 0, 0, 0)
        self.speed = QComboBox(self)
        put_texts(self)
        for speed in SPEEDS:
            self.speed.addItem(f"{plain(speed)} ×", speed)
        self.speed.activated.connect(lambda index: self._player.set_speed(self.speed.itemData(index)))

    def _arrange(self) -> None:
        row = QHBoxLayout(self)
        row.setContentsMargins(6, 3, 6, 3)
        row.setSpacing(2)
        groups = (
            [self._button(name) for name in _MOVES],
            [self.frame, self._time],
            [self.speed, self._button("loop")],
            [self._button(name) for name in _RANGES],
        )
        for group in groups:
            for part in group:
                row.addWidget(part)
            row.addSpacing(_GAP)
        row.addStretch(1)
        for before, after in pairwise(part for group in groups for part in group if part is not self._time):
            QWidget.setTabOrder(before, after)

    def _button(self, name: str) -> QToolButton:
        button = QToolButton(self)
        button.setDefaultAction(self._actions[name])
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonIconOnly)
        button.setAutoRaise(True)
        button.setAccessibleName(self._actions[name].statusTip())
        return button

    def _draw_icons(self) -> None:
        for name in (*_MOVES, *_RANGES, "loop"):
            sign = "pause" if name == "play" and self._player.is_playing else name
            self._actions[name].setIcon(_transport_icon(sign, self.palette()))

    def _follow(self) -> None:
        """Show the session's frame and time."""
        n_frames, rate, frame = self._session.n_frames, self._session.rate, self._session.frame
        self.setEnabled(n_frames > 0)
        self.frame.blockSignals(True)
        self.frame.setRange(0, max(n_frames - 1, 0))
        self.frame.setValue(frame)
        self.frame.blockSignals(False)
        last = max(n_frames - 1, 0) / rate
        self._time.setText(f"{clock(frame / rate, _TIME_STEP)} / {clock(last, _TIME_STEP)}")

    def _follow_player(self) -> None:
        self._draw_icons()
        self._actions["play"].setChecked(self._player.is_playing)
        self._actions["loop"].setChecked(self._player.loop)
        self.speed.setCurrentIndex(self.speed.findData(self._player.speed))


def _transport_icon(name: str, palette: QPalette) -> QIcon:
    """Return the icon of a transport button: ``pause``, or a command of the menu Play.

    Parameters
    ----------
    name : str
        ``pause``, or a command of the menu Play.
    palette : QPalette
        Whose text colour it has.
    """
    icon, shape = QIcon(), _path(name)
    for mode, group in (
        (QIcon.Mode.Normal, QPalette.ColorGroup.Active),
        (QIcon.Mode.Disabled, QPalette.ColorGroup.Disabled),
    ):
        ink = palette.color(group, QPalette.ColorRole.ButtonText)
        icon.addPixmap(drawn_pixmap(_SIZE, _RATIO, partial(_fill, shape, ink)), mode)
    return icon


def _fill(shape: QPainterPath, ink: QColor, painter: QPainter) -> None:
    painter.fillPath(shape, ink)


def _path(name: str) -> QPainterPath:
    path = QPainterPath()
    path.setFillRule(Qt.FillRule.WindingFill)
    for bar in _SIGNS["bars"].get(name, ()):
        path.addRoundedRect(QRectF(*bar), 0.8, 0.8)
    for polygon in _SIGNS["polygons"].get(name, ()):
        path.addPolygon(QPolygonF([QPointF(*corner) for corner in polygon]))
        path.closeSubpath()
    return path


_HEIGHT = 30
_GRIP = 6.0  # px, half the width in which a handle of the range can be caught
_HANDLE = 5.0
_LABEL = 30.0  # px, that a label reaches out at the left
_MINOR = 5  # parts between two labels
_Role = QPalette.ColorRole


class Ruler(SpanView):
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
        super().__init__(session, span, parent)
        self._player = player
        self._grip: int | None = None
        put_texts(self)
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        self.setMouseTracking(True)
        for signal in (session.project_changed, player.settings_changed):
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

    def _drag(self, x: float) -> None:
        frame = self._frame_at(x)
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
        return self._x_of(first) - _HANDLE, self._x_of(last + 1) + _HANDLE

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
        rate, width = self._session.rate, self._plot_width
        step = ruler_step(self._span, rate, width)
        text = self.palette().color(_Role.WindowText)
        faint = blended(text, self.palette().color(_Role.Window), 0.4)
        first = math.ceil(self._span.first / rate / step * _MINOR - 1e-9)
        last = math.floor(self._span.end / rate / step * _MINOR + 1e-9)
        metrics = QFontMetricsF(self.font())
        for index in range(first, last + 1):
            seconds = index * step / _MINOR
            x = self._x_of(seconds * rate + 0.5)
            is_labelled = index % _MINOR == 0
            painter.setPen(faint)
            painter.drawLine(QPointF(x, self.height() - 9), QPointF(x, self.height() - (15 if is_labelled else 12)))
            if is_labelled:
                shown = clock(seconds, step)
                painter.setPen(text)
                painter.drawText(QPointF(x - metrics.horizontalAdvance(shown) / 2, self.height() - 18), shown)

    def _paint_cursor(self, painter: QPainter) -> None:
        x = self._x_of(self._session.frame + 0.5)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(cursor_colour(self.palette()))
        low = float(self.height())
        painter.drawPolygon(QPolygonF([QPointF(x - 5, low - 10), QPointF(x + 5, low - 10), QPointF(x, low)]))
