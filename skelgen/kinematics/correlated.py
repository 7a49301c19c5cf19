"""How many independent frames a series of residuals is worth: soft tissue makes errors that last."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats

FEW_LAGS = 32
"""Lags whose products take less time than a Fourier transform that finds all."""


def effective_frames(residuals: Floats, *, of_squares: bool = False) -> float:
    """Return the number of independent frames that would tell as much.

    The correlation times are summed over lags as long as two neighbouring ones add up to more than nothing (Geyer
    1992, *Practical Markov chain Monte Carlo*, 3.3), so that independent residuals count in full.

    Parameters
    ----------
    residuals : ndarray, shape (n_frames, n_rows)
        In the order of time; of any unit.
    of_squares : bool
        Count what their variance rests on, not their mean: the squares of normal numbers forget twice as fast.
    """
    return _effective(_correlation(residuals), len(residuals), of_squares)


def effective_frames_of_both(residuals: Floats) -> tuple[float, float]:
    """Return the number of independent frames that would tell as much of the mean, and as much of the variance."""
    correlation = _correlation(residuals)
    return _effective(correlation, len(residuals), False), _effective(correlation, len(residuals), True)


def _correlation(residuals: Floats) -> Floats:
    """How alike residuals are that are 0, 1, ... frames apart, 1 for themselves, until two lags are none in sum.

    Few lags are summed one by one, at the cost of a product each; if the residuals last, all are found at once.
    """
    n_frames, n_rows = residuals.shape
    flat = np.ascontiguousarray(residuals).ravel()
    squares = float(flat @ flat)
    if n_frames < 2 or squares == 0:
        return np.ones(1)
    found: list[float] = []
    for lag in range(0, min(n_frames - 1, FEW_LAGS), 2):
        ways = (lag * n_rows, (lag + 1) * n_rows)
        found += [float(flat[way:] @ flat[: len(flat) - way]) / squares for way in ways]
        if found[-2] + found[-1] <= 0:
            return np.array(found[:-2])
    spectrum = np.fft.rfft(residuals, 2 * n_frames, axis=0)
    power = (spectrum.real**2 + spectrum.imag**2).sum(axis=1)
    correlation = np.fft.irfft(power)[: n_frames - n_frames % 2] / squares
    ends = np.flatnonzero(correlation.reshape(-1, 2).sum(axis=1) <= 0)
    return np.asarray(correlation[: 2 * ends[0] if len(ends) else None])


def _effective(correlation: Floats, n_frames: int, of_squares: bool) -> float:
    if of_squares:
        correlation = correlation * np.abs(correlation)
    return float(n_frames / max(2 * correlation.sum() - 1, 1.0))
