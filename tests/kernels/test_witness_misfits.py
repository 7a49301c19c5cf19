"""Misfits of points to usual distances: the sum over witnesses, written in NumPy."""

from __future__ import annotations

import numpy as np

from skelgen._kernels.tracklet_evidence import MOST_MISFIT, write_misfits

ROUNDING = 1e-12  # nats


def test_misfits_are_bounded_squares_summed_over_the_other_witnesses_that_are_seen():
    rng = np.random.default_rng(0)
    distance = rng.uniform(50, 60, (5, 5, 9))
    distance[rng.random(distance.shape) < 0.3] = np.nan
    usual, deviation = rng.uniform(50, 60, (5, 5)), rng.uniform(1, 3, (5, 5))
    misfits = np.full((5, 5, 9), -1.0)
    write_misfits(1, np.array([0, 3, 4]), np.array([2, 3, -1]), distance, (usual, deviation), misfits)
    off = (distance[:, [2, 3]] - usual[1, [2, 3], np.newaxis]) / deviation[1, [2, 3], np.newaxis]
    wanted = np.minimum(np.nan_to_num(off) ** 2 / 2, MOST_MISFIT)
    wanted[3, 1] = 0.0  # its own distance to itself
    np.testing.assert_allclose(misfits[[0, 3, 4], 1], wanted.sum(axis=1)[[0, 3, 4]], atol=ROUNDING)
    misfits[[0, 3, 4], 1] = -1.0
    assert (misfits == -1.0).all()  # nothing else is written
