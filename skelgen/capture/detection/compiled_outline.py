"""From the middles of outlines to the images of centres, compiled: twin of `outline`, which says what is done and why.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.capture.detection.outline import N_AROUND
from skelgen.capture.optics.compiled import Pair, rays
from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats


@compile_function
def offsets(centres: Floats, areas: Floats, numbers: Floats) -> Floats:
    """Return how far the middles of outlines lie from the images of their balls' centres, shape (n_balls, 2), px.

    Parameters
    ----------
    centres : ndarray, shape (n_balls, 2), px
        Middles of outlines.
    areas : ndarray, shape (n_balls,), px
        Areas within them.
    numbers : ndarray, shape (11,)
        See `camera_numbers`.
    """
    on_plane, _ = rays((centres, areas, numbers))
    focal = math.sqrt(numbers[0] * numbers[1])
    out, outline = np.zeros((len(centres), 2)), np.empty((N_AROUND, 2))
    for ball in range(len(centres)):
        x, y = on_plane[ball, 0], on_plane[ball, 1]
        _draw(outline, x, y, math.sqrt(areas[ball] / math.pi) / focal, numbers)
        middle, seen = _middle(outline), _pixel(x, y, numbers)
        if math.isfinite(middle[0] - seen[0]) and math.isfinite(middle[1] - seen[1]):
            out[ball, 0], out[ball, 1] = middle[0] - seen[0], middle[1] - seen[1]
    return out


@compile_function
def _draw(outline: Floats, x: float, y: float, radius: float, numbers: Floats) -> None:
    """Fill the outline [px] of a ball on the ray x, y that is seen as large as a disc on the plane z = 1."""
    length = math.sqrt(x * x + y * y + 1.0)
    u, v, w = x / length, y / length, 1.0 / length
    level = math.sqrt(w * w + u * u)
    aside_x, aside_z = -w / level, u / level  # across the ray and the y axis
    up_x, up_y, up_z = v * aside_z, w * aside_x - u * aside_z, -v * aside_x
    angular = radius * w * math.sqrt(w)
    for corner in range(N_AROUND):
        turn = 2.0 * math.pi * corner / N_AROUND
        across, along = angular * math.cos(turn), angular * math.sin(turn)
        depth = w + across * aside_z + along * up_z
        right, down = u + across * aside_x + along * up_x, v + along * up_y
        outline[corner, 0], outline[corner, 1] = _pixel(right / depth, down / depth, numbers)


@compile_function
def _pixel(x: float, y: float, numbers: Floats) -> Pair:
    """Where a camera sees the ray x, y; NaN where its lens folds back."""
    fx, fy, cx, cy, skew, k1, k2, p1, p2, k3, fold = numbers
    square = x * x + y * y
    if not square < fold:
        return math.nan, math.nan
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    bent_x = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
    bent_y = y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
    return fx * bent_x + skew * bent_y + cx, fy * bent_y + cy


@compile_function
def _middle(outline: Floats) -> Pair:
    """Centroid of the area of a polygon."""
    first_x, first_y, total, across, down = outline[0, 0], outline[0, 1], 0.0, 0.0, 0.0
    for corner in range(len(outline)):
        after = (corner + 1) % len(outline)
        x, y = outline[corner, 0] - first_x, outline[corner, 1] - first_y
        next_x, next_y = outline[after, 0] - first_x, outline[after, 1] - first_y
        doubled = x * next_y - y * next_x
        total += doubled
        across += (x + next_x) * doubled
        down += (y + next_y) * doubled
    return first_x + across / (3.0 * total), first_y + down / (3.0 * total)
