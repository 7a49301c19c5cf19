"""Points and the markers within whose gates they are: all pairs, written in NumPy."""

from __future__ import annotations

import numpy as np

from skelgen._kernels.explained_points import explained_points

FLOAT32 = 1e-6  # of scores up to 1


def test_all_pairs_within_the_gates_are_found_point_after_point():
    rng = np.random.default_rng(0)
    predicted, gates = rng.normal(size=(5, 7, 3)), rng.uniform(0.5, 2.0, (5, 7))
    predicted[rng.random((5, 7)) < 0.2] = np.nan
    frames = np.repeat(np.arange(5), 6)
    points = rng.normal(size=(30, 3))
    squares = ((predicted[frames] - points[:, np.newaxis]) ** 2).sum(axis=2)
    wanted = np.nan_to_num(np.maximum(1 - squares / gates[frames] ** 2, 0.0))
    found, markers, scores = explained_points(points, frames, predicted, gates)
    assert np.array_equal([found, markers], np.nonzero(wanted))
    np.testing.assert_allclose(scores, wanted[wanted > 0], atol=FLOAT32)


def test_there_is_room_for_points_that_many_markers_explain():
    found, markers, scores = explained_points(
        np.zeros((2, 3)), np.zeros(2, dtype=np.intp), np.zeros((1, 9, 3)), np.ones((1, 9))
    )
    assert found.tolist() == [0] * 9 + [1] * 9
    assert markers.tolist() == [*range(9), *range(9)]
    assert (scores == 1.0).all()
