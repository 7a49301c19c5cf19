r"""The best rotations of many frames at once, by Horn's quartic instead of an eigensolver: six times as fast.

For moments M the largest eigenvalue of Horn's matrix N is the largest root of

.. math::
    \lambda^4 - 2 \|M\|^2 \lambda^2 - 8 \det(M) \lambda + 2 \|M^T M\|^2 - \|M\|^4,

found by Newton's method from above, and its quaternion a column of the adjugate of :math:`N - \lambda`. One step of
Gauss-Newton on the rotation takes off what rounding has left.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.frames_last import along, dot, inverse_of_symmetric, product, rotation_by, transposed_product
from skelgen.model.arrays import Bools, Floats

LEAST_GAPS = 1e-5
"""Product of the gaps between the largest eigenvalue and the others, for moments of norm 1. Points on one line have
none, a double root that is known to eight digits only; flat limbs are far above."""

MAX_STEPS = 40
ROOT_TOLERANCE = 1e-14
LEAST_SLOPE = 1e-6
"""Newton goes no further than where rounding would rule the slope: at a double root."""

RIDGE = 1e-12

TINY = float(np.finfo(np.float64).tiny)


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
    m = np.ascontiguousarray(np.moveaxis(moments, 0, -1))
    size = np.sqrt(np.einsum("ijf,ijf->f", m, m))
    m = m / np.maximum(size, TINY)
    columns = _adjugate(_horn_matrix(m) - _largest_root(m) * np.eye(4)[:, :, np.newaxis])
    gaps = np.abs(np.einsum("iif->if", columns))
    best = gaps.argmax(axis=0)
    quaternion = np.take_along_axis(columns, best[np.newaxis, np.newaxis], axis=1)[:, 0]
    sure = (size > 0) & (gaps.sum(axis=0) > LEAST_GAPS)
    quaternion = np.where(sure, quaternion, np.array([1.0, 0.0, 0.0, 0.0])[:, np.newaxis])
    w, vector = quaternion[0], quaternion[1:]
    turn = _matrix(w, vector, dot(vector, vector) + w * w)
    return np.ascontiguousarray(np.moveaxis(_polished(turn, m), -1, 0)), np.asarray(sure)


def _largest_root(m: Floats) -> Floats:
    square = transposed_product(m, m)
    determinant = dot(m[0], np.cross(m[1], m[2], axis=0))
    last = 2 * np.einsum("ijf,ijf->f", square, square) - 1.0
    root = np.full(m.shape[2], np.sqrt(3.0))  # no sum of three singular values is above sqrt(3) of their norm
    for _ in range(MAX_STEPS):
        value = ((root * root - 2.0) * root - 8 * determinant) * root + last
        slope = (4 * root * root - 4.0) * root - 8 * determinant
        step = np.maximum(value, 0.0) / np.maximum(slope, LEAST_SLOPE)
        root = root - step
        if step.max(initial=0.0) < ROOT_TOLERANCE:
            break
    return np.asarray(root)


def _horn_matrix(m: Floats) -> Floats:
    n = np.empty((4, 4, m.shape[2]))
    trace = m[0, 0] + m[1, 1] + m[2, 2]
    n[0, 0] = trace
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        n[i + 1, i + 1] = 2 * m[i, i] - trace
        n[0, i + 1] = n[i + 1, 0] = m[k, j] - m[j, k]
        n[i + 1, j + 1] = n[j + 1, i + 1] = m[i, j] + m[j, i]
    return n


def _adjugate(a: Floats) -> Floats:
    """Adjugate of symmetric matrices, shape (4, 4, n_frames), from the minors of two rows each (Laplace)."""
    pairs = ((0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3))
    s = [a[0, i] * a[1, j] - a[1, i] * a[0, j] for i, j in pairs]
    c = [a[2, i] * a[3, j] - a[3, i] * a[2, j] for i, j in pairs]
    out = np.empty_like(a)
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
    return out


def _matrix(w: Floats, vector: Floats, square: Floats) -> Floats:
    """Rotations of quaternions that need not be of length 1, shape (3, 3, n_frames)."""
    x, y, z = vector
    scale = 2.0 / square
    xx, yy, zz, xy, xz, yz = (scale * one for one in (x * x, y * y, z * z, x * y, x * z, y * z))
    wx, wy, wz = (scale * w * one for one in (x, y, z))
    rows = [[1 - yy - zz, xy - wz, xz + wy], [xy + wz, 1 - xx - zz, yz - wx], [xz - wy, yz + wx, 1 - xx - yy]]
    return np.stack([np.stack(row) for row in rows])


def _polished(turn: Floats, m: Floats) -> Floats:
    """One step towards the rotation at which turn^T M is symmetric."""
    inner = transposed_product(turn, m)
    slope = np.stack([inner[2, 1] - inner[1, 2], inner[0, 2] - inner[2, 0], inner[1, 0] - inner[0, 1]])
    bend = -(inner + inner.swapaxes(0, 1)) / 2
    trace = inner[0, 0] + inner[1, 1] + inner[2, 2]
    for axis in range(3):
        bend[axis, axis] += trace
    step = along(inverse_of_symmetric(bend, np.full(m.shape[2], RIDGE)), slope)
    return product(turn, rotation_by(step))
