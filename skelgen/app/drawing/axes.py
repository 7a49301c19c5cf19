"""Axes of a plot as SVG: grid, ticks and titles, and where values lie."""

from __future__ import annotations

from dataclasses import dataclass

from markupsafe import Markup

from skelgen.app.drawing import svg
from skelgen.app.drawing.scales import ticks
from skelgen.app.drawing.wording import plain

LEFT, RIGHT, TOP = 52.0, 10.0, 22.0
"""px; left of the plot area for tick labels, right of it, and above it for the title of the y axis."""


@dataclass(frozen=True)
class Axes:
    """A plot area with linear axes.

    Attributes
    ----------
    width, height, bottom : float, px
        The whole drawing, and the space below the plot area.
    last_x, last_y : float
        Largest values on the axes.
    first_y : float
        Value at the foot of the y axis.
    """

    width: float
    height: float
    bottom: float
    last_x: float
    last_y: float
    first_y: float = 0.0

    def x(self, value: float) -> float:
        """Return the place [px] of a value on the x axis."""
        return LEFT + (self.width - LEFT - RIGHT) * value / self.last_x

    def y(self, value: float) -> float:
        """Return the place [px] of a value on the y axis."""
        share = (value - self.first_y) / (self.last_y - self.first_y)
        return self.height - self.bottom - (self.height - self.bottom - TOP) * share

    def frame(self, y_title: str, x_title: str = "") -> Markup:
        """Draw grid, tick labels and titles; without a title the x axis has no ticks."""
        right, floor = self.width - RIGHT, self.height - self.bottom
        parts = [svg.text(4, 12, y_title, "small")]
        for value in ticks(self.first_y, self.last_y, 4):
            parts += [
                svg.line(LEFT, self.y(value), right, self.y(value), "grid"),
                svg.text(LEFT - 6, self.y(value) + 3.5, plain(value), "small", anchor="end"),
            ]
        if x_title:
            parts += [
                svg.text(self.x(value), floor + 15, plain(value), "small", anchor="middle")
                for value in ticks(0.0, self.last_x, 8)
            ]
            parts.append(svg.text((LEFT + right) / 2, floor + 31, x_title, "small", anchor="middle"))
        parts.append(svg.line(LEFT, floor, right, floor, "axis"))
        return svg.group(*parts)
