"""Numbers as text with a fixed number of digits behind the point, many at once."""

from __future__ import annotations

from skelgen.model.arrays import Floats


def fixed_rows(numbers: Floats, decimals: int) -> list[str]:
    """Return each row as text: before every number a comma.

    Parameters
    ----------
    numbers : ndarray, shape (n_rows, n_columns)
        The table.
    decimals : int
        Digits behind the point.

    Examples
    --------
    >>> fixed_rows(np.array([[1.0, -0.25]]), 1)
    [',1.0,-0.2']
    """
    row = f",%.{decimals}f" * numbers.shape[1]
    return [row % tuple(values) for values in numbers.tolist()]
