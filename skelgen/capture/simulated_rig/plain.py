"""The plain twins of the compiled loops of the simulated rig, and the numbers that both share."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.simulated_rig.view import PADDING
from skelgen.capture.values import Image
from skelgen.model.arrays import Floats, Ints

_Light = NDArray[np.float32]

SAMPLES = 3
"""Samples along a side of a pixel. An edge is soft within a sample, so that three are exact to 1e-3 px of a centre."""

N_NORMALS = 4096
"""Normal deviates in the table that noise is drawn from: their deviation is 0.9993, the largest 3.7."""

GOLDEN, MIX_1, MIX_2 = 0x9E3779B97F4A7C15, 0xBF58476D1CE4E5B9, 0x94D049BB133111EB
"""Constants of SplitMix64 (Steele, Lea and Flood 2014): each pixel's noise follows from its number alone."""

_KERNEL_REACH = 4.5  # standard deviations beyond which the blur leaves 1e-5


def normal_table() -> _Light:
    """Return `N_NORMALS` evenly spread quantiles of the normal distribution, rising."""
    from scipy.special import ndtri  # noqa: PLC0415 - imported where it is used

    return np.asarray(ndtri((np.arange(N_NORMALS) + 0.5) / N_NORMALS), dtype=np.float32)


def blur_kernel(blur: float) -> Floats:
    """Return how much of a sample's light each pixel receives: the normal density summed over the pixel.

    Parameters
    ----------
    blur : float, px
        Standard deviation.

    Returns
    -------
    ndarray, shape ((2 reach + 1) `SAMPLES`,)
        One axis, for the samples from `reach` pixels before a pixel to as many behind it.
    """
    reach = math.ceil(_KERNEL_REACH * blur)
    n_samples = (2 * reach + 1) * SAMPLES
    offsets = (np.arange(n_samples) + 0.5) / SAMPLES - reach - 0.5
    from scipy.special import ndtr  # noqa: PLC0415 - imported where it is used

    received = ndtr((offsets + 0.5) / blur) - ndtr((offsets - 0.5) / blur)
    return np.asarray(received / received.sum())


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
    """Add a blurred ball to an image's light.

    Parameters
    ----------
    light : ndarray of float32, shape (height, width), grey levels
        Is added to.
    rays : ndarray, shape (height + 2 PADDING + 1, width + 2 PADDING + 1, 2)
        Of `corner_rays`.
    window : ndarray of intp, shape (4,), px
        First and last + 1 column, first and last + 1 row of the ball's outline.
    place : ndarray, shape (3,), mm
        Its centre in the camera's frame.
    radius : float, mm
        Of all balls.
    scale : float, px/mm
        Size of the image at the ball.
    nearer : ndarray, shape (n, 3), mm
        Balls that may cover it.
    nearer_scale : ndarray, shape (n,), px/mm
        Size of the image at those.
    level : float, grey levels
        Brightness of the ball's middle.
    darkening : float
        How much darker its rim is.
    kernel : ndarray
        Of `blur_kernel`.

    Returns
    -------
    float
        Area [px] of the outline that is in the image and not covered.
    """
    x = (np.arange(window[0] * SAMPLES, window[1] * SAMPLES) + 0.5) / SAMPLES - 0.5
    y = (np.arange(window[2] * SAMPLES, window[3] * SAMPLES) + 0.5) / SAMPLES - 0.5
    sampled_rays = _interpolated(rays, x, y)
    distances = _distances(sampled_rays, place)
    free = np.nan_to_num(np.clip(0.5 + (radius - distances) * scale * SAMPLES, 0.0, 1.0))
    for other, other_scale in zip(nearer, nearer_scale, strict=True):
        gap = _distances(sampled_rays, other)
        free *= 1.0 - np.nan_to_num(np.clip(0.5 + (radius - gap) * other_scale * SAMPLES, 0.0, 1.0))
    slant = np.nan_to_num(1.0 - np.minimum(distances / radius, 1.0) ** 2)
    samples = free * (1.0 - darkening + darkening * np.sqrt(slant))
    height, width = light.shape
    light += (level * _received(kernel, y, height) @ samples @ _received(kernel, x, width).T).astype(np.float32)
    inside = np.ix_((y > -0.5) & (y < height - 0.5), (x > -0.5) & (x < width - 0.5))
    return float(free[inside].sum()) / SAMPLES**2


def expose(light: _Light, normals: _Light, key: int, noise: float, shot_noise: float, image: Image) -> None:
    """Fill an image from its light with a sensor's noise; values are rounded and cut to 0 .. 255.

    Parameters
    ----------
    light : ndarray of float32, shape (height, width), grey levels
        What falls on the sensor.
    normals : ndarray of float32, shape (`N_NORMALS`,)
        Of `normal_table`.
    key : int
        Below 2^64: the same key gives the same noise.
    noise : float, grey levels
        Standard deviation in the dark.
    shot_noise : float, grey levels
        Variance that each grey level adds.
    image : ndarray of uint8, shape (height, width)
        Is filled.
    """
    with np.errstate(over="ignore"):
        state = np.arange(1, light.size + 1, dtype=np.uint64) * np.uint64(GOLDEN) + np.uint64(key)
        mixed = (state ^ (state >> np.uint64(30))) * np.uint64(MIX_1)
        mixed = (mixed ^ (mixed >> np.uint64(27))) * np.uint64(MIX_2)
    normal = normals[((mixed >> np.uint64(40)) & np.uint64(N_NORMALS - 1)).astype(np.intp)].reshape(light.shape)
    values = light + normal * np.sqrt(np.float32(noise * noise) + np.float32(shot_noise) * light)
    image[:] = np.clip(values + np.float32(0.5), 0.0, 255.0).astype(np.uint8)


def _interpolated(rays: Floats, x: Floats, y: Floats) -> Floats:
    """Rays at pixels `x` by `y`, bilinear between corners, shape (n_y, n_x, 2)."""
    column, row = np.floor(x + 0.5).astype(np.intp) + PADDING, np.floor(y + 0.5).astype(np.intp) + PADDING
    right, down = (x + 0.5 + PADDING - column)[:, np.newaxis], (y + 0.5 + PADDING - row)[:, np.newaxis, np.newaxis]
    upper = rays[np.ix_(row, column)] * (1 - right) + rays[np.ix_(row, column + 1)] * right
    lower = rays[np.ix_(row + 1, column)] * (1 - right) + rays[np.ix_(row + 1, column + 1)] * right
    return np.asarray(upper * (1 - down) + lower * down)


def _distances(rays: Floats, place: Floats) -> Floats:
    """Distances [mm] of a ball's centre from rays, shape (n_y, n_x)."""
    along = rays @ place[:2] + place[2]
    return np.asarray(np.sqrt(np.maximum(place @ place - along**2 / ((rays * rays).sum(axis=-1) + 1.0), 0.0)))


def _received(kernel: Floats, places: Floats, n_pixels: int) -> Floats:
    """How much of each sample's light each pixel of a row or column receives, shape (n_pixels, n_samples)."""
    offsets = np.round((places - np.arange(n_pixels)[:, np.newaxis]) * SAMPLES + (len(kernel) - 1) / 2).astype(np.intp)
    is_near = (offsets >= 0) & (offsets < len(kernel))
    return np.where(is_near, kernel[np.clip(offsets, 0, len(kernel) - 1)], 0.0)
