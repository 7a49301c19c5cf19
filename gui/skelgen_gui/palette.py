"""Colours that a palette does not have: of limbs, of what is doubtful, of curves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtGui import QColor, QPalette

from skelgen.app.report.colours import limb_colour
from skelgen_gui.theme import is_dark

_DOUBT = {False: "#d9480f", True: "#ff922b"}
_CURSOR = {False: "#e03131", True: "#ff6b6b"}
_LIMBLESS = {False: "#868e96", True: "#868e96"}
_COMPONENTS = {False: ("#c92a2a", "#2b8a3e", "#1864ab"), True: ("#ff8787", "#69db7c", "#74c0fc")}


def colour_of_limb(limb: int, palette: QPalette) -> QColor:
    """Return the colour of a limb; grey for -1, no limb."""
    dark = is_dark(palette)
    return QColor(limb_colour(limb, dark=dark) if limb >= 0 else _LIMBLESS[dark])


def doubt_colour(palette: QPalette) -> QColor:
    """Return the colour of what is doubtful."""
    return QColor(_DOUBT[is_dark(palette)])


def cursor_colour(palette: QPalette) -> QColor:
    """Return the colour of the line that stands for the frame that is shown."""
    return QColor(_CURSOR[is_dark(palette)])


def component_colour(component: int, palette: QPalette) -> QColor:
    """Return the colour of the first, second or third of three components."""
    return QColor(_COMPONENTS[is_dark(palette)][component % 3])


def blended(colour: QColor, ground: QColor, share: float) -> QColor:
    """Return a colour that lies between a ground (0) and a colour (1)."""
    return QColor(*np.round(share * rgb_of(colour) + (1 - share) * rgb_of(ground)).astype(int).tolist())


def rgb_of(colour: QColor) -> NDArray[np.uint8]:
    """Return red, green and blue of a colour, shape (3,)."""
    return np.array([colour.red(), colour.green(), colour.blue()], dtype=np.uint8)
