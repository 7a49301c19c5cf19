"""Small pictures in the rows of the table of lengths: how the raw joint distance scatters about the rigid length."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup

from skelgen.app.report import svg
from skelgen.app.report.measures import Length

_WIDTH, _HEIGHT = 220.0, 20.0
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
    middle, half = _WIDTH / 2, _HEIGHT / 2
    zero = svg.line(middle, 1, middle, _HEIGHT - 1, "zero")
    if not len(length.deviations):
        return svg.drawing(_WIDTH, _HEIGHT, "no frame in which both joints are known", zero)
    quantiles = np.percentile(length.deviations, _PERCENTILES)
    low, first, median, third, high = (middle + (middle - _MARGIN) * quantiles / reach).tolist()
    parts = svg.group(
        svg.line(low, half, high, half, "whisker"),
        svg.rect(first, half - 5, max(third - first, 1.0), 10, "fill"),
        svg.line(median, half - 6, median, half + 6, "median"),
        cls=f"limb{length.limb}",
    )
    return svg.drawing(_WIDTH, _HEIGHT, "scatter of the raw distance", zero, parts)
