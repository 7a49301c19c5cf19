"""Bridges over gaps of series whose covariance is known."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.kinematics.bridging import bridge, fit_memory, without_outliers

N_FRAMES = 4000
GAP = 25
SHARE = 0.05  # of 0.68 and 0.95: four standard errors of 80 gaps with three axes


@pytest.fixture
def remembering():
    """`remembering(memory, noise)`: an Ornstein-Uhlenbeck series, variance 1, correlation time `memory` frames."""

    def make(memory: float, noise: float) -> np.ndarray:
        random = np.random.default_rng(3)
        keep = np.exp(-1.0 / memory)
        series = random.normal(size=(N_FRAMES, 3))
        for frame in range(1, N_FRAMES):
            series[frame] = keep * series[frame - 1] + np.sqrt(1 - keep**2) * series[frame]
        return series + noise * random.normal(size=series.shape)

    return make


def gaps() -> np.ndarray:
    """Frames of a gap in every 50."""
    return np.arange(N_FRAMES) % 50 >= GAP


@pytest.mark.parametrize(("memory", "noise"), [(5.0, 0.0), (40.0, 0.0), (40.0, 0.3)])
def test_variance_and_noise_are_found(remembering, memory, noise):
    fitted = fit_memory(remembering(memory, noise), ~gaps())
    assert fitted.variance == pytest.approx(1 + noise**2, rel=0.25)  # few hundred independent values
    assert fitted.noise == pytest.approx(noise**2, abs=0.03)


@pytest.mark.parametrize("noise", [0.0, 0.3])
def test_stated_deviations_hold(remembering, noise):
    series, hidden = remembering(40.0, noise), gaps()
    values, std = bridge(series, ~hidden, np.flatnonzero(hidden), fit_memory(series, ~hidden))
    error = np.abs(values - series[hidden]) / std[:, np.newaxis]
    assert (error < 1).mean() == pytest.approx(0.68, abs=SHARE)
    assert (error < 2).mean() == pytest.approx(0.95, abs=SHARE)


def test_far_from_all_known_frames_the_mean_and_the_deviation_of_the_series_are_left(remembering):
    series, known = remembering(5.0, 0.0), np.arange(N_FRAMES) < 3000
    memory = fit_memory(series, known)
    values, std = bridge(series, known, np.array([N_FRAMES - 1]), memory)
    assert values[0] == pytest.approx(memory.mean, abs=0.05)
    assert std[0] == pytest.approx(np.sqrt(memory.variance), rel=0.01)


def test_deviation_rises_towards_the_middle_of_a_gap(remembering):
    series, known = remembering(40.0, 0.0), np.ones(N_FRAMES, dtype=bool)
    known[1000:1041] = False
    _, std = bridge(series, known, np.arange(1000, 1041), fit_memory(series, known))
    assert (np.diff(std[:20]) > 0).all()
    assert (np.diff(std[21:]) < 0).all()


def test_a_constant_series_stays_constant():
    series, known = np.full((10, 3), 7.0), np.arange(10) != 4
    values, std = bridge(series, known, np.array([4]), fit_memory(series, known))
    assert values.tolist() == [[7.0, 7.0, 7.0]]
    assert std[0] == 0.0


@pytest.mark.parametrize("n_known", [1, 2, 3])
def test_few_known_frames_are_enough(n_known):
    series, known = np.arange(30.0).reshape(10, 3), np.arange(10) < n_known
    values, std = bridge(series, known, np.flatnonzero(~known), fit_memory(series, known))
    assert np.isfinite(values).all()
    assert np.isfinite(std).all()


def test_a_value_far_off_all_others_is_an_outlier():
    series = np.random.default_rng(0).normal(size=(100, 3))
    series[7] += 100.0
    assert np.flatnonzero(~without_outliers(series, np.ones(100, dtype=bool))).tolist() == [7]
