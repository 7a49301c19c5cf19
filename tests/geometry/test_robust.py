from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.robust import median_of_known, quantile_of


@pytest.mark.parametrize("n_rows", [1, 2, 7, 8])
def test_medians_are_those_of_numpy_where_something_is_known(n_rows):
    rng = np.random.default_rng(n_rows)
    values = rng.normal(size=(n_rows, 6))
    values[1:][rng.random((n_rows - 1, 6)) < 0.4] = np.nan
    assert np.array_equal(median_of_known(values), np.nanmedian(values, axis=0))


def test_what_is_never_known_has_no_median():
    values = np.random.default_rng(0).normal(size=(5, 2))
    values[:, 1] = np.nan
    assert np.isnan(median_of_known(values)).tolist() == [False, True]


@pytest.mark.parametrize("n_values", [1, 2, 21, 100])
@pytest.mark.parametrize("part", [0.0, 0.5, 0.95, 1.0])
def test_quantiles_are_those_of_numpy(n_values, part):
    values = np.random.default_rng(n_values).normal(size=n_values)
    assert quantile_of(values, part) == np.quantile(values, part)
