"""Balls of two images: which can be one ball, and where in space it is, with its covariance.

Two balls can be one if both lie in one plane with both cameras. The measure is the first order of the optimal
correction (Sampson), in standard deviations of the balls' centres: for two balls that are one it is normal with
deviation 1, wherever they are and whatever the lens does there.

The point is that of Hartley and Sturm's optimal correction (1997; Gaschler 2011, equations 3.6-3.12): the least shift
of both centres after which their rays meet. Both images are first moved and whitened, so that the measured centres lie
at 0 and their noise is 1 in all directions: the shift is then the most likely one also where the lens has squeezed the
image and where one ball is known better than the other. Corresponding epipolar lines are numbered by t; the sum of
squared distances from both has its minimum at one of six roots.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen._kernels.camera import Pair
from skelgen._kernels.room_points import LEVEL
from skelgen._kernels.small_matrices import block, cross, dot, inverse, plus, set_block, turned, whole
from skelgen.model.arrays import Floats, Ints

NEWTON_STEPS = 12
"""From the root of the linear problem two or three steps are enough; more are never taken where all has stood still."""

STANDS_STILL = 1e-12
"""Relative change of t below which a step of Newton's is rounding."""

SURE = 0.01
"""Squared ratio of the correction to the distance of the epipole below which the root next to 0 is the best of all:
any better line would pass within a tenth of that distance, where the cost has one minimum."""

AT_INFINITY = 1e12
"""A t whose line is that at infinity to rounding: through the epipole, across the way there."""


class View(NamedTuple):
    """What one camera sees: the rays of balls, from `rays_of_pixels`.

    Attributes
    ----------
    rays : ndarray, shape (n_balls, 2)
        Normalised coordinates.
    spread : ndarray, shape (n_balls, 2, 2)
        How their noise spreads them.
    """

    rays: Floats
    spread: Floats


class Geometry(NamedTuple):
    """Where the right camera is, seen from the left one.

    Attributes
    ----------
    rotation : ndarray, shape (3, 3)
        Of right_from_left.
    shift : ndarray, shape (3,), mm
        Of right_from_left.
    essential : ndarray, shape (3, 3)
        x'^T E x = 0 for rays x of the left and x' of the right camera that meet.
    """

    rotation: Floats
    shift: Floats
    essential: Floats


class Triangulation(NamedTuple):
    """Points of pairs of balls, in the left camera's frame.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        NaN where the rays do not meet in front of both cameras.
    covariances : ndarray, shape (n, 3, 3), mm^2
        From the noise in both images; NaN where the point is.
    rays : ndarray, shape (n, 2, 2)
        Normalised coordinates in the left and in the right camera that meet in the point.
    shifts : ndarray, shape (n, 2)
        How far both centres were moved, in their standard deviations; the sum of squares is chi-squared with one degree
        of freedom.
    """

    points: Floats
    covariances: Floats
    rays: Floats
    shifts: Floats


class _Pencil(NamedTuple):
    """The numbers a b c d f f' of equation 3.10."""

    a: float
    b: float
    c: float
    d: float
    f: float
    g: float


@array_kernel
def find_pairs(left: View, right: View, geometry: Geometry, gate: float) -> Ints:
    """Return the pairs of balls that can be one.

    Parameters
    ----------
    left, right : View
        What both cameras see.
    geometry : Geometry
        Of both cameras.
    gate : float
        Pairs farther from the epipolar constraint than so many standard deviations are left out.

    Returns
    -------
    ndarray of intp, shape (n_pairs, 2)
        The left and the right ball, in the order of the left balls, then of the right ones.
    """
    x, x_spread, y, y_spread = left.rays, left.spread, right.rays, right.spread
    in_right, in_left = np.empty((len(x), 3)), np.empty((len(y), 3))  # epipolar lines
    for row in range(3):
        e = geometry.essential
        for i in range(len(x)):
            in_right[i, row] = e[row, 0] * x[i, 0] + e[row, 1] * x[i, 1] + e[row, 2]
        for j in range(len(y)):
            in_left[j, row] = e[0, row] * y[j, 0] + e[1, row] * y[j, 1] + e[2, row]
    pairs, n_pairs = np.empty((4 * (len(x) + len(y)), 2), dtype=np.intp), 0
    for i in range(len(x)):
        for j in range(len(y)):
            residual = in_right[i, 0] * y[j, 0] + in_right[i, 1] * y[j, 1] + in_right[i, 2]
            u = x_spread[i, 0, 0] * in_left[j, 0] + x_spread[i, 1, 0] * in_left[j, 1]
            v = x_spread[i, 0, 1] * in_left[j, 0] + x_spread[i, 1, 1] * in_left[j, 1]
            w = y_spread[j, 0, 0] * in_right[i, 0] + y_spread[j, 1, 0] * in_right[i, 1]
            z = y_spread[j, 0, 1] * in_right[i, 0] + y_spread[j, 1, 1] * in_right[i, 1]
            if residual * residual <= gate * gate * (u * u + v * v + w * w + z * z):
                if n_pairs == len(pairs):
                    larger = np.empty((2 * n_pairs, 2), dtype=np.intp)
                    larger[:n_pairs] = pairs
                    pairs = larger
                pairs[n_pairs, 0], pairs[n_pairs, 1] = i, j
                n_pairs += 1
    return pairs[:n_pairs].copy()


@array_kernel
def triangulate(left: View, right: View, geometry: Geometry, pairs: Ints) -> Triangulation:
    """Return the most likely points of pairs of balls.

    Parameters
    ----------
    left, right : View
        What both cameras see.
    geometry : Geometry
        Of both cameras.
    pairs : ndarray of intp, shape (n, 2)
        The left and the right ball of each.
    """
    x, x_spread, y, y_spread = left.rays, left.spread, right.rays, right.spread
    n = len(pairs)
    points, covariances, rays, shifts = np.empty((n, 3)), np.empty((n, 3, 3)), np.empty((n, 2, 2)), np.empty((n, 2))
    slope, here, at_zero, right_in_left = np.empty((4, 3)), np.eye(3), np.zeros(3), np.zeros(3)
    for axis in range(3):
        for row in range(3):
            right_in_left[axis] -= geometry.rotation[row, axis] * geometry.shift[row]
    for pair in range(n):
        i, j = pairs[pair, 0], pairs[pair, 1]
        ux, uy, f = _epipole(right_in_left, x[i], x_spread[i])
        vx, vy, g = _epipole(geometry.shift, y[j], y_spread[j])
        across = -x_spread[i, 0, 0] * uy + x_spread[i, 0, 1] * ux, -x_spread[i, 1, 0] * uy + x_spread[i, 1, 1] * ux
        beside = -y_spread[j, 0, 0] * vy + y_spread[j, 0, 1] * vx, -y_spread[j, 1, 0] * vy + y_spread[j, 1, 1] * vx
        a, b, c, d = _pencil(x[i], y[j], across, beside, geometry.essential)
        pencil = _Pencil(a, b, c, d, f, g)
        t, is_sure = _root_near_zero(pencil)
        if not is_sure:
            t = _best_root(pencil)
        p, q = a * t + b, c * t + d
        below, below_right = 1.0 + t * t * f * f, p * p + q * q * g * g
        along, aside = t * t * f / below, t / below
        along_right, aside_right = q * q * g / below_right, -p * q / below_right
        first = _moved(x[i], x_spread[i], along * ux - aside * uy, along * uy + aside * ux)
        second = _moved(y[j], y_spread[j], along_right * vx - aside_right * vy, along_right * vy + aside_right * vx)
        rays[pair, 0, 0], rays[pair, 0, 1] = first
        rays[pair, 1, 0], rays[pair, 1, 1] = second
        shifts[pair, 0] = math.sqrt(along * along + aside * aside)
        shifts[pair, 1] = math.sqrt(along_right * along_right + aside_right * aside_right)
        if _meet(first, second, geometry, points[pair]):
            _fill_slope(slope[:2], points[pair], x_spread[i], here, at_zero)
            _fill_slope(slope[2:], points[pair], y_spread[j], geometry.rotation, geometry.shift)
            _invert_normal(slope, covariances[pair])
        else:
            points[pair] = np.nan
            covariances[pair] = np.nan
    return Triangulation(points, covariances, rays, shifts)


@kernel_part
def _epipole(place: Floats, ray: Floats, spread: Floats) -> tuple[float, float, float]:
    """Return the whitened direction from a ball to the other camera's place, and the inverse of its distance."""
    determinant = spread[0, 0] * spread[1, 1] - spread[0, 1] * spread[1, 0]
    off_x, off_y = place[0] - place[2] * ray[0], place[1] - place[2] * ray[1]
    u = (spread[1, 1] * off_x - spread[0, 1] * off_y) / determinant
    v = (spread[0, 0] * off_y - spread[1, 0] * off_x) / determinant
    length = math.sqrt(u * u + v * v)
    return u / length, v / length, place[2] / length


@kernel_part
def _pencil(x: Floats, y: Floats, across: Pair, beside: Pair, essential: Floats) -> tuple[float, float, float, float]:
    """Return a b c d: the lower right corner of the moved, whitened and turned matrix."""
    a = b = c = d = 0.0
    for row in range(3):
        slope = essential[row, 0] * across[0] + essential[row, 1] * across[1]
        line = essential[row, 0] * x[0] + essential[row, 1] * x[1] + essential[row, 2]
        if row < 2:
            a, b = a + beside[row] * slope, b + beside[row] * line
            c, d = c + y[row] * slope, d + y[row] * line
        else:
            c, d = c + slope, d + line
    return a, b, c, d


@kernel_part
def _root_near_zero(pencil: _Pencil) -> tuple[float, bool]:
    """Return a root of equation 3.12 by Newton's method, from the linear problem, and whether it is surely best."""
    a, b, c, d, f, g = pencil
    ff, gg, determinant = f * f, g * g, a * d - b * c
    t, step = -c * d / (b * b + c * c), math.inf
    for _ in range(NEWTON_STEPS):
        p, q = a * t + b, c * t + d
        u, v = p * p + gg * q * q, 1.0 + ff * t * t
        u_slope, v_slope = 2.0 * (a * p + gg * c * q), 2.0 * ff * t
        value = t * u * u - determinant * v * v * p * q
        slope = u * (u + 2.0 * t * u_slope) - determinant * v * (2.0 * v_slope * p * q + v * (a * q + c * p))
        step = value / slope
        t -= step
        if abs(step) <= STANDS_STILL * (1.0 + abs(t)):
            break
    return t, abs(step) <= STANDS_STILL * (1.0 + abs(t)) and _cost(pencil, t) * max(ff, gg) < SURE


@kernel_part
def _cost(pencil: _Pencil, t: float) -> float:
    """Return the sum of squared distances of both centres from the epipolar lines number t."""
    a, b, c, d, f, g = pencil
    p, q = a * t + b, c * t + d
    return t * t / (1.0 + f * f * t * t) + q * q / (p * p + g * g * q * q)


@array_part
def _best_root(pencil: _Pencil) -> float:
    """Return the best of all six roots of equation 3.12 and of the line at infinity."""
    a, b, c, d, f, g = pencil
    ff, gg, determinant = f * f, g * g, a * d - b * c
    u, v, w = a * a + gg * c * c, 2.0 * (a * b + gg * c * d), b * b + gg * d * d  # of p^2 + g^2 q^2, from t^2 on
    k, m, n = a * c, a * d + b * c, b * d  # of p q
    polynomial = np.empty(7, dtype=np.complex128)  # numba's roots are complex only if the coefficients are
    polynomial[0] = -determinant * ff * ff * k
    polynomial[1] = u * u - determinant * ff * ff * m
    polynomial[2] = 2.0 * u * v - determinant * (ff * ff * n + 2.0 * ff * k)
    polynomial[3] = 2.0 * u * w + v * v - determinant * 2.0 * ff * m
    polynomial[4] = 2.0 * v * w - determinant * (2.0 * ff * n + k)
    polynomial[5] = w * w - determinant * m
    polynomial[6] = -determinant * n
    for coefficient in polynomial:
        if not math.isfinite(coefficient.real):
            return math.nan
    best, least = AT_INFINITY, _cost(pencil, AT_INFINITY)
    for root in np.roots(polynomial):
        cost = _cost(pencil, root.real)
        if cost < least:
            best, least = root.real, cost
    return best


@kernel_part
def _moved(ray: Floats, spread: Floats, u: float, v: float) -> Pair:
    """Return a ray after a whitened shift."""
    return ray[0] + spread[0, 0] * u + spread[0, 1] * v, ray[1] + spread[1, 0] * u + spread[1, 1] * v


@kernel_part
def _meet(first: Pair, second: Pair, geometry: Geometry, point: Floats) -> bool:
    """Fill where two rays meet, in the left camera's frame; return whether that is in front of both cameras."""
    turn, shift = geometry.rotation, geometry.shift
    ahead = turned(block(turn, 0, 0), (first[0], first[1], 1.0))
    ray = second[0], second[1], 1.0
    a, b = cross(ray, ahead), cross(ray, (shift[0], shift[1], shift[2]))
    depth = -dot(a, b) / dot(a, a)
    point[0], point[1], point[2] = first[0] * depth, first[1] * depth, depth
    return depth > 0.0 and math.isfinite(depth) and ahead[2] * depth + shift[2] > 0.0


@kernel_part
def _fill_slope(slope: Floats, point: Floats, spread: Floats, turn: Floats, shift: Floats) -> None:
    """Fill the derivative (2, 3) of the whitened coordinates of one camera by the point in the left one's frame."""
    inside = turned(block(turn, 0, 0), (point[0], point[1], point[2]))
    px, py, pz = plus(inside, (shift[0], shift[1], shift[2]))
    determinant = (spread[0, 0] * spread[1, 1] - spread[0, 1] * spread[1, 0]) * pz
    for axis in range(3):
        u, v = turn[0, axis] - turn[2, axis] * px / pz, turn[1, axis] - turn[2, axis] * py / pz
        slope[0, axis] = (spread[1, 1] * u - spread[0, 1] * v) / determinant
        slope[1, axis] = (spread[0, 0] * v - spread[1, 0] * u) / determinant


@kernel_part
def _invert_normal(slope: Floats, out: Floats) -> None:
    """Fill (J^T J)^-1 of a slope J (4, 3)."""
    a = b = c = d = e = f = 0.0
    for row in range(4):
        u, v, w = slope[row, 0], slope[row, 1], slope[row, 2]
        a, b, c, d, e, f = a + u * u, b + u * v, c + u * w, d + v * v, e + v * w, f + w * w
    set_block(out, 0, 0, whole(inverse((a, b, c, d, e, f), LEVEL)))
