"""Small embedded pictures: matrices, and what happens to markers over time.

A matrix is of distance deviations of markers, or of joint costs of limbs. A picture over time has a row per marker, a
pixel per stretch of frames, and an axis in seconds.
"""

import base64
import struct
import zlib
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.lanes import State, find_lanes
from skelgen.app.drawing.measures import DeviationMatrix, find_deviation_matrix
from skelgen.app.drawing.scales import LogScale, bin_edges, ramp_rgba, ticks
from skelgen.app.drawing.wording import clipped, digits, percent, plain
from skelgen.model import Labelling, Project, Trajectories
from skelgen.model.arrays import Floats, Ints
from skelgen.model.filled import Filled, PositionSource
from skelgen.progress import counted

_WIDTH = 640.0  # of the matrix of markers, without its labels
_LARGEST_CELL, _SMALLEST_LABELLED_CELL = 26.0, 8.5
_LABEL_WIDTH, _LIMB_STRIP, _SPACE = 108.0, 12.0, 4.0
_SCALE_WIDTH, _SCALE_HEIGHT, _SCALE_STEPS = 220.0, 10.0, 64
_COST_CELL = 26.0
_MOST_COST_WIDTH = 420.0
_LEAST_SCALE = 0.75


def deviation_figure(project: Project) -> Markup:
    """Draw the matrix of distance deviations, ordered by limb, with the limbs' boundaries and colours."""
    matrix = find_deviation_matrix(project)
    cell = min(_WIDTH / matrix.n, _LARGEST_CELL)
    side = cell * matrix.n
    left, top = _LABEL_WIDTH + _LIMB_STRIP + _SPACE, _LIMB_STRIP + 18
    parts = [
        svg.image(left, top, side, side, png_uri(matrix.pixels)),
        *_limb_marks(matrix, cell, left, top),
        *_marker_labels(matrix.names, cell, left, top),
        _scale(matrix.scale, "mm", left, top + side + 14),
    ]
    width, height = left + max(side, _SCALE_WIDTH + 40) + 4, top + side + 48
    label = f"Distance deviation of {counted(matrix.n, 'marker')}, ordered by limb"
    return svg.drawing(width, height, label, *parts, least=_LEAST_SCALE * width)


def _limb_marks(matrix: DeviationMatrix, cell: float, left: float, top: float) -> list[Markup]:
    """Strips in the limbs' colours at the left and above, and a frame about each limb's block."""
    marks = []
    for start, stop in pairwise(matrix.borders):
        limb, offset, size = int(matrix.limbs[start]), start * cell, (stop - start) * cell
        marks.append(
            svg.group(
                svg.rect(left - _LIMB_STRIP - _SPACE, top + offset + 0.5, _LIMB_STRIP, size - 1, "fill"),
                svg.rect(left + offset + 0.5, top - _LIMB_STRIP - _SPACE, size - 1, _LIMB_STRIP, "fill"),
                svg.rect(left + offset, top + offset, size, size, "block"),
                svg.text(
                    left + offset + size / 2,
                    top - _LIMB_STRIP - 8,
                    str(limb) if limb >= 0 else "–",
                    "small",
                    anchor="middle",
                ),
                cls=f"limb{limb}" if limb >= 0 else "limbless",
            )
        )
    return marks


def _marker_labels(names: Sequence[str], cell: float, left: float, top: float) -> list[Markup]:
    if cell < _SMALLEST_LABELLED_CELL:
        return []
    right = left - _LIMB_STRIP - 2 * _SPACE
    return [
        svg.text(right, top + (row + 0.5) * cell + 3.5, clipped(name, _NAME_ROOM), "small", anchor="end")
        for row, name in enumerate(names)
    ]


def _scale(colours: LogScale, unit: str, x: float, y: float) -> Markup:
    steps = np.linspace(0.0, 1.0, _SCALE_STEPS)[np.newaxis]
    middle = (colours.low * colours.high) ** 0.5
    below = y + _SCALE_HEIGHT + 13
    return svg.group(
        svg.image(x, y, _SCALE_WIDTH, _SCALE_HEIGHT, png_uri(ramp_rgba(steps)), crisp=False),
        svg.rect(x, y, _SCALE_WIDTH, _SCALE_HEIGHT, "frame"),
        svg.text(x, below, f"≤ {_rounded(colours.low)}", "small"),
        svg.text(x + _SCALE_WIDTH / 2, below, _rounded(middle), "small", anchor="middle"),
        svg.text(x + _SCALE_WIDTH, below, f"{_rounded(colours.high)} {unit}", "small", anchor="end"),
    )


def _rounded(value: float) -> str:
    return plain(float(f"{value:.2g}"))


def cost_figure(project: Project) -> Markup:
    """Draw the matrix of joint costs, limbs in the order of the tree; frames mark the joints that were kept."""
    topology = project.topology
    order = measures.limb_order(project)
    matrix = topology.joint_costs[np.ix_(order, order)].copy()
    np.fill_diagonal(matrix, np.nan)
    dearest, most = topology.joint_costs[tuple(topology.edges.T)].max(initial=0.0), np.nanmax(matrix, initial=0.0)
    colours = LogScale(dearest, most) if 0.0 < dearest < most else LogScale.of(matrix)
    cell = min(_COST_CELL, _MOST_COST_WIDTH / len(order))
    side, left, top = cell * len(order), 30.0, 30.0
    pixels = ramp_rgba(colours.fractions(matrix))
    pixels[np.arange(len(order)), np.arange(len(order))] = 0  # a limb has no joint with itself: nothing is drawn
    row_of_limb = np.argsort(order)
    kept = [svg.rect(left, top, side, side, "frame")]
    for parent, child in topology.edges.tolist():
        first, second = row_of_limb[parent] * cell, row_of_limb[child] * cell
        hint = svg.tag("title", f"{parent}–{child}: {digits(topology.joint_costs[parent, child])} mm²")
        for x, y in ((first, second), (second, first)):
            kept.append(svg.tag("rect", hint, x=left + x, y=top + y, width=cell, height=cell, cls="kept"))
    heads = [mark for row, limb in enumerate(order) for mark in _heads(limb, (row + 0.5) * cell, left, top, cell)]
    parts = [svg.image(left, top, side, side, png_uri(pixels)), *kept, *heads]
    parts.append(_scale(colours, "mm²", left, top + side + 14))
    width = left + max(side, _SCALE_WIDTH) + 8
    return svg.drawing(width, top + side + 48, "Joint cost between each two limbs", *parts, least=300)


def _heads(limb: int, along: float, left: float, top: float, cell: float) -> list[Markup]:
    radius = min(10.0, cell / 2 - 1)
    places = ((left - 14, top + along), (left + along, top - 14))
    marks = [svg.circle(x, y, radius, "fill") for x, y in places]
    if radius >= 7:
        marks += [svg.text(x, y + 3.5, str(limb), "on-fill small", anchor="middle") for x, y in places]
    return [svg.group(*marks, cls=f"limb{limb}")]


_SIGNATURE = b"\x89PNG\r\n\x1a\n"
_COLOUR_TYPES = {1: 0, 4: 6}  # channels: grey, and colour with alpha
_BIT_DEPTH = 8
_COMPRESSION_LEVEL = 9


def png_uri(pixels: NDArray[np.uint8]) -> str:
    """Return a ``data:`` URI with a picture.

    Parameters
    ----------
    pixels : ndarray of uint8, shape (height, width) or (height, width, 4)
        Grey levels, or red, green, blue and alpha.
    """
    channels = 1 if pixels.ndim == 2 else pixels.shape[2]
    height, width = pixels.shape[:2]
    rows = pixels.reshape(height, width * channels)
    unfiltered = np.hstack([np.zeros((height, 1), dtype=np.uint8), rows])  # every row begins with its filter, 0 = none
    header = struct.pack(">IIBBBBB", width, height, _BIT_DEPTH, _COLOUR_TYPES[channels], 0, 0, 0)
    data = zlib.compress(unfiltered.tobytes(), _COMPRESSION_LEVEL)
    png = _SIGNATURE + _chunk(b"IHDR", header) + _chunk(b"IDAT", data) + _chunk(b"IEND", b"")
    return "data:image/png;base64," + base64.b64encode(png).decode("ascii")


def _chunk(kind: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))


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
