"""Small systems of linear equations, for compiled loops.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats


@compile_function
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


@compile_function
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
