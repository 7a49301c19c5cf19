"""Rays of a camera: its lens, both ways, and from the outlines of balls to the images of their centres.

A camera is given by eleven numbers: focal lengths, principal point, skew, distortion k1 k2 p1 p2 k3, and the square of
the radius on the plane z = 1 from which on the lens model folds the image back into itself.

The lens distorts a normalised point x / z, y / z before the camera matrix makes pixels of it (Gaschler 2011, 4.1.1).
"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import array_kernel, kernel_part
from skelgen.model.arrays import Floats

MAX_NEWTON_STEPS = 30
"""Gaschler 2011 needs 5 to 10; a lens that bends a ray by half its slope needs 15."""

NEWTON_TOLERANCE = 1e-13
"""Of a normalised coordinate: 1e-10 px at the focal lengths of real cameras."""

N_CORNERS = 16
"""Of a polygon inscribed in an outline, whose middle is that of the ellipse."""

Pair = tuple[float, float]


@array_kernel
def distort(rays: Floats, numbers: Floats) -> tuple[Floats, Floats]:
    """Return where the lens puts rays, and how that changes with the ray.

    Parameters
    ----------
    rays : ndarray, shape (n, 2)
        Normalised coordinates x / z, y / z.
    numbers : ndarray, shape (11,)
        The camera's.

    Returns
    -------
    distorted : ndarray, shape (n, 2)
        Normalised coordinates behind the lens; also those beyond the fold.
    slope : ndarray, shape (n, 2, 2)
        d distorted / d ray.
    """
    distorted, slope = np.empty((len(rays), 2)), np.empty((len(rays), 2, 2))
    for ray in range(len(rays)):
        x, y, a, b, d = _lens(rays[ray, 0], rays[ray, 1], numbers)
        distorted[ray, 0], distorted[ray, 1] = x, y
        slope[ray, 0, 0], slope[ray, 0, 1], slope[ray, 1, 0], slope[ray, 1, 1] = a, b, b, d
    return distorted, slope


@array_kernel
def undistort(distorted: Floats, numbers: Floats) -> Floats:
    """Return the rays that the lens puts at normalised coordinates, shape (n, 2), by Newton's method.

    Parameters
    ----------
    distorted : ndarray, shape (n, 2)
        Normalised coordinates behind the lens.
    numbers : ndarray, shape (11,)
        The camera's.

    Returns
    -------
    ndarray, shape (n, 2)
        NaN where the lens sends no ray.
    """
    rays = np.empty((len(distorted), 2))
    for ray in range(len(distorted)):
        rays[ray, 0], rays[ray, 1], _, _, _ = _ray(distorted[ray, 0], distorted[ray, 1], numbers)
    return rays


@array_kernel
def rays_of_pixels(pixels: Floats, std: Floats, numbers: Floats) -> tuple[Floats, Floats]:
    """Return the rays that pixels look along, and how their noise spreads them.

    Parameters
    ----------
    pixels : ndarray, shape (n, 2), px
        As the camera sees them.
    std : ndarray, shape (n,), px
        Standard deviation of each along one axis.
    numbers : ndarray, shape (11,)
        The camera's.

    Returns
    -------
    rays : ndarray, shape (n, 2)
        Normalised coordinates; NaN where the lens sends no ray.
    spread : ndarray, shape (n, 2, 2)
        d ray / d pixel times the deviation: spread spread^T is the covariance of a ray.
    """
    fx, fy, cx, cy, skew = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4]
    rays, spread = np.empty((len(pixels), 2)), np.empty((len(pixels), 2, 2))
    for ball in range(len(pixels)):
        distorted_y = (pixels[ball, 1] - cy) / fy
        distorted_x = (pixels[ball, 0] - cx - skew * distorted_y) / fx
        x, y, a, b, d = _ray(distorted_x, distorted_y, numbers)
        rays[ball, 0], rays[ball, 1] = x, y
        scale = std[ball] / (a * d - b * b)  # the inverse of focal lengths times the slope of the lens
        spread[ball, 0, 0], spread[ball, 0, 1] = d * scale / fx, (-b - d * skew / fx) * scale / fy
        spread[ball, 1, 0], spread[ball, 1, 1] = -b * scale / fx, (a + b * skew / fx) * scale / fy
    return rays, spread


@kernel_part
def _lens(x: float, y: float, numbers: Floats) -> tuple[float, float, float, float, float]:
    """Return where the lens puts a ray, and the slope a b, b d of that."""
    k1, k2, p1, p2, k3 = numbers[5], numbers[6], numbers[7], numbers[8], numbers[9]
    square = x * x + y * y
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    growth = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
    distorted_x = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x)
    distorted_y = y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y
    a = radial + growth * x * x + 2.0 * p1 * y + 6.0 * p2 * x
    d = radial + growth * y * y + 6.0 * p1 * y + 2.0 * p2 * x
    b = growth * x * y + 2.0 * p1 * x + 2.0 * p2 * y
    return distorted_x, distorted_y, a, b, d


@kernel_part
def _ray(distorted_x: float, distorted_y: float, numbers: Floats) -> tuple[float, float, float, float, float]:
    """Return the ray that the lens puts at a place, NaN if there is none, and the slope a b, b d of the lens there."""
    x, y, largest = distorted_x, distorted_y, 1.0
    a, b, d = 1.0, 0.0, 1.0
    for step in range(MAX_NEWTON_STEPS + 1):
        there_x, there_y, a, b, d = _lens(x, y, numbers)
        if largest <= NEWTON_TOLERANCE or step == MAX_NEWTON_STEPS:
            break
        off_x, off_y, determinant = there_x - distorted_x, there_y - distorted_y, a * d - b * b
        if determinant == 0.0:
            largest = math.inf
            break
        step_x, step_y = (d * off_x - b * off_y) / determinant, (a * off_y - b * off_x) / determinant
        x, y, largest = x - step_x, y - step_y, max(abs(step_x), abs(step_y))
    if not (largest <= NEWTON_TOLERANCE * MAX_NEWTON_STEPS and x * x + y * y < numbers[10]):
        x = y = math.nan
    return x, y, a, b, d


@array_kernel
def outline_offsets(centres: Floats, areas: Floats, numbers: Floats) -> Floats:
    """Return how far the middles of outlines lie from the images of their balls' centres.

    Parameters
    ----------
    centres : ndarray, shape (n_balls, 2), px
        Middles of outlines.
    areas : ndarray, shape (n_balls,), px
        Areas within them.
    numbers : ndarray, shape (11,)
        The camera's.

    Returns
    -------
    ndarray, shape (n_balls, 2), px
        0 where the lens sends no ray.
    """
    rays, _ = rays_of_pixels(centres, areas, numbers)
    focal = math.sqrt(numbers[0] * numbers[1])
    offsets, outline = np.zeros((len(centres), 2)), np.empty((N_CORNERS, 2))
    for ball in range(len(centres)):
        x, y = rays[ball, 0], rays[ball, 1]
        if not (math.isfinite(x) and math.isfinite(y)):
            continue
        _draw_outline(outline, x, y, math.sqrt(areas[ball] / math.pi) / focal, numbers)
        middle, seen = _middle(outline), _pixel(x, y, numbers)
        if math.isfinite(middle[0] - seen[0]) and math.isfinite(middle[1] - seen[1]):
            offsets[ball, 0], offsets[ball, 1] = middle[0] - seen[0], middle[1] - seen[1]
    return offsets


@kernel_part
def _draw_outline(outline: Floats, x: float, y: float, radius: float, numbers: Floats) -> None:
    """Fill the outline [px] of a ball on the ray x, y that is seen as large as a disc on the plane z = 1."""
    length = math.sqrt(x * x + y * y + 1.0)
    u, v, w = x / length, y / length, 1.0 / length
    level = math.sqrt(w * w + u * u)
    aside_x, aside_z = -w / level, u / level  # across the ray and the y axis
    up_x, up_y, up_z = v * aside_z, w * aside_x - u * aside_z, -v * aside_x
    # A cone of the half angle a about a ray that is t off the axis cuts an area of pi tan(a)^2 / cos(t)^3 from z = 1.
    angular = radius * w * math.sqrt(w)
    for corner in range(N_CORNERS):
        turn = 2.0 * math.pi * corner / N_CORNERS
        across, along = angular * math.cos(turn), angular * math.sin(turn)
        depth = w + across * aside_z + along * up_z
        right, down = u + across * aside_x + along * up_x, v + along * up_y
        outline[corner, 0], outline[corner, 1] = _pixel(right / depth, down / depth, numbers)


@kernel_part
def _pixel(x: float, y: float, numbers: Floats) -> Pair:
    """Return where a camera sees the ray x, y; NaN where its lens folds back."""
    if not x * x + y * y < numbers[10]:
        return math.nan, math.nan
    distorted_x, distorted_y, _, _, _ = _lens(x, y, numbers)
    return numbers[0] * distorted_x + numbers[4] * distorted_y + numbers[2], numbers[1] * distorted_y + numbers[3]


@kernel_part
def _middle(outline: Floats) -> Pair:
    """Return the centroid of the area of a polygon."""
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
