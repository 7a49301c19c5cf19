"""The errors of a rig as a picture of its own, one panel for each thing (Gaschler 2011, figures 6.1 to 6.4)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import svg
from skelgen.app.drawing.scales import ticks
from skelgen.app.drawing.wording import plain
from skelgen.capture.errors_by_distance import Curve, RigErrors
from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model.arrays import Floats

_WIDTH, _HEIGHT = 480.0, 320.0  # px; of a panel
_LEFT, _RIGHT, _TOP, _BOTTOM = 56.0, 12.0, 28.0, 44.0
_PANELS_IN_A_ROW = 2
_COLOURS = ("#1f5fa8", "#c8501e", "#2e8b57", "#444444", "#8a4fa0")
_STYLE = """
text{font:12px sans-serif;fill:#222}.title{font-weight:bold}.grid{stroke:#ddd}.curve{fill:none;stroke-width:1.8}
"""


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
        raise WriteError(f"{path}: the picture cannot be written: it is SVG, so that its name must end in .svg")
    rows = -(-len(errors.curves) // _PANELS_IN_A_ROW)
    panels = [
        svg.group(
            _panel(errors.distances / 1000.0, curve),
            transform=f"translate({number % _PANELS_IN_A_ROW * _WIDTH:g} {number // _PANELS_IN_A_ROW * _HEIGHT:g})",
        )
        for number, curve in enumerate(errors.curves)
    ]
    style = svg.tag("style", Markup(_STYLE))
    page = svg.drawing(_PANELS_IN_A_ROW * _WIDTH, rows * _HEIGHT, "Errors of a rig", style, *panels)
    with replacing(path) as temporary:
        temporary.write_text(str(page), encoding="utf-8")


def _panel(metres: Floats, curve: Curve) -> Markup:
    """One thing's standard deviations against the distance [m], a curve for each component."""
    largest = float(np.nanmax(curve.std)) if np.isfinite(curve.std).any() else 1.0
    x = _LEFT + (_WIDTH - _LEFT - _RIGHT) * metres / metres.max()
    y = _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * curve.std / (1.05 * largest)
    parts = [svg.text(_LEFT, 16.0, curve.what, "title")]
    for value in ticks(0.0, largest, 5):
        level = _HEIGHT - _BOTTOM - (_HEIGHT - _TOP - _BOTTOM) * value / (1.05 * largest)
        parts += [
            svg.line(_LEFT, level, _WIDTH - _RIGHT, level, "grid"),
            svg.text(_LEFT - 6.0, level + 4.0, plain(value), anchor="end"),
        ]
    for value in ticks(0.0, float(metres.max()), 6):
        across = _LEFT + (_WIDTH - _LEFT - _RIGHT) * value / metres.max()
        parts += [
            svg.line(across, _TOP, across, _HEIGHT - _BOTTOM, "grid"),
            svg.text(across, _HEIGHT - _BOTTOM + 16.0, plain(value), anchor="middle"),
        ]
    parts += [
        svg.text((_LEFT + _WIDTH) / 2, _HEIGHT - 8.0, "distance [m]", anchor="middle"),
        svg.text(14.0, _HEIGHT / 2, f"standard deviation [{curve.unit}]", anchor="middle", turn=-90.0),
    ]
    for number, name in enumerate(curve.columns):
        colour, down = _COLOURS[number % len(_COLOURS)], _TOP + 14.0 + 15.0 * number
        parts += [
            svg.tag("path", d=svg.path_through(x, y[:, number]), cls="curve", stroke=colour),
            svg.line(_LEFT + 10.0, down - 4.0, _LEFT + 30.0, down - 4.0, "curve", stroke=colour),
            svg.text(_LEFT + 36.0, down, name),
        ]
    return Markup("").join(parts)
