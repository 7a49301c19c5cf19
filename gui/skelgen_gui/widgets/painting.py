"""What is shared by all that paints: colours on light and dark desktops, and helpers.

There are a dark and a light palette, and colours that no palette has, of limbs, doubts and curves; lines and points
from arrays, pictures from pixels, the wheel, tool tips.
"""

import html
import math
from collections.abc import Callable, Sequence
from typing import cast

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QLineF, QObject, QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QGuiApplication, QHelpEvent, QImage, QPainter, QPalette, QPixmap, QWheelEvent
from PySide6.QtWidgets import QApplication, QToolTip, QWidget
from shiboken6 import Shiboken

from skelgen.app.drawing.scales import limb_colour
from skelgen.files import read_table
from skelgen.model.arrays import Floats
from skelgen_gui.widgets.preferences import Preferences

ZOOM = 1.25
"""By how much a notch of the wheel enlarges."""

_NOTCH = 120.0  # eighths of a degree that most wheels turn by


def notches(event: QWheelEvent) -> tuple[float, float]:
    """Return by how many notches a wheel was turned: sideways, and away from the user."""
    turned = event.angleDelta()
    return turned.x() / _NOTCH, turned.y() / _NOTCH


def paint_words(painter: QPainter, room: QRectF, words: str, palette: QPalette) -> None:
    """Write why there is nothing to see, and what to do.

    Parameters
    ----------
    painter : QPainter
        Whose pen is changed.
    room : QRectF
        In whose middle they stand.
    words : str
        Are wrapped where they are too long.
    palette : QPalette
        Of the widget.
    """
    painter.setPen(palette.color(QPalette.ColorRole.PlaceholderText))
    painter.drawText(room, Qt.AlignmentFlag.AlignCenter | Qt.TextFlag.TextWordWrap, words)


def draw_lines(painter: QPainter, ends: Floats) -> None:
    """Draw lines with the painter's pen.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    ends : ndarray, shape (n_lines, 2, 2), px
        Both ends of each line as x and y; lines with NaN are left out.
    """
    ends = np.ascontiguousarray(ends[~np.isnan(ends).any(axis=(1, 2))], dtype=np.float64)
    if len(ends):
        # A QLineF is four doubles. The wrapper owns nothing, and lives no longer than this call.
        first = cast(QLineF, Shiboken.wrapInstance(ends.ctypes.data, QLineF))
        painter.drawLines(first, len(ends))


def draw_points(painter: QPainter, points: Floats) -> None:
    """Draw points with the painter's pen: discs of its width, if its caps are round.

    Parameters
    ----------
    painter : QPainter
        An active painter.
    points : ndarray, shape (n_points, 2), px
        Places as x and y; points with NaN are left out.
    """
    points = np.ascontiguousarray(points[~np.isnan(points).any(axis=1)], dtype=np.float64)
    if len(points):
        first = cast(QPointF, Shiboken.wrapInstance(points.ctypes.data, QPointF))
        painter.drawPoints(first, len(points))


def image_of(pixels: NDArray[np.uint8]) -> QImage:
    """Return the picture of an array (height, width, 4) of red, green, blue and opacity; it holds a copy."""
    height, width, _ = pixels.shape
    pixels = np.ascontiguousarray(pixels)
    return QImage(pixels.data, width, height, 4 * width, QImage.Format.Format_RGBA8888).copy()


def pixmap_of(pixels: NDArray[np.uint8], ratio: float) -> QPixmap:
    """Return the same as a pixmap for a screen with `ratio` pixels per point.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (height, width, 4)
        Red, green, blue and opacity.
    ratio : float
        Pixels of the screen per pixel of the window.
    """
    pixmap = QPixmap.fromImage(image_of(pixels))
    pixmap.setDevicePixelRatio(ratio)
    return pixmap


def drawn_pixmap(side: float, ratio: float, draw: Callable[[QPainter], None]) -> QPixmap:
    """Return a small square picture on a transparent ground.

    Parameters
    ----------
    side : float, px
        Its width and height.
    ratio : float
        Pixels of the screen per pixel of the window.
    draw : callable (painter)
        Draws it, with smooth edges.
    """
    pixmap = QPixmap(math.ceil(side * ratio), math.ceil(side * ratio))
    pixmap.setDevicePixelRatio(ratio)
    pixmap.fill(Qt.GlobalColor.transparent)
    with QPainter(pixmap) as painter:
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        draw(painter)
    return pixmap


def show_tip(widget: QWidget, event: QEvent, tip_at: Callable[[QPointF], str]) -> bool:
    """Show a tool tip about the place under the pointer, if an event asks for one.

    Parameters
    ----------
    widget : QWidget
        Whose event it is.
    event : QEvent
        Any.
    tip_at : callable
        Gives lines of plain text for a place in the widget.

    Returns
    -------
    bool
        Whether the event asked for it.
    """
    if event.type() != QEvent.Type.ToolTip or not isinstance(event, QHelpEvent):
        return False
    QToolTip.showText(event.globalPos(), as_rich_text(tip_at(QPointF(event.pos()))), widget)
    return True


def as_rich_text(text: str) -> str:
    """Return plain text as rich text, which Qt wraps, and in which names of markers cannot be taken for tags."""
    return "<qt>" + "<br>".join(html.escape(line) for line in text.split("\n")) + "</qt>"


def draw_names(painter: QPainter, names: Sequence[tuple[str, QPointF, QColor]]) -> None:
    """Draw names where their text begins, those that would cover others below them.

    Parameters
    ----------
    painter : QPainter
        Where to draw.
    names : sequence of (text, place, colour)
        The place [px] is the left end of the text's base line.
    """
    metrics, taken = painter.fontMetrics(), list[QRectF]()
    for text, place, colour in sorted(names, key=lambda one: one[1].y()):
        box = QRectF(metrics.boundingRect(text)).translated(place)
        while hidden := [other for other in taken if other.intersects(box)]:
            box.moveTop(max(other.bottom() for other in hidden) + 1)
        taken.append(box)
        painter.setPen(colour)
        painter.drawText(box.topLeft() - QPointF(metrics.boundingRect(text).topLeft()), text)


PROBLEM_ROLE = QPalette.ColorRole.BrightText
"""Role of texts about errors; both palettes give it a colour that stands out and can be read."""

CHANGED_ROLE = QPalette.ColorRole.Link
"""Role of texts that differ from their default."""

_Role = QPalette.ColorRole
_COLOURS = read_table(__file__, "colours")
_MIDDLE = 128  # of lightness 0 .. 255
_LIMBLESS = "#868e96"


class Theme(QObject):
    """Keeps the application's palette as the preferences say: dark, light, or as the system has it.

    Parameters
    ----------
    app : QApplication
        Whose palette is kept.
    preferences : Preferences
        Whose theme is followed.
    """

    def __init__(self, app: QApplication, preferences: Preferences) -> None:
        super().__init__(app)
        self._app, self._preferences = app, preferences
        preferences.changed.connect(self.apply)
        app.styleHints().colorSchemeChanged.connect(self.apply)
        self.apply()

    def apply(self) -> None:
        """Give the application the palette that is wanted now."""
        wanted = self._preferences.values.theme
        dark = self._app.styleHints().colorScheme() == Qt.ColorScheme.Dark if wanted == "system" else wanted == "dark"
        if self._app.style().name() != "fusion":
            self._app.setStyle("Fusion")
        self._app.setPalette(theme_palette(dark=dark))


def prepare_high_dpi() -> None:
    """Let the window be scaled by fractions, e.g. 150 %, as the screen asks; call before the application is made."""
    QGuiApplication.setHighDpiScaleFactorRoundingPolicy(Qt.HighDpiScaleFactorRoundingPolicy.PassThrough)


def theme_palette(*, dark: bool) -> QPalette:
    """Return the palette of a dark or a light window."""
    colours = {QPalette.ColorRole[role]: pair[dark] for role, pair in _COLOURS["palette"].items()}
    palette = QPalette(QColor(colours[_Role.Button]), QColor(colours[_Role.Window]))  # derives the shades of bevels
    for role, colour in colours.items():
        palette.setColor(role, QColor(colour))
    for role in (_Role.WindowText, _Role.Text, _Role.ButtonText, _Role.BrightText, _Role.Link):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(_COLOURS["others"]["faded"][dark]))
    return palette


def is_dark(palette: QPalette) -> bool:
    """Return whether texts of this palette are on a dark ground, for colours that are not in it."""
    return palette.color(_Role.Window).lightness() < _MIDDLE


def colour_of_limb(limb: int, palette: QPalette) -> QColor:
    """Return the colour of a limb; grey for -1, no limb.

    Parameters
    ----------
    limb : int
        The limb.
    palette : QPalette
        Light or dark.
    """
    return QColor(limb_colour(limb, dark=is_dark(palette)) if limb >= 0 else _LIMBLESS)


def doubt_colour(palette: QPalette) -> QColor:
    """Return the colour of what is doubtful."""
    return QColor(_COLOURS["others"]["doubt"][is_dark(palette)])


def cursor_colour(palette: QPalette) -> QColor:
    """Return the colour of the line that stands for the frame that is shown."""
    return QColor(_COLOURS["others"]["cursor"][is_dark(palette)])


def component_colour(component: int, palette: QPalette) -> QColor:
    """Return the colour of the first, second or third of three components.

    Parameters
    ----------
    component : int
        From 0.
    palette : QPalette
        Light or dark.
    """
    return QColor(list(_COLOURS["components"].values())[component % 3][is_dark(palette)])


def blended(colour: QColor, ground: QColor, share: float) -> QColor:
    """Return a colour that lies between a ground (0) and a colour (1).

    Parameters
    ----------
    colour, ground : QColor
        The colours.
    share : float
        Part of the colour, 0 .. 1.
    """
    return QColor(*np.round(share * rgb_of(colour) + (1 - share) * rgb_of(ground)).astype(int).tolist())


def rgb_of(colour: QColor) -> NDArray[np.uint8]:
    """Return red, green and blue of a colour, shape (3,)."""
    return np.array([colour.red(), colour.green(), colour.blue()], dtype=np.uint8)
