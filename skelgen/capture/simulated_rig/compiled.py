"""The compiled loops of the simulated rig: drawing a ball, and what the sensor makes of the light.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.simulated_rig.plain import (
    GOLDEN,
    MIX_1,
    MIX_2,
    N_NORMALS,
    SAMPLES,
)
from skelgen.capture.simulated_rig.view import PADDING
from skelgen.capture.values import Image
from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats, Ints

_Light = NDArray[np.float32]


@compile_function
def _distance_from_ray(x: float, y: float, place: Floats) -> float:
    """Distance [mm] of a ball's centre from a ray."""
    along = x * place[0] + y * place[1] + place[2]
    square = place[0] * place[0] + place[1] * place[1] + place[2] * place[2]
    return math.sqrt(max(square - along * along / (x * x + y * y + 1.0), 0.0))


@compile_function
def _coverage(distance: float, radius: float, scale: float) -> float:
    """Part of a sample that a ball covers, from the distance of its edge."""
    return min(max(0.5 + (radius - distance) * scale * SAMPLES, 0.0), 1.0)


@compile_function
def _sampled(
    rays: Floats,
    window: Ints,
    place: Floats,
    radius: float,
    scale: float,
    nearer: Floats,
    nearer_scale: Floats,
    darkening: float,
    samples: Floats,
) -> float:
    """Fill the light of a ball's samples, its middle being 1; returns the area [px] that is in the image and free."""
    visible = 0.0
    height, width = rays.shape[0] - 1 - 2 * PADDING, rays.shape[1] - 1 - 2 * PADDING
    for row in range(samples.shape[0]):
        y, down = window[2] + row // SAMPLES, (row % SAMPLES + 0.5) / SAMPLES
        for column in range(samples.shape[1]):
            x, right = window[0] + column // SAMPLES, (column % SAMPLES + 0.5) / SAMPLES
            i, j = y + PADDING, x + PADDING
            upper_x = rays[i, j, 0] + right * (rays[i, j + 1, 0] - rays[i, j, 0])
            lower_x = rays[i + 1, j, 0] + right * (rays[i + 1, j + 1, 0] - rays[i + 1, j, 0])
            upper_y = rays[i, j, 1] + right * (rays[i, j + 1, 1] - rays[i, j, 1])
            lower_y = rays[i + 1, j, 1] + right * (rays[i + 1, j + 1, 1] - rays[i + 1, j, 1])
            ray_x, ray_y = upper_x + down * (lower_x - upper_x), upper_y + down * (lower_y - upper_y)
            distance = _distance_from_ray(ray_x, ray_y, place)
            free = _coverage(distance, radius, scale)
            if not free > 0.0:  # NaN, too, where the lens sends no ray
                samples[row, column] = 0.0
                continue
            for ball in range(len(nearer)):
                gap = _distance_from_ray(ray_x, ray_y, nearer[ball])
                free *= 1.0 - _coverage(gap, radius, nearer_scale[ball])
            slant = 1.0 - min(distance / radius, 1.0) ** 2
            samples[row, column] = free * (1.0 - darkening + darkening * math.sqrt(slant))
            if 0 <= y < height and 0 <= x < width:
                visible += free
    return visible / (SAMPLES * SAMPLES)


@compile_function
def draw_ball(
    light: _Light,
    rays: Floats,
    window: Ints,
    place: Floats,
    radius: float,
    scale: float,
    nearer: Floats,
    nearer_scale: Floats,
    level: float,
    darkening: float,
    kernel: Floats,
) -> float:
    """Add a blurred ball to an image's light; arguments and result as `plain.draw_ball`."""
    n_rows, n_columns = window[3] - window[2], window[1] - window[0]
    samples = np.empty((n_rows * SAMPLES, n_columns * SAMPLES))
    visible = _sampled(rays, window, place, radius, scale, nearer, nearer_scale, darkening, samples)
    reach = (len(kernel) // SAMPLES - 1) // 2
    left, right = max(window[0] - reach, 0), min(window[1] + reach, light.shape[1])
    top, bottom = max(window[2] - reach, 0), min(window[3] + reach, light.shape[0])
    if left >= right or top >= bottom:
        return visible
    across = np.zeros((samples.shape[0], right - left))
    for row in range(samples.shape[0]):
        for x in range(left, right):
            shift = (x - window[0] - reach) * SAMPLES
            total = 0.0
            for column in range(max(shift, 0), min(shift + len(kernel), samples.shape[1])):
                total += kernel[column - shift] * samples[row, column]
            across[row, x - left] = total
    for y in range(top, bottom):
        shift = (y - window[2] - reach) * SAMPLES
        for row in range(max(shift, 0), min(shift + len(kernel), samples.shape[0])):
            weight = level * kernel[row - shift]
            for x in range(left, right):
                light[y, x] += np.float32(weight * across[row, x - left])
    return visible


@compile_function
def expose(light: _Light, normals: _Light, key: np.uint64, noise: float, shot_noise: float, image: Image) -> None:
    """Fill an image from its light with a sensor's noise; arguments as `plain.expose`."""
    width = light.shape[1]
    mask = np.uint64(N_NORMALS - 1)
    for y in range(light.shape[0]):
        state = np.uint64(y * width) * np.uint64(GOLDEN) + key
        for x in range(width):
            state += np.uint64(GOLDEN)
            mixed = (state ^ (state >> np.uint64(30))) * np.uint64(MIX_1)
            mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(MIX_2)
            normal = normals[(mixed >> np.uint64(40)) & mask]
            level = light[y, x]
            value = level + normal * math.sqrt(np.float32(noise * noise) + np.float32(shot_noise) * level)
            image[y, x] = np.uint8(min(max(value + np.float32(0.5), np.float32(0.0)), np.float32(255.0)))
