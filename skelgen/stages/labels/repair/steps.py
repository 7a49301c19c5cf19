"""Changes of series from before a frame to after it: of straight lines through a few frames, and of means."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Floats

LINE_FRAMES = 8
"""Frames of the lines: as many as markers move straight for."""

LEAST_LINE = 5
"""Of these, those in which the series must be known."""

LEAST_SEEN = 0.5
"""Part of the frames of a window in which the series must be known for its mean."""


def jumps(series: Floats) -> Floats:
    """How far the line through the frames from each on lies from that through the frames before it, where they meet.

    Constant velocity and constant acceleration are no jumps.

    Parameters
    ----------
    series : ndarray, shape (n_frames, n_series)
        NaN where unknown.

    Returns
    -------
    ndarray, shape (n_frames, n_series)
        NaN where one of the lines is not known.
    """
    times = np.arange(LINE_FRAMES, dtype=np.float64) + 0.5  # from the middle between the frame and the one before
    after = _line_ends(series, times, 0)
    before = _line_ends(series, -times, -LINE_FRAMES)
    return after - before


def changes(series: Floats, window: int, skipped: int = 0) -> Floats:
    """Mean over the `window` frames from each on, or some later, less that over those before; NaN if little is known.

    Parameters
    ----------
    series : ndarray, shape (n_frames, n_series)
        NaN where unknown.
    window : int, frames
        On each side, whole: nothing is said of what lasts beyond the take.
    skipped : int, frames
        Left out from each on: what is over by then is no change.
    """
    known = ~np.isnan(series)
    nothing = np.zeros((1, series.shape[1]))
    total = np.concatenate([nothing, np.cumsum(np.where(known, series, 0.0), axis=0)])
    count = np.concatenate([nothing, np.cumsum(known, axis=0)])
    result = np.full(series.shape, np.nan)
    if len(series) < 2 * window + skipped:
        return result
    with np.errstate(invalid="ignore", divide="ignore"):
        number = count[window:] - count[:-window]
        mean = np.where(number >= LEAST_SEEN * window, (total[window:] - total[:-window]) / number, np.nan)
    result[window : len(series) - window - skipped + 1] = (
        mean[window + skipped :] - mean[: len(mean) - window - skipped]
    )
    return result


def _line_ends(series: Floats, times: NDArray[np.floating], first: int) -> Floats:
    """Value at time 0 of the line through some frames, the first of which is `first` frames after each."""
    n_frames = len(series)
    known = ~np.isnan(series)
    values = np.where(known, series, 0.0)
    if known.all():  # as many frames count for all series
        known = known[:, :1]
    counts, sums = np.zeros((3, *known.shape)), np.zeros((2, *series.shape))
    order = times if first == 0 else times[::-1]
    for offset, time in enumerate(order):
        shift = first + offset
        rows = slice(max(0, -shift), min(n_frames, n_frames - shift))
        there = slice(rows.start + shift, rows.stop + shift)
        for total, power in zip(counts, (1.0, time, time**2), strict=True):
            total[rows] += known[there] * power
        sums[0, rows] += values[there]
        sums[1, rows] += values[there] * time
    (n, t, tt), (x, tx) = counts, sums
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n >= LEAST_LINE, (tt * x - t * tx) / (n * tt - t * t), np.nan)
