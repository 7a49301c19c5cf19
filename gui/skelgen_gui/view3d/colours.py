"""Colours of the 3-D view on light and dark desktops, and balls and rings in them, painted once and then copied."""

import math
from collections.abc import Sequence
from enum import Enum

from PySide6.QtCore import QPointF, Qt
from PySide6.QtGui import QColor, QPainter, QPalette, QPen, QPixmap, QRadialGradient

from skelgen_gui.widgets.painting import blended, colour_of_limb, component_colour, doubt_colour, drawn_pixmap, is_dark

N_FOGS = 5
"""Steps in which what is deeper fades into the background."""

_HAZE = 0.55  # of the background in the colour of what is deepest
_ABOVE, _BELOW = 0.75, 0.05  # of the colour of pages in the background, the rest being that of the window
_OTHER = {False: "#c2187f", True: "#ff79c6"}  # on light, on dark
_SHADE = {False: 109, True: 150}  # percent by which shadows are darker

_RADIUS_STEP = 0.5  # sprites are made for radii in steps of so many pixels

MOST_SPRITES = 2000
"""Sprites kept: 20 colours in 5 depths, 4 styles and 5 radii."""


class Colours:
    """The colour of each thing that is painted.

    Attributes
    ----------
    above, below, ground : QColor
        The background at the top, at the bottom, and between.
    ink : QColor
        Texts, and joints.
    highlight : QColor
        What is selected.
    doubt : QColor
        What is doubtful.
    shade : QColor
        Shadows: opaque, so that crossing ones do not add up.
    axes : tuple of QColor
        x, y and z.
    only : QColor or None
        One colour for everything, of an overlaid project.

    Parameters
    ----------
    palette : QPalette
        Light or dark.
    is_other : bool
        Whether they are for an overlaid project.
    """

    def __init__(self, palette: QPalette, *, is_other: bool = False) -> None:
        self._palette = palette
        dark = is_dark(palette)
        window, page = palette.color(QPalette.ColorRole.Window), palette.color(QPalette.ColorRole.Base)
        self.above, self.below = blended(page, window, _ABOVE), blended(page, window, _BELOW)
        self.ground = blended(self.above, self.below, 0.5)
        self.ink = palette.color(QPalette.ColorRole.WindowText)
        self.highlight = palette.color(QPalette.ColorRole.Highlight)
        self.doubt = doubt_colour(palette)
        self.shade = self.below.darker(_SHADE[dark])
        self.axes = tuple(component_colour(axis, palette) for axis in range(3))
        self.only = QColor(_OTHER[dark]) if is_other else None

    def limb(self, limb: int) -> QColor:
        """Colour of a limb, -1 = none."""
        return self.only or colour_of_limb(limb, self._palette)

    def mixed(self, colour: QColor, haze: float) -> QColor:
        """Mix a colour with the background: 0 leaves it, 1 is the background.

        Parameters
        ----------
        colour : QColor
            The colour.
        haze : float
            0 leaves it, 1 is the background.
        """
        return blended(colour, self.ground, 1 - haze)


class Inks:
    """Colours of limbs, joints and bones by depth, mixed once.

    Parameters
    ----------
    colours : Colours
        What to mix.
    """

    def __init__(self, colours: Colours) -> None:
        self.colours = colours
        self._limbs: dict[tuple[int, int], QColor] = {}
        ink = colours.only or colours.ink
        self._edges = [self._fogged(ink, fog) for fog in range(N_FOGS)]
        self._inside = colours.mixed(ink, 0.95)

    def limb(self, limb: int, fog: int) -> QColor:
        """Colour of a limb, -1 = none, as it looks at a depth, 0 = front .. `N_FOGS` - 1.

        Parameters
        ----------
        limb : int
            The limb, -1 = none.
        fog : int
            Depth, 0 = front .. `N_FOGS` - 1.
        """
        colour = self._limbs.get((limb, fog))
        if colour is None:
            colour = self._limbs[limb, fog] = self._fogged(self.colours.limb(limb), fog)
        return colour

    def joint(self, fog: int) -> tuple[QColor, QColor]:
        """Colours of a joint's edge and inside at a depth."""
        return self._edges[fog], self._inside

    def halo(self, is_selected: bool) -> QColor:
        """Colour around a bone."""
        return self.colours.highlight if is_selected else self.colours.ground

    def _fogged(self, colour: QColor, fog: int) -> QColor:
        return self.colours.mixed(colour, _HAZE * min(fog, N_FOGS - 1) / (N_FOGS - 1))


class Style(Enum):
    """The look of a ball."""

    BALL = "ball"
    DOUBTFUL = "doubtful"
    HOLLOW = "hollow"
    JOINT = "joint"
    OPEN_JOINT = "open joint"
    """Its place is not determined."""
    RING = "ring"
    """Around what is selected."""


class Sprites:
    """Sprites for one resolution of the screen.

    Parameters
    ----------
    ratio : float
        Pixels of the screen per pixel of the window.
    """

    def __init__(self, ratio: float) -> None:
        self.ratio = ratio
        self._kept: dict[tuple[Style, int, int, int], QPixmap] = {}

    def draw(self, painter: QPainter, place: Sequence[float], radius: float, style: Style, *colours: QColor) -> None:
        """Draw a sprite around a place.

        Parameters
        ----------
        painter : QPainter
            An active painter.
        place : sequence of float, px
            Its middle, x and y.
        radius : float, px
            Its size.
        style : Style
            What it looks like.
        *colours : QColor
            Of the ball or ring, and of what marks it (the ring of a doubtful one, the edge of a joint or ring).
        """
        step = max(round(radius / _RADIUS_STEP), 2)
        key = (style, step, colours[0].rgba(), colours[-1].rgba())
        pixmap = self._kept.get(key)
        if pixmap is None:
            if len(self._kept) >= MOST_SPRITES:
                self._kept.clear()
            size = step * _RADIUS_STEP
            side = 2 * math.ceil(1.5 * size + 5.0)
            looks = (QPointF(side / 2, side / 2), size, colours[0], colours[-1])
            pixmap = drawn_pixmap(side, self.ratio, lambda painter: _PAINTERS[style](painter, *looks))
            self._kept[key] = pixmap
        half = pixmap.width() / self.ratio / 2
        painter.drawPixmap(QPointF(place[0] - half, place[1] - half), pixmap)


def _ball(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    """A ball that is lit from the upper left."""
    light = QRadialGradient(middle, radius, middle - QPointF(0.38, 0.42) * radius)
    light.setColorAt(0.0, colour.lighter(145))
    light.setColorAt(0.45, colour)
    light.setColorAt(1.0, colour.darker(128))
    painter.setPen(QPen(colour.darker(165), 0.8))
    painter.setBrush(light)
    painter.drawEllipse(middle, radius, radius)


def _doubtful(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    _ball(painter, middle, 0.72 * radius, colour, colour)
    painter.setBrush(Qt.BrushStyle.NoBrush)
    painter.setPen(QPen(mark, 1.8))
    painter.drawEllipse(middle, radius + 1.8, radius + 1.8)


def _hollow(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    inside = QColor(colour)
    inside.setAlpha(45)
    painter.setBrush(inside)
    painter.setPen(QPen(colour, 1.5))
    painter.drawEllipse(middle, radius - 0.5, radius - 0.5)


def _joint(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    painter.setBrush(colour)
    painter.setPen(QPen(mark, max(0.36 * radius, 1.2)))
    painter.drawEllipse(middle, 0.85 * radius, 0.85 * radius)


def _open_joint(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    """A dashed circle that is larger than a joint: it is somewhere about here."""
    inside = QColor(mark)
    inside.setAlpha(30)
    painter.setBrush(inside)
    painter.setPen(QPen(mark, 1.6, Qt.PenStyle.DashLine))
    painter.drawEllipse(middle, 1.5 * radius, 1.5 * radius)


def _ring(painter: QPainter, middle: QPointF, radius: float, colour: QColor, mark: QColor) -> None:
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for ink, width in ((mark, 4.4), (colour, 2.2)):
        painter.setPen(QPen(ink, width))
        painter.drawEllipse(middle, radius + 3.0, radius + 3.0)


_PAINTERS = dict(zip(Style, (_ball, _doubtful, _hollow, _joint, _open_joint, _ring), strict=True))
