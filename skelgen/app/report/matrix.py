"""Matrices as small embedded pictures: distance deviations of markers, joint costs of limbs."""

import base64
import struct
import zlib
from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from markupsafe import Markup
from numpy.typing import NDArray

from skelgen.app.drawing import measures, svg
from skelgen.app.drawing.colours import ramp_rgba
from skelgen.app.drawing.measures import DeviationMatrix, find_deviation_matrix
from skelgen.app.drawing.scales import LogScale
from skelgen.app.drawing.wording import clipped, counted, digits, plain
from skelgen.model import Project

_WIDTH = 640.0  # of the matrix of markers, without its labels
_LARGEST_CELL, _SMALLEST_LABELLED_CELL = 26.0, 8.5
_LABEL_WIDTH, _STRIP, _SPACE = 108.0, 12.0, 4.0
_NAME_ROOM = 16
_SCALE_WIDTH, _SCALE_HEIGHT, _SCALE_STEPS = 220.0, 10.0, 64
_COST_CELL = 26.0
_MOST_COST_WIDTH = 420.0
_LEAST_SCALE = 0.75


def deviation_figure(project: Project) -> Markup:
    """Draw the matrix of distance deviations, ordered by limb, with the limbs' boundaries and colours."""
    matrix = find_deviation_matrix(project)
    cell = min(_WIDTH / matrix.n, _LARGEST_CELL)
    side = cell * matrix.n
    left, top = _LABEL_WIDTH + _STRIP + _SPACE, _STRIP + 18
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
                svg.rect(left - _STRIP - _SPACE, top + offset + 0.5, _STRIP, size - 1, "fill"),
                svg.rect(left + offset + 0.5, top - _STRIP - _SPACE, size - 1, _STRIP, "fill"),
                svg.rect(left + offset, top + offset, size, size, "block"),
                svg.text(
                    left + offset + size / 2,
                    top - _STRIP - 8,
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
    right = left - _STRIP - 2 * _SPACE
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
    colours = LogScale.of(matrix)
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
