"""The checks that all values share."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.model.arrays import check_bools, check_floats, check_ints, check_names, check_rate


@pytest.mark.parametrize(
    ("check", "values", "kind"),
    [
        (check_floats, [[1, 2, 3]], np.float64),
        (check_ints, np.array([[1, 2, 3]], dtype=np.int8), np.intp),
        (check_bools, [[True, False, True]], np.bool_),
    ],
)
def test_clean_arrays_are_read_only_copies(check, values, kind):
    given = np.array(values)
    clean = check(given, (None, 3), "values")
    assert clean.dtype == kind
    assert not np.shares_memory(clean, given)
    with pytest.raises(ValueError, match="read-only"):
        clean[0, 0] = 0


@pytest.mark.parametrize("shape", [(2,), (3, 2), (2, 3, 1)])
def test_wrong_shape_is_named_with_the_right_one(shape):
    with pytest.raises(InputError, match=r"points has shape .*; it must be \(any, 3\)"):
        check_floats(np.zeros(shape), (None, 3), "points")


def test_infinite_numbers_are_refused():
    with pytest.raises(InputError, match="points holds values that are not finite"):
        check_floats([1.0, np.inf], (None,), "points")


def test_nan_is_refused_only_where_it_means_nothing():
    assert np.isnan(check_floats([np.nan], (1,), "points"))
    with pytest.raises(InputError, match="not finite"):
        check_floats([np.nan], (1,), "points", finite=True)


def test_fractions_are_no_whole_numbers():
    with pytest.raises(InputError, match="limbs must be whole numbers"):
        check_ints([0.5], (1,), "limbs")


def test_empty_lists_are_whole_numbers():
    assert check_ints([], (0,), "limbs").dtype == np.intp


@pytest.mark.parametrize(
    ("names", "sentence"),
    [
        (["a"], "1 marker name where 2 belong"),
        (["a", " "], "empty name"),
        (["a", "a"], "two markers are called 'a'"),
    ],
)
def test_bad_names_are_refused(names, sentence):
    with pytest.raises(InputError, match=sentence):
        check_names(names, 2, "marker")


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan, np.inf])
def test_bad_rates_are_refused(rate):
    with pytest.raises(InputError, match="must be above 0"):
        check_rate(rate, "the take")
