"""Small matrices and vectors inside kernels: of three as plain numbers, which stay in registers, others in arrays.

Symmetric matrices of three are held by their upper halves, row by row; others by their rows.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel_part
from skelgen.model.arrays import Floats

Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]


@kernel_part
def vector(table: Floats, row: int, first: int) -> Vector:
    """Three numbers of a table."""
    return table[row, first], table[row, first + 1], table[row, first + 2]


@kernel_part
def set_vector(table: Floats, row: int, first: int, value: Vector) -> None:
    """Write three numbers into a table."""
    table[row, first], table[row, first + 1], table[row, first + 2] = value


@kernel_part
def add_vector(table: Floats, row: int, first: int, value: Vector) -> None:
    """Add three numbers to those in a table."""
    table[row, first] += value[0]
    table[row, first + 1] += value[1]
    table[row, first + 2] += value[2]


@kernel_part
def symmetric(table: Floats, row: int, first: int) -> Symmetric:
    """Six numbers of a table."""
    return (
        table[row, first],
        table[row, first + 1],
        table[row, first + 2],
        table[row, first + 3],
        table[row, first + 4],
        table[row, first + 5],
    )


@kernel_part
def set_symmetric(table: Floats, row: int, first: int, value: Symmetric) -> None:
    """Write six numbers into a table."""
    set_vector(table, row, first, (value[0], value[1], value[2]))
    set_vector(table, row, first + 3, (value[3], value[4], value[5]))


@kernel_part
def add_symmetric(table: Floats, row: int, first: int, value: Symmetric) -> None:
    """Add six numbers to those in a table."""
    add_vector(table, row, first, (value[0], value[1], value[2]))
    add_vector(table, row, first + 3, (value[3], value[4], value[5]))


@kernel_part
def matrix(table: Floats, row: int, first: int) -> Matrix:
    """Nine numbers of a table: a matrix by its rows."""
    return vector(table, row, first), vector(table, row, first + 3), vector(table, row, first + 6)


@kernel_part
def set_matrix(table: Floats, row: int, first: int, value: Matrix) -> None:
    """Write nine numbers into a table."""
    set_vector(table, row, first, value[0])
    set_vector(table, row, first + 3, value[1])
    set_vector(table, row, first + 6, value[2])


@kernel_part
def plus(first: Vector, second: Vector) -> Vector:
    """Return first + second."""
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@kernel_part
def minus(first: Vector, second: Vector) -> Vector:
    """Return first - second."""
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]


@kernel_part
def times(factor: float, vector: Vector) -> Vector:
    """Return factor * vector."""
    return factor * vector[0], factor * vector[1], factor * vector[2]


@kernel_part
def dot(first: Vector, second: Vector) -> float:
    """Return first . second."""
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


@kernel_part
def cross(first: Vector, second: Vector) -> Vector:
    """Return first x second."""
    return (
        first[1] * second[2] - first[2] * second[1],
        first[2] * second[0] - first[0] * second[2],
        first[0] * second[1] - first[1] * second[0],
    )


@kernel_part
def largest(vector: Vector) -> float:
    """Return the largest absolute number of a vector."""
    return max(abs(vector[0]), abs(vector[1]), abs(vector[2]))


@kernel_part
def turned(rotation: Matrix, vector: Vector) -> Vector:
    """Return rotation @ vector."""
    return dot(rotation[0], vector), dot(rotation[1], vector), dot(rotation[2], vector)


@kernel_part
def product(first: Matrix, second: Matrix) -> Matrix:
    """Return first @ second."""
    x, y, z = transposed(second)
    return (
        (dot(first[0], x), dot(first[0], y), dot(first[0], z)),
        (dot(first[1], x), dot(first[1], y), dot(first[1], z)),
        (dot(first[2], x), dot(first[2], y), dot(first[2], z)),
    )


@kernel_part
def transposed(matrix: Matrix) -> Matrix:
    """Return matrix^T, the columns of a matrix."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return (a, d, g), (b, e, h), (c, f, i)


@kernel_part
def by_symmetric(matrix: Symmetric, vector: Vector) -> Vector:
    """Return matrix @ vector."""
    a, b, c, d, e, f = matrix
    x, y, z = vector
    return a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z


@kernel_part
def upper_of_product(first: Vector, second: Vector) -> Symmetric:
    """Return first second^T of parallel vectors."""
    a, b, c = first
    x, y, z = second
    return a * x, a * y, a * z, b * y, b * z, c * z


@kernel_part
def inverse(matrix: Symmetric, level: float) -> Symmetric:
    """Return (matrix + level)^-1 of a matrix that is not negative, by L D L^T; no pivot is below the level."""
    a, b, c, d, e, f = matrix
    first = 1.0 / max(a + level, level)
    low, lower = b * first, c * first
    second = 1.0 / max(d + level - low * b, level)
    mixed = e - lower * b
    last = mixed * second
    third = 1.0 / max(f + level - lower * c - last * mixed, level)
    corner = low * last - lower
    xz, yz = corner * third, -last * third
    xy, yy = -low * second - last * xz, second - last * yz
    return first + low * low * second + corner * xz, xy, xz, yy, yz, third


@kernel_part
def rotation_by(vector: Vector) -> Matrix:
    """Return the rotation about a vector by 2 arctan(length / 2): of a small vector, by its length."""
    scale = 1.0 / (1.0 + dot(vector, vector) / 4.0)
    x, y, z = vector
    xx, xy, xz, yy, yz, zz = upper_of_product(vector, times(scale / 2.0, vector))
    x, y, z = x * scale, y * scale, z * scale
    return (1.0 - yy - zz, xy - z, xz + y), (xy + z, 1.0 - xx - zz, yz - x), (xz - y, yz + x, 1.0 - xx - yy)


@kernel_part
def proper(matrix: Matrix) -> Matrix:
    """Return a rotation that is proper to rounding, of one that has drifted: a step of Newton for the polar factor."""
    x, y, z = transposed(matrix)
    square = ((dot(x, x), dot(x, y), dot(x, z)), (dot(y, x), dot(y, y), dot(y, z)), (dot(z, x), dot(z, y), dot(z, z)))
    away = product(matrix, square)
    return (
        minus(times(1.5, matrix[0]), times(0.5, away[0])),
        minus(times(1.5, matrix[1]), times(0.5, away[1])),
        minus(times(1.5, matrix[2]), times(0.5, away[2])),
    )


SMALL_ANGLE = 1e-8
"""rad; below this the series of sin(x)/x is exact to double precision with its first term."""

TINY = float(np.finfo(np.float64).tiny)

MAX_SWEEPS = 30
JACOBI_TOLERANCE = 1e-31
"""Of the sum of squares: what is left aside of the diagonal is less than rounding."""


@kernel_part
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


@kernel_part
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
    """Write a matrix into another one, which may be larger."""
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            out[i, j] = matrix[i, j]


@kernel_part
def sum_of_squares(matrix: Floats) -> float:
    """Return the sum of the squares of all elements."""
    total = 0.0
    for i in range(matrix.shape[0]):
        for j in range(matrix.shape[1]):
            total += matrix[i, j] * matrix[i, j]
    return total


@kernel_part
def write_times_transposed(first: Floats, second: Floats, out: Floats) -> None:
    """Write first second^T, 3 x 3."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[j, 0] + first[i, 1] * second[j, 1] + first[i, 2] * second[j, 2]


@kernel_part
def write_product(first: Floats, second: Floats, out: Floats) -> None:
    """Write first second, 3 x 3."""
    for i in range(3):
        for j in range(3):
            out[i, j] = first[i, 0] * second[0, j] + first[i, 1] * second[1, j] + first[i, 2] * second[2, j]


@kernel_part
def factorise(matrix: Floats) -> bool:
    """Put Cholesky's factor into the lower half of a symmetric matrix; return whether the matrix is positive."""
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
    """Solve for a vector in place, given Cholesky's factor."""
    n = len(vector)
    for i in range(n):
        for k in range(i):
            vector[i] -= factor[i, k] * vector[k]
        vector[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            vector[i] -= factor[k, i] * vector[k]
        vector[i] /= factor[i, i]
