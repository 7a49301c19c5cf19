"""The matching of one pair of images, compiled: twin of what `matching` does with `epipolar`, `correction` and others.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.capture.optics.correction import NEWTON_STEPS, STANDS_STILL, SURE
from skelgen.capture.optics.projection import MAX_NEWTON_STEPS, NEWTON_TOLERANCE
from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats, Ints

Pair = tuple[float, float]


@compile_function
def rays(seen: tuple[Floats, Floats, Floats]) -> tuple[Floats, Floats]:
    """Undistorted normalised coordinates (n, 2), and their derivative by the pixel times its deviation (n, 2, 2)."""
    pixels, noise, numbers = seen
    fx, fy, cx, cy, skew, k1, k2, p1, p2, k3, fold = numbers
    out, spread = np.empty((len(pixels), 2)), np.empty((len(pixels), 2, 2))
    for ball in range(len(pixels)):
        wanted_y = (pixels[ball, 1] - cy) / fy
        wanted_x = (pixels[ball, 0] - cx - skew * wanted_y) / fx
        x, y, largest = wanted_x, wanted_y, 1.0
        a, b, d = 1.0, 0.0, 1.0
        for step in range(MAX_NEWTON_STEPS + 1):
            square = x * x + y * y
            radial = 1.0 + square * (k1 + square * (k2 + square * k3))
            growth = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
            a = radial + growth * x * x + 2.0 * p1 * y + 6.0 * p2 * x
            d = radial + growth * y * y + 6.0 * p1 * y + 2.0 * p2 * x
            b = growth * x * y + 2.0 * p1 * x + 2.0 * p2 * y
            if largest <= NEWTON_TOLERANCE or step == MAX_NEWTON_STEPS:
                break
            off_x = x * radial + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x) - wanted_x
            off_y = y * radial + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y - wanted_y
            step_x, step_y = (d * off_x - b * off_y) / (a * d - b * b), (a * off_y - b * off_x) / (a * d - b * b)
            x, y, largest = x - step_x, y - step_y, max(abs(step_x), abs(step_y))
        if not (largest <= NEWTON_TOLERANCE * MAX_NEWTON_STEPS and x * x + y * y < fold):
            x = y = math.nan
        out[ball, 0], out[ball, 1] = x, y
        scale = noise[ball] / (a * d - b * b)  # the inverse of focal lengths times the slope of the lens
        spread[ball, 0, 0], spread[ball, 0, 1] = d * scale / fx, (-b - d * skew / fx) * scale / fy
        spread[ball, 1, 0], spread[ball, 1, 1] = -b * scale / fx, (a + b * skew / fx) * scale / fy
    return out, spread


@compile_function
def lines(points: Floats, matrix: Floats) -> Floats:
    """Epipolar lines, matrix times (x, y, 1), shape (n, 3)."""
    out = np.empty((len(points), 3))
    for point in range(len(points)):
        for row in range(3):
            out[point, row] = matrix[row, 0] * points[point, 0] + matrix[row, 1] * points[point, 1] + matrix[row, 2]
    return out


@compile_function
def near_pairs(
    in_right: Floats, in_left: Floats, x: Floats, x_spread: Floats, y: Floats, y_spread: Floats, gate: float
) -> Ints:
    """Pairs whose Sampson distance is within the gate, in the order of the left balls, shape (n, 2)."""
    out, n_pairs = np.empty((4 * (len(x) + len(y)), 2), dtype=np.intp), 0
    for i in range(len(x)):
        for j in range(len(y)):
            residual = in_right[i, 0] * y[j, 0] + in_right[i, 1] * y[j, 1] + in_right[i, 2]
            u = x_spread[i, 0, 0] * in_left[j, 0] + x_spread[i, 1, 0] * in_left[j, 1]
            v = x_spread[i, 0, 1] * in_left[j, 0] + x_spread[i, 1, 1] * in_left[j, 1]
            w = y_spread[j, 0, 0] * in_right[i, 0] + y_spread[j, 1, 0] * in_right[i, 1]
            z = y_spread[j, 0, 1] * in_right[i, 0] + y_spread[j, 1, 1] * in_right[i, 1]
            if residual * residual <= gate * gate * (u * u + v * v + w * w + z * z):
                if n_pairs == len(out):
                    larger = np.empty((2 * n_pairs, 2), dtype=np.intp)
                    larger[:n_pairs] = out
                    out = larger
                out[n_pairs, 0], out[n_pairs, 1] = i, j
                n_pairs += 1
    return out[:n_pairs]


@compile_function
def to_epipole(x: float, y: float, z: float, ray: Floats, spread: Floats) -> tuple[float, float, float]:
    """Whitened direction from a ball to the epipole, and the inverse of its distance."""
    determinant = spread[0, 0] * spread[1, 1] - spread[0, 1] * spread[1, 0]
    off_x, off_y = x - z * ray[0], y - z * ray[1]
    u = (spread[1, 1] * off_x - spread[0, 1] * off_y) / determinant
    v = (spread[0, 0] * off_y - spread[1, 0] * off_x) / determinant
    length = math.sqrt(u * u + v * v)
    return u / length, v / length, z / length


@compile_function
def pencil(
    x: Floats, x_spread: Floats, y: Floats, y_spread: Floats, turn: Floats, shift: Floats, essential: Floats
) -> tuple[float, float, float, float, float, float, float, float, float, float]:
    """Numbers a b c d f f' of equation 3.10, and both whitened directions to the epipoles."""
    ex = -(turn[0, 0] * shift[0] + turn[1, 0] * shift[1] + turn[2, 0] * shift[2])
    ey = -(turn[0, 1] * shift[0] + turn[1, 1] * shift[1] + turn[2, 1] * shift[2])
    ez = -(turn[0, 2] * shift[0] + turn[1, 2] * shift[1] + turn[2, 2] * shift[2])
    ux, uy, f = to_epipole(ex, ey, ez, x, x_spread)
    vx, vy, g = to_epipole(shift[0], shift[1], shift[2], y, y_spread)
    across = -x_spread[0, 0] * uy + x_spread[0, 1] * ux, -x_spread[1, 0] * uy + x_spread[1, 1] * ux
    beside = -y_spread[0, 0] * vy + y_spread[0, 1] * vx, -y_spread[1, 0] * vy + y_spread[1, 1] * vx
    a = b = c = d = 0.0
    for row in range(3):
        slope = essential[row, 0] * across[0] + essential[row, 1] * across[1]
        line = essential[row, 0] * x[0] + essential[row, 1] * x[1] + essential[row, 2]
        if row < 2:
            a, b = a + beside[row] * slope, b + beside[row] * line
            c, d = c + y[row] * slope, d + y[row] * line
        else:
            c, d = c + slope, d + line
    return a, b, c, d, f, g, ux, uy, vx, vy


@compile_function
def root_near_zero(a: float, b: float, c: float, d: float, f: float, g: float) -> tuple[float, bool]:
    """Newton's method on equation 3.12, and whether its root is sure to be the best."""
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
    p, q = a * t + b, c * t + d
    cost = t * t / (1.0 + ff * t * t) + q * q / (p * p + gg * q * q)
    return t, abs(step) <= STANDS_STILL * (1.0 + abs(t)) and cost * max(ff, gg) < SURE


@compile_function
def moved(ray: Floats, spread: Floats, u: float, v: float) -> Pair:
    """A ray after a whitened shift."""
    return ray[0] + spread[0, 0] * u + spread[0, 1] * v, ray[1] + spread[1, 0] * u + spread[1, 1] * v


@compile_function
def meet(first: Pair, second: Pair, turn: Floats, shift: Floats, out: Floats) -> bool:
    """Where two rays meet, in the left camera's frame; whether that is in front of both cameras."""
    x = turn[0, 0] * first[0] + turn[0, 1] * first[1] + turn[0, 2]
    y = turn[1, 0] * first[0] + turn[1, 1] * first[1] + turn[1, 2]
    z = turn[2, 0] * first[0] + turn[2, 1] * first[1] + turn[2, 2]
    ax, ay, az = second[1] * z - y, x - second[0] * z, second[0] * y - second[1] * x
    bx, by = second[1] * shift[2] - shift[1], shift[0] - second[0] * shift[2]
    bz = second[0] * shift[1] - second[1] * shift[0]
    depth = -(ax * bx + ay * by + az * bz) / (ax * ax + ay * ay + az * az)
    out[0], out[1], out[2] = first[0] * depth, first[1] * depth, depth
    return depth > 0.0 and math.isfinite(depth) and z * depth + shift[2] > 0.0


@compile_function
def fill_slope(out: Floats, point: Floats, spread: Floats, turn: Floats, shift: Floats) -> None:
    """Derivative (2, 3) of the whitened coordinates of one camera by the point in the left one's frame."""
    px = turn[0, 0] * point[0] + turn[0, 1] * point[1] + turn[0, 2] * point[2] + shift[0]
    py = turn[1, 0] * point[0] + turn[1, 1] * point[1] + turn[1, 2] * point[2] + shift[1]
    pz = turn[2, 0] * point[0] + turn[2, 1] * point[1] + turn[2, 2] * point[2] + shift[2]
    determinant = (spread[0, 0] * spread[1, 1] - spread[0, 1] * spread[1, 0]) * pz
    for axis in range(3):
        u, v = turn[0, axis] - turn[2, axis] * px / pz, turn[1, axis] - turn[2, axis] * py / pz
        out[0, axis] = (spread[1, 1] * u - spread[0, 1] * v) / determinant
        out[1, axis] = (spread[0, 0] * v - spread[1, 0] * u) / determinant


@compile_function
def invert_normal(slope: Floats, out: Floats) -> None:
    """(J^T J)^-1 of a slope (4, 3), by cofactors."""
    a = b = c = d = e = f = 0.0
    for row in range(4):
        u, v, w = slope[row, 0], slope[row, 1], slope[row, 2]
        a, b, c, d, e, f = a + u * u, b + u * v, c + u * w, d + v * v, e + v * w, f + w * w
    scale = 1.0 / (a * (d * f - e * e) + b * (c * e - b * f) + c * (b * e - c * d))
    out[0, 0], out[1, 1], out[2, 2] = (d * f - e * e) * scale, (a * f - c * c) * scale, (a * d - b * b) * scale
    out[0, 1] = out[1, 0] = (c * e - b * f) * scale
    out[0, 2] = out[2, 0] = (b * e - c * d) * scale
    out[1, 2] = out[2, 1] = (b * c - a * e) * scale


@compile_function
def match(
    left: tuple[Floats, Floats, Floats],
    right: tuple[Floats, Floats, Floats],
    turn: Floats,
    shift: Floats,
    essential: Floats,
    gate: float,
) -> tuple[Ints, Floats, Floats, Floats, bool]:
    """Return pairs of balls (n, 2), points (n, 3) and covariances (n, 3, 3) in the left camera's frame, shifts (n,).

    The last value is false if a pair lies next to an epipole, where the twin must look at all roots.

    Parameters
    ----------
    left, right : tuple
        Of each camera: pixels (n_balls, 2), their standard deviations (n_balls,), and the eleven numbers of
        `camera_numbers`.
    turn, shift : ndarray, shape (3, 3) and (3,), mm
        right_from_left.
    essential : ndarray, shape (3, 3)
        See `essential_matrix`.
    gate : float
        See `match_and_triangulate`.
    """
    x, x_spread = rays(left)
    y, y_spread = rays(right)
    lines_in_right, lines_in_left = lines(x, essential), lines(y, essential.T)
    pairs = near_pairs(lines_in_right, lines_in_left, x, x_spread, y, y_spread, gate)
    points, covariances, shifts = np.empty((len(pairs), 3)), np.empty((len(pairs), 3, 3)), np.empty(len(pairs))
    slope, here, at_zero, n_found = np.empty((4, 3)), np.eye(3), np.zeros(3), 0
    for pair in range(len(pairs)):
        i, j = pairs[pair, 0], pairs[pair, 1]
        a, b, c, d, f, g, ux, uy, vx, vy = pencil(x[i], x_spread[i], y[j], y_spread[j], turn, shift, essential)
        t, is_sure = root_near_zero(a, b, c, d, f, g)
        if not is_sure:
            return pairs, points, covariances, shifts, False
        p, q = a * t + b, c * t + d
        below, below_right = 1.0 + t * t * f * f, p * p + q * q * g * g
        along, aside = t * t * f / below, t / below
        along_right, aside_right = q * q * g / below_right, -p * q / below_right
        first = moved(x[i], x_spread[i], along * ux - aside * uy, along * uy + aside * ux)
        second = moved(y[j], y_spread[j], along_right * vx - aside_right * vy, along_right * vy + aside_right * vx)
        if not meet(first, second, turn, shift, points[n_found]):
            continue
        fill_slope(slope[:2], points[n_found], x_spread[i], here, at_zero)
        fill_slope(slope[2:], points[n_found], y_spread[j], turn, shift)
        invert_normal(slope, covariances[n_found])
        shifts[n_found] = math.sqrt(
            (along**2 + aside**2) * left[1][i] ** 2 + (along_right**2 + aside_right**2) * right[1][j] ** 2
        )
        pairs[n_found, 0], pairs[n_found, 1] = i, j
        n_found += 1
    return pairs[:n_found], points[:n_found], covariances[:n_found], shifts[:n_found], True
