"""How many independent frames a series of residuals is worth: soft tissue makes errors that last."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats


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
    correlation = _correlation(residuals)
    return _effective(correlation * np.abs(correlation) if of_squares else correlation)


def effective_frames_of_both(residuals: Floats) -> tuple[float, float]:
    """Return the number of independent frames that would tell as much of the mean, and as much of the variance."""
    correlation = _correlation(residuals)
    return _effective(correlation), _effective(correlation * np.abs(correlation))


def _correlation(residuals: Floats) -> Floats:
    """How alike residuals are that are 0, 1, ... frames apart, 1 for themselves, shape (n_frames,)."""
    n_frames = len(residuals)
    squares = float((residuals**2).sum())
    if n_frames < 2 or squares == 0:
        return np.append(np.ones(min(n_frames, 1)), np.zeros(max(n_frames - 1, 0)))
    spectrum = np.fft.rfft(residuals, 2 * n_frames, axis=0)
    power = (spectrum.real**2 + spectrum.imag**2).sum(axis=1)
    return np.asarray(np.fft.irfft(power)[:n_frames] / squares)


def _effective(correlation: Floats) -> float:
    n_frames = len(correlation)
    pairs = correlation[: n_frames - n_frames % 2].reshape(-1, 2).sum(axis=1)
    ends = np.flatnonzero(pairs <= 0)
    total = pairs[: ends[0] if len(ends) else None].sum()
    return float(n_frames / max(2 * total - 1, 1.0))
