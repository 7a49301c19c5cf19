"""The simulated rig's drawing: a ball into the light on a sensor, and what the sensor makes of the light."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import array_kernel, kernel, kernel_part
from skelgen.model.arrays import Floats, Ints

PADDING = 16
"""Pixels around the image whose light the blur may still bring in: five deviations of the strongest blur."""

SAMPLES = 3
"""Samples along a side of a pixel. An edge is soft within a sample, so that three are exact to 1e-3 px of a centre."""

N_NORMALS = 4096
"""Normal deviates in the table that noise is drawn from: their deviation is 0.9993, the largest 3.7."""

GOLDEN, MIX_1, MIX_2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""Constants of SplitMix64 (Steele, Lea and Flood 2014): each pixel's noise follows from its number alone."""

Light = NDArray[np.float32]
Image = NDArray[np.uint8]


class DrawnBall(NamedTuple):
    """A ball as it is drawn.

    Attributes
    ----------
    window : ndarray of intp, shape (4,), px
        First and last + 1 column, first and last + 1 row of its outline, within `PADDING` of the image.
    place : ndarray, shape (3,), mm
        Its centre in the camera's frame.
    radius : float, mm
        Of all balls.
    scale : float, px/mm
        Size of the image at the ball.
    level : float, grey levels
        Brightness of its middle.
    darkening : float
        How much darker its rim is, as a part of that.
    """

    window: Ints
    place: Floats
    radius: float
    scale: float
    level: float
    darkening: float


class NearerBalls(NamedTuple):
    """Balls that may cover another one.

    Attributes
    ----------
    places : ndarray, shape (n, 3), mm
        Their centres in the camera's frame.
    scales : ndarray, shape (n,), px/mm
        Size of the image at each.
    """

    places: Floats
    scales: Floats


@array_kernel
def draw_ball(light: Light, rays: Floats, ball: DrawnBall, nearer: NearerBalls, blur: Floats) -> float:
    """Add a blurred ball to an image's light.

    Parameters
    ----------
    light : ndarray of float32, shape (height, width), grey levels
        Is added to.
    rays : ndarray, shape (height + 2 PADDING + 1, width + 2 PADDING + 1, 2)
        Rays x / z, y / z through the corners of all pixels of the padded image.
    ball : DrawnBall
        The ball.
    nearer : NearerBalls
        Balls that may cover it.
    blur : ndarray, shape ((2 reach + 1) SAMPLES,)
        How much of a sample's light a pixel receives, along one axis.

    Returns
    -------
    float, px
        Area of the outline that is in the image and not covered.
    """
    first_column, last_column, first_row, last_row = ball.window
    samples = np.empty(((last_row - first_row) * SAMPLES, (last_column - first_column) * SAMPLES))
    visible = _fill_samples(samples, rays, ball, nearer)
    reach = (len(blur) // SAMPLES - 1) // 2
    left, right = max(first_column - reach, 0), min(last_column + reach, light.shape[1])
    top, bottom = max(first_row - reach, 0), min(last_row + reach, light.shape[0])
    if left >= right or top >= bottom:
        return visible
    across = np.zeros((samples.shape[0], right - left))
    for row in range(samples.shape[0]):
        for x in range(left, right):
            shift = (x - first_column - reach) * SAMPLES
            total = 0.0
            for column in range(max(shift, 0), min(shift + len(blur), samples.shape[1])):
                total += blur[column - shift] * samples[row, column]
            across[row, x - left] = total
    for y in range(top, bottom):
        shift = (y - first_row - reach) * SAMPLES
        for row in range(max(shift, 0), min(shift + len(blur), samples.shape[0])):
            weight = ball.level * blur[row - shift]
            for x in range(left, right):
                light[y, x] += np.float32(weight * across[row, x - left])
    return visible


@kernel_part
def _fill_samples(samples: Floats, rays: Floats, ball: DrawnBall, nearer: NearerBalls) -> float:
    """Fill the light of a ball's samples, its middle being 1; return the area [px] that is in the image and free."""
    visible = 0.0
    height, width = rays.shape[0] - 1 - 2 * PADDING, rays.shape[1] - 1 - 2 * PADDING
    for row in range(samples.shape[0]):
        y, down = ball.window[2] + row // SAMPLES, (row % SAMPLES + 0.5) / SAMPLES
        for column in range(samples.shape[1]):
            x, right = ball.window[0] + column // SAMPLES, (column % SAMPLES + 0.5) / SAMPLES
            i, j = y + PADDING, x + PADDING
            upper_x = rays[i, j, 0] + right * (rays[i, j + 1, 0] - rays[i, j, 0])
            lower_x = rays[i + 1, j, 0] + right * (rays[i + 1, j + 1, 0] - rays[i + 1, j, 0])
            upper_y = rays[i, j, 1] + right * (rays[i, j + 1, 1] - rays[i, j, 1])
            lower_y = rays[i + 1, j, 1] + right * (rays[i + 1, j + 1, 1] - rays[i + 1, j, 1])
            ray_x, ray_y = upper_x + down * (lower_x - upper_x), upper_y + down * (lower_y - upper_y)
            distance = _distance_from_ray(ray_x, ray_y, ball.place)
            free = _coverage(distance, ball.radius, ball.scale)
            if not free > 0.0:  # NaN, too, where the lens sends no ray
                samples[row, column] = 0.0
                continue
            for other in range(len(nearer.places)):
                gap = _distance_from_ray(ray_x, ray_y, nearer.places[other])
                free *= 1.0 - _coverage(gap, ball.radius, nearer.scales[other])
            slant = 1.0 - min(distance / ball.radius, 1.0) ** 2
            samples[row, column] = free * (1.0 - ball.darkening + ball.darkening * math.sqrt(slant))
            if 0 <= y < height and 0 <= x < width:
                visible += free
    return visible / (SAMPLES * SAMPLES)


@kernel_part
def _distance_from_ray(x: float, y: float, place: Floats) -> float:
    """Return the distance [mm] of a ball's centre from a ray."""
    along = x * place[0] + y * place[1] + place[2]
    square = place[0] * place[0] + place[1] * place[1] + place[2] * place[2]
    return math.sqrt(max(square - along * along / (x * x + y * y + 1.0), 0.0))


@kernel_part
def _coverage(distance: float, radius: float, scale: float) -> float:
    """Return the part of a sample that a ball covers, from the distance of its edge."""
    return min(max(0.5 + (radius - distance) * scale * SAMPLES, 0.0), 1.0)


class Sensor(NamedTuple):
    """The noise of a sensor.

    Attributes
    ----------
    key : int
        Below 2^64: the same key gives the same noise.
    noise : float, grey levels
        Standard deviation in the dark.
    shot_noise : float, grey levels
        Variance that each grey level adds.
    """

    key: np.uint64
    noise: float
    shot_noise: float


@kernel
def expose(light: Light, normals: Light, sensor: Sensor, image: Image) -> None:
    """Fill an image from its light with a sensor's noise; values are rounded and cut to 0 .. 255.

    Parameters
    ----------
    light : ndarray of float32, shape (height, width), grey levels
        What falls on the sensor.
    normals : ndarray of float32, shape (N_NORMALS,)
        Quantiles of the normal distribution.
    sensor : Sensor
        Its noise.
    image : ndarray of uint8, shape (height, width)
        Is filled.
    """
    width = light.shape[1]
    mask, golden, mix_1, mix_2 = np.uint64(N_NORMALS - 1), np.uint64(GOLDEN), np.uint64(MIX_1), np.uint64(MIX_2)
    dark, shot, half = np.float32(sensor.noise * sensor.noise), np.float32(sensor.shot_noise), np.float32(0.5)
    for y in range(light.shape[0]):
        state = np.uint64(y * width) * golden + sensor.key
        for x in range(width):
            state += golden
            mixed = (state ^ (state >> np.uint64(30))) * mix_1
            mixed = (mixed ^ (mixed >> np.uint64(27))) * mix_2
            level = light[y, x]
            value = level + normals[(mixed >> np.uint64(40)) & mask] * math.sqrt(dark + shot * level)
            image[y, x] = np.uint8(min(max(value + half, np.float32(0.0)), np.float32(255.0)))
