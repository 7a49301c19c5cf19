"""Vectors and matrices of three inside kernels, as plain numbers, which stay in registers.

Symmetric matrices are held by their upper halves, row by row; others by their rows.
"""

from __future__ import annotations

import numpy as np

from skelgen._kernels import kernel_part
from skelgen.model.arrays import Floats

Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]
Matrix = tuple[Vector, Vector, Vector]

TINY = float(np.finfo(np.float64).tiny)


@kernel_part
def vector(table: Floats, row: int, first: int) -> Vector:
    """Three numbers of a table.

    Parameters
    ----------
    table : ndarray
        Numbers, row by row.
    row, first : int
        Row, and column of the first number.
    """
    return table[row, first], table[row, first + 1], table[row, first + 2]


@kernel_part
def set_vector(table: Floats, row: int, first: int, value: Vector) -> None:
    """Write three numbers into a table.

    Parameters
    ----------
    table, row, first
        As for `vector`.
    value : tuple of float
        Three numbers.
    """
    table[row, first], table[row, first + 1], table[row, first + 2] = value


@kernel_part
def add_vector(table: Floats, row: int, first: int, value: Vector) -> None:
    """Add three numbers to those in a table.

    Parameters
    ----------
    table, row, first, value
        As for `set_vector`.
    """
    table[row, first] += value[0]
    table[row, first + 1] += value[1]
    table[row, first + 2] += value[2]


@kernel_part
def symmetric(table: Floats, row: int, first: int) -> Symmetric:
    """Six numbers of a table.

    Parameters
    ----------
    table, row, first
        As for `vector`.
    """
    a, b, c = vector(table, row, first)
    d, e, f = vector(table, row, first + 3)
    return a, b, c, d, e, f


@kernel_part
def set_symmetric(table: Floats, row: int, first: int, value: Symmetric) -> None:
    """Write six numbers into a table.

    Parameters
    ----------
    table, row, first, value
        As for `set_vector`; six numbers.
    """
    set_vector(table, row, first, (value[0], value[1], value[2]))
    set_vector(table, row, first + 3, (value[3], value[4], value[5]))


@kernel_part
def add_symmetric(table: Floats, row: int, first: int, value: Symmetric) -> None:
    """Add six numbers to those in a table.

    Parameters
    ----------
    table, row, first, value
        As for `set_vector`; six numbers.
    """
    add_vector(table, row, first, (value[0], value[1], value[2]))
    add_vector(table, row, first + 3, (value[3], value[4], value[5]))


@kernel_part
def matrix(table: Floats, row: int, first: int) -> Matrix:
    """Nine numbers of a table: a matrix by its rows.

    Parameters
    ----------
    table, row, first
        As for `vector`.
    """
    return vector(table, row, first), vector(table, row, first + 3), vector(table, row, first + 6)


@kernel_part
def set_matrix(table: Floats, row: int, first: int, value: Matrix) -> None:
    """Write nine numbers into a table.

    Parameters
    ----------
    table, row, first, value
        As for `set_vector`; three rows of three numbers.
    """
    set_vector(table, row, first, value[0])
    set_vector(table, row, first + 3, value[1])
    set_vector(table, row, first + 6, value[2])


@kernel_part
def add_matrix(table: Floats, row: int, first: int, value: Matrix) -> None:
    """Add nine numbers to those in a table.

    Parameters
    ----------
    table, row, first, value
        As for `set_vector`; three rows of three numbers.
    """
    add_vector(table, row, first, value[0])
    add_vector(table, row, first + 3, value[1])
    add_vector(table, row, first + 6, value[2])


@kernel_part
def block(table: Floats, row: int, first: int) -> Matrix:
    """Nine numbers of a table, three in each of three rows: of a pose, from its start on, the rotation.

    Parameters
    ----------
    table, row, first
        As for `vector`; of the first row.
    """
    return vector(table, row, first), vector(table, row + 1, first), vector(table, row + 2, first)


@kernel_part
def set_block(table: Floats, row: int, first: int, value: Matrix) -> None:
    """Write nine numbers into a table, three in each of three rows.

    Parameters
    ----------
    table, row, first, value
        As for `set_vector`; three rows of three numbers.
    """
    set_vector(table, row, first, value[0])
    set_vector(table, row + 1, first, value[1])
    set_vector(table, row + 2, first, value[2])


@kernel_part
def column(table: Floats, which: int) -> Vector:
    """The first three numbers of a column of a table: of a pose, of the last one, the shift.

    Parameters
    ----------
    table, which
        Numbers, row by row, and the index of the column.
    """
    return table[0, which], table[1, which], table[2, which]


@kernel_part
def plus(first: Vector, second: Vector) -> Vector:
    """Return first + second.

    Parameters
    ----------
    first, second : tuple of float
        Vectors of three.
    """
    return first[0] + second[0], first[1] + second[1], first[2] + second[2]


@kernel_part
def minus(first: Vector, second: Vector) -> Vector:
    """Return first - second.

    Parameters
    ----------
    first, second : tuple of float
        Vectors of three.
    """
    return first[0] - second[0], first[1] - second[1], first[2] - second[2]


@kernel_part
def times(factor: float, vector: Vector) -> Vector:
    """Return factor * vector.

    Parameters
    ----------
    factor : float
        By which to multiply.
    vector : tuple of float
        Three numbers.
    """
    return factor * vector[0], factor * vector[1], factor * vector[2]


@kernel_part
def dot(first: Vector, second: Vector) -> float:
    """Return first . second.

    Parameters
    ----------
    first, second : tuple of float
        Vectors of three.
    """
    return first[0] * second[0] + first[1] * second[1] + first[2] * second[2]


@kernel_part
def cross(first: Vector, second: Vector) -> Vector:
    """Return first x second.

    Parameters
    ----------
    first, second : tuple of float
        Vectors of three.
    """
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
    """Return rotation @ vector.

    Parameters
    ----------
    rotation : tuple
        Matrix of three, by its rows.
    vector : tuple of float
        Three numbers.
    """
    return dot(rotation[0], vector), dot(rotation[1], vector), dot(rotation[2], vector)


@kernel_part
def product(first: Matrix, second: Matrix) -> Matrix:
    """Return first @ second.

    Parameters
    ----------
    first, second : tuple
        Matrices of three, by their rows.
    """
    (a, b, c), columns = first, transposed(second)
    return turned(columns, a), turned(columns, b), turned(columns, c)


@kernel_part
def transposed(matrix: Matrix) -> Matrix:
    """Return matrix^T, the columns of a matrix."""
    (a, b, c), (d, e, f), (g, h, i) = matrix
    return (a, d, g), (b, e, h), (c, f, i)


@kernel_part
def added(first: Matrix, second: Matrix) -> Matrix:
    """Return first + second.

    Parameters
    ----------
    first, second : tuple
        Matrices of three, by their rows.
    """
    return plus(first[0], second[0]), plus(first[1], second[1]), plus(first[2], second[2])


@kernel_part
def taken(first: Matrix, second: Matrix) -> Matrix:
    """Return first - second.

    Parameters
    ----------
    first, second : tuple
        Matrices of three, by their rows.
    """
    return minus(first[0], second[0]), minus(first[1], second[1]), minus(first[2], second[2])


@kernel_part
def negative(matrix: Matrix) -> Matrix:
    """Return -matrix."""
    return times(-1.0, matrix[0]), times(-1.0, matrix[1]), times(-1.0, matrix[2])


@kernel_part
def outer(first: Vector, second: Vector) -> Matrix:
    """Return first second^T.

    Parameters
    ----------
    first, second : tuple of float
        Vectors of three.
    """
    return times(first[0], second), times(first[1], second), times(first[2], second)


@kernel_part
def cross_matrix(vector: Vector) -> Matrix:
    """Return the matrix [v]x with [v]x u = v x u."""
    x, y, z = vector
    return (0.0, -z, y), (z, 0.0, -x), (-y, x, 0.0)


@kernel_part
def whole(upper: Symmetric) -> Matrix:
    """Return a symmetric matrix by its rows."""
    a, b, c, d, e, f = upper
    return (a, b, c), (b, d, e), (c, e, f)


@kernel_part
def upper_half(rows: Matrix) -> Symmetric:
    """Return the upper half of a symmetric matrix."""
    (a, b, c), (_, d, e), (_, _, f) = rows
    return a, b, c, d, e, f


@kernel_part
def by_symmetric(matrix: Symmetric, vector: Vector) -> Vector:
    """Return matrix @ vector.

    Parameters
    ----------
    matrix : tuple of float
        Upper half of a matrix of three.
    vector : tuple of float
        Three numbers.
    """
    a, b, c, d, e, f = matrix
    x, y, z = vector
    return a * x + b * y + c * z, b * x + d * y + e * z, c * x + e * y + f * z


@kernel_part
def upper_of_product(first: Vector, second: Vector) -> Symmetric:
    """Return first second^T of parallel vectors.

    Parameters
    ----------
    first, second : tuple of float
        Vectors of three.
    """
    a, b, c = first
    x, y, z = second
    return a * x, a * y, a * z, b * y, b * z, c * z


@kernel_part
def inverse(matrix: Symmetric, level: float) -> Symmetric:
    """Return (matrix + level)^-1 of a matrix that is not negative, by L D L^T; no pivot is below the level.

    Parameters
    ----------
    matrix : tuple of float
        Upper half of a matrix of three.
    level : float
        Added to its diagonal, above 0.
    """
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
