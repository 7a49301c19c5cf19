"""The lanes: a bar for each marker over time, painted once and kept until something else is in sight; their legend."""

from functools import partial

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import (
    QContextMenuEvent,
    QFontMetricsF,
    QKeyEvent,
    QMouseEvent,
    QPainter,
    QPaintEvent,
    QPalette,
    QPixmap,
    QResizeEvent,
    QWheelEvent,
)
from PySide6.QtWidgets import QScrollBar, QSizePolicy, QWidget

from skelgen.app.drawing.lanes import Lanes, State, find_lanes
from skelgen.model import Project
from skelgen.model.arrays import Ints
from skelgen_gui.model.lanes import lane_picture, lane_sentence
from skelgen_gui.model.selection import NO_MARKERS, Selection
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.span import GUTTER, MARGIN, SpanView, VisibleSpan
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import blended, colour_of_limb, doubt_colour, paint_words, pixmap_of, rgb_of

_LANE = 16  # px, height of a lane
_FEW, _MANY = 4, 12  # lanes that fit at least, and that there is room for at first
_CHIP = 5.0  # px, width of the strip in the limb's colour beside a name
_TINT = 0.2  # of the highlight behind selected lanes
_Role = QPalette.ColorRole

_SAMPLE = 26  # px, width of a bar
_BAR = 14  # px, its height
_GAP = 18.0
_LEAST = 6.0  # px from the left border


class LaneView(SpanView):
    """A lane for each marker.

    Click or drag goes to a frame, a click on a name selects the marker, the wheel zooms.

    Attributes
    ----------
    lanes : Lanes or None
        The lanes that are shown; None while they are derived.

    Parameters
    ----------
    session : Session
        What is shown.
    span : VisibleSpan
        Which frames are in sight.
    """

    def __init__(self, session: Session, span: VisibleSpan, parent: QWidget | None = None) -> None:
        super().__init__(session, span, parent)
        self.lanes: Lanes | None = None
        self._lanes_of: Project | None = None
        self._picture: tuple[tuple[object, ...], QPixmap] | None = None
        self._is_dragging = False
        self.deriver = Deriver(self)
        self._bar = QScrollBar(Qt.Orientation.Vertical, self)
        self._bar.setSingleStep(_LANE)
        self._bar.valueChanged.connect(self.update)
        put_texts(self)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setMouseTracking(True)
        session.selection_changed.connect(self.update)
        session.project_changed.connect(self._follow_project)
        session.selection_changed.connect(self._show_selected)
        self._follow_project()

    def sizeHint(self) -> QSize:
        """Return room for some lanes."""
        return QSize(640, _LANE * min(max(self._n_lanes, _FEW), _MANY))

    def minimumSizeHint(self) -> QSize:
        """Return room for few lanes."""
        return QSize(GUTTER + MARGIN + 120, _LANE * _FEW)

    def place_of(self, lane: int, frame: int) -> QPointF:
        """Return the middle of a frame of a lane, in this widget.

        Parameters
        ----------
        lane, frame : int
            Which lane, and which frame of it.
        """
        return QPointF(self._x_of(frame + 0.5), _LANE * (lane + 0.5) - self._bar.value())

    def tip_at(self, place: QPointF) -> str:
        """Describe a place: the marker, and how it is known in the frame there."""
        lane, project = self._lane_at(place.y()), self._lanes_of
        if lane is None or self.lanes is None or project is None:
            return self.tr("Wheel: zoom · Shift and wheel: pan · click: go there · click on a name: select")
        frame = self._frame_at(place.x()) if place.x() >= GUTTER else None
        return lane_sentence(project, self.lanes, lane, frame)

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Go to a frame, or select a marker by its name."""
        if event.button() != Qt.MouseButton.LeftButton or not self._session.n_frames:
            return
        self._is_dragging = event.position().x() >= GUTTER
        if self._is_dragging:
            self._session.show_frame(self._frame_at(event.position().x()))
        else:
            self._select(self._lane_at(event.position().y()), event.modifiers())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Go on to other frames."""
        if self._is_dragging and event.buttons() & Qt.MouseButton.LeftButton:
            self._session.show_frame(self._frame_at(event.position().x()))

    def contextMenuEvent(self, event: QContextMenuEvent) -> None:
        """Ask for a menu for what is selected; the marker under the pointer is selected first."""
        lane = self._lane_at(event.pos().y())
        is_mouse = event.reason() is QContextMenuEvent.Reason.Mouse
        here = None if self.lanes is None or lane is None else int(self.lanes.markers[lane])
        if is_mouse and here is not None and here not in self._session.selection.markers:
            self._select(lane, Qt.KeyboardModifier.NoModifier)
        self._session.menu_requested.emit(event.globalPos())

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom or pan; over the names, scroll."""
        if event.position().x() < GUTTER:
            self._bar.event(event)
        else:
            super().wheelEvent(event)

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Select the marker above or below; zoom."""
        if event.key() in {Qt.Key.Key_Up, Qt.Key.Key_Down} and self._n_lanes:
            self._select_beside(-1 if event.key() == Qt.Key.Key_Up else 1)
        else:
            super().keyPressEvent(event)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep the scroll bar at the right."""
        self._bar.setGeometry(self.width() - MARGIN + 2, 0, MARGIN - 2, self.height())
        self._fit_bar()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint selected lanes, bars, names, and the cursor."""
        with QPainter(self) as painter:
            if self.lanes is not None and self._lanes_of is not None and self.lanes.n_lanes:
                shown = self._shown_lanes(self.lanes)
                self._paint_backs(painter, self.lanes, shown)
                top = _LANE * int(shown[0]) - self._bar.value()
                painter.drawPixmap(GUTTER, top, self._bars(self.lanes, shown))
                self._paint_names(painter, self.lanes, shown, self._lanes_of)
            else:
                self._paint_nothing(painter)
            if self._session.n_frames:
                self.paint_cursor(painter, self.height())

    def _follow_project(self) -> None:
        """Derive lanes; until they are there, those of an earlier result of the same take stay."""
        project = self._session.project
        self.deriver.forget()
        if project is None or self._lanes_of is None or self._lanes_of.take is not project.take:
            self._take_lanes(None, None)
        if project is not None:
            self.deriver.derive(partial(find_lanes, project), partial(self._take_lanes, project))

    def _take_lanes(self, project: Project | None, lanes: Lanes | None) -> None:
        self._lanes_of, self.lanes, self._picture = project, lanes, None
        self._fit_bar()
        self.updateGeometry()
        self.update()

    def _show_selected(self) -> None:
        """Scroll to a marker that was selected elsewhere."""
        lanes = [] if self.lanes is None else np.flatnonzero(np.isin(self.lanes.markers, self._selected())).tolist()
        if lanes:
            top, bottom = _LANE * lanes[0], _LANE * (lanes[0] + 1)
            self._bar.setValue(min(max(self._bar.value(), bottom - self.height()), top))

    def _selected(self) -> list[int]:
        """Markers that are selected, by themselves or with their limb."""
        selection, project = self._session.selection, self._session.project
        if selection.markers or not selection.limbs or project is None or not project.has("limbs"):
            return sorted(selection.markers)
        markers: list[int] = np.flatnonzero(np.isin(project.limbs.limb_of_marker, list(selection.limbs))).tolist()
        return markers

    def _select(self, lane: int | None, modifiers: Qt.KeyboardModifier) -> None:
        """Select a lane's marker; with Control another one as well, or one less."""
        marker = frozenset({int(self.lanes.markers[lane])}) if self.lanes is not None and lane is not None else None
        if modifiers & Qt.KeyboardModifier.ControlModifier and marker is not None:
            self._session.select(Selection(self._session.selection.markers ^ marker))
        else:
            self._session.select(Selection(marker or NO_MARKERS))

    def _select_beside(self, step: int) -> None:
        """Select the marker of the lane above or below the selected one."""
        if self.lanes is None or not self.lanes.n_lanes:
            return
        lanes = np.flatnonzero(np.isin(self.lanes.markers, self._selected()))
        lane = (int(lanes[0 if step < 0 else -1]) + step) if len(lanes) else 0
        self._select(min(max(lane, 0), self._n_lanes - 1), Qt.KeyboardModifier.NoModifier)

    @property
    def _n_lanes(self) -> int:
        return 0 if self.lanes is None else self.lanes.n_lanes

    def _lane_at(self, y: float) -> int | None:
        lane = int((y + self._bar.value()) // _LANE)
        return lane if 0 <= lane < self._n_lanes else None

    def _fit_bar(self) -> None:
        beyond = max(_LANE * self._n_lanes - self.height(), 0)
        self._bar.setRange(0, beyond)
        self._bar.setPageStep(self.height())
        self._bar.setVisible(beyond > 0)

    def _shown_lanes(self, lanes: Lanes) -> Ints:
        first = self._bar.value() // _LANE
        last = min((self._bar.value() + self.height()) // _LANE, lanes.n_lanes - 1)
        return np.arange(first, last + 1)

    def _bars(self, lanes: Lanes, shown: Ints) -> QPixmap:
        """The bars of some lanes: kept, since while the take plays only the cursor moves."""
        ratio, width = self.devicePixelRatioF(), self._plot_width
        key = (self._span.first, self._span.end, width, ratio, int(shown[0]), len(shown), self.palette().cacheKey())
        if self._picture is None or self._picture[0] != key:
            columns = max(round(width * ratio), 1)
            shares = lanes.shares(shown, np.linspace(self._span.first, self._span.end, columns + 1))
            colours = np.array([rgb_of(colour_of_limb(limb, self.palette())) for limb in lanes.limbs[shown].tolist()])
            doubt = rgb_of(doubt_colour(self.palette()))
            pixels = lane_picture(shares, colours, doubt, max(round(_LANE * ratio), 1))
            self._picture = key, pixmap_of(pixels, ratio)
        return self._picture[1]

    def _paint_backs(self, painter: QPainter, lanes: Lanes, shown: Ints) -> None:
        """Every other limb on a ground of its own; selected lanes on the highlight."""
        palette = self.palette()
        other = palette.color(_Role.AlternateBase)
        marked = blended(palette.color(_Role.Highlight), palette.color(_Role.Base), _TINT)
        selected = np.isin(lanes.markers, self._selected())
        groups = np.cumsum(np.diff(lanes.limbs, prepend=lanes.limbs[:1]) != 0)
        painter.fillRect(self.rect(), palette.color(_Role.Base))
        for lane in shown.tolist():
            if selected[lane] or groups[lane] % 2:
                place = QRectF(0, _LANE * lane - self._bar.value(), self.width() - MARGIN, _LANE)
                painter.fillRect(place, marked if selected[lane] else other)

    def _paint_names(self, painter: QPainter, lanes: Lanes, shown: Ints, project: Project) -> None:
        names, metrics = project.trajectories.names, QFontMetricsF(self.font())
        text = self.palette().color(_Role.Text)
        for lane in shown.tolist():
            top = _LANE * lane - self._bar.value()
            painter.fillRect(QRectF(4, top, _CHIP, _LANE), colour_of_limb(int(lanes.limbs[lane]), self.palette()))
            painter.setPen(text)
            room = QRectF(4 + 2 * _CHIP, top, GUTTER - 8 - 2 * _CHIP, _LANE)
            name = metrics.elidedText(names[lanes.markers[lane]], Qt.TextElideMode.ElideMiddle, room.width())
            painter.drawText(room, Qt.AlignmentFlag.AlignVCenter | Qt.AlignmentFlag.AlignLeft, name)

    def _paint_nothing(self, painter: QPainter) -> None:
        painter.fillRect(self.rect(), self.palette().color(_Role.Base))
        if self.deriver.is_busy:
            words = self.tr("Looking through the take …")
        elif self._session.project is None:
            words = self.tr("Open a take to see its markers here")
        else:
            words = self.tr("Run the step Labels to see a lane for each marker")
        paint_words(painter, QRectF(self.rect()), words, self.palette())


class Legend(QWidget):
    """A sample of each bar with its meaning."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._words = {
            State.SEEN: self.tr("seen"),
            State.FILLED: self.tr("filled by the skeleton"),
            State.DOUBTFUL: self.tr("doubtful"),
            State.LEFT_OUT: self.tr("on no limb"),
        }
        put_texts(self)
        self.setAccessibleDescription(", ".join(self._words.values()))
        self.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)

    def sizeHint(self) -> QSize:
        """Return one low line."""
        return QSize(400, _BAR + 8)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the samples as lanes are painted."""
        with QPainter(self) as painter:
            metrics = QFontMetricsF(self.font())
            widths = [_SAMPLE + 5 + metrics.horizontalAdvance(words) + _GAP for words in self._words.values()]
            x = min(float(GUTTER), max(self.width() - sum(widths), _LEAST))  # below the lanes, if there is room
            ratio = self.devicePixelRatioF()
            doubt = rgb_of(doubt_colour(self.palette()))
            for (state, words), width in zip(self._words.items(), widths, strict=True):
                shares = np.zeros((1, round(_SAMPLE * ratio), len(State)))
                shares[..., state] = 1.0
                colours = rgb_of(colour_of_limb(-1 if state == State.LEFT_OUT else 0, self.palette()))[np.newaxis]
                bar = lane_picture(shares, colours, doubt, round(_BAR * ratio))
                painter.drawPixmap(QPointF(x, 4), pixmap_of(bar, ratio))
                painter.setPen(self.palette().color(QPalette.ColorRole.WindowText))
                painter.drawText(QPointF(x + _SAMPLE + 5, 4 + (_BAR + metrics.ascent() - metrics.descent()) / 2), words)
                x += width
