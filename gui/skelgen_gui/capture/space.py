"""Points and bodies of a capture in space, with the cameras that see them; drawn as they come, without a take."""

import math
from dataclasses import replace

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QKeyEvent, QMouseEvent, QPainter, QPaintEvent, QPen, QResizeEvent, QWheelEvent
from PySide6.QtWidgets import QWidget

from skelgen.app.capture_jobs.images import NO_BODY
from skelgen.app.capture_jobs.messages import FoundInSpace
from skelgen.model.arrays import Floats
from skelgen.model.rig import CameraRig, StereoRig
from skelgen_gui.model.picture import Canvas
from skelgen_gui.model.viewpoint import DEPTH, Viewpoint, cameras_of, up_axis
from skelgen_gui.view3d.colours import Colours, Sprites, Style
from skelgen_gui.view3d.controls import ARROWS, KEY_SHIFT, KEY_TURN, ZOOMS, Drag, DragKind, dragged, wheeled
from skelgen_gui.view3d.renderer import paint_background
from skelgen_gui.widgets.layouts import put_texts
from skelgen_gui.widgets.painting import colour_of_limb, doubt_colour, draw_lines, draw_names

# A rig's x right, y down, z away, turned to x right, y away, z up, as viewers stand
_SHOWN_FROM_RIG = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])

_HOME = Viewpoint(azimuth=math.radians(-62), elevation=math.radians(22), up=2)
_AXIS = 60.0  # mm, of the axes of a body
_RADIUS = 5.0  # px, of a point


class Space(QWidget):
    """Shows cameras, points and bodies in space.

    Dragging orbits, the right button shifts, the wheel zooms, F fits what is there.

    Parameters
    ----------
    parent : QWidget, optional
        Parent widget.
    """

    own_keys = frozenset({*ARROWS, *ZOOMS, Qt.Key.Key_F, Qt.Key.Key_1})

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._canvas = Canvas(_HOME, 1, 1)
        self._rig: StereoRig | CameraRig | None = None
        self._names: tuple[str, ...] = ()
        self._shown_from_world = _SHOWN_FROM_RIG
        self._frustums: Floats = np.zeros((0, 2, 3))
        self._found = FoundInSpace()
        self._is_home = True
        self._drag: Drag | None = None
        self._sprites = Sprites(1.0)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        put_texts(self)

    def show_rig(self, rig: StereoRig | CameraRig) -> None:
        """Show the cameras of a rig, and what they look at."""
        if rig is self._rig:
            return
        self._rig, self._is_home, self._found = rig, True, FoundInSpace()
        self._canvas = replace(self._canvas, viewpoint=_HOME)
        if isinstance(rig, CameraRig):
            self._names = rig.names
            is_on_floor = up_axis(cameras_of(rig)) == _HOME.up
            self._shown_from_world = np.eye(3) if is_on_floor else _SHOWN_FROM_RIG
            self._lay_frustums(float(np.linalg.norm(rig.places - rig.places.mean(axis=0), axis=1).mean()))
        else:
            self._names, self._shown_from_world = (self.tr("left"), self.tr("right")), _SHOWN_FROM_RIG
            self._lay_frustums(2 * rig.baseline)  # a typical distance, before anything was seen

    def clear(self) -> None:
        """Show nothing: what was found belongs to other images."""
        self._rig, self._found, self._is_home = None, FoundInSpace(), True
        self._frustums = np.zeros((0, 2, 3))
        self.update()

    def show_found(self, found: FoundInSpace) -> None:
        """Show what was found in a pair of images."""
        is_first = not len(self._found.points) and len(found.points) > 0
        self._found = found
        if is_first and self._is_home and isinstance(self._rig, StereoRig):
            self._lay_frustums(float(np.median(np.linalg.norm(found.points, axis=1))))
        self.update()

    def fit(self) -> None:
        """Look at the cameras and all that was found."""
        everything = np.concatenate([self._frustums.reshape(-1, 3), self._shown(self._found.points)])
        canvas = self._canvas
        self._canvas = replace(canvas, viewpoint=canvas.viewpoint.fitted(everything, canvas.width, canvas.height))
        self.update()

    def look_from_cameras(self) -> None:
        """Look from behind the cameras."""
        self._move(replace(self._canvas.viewpoint, azimuth=-math.pi / 2, elevation=0.0))
        self.fit()

    def sizeHint(self) -> QSize:
        """Return a comfortable size."""
        return QSize(900, 360)

    def minimumSizeHint(self) -> QSize:
        """Return the least useful size."""
        return QSize(200, 90)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Paint cameras, points and bodies."""
        colours, canvas = Colours(self.palette()), self._canvas
        if self._sprites.ratio != self.devicePixelRatioF():
            self._sprites = Sprites(self.devicePixelRatioF())
        with QPainter(self) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            paint_background(painter, canvas, colours)
            painter.setPen(QPen(colours.mixed(colours.ink, 0.45), 1.2))
            if self._rig is None:
                painter.drawText(self.rect(), Qt.AlignmentFlag.AlignCenter, self.tr("Cameras and points in space"))
            self._paint_lines(painter, self._frustums)
            self._paint_names_of_cameras(painter, colours)
            self._paint_points(painter)
            self._paint_bodies(painter, colours)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Keep an untouched view fitted."""
        self._canvas = replace(self._canvas, width=self.width(), height=self.height())
        if self._is_home:
            self.fit()

    def mousePressEvent(self, event: QMouseEvent) -> None:
        """Begin a drag."""
        self._drag = Drag(event.position(), event.button())

    def mouseMoveEvent(self, event: QMouseEvent) -> None:
        """Turn or shift."""
        if self._drag is None:
            return
        step = self._drag.moved_to(event.position(), wants_band=False)
        if self._drag.kind in (DragKind.TURN, DragKind.SHIFT):
            self._move(dragged(self._canvas.viewpoint, self._drag.kind, step, self.height()))

    def mouseReleaseEvent(self, event: QMouseEvent) -> None:
        """End a drag."""
        self._drag = None

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Zoom at the pointer."""
        self._move(wheeled(self._canvas.viewpoint, event, self))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Turn, shift, zoom and fit with keys."""
        viewpoint, key = self._canvas.viewpoint, Qt.Key(event.key())
        if key in ARROWS:
            right, down = ARROWS[key]
            if event.modifiers() & Qt.KeyboardModifier.ShiftModifier:
                self._move(viewpoint.panned(KEY_SHIFT * right, KEY_SHIFT * down, self.height()))
            else:
                self._move(viewpoint.orbited(KEY_TURN * right, -KEY_TURN * down))
        elif key in ZOOMS:
            self._move(viewpoint.zoomed(ZOOMS[key]))
        elif key == Qt.Key.Key_F:
            self.fit()
        elif key == Qt.Key.Key_1:
            self.look_from_cameras()
        else:
            super().keyPressEvent(event)

    def _move(self, viewpoint: Viewpoint) -> None:
        self._canvas, self._is_home = replace(self._canvas, viewpoint=viewpoint), False
        self.update()

    def _lay_frustums(self, distance: float) -> None:
        if self._rig is not None:
            lines = [camera.lines(DEPTH * distance) for camera in cameras_of(self._rig)]
            self._frustums = self._shown(np.concatenate(lines).reshape(-1, 3)).reshape(-1, 2, 3)
            self.fit()

    def _paint_lines(self, painter: QPainter, lines: Floats) -> None:
        places, _ = self._canvas.project(lines)
        draw_lines(painter, places)

    def _paint_names_of_cameras(self, painter: QPainter, colours: Colours) -> None:
        painter.setPen(colours.ink)
        for lines, name in zip(np.split(self._frustums, max(len(self._names), 1)), self._names, strict=False):
            if len(lines):
                (place,), _ = self._canvas.project(lines[:1, 0])
                if not np.isnan(place).any():
                    painter.drawText(QRectF(place[0] - 60, place[1] + 4, 120, 20), Qt.AlignmentFlag.AlignHCenter, name)

    def _paint_points(self, painter: QPainter) -> None:
        """Points, the farthest first."""
        places, depths = self._canvas.project(self._shown(self._found.points))
        known = np.flatnonzero(~np.isnan(depths))
        order = known[np.argsort(-depths[known], kind="stable")]
        for place, group in zip(places[order].tolist(), self._found.groups[order].tolist(), strict=True):
            colour = doubt_colour(self.palette()) if group == NO_BODY else colour_of_limb(group, self.palette())
            self._sprites.draw(painter, place, _RADIUS if group != NO_BODY else _RADIUS / 2, Style.BALL, colour)

    def _paint_bodies(self, painter: QPainter, colours: Colours) -> None:
        """Axes and names of bodies."""
        names = []
        for body in self._found.bodies.values():
            pose = body.world_from_body
            ends = np.stack([np.repeat(pose[None, :3, 3], 3, axis=0), pose[:3, 3] + _AXIS * pose[:3, :3].T], axis=1)
            shown = self._shown(ends.reshape(-1, 3)).reshape(-1, 2, 3)
            for axis, colour in enumerate(colours.axes):
                painter.setPen(QPen(colour, 2.0))
                self._paint_lines(painter, shown[axis : axis + 1])
            (place,), _ = self._canvas.project(shown[:1, 0])
            if not np.isnan(place).any():
                names.append((body.name, QPointF(place[0] + 8, place[1] + 14), colours.ink))
        draw_names(painter, names)

    def _shown(self, points: Floats) -> Floats:
        return np.asarray(points @ self._shown_from_world.T)
