"""Misfits to a marker set: as they are defined, with markers that are never seen together and two of one place."""

import numpy as np
import pytest

from skelgen._kernels.distance_statistics import (
    LARGEST,
    MOTION_WEIGHT,
    UNKNOWN,
    misfits_to_set,
    move_to_posture,
    own_misfits,
    precision_of,
)

SINGLE = 1e-5  # relative: single precision


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
    single = (values.astype(np.float32) for values in (take, mean, precision_of(spread)))
    found = misfits_to_set(*single, np.array(markers), np.array(of_set))
    np.testing.assert_allclose(found, expected / max(len(markers) - 1, 1), rtol=SINGLE)


def test_markers_fit_their_own_places_as_all_places():
    rng, markers, of_set = np.random.default_rng(1), np.array([5, 0, 2, 4]), np.array([5, 0, 2, 7])
    take, mean, spread = (values + values.swapaxes(1, 2) for values in rng.uniform(0.2, 2.0, (3, 2, 8, 8)))
    take[:, 0, 5] = take[:, 5, 0] = np.nan
    take, mean, precision = take.astype(np.float32), mean.astype(np.float32), precision_of(spread)
    to_all = misfits_to_set(take, mean, precision, markers, of_set)[markers, of_set]
    np.testing.assert_allclose(own_misfits(take, mean, precision, markers, of_set), to_all, rtol=SINGLE)


def test_distances_are_moved_to_a_posture_once_for_each_marker():
    rng = np.random.default_rng(0)
    ways, mean = rng.normal(size=(5, 2, 3, 5)).astype(np.float32), rng.normal(size=(2, 5, 5)).astype(np.float32)
    expected, moved, known, posture = mean.copy(), mean.copy(), np.zeros(5, dtype=bool), rng.normal(size=4)
    expected[:, [1, 4]] += np.einsum("w,phwo->hpo", posture[:3], ways[[1, 4]])
    expected[0, [1, 4]] += posture[3]
    for of_set in ([1], [4, 1, 4]):
        move_to_posture(ways, posture, np.array(of_set), known, moved)
    np.testing.assert_allclose(moved, expected, rtol=SINGLE, atol=SINGLE)
    np.testing.assert_array_equal(known, [False, True, False, False, True])
