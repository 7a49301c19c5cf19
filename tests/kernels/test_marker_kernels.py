"""Steps of markers, evidence of identities, and tracks, against their definitions."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from scipy.optimize import linear_sum_assignment
from scipy.stats import t as student

from skelgen._kernels.distance_statistics import sums_of_distances
from skelgen._kernels.identity_evidence import CHANGE, FOUL_PART, FOUND, FREEDOMS, evidence_of, probabilities
from skelgen._kernels.marker_steps import (
    LINE_FRAMES,
    changes,
    expected_places,
    fitted_steps,
    jumps,
    lengths,
    relative_steps,
    strayed,
)
from skelgen._kernels.track_matching import find_pairs, match, rising_order


def test_jumps_are_steps_between_lines_through_the_frames_before_and_after():
    series = np.random.default_rng(0).normal(size=(30, 2))
    found, times = jumps(series), np.arange(LINE_FRAMES) + 0.5
    for column in range(2):
        after = np.polyfit(times, series[15 : 15 + LINE_FRAMES, column], 1)[1]
        before = np.polyfit(-times[::-1], series[15 - LINE_FRAMES : 15, column], 1)[1]
        assert found[15, column] == pytest.approx(after - before)


def test_constant_velocity_is_no_jump_and_too_few_frames_tell_none():
    line = np.arange(30.0)[:, np.newaxis] * [1.0, -2.0]
    assert np.nanmax(np.abs(jumps(line))) < 1e-9
    assert np.isnan(jumps(line[:4])).all()


def test_changes_are_between_means_before_and_after():
    series = np.random.default_rng(1).normal(size=(40, 1))
    series[12] = np.nan
    found = changes(series, 6, 2)
    assert found[15, 0] == pytest.approx(series[17:23].mean() - np.nanmean(series[9:15]))
    assert np.isnan(found[:6]).all()
    assert np.isnan(changes(series[:10], 6, 0)).all()


def test_lengths_and_steps_against_the_median_of_others():
    positions = np.random.default_rng(2).normal(size=(5, 4, 3))
    positions[2, 1] = np.nan
    others = np.array([1, 2, 3])
    wanted = np.linalg.norm(positions[:, [0]] - positions[:, 1:], axis=2)
    np.testing.assert_allclose(lengths(positions, 0, others), wanted)
    found = relative_steps(positions, 0, others)
    np.testing.assert_allclose(found[0], positions[0, 0] - np.median(positions[0, 1:], axis=0))
    np.testing.assert_allclose(found[2], positions[2, 0] - positions[2, 2:].min(axis=0))  # the lower one of two


def test_labels_are_expected_where_they_were_moved_on_with_their_neighbours():
    positions = np.random.default_rng(3).normal(size=(1, 4, 3)) + np.arange(12.0)[:, np.newaxis, np.newaxis]
    positions[5:9, 0] = np.nan
    neighbours = np.tile(np.arange(4), (4, 1))
    places, ages = expected_places(positions, np.array([0]), neighbours, 2.0)
    assert np.isinf(ages[0, 0])
    assert ages[[4, 5, 6, 7], 0].tolist() == [1, 1, 2, 3]
    np.testing.assert_allclose(places[6, 0], positions[4, 0] + 2.0)
    assert np.isnan(places[7]).all()


def test_labels_that_exchanged_places_have_strayed():
    expected = np.array([[[0.0, 0, 0], [100.0, 0, 0], [0, 100.0, 0]]])
    found, target = strayed(expected[:, [1, 0, 2]].copy(), expected, 2.0)
    assert found.tolist() == [[True, True, False]]
    assert target[0, :2].tolist() == [1, 0]


def test_a_step_is_fitted_to_jumps_of_distances_by_least_squares():
    random = np.random.default_rng(4)
    positions, mates, weights = random.normal(scale=100.0, size=(3, 6, 3)), np.arange(1, 6), random.uniform(1, 2, 5)
    sudden, seen, direct = random.normal(size=(3, 5)), random.normal(size=(3, 3)), 0.5
    found = fitted_steps(positions, 0, mates, sudden, np.append(weights, direct), seen)
    for frame in range(3):
        away = positions[frame, 0] - positions[frame, mates]
        rows = np.sqrt(weights)[:, np.newaxis] * away / np.linalg.norm(away, axis=1, keepdims=True)
        left = np.concatenate([rows, np.sqrt(direct) * np.eye(3)])
        right = np.concatenate([np.sqrt(weights) * sudden[frame], np.sqrt(direct) * seen[frame]])
        np.testing.assert_allclose(found[frame], np.linalg.lstsq(left, right)[0], rtol=1e-9)


def test_evidence_is_the_odds_of_distances_against_nowhere_and_against_rivals():
    positions = np.array([[[0.0, 0, 0], [103.0, 0, 0], [0, 60.0, 0]]])
    distance, spread = np.array([[np.nan, 100, 50], [100, np.nan, 120], [50, 120, np.nan]]), np.full((3, 3), 2.0)
    mates, rivals, reach = np.array([[1, 2], [0, 2], [0, 1]]), np.full((3, 1), -1), 1000.0
    evidence, rival, n_seen = evidence_of(positions, distance, spread, mates, rivals, reach)

    def density(length, middle):
        return (1 - FOUL_PART) * student.pdf((length - middle) / 2.0, FREEDOMS) / 2.0 + FOUL_PART / reach

    assert evidence[0, 0] == pytest.approx(np.log(density(103, 100) * density(60, 50) * reach**2), rel=1e-5)
    assert rival[0].tolist() == [-1, -1, -1]
    assert n_seen[0].tolist() == [2, 2, 2]


def test_probabilities_are_those_of_all_ways_through_right_and_wrong():
    random = np.random.default_rng(5)
    evidence = random.normal(scale=2.0, size=(5, 1)).astype(np.float32)
    seen, breaks = np.ones((5, 1), dtype=bool), np.array([[False], [False], [True], [False], [False]])
    right, lost = 0.8, 0.3
    found = probabilities(evidence, 1.0, seen, np.zeros((0, 0), dtype=bool), breaks, (right, lost))
    total, held = 0.0, np.zeros(5)
    for states in product([True, False], repeat=5):
        chance = right if states[0] else 1 - right
        for frame in range(1, 5):
            lose, find = (lost, FOUND) if breaks[frame, 0] else (CHANGE, CHANGE)
            stay, change = (1 - lose, lose) if states[frame - 1] else (1 - find, find)
            chance *= stay if states[frame] == states[frame - 1] else change
        chance *= np.exp(evidence[list(states), 0].sum(dtype=float))
        total += chance
        held += chance * np.array(states)
    np.testing.assert_allclose(found[:, 0], held / total, rtol=1e-6)


def test_numbers_are_sorted_and_equal_ones_stay_as_they_come():
    values = np.array([3.0, 1.0, 3.0, 2.0, 1.0, 0.0])
    assert rising_order(values).tolist() == np.argsort(values, kind="stable").tolist()


def test_tracks_and_points_are_matched_for_the_largest_gain():
    random = np.random.default_rng(6)
    gain = np.where(random.uniform(size=(8, 10)) < 0.6, random.uniform(0.1, 5.0, size=(8, 10)), 0.0)
    pairs = np.argwhere(gain > 0)
    found = match(pairs, gain[gain > 0], 8, 10, True)
    rows, columns = linear_sum_assignment(gain, maximize=True)
    matched = np.flatnonzero(found >= 0)
    assert gain[matched, found[matched]].sum() == pytest.approx(gain[rows, columns].sum())
    assert len(set(found[matched].tolist())) == len(matched)


def test_greedy_matching_takes_the_largest_gain_first():
    pairs, gains = np.array([[0, 0], [0, 1], [1, 0], [1, 1]]), np.array([5.0, 4.0, 4.5, 0.1])
    assert match(pairs, gains, 2, 2, False).tolist() == [0, 1]
    assert match(pairs, gains, 2, 2, True).tolist() == [1, 0]


def test_pairs_are_those_in_reach_with_a_gain():
    points = np.array([[0.0, 0, 0], [3.0, 0, 0], [50.0, 0, 0]])
    expected, terms = (
        np.array([[1.0, 0, 0]]),
        np.array([[10.0, 20.0, 4.0, 4.0]]),
    )  # reach, gain, squared width, exponent
    pairs, gains, is_crowded = find_pairs(expected, terms, points, np.ones(3), rising_order(points[:, 0].copy()))
    assert sorted(pairs[:, 1].tolist()) == [0, 1]
    assert not is_crowded
    assert gains[0] == pytest.approx(20.0 - 4.0 * np.log1p(1.0 / 4.0))


def test_distances_are_summed_over_the_moments_that_show_both():
    points = np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0], [0.0, 0.0, 0.0], [6.0, 8.0, 0.0], [9.0, 9.0, 9.0]])
    markers, starts = np.array([0, 1, 1, 0, 2]), np.array([0, 2, 4, 5])
    weight, total, squares = sums_of_distances(3, points, markers, starts, np.array([1.0, 0.5, 2.0]))
    assert weight.tolist() == [[1.5, 1.5, 0.0], [1.5, 1.5, 0.0], [0.0, 0.0, 2.0]]
    assert (total[0, 1], total[1, 0], squares[0, 1]) == (10.0, 10.0, 75.0)
    assert not total[2].any()
