"""Angles of a joint over time, each within the band of its 95 % interval."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from skelgen.app.report import measures, svg
from skelgen.app.report.figure_curves import Axes
from skelgen.model.arrays import Floats

_WIDTH, _HEIGHT, _BOTTOM = 900.0, 220.0, 36.0
_LEAST_WIDTH = 560.0
_MOST_BINS = 300  # three curves and their bands of that many stretches are some 40 kB
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
    axes = Axes(_WIDTH, _HEIGHT, _BOTTOM, max(float(times[-1]), np.finfo(np.float64).eps), high + margin, low - margin)
    parts = [axes.frame("angle [deg]", "time [s]")]
    for number, (angle, std) in enumerate(zip(angles.T, stds.T, strict=True)):
        parts.append(_band(axes, times, angle, std, f"angle{number}"))
    for number, name in enumerate(names):
        x = axes.width - 10 - 215 * (len(names) - number)
        parts += [svg.line(x, 8, x + 18, 8, f"angle{number} curve thick"), svg.text(x + 24, 12, name, "small")]
    return svg.drawing(_WIDTH, _HEIGHT, "Joint angles over time", *parts, least=_LEAST_WIDTH)


def _band(axes: Axes, times: Floats, angle: Floats, std: Floats, cls: str) -> Markup:
    """The curve in the middle of each stretch, within the band that holds all of its intervals."""
    centres, low, _ = measures.envelope(angle - _SURE * std, _MOST_BINS)
    _, _, high = measures.envelope(angle + _SURE * std, _MOST_BINS)
    at = times[np.round(centres).astype(np.intp)]
    middle = angle[np.round(centres).astype(np.intp)]
    across = np.array([axes.x(value) for value in at.tolist()])
    tops, floors, line = (np.array([axes.y(value) for value in ends.tolist()]) for ends in (high, low, middle))
    outline = svg.path_through(np.concatenate([across, across[::-1]]), np.concatenate([tops, floors[::-1]]))
    return svg.group(
        svg.tag("path", d=outline, cls=f"{cls} band"),
        svg.tag("path", d=svg.path_through(across, line), cls=f"{cls} curve"),
    )
