"""Hartley and Sturm's optimal correction: the least shift of two centres after which their rays meet.

Both images are first moved and whitened, so that the measured centres lie at 0 and their noise is 1 in all directions:
the shift is then the most likely one also where the lens has squeezed the image and where one ball is known better
than the other. Corresponding epipolar lines are numbered by t; the sum of squared distances from both has its minimum
at one of six roots (Hartley and Sturm 1997; Gaschler 2011, equations 3.6-3.12).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.capture.optics.epipolar import Rays, homogeneous
from skelgen.model.arrays import Bools, Floats

NEWTON_STEPS = 12
"""From the root of the linear problem two or three steps are enough; more are never taken where all has stood still."""

STANDS_STILL = 1e-12
"""Relative change of t below which a step of Newton's is rounding."""

SURE = 0.01
"""Squared ratio of the correction to the distance of the epipole below which the root next to 0 is the best of all:
any better line would pass within a tenth of that distance, where the cost has one minimum."""

INFINITE = 1e12
"""A t whose line is that at infinity to rounding: through the epipole, across the way there."""


class Corrected(NamedTuple):
    """Corrected rays and what they cost.

    Attributes
    ----------
    left, right : ndarray, shape (n, 2)
        Normalised coordinates whose rays meet.
    left_shift, right_shift : ndarray, shape (n,)
        Length of the shifts in standard deviations; the sum of squares is chi-square with one degree of freedom.
    """

    left: Floats
    right: Floats
    left_shift: Floats
    right_shift: Floats


class _Pencil(NamedTuple):
    """The numbers a b c d f f' of equation 3.10, each of shape (n,)."""

    a: Floats
    b: Floats
    c: Floats
    d: Floats
    f: Floats
    g: Floats


def correct(essential: Floats, epipoles: tuple[Floats, Floats], left: Rays, right: Rays) -> Corrected:
    """Return the most likely rays that meet, given pairs of rays that nearly do.

    Parameters
    ----------
    essential : ndarray, shape (3, 3)
        x'^T E x = 0 for rays that meet.
    epipoles : tuple of ndarray, each of shape (3,)
        The other camera's place in the frame of the left and of the right camera, at any scale.
    left, right : Rays
        Pairs, the n-th with the n-th.
    """
    axis, across, f = _turned(epipoles[0], left)
    axis_right, across_right, g = _turned(epipoles[1], right)
    pencil = _pencil(essential, left, right, across, across_right, f, g)
    t, sure = _root_near_zero(pencil)
    for index in np.flatnonzero(~sure):
        t[index] = _best_root(_Pencil(*(values[index] for values in pencil)))
    p, q = pencil.a * t + pencil.b, pencil.c * t + pencil.d
    along, aside = _over(t * t * f, t, 1.0 + t * t * f * f)
    along_right, aside_right = _over(q * q * g, -p * q, p * p + q * q * g * g)
    return Corrected(
        left.normalised + _spread(left, along[:, np.newaxis] * axis + aside[:, np.newaxis] * across),
        right.normalised
        + _spread(right, along_right[:, np.newaxis] * axis_right + aside_right[:, np.newaxis] * across_right),
        np.hypot(along, aside),
        np.hypot(along_right, aside_right),
    )


def _turned(epipole: Floats, rays: Rays) -> tuple[Floats, Floats, Floats]:
    """Whitened direction to the epipole, the direction across it, both (n, 2), and f (n,) with the epipole at 1 / f."""
    a, b, c, d = rays.spread[:, 0, 0], rays.spread[:, 0, 1], rays.spread[:, 1, 0], rays.spread[:, 1, 1]
    x = epipole[0] - epipole[2] * rays.normalised[:, 0]
    y = epipole[1] - epipole[2] * rays.normalised[:, 1]
    determinant = a * d - b * c
    x, y = (d * x - b * y) / determinant, (a * y - c * x) / determinant
    length = np.hypot(x, y)
    x, y = x / length, y / length
    return np.stack([x, y], axis=1), np.stack([-y, x], axis=1), epipole[2] / length


def _pencil(
    essential: Floats, left: Rays, right: Rays, across: Floats, across_right: Floats, f: Floats, g: Floats
) -> _Pencil:
    """The moved, whitened and turned matrix; only its lower right corner is needed."""
    lines = homogeneous(left.normalised) @ essential.T
    slopes = _spread(left, across) @ essential[:, :2].T
    aside, here = _spread(right, across_right), homogeneous(right.normalised)
    return _Pencil(
        (aside * slopes[:, :2]).sum(axis=1),
        (aside * lines[:, :2]).sum(axis=1),
        (here * slopes).sum(axis=1),
        (here * lines).sum(axis=1),
        f,
        g,
    )


def _spread(rays: Rays, whitened: Floats) -> Floats:
    """Normalised shifts of whitened ones, shape (n, 2)."""
    return np.asarray((rays.spread @ whitened[..., np.newaxis])[..., 0])


def _over(along: Floats, aside: Floats, divisor: Floats) -> tuple[Floats, Floats]:
    return along / divisor, aside / divisor


def _root_near_zero(pencil: _Pencil) -> tuple[Floats, Bools]:
    """Newton's method on equation 3.12 from the root of the linear problem, and where that is sure to be the best."""
    a, b, c, d, f, g = pencil
    ff, gg, determinant = f * f, g * g, a * d - b * c
    t = -c * d / (b * b + c * c)
    for _ in range(NEWTON_STEPS):
        p, q = a * t + b, c * t + d
        u, v = p * p + gg * q * q, 1.0 + ff * t * t
        u_slope, v_slope = 2.0 * (a * p + gg * c * q), 2.0 * ff * t
        value = t * u * u - determinant * v * v * p * q
        slope = u * (u + 2.0 * t * u_slope) - determinant * v * (2.0 * v_slope * p * q + v * (a * q + c * p))
        step = value / slope
        t = t - step
        if not (np.abs(step) > STANDS_STILL * (1.0 + np.abs(t))).any():
            break
    still = np.abs(step) <= STANDS_STILL * (1.0 + np.abs(t))
    return t, still & (_cost(pencil, t) * np.maximum(ff, gg) < SURE)


def _cost(pencil: _Pencil, t: Floats) -> Floats:
    """Sum of squared distances of both centres from the epipolar lines number t."""
    a, b, c, d, f, g = pencil
    p, q = a * t + b, c * t + d
    return np.asarray(t * t / (1.0 + f * f * t * t) + q * q / (p * p + g * g * q * q))


def _best_root(pencil: _Pencil) -> float:
    """Take the best of all six roots of equation 3.12 and of the line at infinity, for one pair."""
    a, b, c, d, f, g = (float(value) for value in pencil)
    p, q, t = np.poly1d([a, b]), np.poly1d([c, d]), np.poly1d([1.0, 0.0])
    u, v = p * p + g * g * q * q, np.poly1d([f * f, 0.0, 1.0])
    roots = np.roots((t * u * u - (a * d - b * c) * v * v * p * q).coeffs)
    tried = np.append(roots.real, INFINITE)
    return float(tried[np.argmin(_cost(pencil, tried))])
