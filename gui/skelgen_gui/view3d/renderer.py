"""Puts a whole picture together, and keeps what stays the same while a take plays.

That is the backdrop: background, floor grid, and axes of the world.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QLinearGradient, QPainter, QPalette, QPen, QPixmap, QStaticText

from skelgen.model.arrays import Floats
from skelgen_gui.model.picture import Canvas, FrameView, Picture, place_names, take_picture
from skelgen_gui.model.scene import Scene, Snapshot
from skelgen_gui.model.selection import Marked, Selection
from skelgen_gui.model.view_camera import N_FADES, Floor
from skelgen_gui.view3d import painting
from skelgen_gui.view3d.colours import Colours, Inks, Sprites
from skelgen_gui.view3d.painting import Brushes, Figure
from skelgen_gui.widgets.painting import draw_lines

NO_FRUSTUMS = np.zeros((0, 2, 3))
"""No cameras: nothing of them is painted."""

_AXIS_SHARE = 0.05  # of the size of what is seen: half the length of axes
_OTHER_OPACITY = 0.5
_NOTE_GAP = 14.0  # px, from what a note is about
_NOTE_PAD = 7.0
_NAME_MARGIN = (QPointF(-1, 0), QPointF(1, 0), QPointF(0, -1), QPointF(0, 1))
_MOST_NAMES = 12  # of selected markers, beside them


class Renderer:
    """Paints scenes in the colours of a palette.

    Parameters
    ----------
    palette : QPalette
        Light or dark.
    ratio : float
        Pixels of the screen per pixel of the window.
    """

    def __init__(self, palette: QPalette, ratio: float) -> None:
        self.colours = Colours(palette)
        self._inks, self._other_inks = Inks(self.colours), Inks(Colours(palette, is_other=True))
        self.ratio = ratio
        self._sprites = Sprites(ratio)
        self._backdrop = QPixmap()
        self._backdrop_key: object = None
        self._backdrop_frustums = NO_FRUSTUMS
        self._names: dict[str, QStaticText] = {}

    def paint_backdrop(
        self, painter: QPainter, canvas: Canvas, floor: Floor | None, frustums: Floats, legend: str
    ) -> None:
        """Paint what lies behind everything, from a kept picture where nothing of it has changed.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        canvas : Canvas
            From where, and how large.
        floor : Floor or None
            The floor, if it is shown.
        frustums : ndarray, shape (n_lines, 2, 3), mm
            Lines of cameras.
        legend : str
            Scales, in the lower right corner.
        """
        key = (canvas, floor, legend)
        if key != self._backdrop_key or frustums is not self._backdrop_frustums:
            self._backdrop_key, self._backdrop_frustums = key, frustums
            self._backdrop = self._new_backdrop(canvas, floor, frustums, legend)
        painter.drawPixmap(0, 0, self._backdrop)

    def paint_scene(
        self, painter: QPainter, scene: Scene, view: FrameView, marked: Marked, floor: Floor | None
    ) -> tuple[Snapshot, Picture]:
        """Paint one frame of a project.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        scene : Scene
            The project.
        view : FrameView
            Which frame, from where, and what is shown.
        marked : Marked
            What stands out.
        floor : Floor or None
            Where shadows fall, if the floor is shown.

        Returns
        -------
        tuple of Snapshot and Picture
            What was painted, and where.
        """
        figure, canvas, shown = self._figure(scene, view, self._inks, marked.joints), view.canvas, view.shown
        if floor is not None:
            painting.paint_shadows(painter, figure.snapshot, floor, canvas, figure.brushes)
        if shown.trails and shown.markers:
            places, _ = canvas.project(scene.trail(view.frame, shown.trail_seconds))
            places[:, scene.is_hidden(frozenset(shown.hidden))[0]] = np.nan
            painting.paint_trails(painter, scene, places, self._inks)
            past, _ = canvas.project(scene.past_points(view.frame, shown.trail_seconds))
            painting.paint_past(painter, past, self._inks)
        _paint_figure(painter, figure, marked)
        selected = marked.selection.markers
        few = sorted(selected) if len(selected) <= _MOST_NAMES else []  # more names would cover the picture
        named = range(scene.n_markers) if shown.names else few
        self._paint_names(painter, scene.names, figure.picture, named)
        return figure.snapshot, figure.picture

    def paint_other(self, painter: QPainter, scene: Scene, view: FrameView) -> None:
        """Paint one frame of a second project: translucent, and in one hue.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        scene : Scene
            The second project.
        view : FrameView
            Which frame, from where, and what is shown.
        """
        painter.setOpacity(_OTHER_OPACITY)
        _paint_figure(painter, self._figure(scene, view, self._other_inks), Marked(Selection()))
        painter.setOpacity(1.0)

    def paint_note(self, painter: QPainter, text: str, x: float, y: float, canvas: Canvas) -> None:
        """Paint a text in a box beside a place [px], wherever there is room.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        text : str
            The note.
        x, y : float, px
            The place.
        canvas : Canvas
            Size of the picture.
        """
        metrics = painter.fontMetrics()
        size = metrics.boundingRect(0, 0, canvas.width, canvas.height, Qt.AlignmentFlag.AlignLeft, text)
        width, height = size.width() + 2 * _NOTE_PAD, size.height() + 2 * _NOTE_PAD
        left = x + _NOTE_GAP if x + _NOTE_GAP + width < canvas.width else x - _NOTE_GAP - width
        top = min(max(y - height / 2, 2.0), canvas.height - height - 2.0)
        box = QRectF(left, top, width, height)
        paper, edge = QColor(self.colours.above), QColor(self.colours.ink)
        paper.setAlpha(235)
        edge.setAlpha(70)
        painter.setPen(QPen(edge, 1.0))
        painter.setBrush(paper)
        painter.drawRoundedRect(box, 5.0, 5.0)
        painter.setPen(self.colours.ink)
        painter.drawText(box.adjusted(_NOTE_PAD, _NOTE_PAD, 0, 0), Qt.AlignmentFlag.AlignLeft, text)

    def paint_band(self, painter: QPainter, band: QRectF) -> None:
        """Paint the rectangle that selects.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        band : QRectF, px
            The rectangle.
        """
        inside = QColor(self.colours.highlight)
        inside.setAlpha(40)
        painter.setPen(QPen(self.colours.highlight, 1.0))
        painter.setBrush(inside)
        painter.drawRect(band)

    def _figure(self, scene: Scene, view: FrameView, inks: Inks, uncertain: Iterable[int] = ()) -> Figure:
        shown, canvas = view.shown, view.canvas
        snapshot = scene.without(scene.at(view.frame), frozenset(shown.hidden))
        magnification = shown.magnification or scene.magnification
        picture = take_picture(snapshot, canvas, shown, _AXIS_SHARE * scene.size, magnification, uncertain)
        radius = painting.marker_radius(canvas, scene.size)
        return Figure(scene, snapshot, picture, Brushes(inks, self._sprites, radius, canvas.viewpoint.distance))

    def _paint_names(self, painter: QPainter, names: tuple[str, ...], picture: Picture, markers: Iterable[int]) -> None:
        """Paint names beside markers, with a margin that parts them from what lies behind."""
        drawn = [marker for marker in markers if not math.isnan(picture.markers[marker, 0])]
        drawn.sort(key=lambda marker: float(picture.marker_depths[marker]))  # what is in front has its name first
        signs = [self._name(names[marker]) for marker in drawn]
        sizes = np.array([[sign.size().width(), sign.size().height()] for sign in signs]).reshape(-1, 2)
        places = place_names(picture.markers[drawn], sizes)
        texts = [
            (sign, QPointF(*place))
            for sign, place in zip(signs, places.tolist(), strict=True)
            if not math.isnan(place[0])
        ]
        painter.setPen(self.colours.ground)
        for text, place in texts:
            for shift in _NAME_MARGIN:
                painter.drawStaticText(place + shift, text)
        painter.setPen(self.colours.mixed(self.colours.ink, 0.2))
        for text, place in texts:
            painter.drawStaticText(place, text)

    def _name(self, name: str) -> QStaticText:
        if name not in self._names:
            self._names[name] = QStaticText(name)
            self._names[name].setTextFormat(Qt.TextFormat.PlainText)
        return self._names[name]

    def _new_backdrop(self, canvas: Canvas, floor: Floor | None, frustums: Floats, legend: str) -> QPixmap:
        pixmap = QPixmap(round(canvas.width * self.ratio), round(canvas.height * self.ratio))
        pixmap.setDevicePixelRatio(self.ratio)
        with QPainter(pixmap) as painter:
            painter.setRenderHint(QPainter.RenderHint.Antialiasing)
            paint_background(painter, canvas, self.colours)
            if floor is not None:
                paint_floor(painter, floor, canvas, self.colours)
            places, _ = canvas.project(frustums)
            painter.setPen(QPen(self.colours.mixed(self.colours.ink, 0.45), 1.2))
            draw_lines(painter, places)
            paint_triad(painter, canvas, self.colours)
            painter.setPen(self.colours.mixed(self.colours.ink, 0.4))
            corner = QRectF(0, 0, canvas.width - 12, canvas.height - 10)
            painter.drawText(corner, Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignBottom, legend)
        return pixmap


def _paint_figure(painter: QPainter, figure: Figure, marked: Marked) -> None:
    scene, picture, brushes = figure.scene, figure.picture, figure.brushes
    colours = brushes.inks.colours
    if scene.trajectories is None:
        painting.paint_points(painter, figure)
    else:
        painting.paint_left_out(painter, picture, brushes)
    painting.paint_axes(painter, picture, colours)
    faint = np.zeros(len(scene.bones.limb), dtype=np.bool_)
    if scene.project.has("skeleton"):  # faint are the bones of limbs whose pose is interpolated
        faint = ~scene.project.motion.limb_seen[figure.snapshot.frame][scene.bones.limb]
    painting.paint_items(painter, figure, faint, marked.limb(scene))
    painting.paint_ellipses(painter, picture, brushes)
    for places, depths, selected in (
        (picture.markers, picture.marker_depths, marked.markers(scene)),
        (picture.joints, picture.joint_depths, marked.joints),
        (picture.unlabelled, picture.unlabelled_depths, marked.points(figure.snapshot.frame)),
    ):
        chosen = [index for index in sorted(selected) if index < len(places)]
        painting.paint_rings(painter, places[chosen], depths[chosen], brushes, colours.highlight)


AXIS_NAMES = ("X", "Y", "Z")
_TRIAD = 30.0  # px
_CORNER = 46.0  # px, of the triad's origin from the lower left corner
_LINE_ALPHA = (70, 52, 32, 12)  # of the grid, from the middle to the edge


def paint_background(painter: QPainter, canvas: Canvas, colours: Colours) -> None:
    """Fill the picture.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    canvas : Canvas
        How large the picture is.
    colours : Colours
        Colours.
    """
    sky = QLinearGradient(0, 0, 0, canvas.height)
    sky.setColorAt(0, colours.above)
    sky.setColorAt(1, colours.below)
    painter.fillRect(0, 0, canvas.width, canvas.height, sky)


def paint_floor(painter: QPainter, floor: Floor, canvas: Canvas, colours: Colours) -> None:
    """Paint the grid, and the world's axes on it where they start within it.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    floor : Floor
        The floor.
    canvas : Canvas
        From where, and how large.
    colours : Colours
        Colours.
    """
    places, _ = canvas.project(floor.lines)
    for fade in range(N_FADES):
        ink = QColor(colours.ink)
        ink.setAlpha(_LINE_ALPHA[fade])
        painter.setPen(QPen(ink, 1.0, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
        draw_lines(painter, places[floor.fade == fade])
    _paint_origin(painter, floor, canvas, colours)


def paint_triad(painter: QPainter, canvas: Canvas, colours: Colours) -> None:
    """Paint the directions of the world's axes in the lower left corner, the farthest first.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    canvas : Canvas
        From where, and how large.
    colours : Colours
        Colours.
    """
    basis = canvas.viewpoint.basis
    origin = QPointF(_CORNER, canvas.height - _CORNER)
    for axis in np.argsort(basis[2]).tolist():
        direction = QPointF(basis[0, axis], -basis[1, axis])
        painter.setPen(QPen(colours.axes[axis], 2.2, Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap))
        painter.drawLine(origin, origin + direction * _TRIAD)
        middle = origin + direction * (_TRIAD + 10)
        painter.drawText(QRectF(middle.x() - 9, middle.y() - 9, 18, 18), Qt.AlignmentFlag.AlignCenter, AXIS_NAMES[axis])


def _paint_origin(painter: QPainter, floor: Floor, canvas: Canvas, colours: Colours) -> None:
    """Two cells of the world's level axes, from its origin."""
    corners = floor.lines.reshape(-1, 3)
    for axis in (axis for axis in range(3) if axis != floor.up):
        end = floor.origin.copy()
        end[axis] += 2 * floor.spacing
        ends: Floats = np.stack([floor.origin, end])
        if not ((ends >= corners.min(axis=0) - 1e-6) & (ends <= corners.max(axis=0) + 1e-6)).all():
            continue
        places, _ = canvas.project(ends[np.newaxis])
        ink = QColor(colours.axes[axis])
        ink.setAlpha(170)
        painter.setPen(QPen(ink, 2.0))
        draw_lines(painter, places)
