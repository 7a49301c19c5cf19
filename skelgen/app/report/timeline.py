"""What pictures over time have in common: a row per marker, a pixel per stretch of frames, an axis in seconds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.report import measures, svg
from skelgen.app.report.wording import clipped, plain
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats

WIDTH, LEFT, RIGHT, BOTTOM = 900.0, 112.0, 52.0, 36.0
"""Of the whole drawing [px]; names stand at the left, shares at the right, the axis below."""

PLOT = WIDTH - LEFT - RIGHT
LEAST_WIDTH = 560.0
MOST_BINS = 736
"""Stretches over time: one per pixel."""

_ROW = 11.0
_SMALLEST_ROW = 2.5  # with very many markers; below `_SMALLEST_LABELLED_ROW` without names
_SMALLEST_LABELLED_ROW = 9.0
_SMALLEST_PARTED_ROW = 5.0
_LINES = 6  # of a row, the last of which is blank
_LARGEST_HEIGHT = 800.0
_NAME_ROOM = 16


def row_height(n_rows: int) -> float:
    """Height [px] of one of some rows, so that the picture stays on a page."""
    return min(_ROW, max(_SMALLEST_ROW, _LARGEST_HEIGHT / max(n_rows, 1)))


def row_labels(names: Sequence[str], values: Sequence[str], row: float) -> list[Markup]:
    """Draw a name at the left and a value at the right of each row; nothing where rows are too low."""
    if row < _SMALLEST_LABELLED_ROW:
        return []
    labels = []
    for index, (name, value) in enumerate(zip(names, values, strict=True)):
        baseline = row * (index + 0.5) + 3.5
        labels.append(svg.text(LEFT - 6, baseline, clipped(name, _NAME_ROOM), "small", anchor="end"))
        labels.append(svg.text(WIDTH - RIGHT + 6, baseline, value, "small"))
    return labels


def time_axis(trajectories: Trajectories, height: float) -> Markup:
    """Draw the axis in seconds below rows of a total height [px]."""
    last = max(trajectories.n_frames - 1, 1) / trajectories.rate
    parts = [svg.line(LEFT, height + 2, LEFT + PLOT, height + 2, "axis")]
    for value in svg.ticks(0.0, last, 8):
        parts.append(svg.text(LEFT + PLOT * value / last, height + 16, plain(value), "small", anchor="middle"))
    parts.append(svg.text(LEFT + PLOT / 2, height + 32, "time [s]", "small", anchor="middle"))
    return svg.group(*parts)


def parted(pixels: NDArray[np.uint8], row: float) -> NDArray[np.uint8]:
    """Leave a thin blank line under each row of a picture, unless rows are too low, shape (n, n_bins, 4)."""
    if row < _SMALLEST_PARTED_ROW:
        return pixels
    lines = np.repeat(pixels, _LINES, axis=0)
    lines[_LINES - 1 :: _LINES] = 0
    return lines


def shares(flags: Bools) -> Floats:
    """Part of the frames of each stretch in which a flag is up, shape (n_bins, n_rows)."""
    starts, stops = measures.bin_edges(len(flags), MOST_BINS)
    counts = np.add.reduceat(flags.astype(np.float64), starts, axis=0)
    return np.asarray(counts / (stops - starts)[:, np.newaxis])
