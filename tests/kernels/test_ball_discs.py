"""Discs fitted to grey values: derivatives against differences, and fits of drawn discs against what was drawn."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import ndtr

from skelgen._kernels.ball_discs import BRIGHTNESS, RADIUS, STD, fit_discs, normal_equations

TWO = np.array([6.2, 5.9, 4.0, 0.9, 10.8, 7.3, 3.5, 1.0, 0.7])
"""x, y, radius, brightness of two discs that overlap, and the width of their edges."""


def drawn(unknowns, shape=(14, 17)):
    """The brightness that the model of `ball_discs` gives each pixel."""
    rows, columns = np.indices(shape)
    x, y, radius, level = (part[:, np.newaxis, np.newaxis] for part in unknowns[:-1].reshape(-1, 4).T)
    part = np.maximum(ndtr((radius - np.hypot(columns - x, rows - y)) / unknowns[-1]), 1e-12)
    return (1.0 - (1.0 - part).prod(axis=0)) * (part * level).sum(axis=0) / part.sum(axis=0)


def test_the_cost_is_the_sum_of_squared_differences_from_the_model():
    window = np.random.default_rng(1).uniform(size=(14, 17))
    window[:3, :5] = np.nan
    _, _, cost, n_pixels = normal_equations(window, TWO)
    assert n_pixels == 14 * 17 - 15
    assert cost == pytest.approx(np.nansum((drawn(TWO) - window) ** 2), rel=1e-5)  # far edges are left out, 3e-7 each


def test_derivatives_are_those_of_the_cost():
    window = np.zeros((14, 17))
    _, slope, _, _ = normal_equations(window, TWO)
    for place, step in enumerate(np.eye(9) * 1e-6):
        higher, lower = (normal_equations(window, TWO + sign * step)[2] for sign in (1, -1))
        assert (higher - lower) / 4e-6 == pytest.approx(slope[place], rel=1e-4)  # the cost is half of the sum


def test_discs_that_were_drawn_are_found():
    guess = np.array([[6.6, 5.5, 3.6], [10.4, 7.6, 3.9]])
    discs, width, rms = fit_discs(drawn(TWO), guess, 0.05)
    np.testing.assert_allclose(discs[:, : BRIGHTNESS + 1], TWO[:-1].reshape(2, 4), atol=1e-3)
    assert width == pytest.approx(0.7, abs=1e-3)
    assert rms < 1e-3


def test_stated_deviations_are_those_of_the_errors():
    rng, errors, stated = np.random.default_rng(0), [], []
    for _ in range(20):
        noisy = drawn(TWO) + rng.normal(scale=0.02, size=(14, 17))
        discs, _, _ = fit_discs(noisy, TWO[:-1].reshape(2, 4)[:, :3].copy(), 0.05)
        errors.append(discs[:, :RADIUS] - TWO[:-1].reshape(2, 4)[:, :RADIUS])
        stated.append(discs[:, STD])
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(np.sqrt(np.mean(np.square(stated))), rel=0.35)


def test_a_window_without_light_gives_no_discs():
    assert np.isinf(fit_discs(np.zeros((8, 8)), np.array([[4.0, 4.0, 2.0]]), 0.05)[2])
