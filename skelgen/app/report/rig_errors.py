"""The errors of a rig as a picture of its own, one panel for each thing (Gaschler 2011, figures 6.1 to 6.4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import svg
from skelgen.app.drawing.axes import Axes
from skelgen.capture.errors_by_distance import Curve, RigErrors
from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model.arrays import Floats

_WIDTH, _HEIGHT, _BOTTOM, _TITLE = 480.0, 300.0, 36.0, 26.0  # px; of a panel, and the line of its name
_HEADROOM = 1.05
_PANELS_IN_A_ROW = 2
_COLOURS = ("#1f5fa8", "#c8501e", "#2e8b57", "#444444", "#8a4fa0")
_STYLE = (
    "text{font:12px sans-serif;fill:#222}.small{font-size:11px}.title{font-weight:bold}"
    ".grid{stroke:#ddd}.axis{stroke:#444}.curve{fill:none;stroke-width:1.8}"
)


def write_rig_errors(errors: RigErrors, path: Path) -> None:
    """Draw all curves into an SVG file.

    Parameters
    ----------
    errors : RigErrors
        What is drawn.
    path : Path
        Its suffix must be ``.svg``.

    Raises
    ------
    WriteError
        If the file cannot be written, or its suffix is another one.
    """
    if path.suffix.lower() != ".svg":
        raise WriteError(f"{path} cannot be written: the picture is drawn as SVG; give it a name that ends in .svg")
    rows = -(-len(errors.curves) // _PANELS_IN_A_ROW)
    panels = []
    for number, curve in enumerate(errors.curves):
        row, column = divmod(number, _PANELS_IN_A_ROW)
        place = f"translate({column * _WIDTH:g} {_TITLE + row * (_TITLE + _HEIGHT):g})"
        panels.append(svg.group(_panel(errors.distances / 1000.0, curve), transform=place))
    style = svg.tag("style", Markup(_STYLE))
    page = svg.drawing(_PANELS_IN_A_ROW * _WIDTH, rows * (_TITLE + _HEIGHT), "Errors of a rig", style, *panels)
    with replacing(path) as temporary:
        temporary.write_text(str(page), encoding="utf-8")


def _panel(metres: Floats, curve: Curve) -> Markup:
    """One thing's standard deviations against the distance [m], a curve for each component."""
    largest = float(np.nanmax(curve.std)) if np.isfinite(curve.std).any() else 0.0
    axes = Axes(_WIDTH, _HEIGHT, _BOTTOM, float(metres.max()), _HEADROOM * largest or 1.0)
    parts = [svg.text(4, -8, curve.what, "title"), axes.frame(f"standard deviation [{curve.unit}]", "distance [m]")]
    across = np.array([axes.x(value) for value in metres.tolist()])
    for number, (name, std) in enumerate(zip(curve.columns, curve.std.T, strict=True)):
        colour, left, down = _COLOURS[number % len(_COLOURS)], axes.x(0.0) + 10, 38.0 + 15 * number
        places = np.array([axes.y(value) for value in std.tolist()])
        parts += [
            svg.tag("path", d=svg.path_through(across, places), cls="curve", stroke=colour),
            svg.line(left, down - 4, left + 20, down - 4, "curve", stroke=colour),
            svg.text(left + 26, down, name, "small"),
        ]
    return svg.group(*parts)
