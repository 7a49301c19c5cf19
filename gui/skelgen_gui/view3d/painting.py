"""Paints a frame back to front, on a background with floor grid and the axes of the world."""

import math
from dataclasses import dataclass

import numpy as np
from PySide6.QtCore import QLineF, QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPen, QPolygonF

from skelgen.model.arrays import Bools, Floats
from skelgen_gui.model.picture import N_AGES, Canvas, Picture, trail_lines
from skelgen_gui.model.scene import Scene, Snapshot
from skelgen_gui.model.view_camera import Floor
from skelgen_gui.view3d.colours import N_FOGS, Colours, Inks, Sprites, Style
from skelgen_gui.widgets.painting import draw_lines, draw_points

_MARKER_RADIUS = 5.0  # pixels, of a marker as deep as the target, where what is seen in a frame takes `_TYPICAL_SIZE`

_TYPICAL_SIZE = 480.0  # pixels; on smaller and larger pictures markers are smaller and larger

_SIZES = (0.55, 1.5)  # bounds of that growth
_NEARER = (0.7, 1.4)  # bounds of the growth with nearness
_JOINT = 1.0  # of a marker's radius
_BONE = 0.95  # of a marker's radius: radius of a bone
_PAST, _PAST_ALPHA = 1.8, 90  # px, 0 .. 255: dots where points without names were
_LEFT_OUT = 1.2  # of a marker's radius: diameter of points that went to no marker
_FULL_FOG = 0.4  # of the size of what is seen: a figure that is flatter does not fade in full
_SPOKE = 0.4  # of a bone's width: lines to markers
_HALO, _MARKED_HALO = 3.0, 6.0  # px, of the halo around bones
_WAIST, _THICKNESS, _THICKEST = 0.16, 0.09, 1.5  # of bones: where, parts of the length, of a marker's radius at most
_WIDE = 60.0  # of a marker's radius: ellipsoids that are larger are not filled, so as not to veil the rest
_STYLES = (Style.BALL, Style.DOUBTFUL, Style.HOLLOW)  # by `State`
_ROUND = Qt.PenJoinStyle.RoundJoin
_SOLID, _CAP, _FLAT = Qt.PenStyle.SolidLine, Qt.PenCapStyle.RoundCap, Qt.PenCapStyle.FlatCap


@dataclass(frozen=True, eq=False)
class Brushes:
    """The tools of painting: all that it needs besides the picture.

    Attributes
    ----------
    inks : Inks
        Colours.
    sprites : Sprites
        Balls and rings.
    radius : float, px
        Of a marker as deep as the target.
    distance : float, mm
        Depth of the target.
    """

    inks: Inks
    sprites: Sprites
    radius: float
    distance: float

    def radius_at(self, depth: float) -> float:
        """Radius [px] of a marker at a depth [mm]."""
        return self.radius * min(max(self.distance / depth, _NEARER[0]), _NEARER[1])


@dataclass(frozen=True, eq=False)
class Figure:
    """A frame of a project, ready to be painted.

    Attributes
    ----------
    scene : Scene
        The project.
    snapshot : Snapshot
        The frame.
    picture : Picture
        Where everything lies in the picture.
    brushes : Brushes
        Colours and sizes.
    """

    scene: Scene
    snapshot: Snapshot
    picture: Picture
    brushes: Brushes


def marker_radius(canvas: Canvas, size: float) -> float:
    """Return the radius [px] of markers.

    Parameters
    ----------
    canvas : Canvas
        From where, and how large.
    size : float, mm
        Extent of what is seen.
    """
    growth = canvas.viewpoint.scale(canvas.height) * size / _TYPICAL_SIZE
    return _MARKER_RADIUS * min(max(growth, _SIZES[0]), _SIZES[1])


def paint_shadows(painter: QPainter, snapshot: Snapshot, floor: Floor, canvas: Canvas, brushes: Brushes) -> None:
    """Paint shadows straight below bones and markers: they show where these are in the room.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    snapshot : Snapshot
        The frame.
    floor : Floor
        Where shadows fall.
    canvas : Canvas
        From where, and how large.
    brushes : Brushes
        Colours and sizes.
    """
    shade = brushes.inks.colours.shade
    bones, _ = canvas.project(floor.below(snapshot.bones))
    painter.setPen(QPen(shade, 0.7 * brushes.radius, _SOLID, _CAP))
    draw_lines(painter, bones)
    points, _ = canvas.project(floor.below(np.concatenate([snapshot.markers, snapshot.unlabelled])))
    painter.setPen(QPen(shade, brushes.radius, _SOLID, _CAP))
    draw_points(painter, points)


def paint_trails(painter: QPainter, scene: Scene, places: Floats, inks: Inks) -> None:
    """Paint the paths of markers until this frame, faint where old.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    scene : Scene
        For the limbs of markers.
    places : ndarray, shape (n_steps, n_markers, 2), px
        Where they were.
    inks : Inks
        Colours.
    """
    for limb, age, lines in trail_lines(places, scene.limb_of_marker):
        ink = QColor(inks.limb(limb, 0))
        ink.setAlphaF(0.08 + 0.42 * ((age + 1) / N_AGES) ** 2)
        painter.setPen(QPen(ink, 1.0 + 0.5 * age / N_AGES, _SOLID, _FLAT))
        draw_lines(painter, lines)


def paint_past(painter: QPainter, places: Floats, inks: Inks) -> None:
    """Paint where points without names were [px], shape (n, 2), as small dots.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    places : ndarray, shape (n, 2), px
        Where points were.
    inks : Inks
        Colours.
    """
    ink = QColor(inks.limb(-1, 0))
    ink.setAlpha(_PAST_ALPHA)
    painter.setPen(QPen(ink, _PAST, _SOLID, _CAP))
    draw_points(painter, places)


def paint_left_out(painter: QPainter, picture: Picture, brushes: Brushes) -> None:
    """Paint the points of an unlabelled take small: markers cover their own, so that those left out can be seen.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    picture : Picture
        What is drawn.
    brushes : Brushes
        Colours and sizes.
    """
    painter.setPen(QPen(brushes.inks.limb(-1, 0), _LEFT_OUT * brushes.radius, _SOLID, _CAP))
    draw_points(painter, picture.unlabelled)


def paint_points(painter: QPainter, figure: Figure) -> None:
    """Paint the points of a take that has no markers yet, from the farthest to the nearest.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    figure : Figure
        What is painted.
    """
    scene, picture, brushes = figure.scene, figure.picture, figure.brushes
    known = np.flatnonzero(~np.isnan(picture.unlabelled[:, 0]))
    order = known[np.argsort(-picture.unlabelled_depths[known], kind="stable")]
    depths, places = picture.unlabelled_depths[order], picture.unlabelled[order].tolist()
    for place, depth, fog in zip(places, depths.tolist(), _fogs(depths, scene.size), strict=True):
        brushes.sprites.draw(painter, place, brushes.radius_at(depth), Style.BALL, brushes.inks.limb(-1, fog))


def paint_axes(painter: QPainter, picture: Picture, colours: Colours) -> None:
    """Paint axes of joints dashed, and those of bodies in the colours of x, y and z.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    picture : Picture
        What is drawn.
    colours : Colours
        Colours.
    """
    painter.setPen(QPen(colours.mixed(colours.ink, 0.4), 1.2, Qt.PenStyle.DashLine, _FLAT))
    draw_lines(painter, picture.axes)
    for axis, colour in enumerate(colours.axes):
        painter.setPen(QPen(colour, 2.0, _SOLID, _CAP))
        draw_lines(painter, picture.bodies[:, axis])


def paint_ellipses(painter: QPainter, picture: Picture, brushes: Brushes) -> None:
    """Paint the uncertainty of joints: translucent ellipsoids with their main sections, where they exceed a joint.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    picture : Picture
        What is drawn.
    brushes : Brushes
        Colours and sizes.
    """
    colours = brushes.inks.colours
    edge, line, inside = (QColor(colours.only or colours.ink) for _ in range(3))
    edge.setAlpha(120)
    line.setAlpha(60)
    inside.setAlpha(22)
    spans = np.ptp(picture.ellipses[:, 0], axis=1).max(axis=1)
    known = picture.ellipses[spans > 2 * brushes.radius]
    painter.setPen(QPen(edge, 1.0))
    for outline, span in zip(known[:, 0].tolist(), spans[spans > 2 * brushes.radius].tolist(), strict=True):
        painter.setBrush(inside if span < _WIDE * brushes.radius else Qt.BrushStyle.NoBrush)
        painter.drawPolygon(QPolygonF([QPointF(x, y) for x, y in outline]))
    sections = known[:, 1:].reshape(-1, *known.shape[2:])
    painter.setPen(QPen(line, 0.8, _SOLID, _FLAT))
    draw_lines(painter, np.stack([sections, np.roll(sections, -1, axis=1)], axis=2).reshape(-1, 2, 2))


def paint_items(painter: QPainter, figure: Figure, faint: Bools, limb: int) -> None:
    """Paint bones, markers and joints from the farthest to the nearest.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    figure : Figure
        What is painted.
    faint : ndarray of bool, shape (n_bones,)
        Bones whose place is interpolated.
    limb : int
        The limb that is selected, or -1.
    """
    scene, picture, brushes = figure.scene, figure.picture, figure.brushes
    n_markers, n_joints = len(picture.markers), len(picture.joints)
    depths = np.concatenate([picture.marker_depths, picture.joint_depths, picture.bone_depths])
    known = ~np.isnan(
        np.concatenate([picture.markers[:, 0], picture.joints[:, 0], picture.bones[:, :, 0].mean(axis=1)])
    )
    order = np.flatnonzero(known)[np.argsort(-depths[known], kind="stable")]
    markers, joints, bones = picture.markers.tolist(), picture.joints.tolist(), picture.bones.tolist()
    state = figure.snapshot.state.tolist()
    limb_of_marker, limb_of_bone = scene.limb_of_marker.tolist(), scene.bones.limb.tolist()
    for item, depth, fog in zip(order.tolist(), depths[order].tolist(), _fogs(depths[order], scene.size), strict=True):
        radius = brushes.radius_at(depth)
        if item < n_markers:
            colour = brushes.inks.limb(limb_of_marker[item], fog)
            brushes.sprites.draw(
                painter, markers[item], radius, _STYLES[state[item]], colour, brushes.inks.colours.doubt
            )
        elif item < n_markers + n_joints:
            edge, inside = brushes.inks.joint(fog)
            is_open = item - n_markers in scene.open_joints
            edge, style = (brushes.inks.colours.doubt, Style.OPEN_JOINT) if is_open else (edge, Style.JOINT)
            brushes.sprites.draw(painter, joints[item - n_markers], _JOINT * radius, style, inside, edge)
        else:
            bone = item - n_markers - n_joints
            colour = brushes.inks.limb(limb_of_bone[bone], fog + (2 if faint[bone] else 0))
            paint = _paint_spoke if scene.bones.is_spoke[bone] else _paint_bone
            is_marked = limb_of_bone[bone] == limb
            halo = QPen(brushes.inks.halo(is_marked), _MARKED_HALO if is_marked else _HALO, _SOLID, _CAP, _ROUND)
            paint(painter, bones[bone], _BONE * radius, colour, halo)


def paint_rings(painter: QPainter, places: Floats, depths: Floats, brushes: Brushes, colour: QColor) -> None:
    """Paint rings around markers or joints [px] that are selected or under the pointer.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    places : ndarray, shape (n, 2), px
        Middles of the rings; NaN where something is hidden.
    depths : ndarray, shape (n,), mm
        Distances along the line of sight.
    brushes : Brushes
        Colours and sizes.
    colour : QColor
        Colour of the rings.
    """
    for (x, y), depth in zip(places.tolist(), depths.tolist(), strict=True):
        if not math.isnan(x):  # else it is hidden
            brushes.sprites.draw(
                painter, (x, y), brushes.radius_at(depth), Style.RING, colour, brushes.inks.colours.ground
            )


def _paint_spoke(painter: QPainter, ends: list[list[float]], radius: float, colour: QColor, halo: QPen) -> None:
    """A thin line to a marker."""
    line, width = QLineF(*ends[0], *ends[1]), _SPOKE * radius
    for ink, thickness in ((halo.color(), width + halo.widthF()), (colour, width)):
        painter.setPen(QPen(ink, thickness, _SOLID, _CAP))
        painter.drawLine(line)


def _paint_bone(painter: QPainter, ends: list[list[float]], radius: float, colour: QColor, halo: QPen) -> None:
    """An octahedron, thickest near its first end, lit from one side; its halo cuts what lies behind."""
    start, end = QPointF(*ends[0]), QPointF(*ends[1])
    along = end - start
    length = math.hypot(along.x(), along.y())
    half = min(_THICKNESS * length, _THICKEST * radius)
    across = QPointF(-along.y(), along.x()) * (half / max(length, 1e-9))
    if across.x() + across.y() > 0:  # the light comes from the upper left
        across = -across
    waist = start + along * _WAIST
    painter.setPen(halo)
    painter.setBrush(colour)
    painter.drawPolygon(QPolygonF([start, waist + across, end, waist - across]))
    painter.setPen(QPen(colour.darker(125), 0.8, _SOLID, _CAP, _ROUND))
    for side, ink in ((across, colour.lighter(118)), (-across, colour.darker(112))):
        painter.setBrush(ink)
        painter.drawPolygon(QPolygonF([start, waist + side, end]))


def _fogs(depths: Floats, size: float) -> list[int]:
    """Fog of each item by its depth, 0 .. `N_FOGS` - 1; less if the items are flatter than a part of a size [mm]."""
    if not len(depths):
        return []
    span = max(float(np.ptp(depths)), _FULL_FOG * size, 1e-9)
    return [round(fog) for fog in ((N_FOGS - 1) * (depths - depths.min()) / span).tolist()]
