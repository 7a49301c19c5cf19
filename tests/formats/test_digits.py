"""Tables of numbers as text: each number as Python rounds it, after a comma."""

from __future__ import annotations

import numpy as np
import pytest
from skelgen_formats.digits import fixed_rows


@pytest.mark.parametrize("decimals", [0, 1, 6, 9])
def test_random_numbers_are_rounded_as_python_rounds_them(decimals):
    rng = np.random.default_rng(decimals)
    numbers = rng.normal(size=(30, 20)) * 10.0 ** rng.uniform(-12, 5, size=(30, 20))
    wanted = ["".join(f",{number:.{decimals}f}" for number in row) for row in numbers]
    assert fixed_rows(numbers, decimals) == wanted


@pytest.mark.parametrize(
    ("number", "text"), [(np.nan, "nan"), (np.inf, "inf"), (-np.inf, "-inf"), (-0.0, "-0.00"), (0.125, "0.12")]
)
def test_odd_numbers_are_written_as_python_writes_them(number, text):
    assert fixed_rows(np.array([[1.5, number]]), 2) == [f",1.50,{text}"]


@pytest.mark.parametrize("shape", [(0, 3), (3, 0)])
def test_tables_without_rows_or_columns_have_no_numbers(shape):
    assert fixed_rows(np.zeros(shape), 2) == [""] * shape[0]
