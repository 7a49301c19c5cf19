"""Values predicted from time and features, where the process behind them is known."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.kinematics.gap_filling.gaussian_process import (
    Features,
    Series,
    TimeCovariance,
    fit_variances,
    learnt_frames,
    left_out_errors,
    needed_frames,
    predict,
)

N_FRAMES, RATE, GAP = 2000, 100.0, 25
SHARE = 0.06  # of 0.68 and 0.95: four standard errors of 40 gaps with three axes
NOISE = 0.3  # mm


def hidden() -> np.ndarray:
    """Frames of a gap in every 50."""
    return np.arange(N_FRAMES) % 50 >= GAP


def predicted(values, features=(), curved=(), rate=RATE):
    """Values and deviations in the hidden frames."""
    known, targets = np.flatnonzero(~hidden()), np.flatnonzero(hidden())
    learnt, clock = learnt_frames(known), TimeCovariance(N_FRAMES, rate)
    series = Series(np.arange(N_FRAMES), values, Features(tuple(features), tuple(curved)).scaled(learnt))
    return predict(series, known, targets, clock, fit_variances(series, learnt, clock))


@pytest.fixture
def remembering():
    """An Ornstein-Uhlenbeck series of variance 1 with a correlation time of 0.4 s, and white noise."""
    random, keep = np.random.default_rng(3), np.exp(-1 / 40)
    series = random.normal(size=(N_FRAMES, 3))
    for frame in range(1, N_FRAMES):
        series[frame] = keep * series[frame - 1] + np.sqrt(1 - keep**2) * series[frame]
    return series + NOISE * random.normal(size=series.shape)


def test_stated_deviations_hold(remembering):
    values, std = predicted(remembering)
    error = np.abs(values - remembering[hidden()]) / std[:, np.newaxis]
    assert (error < 1).mean() == pytest.approx(0.68, abs=SHARE)
    assert (error < 2).mean() == pytest.approx(0.95, abs=SHARE)


def test_what_follows_a_feature_is_told_by_it(remembering):
    feature = np.random.default_rng(5).normal(size=(N_FRAMES, 2))
    series = 10 * feature @ np.array([[1.0, 2.0, 0.0], [0.0, 1.0, -1.0]]) + remembering
    error = predicted(series, features=(feature,))[0] - series[hidden()]
    without = predicted(remembering)[0] - remembering[hidden()]
    assert error.std() < 1.2 * without.std()  # the feature's part is known, a little is lost in learning it


def test_what_follows_a_feature_along_a_curve_is_told_by_it():
    feature = np.random.default_rng(5).uniform(-1, 1, size=(N_FRAMES, 1))
    series = np.hstack([feature**2, np.sin(2 * feature), feature])
    error = predicted(series, curved=(feature,))[0] - series[hidden()]
    assert error.std() < 0.1 * series.std(axis=0).mean()


def test_waves_are_carried_through_gaps():
    times = np.arange(N_FRAMES) / RATE
    series = np.sin(2 * np.pi * times[:, np.newaxis] * np.array([0.7, 0.9, 1.3]))
    assert np.abs(predicted(series)[0] - series[hidden()]).max() < 0.02


def test_a_constant_series_stays_constant():
    values, std = predicted(np.full((N_FRAMES, 3), 7.0))
    assert (values == 7.0).all()
    assert std.max() < 1e-6  # mm


def test_deviation_is_largest_in_the_middle_of_a_gap(remembering):
    _, std = predicted(remembering)
    gaps = std.reshape(-1, GAP)
    assert (np.median(gaps, axis=0).argmax() - GAP // 2) ** 2 <= 9
    assert (gaps[:, GAP // 2] > gaps[:, 0]).mean() > 0.9


def test_needed_frames_of_a_long_take_are_few():
    known = np.setdiff1d(np.arange(100_000), np.arange(500, 540))
    needed = needed_frames(known, np.arange(500, 540), RATE)
    assert len(needed) < 600
    assert np.isin(np.arange(490, 550), needed).all()


@pytest.mark.parametrize("n_known", [1, 2, 3])
def test_few_known_frames_are_enough(n_known):
    known, targets, clock = np.arange(n_known), np.arange(n_known, 10), TimeCovariance(10, RATE)
    series = Series(np.arange(10), np.arange(30.0).reshape(10, 3), Features())
    values, std = predict(series, known, targets, clock, fit_variances(series, known, clock))
    assert np.isfinite(values).all()
    assert np.isfinite(std).all()


def test_left_out_errors_are_those_of_values_truly_left_out():
    random = np.random.default_rng(1)
    root = random.normal(size=(8, 8))
    covariance, values = root @ root.T + np.eye(8), random.normal(size=(8, 2))
    towards = covariance[:6, 6:] @ np.linalg.inv(covariance[6:, 6:])
    left = covariance[:6, :6] - towards @ covariance[6:, :6]
    expected = (values[:6] - towards @ values[6:]) / np.sqrt(np.diag(left))[:, np.newaxis]
    assert left_out_errors(np.linalg.inv(covariance), values)[:6] == pytest.approx(expected)
