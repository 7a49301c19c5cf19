"""How values become places: round values along an axis, a logarithmic scale of colours, extremes of stretches."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints

_ROUND_STEPS = (1.0, 2.0, 5.0, 10.0)


def round_below(value: float) -> float:
    """Return the largest of 1, 2, 5, 10, ... that does not exceed a positive value."""
    power = 10.0 ** math.floor(math.log10(value))
    return max(power * factor for factor in _ROUND_STEPS if power * factor <= value)


def ticks(low: float, high: float, wanted: int) -> list[float]:
    """Return about `wanted` round values that lie in low .. high."""
    if not high > low:
        return [low]
    rough = (high - low) / wanted
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(power * factor for factor in _ROUND_STEPS if power * factor >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [index * step for index in range(first, last + 1)]


_DECADES = 4.0  # range of the colours: numerical noise far below the largest value is not worth a colour


@dataclass(frozen=True)
class LogScale:
    """A logarithmic scale of matrix cells.

    Attributes
    ----------
    low, high : float
        Values that get the first and the last colour; what is lower counts as `low`.
    """

    low: float
    high: float

    @classmethod
    def of(cls, values: Floats) -> LogScale:
        """Return the scale of some values, any shape; NaN, 0 and what is very much smaller than the largest apart."""
        positive = values[values > 0]
        high = float(positive.max()) if len(positive) else 1.0
        low = max(float(positive.min()), high / 10**_DECADES) if len(positive) else high
        return cls(low, high) if low < high else cls(high / 10, high)

    def fractions(self, values: Floats) -> Floats:
        """Return where values lie on the scale, 0 .. 1, for `ramp_rgba`; NaN stays."""
        clipped_low: Floats = np.maximum(values, self.low)  # keeps NaN
        return np.asarray(np.log10(clipped_low / self.low) / np.log10(self.high / self.low))


def envelope(values: Floats, n_bins: int) -> tuple[Floats, Floats, Floats]:
    """Decimate a curve honestly: the smallest and the largest value of each stretch, so that no peak is lost.

    Parameters
    ----------
    values : ndarray, shape (n,)
        One value per frame, NaN where unknown.
    n_bins : int
        Number of stretches at most.

    Returns
    -------
    centres, low, high : ndarray, shape (min(n, n_bins),)
        Middle of each stretch as a frame index, and its extremes; NaN where no frame of it is known.
    """
    starts, stops = bin_edges(len(values), n_bins)
    low = np.fmin.reduceat(values, starts) if len(starts) else np.zeros(0)
    high = np.fmax.reduceat(values, starts) if len(starts) else np.zeros(0)
    return (starts + stops - 1) / 2, low, high


def bin_edges(n_frames: int, n_bins: int) -> tuple[Ints, Ints]:
    """Return first frame and end of each of at most `n_bins` stretches of nearly equal length."""
    edges = np.linspace(0, n_frames, min(n_frames, n_bins) + 1).astype(np.intp)
    return edges[:-1], edges[1:]
