from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.statistics import (
    SORTED_AT_ONCE,
    lengths_of,
    median_and_deviation,
    median_of_known,
    pair_distances,
    pair_lengths,
    quantile_of,
    sorted_pair_lengths,
)


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


def test_each_row_holds_the_distances_of_a_pair():
    positions = np.random.default_rng(0).normal(size=(5, 4, 3))
    positions[2, 1] = np.nan
    lengths = pair_lengths(positions, np.array([0, 3]), np.array([1, 2]))
    assert lengths.shape == (2, 5)
    assert np.isnan(lengths[0]).tolist() == [False, False, True, False, False]
    np.testing.assert_allclose(lengths[1], np.linalg.norm(positions[:, 3] - positions[:, 2], axis=1), rtol=1e-15)


def test_no_pairs_have_no_rows():
    none = np.zeros(0, dtype=np.intp)
    assert pair_lengths(np.zeros((3, 2, 3)), none, none).shape == (0, 3)


def test_lengths_are_those_of_numpy():
    vectors = np.random.default_rng(0).normal(size=(7, 4, 3))
    vectors[2, 1, 0] = np.nan
    assert np.array_equal(lengths_of(vectors), np.linalg.norm(vectors, axis=-1), equal_nan=True)


def test_sorted_distances_rise_and_are_those_of_the_pairs():
    positions = np.random.default_rng(1).normal(size=(2 * SORTED_AT_ONCE // 5, 3, 3))  # two of three pairs at once
    positions[3:5, 2] = np.nan
    first, second = np.triu_indices(3, 1)
    found = np.full((len(positions), len(first)), -1.0)
    for part, lengths in sorted_pair_lengths(positions, first, second):
        found[:, part] = lengths
    assert np.array_equal(found, np.sort(pair_lengths(positions, first, second).T, axis=0), equal_nan=True)


def test_pairs_are_described_by_the_frames_that_show_both():
    lengths = np.array([3.0, 9.0, 4.0, 5.0, 6.0, 7.0, 8.0, 10.0, np.nan, 11.0])
    positions = np.zeros((10, 2, 3))
    positions[:, 1, 0] = lengths
    pairs = pair_distances(positions, np.array([0]), np.array([1]), within=(0.0, 0.8))
    assert (pairs.n_common[0], pairs.largest[0], pairs.is_known[0]) == (9, 9.0, True)
    assert pairs.mean[0] == pytest.approx(np.nanmean(lengths))
    assert pairs.deviation[0] == pytest.approx(np.nanstd(lengths) * np.sqrt(10 / 9))


def test_wild_distances_of_a_pair_do_not_count_where_they_are_clipped():
    positions = np.zeros((100, 2, 3))
    positions[:, 1, 0] = 5.0
    positions[50, 1, 0] = 500.0
    pairs = pair_distances(positions, np.array([0]), np.array([1]), (0.03, 0.97), method="nearest", clipped=True)
    assert (pairs.largest[0], pairs.mean[0], pairs.deviation[0]) == (5.0, 5.0, 0.0)


def test_rows_are_described_without_what_is_unknown():
    middle, deviation, n_known = median_and_deviation(np.array([[3.0, np.nan, 1.0, 2.0], [np.nan] * 4]))
    assert (middle[0], deviation[0]) == (2.0, 1.4826)
    assert np.isnan([middle[1], deviation[1]]).all()
    assert n_known.tolist() == [3, 0]
