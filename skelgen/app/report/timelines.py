"""What pictures over time have in common: a row per marker, a pixel per stretch of frames, an axis in seconds."""

from collections.abc import Sequence

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.colours import ramp_rgba
from skelgen.app.drawing.lanes import State, find_lanes
from skelgen.app.drawing.scales import bin_edges, ticks
from skelgen.app.drawing.wording import clipped, percent, plain
from skelgen.app.report.matrix import png_uri
from skelgen.model import Labelling, Project, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Filled, PositionSource

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
    """Draw a name at the left and a value at the right of each row; nothing where rows are too low.

    Parameters
    ----------
    names, values : sequence of str, length n_rows
        What stands at the left and at the right.
    row : float, px
        Height of a row.
    """
    if row < _SMALLEST_LABELLED_ROW:
        return []
    labels = []
    for index, (name, value) in enumerate(zip(names, values, strict=True)):
        baseline = row * (index + 0.5) + 3.5
        labels.append(svg.text(LEFT - 6, baseline, clipped(name, _NAME_ROOM), "small", anchor="end"))
        labels.append(svg.text(WIDTH - RIGHT + 6, baseline, value, "small"))
    return labels


def time_axis(trajectories: Trajectories, height: float) -> Markup:
    """Draw the axis in seconds below rows of a total height [px].

    Parameters
    ----------
    trajectories : Trajectories
        Of what the rows show.
    height : float, px
        Of all rows.
    """
    last = max(trajectories.n_frames - 1, 1) / trajectories.rate
    parts = [svg.line(LEFT, height + 2, LEFT + PLOT, height + 2, "axis")]
    for value in ticks(0.0, last, 8):
        parts.append(svg.text(LEFT + PLOT * value / last, height + 16, plain(value), "small", anchor="middle"))
    parts.append(svg.text(LEFT + PLOT / 2, height + 32, "time [s]", "small", anchor="middle"))
    return svg.group(*parts)


def parted(pixels: NDArray[np.uint8], row: float) -> NDArray[np.uint8]:
    """Leave a thin blank line under each row of a picture, unless rows are too low, shape (n, n_bins, 4).

    Parameters
    ----------
    pixels : ndarray of uint8, shape (n_rows, n_bins, 4)
        A line of pixels for each row.
    row : float, px
        Height of a row.
    """
    if row < _SMALLEST_PARTED_ROW:
        return pixels
    lines = np.repeat(pixels, _LINES, axis=0)
    lines[_LINES - 1 :: _LINES] = 0
    return lines


_OPAQUE = 255
_MOST_WITH_GAP = 130  # of 255: a single missing frame already fades its whole stretch visibly
_LEAST_FILLED = 110  # alpha of 255: a single filled frame still tints its stretch visibly
_DOUBT_LINES = 3  # of a bar's height, one such part is the line of doubt
_STRIP, _STRIP_GAP = 9.0, 4.0  # px: the row of points that are left out

_SOURCE_COLOURS = {
    PositionSource.LIMB: (46, 139, 87),
    PositionSource.JOINT: (218, 149, 32),
    PositionSource.INTERPOLATED: (200, 60, 60),
    PositionSource.PATTERN: (120, 90, 190),
}
"""Red, green, blue of each source of filled positions; readable on light and on dark ground."""

_DOUBT_COLOUR = (190, 20, 160)
"""Of the line under a bar."""

_LEFT_OUT_COLOUR = (128, 128, 128)
"""Of points that are nobody's."""


def gaps_figure(project: Project, filled: Filled | None = None) -> Markup:
    """Draw the timeline of seen, filled, unseen and doubtful markers, in the order of the limbs.

    Parameters
    ----------
    project : Project
        With labelled markers.
    filled : Filled, optional
        How the gaps can be filled.
    """
    lanes = find_lanes(project)
    n_frames, row = lanes.n_frames, row_height(lanes.n_lanes)
    height = row * lanes.n_lanes
    edges = np.linspace(0, n_frames, min(n_frames, MOST_BINS) + 1).astype(np.intp)
    parts_of_states = lanes.shares(np.arange(lanes.n_lanes), edges.astype(np.float64))
    seen_part = svg.image(LEFT, 0, PLOT, height, png_uri(_brightness(parts_of_states)))
    box = {"x": LEFT, "y": 0, "width": PLOT, "height": height}
    mask = svg.tag("mask", seen_part, id="seen-mask", maskUnits="userSpaceOnUse", **box)
    classes = [f"fill limb{limb}" if limb >= 0 else "fill limbless" for limb in lanes.limbs.tolist()]
    bar = row - 2 if row > 4 else row
    bars = [svg.rect(LEFT, row * index + 1, PLOT, bar, cls) for index, cls in enumerate(classes)]
    parts = [mask, svg.group(*bars, mask="url(#seen-mask)")]
    if filled:
        parts.append(svg.image(LEFT, 0, PLOT, height, png_uri(parted(_tints(filled.source[:, lanes.markers]), row))))
    if project.has_labelling and project.labelling.doubts:
        # a line at the foot of each bar, in stretches with a doubtful frame
        there = parts_of_states[..., State.DOUBTFUL] > 0
        pixels = np.zeros((_DOUBT_LINES * len(there), there.shape[1], 4), dtype=np.uint8)
        pixels[_DOUBT_LINES - 1 :: _DOUBT_LINES][there] = (*_DOUBT_COLOUR, _OPAQUE)
        parts.append(svg.image(LEFT, 0, PLOT, height, png_uri(pixels)))
    names = [project.trajectories.names[marker] for marker in lanes.markers.tolist()]
    seen = project.trajectories.seen[:, lanes.markers].mean(axis=0)
    parts += row_labels(names, [percent(float(share)) for share in seen], row)
    if project.has_labelling and project.labelling.left_out.any():
        parts.append(_left_out_strip(project.labelling, height + _STRIP_GAP))
        height += _STRIP_GAP + _STRIP
    parts.append(time_axis(project.trajectories, height))
    return svg.drawing(WIDTH, height + BOTTOM, "When each marker is seen", *parts, least=LEAST_WIDTH)


def _brightness(parts_of_states: Floats) -> NDArray[np.uint8]:
    """Brightness of the mask, shape (n_lanes, n_bins): full where a marker is seen in all frames of a stretch."""
    missing = parts_of_states[..., State.FILLED] + parts_of_states[..., State.UNSEEN]
    grey = np.where(missing == 0.0, _OPAQUE, np.minimum((1.0 - missing) * _OPAQUE, _MOST_WITH_GAP))
    return np.ascontiguousarray(grey.astype(np.uint8))


def _tints(source: Ints) -> NDArray[np.uint8]:
    """Colours over the gaps, shape (n_markers, n_bins, 4): of each stretch the least certain source that it has."""
    starts, stops = bin_edges(len(source), MOST_BINS)
    pixels = np.zeros((len(starts), source.shape[1], 4), dtype=np.uint8)
    for kind, colour in _SOURCE_COLOURS.items():
        part = np.add.reduceat((source == kind).astype(np.float64), starts) / (stops - starts)[:, np.newaxis]
        there = part > 0
        pixels[there, :3] = colour
        pixels[there, 3] = np.maximum(part[there] * _OPAQUE, _LEAST_FILLED).astype(np.uint8)
    return np.ascontiguousarray(pixels.swapaxes(0, 1))


def _left_out_strip(labelling: Labelling, top: float) -> Markup:
    """A row that is the darker the more points of a stretch are left out."""
    starts, stops = bin_edges(len(labelling.left_out), MOST_BINS)
    counts = np.add.reduceat(labelling.left_out.astype(np.float64), starts) / (stops - starts)
    pixels = np.zeros((1, len(counts), 4), dtype=np.uint8)
    pixels[..., :3] = _LEFT_OUT_COLOUR
    alpha = _LEAST_FILLED + (_OPAQUE - _LEAST_FILLED) * counts / counts.max()
    pixels[0, :, 3] = np.where(counts > 0, alpha, 0).astype(np.uint8)
    baseline = top + _STRIP - 1
    return svg.group(
        svg.image(LEFT, top, PLOT, _STRIP, png_uri(pixels)),
        svg.text(LEFT - 6, baseline, "left out", "small", anchor="end"),
        svg.text(WIDTH - RIGHT + 6, baseline, str(int(labelling.left_out.sum())), "small"),
    )


def confidence_figure(project: Project) -> Markup:
    """Draw the least confidence of each marker in each stretch, and its mean at the right."""
    order = measures.subtree_markers(project)
    confidence = project.labelling.confidence[:, order]
    row = row_height(len(order))
    height = row * len(order)
    names = [project.trajectories.names[marker] for marker in order.tolist()]
    means = [percent(float(mean)) for mean in project.labelling.marker_confidence[order]]
    starts, _ = bin_edges(len(confidence), MOST_BINS)
    least = np.fmin.reduceat(confidence, starts, axis=0).T
    pixels = ramp_rgba(least)
    pixels[np.isnan(least)] = 0
    picture = svg.image(LEFT, 0, PLOT, height, png_uri(parted(np.ascontiguousarray(pixels), row)))
    axis = time_axis(project.trajectories, height)
    labels = row_labels(names, means, row)
    title = "Confidence of every marker over time"
    return svg.drawing(WIDTH, height + BOTTOM, title, picture, *labels, axis, least=LEAST_WIDTH)
