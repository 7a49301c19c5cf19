"""Colours of the 3-D view on light and dark desktops."""

from __future__ import annotations

from PySide6.QtGui import QColor, QPalette

from skelgen_gui.widgets.theme import blended, colour_of_limb, component_colour, doubt_colour, is_dark

N_FOGS = 5
"""Steps in which what is deeper fades into the background."""

_HAZE = 0.55  # of the background in the colour of what is deepest
_ABOVE, _BELOW = 0.75, 0.05  # of the colour of pages in the background, the rest being that of the window
_OTHER = {False: "#c2187f", True: "#ff79c6"}  # on light, on dark
_SHADE = {False: 109, True: 150}  # percent by which shadows are darker


class Colours:
    """What is painted in which colour.

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
        self._halo = colours.ground

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
        return self.colours.highlight if is_selected else self._halo

    def _fogged(self, colour: QColor, fog: int) -> QColor:
        return self.colours.mixed(colour, _HAZE * min(fog, N_FOGS - 1) / (N_FOGS - 1))
