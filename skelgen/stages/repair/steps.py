"""Changes of series from before a frame to after it, steps of neighbours, and where labels are expected, in NumPy.

`compiled_steps` does the same in compiled loops; this is its meaning.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Bools, Floats, Ints

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


def lengths(positions: Floats, marker: int, others: Ints) -> Floats:
    """Distances [mm] of one marker to others, shape (n_frames, n_others); NaN where either is unseen.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    marker : int
        The one.
    others : ndarray of intp, shape (n_others,)
        The others.
    """
    return np.asarray(np.linalg.norm(positions[:, [marker]] - positions[:, others], axis=2))


def relative_steps(steps: Floats, marker: int, others: Ints) -> Floats:
    """Steps of a marker [mm] less the median of the known steps of others, the lower one of two.

    Parameters
    ----------
    steps : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unknown.
    marker : int
        The one.
    others : ndarray of intp, shape (n_others,)
        The others. Where none of theirs is known, nothing is subtracted.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
        Each coordinate for itself; NaN where the marker's own step is unknown.
    """
    return np.asarray(steps[:, marker] - np.nan_to_num(_lower_median(steps[:, others])))


def expected_places(positions: Floats, chosen: Ints, neighbours: Ints, longest: float) -> tuple[Floats, Floats]:
    """Expect each chosen label where it was last, moved on by the median step of its neighbours.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    chosen : ndarray of intp, shape (n_chosen,)
        The labels.
    neighbours : ndarray of intp, shape (n_markers, n_neighbours)
        Markers whose steps count, itself among them.
    longest : float, frames
        A label that was not seen for longer is expected nowhere.

    Returns
    -------
    places : ndarray, shape (n_frames, n_chosen, 3), mm
        NaN where nothing is expected.
    ages : ndarray, shape (n_frames, n_chosen)
        Frames since the label was seen.
    """
    steps = np.diff(positions, axis=0, prepend=np.nan)
    moved = np.stack([_lower_median(steps[:, neighbours[marker]]) for marker in chosen], axis=1)
    travelled = np.cumsum(np.nan_to_num(moved), axis=0)
    own = positions[:, chosen]
    index = np.arange(len(own))[:, np.newaxis]
    last = np.maximum.accumulate(np.where(np.isnan(own[..., 0]), -1, index), axis=0)
    last = np.concatenate([np.full((1, len(chosen)), -1), last[:-1]])
    column = np.arange(len(chosen))
    places = own[last, column] + travelled - travelled[last, column]
    ages = np.where(last < 0, np.inf, index - last)
    return np.where((ages <= longest)[..., np.newaxis], places, np.nan), ages


def strayed(positions: Floats, expected: Floats, factor: float) -> tuple[Bools, Ints]:
    """Which labels are `factor` times nearer to another one's expected place than to their own, and to whose.

    Parameters
    ----------
    positions, expected : ndarray, shape (n_frames, n_markers, 3), mm
        Where labels are and where they are expected; NaN where that is not known.
    factor : float
        How many times.

    Returns
    -------
    strayed : ndarray of bool, shape (n_frames, n_markers)
        The labels.
    target : ndarray of intp, shape (n_frames, n_markers)
        The marker whose expected place is nearest.
    """
    square = np.zeros((*positions.shape[:2], positions.shape[1]))
    for axis in range(3):
        square += (positions[:, :, np.newaxis, axis] - expected[:, np.newaxis, :, axis]) ** 2
    own = np.diagonal(square, axis1=1, axis2=2)
    square = np.where(np.isnan(square), np.inf, square)
    target = np.argmin(square, axis=2)
    nearest = np.take_along_axis(square, target[:, :, np.newaxis], axis=2)[..., 0]
    itself = target == np.arange(positions.shape[1])
    return (own > factor**2 * nearest) & ~itself & np.isfinite(nearest), target


def fitted_steps(
    positions: Floats, marker: int, mates: Ints, sudden: Floats, weights: Floats, seen: Floats, direct: float
) -> Floats:
    """Step of a marker [mm] by least squares from those of its distances and from that which is seen in space.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    marker : int
        The one.
    mates : ndarray of intp, shape (n_mates,)
        Markers to which distances are measured.
    sudden : ndarray, shape (n_frames, n_mates), mm
        Jumps of the distances; NaN where unknown.
    weights : ndarray, shape (n_mates,)
        Of the distances.
    seen : ndarray, shape (n_frames, 3), mm
        Step in space.
    direct : float
        Its weight.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
    """
    away = positions[:, [marker]] - positions[:, mates]
    with np.errstate(invalid="ignore"):  # markers in one place have no direction
        towards = np.nan_to_num(away / np.linalg.norm(away, axis=2, keepdims=True))
    weighted = (towards * np.where(np.isnan(sudden), 0.0, weights)[..., np.newaxis]).swapaxes(1, 2)
    normal = weighted @ towards + direct * np.eye(3)
    right = weighted @ np.nan_to_num(sudden)[..., np.newaxis] + direct * seen[..., np.newaxis]
    return np.asarray(np.linalg.solve(normal, right)[..., 0])


def _lower_median(steps: Floats) -> Floats:
    """Median of the known steps of each frame, the lower one of two; NaN where none is known, shape (n_frames, 3)."""
    ordered = np.sort(steps, axis=1)
    count = (~np.isnan(ordered[..., 0])).sum(axis=1)
    place = (np.maximum(count - 1, 0) // 2)[:, np.newaxis, np.newaxis]
    return np.asarray(np.take_along_axis(ordered, place, axis=1)[:, 0])


def _line_ends(series: Floats, times: NDArray[np.floating], first: int) -> Floats:
    """Value at time 0 of the line through some frames, the first of which is `first` frames after each."""
    n_frames = len(series)
    known = ~np.isnan(series)
    values = np.where(known, series, 0.0)
    counts, sums = np.zeros((3, *known.shape)), np.zeros((2, *series.shape))
    order = times if first == 0 else times[::-1]
    for offset, time in enumerate(order):
        shift = first + offset
        begin = max(0, -shift)
        rows = slice(begin, max(begin, min(n_frames, n_frames - shift)))
        there = slice(rows.start + shift, rows.stop + shift)
        for total, power in zip(counts, (1.0, time, time**2), strict=True):
            total[rows] += known[there] * power
        sums[0, rows] += values[there]
        sums[1, rows] += values[there] * time
    (n, t, tt), (x, tx) = counts, sums
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(n >= LEAST_LINE, (tt * x - t * tx) / (n * tt - t * t), np.nan)
