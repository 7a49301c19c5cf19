"""Postures: found from distances, with some that are wrong; and misfits in them as they are defined."""

import numpy as np
import pytest

from skelgen.stages.limbs.postures import median_of_known, square_of_pairs
from skelgen.stages.limbs.worn_sets import worn_sets

WRONG = 0.15  # part of the distances


@pytest.fixture(scope="module")
def worn():
    return next(one for one in worn_sets() if one.name == "animation-41")


def test_the_posture_of_most_distances_is_found(worn):
    rng, postures = np.random.default_rng(0), worn.postures
    meant = postures.mean + square_of_pairs((worn.ways @ rng.normal(size=worn.ways.shape[2])).T)
    meant[0] += 0.3  # a larger body
    taken = np.triu(rng.random(meant.shape[1:]) < WRONG, 1)
    seen = meant + (taken | taken.T) * 1.5
    seen[:, 3, 5] = seen[:, 5, 3] = np.nan  # never together
    every = np.arange(meant.shape[1])
    off = np.abs(postures.assumed(seen, every, every).mean(every) - meant) / postures.spread
    usual = np.abs(postures.mean - meant + np.nanmedian(meant[0] - postures.mean[0])) / postures.spread
    assert np.nanmean(off[0]) < 0.25 * np.nanmean(usual[0])


def test_no_distance_leaves_the_usual_posture(worn):
    nothing, few = np.full((2, 4, 4), np.nan, dtype=np.float32), np.arange(4)
    np.testing.assert_allclose(worn.postures.assumed(nothing, few, few).mean(few), worn.postures.mean)


def test_what_only_legs_show_leaves_arms_unknown(worn):
    postures, legs = worn.postures, worn.parts[0]
    every = np.arange(len(worn.segments))
    by_legs, by_all = (postures.assumed(postures.mean, one, one).spread for one in (legs, every))
    arms = np.setdiff1d(every, legs)
    beside = by_legs[0][np.ix_(arms, legs)] / by_all[0][np.ix_(arms, legs)]
    within = by_legs[0][np.ix_(legs, legs)] / by_all[0][np.ix_(legs, legs)]
    assert np.nanmedian(beside) > np.nanmedian(within) + 0.03
    assert np.nanmin(by_all / postures.spread) >= 1.0


def test_half_a_set_is_the_set_without_the_others(worn):
    taken, half = worn.halves[0]
    of_half, of_all = (square_of_pairs(one.ways[..., 0].T) for one in (half, worn))
    np.testing.assert_array_equal(of_half, of_all[:, taken][..., taken])
    np.testing.assert_allclose(half.postures.spread, worn.postures.spread[:, taken][..., taken])
    assert half.markers == tuple(worn.markers[marker] for marker in taken)


def test_pairs_are_the_rows_above_the_diagonal():
    square = square_of_pairs(np.array([1.0, 2.0, 3.0]))
    np.testing.assert_array_equal(square, [[np.nan, 1, 2], [1, np.nan, 3], [2, 3, np.nan]])


def test_one_marker_has_no_pair():
    np.testing.assert_array_equal(square_of_pairs(np.zeros((2, 0))), np.full((2, 1, 1), np.nan))


def test_the_median_is_of_what_is_known():
    assert median_of_known(np.array([4.0, np.nan, 1.0, 2.0, 9.0])) == 3.0
    assert median_of_known(np.full(3, np.nan)) == median_of_known(np.zeros(0)) == 0.0


def test_ways_of_a_marker_are_those_of_its_pairs(worn):
    found = np.moveaxis(worn.postures.ways_of_markers, (1, 2), (0, 1))
    expected = square_of_pairs(worn.ways.T).swapaxes(0, 1)
    others = ~np.eye(len(worn.segments), dtype=bool)
    np.testing.assert_array_equal(found[..., others], expected[..., others])
