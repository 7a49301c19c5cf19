"""Small matrices inside compiled loops: products, Cholesky's root, Jacobi's eigenvectors.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats

TINY = float(np.finfo(np.float64).tiny)

MAX_SWEEPS = 30
JACOBI_TOLERANCE = 1e-31
"""Of the sum of squares: what is left aside of the diagonal is less than rounding."""


@compile_function
def write_inverse_root(matrix: Floats, out: Floats) -> None:
    """Write the inverse of the lower root of a matrix (Cholesky), which is lost."""
    size = len(matrix)
    for j in range(size):
        for i in range(j, size):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = math.sqrt(max(matrix[j, j], TINY)) if i == j else matrix[i, j] / matrix[j, j]
    for j in range(size):
        for i in range(size):
            out[i, j] = 0.0
        out[j, j] = 1.0 / matrix[j, j]
        for i in range(j + 1, size):
            total = 0.0
            for k in range(j, i):
                total -= matrix[i, k] * out[k, j]
            out[i, j] = total / matrix[i, i]


@compile_function
def turn_to_axes(matrix: Floats, vectors: Floats, size: int) -> None:
    """Make a symmetric matrix diagonal by Jacobi's rotations, and write its eigenvectors as columns."""
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


@compile_function
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


@compile_function
def write_times_transposed(first: Floats, second: Floats, out: Floats) -> None:
    """Write first second^T, 3 x 3."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[j, 0] + first[i, 1] * second[j, 1] + first[i, 2] * second[j, 2]


@compile_function
def write_product(first: Floats, second: Floats, out: Floats) -> None:
    """Write first second, 3 x 3."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]
