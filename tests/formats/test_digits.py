"""Tables of numbers as text: the compiled writer gives what Python's formatting gives, character by character."""

from __future__ import annotations

from importlib import import_module

import numpy as np
import pytest
from skelgen_formats.digits import fixed_rows, plain_rows


@pytest.fixture
def compiled():
    pytest.importorskip("numba", reason="numba is not installed")
    return import_module("skelgen_formats.compiled_digits").rows


@pytest.mark.parametrize("decimals", [0, 1, 6, 9])
def test_random_numbers_are_rounded_as_python_rounds_them(compiled, decimals):
    rng = np.random.default_rng(decimals)
    numbers = rng.normal(size=(300, 20)) * 10.0 ** rng.uniform(-12, 5, size=(300, 20))
    assert compiled(numbers, decimals) == plain_rows(numbers, decimals)


def test_halves_go_where_the_exact_number_goes(compiled):
    eighths, near = np.arange(-40, 41)[np.newaxis] / 8, np.arange(1, 200)[np.newaxis] * 1e-6 + 0.5e-6
    for numbers, decimals in ((eighths, 0), (eighths, 1), (eighths, 2), (near, 6), (np.nextafter(near, 0), 6)):
        assert compiled(numbers, decimals) == plain_rows(numbers, decimals)


@pytest.mark.parametrize("odd", [np.nan, np.inf, -np.inf, 1e300, -(2.0**60), -0.0, 5e-324])
def test_odd_numbers_are_written_as_python_writes_them(compiled, odd):
    numbers = np.array([[1.5, odd], [2.5, 3.5]])
    assert compiled(numbers, 6) == plain_rows(numbers, 6)


@pytest.mark.parametrize("shape", [(0, 3), (3, 0), (1, 1)])
def test_tables_without_rows_or_columns_have_no_numbers(compiled, shape):
    assert compiled(np.zeros(shape), 2) == plain_rows(np.zeros(shape), 2) == fixed_rows(np.zeros(shape), 2)
