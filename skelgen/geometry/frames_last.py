"""Small matrices and vectors of many frames, frames last: each operation runs over memory in its order.

Matrices of 3 x 3 one after the other leave most of a processor idle; this is five times as fast as `numpy.matmul`.
"""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats


def product(first: Floats, second: Floats) -> Floats:
    """Return first @ second, shape (3, 3, n_frames)."""
    return np.asarray(np.einsum("ijf,jkf->ikf", first, second))


def transposed_product(first: Floats, second: Floats) -> Floats:
    """Return first^T @ second, shape (3, 3, n_frames)."""
    return np.asarray(np.einsum("jif,jkf->ikf", first, second))


def along(matrix: Floats, vector: Floats) -> Floats:
    """Return matrix @ vector, shape (3, n_frames)."""
    return np.asarray(np.einsum("ijf,jf->if", matrix, vector))


def turned(matrix: Floats, vector: Floats) -> Floats:
    """Return matrix @ vector for one vector, shape (3, n_frames)."""
    return np.asarray(np.einsum("ijf,j->if", matrix, vector))


def dot(first: Floats, second: Floats) -> Floats:
    """Return first . second, shape (n_frames,)."""
    return np.asarray(np.einsum("if,if->f", first, second))


def outer(first: Floats, second: Floats) -> Floats:
    """Return first second^T, shape (3, 3, n_frames)."""
    return np.asarray(first[:, np.newaxis] * second[np.newaxis])


def cross(first: Floats, second: Floats) -> Floats:
    """Return first x second, shape (3, n_frames)."""
    a, b = first, second
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def cross_matrix(vector: Floats) -> Floats:
    """Return the matrices [v]x with [v]x u = v x u, shape (3, 3, n_frames)."""
    out = np.zeros((3, *vector.shape))
    out[0, 1], out[0, 2], out[1, 2] = -vector[2], vector[1], -vector[0]
    out[1, 0], out[2, 0], out[2, 1] = vector[2], -vector[1], vector[0]
    return out


def rotation_by(vector: Floats) -> Floats:
    """Return rotations about vectors by 2 arctan(length / 2), for small vectors their length: no sine is needed.

    The quaternion is (1, v / 2), normalised; a step of a descent may go by any measure of angles. Shape
    (3, 3, n_frames) from (3, n_frames).
    """
    x, y, z = vector
    scale = 1.0 / (1.0 + dot(vector, vector) / 4.0)
    out = outer(vector, vector * (scale / 2.0))
    xx, yy, zz = out[0, 0].copy(), out[1, 1].copy(), out[2, 2].copy()
    out[0, 0], out[1, 1], out[2, 2] = 1.0 - yy - zz, 1.0 - xx - zz, 1.0 - xx - yy
    x, y, z = x * scale, y * scale, z * scale
    out[0, 1] -= z
    out[1, 0] += z
    out[0, 2] += y
    out[2, 0] -= y
    out[1, 2] -= x
    out[2, 1] += x
    return out


def orthonormal(matrix: Floats) -> Floats:
    """Return rotations that are proper to rounding from such that are nearly so: one step of Newton's polar iteration.

    Shape (n_limbs, 3, 3, n_frames).
    """
    square = np.einsum("ljif,ljkf->likf", matrix, matrix)
    return np.asarray(1.5 * matrix - 0.5 * np.einsum("lijf,ljkf->likf", matrix, square))


def inverse_of_symmetric(matrix: Floats, level: Floats) -> Floats:
    """Return (matrix + level)^-1, shape (3, 3, n_frames), by L D L^T.

    Parameters
    ----------
    matrix : ndarray, shape (3, 3, n_frames)
        Symmetric, no eigenvalue below 0 but for rounding.
    level : ndarray, shape (n_frames,)
        Above 0. No pivot of such a sum is below it, whatever rounding makes of it.
    """
    a, b, c, d, e, f = matrix[0, 0], matrix[0, 1], matrix[0, 2], matrix[1, 1], matrix[1, 2], matrix[2, 2]
    first = 1.0 / np.maximum(a + level, level)
    low, lower = b * first, c * first
    second = 1.0 / np.maximum(d + level - low * b, level)
    mixed = e - lower * b
    last = mixed * second
    third = 1.0 / np.maximum(f + level - lower * c - last * mixed, level)
    corner = low * last - lower
    out = np.empty_like(matrix)
    out[2, 2] = third
    out[1, 2] = out[2, 1] = -last * third
    out[0, 2] = out[2, 0] = corner * third
    out[1, 1] = second - last * out[1, 2]
    out[0, 1] = out[1, 0] = -low * second - last * out[0, 2]
    out[0, 0] = first + low * low * second + corner * out[0, 2]
    return out
