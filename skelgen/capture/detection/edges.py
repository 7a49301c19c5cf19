"""Centres of balls from the whole of their edges: the plain twin.

The brightness-weighted centre uses what lies between the two thresholds, which after saturation is a thin rim that the
grid of pixels cuts at random. Here the grey values I of a ring about the rim are weighed with h = exp(-(rho - r)^2 /
(2 w^2)), rho being the distance from the centre c: the sum of I h (p - c) / rho vanishes where c is the middle of a
shape that is symmetric about it. That is the filter matched to a blurred edge, and two steps of Newton's method from
the weighted centre find its zero.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.detection.spots import BOTTOM, FULL, LEFT, M00, M01, M10, RIGHT, TOP
from skelgen.capture.values import Image
from skelgen.model.arrays import Floats

RING = 0.7
"""Width w [px] of the ring: up to 1.4 px noise does as little harm, but dull metal beside a ball does more."""

REACH = 3.0
"""Widths to both sides of the rim within which the ring is drawn."""

STEPS = 2
"""Newton's steps; the second one moves a centre by less than 1e-3 px."""

NEAREST = 0.5
"""Distance [px] from the centre within which a pixel has no direction."""


def edge_centres(image: Image, spots: NDArray[np.int64], background: float) -> Floats:
    """Return the centres of spots that are one ball each, from their edges.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        Grey image.
    spots : ndarray of int64, shape (n_spots, N_COLUMNS)
        All spots of the image, by the columns of `skelgen.capture.detection.spots`.
    background : float, grey levels
        Brightness of what is dark.

    Returns
    -------
    ndarray, shape (n_spots, 3)
        x and y [px], and the standard deviation of each for a noise of one grey level [px]. NaN for a spot whose ring
        leaves the image, touches another spot, or does not settle.
    """
    found = np.full((len(spots), 3), np.nan)
    for spot in range(len(spots)):
        x, y = spots[spot, M10] / spots[spot, M00], spots[spot, M01] / spots[spot, M00]
        radius = math.sqrt(spots[spot, M00] / (FULL * math.pi))
        window = _window(image, spots, spot, x, y, radius + REACH * RING)
        if window is not None:
            found[spot] = _settled(image, window, (x, y), radius, background)
    return found


def _window(
    image: Image, spots: NDArray[np.int64], spot: int, x: float, y: float, reach: float
) -> tuple[int, int, int, int] | None:
    """First and last column and row of a ring; None if it leaves the image or touches another spot."""
    left, right, top, bottom = math.floor(x - reach), math.ceil(x + reach), math.floor(y - reach), math.ceil(y + reach)
    if left < 0 or top < 0 or right >= image.shape[1] or bottom >= image.shape[0]:
        return None
    others = np.delete(spots, spot, axis=0)
    is_near = (others[:, LEFT] <= right) & (others[:, RIGHT] >= left)
    is_near &= (others[:, TOP] <= bottom) & (others[:, BOTTOM] >= top)
    return None if is_near.any() else (left, right, top, bottom)


def _settled(
    image: Image, window: tuple[int, int, int, int], start: tuple[float, float], radius: float, background: float
) -> Floats:
    left, right, top, bottom = window
    rows, columns = np.mgrid[top : bottom + 1, left : right + 1]
    light = image[rows, columns] - background
    x, y = start
    spread, slope = 0.0, 0.0
    for _ in range(STEPS):
        across, down = columns - x, rows - y
        distance = np.maximum(np.hypot(across, down), NEAREST)
        off = distance - radius
        ring = np.exp(-(off**2) / (2 * RING**2))
        slope = float((light * ring * (1 / distance - off / RING**2)).sum()) / 2
        if slope <= 0.0:
            return np.full(3, np.nan)
        x += float((light * ring * across / distance).sum()) / slope
        y += float((light * ring * down / distance).sum()) / slope
        spread = float((ring**2).sum())
    is_near = math.hypot(x - start[0], y - start[1]) < RING
    return np.array([x, y, math.sqrt(spread / 2) / slope]) if is_near else np.full(3, np.nan)
