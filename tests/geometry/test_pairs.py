"""Distances of pairs of markers."""

import numpy as np

from skelgen.geometry.pairs import pair_lengths


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
