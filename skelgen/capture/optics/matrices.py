"""Small matrices, many at once."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats


def inverse_symmetric(matrices: Floats) -> Floats:
    """Return inverses of symmetric matrices, shape (..., 3, 3), by their cofactors; NaN where one holds NaN.

    LAPACK raises for a whole batch if one matrix holds NaN, which here stands for a point that is not seen.
    """
    a, b, c = (matrices[..., 0, column] for column in range(3))
    d, e, f = matrices[..., 1, 1], matrices[..., 1, 2], matrices[..., 2, 2]
    cofactors = [d * f - e * e, c * e - b * f, b * e - c * d, a * f - c * c, b * c - a * e, a * d - b * b]
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / (a * cofactors[0] + b * cofactors[1] + c * cofactors[2])
        out = np.empty(matrices.shape)
        for (row, column), cofactor in zip(_UPPER, cofactors, strict=True):
            out[..., row, column] = out[..., column, row] = cofactor * scale
    return out


_UPPER = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
