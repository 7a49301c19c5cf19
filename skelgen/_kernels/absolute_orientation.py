r"""Moments of points over frames, and the rotations that fit them best, by Horn's quartic.

For moments M the largest eigenvalue of Horn's matrix N is the largest root of

.. math::
    \lambda^4 - 2 \|M\|^2 \lambda^2 - 8 \det(M) \lambda + 2 \|M^T M\|^2 - \|M\|^4,

found by Newton's method from above, and its quaternion a column of the adjugate of :math:`N - \lambda`. One step of
Gauss-Newton on the rotation takes off what rounding has left.

"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.small_matrices import TINY
from skelgen.model.arrays import Bools, Floats

LEAST_GAPS = 1e-5
"""Product of the gaps between the largest eigenvalue and the others, for moments of norm 1. Points on one line have
none, a double root that is known to eight digits only; flat limbs are far above."""

MAX_STEPS = 40
ROOT_TOLERANCE = 1e-14
LEAST_SLOPE = 1e-6
"""Newton goes no further than where rounding would rule the slope: at a double root."""

RIDGE = 1e-12

N_ROOM = 6
"""Matrices of room that `write_rotations` works in."""


def moments_of(source: Floats, target: Floats, seen: Bools) -> tuple[Floats, Floats, Floats, Floats]:
    """Return the moments of two sets of points about their centres, both centres, and how many points are seen.

    Parameters
    ----------
    source : ndarray, shape (1 or n_frames, n_points, 3), mm
        Points in the frame of a body.
    target : ndarray, shape (n_frames, n_points, 3), mm
        The same points in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which count.

    Returns
    -------
    tuple of ndarray
        Shapes (n_frames, 3, 3), (n_frames, 3), (n_frames, 3) and (n_frames,). Centres of no points are NaN.
    """
    n_frames = len(seen)
    moments, centres, count = np.zeros((n_frames, 3, 3)), np.zeros((2, n_frames, 3)), np.zeros(n_frames)
    _add_moments(source, target, seen, moments, centres, count)
    return moments, centres[0], centres[1], count


@kernel
def _add_moments(source: Floats, target: Floats, seen: Bools, moments: Floats, centres: Floats, count: Floats) -> None:
    for frame in range(seen.shape[0]):
        own = frame % len(source)
        for point in range(seen.shape[1]):
            if seen[frame, point]:
                count[frame] += 1.0
                for i in range(3):
                    centres[0, frame, i] += source[own, point, i]
                    centres[1, frame, i] += target[frame, point, i]
        for i in range(3):
            centres[0, frame, i] /= count[frame]
            centres[1, frame, i] /= count[frame]
        for point in range(seen.shape[1]):
            if seen[frame, point]:
                for i in range(3):
                    outer = target[frame, point, i] - centres[1, frame, i]
                    for j in range(3):
                        moments[frame, i, j] += outer * (source[own, point, j] - centres[0, frame, j])


def moments_about(source: Floats, target: Floats, centres: Floats, seen: Bools) -> Floats:
    """Return the moments of two sets of points about centres that coincide, shape (n_frames, 3, 3).

    Parameters
    ----------
    source : ndarray, shape (n_points, 3), mm
        Points from the centre, in the frame of a body.
    target : ndarray, shape (n_frames, n_points, 3), mm
        The same points in the world.
    centres : ndarray, shape (n_frames, 3), mm
        Where the centre is in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which points count.
    """
    moments = np.zeros((len(target), 3, 3))
    _add_moments_about(source, target, centres, seen, moments)
    return moments


@kernel
def _add_moments_about(source: Floats, target: Floats, centres: Floats, seen: Bools, moments: Floats) -> None:
    for frame in range(len(target)):
        for point in range(len(source)):
            if seen[frame, point]:
                for i in range(3):
                    outer = target[frame, point, i] - centres[frame, i]
                    for j in range(3):
                        moments[frame, i, j] += outer * source[point, j]


def means_in_body(poses: Floats, places: Floats, seen: Bools) -> Floats:
    """Return the mean of each point in the frame of a body, shape (n_points, 3), mm; NaN for points never seen.

    Parameters
    ----------
    poses : ndarray, shape (n_frames, 4, 4)
        world_from_body.
    places : ndarray, shape (n_frames, n_points, 3), mm
        The points in the world.
    seen : ndarray of bool, shape (n_frames, n_points)
        Which count.
    """
    means = np.zeros((seen.shape[1], 3))
    _add_means_in_body(poses, places, seen, means, np.zeros(len(means)))
    return means


@kernel
def _add_means_in_body(poses: Floats, places: Floats, seen: Bools, means: Floats, count: Floats) -> None:
    for frame in range(len(seen)):
        for point in range(len(means)):
            if seen[frame, point]:
                count[point] += 1.0
                x = places[frame, point, 0] - poses[frame, 0, 3]
                y = places[frame, point, 1] - poses[frame, 1, 3]
                z = places[frame, point, 2] - poses[frame, 2, 3]
                for i in range(3):
                    means[point, i] += poses[frame, 0, i] * x + poses[frame, 1, i] * y + poses[frame, 2, i] * z
    for point in range(len(means)):
        for i in range(3):
            means[point, i] /= count[point]


def fast_rotations(moments: Floats) -> tuple[Floats, Bools]:
    """Return the rotations R that maximise trace(R^T M), and where they can be trusted.

    Parameters
    ----------
    moments : ndarray, shape (n_frames, 3, 3)
        M = sum of (target point) (source point)^T.

    Returns
    -------
    tuple of ndarray, shapes (n_frames, 3, 3) and (n_frames,)
        Where the second is False, many rotations are nearly as good as the best, and any is given.
    """
    turns, sure = np.empty(moments.shape), np.empty(len(moments), dtype=np.bool_)
    write_rotations(moments, np.empty((N_ROOM, 4, 4)), turns, sure)
    return turns, sure


@kernel
def write_rotations(moments: Floats, room: Floats, turns: Floats, sure: Bools) -> None:
    """Write what `fast_rotations` returns.

    Parameters
    ----------
    moments : ndarray, shape (n_frames, 3, 3)
        Of the points.
    room : ndarray, shape (6, 4, 4)
        Room to work in.
    turns, sure : ndarray, shapes (n_frames, 3, 3) and (n_frames,)
        Receive the results.
    """
    n, columns, m, turn, inner, step = room[0], room[1], room[2], room[3], room[4], room[5]
    for frame in range(len(moments)):
        size = 0.0
        for i in range(3):
            for j in range(3):
                size += moments[frame, i, j] ** 2
        size = math.sqrt(size)
        for i in range(3):
            for j in range(3):
                m[i, j] = moments[frame, i, j] / max(size, TINY)
        _fill_horn_matrix(n, m, _largest_root(m))
        _fill_adjugate(columns, n)
        best, gaps = 0, 0.0
        for i in range(4):
            gaps += abs(columns[i, i])
            if abs(columns[i, i]) > abs(columns[best, best]):
                best = i
        sure[frame] = size > 0.0 and gaps > LEAST_GAPS
        if sure[frame]:
            _fill_matrix(turn, columns[0, best], columns[1, best], columns[2, best], columns[3, best])
        else:
            _fill_matrix(turn, 1.0, 0.0, 0.0, 0.0)
        _polish(turn, m, inner, step)
        for i in range(3):
            for j in range(3):
                turns[frame, i, j] = turn[i, 0] * step[0, j] + turn[i, 1] * step[1, j] + turn[i, 2] * step[2, j]


@kernel_part
def _largest_root(m: Floats) -> float:
    last = -1.0
    for i in range(3):
        for j in range(3):
            last += 2.0 * (m[0, i] * m[0, j] + m[1, i] * m[1, j] + m[2, i] * m[2, j]) ** 2
    determinant = (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        + m[0, 1] * (m[1, 2] * m[2, 0] - m[1, 0] * m[2, 2])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )
    root = math.sqrt(3.0)
    for _ in range(MAX_STEPS):
        value = ((root * root - 2.0) * root - 8.0 * determinant) * root + last
        slope = (4.0 * root * root - 4.0) * root - 8.0 * determinant
        step = max(value, 0.0) / max(slope, LEAST_SLOPE)
        root -= step
        if step < ROOT_TOLERANCE:
            break
    return root


@kernel_part
def _fill_horn_matrix(n: Floats, m: Floats, root: float) -> None:
    """Write Horn's matrix minus a root on its diagonal."""
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    n[0, 0] = trace - root
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        n[i + 1, i + 1] = 2.0 * m[i, i] - trace - root
        n[0, i + 1] = n[i + 1, 0] = m[k, j] - m[j, k]
        n[i + 1, j + 1] = n[j + 1, i + 1] = m[i, j] + m[j, i]


@kernel_part
def _minors(a: Floats, first: int, second: int) -> tuple[float, float, float, float, float, float]:
    """Minors of two rows: of the columns 01, 02, 03, 12, 13, 23."""
    return (
        a[first, 0] * a[second, 1] - a[second, 0] * a[first, 1],
        a[first, 0] * a[second, 2] - a[second, 0] * a[first, 2],
        a[first, 0] * a[second, 3] - a[second, 0] * a[first, 3],
        a[first, 1] * a[second, 2] - a[second, 1] * a[first, 2],
        a[first, 1] * a[second, 3] - a[second, 1] * a[first, 3],
        a[first, 2] * a[second, 3] - a[second, 2] * a[first, 3],
    )


@kernel_part
def _fill_adjugate(out: Floats, a: Floats) -> None:
    """Write the adjugate of a symmetric matrix (4 x 4), from the minors of two rows each (Laplace)."""
    s, c = _minors(a, 0, 1), _minors(a, 2, 3)
    out[0, 0] = a[1, 1] * c[5] - a[1, 2] * c[4] + a[1, 3] * c[3]
    out[1, 1] = a[0, 0] * c[5] - a[0, 2] * c[2] + a[0, 3] * c[1]
    out[2, 2] = a[3, 0] * s[4] - a[3, 1] * s[2] + a[3, 3] * s[0]
    out[3, 3] = a[2, 0] * s[3] - a[2, 1] * s[1] + a[2, 2] * s[0]
    out[0, 1] = out[1, 0] = -a[0, 1] * c[5] + a[0, 2] * c[4] - a[0, 3] * c[3]
    out[0, 2] = out[2, 0] = a[3, 1] * s[5] - a[3, 2] * s[4] + a[3, 3] * s[3]
    out[0, 3] = out[3, 0] = -a[2, 1] * s[5] + a[2, 2] * s[4] - a[2, 3] * s[3]
    out[1, 2] = out[2, 1] = -a[3, 0] * s[5] + a[3, 2] * s[2] - a[3, 3] * s[1]
    out[1, 3] = out[3, 1] = a[2, 0] * s[5] - a[2, 2] * s[2] + a[2, 3] * s[1]
    out[2, 3] = out[3, 2] = -a[2, 0] * s[4] + a[2, 1] * s[2] - a[2, 3] * s[0]


@kernel_part
def _fill_matrix(out: Floats, w: float, x: float, y: float, z: float) -> None:
    """Write the rotation of a quaternion that need not be of length 1."""
    scale = 2.0 / (w * w + x * x + y * y + z * z)
    out[0, 0], out[0, 1], out[0, 2] = 1.0 - scale * (y * y + z * z), scale * (x * y - w * z), scale * (x * z + w * y)
    out[1, 0], out[1, 1], out[1, 2] = scale * (x * y + w * z), 1.0 - scale * (x * x + z * z), scale * (y * z - w * x)
    out[2, 0], out[2, 1], out[2, 2] = scale * (x * z - w * y), scale * (y * z + w * x), 1.0 - scale * (x * x + y * y)


@kernel_part
def _polish(turn: Floats, m: Floats, inner: Floats, step: Floats) -> None:
    """Write the step from a rotation towards that at which `inner`, turn^T M, is symmetric."""
    for i in range(3):
        for j in range(3):
            inner[i, j] = turn[0, i] * m[0, j] + turn[1, i] * m[1, j] + turn[2, i] * m[2, j]
    px, py, pz = inner[2, 1] - inner[1, 2], inner[0, 2] - inner[2, 0], inner[1, 0] - inner[0, 1]
    b, c, e = -(inner[0, 1] + inner[1, 0]) / 2, -(inner[0, 2] + inner[2, 0]) / 2, -(inner[1, 2] + inner[2, 1]) / 2
    first = 1.0 / max(inner[1, 1] + inner[2, 2] + RIDGE, RIDGE)  # L D L^T of the trace minus the symmetric part
    low, lower = b * first, c * first
    second = 1.0 / max(inner[0, 0] + inner[2, 2] + RIDGE - low * b, RIDGE)
    last = (e - lower * b) * second
    third = 1.0 / max(inner[0, 0] + inner[1, 1] + RIDGE - lower * c - last * (e - lower * b), RIDGE)
    py -= low * px
    pz -= lower * px + last * py
    z = pz * third
    y = py * second - last * z
    x = px * first - low * y - lower * z
    _fill_matrix(step, 2.0, x, y, z)
