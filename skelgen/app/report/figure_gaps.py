"""When each marker is seen: one bar per marker in its limb's colour, faded where the marker is missing.

Where gaps can be filled, they are coloured by what the filled positions rest on.
"""

from __future__ import annotations

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.report import measures, svg
from skelgen.app.report.png import png_uri
from skelgen.app.report.wording import clipped, percent, plain
from skelgen.model import Project
from skelgen.model.arrays import Bools, Ints
from skelgen.model.filled import Filled, Source

_WIDTH, _LEFT, _RIGHT, _BOTTOM = 900.0, 112.0, 52.0, 36.0
_ROW = 11.0
_SMALLEST_ROW = 2.5  # with very many markers; below `_SMALLEST_LABELLED_ROW` without names
_SMALLEST_LABELLED_ROW = 9.0
_LARGEST_HEIGHT = 800.0
_MOST_BINS = 736
_OPAQUE = 255
_MOST_WITH_GAP = 130  # of 255: a single missing frame already fades its whole stretch visibly
_LEAST_WIDTH = 560.0
_NAME_ROOM = 16
_LEAST_FILLED = 110  # alpha of 255: a single filled frame still tints its stretch visibly

SOURCE_COLOURS = {Source.LIMB: (46, 139, 87), Source.JOINT: (218, 149, 32), Source.INTERPOLATED: (200, 60, 60)}
"""Red, green, blue of each source of filled positions; readable on light and on dark ground."""


def gaps_figure(project: Project, filled: Filled | None = None) -> Markup:
    """Draw the timeline of seen, filled and unseen markers, in the order of the limbs.

    Parameters
    ----------
    project : Project
        With labelled markers.
    filled : Filled, optional
        How the gaps can be filled.
    """
    order = measures.subtree_markers(project)
    seen = project.trajectories.seen[:, order]
    row = min(_ROW, max(_SMALLEST_ROW, _LARGEST_HEIGHT / max(len(order), 1)))
    height, width = row * len(order), _WIDTH - _LEFT - _RIGHT
    mask = svg.tag(
        "mask",
        svg.image(_LEFT, 0, width, height, png_uri(_brightness(seen))),
        id="seen-mask",
        maskUnits="userSpaceOnUse",
        x=_LEFT,
        y=0,
        width=width,
        height=height,
    )
    bars = svg.group(*_bars(project, order, row, width), mask="url(#seen-mask)")
    tints = [svg.image(_LEFT, 0, width, height, png_uri(_tints(filled.source[:, order])))] if filled else []
    labels = _labels(project, order, seen, row) if row >= _SMALLEST_LABELLED_ROW else []
    axis = _time_axis(project, width, height)
    title = "When each marker is seen"
    return svg.drawing(_WIDTH, height + _BOTTOM, title, mask, bars, *tints, *labels, axis, least=_LEAST_WIDTH)


def _brightness(seen: Bools) -> NDArray[np.uint8]:
    """Brightness of the mask, shape (n_markers, n_bins): full where a marker is seen in all frames of a stretch."""
    starts, stops = measures.bin_edges(len(seen), _MOST_BINS)
    counts = np.add.reduceat(seen.astype(np.float64), starts, axis=0)
    shares = counts / (stops - starts)[:, np.newaxis]
    grey = np.where(shares == 1.0, _OPAQUE, np.minimum(shares * _OPAQUE, _MOST_WITH_GAP))
    return np.ascontiguousarray(grey.T.astype(np.uint8))


def _tints(source: Ints) -> NDArray[np.uint8]:
    """Colours over the gaps, shape (n_markers, n_bins, 4): of each stretch the least certain source that it has."""
    starts, stops = measures.bin_edges(len(source), _MOST_BINS)
    pixels = np.zeros((len(starts), source.shape[1], 4), dtype=np.uint8)
    for kind, colour in SOURCE_COLOURS.items():
        shares = np.add.reduceat((source == kind).astype(np.float64), starts, axis=0) / (stops - starts)[:, np.newaxis]
        there = shares > 0
        pixels[there, :3] = colour
        pixels[there, 3] = np.maximum(shares[there] * _OPAQUE, _LEAST_FILLED).astype(np.uint8)
    return np.ascontiguousarray(pixels.swapaxes(0, 1))


def _bars(project: Project, order: Ints, row: float, width: float) -> list[Markup]:
    limb_of_marker = project.limbs.limb_of_marker if project.has("limbs") else np.full(len(order), -1)
    bars = []
    for index, marker in enumerate(order.tolist()):
        limb = int(limb_of_marker[marker])
        cls = f"fill limb{limb}" if limb >= 0 else "fill limbless"
        bars.append(svg.rect(_LEFT, row * index + 1, width, row - 2 if row > 4 else row, cls))
    return bars


def _labels(project: Project, order: Ints, seen: Bools, row: float) -> list[Markup]:
    labels = []
    for index, marker in enumerate(order.tolist()):
        baseline = row * (index + 0.5) + 3.5
        name = clipped(project.trajectories.names[marker], _NAME_ROOM)
        share = percent(float(seen[:, index].mean()))
        labels.append(svg.text(_LEFT - 6, baseline, name, "small", anchor="end"))
        labels.append(svg.text(_WIDTH - _RIGHT + 6, baseline, share, "small"))
    return labels


def _time_axis(project: Project, width: float, height: float) -> Markup:
    trajectories = project.trajectories
    last = max(trajectories.n_frames - 1, 1) / trajectories.rate
    parts = [svg.line(_LEFT, height + 2, _LEFT + width, height + 2, "axis")]
    for value in svg.ticks(0.0, last, 8):
        parts.append(svg.text(_LEFT + width * value / last, height + 16, plain(value), "small", anchor="middle"))
    parts.append(svg.text(_LEFT + width / 2, height + 32, "time [s]", "small", anchor="middle"))
    return svg.group(*parts)
