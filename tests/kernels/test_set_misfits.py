"""Misfits to a marker set: as they are defined, with markers that are never seen together and two of one place."""

import numpy as np
import pytest

from skelgen._kernels.distance_statistics import (
    LARGEST,
    MOTION_WEIGHT,
    UNKNOWN,
    misfits_to_set,
    move_to_posture,
    ways_of_pairs,
)


@pytest.mark.parametrize(
    ("markers", "of_set"), [([1, 4], [3, 7]), ([1, 4, 5], [3, 8, 9]), ([2], [0]), ([0, 1], [6, 6])]
)
def test_distances_are_compared_as_defined(markers, of_set):
    rng = np.random.default_rng(len(markers))
    take, mean, spread = rng.normal(size=(2, 6, 6)), rng.normal(size=(2, 10, 10)), rng.uniform(0.2, 2.0, (2, 10, 10))
    take[:, 2, 4] = take[:, 4, 2] = np.nan
    expected = np.zeros((6, 10))
    for marker, place in zip(markers, of_set, strict=True):
        off = (take[:, marker, :, np.newaxis] - mean[:, place, np.newaxis]) / spread[:, place, np.newaxis]
        one = np.nan_to_num(np.minimum(off[0] ** 2 + MOTION_WEIGHT * off[1] ** 2, LARGEST), nan=UNKNOWN)
        one[:, place] = LARGEST
        one[marker] = 0.0
        expected += one
    found = misfits_to_set(take, mean, spread, np.array(markers), np.array(of_set))
    np.testing.assert_allclose(found, expected / max(len(markers) - 1, 1), rtol=1e-12)


def test_distances_are_moved_to_a_posture_once_for_each_marker():
    rng = np.random.default_rng(0)
    ways, posture, mean = rng.normal(size=(5, 3, 2, 5)), rng.normal(size=4), rng.normal(size=(2, 5, 5))
    expected, moved, known = mean.copy(), mean.copy(), np.zeros(5, dtype=bool)
    expected[:, [1, 4]] += np.einsum("w,pwho->hpo", posture[:3], ways[[1, 4]])
    expected[0, [1, 4]] += posture[3]
    for of_set in ([1], [4, 1, 4]):
        move_to_posture(ways, posture, np.array(of_set), known, moved)
    np.testing.assert_allclose(moved, expected)
    np.testing.assert_array_equal(known, [False, True, False, False, True])


def test_ways_of_pairs_end_with_the_size():
    ways, pairs = np.random.default_rng(0).normal(size=(5, 3, 2, 5)), np.array([[0, 2], [3, 4]])
    found = ways_of_pairs(ways, pairs)
    np.testing.assert_array_equal(found[:, :, :3], [[ways[0, :, half, 3], ways[2, :, half, 4]] for half in (0, 1)])
    np.testing.assert_array_equal(found[:, :, 3], [[1.0, 1.0], [0.0, 0.0]])
