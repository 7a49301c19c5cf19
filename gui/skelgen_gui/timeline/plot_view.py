"""Panels of curves above each other over the frames in sight: residuals, and angles of the selected joint."""

from functools import partial

import numpy as np
from PySide6.QtCore import QEvent, QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QPixmap, QWheelEvent
from PySide6.QtWidgets import QWidget

from skelgen.app.drawing.wording import digits
from skelgen.model import Project, Take
from skelgen_gui.model.curves import Curve, Panel, joint_panels, residual_curve, residual_panel
from skelgen_gui.project.deriving import Deriver
from skelgen_gui.project.session import Session
from skelgen_gui.timeline.plot import paint_legend, paint_plot
from skelgen_gui.timeline.span import GUTTER, MARGIN, VisibleSpan, plot_width, zoom_or_pan, zoomed_by_key
from skelgen_gui.widgets.painting import paint_words, show_tip
from skelgen_gui.widgets.theme import cursor_colour

_GAP = 6.0  # px between panels


class PlotView(QWidget):
    """Shows panels; click or drag goes to a frame, the wheel zooms.

    Parameters
    ----------
    session : Session
        Whose frame is shown.
    span : VisibleSpan
        Which frames are in sight.
    """

    def __init__(self, session: Session, span: VisibleSpan, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._session, self._span = session, span
        self._panels: tuple[Panel, ...] = ()
        self._hint = ""
        self._picture: tuple[tuple[object, ...], QPixmap] | None = None
        self._panels_of: Take | None = None
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        session.project_changed.connect(self._forget_other_take)
        for signal in (session.frame_changed, span.changed):
            signal.connect(self.update)

    @property
    def panels(self) -> tuple[Panel, ...]:
        """What is shown."""
        return self._panels

    @property
    def hint(self) -> str:
        """Words below the panels, or instead of them."""
        return self._hint

    def show_panels(self, panels: tuple[Panel, ...], hint: str = "") -> None:
        """Show some panels, and below them, or instead of them, a hint.

        Parameters
        ----------
        panels : tuple of Panel
            From above to below.
        hint : str
            Words below them, or instead of them.
        """
        self._panels, self._hint, self._picture = panels, hint, None
        self.update()

    def minimumSizeHint(self) -> QSize:
        """Return room for one low panel."""
        return QSize(GUTTER + MARGIN + 120, 36)

    def panel_rect(self, index: int) -> QRectF:
        """Return where a panel's curves lie."""
        count = len(self._panels) + (1 if self._hint and self._panels else 0)
        height = (self.height() + _GAP) / max(count, 1) - _GAP
        return QRectF(GUTTER, index * (height + _GAP), plot_width(self.width()), height)

    def event(self, event: QEvent) -> bool:
        """Describe what lies under the pointer."""
        return show_tip(self, event, self.tip_at) or super().event(event)

    def tip_at(self, place: QPointF) -> str:
        """Return the values of the frame at a place, and what the panel's note says."""
        rooms = (self.panel_rect(index) for index in range(len(self._panels)))
        y, panels = place.y(), zip(self._panels, rooms, strict=True)
        panel = next((panel for panel, room in panels if room.top() <= y <= room.bottom()), None)
        if panel is None or place.x() < GUTTER:
            return self.toolTip() if panel is None else "\n".join(filter(None, (panel.title, panel.note, panel.about)))
        frame = self._span.frame_at(place.x(), GUTTER, plot_width(self.width()))
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

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom or pan."""
        zoom_or_pan(event, self._span, plot_width(self.width()))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Zoom."""
        if not zoomed_by_key(event, self._span, self._session.frame):
            super().keyPressEvent(event)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint the curves that are kept, legends and cursor."""
        with QPainter(self) as painter:
            painter.drawPixmap(0, 0, self._curves())
            frame = self._session.frame
            for index, panel in enumerate(self._panels):
                paint_legend(painter, panel, frame, self.panel_rect(index), self.palette())
            x = round(self._span.place(frame + 0.5, GUTTER, plot_width(self.width())))
            if self._panels and GUTTER <= x <= self.width() - MARGIN:
                painter.setPen(QPen(cursor_colour(self.palette()), 1.0))
                painter.drawLine(x, 0, x, round(self.panel_rect(len(self._panels) - 1).bottom()))
            if self._hint:
                room = self.panel_rect(len(self._panels)) if self._panels else QRectF(self.rect())
                paint_words(painter, room, self._hint, self.palette())

    def _forget_other_take(self) -> None:
        """Drop the curves of another take, which has other frames, until those of this one are there."""
        project = self._session.project
        if project is None or project.take is not self._panels_of:
            self._panels_of = None if project is None else project.take
            self.show_panels(())

    def _go_to(self, x: float) -> None:
        self._session.show_frame(self._span.frame_at(x, GUTTER, plot_width(self.width())))

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
                for index, panel in enumerate(self._panels):
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
        self.setAccessibleName(self.tr("Curves"))
        self.setToolTip(self.tr("Residuals, and angles of the selected joint. Wheel: zoom, click: go there"))
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
