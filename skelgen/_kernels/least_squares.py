"""Least squares: matrices in arrays, their factors and axes, and the elimination of the unknowns of frames."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.small_matrices import TINY
from skelgen.model.arrays import Floats

MAX_SWEEPS = 30

JACOBI_TOLERANCE = 1e-31
"""Of the sum of squares: what is left aside of the diagonal is less than rounding."""

RANK_TOLERANCE = 1e-12
"""Directions whose information is below this part of the largest are not determined: double precision ends there."""

PIVOT = 1e-13
"""Of a variance: what is left of it beside others is at least this; rounding may leave less, or negative numbers."""

OWN_RIDGE = 1e-14
"""Of a frame's own normal matrix: keeps angles that nothing measures in place."""


class Linearised(NamedTuple):
    """A linearised problem, as in `schur_complement.LinearisedProblem`.

    Attributes
    ----------
    residuals : ndarray, shape (n_frames, n_rows)
        In standard deviations.
    constants : ndarray, shape (n_frames, n_rows, n_constants)
        Derivatives by the constants.
    angles : ndarray, shape (n_frames, n_rows, n_angles)
        Derivatives by the frames' own unknowns.
    """

    residuals: Floats
    constants: Floats
    angles: Floats


class Eliminated(NamedTuple):
    """A problem without the frames' own unknowns.

    Attributes
    ----------
    inverse : ndarray, shape (n_frames, n_angles, n_angles)
        Inverse normal matrices of the frames' own unknowns.
    follow : ndarray, shape (n_frames, n_angles, n_constants)
        Derivatives of these by the constants.
    alone : ndarray, shape (n_frames, n_angles)
        What they are where the constants stay.
    reduced : ndarray, shape (n_frames, n_rows, n_constants)
        Derivatives of the residuals that they leave by the constants.
    left : ndarray, shape (n_frames, n_rows)
        These residuals.
    normal : ndarray, shape (n_constants, n_constants)
        Normal matrix of the constants.
    gradient : ndarray, shape (n_constants,)
        Right-hand side.
    """

    inverse: Floats
    follow: Floats
    alone: Floats
    reduced: Floats
    left: Floats
    normal: Floats
    gradient: Floats


def whitened(covariances: Floats) -> Floats:
    """Return matrices W with W^T W = covariance^-1, shape (n_frames, n, n)."""
    out = np.empty(covariances.shape)
    _whiten(covariances.copy(), out)
    return out


@kernel
def _whiten(covariances: Floats, out: Floats) -> None:
    for frame in range(len(out)):
        write_inverse_root(covariances[frame], out[frame])


def eliminate(residuals: Floats, constants: Floats, angles: Floats) -> Eliminated:
    """Take the frames' own unknowns out of a least squares problem.

    Parameters
    ----------
    residuals, constants, angles : ndarray
        See `schur_complement.LinearisedProblem`.
    """
    n_frames, n_rows, n_constants = constants.shape
    n_angles = angles.shape[2]
    out = Eliminated(
        np.empty((n_frames, n_angles, n_angles)),
        np.empty((n_frames, n_angles, n_constants)),
        np.empty((n_frames, n_angles)),
        np.empty((n_frames, n_rows, n_constants)),
        np.empty((n_frames, n_rows)),
        np.empty((n_constants, n_constants)),
        np.empty(n_constants),
    )
    _eliminate(Linearised(residuals, constants, angles), out)
    return out


@kernel
def _eliminate(linear: Linearised, out: Eliminated) -> None:
    """Write what `eliminate` returns."""
    residuals, constants, angles = linear
    inverse, follow, alone, reduced, left, normal, gradient = out
    n_frames, n_rows, n_constants = constants.shape
    for c in range(n_constants):
        gradient[c] = 0.0
        for d in range(n_constants):
            normal[c, d] = 0.0
    for frame in range(n_frames):
        _invert_own(angles[frame], inverse[frame])
        _follow(angles[frame], inverse[frame], constants[frame], residuals[frame], follow[frame], alone[frame])
        for row in range(n_rows):
            rest = residuals[frame, row]
            for a in range(angles.shape[2]):
                rest -= angles[frame, row, a] * alone[frame, a]
            left[frame, row] = rest
            for c in range(n_constants):
                slope = constants[frame, row, c]
                for a in range(angles.shape[2]):
                    slope -= angles[frame, row, a] * follow[frame, a, c]
                reduced[frame, row, c] = slope
                gradient[c] += slope * rest
                for d in range(c + 1):
                    normal[c, d] += slope * reduced[frame, row, d]
    for c in range(n_constants):
        for d in range(c):
            normal[d, c] = normal[c, d]


@kernel_part
def _follow(
    angles: Floats, inverse: Floats, constants: Floats, residuals: Floats, follow: Floats, alone: Floats
) -> None:
    """Write how a frame's own unknowns follow the constants, and what they are without."""
    for a in range(len(alone)):
        alone[a] = 0.0
        for c in range(constants.shape[1]):
            follow[a, c] = 0.0
        for row in range(len(residuals)):
            gain = 0.0
            for b in range(len(alone)):
                gain += inverse[a, b] * angles[row, b]
            alone[a] += gain * residuals[row]
            for c in range(constants.shape[1]):
                follow[a, c] += gain * constants[row, c]


@kernel_part
def _invert_own(slopes: Floats, out: Floats) -> None:
    """Write the inverse of slopes^T slopes, its diagonal a little raised: Gauss and Jordan without exchanges."""
    n_rows, size = slopes.shape
    trace = 0.0
    for i in range(size):
        for j in range(size):
            out[i, j] = 0.0
            for row in range(n_rows):
                out[i, j] += slopes[row, i] * slopes[row, j]
        trace += out[i, i]
    level = OWN_RIDGE * trace + TINY
    for i in range(size):
        out[i, i] += level
    for pivot in range(size):
        scale = 1.0 / max(out[pivot, pivot], level)
        out[pivot, pivot] = 1.0
        for j in range(size):
            out[pivot, j] *= scale
        for i in range(size):
            if i != pivot:
                factor = out[i, pivot]
                out[i, pivot] = 0.0
                for j in range(size):
                    out[i, j] -= factor * out[pivot, j]


@kernel_part
def write_inverse_root(matrix: Floats, out: Floats) -> None:
    """Write the inverse of the lower root of a matrix (Cholesky), which is lost.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        Symmetric and positive; only the lower half counts.
    out : ndarray, shape (n, n)
        Receives W with W^T W = matrix^-1.
    """
    size = len(matrix)
    for j in range(size):
        least = max(PIVOT * matrix[j, j], TINY)
        for i in range(j, size):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(max(matrix[j, j], least)) if i == j else matrix[i, j] / matrix[j, j]
    for j in range(size):
        for i in range(size):
            out[i, j] = 0.0
        out[j, j] = 1.0 / matrix[j, j]
        for i in range(j + 1, size):
            total = 0.0
            for k in range(j, i):
                total -= matrix[i, k] * out[k, j]
            out[i, j] = total / matrix[i, i]


@kernel_part
def turn_to_axes(matrix: Floats, vectors: Floats, size: int) -> None:
    """Make a symmetric matrix diagonal by Jacobi's rotations, and write its eigenvectors as columns.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        Symmetric; its diagonal receives the eigenvalues.
    vectors : ndarray, shape (n, n)
        Receives the eigenvectors.
    size : int
        n; the arrays may be larger.
    """
    for i in range(size):
        for j in range(size):
            vectors[i, j] = 1.0 if i == j else 0.0
    for _ in range(MAX_SWEEPS):
        aside, whole = 0.0, 0.0
        for i in range(size):
            whole += matrix[i, i] ** 2
            for j in range(i):
                aside += matrix[j, i] ** 2
        if aside <= whole * JACOBI_TOLERANCE:
            break
        for p in range(size - 1):
            for q in range(p + 1, size):
                if matrix[p, q] != 0.0:
                    _rotate(matrix, vectors, size, p, q)


@kernel_part
def _rotate(matrix: Floats, vectors: Floats, size: int, p: int, q: int) -> None:
    """Bring one element of a symmetric matrix to 0."""
    ratio = (matrix[q, q] - matrix[p, p]) / (2.0 * matrix[p, q])
    tangent = (1.0 if ratio >= 0.0 else -1.0) / (abs(ratio) + math.sqrt(ratio * ratio + 1.0))
    cosine = 1.0 / math.sqrt(tangent * tangent + 1.0)
    sine = tangent * cosine
    for k in range(size):
        first, second = matrix[k, p], matrix[k, q]
        matrix[k, p], matrix[k, q] = cosine * first - sine * second, sine * first + cosine * second
    for k in range(size):
        first, second = matrix[p, k], matrix[q, k]
        matrix[p, k], matrix[q, k] = cosine * first - sine * second, sine * first + cosine * second
        first, second = vectors[k, p], vectors[k, q]
        vectors[k, p], vectors[k, q] = cosine * first - sine * second, sine * first + cosine * second


@kernel_part
def write_copy(matrix: Floats, out: Floats) -> None:
    """Write a matrix into another one, which may be larger.

    Parameters
    ----------
    matrix : ndarray, shape (m, n)
        What is copied.
    out : ndarray, at least that large
        Receives it in its first rows and columns.
    """
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i, j] = matrix[i, j]


@kernel_part
def write_times_transposed(first: Floats, second: Floats, out: Floats) -> None:
    """Write first second^T, 3 x 3.

    Parameters
    ----------
    first, second : ndarray, shape (3, 3)
        The factors.
    out : ndarray, shape (3, 3)
        Receives the product; neither of the factors.
    """
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[j, 0] + first[i, 1] * second[j, 1] + first[i, 2] * second[j, 2]


@kernel_part
def factorise(matrix: Floats) -> bool:
    """Put Cholesky's factor into the lower half of a symmetric matrix; return whether the matrix is positive.

    Parameters
    ----------
    matrix : ndarray, shape (n, n)
        Its lower half is read and changed.
    """
    for i in range(len(matrix)):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= matrix[i, k] * matrix[j, k]
            if j < i:
                matrix[i, j] = total / matrix[j, j]
            elif total > 0.0:
                matrix[i, i] = math.sqrt(total)
            else:
                return False
    return True


@kernel_part
def solve(factor: Floats, vector: Floats) -> None:
    """Solve for a vector in place, given Cholesky's factor.

    Parameters
    ----------
    factor : ndarray, shape (n, n)
        As `factorise` leaves it.
    vector : ndarray, shape (n,)
        Right-hand side, replaced by the solution.
    """
    n = len(vector)
    for i in range(n):
        for k in range(i):
            vector[i] -= factor[i, k] * vector[k]
        vector[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            vector[i] -= factor[k, i] * vector[k]
        vector[i] /= factor[i, i]
