"""Curves over time, bars over markers, and errors of a rig over the distance from it, in one frame of axes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.measures import Length
from skelgen.app.drawing.scales import envelope
from skelgen.app.drawing.svg import LEFT, RIGHT, Axes
from skelgen.app.drawing.wording import clipped, digits
from skelgen.errors import WriteError
from skelgen.files import replacing
from skelgen.model import Motion, PointCloud
from skelgen.model.arrays import Floats

if TYPE_CHECKING:
    from skelgen.capture.errors_by_distance import ErrorCurve, RigErrors

_WIDTH, _HEIGHT = 900.0, 260.0
_BOTTOM = 36.0
_MOST_BINS = 760  # about one per pixel
_LEAST_WIDTH = 560.0
_HEADROOM = 1.05
_LEAST_BAR_WIDTH = 290.0  # px, for the title of the axis
_BAR_STEP, _WIDEST_BAR_STEP = 14.0, 40.0
_CHARACTER = 6.2  # px of a marker name below its bar, turned upright
_NAME_ROOM = 16


def residual_figure(motion: Motion) -> Markup:
    """Draw mean and largest residual of every frame over time; long takes as envelopes that lose no peak."""
    mean, largest = measures.residual_per_frame(motion)
    axes = _time_axes(largest, motion.rate)
    parts = [
        axes.frame("residual [mm]", "time [s]"),
        _curve(axes, largest, motion.rate, "curve-max"),
        _curve(axes, mean, motion.rate, "curve-mean"),
        _legend(axes, (("curve-max", "largest of all markers"), ("curve-mean", "mean of all markers"))),
    ]
    return svg.drawing(_WIDTH, _HEIGHT, "Residual over time", *parts, least=_LEAST_WIDTH)


def points_figure(cloud: PointCloud) -> Markup:
    """Draw the number of points in every frame of an unlabelled take."""
    counts = cloud.points_per_frame.astype(np.float64)
    axes = _time_axes(counts, cloud.rate)
    parts = [axes.frame("points in the frame", "time [s]"), _curve(axes, counts, cloud.rate, "curve-mean")]
    return svg.drawing(_WIDTH, _HEIGHT, "Points per frame over time", *parts, least=_LEAST_WIDTH)


def _time_axes(values: Floats, rate: float) -> Axes:
    highest = float(np.nanmax(values)) if np.isfinite(values).any() else 0.0
    return Axes(_WIDTH, _HEIGHT, _BOTTOM, max(len(values) - 1, 1) / rate, _HEADROOM * highest or 1.0)


def _curve(axes: Axes, values: Floats, rate: float, cls: str) -> Markup:
    """One path: up and down each stretch between its extremes, or simply through the frames where all fit."""
    centres, low, high = envelope(values, _MOST_BINS)
    across = np.array([axes.x(centre / rate) for centre in centres.tolist()])
    tops, floors = (np.array([axes.y(value) for value in ends.tolist()]) for ends in (high, low))
    if np.array_equal(low, high, equal_nan=True):
        return svg.tag("path", d=svg.path_through(across, tops), cls=f"{cls} curve")
    zigzag = np.stack([tops, floors], axis=1)
    zigzag[1::2] = zigzag[1::2, ::-1]  # neighbours meet at the same end, so that the line adds nothing between them
    return svg.tag("path", d=svg.path_through(np.repeat(across, 2), zigzag.ravel()), cls=f"{cls} curve")


def _legend(axes: Axes, entries: Sequence[tuple[str, str]]) -> Markup:
    parts = []
    for index, (cls, name) in enumerate(entries):
        x = axes.width - RIGHT - 330 + 170 * index
        parts += [svg.line(x, 8, x + 18, 8, f"{cls} curve thick"), svg.text(x + 24, 12, name, "small")]
    return svg.group(*parts)


def deviation_bars(rows: Sequence[measures.MarkerDeviation]) -> Markup:
    """Draw the mean deviation of every marker as a bar in its limb's colour, the root mean square as a tick."""
    step = min(max(_BAR_STEP, (_WIDTH - LEFT - RIGHT) / len(rows)), _WIDEST_BAR_STEP)
    width = LEFT + RIGHT + step * len(rows)
    highest = max((row.rms for row in rows if not np.isnan(row.rms)), default=0.0)
    labels = 14 + _CHARACTER * min(max(len(row.name) for row in rows), _NAME_ROOM)
    axes = Axes(max(width, _LEAST_BAR_WIDTH), _HEIGHT + labels, labels, 1.0, _HEADROOM * highest or 1.0)
    bars = [_bar(axes, row, LEFT + step * index, step) for index, row in enumerate(rows)]
    parts = [axes.frame("deviation [mm]: bar = mean, tick = root mean square"), *bars]
    return svg.drawing(axes.width, axes.height, "Deviation of every marker", *parts, least=0.8 * axes.width)


def _bar(axes: Axes, row: measures.MarkerDeviation, x: float, step: float) -> Markup:
    floor = axes.height - axes.bottom
    middle = x + step / 2
    name = svg.text(middle + 3.5, floor + 7, clipped(row.name, _NAME_ROOM), "small", anchor="end", turn=-90)
    if np.isnan(row.mean):
        return svg.group(name)
    hint = f"{row.name}: mean {digits(row.mean)}, rms {digits(row.rms)}, max {digits(row.largest)} mm"
    left, right, tick = x + 0.15 * step, x + 0.85 * step, axes.y(row.rms)
    return svg.group(
        svg.tag("title", hint),
        svg.rect(left, axes.y(row.mean), right - left, floor - axes.y(row.mean), "fill"),
        svg.line(left, tick, right, tick, "rms"),
        name,
        cls=f"limb{row.limb}",
    )


_ANGLES_HEIGHT, _ANGLES_BOTTOM = 220.0, 36.0
_ANGLES_MOST_BINS = 300  # three curves and their bands of that many stretches are some 40 kB
_SURE = 1.96  # standard deviations: 95 % of a normal distribution
_LEAST_HEIGHT = 1.0  # deg


def angle_figure(times: Floats, angles: Floats, stds: Floats, names: tuple[str, ...]) -> Markup:
    """Draw the angles of one joint.

    Parameters
    ----------
    times : ndarray, shape (n_frames,), s
        Rising.
    angles, stds : ndarray, shape (n_frames, n_angles), deg
        Angles and their standard deviations.
    names : tuple of str
        Of the angles.
    """
    low, high = float((angles - _SURE * stds).min()), float((angles + _SURE * stds).max())
    margin = max(0.04 * (high - low), _LEAST_HEIGHT / 2)
    last = max(float(times[-1]), np.finfo(np.float64).eps)
    axes = Axes(_WIDTH, _ANGLES_HEIGHT, _ANGLES_BOTTOM, last, high + margin, low - margin)
    parts = [axes.frame("angle [deg]", "time [s]")]
    for number, (angle, std) in enumerate(zip(angles.T, stds.T, strict=True)):
        parts.append(_band(axes, times, angle, std, f"angle{number}"))
    for number, name in enumerate(names):
        x = axes.width - 10 - 215 * (len(names) - number)
        parts += [svg.line(x, 8, x + 18, 8, f"angle{number} curve thick"), svg.text(x + 24, 12, name, "small")]
    return svg.drawing(_WIDTH, _ANGLES_HEIGHT, "Joint angles over time", *parts, least=_LEAST_WIDTH)


def _band(axes: Axes, times: Floats, angle: Floats, std: Floats, cls: str) -> Markup:
    """The curve in the middle of each stretch, within the band that holds all of its intervals."""
    centres, low, high = envelope(angle - _SURE * std, _ANGLES_MOST_BINS, angle + _SURE * std)
    at = times[np.round(centres).astype(np.intp)]
    middle = angle[np.round(centres).astype(np.intp)]
    across = np.array([axes.x(value) for value in at.tolist()])
    tops, floors, line = (np.array([axes.y(value) for value in ends.tolist()]) for ends in (high, low, middle))
    outline = svg.path_through(np.concatenate([across, across[::-1]]), np.concatenate([tops, floors[::-1]]))
    return svg.group(
        svg.tag("path", d=outline, cls=f"{cls} band"),
        svg.tag("path", d=svg.path_through(across, line), cls=f"{cls} curve"),
    )


_SPREAD_WIDTH, _SPREAD_HEIGHT = 220.0, 20.0
_PERCENTILES = (5, 25, 50, 75, 95)
_MARGIN = 6.0


def common_reach(lengths: Sequence[Length]) -> float:
    """Return the deviation [mm] that all rows share as the end of their axis."""
    tails = [np.abs(np.percentile(each.deviations, _PERCENTILES)).max() for each in lengths if len(each.deviations)]
    return float(max(tails, default=0.0)) or 1.0


def spread_figure(length: Length, reach: float) -> Markup:
    """Draw one row: whiskers hold 90 % of the frames, the box 50 %, the line in it is the median.

    Parameters
    ----------
    length : Length
        The length with its deviations.
    reach : float, mm
        Deviation at both ends of the axis.
    """
    middle, half = _SPREAD_WIDTH / 2, _SPREAD_HEIGHT / 2
    zero = svg.line(middle, 1, middle, _SPREAD_HEIGHT - 1, "zero")
    if not len(length.deviations):
        return svg.drawing(_SPREAD_WIDTH, _SPREAD_HEIGHT, "no frame in which both joints are known", zero)
    quantiles = np.percentile(length.deviations, _PERCENTILES)
    low, first, median, third, high = (middle + (middle - _MARGIN) * quantiles / reach).tolist()
    parts = svg.group(
        svg.line(low, half, high, half, "whisker"),
        svg.rect(first, half - 5, max(third - first, 1.0), 10, "fill"),
        svg.line(median, half - 6, median, half + 6, "median"),
        cls=f"limb{length.limb}",
    )
    return svg.drawing(_SPREAD_WIDTH, _SPREAD_HEIGHT, "scatter of the raw distance", zero, parts)


_PANEL_WIDTH, _PANEL_HEIGHT, _PANEL_TITLE = 480.0, 300.0, 26.0  # px; of a panel, and the line of its name
_PANELS_IN_A_ROW = 2
_COLOURS = ("#1f5fa8", "#c8501e", "#2e8b57", "#444444", "#8a4fa0")
_PANEL_STYLE = (
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
        place = f"translate({column * _PANEL_WIDTH:g} {_PANEL_TITLE + row * (_PANEL_TITLE + _PANEL_HEIGHT):g})"
        panels.append(svg.group(_panel(errors.distances / 1000.0, curve), transform=place))
    style = svg.tag("style", Markup(_PANEL_STYLE))
    page = svg.drawing(
        _PANELS_IN_A_ROW * _PANEL_WIDTH, rows * (_PANEL_TITLE + _PANEL_HEIGHT), "Errors of a rig", style, *panels
    )
    with replacing(path) as temporary:
        temporary.write_text(str(page), encoding="utf-8")


def _panel(metres: Floats, curve: ErrorCurve) -> Markup:
    """One thing's standard deviations against the distance [m], a curve for each component."""
    largest = float(np.nanmax(curve.std)) if np.isfinite(curve.std).any() else 0.0
    axes = Axes(_PANEL_WIDTH, _PANEL_HEIGHT, _BOTTOM, float(metres.max()), _HEADROOM * largest or 1.0)
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
