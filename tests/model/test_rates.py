from __future__ import annotations

import numpy as np
import pytest

from skelgen.model.rates import rate_of

NTSC = 30 / 1.001


@pytest.mark.parametrize("decimals", [3, 4, 6, 15])
@pytest.mark.parametrize("rate", [12.5, NTSC, 60.0, 99.7, 100.0, 120.0, 250.0])
def test_printed_stamps_tell_the_rate(rate, decimals):
    times = np.round(np.arange(2000) / rate, decimals)
    assert rate_of(times) == pytest.approx(rate, rel=1e-12)


def test_missing_frames_change_no_rate():
    times = np.delete(np.round(np.arange(500) / 120, 6), [5, 6, 7, 200])
    assert rate_of(times) == 120.0


def test_jitter_leaves_the_median_step():
    times = np.cumsum(np.random.default_rng(0).uniform(0.009, 0.011, 500))
    assert rate_of(times) == 1 / np.median(np.diff(times))


def test_without_two_times_the_rate_is_one():
    assert rate_of(np.zeros(3)) == rate_of(np.zeros(0)) == 1.0
