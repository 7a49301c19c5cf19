"""Postures: found from distances, with some that are wrong; and misfits in them as they are defined."""

import numpy as np
import pytest

from skelgen._kernels.distance_statistics import LARGEST, MOTION_WEIGHT, UNKNOWN
from skelgen.stages.limbs.postures import own_misfits
from skelgen.stages.limbs.worn_sets import worn_sets
from skelgen.stages.limbs.worn_shapes import square_of_pairs

WRONG = 0.15  # part of the distances


@pytest.fixture(scope="module")
def worn():
    return next(one for one in worn_sets() if one.name == "animation-41")


def test_the_posture_of_most_distances_is_found(worn):
    rng, postures = np.random.default_rng(0), worn.postures
    meant = postures.mean + np.tensordot(rng.normal(size=len(worn.ways)), square_of_pairs(worn.ways), 1)
    meant[0] += 0.3  # a larger body
    taken = np.triu(rng.random(meant.shape[1:]) < WRONG, 1)
    seen = meant + (taken | taken.T) * 1.5
    seen[:, 3, 5] = seen[:, 5, 3] = np.nan  # never together
    every = np.arange(meant.shape[1])
    off = np.abs(postures.assumed(seen, every).mean(every) - meant) / postures.spread
    usual = np.abs(postures.mean - meant + np.nanmedian(meant[0] - postures.mean[0])) / postures.spread
    assert np.nanmean(off[0]) < 0.25 * np.nanmean(usual[0])


def test_no_distance_leaves_the_usual_posture(worn):
    nothing = np.full((2, 4, 4), np.nan)
    np.testing.assert_allclose(worn.postures.assumed(nothing, np.arange(4)).mean(np.arange(2)), worn.postures.mean)


def test_what_only_legs_show_leaves_arms_unknown(worn):
    postures, legs = worn.postures, worn.parts[0]
    every = np.arange(len(worn.segments))
    by_legs, by_all = (postures.assumed(postures.mean[:, one][..., one], one).spread for one in (legs, every))
    arms = np.setdiff1d(every, legs)
    beside = by_legs[0][np.ix_(arms, legs)] / by_all[0][np.ix_(arms, legs)]
    within = by_legs[0][np.ix_(legs, legs)] / by_all[0][np.ix_(legs, legs)]
    assert np.nanmedian(beside) > np.nanmedian(within) + 0.03
    assert np.nanmin(by_all / postures.spread) >= 1.0


def test_misfits_are_as_defined():
    rng, of_set = np.random.default_rng(1), np.array([5, 0, 2])
    take, mean, spread = rng.normal(size=(2, 3, 3)), rng.normal(size=(2, 6, 6)), rng.uniform(0.2, 2.0, (2, 6, 6))
    take[:, 0, 1] = take[:, 1, 0] = np.nan
    expected = np.zeros(3)
    for one, other in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)]:
        off = (take[:, one, other] - mean[:, of_set[one], of_set[other]]) / spread[:, of_set[one], of_set[other]]
        square = off[0] ** 2 + MOTION_WEIGHT * off[1] ** 2
        expected[one] += UNKNOWN if np.isnan(square) else min(square, LARGEST)
    np.testing.assert_allclose(own_misfits(take, mean, spread, of_set), expected / 2)


def test_half_a_set_is_the_set_without_the_others(worn):
    taken, half = worn.halves[0]
    np.testing.assert_allclose(half.postures.ways, worn.postures.ways[taken][..., taken])
    np.testing.assert_allclose(half.postures.spread, worn.postures.spread[:, taken][..., taken])
    assert half.markers == tuple(worn.markers[marker] for marker in taken)


def test_pairs_are_the_rows_above_the_diagonal():
    square = square_of_pairs(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(square, [[np.nan, 1, 2], [1, np.nan, 3], [2, 3, np.nan]])
