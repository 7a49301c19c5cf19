"""Drawings of the page: series of points over two linear axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from markupsafe import Markup

from skelgen.app.report import svg
from skelgen.app.report.figure_curves import Axes

_WIDTH, _HEIGHT, _BOTTOM = 620.0, 300.0, 36.0
_LEGEND_WIDTH, _LEGEND_TOP, _LEGEND_STEP = 200.0, 30.0, 18.0  # px: beside the axes, so that it hides no point
_HEADROOM = 1.08
_RADIUS = 4.0


@dataclass(frozen=True)
class Series:
    """Points of one kind.

    Attributes
    ----------
    name : str
        For the legend.
    x, y : sequence of float
        The points.
    is_line : bool
        Whether a line joins them.
    has_points : bool
        Whether they are drawn one by one.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]
    is_line: bool = True
    has_points: bool = True


def draw(title: str, x_title: str, y_title: str, series: Sequence[Series]) -> Markup:
    """Draw series over axes that begin at zero, each in its colour, with a legend.

    Parameters
    ----------
    title : str
        For those who do not see the drawing.
    x_title, y_title : str
        With units.
    series : sequence of Series
        At most six; empty ones are left out.
    """
    shown = [one for one in series if len(one.x)]
    last_x = max((max(one.x) for one in shown), default=1.0) * _HEADROOM
    last_y = max((max(one.y) for one in shown), default=1.0) * _HEADROOM
    axes = Axes(_WIDTH, _HEIGHT, _BOTTOM, last_x or 1.0, last_y or 1.0)
    drawn = [_drawn(axes, one, f"series{index}") for index, one in enumerate(shown)]
    legend = [_legend(axes, one, f"series{index}", index) for index, one in enumerate(shown)]
    return svg.drawing(_WIDTH + _LEGEND_WIDTH, _HEIGHT, title, axes.frame(y_title, x_title), *drawn, *legend)


def _drawn(axes: Axes, one: Series, cls: str) -> Markup:
    across, down = [axes.x(value) for value in one.x], [axes.y(value) for value in one.y]
    parts = []
    if one.is_line:
        parts.append(svg.tag("path", d=svg.path_through(np.array(across), np.array(down)), cls=f"{cls} curve"))
    if one.has_points:
        hints = [f"{one.name}: {x:.4g}, {y:.4g}" for x, y in zip(one.x, one.y, strict=True)]
        parts += [
            svg.circle(x, y, _RADIUS, f"{cls} point", hint) for x, y, hint in zip(across, down, hints, strict=True)
        ]
    return svg.group(*parts)


def _legend(axes: Axes, one: Series, cls: str, index: int) -> Markup:
    x, y = axes.width + _RADIUS, _LEGEND_TOP + _LEGEND_STEP * index
    sign = svg.line(x, y, x + 18, y, f"{cls} curve") if one.is_line else svg.circle(x + 9, y, _RADIUS, f"{cls} point")
    return svg.group(sign, svg.text(x + 24, y + 4, one.name, "small"))
