"""Panels of curves above each other over the frames in sight: residuals, and angles of the selected joint.

A panel is painted with its grid, bands, lines, and a legend with the values of the frame that is shown.
"""

from __future__ import annotations

from functools import partial

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QFont, QFontMetricsF, QMouseEvent, QPainter, QPaintEvent, QPalette, QPen, QPixmap
from PySide6.QtWidgets import QWidget

from skelgen.app.drawing.scales import ticks
from skelgen.app.drawing.wording import digits, plain
from skelgen.model import Project
from skelgen.model.arrays import Floats
from skelgen_gui.model.curves import Curve, Panel, joint_panels, residual_curve, residual_panel
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.span import GUTTER, MARGIN, SpanView, VisibleSpan
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import blended, colour_of_limb, component_colour, draw_lines, is_dark, paint_words

_GAP = 6.0  # px between panels


class PlotView(SpanView):
    """Shows panels; click or drag goes to a frame, the wheel zooms.

    Attributes
    ----------
    panels : tuple of Panel
        What is shown.
    hint : str
        Words below the panels, or instead of them.

    Parameters
    ----------
    session : Session
        Whose frame is shown.
    span : VisibleSpan
        Which frames are in sight.
    """

    def __init__(self, session: Session, span: VisibleSpan, parent: QWidget | None = None) -> None:
        super().__init__(session, span, parent)
        self.panels: tuple[Panel, ...] = ()
        self.hint = ""
        self._picture: tuple[tuple[object, ...], QPixmap] | None = None
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        session.take_changed.connect(self._follow_take)

    def show_panels(self, panels: tuple[Panel, ...], hint: str = "") -> None:
        """Show some panels, and below them, or instead of them, a hint.

        Parameters
        ----------
        panels : tuple of Panel
            From above to below.
        hint : str
            Words below them, or instead of them.
        """
        self.panels, self.hint, self._picture = panels, hint, None
        self.update()

    def minimumSizeHint(self) -> QSize:
        """Return room for one low panel."""
        return QSize(GUTTER + MARGIN + 120, 36)

    def panel_rect(self, index: int) -> QRectF:
        """Return where a panel's curves lie."""
        count = len(self.panels) + (1 if self.hint and self.panels else 0)
        height = (self.height() + _GAP) / max(count, 1) - _GAP
        return QRectF(GUTTER, index * (height + _GAP), self._plot_width, height)

    def tip_at(self, place: QPointF) -> str:
        """Return the values of the frame at a place, and what the panel's note says."""
        rooms = (self.panel_rect(index) for index in range(len(self.panels)))
        y, panels = place.y(), zip(self.panels, rooms, strict=True)
        panel = next((panel for panel, room in panels if room.top() <= y <= room.bottom()), None)
        if panel is None or place.x() < GUTTER:
            return self.toolTip() if panel is None else "\n".join(filter(None, (panel.title, panel.note, panel.about)))
        frame = self._frame_at(place.x())
        values = [f"{curve.name}: {digits(float(curve.line.low[frame]))} {panel.unit}" for curve in panel.curves]
        return "\n".join([f"{panel.title}, " + self.tr("frame {}").format(frame), *values])

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Go to a frame."""
        if event.button() == Qt.MouseButton.LeftButton and event.position().x() >= GUTTER:
            self._go_to(event.position().x())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Go on to other frames."""
        if event.buttons() & Qt.MouseButton.LeftButton:
            self._go_to(event.position().x())

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the curves that are kept, legends and cursor."""
        with QPainter(self) as painter:
            painter.drawPixmap(0, 0, self._curves())
            frame = self._session.frame
            for index, panel in enumerate(self.panels):
                paint_legend(painter, panel, frame, self.panel_rect(index), self.palette())
            if self.panels:
                self.paint_cursor(painter, round(self.panel_rect(len(self.panels) - 1).bottom()))
            if self.hint:
                room = self.panel_rect(len(self.panels)) if self.panels else QRectF(self.rect())
                paint_words(painter, room, self.hint, self.palette())

    def _follow_take(self) -> None:
        """Drop the curves of another take, which has other frames, until those of this one are there."""
        self.show_panels(())

    def _go_to(self, x: float) -> None:
        self._session.show_frame(self._frame_at(x))

    def _curves(self) -> QPixmap:
        """The panels without legend and cursor: kept, since while the take plays only these change."""
        ratio = self.devicePixelRatioF()
        key = (self._span.first, self._span.end, self.size(), ratio, self.palette().cacheKey())
        if self._picture is None or self._picture[0] != key:
            picture = QPixmap(self.size() * ratio)
            picture.setDevicePixelRatio(ratio)
            picture.fill(Qt.GlobalColor.transparent)
            with QPainter(picture) as painter:
                painter.setFont(self.font())
                for index, panel in enumerate(self.panels):
                    paint_plot(painter, panel, self._span, self.panel_rect(index), self.palette())
            self._picture = key, picture
        return self._picture[1]


class Curves(PlotView):
    """Residuals of all and of selected markers, angles of the selected joint with their band, and its deviation.

    Of a selected limb the joint above it is shown.

    Parameters
    ----------
    session : Session
        What is shown.
    span : VisibleSpan, optional
        Which frames are in sight; give that of the timeline to keep both together.
    """

    def __init__(self, session: Session, span: VisibleSpan | None = None, parent: QWidget | None = None) -> None:
        super().__init__(session, span or VisibleSpan(session, parent), parent)
        self._mean: tuple[Project, Curve] | None = None
        self.deriver = Deriver(self)
        put_texts(self)
        session.project_changed.connect(self._follow)
        session.selection_changed.connect(self._follow)
        self._follow()

    def sizeHint(self) -> QSize:
        """Return room for three panels."""
        return QSize(640, 320)

    def _follow(self) -> None:
        """Derive what is selected; the mean of all markers only once for each project."""
        project, selection = self._session.project, self._session.selection
        if project is None or not project.has("skeleton"):
            self.deriver.forget()
            self.show_panels((), self.tr("Run the step Skeleton to see residuals and angles of joints"))
            return
        joint = selection.joint
        if joint is None and selection.limb is not None:
            above = np.flatnonzero(project.topology.children == selection.limb)
            joint = int(above[0]) if len(above) else None
        mean = self._mean[1] if self._mean is not None and self._mean[0] is project else None
        wanted = partial(_panels, project, mean, tuple(sorted(selection.markers)), joint)
        self.deriver.derive(wanted, partial(self._take, project, joint))

    def _take(self, project: Project, joint: int | None, panels: tuple[Panel, ...]) -> None:
        self._mean = project, panels[0].curves[0]
        self.show_panels(panels, "" if joint is not None else self.tr("Select a joint or a limb to see its angles"))


def _panels(project: Project, mean: Curve | None, markers: tuple[int, ...], joint: int | None) -> tuple[Panel, ...]:
    residuals = residual_panel(project, mean or residual_curve(project), markers)
    return (residuals, *(joint_panels(project, joint) if joint is not None else ()))


_TICK_ROOM = 24.0  # px between lines of the grid
_BAND = 0.25  # opacity
_AIR = 0.06  # of the height, free above and below the curves
_LINE = 1.3
_VEIL = 0.75  # opacity of the ground behind values of the scale
_CHIP = 8.0
_SHADE = 35  # percent by which a further curve of the same limb stands out more from the ground
_Role = QPalette.ColorRole


def _colour_of(curve: Curve, palette: QPalette) -> QColor:
    """Return the colour of a curve.

    Parameters
    ----------
    curve : Curve
        The curve.
    palette : QPalette
        Light or dark.
    """
    if curve.limb is not None:
        colour, change = colour_of_limb(curve.limb, palette), 100 + _SHADE * curve.shade
        return colour.lighter(change) if is_dark(palette) else colour.darker(change)
    return palette.color(_Role.Text) if curve.component is None else component_colour(curve.component, palette)


def paint_plot(painter: QPainter, panel: Panel, span: VisibleSpan, place: QRectF, palette: QPalette) -> None:
    """Paint grid and curves.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    panel : Panel
        What is drawn.
    span : VisibleSpan
        Which frames.
    place : QRectF, px
        Where; the legend lies at the left of it.
    palette : QPalette
        Colours of texts and ground.
    """
    n_columns = max(round(place.width()), 1)
    columns = panel.columns(span.first, span.end, n_columns)
    low, high = panel.scale(columns)
    air = _AIR * (high - low)
    high += air
    low -= 0.0 if panel.from_zero and low == 0 else air
    painter.save()
    painter.setClipRect(place)
    painter.fillRect(place, palette.color(_Role.Base))
    lines = _grid(low, high, place)
    for value, y in lines:
        painter.setPen(blended(palette.color(_Role.Text), palette.color(_Role.Base), 0.3 if value == 0 else 0.12))
        painter.drawLine(QPointF(place.left(), y), QPointF(place.right(), y))

    def heights(values: Floats) -> Floats:
        return np.asarray(place.bottom() - (values - low) / (high - low) * place.height())

    xs = np.arange(n_columns, dtype=np.float64) + (place.left() + 0.5)
    for curve, found in zip(panel.curves, columns, strict=True):
        colour = _colour_of(curve, palette)
        if found.band is not None:
            _paint_band(painter, colour, _upright(xs, *map(heights, found.band)))
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(QPen(colour, _LINE, Qt.PenStyle.SolidLine, Qt.PenCapStyle.SquareCap))  # round: 10 times slower
        draw_lines(painter, _joined(xs, *map(heights, found.line)))
    _paint_scale(painter, lines, place, palette)
    painter.restore()


def paint_legend(painter: QPainter, panel: Panel, frame: int, place: QRectF, palette: QPalette) -> None:
    """Paint the title, and a line for each curve with its value in a frame.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    panel : Panel
        What is drawn.
    frame : int
        The frame whose values are written.
    place : QRectF, px
        Where the curves are; the legend lies at the left of it.
    palette : QPalette
        Colours of texts.
    """
    font, bold = painter.font(), QFont(painter.font())
    bold.setBold(True)
    metrics = QFontMetricsF(font)
    step = metrics.height()
    left, room = 6.0, place.left() - 14.0
    rows = [QRectF(left, place.top() + 2 + step * index, room, step) for index in range(len(panel.curves) + 2)]
    title = f"{panel.title} [{panel.unit}]" if panel.unit else panel.title
    elide = Qt.TextElideMode.ElideRight
    painter.setPen(palette.color(_Role.WindowText))
    painter.setFont(bold)
    painter.drawText(rows[0], Qt.AlignmentFlag.AlignLeft, QFontMetricsF(bold).elidedText(title, elide, room))
    painter.setFont(font)
    for row, curve in zip(rows[1:], panel.curves, strict=False):
        if row.bottom() > place.bottom():
            return
        values = curve.line.low
        value = digits(float(values[frame])) if frame < len(values) else ""
        chip = QRectF(row.left(), row.center().y() - 1.5, _CHIP, 3.0)
        painter.fillRect(chip, _colour_of(curve, palette))
        name_room = room - _CHIP - 6 - metrics.horizontalAdvance(value) - 4
        name = metrics.elidedText(curve.name, Qt.TextElideMode.ElideMiddle, name_room)
        painter.drawText(row.adjusted(_CHIP + 5, 0, 0, 0), Qt.AlignmentFlag.AlignLeft, name)
        painter.drawText(row, Qt.AlignmentFlag.AlignRight, value)
    last = rows[len(panel.curves) + 1]
    if panel.note and last.bottom() <= place.bottom():
        painter.setPen(palette.color(_Role.PlaceholderText))
        painter.drawText(last, Qt.AlignmentFlag.AlignLeft, metrics.elidedText(panel.note, elide, room))


def _grid(low: float, high: float, place: QRectF) -> list[tuple[float, float]]:
    """Round values, and the height of each [px]."""
    wanted = max(int(place.height() / _TICK_ROOM), 1)
    scale = place.height() / (high - low)
    return [(value, round(place.bottom() - (value - low) * scale) + 0.5) for value in ticks(low, high, wanted)]


def _paint_scale(painter: QPainter, lines: list[tuple[float, float]], place: QRectF, palette: QPalette) -> None:
    """Values of the grid, above the curves on a ground that lets these through."""
    text, ground = palette.color(_Role.Text), palette.color(_Role.Base)
    metrics = QFontMetricsF(painter.font())
    veil = QColor(ground)
    veil.setAlphaF(_VEIL)
    painter.setPen(blended(text, ground, 0.65))
    for value, y in lines:
        shown = plain(value)
        room = QRectF(
            place.left() + 2, y - metrics.height(), metrics.horizontalAdvance(shown) + 6, metrics.height() - 1
        )
        if room.top() >= place.top():
            painter.fillRect(room, veil)
            painter.drawText(room, Qt.AlignmentFlag.AlignCenter, shown)


def _paint_band(painter: QPainter, colour: QColor, lines: Floats) -> None:
    veil = QColor(colour)
    veil.setAlphaF(_BAND)
    painter.setRenderHint(QPainter.RenderHint.Antialiasing, False)
    painter.setPen(QPen(veil, 1.0))
    draw_lines(painter, lines)


def _upright(xs: Floats, starts: Floats, stops: Floats) -> Floats:
    """Upright lines, shape (n, 2, 2), without those that are unknown."""
    known = ~np.isnan(starts) & ~np.isnan(stops)
    return np.stack([np.stack([xs, starts], axis=1), np.stack([xs, stops], axis=1)], axis=1)[known]


def _joined(xs: Floats, starts: Floats, stops: Floats) -> Floats:
    """Lines that join the columns of a curve, each a pixel apart, without bridging what is unknown."""
    upright = _upright(xs, starts, stops)
    across = np.stack([np.stack([xs[:-1], stops[:-1]], axis=1), np.stack([xs[1:], starts[1:]], axis=1)], axis=1)
    return np.concatenate([upright, across[~np.isnan(across).any(axis=(1, 2))]])
