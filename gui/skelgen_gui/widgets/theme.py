"""Colours: the dark and the light palette, and colours that no palette has, of limbs, doubts and curves."""

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QObject, Qt
from PySide6.QtGui import QColor, QGuiApplication, QPalette
from PySide6.QtWidgets import QApplication

from skelgen.app.drawing.colours import limb_colour
from skelgen_gui.widgets.preferences import Preferences

PROBLEM_ROLE = QPalette.ColorRole.BrightText
"""Role of texts about errors; both palettes give it a colour that stands out and can be read."""

CHANGED_ROLE = QPalette.ColorRole.Link
"""Role of texts that differ from their default."""

_Role = QPalette.ColorRole
# On light and on dark desktops
_PALETTE = {
    _Role.Window: ("#f3f4f6", "#202327"),
    _Role.WindowText: ("#1c2024", "#e6e8eb"),
    _Role.Base: ("#ffffff", "#353b43"),
    _Role.AlternateBase: ("#eceef1", "#3d444d"),
    _Role.Text: ("#1c2024", "#e6e8eb"),
    _Role.Button: ("#e6e8ec", "#3d434c"),
    _Role.ButtonText: ("#1c2024", "#e6e8eb"),
    _Role.ToolTipBase: ("#fffbe6", "#474e58"),
    _Role.ToolTipText: ("#1c2024", "#f2f3f5"),
    _Role.PlaceholderText: ("#6b7280", "#b3bac4"),
    _Role.Highlight: ("#1f6fc4", "#2f7fd6"),
    _Role.HighlightedText: ("#ffffff", "#ffffff"),
    _Role.Accent: ("#1f6fc4", "#2f7fd6"),
    _Role.Link: ("#155a9f", "#7db7f5"),
    _Role.LinkVisited: ("#6b4fa0", "#b9a3e3"),
    _Role.BrightText: ("#b3261e", "#ff8f85"),
}
_FADED = {False: "#8b929c", True: "#8d949e"}  # texts of what is switched off
_MIDDLE = 128  # of lightness 0 .. 255

_DOUBT = {False: "#d9480f", True: "#ff922b"}
_CURSOR = {False: "#e03131", True: "#ff6b6b"}
_LIMBLESS = "#868e96"
# Told apart by people who lack any one of the three cones
_COMPONENTS = {False: ("#d55e00", "#00876a", "#3b3fb5"), True: ("#ff9d5c", "#4fd6ad", "#8ea2ff")}


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
    colours = {role: pair[dark] for role, pair in _PALETTE.items()}
    palette = QPalette(QColor(colours[_Role.Button]), QColor(colours[_Role.Window]))  # derives the shades of bevels
    for role, colour in colours.items():
        palette.setColor(role, QColor(colour))
    for role in (_Role.WindowText, _Role.Text, _Role.ButtonText, _Role.BrightText, _Role.Link):
        palette.setColor(QPalette.ColorGroup.Disabled, role, QColor(_FADED[dark]))
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
    return QColor(_DOUBT[is_dark(palette)])


def cursor_colour(palette: QPalette) -> QColor:
    """Return the colour of the line that stands for the frame that is shown."""
    return QColor(_CURSOR[is_dark(palette)])


def component_colour(component: int, palette: QPalette) -> QColor:
    """Return the colour of the first, second or third of three components.

    Parameters
    ----------
    component : int
        From 0.
    palette : QPalette
        Light or dark.
    """
    return QColor(_COMPONENTS[is_dark(palette)][component % 3])


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
