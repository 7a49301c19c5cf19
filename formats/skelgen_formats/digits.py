"""Numbers as text with a fixed number of digits behind the point, many at once."""

from __future__ import annotations

import sys

from skelgen.compiling import loops
from skelgen.model.arrays import Floats

_WORTH_IMPORTING = 1_000_000  # numbers that take Python as long as numba takes to load


def fixed_rows(numbers: Floats, decimals: int) -> list[str]:
    """Return each row as text: before every number a comma, and the number exactly as Python rounds it.

    The compiled twin gives the same text; it is taken where numba is loaded anyhow, or the table is large.

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
    if "numba" not in sys.modules and numbers.size < _WORTH_IMPORTING:
        return plain_rows(numbers, decimals)
    module = loops(f"{__package__}.compiled_digits", __name__)
    return plain_rows(numbers, decimals) if module.__name__ == __name__ else list(module.rows(numbers, decimals))


def plain_rows(numbers: Floats, decimals: int) -> list[str]:
    """Do what `fixed_rows` does, by Python's own formatting."""
    row = f",%.{decimals}f" * numbers.shape[1]
    return [row % tuple(values) for values in numbers.tolist()]
