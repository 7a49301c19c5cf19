"""Colours of the 3-D view on light and dark desktops."""

from __future__ import annotations

from dataclasses import dataclass, replace

from PySide6.QtGui import QColor, QPalette

from skelgen.app.report.colours import limb_colour

N_FOGS = 5
"""Steps in which what is deeper fades into the background."""

_HAZE = 0.55  # of the background in the colour of what is deepest
_DARK_BELOW = 128  # lightness of a window's background, 0 .. 255


@dataclass(frozen=True)
class Colours:
    """What is painted in which colour.

    Attributes
    ----------
    is_dark : bool
        Whether the desktop is dark.
    above, below : QColor
        The background at the top and at the bottom.
    ink : QColor
        Texts, and what has no limb.
    highlight : QColor
        What is selected.
    doubt : QColor
        What is doubtful.
    only : QColor or None
        One colour for all limbs, of an overlaid project.
    """

    is_dark: bool
    above: QColor
    below: QColor
    ink: QColor
    highlight: QColor
    doubt: QColor
    only: QColor | None = None

    def limb(self, limb: int) -> QColor:
        """Colour of a limb, -1 = none."""
        if self.only is not None:
            return self.only
        return QColor(limb_colour(limb, dark=self.is_dark)) if limb >= 0 else self.mixed(self.ink, 0.45)

    @property
    def shade(self) -> QColor:
        """Colour of shadows: opaque, so that crossing ones do not add up."""
        return self.below.darker(150) if self.is_dark else self.below.darker(109)

    def mixed(self, colour: QColor, haze: float) -> QColor:
        """Mix a colour with the background: 0 leaves it, 1 is the background."""
        return blend(colour, blend(self.above, self.below, 0.5), haze)

    @property
    def axes(self) -> tuple[QColor, QColor, QColor]:
        """Colours of x, y and z."""
        names = ("#ff6b6b", "#6cc26c", "#6fa8ff") if self.is_dark else ("#d03a3a", "#2f8f3a", "#2f63c8")
        return QColor(names[0]), QColor(names[1]), QColor(names[2])

    @property
    def other(self) -> Colours:
        """The colours of an overlaid project: one hue."""
        return replace(self, only=QColor("#ff79c6" if self.is_dark else "#c2187f"))


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
        self._halo = colours.mixed(colours.ink, 1.0)

    def limb(self, limb: int, fog: int) -> QColor:
        """Colour of a limb, -1 = none, as it looks at a depth, 0 = front .. `N_FOGS` - 1."""
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


def colours_of(palette: QPalette) -> Colours:
    """Return the colours that go with a palette."""
    window, base = palette.color(QPalette.ColorRole.Window), palette.color(QPalette.ColorRole.Base)
    is_dark = window.lightness() < _DARK_BELOW
    return Colours(
        is_dark,
        above=blend(base, window, 0.25),
        below=blend(base, window, 0.95).darker(100 if is_dark else 104),
        ink=palette.color(QPalette.ColorRole.WindowText),
        highlight=palette.color(QPalette.ColorRole.Highlight),
        doubt=QColor("#ffb020" if is_dark else "#e07b00"),
    )


def blend(first: QColor, second: QColor, part: float) -> QColor:
    """Mix two colours: 0 is the first, 1 the second."""
    return QColor.fromRgbF(
        first.redF() + (second.redF() - first.redF()) * part,
        first.greenF() + (second.greenF() - first.greenF()) * part,
        first.blueF() + (second.blueF() - first.blueF()) * part,
    )
