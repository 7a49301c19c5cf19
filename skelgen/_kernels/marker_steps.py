"""Changes of series, steps of neighbours, and where labels are expected: what jumps of labels are found by."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
from skelgen._kernels.small_matrices import TINY, by_symmetric, inverse, minus, set_vector, vector
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
    result = np.zeros(series.shape)
    result[:1] = math.nan  # nothing is before it
    _add_jumps(series, np.empty((5, series.shape[1])), result)
    return result


@kernel
def _add_jumps(series: Floats, sums: Floats, result: Floats) -> None:
    """Add where the lines after a frame begin, and subtract where those before it end; there is room for `sums`."""
    for first in range(1 - LINE_FRAMES, len(series)):
        _fill_sums(sums, series, first)
        beyond = first + LINE_FRAMES
        for column in range(series.shape[1]):
            if first >= 0:
                result[first, column] += _line_end(sums, column, 0.5)
            if beyond < len(series):
                result[beyond, column] -= _line_end(sums, column, 0.5 - LINE_FRAMES)


@kernel_part
def _fill_sums(sums: Floats, series: Floats, first: int) -> None:
    """Number of known values in the frames from one on, sums of their times from 0, squares, values, and products."""
    for row in range(len(sums)):
        for column in range(sums.shape[1]):
            sums[row, column] = 0.0
    for time in range(LINE_FRAMES):
        if 0 <= first + time < len(series):
            for column in range(sums.shape[1]):
                value = series[first + time, column]
                known = 0.0 if math.isnan(value) else 1.0
                value = 0.0 if math.isnan(value) else value
                sums[0, column] += known
                sums[1, column] += known * time
                sums[2, column] += known * (time * time)
                sums[3, column] += value
                sums[4, column] += value * time


@kernel_part
def _line_end(sums: Floats, column: int, start: float) -> float:
    """Value at time 0 of the line through frames of which the first is at `start`; NaN if too few are known."""
    n = sums[0, column]
    if n < LEAST_LINE:
        return math.nan
    t, tx = sums[1, column] + start * n, sums[4, column] + start * sums[3, column]
    tt = sums[2, column] + start * (sums[1, column] + t)
    return float((tt * sums[3, column] - t * tx) / (n * tt - t * t))


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
    result = np.full(series.shape, math.nan)
    if len(series) >= 2 * window + skipped:
        total, count = np.zeros((2, len(series) + 1, series.shape[1]))
        _write_changes(series, (window, skipped), total, count, result)
    return result


@kernel
def _write_changes(series: Floats, frames: tuple[int, int], total: Floats, count: Floats, result: Floats) -> None:
    """Write the changes over a window, of which some frames are skipped; total and count are summed up."""
    window, skipped = frames
    for frame in range(len(series)):
        for column in range(series.shape[1]):
            value = series[frame, column]
            known = not math.isnan(value)
            total[frame + 1, column] = total[frame, column] + (value if known else 0.0)
            count[frame + 1, column] = count[frame, column] + (1.0 if known else 0.0)
    for frame in range(window, len(series) - window - skipped + 1):
        first = frame + skipped
        for column in range(series.shape[1]):
            before = count[frame, column] - count[frame - window, column]
            after = count[first + window, column] - count[first, column]
            if before >= LEAST_SEEN * window and after >= LEAST_SEEN * window:
                mean = (total[frame, column] - total[frame - window, column]) / before
                result[frame, column] = (total[first + window, column] - total[first, column]) / after - mean


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
    result = np.empty((len(positions), len(others)))
    _write_lengths(positions, marker, others, result)
    return result


@kernel
def _write_lengths(positions: Floats, marker: int, others: Ints, result: Floats) -> None:
    for frame in range(len(positions)):
        for column in range(len(others)):
            points = positions[frame]
            result[frame, column] = math.sqrt(squared_distance(points, marker, points, others[column]))


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
    result = np.empty((len(steps), 3))
    _write_relative_steps(steps, marker, others, np.empty(len(others)), result)
    return result


@kernel
def _write_relative_steps(steps: Floats, marker: int, others: Ints, values: Floats, result: Floats) -> None:
    for frame in range(len(steps)):
        for axis in range(3):
            for index in range(len(others)):
                values[index] = steps[frame, others[index], axis]
            usual = _lower_median(values)
            result[frame, axis] = steps[frame, marker, axis] - (0.0 if math.isnan(usual) else usual)


@kernel_part
def _lower_median(values: Floats) -> float:
    """Median of few known values, the lower one of two; NaN if none is known. The values are left in another order."""
    n_known = 0
    for value in values:
        if not math.isnan(value):
            place = n_known
            while place > 0 and values[place - 1] > value:
                values[place] = values[place - 1]
                place -= 1
            values[place] = value
            n_known += 1
    return float(values[(n_known - 1) // 2]) if n_known else math.nan


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
    places = np.full((len(positions), len(chosen), 3), math.nan)
    ages = np.full(places.shape[:2], math.inf)
    _write_expected(positions, chosen, neighbours, np.empty(neighbours.shape[1]), places, ages)
    places[ages > longest] = math.nan
    return places, ages


@kernel
def _write_expected(
    positions: Floats, chosen: Ints, neighbours: Ints, steps: Floats, places: Floats, ages: Floats
) -> None:
    """Write where each label is expected once it has been seen; there is room for the `steps` of its neighbours."""
    for column in range(len(chosen)):
        marker = chosen[column]
        for axis in range(3):
            last, travelled, then = -1, 0.0, 0.0
            for frame in range(1, len(positions)):
                if not math.isnan(positions[frame - 1, marker, 0]):
                    last, then = frame - 1, travelled
                for index in range(len(steps)):
                    other = neighbours[marker, index]
                    steps[index] = positions[frame, other, axis] - positions[frame - 1, other, axis]
                step = _lower_median(steps)
                travelled += 0.0 if math.isnan(step) else step
                if last >= 0:
                    ages[frame, column] = frame - last
                    places[frame, column, axis] = positions[last, marker, axis] + travelled - then


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
    target = np.zeros(positions.shape[:2], dtype=np.intp)
    found = np.zeros(positions.shape[:2], dtype=np.bool_)
    _write_strayed(positions, expected, factor, found, target)
    return found, target


@kernel
def _write_strayed(positions: Floats, expected: Floats, factor: float, found: Bools, target: Ints) -> None:
    for frame in range(positions.shape[0]):
        for marker in range(positions.shape[1]):
            own, nearest = math.nan, math.inf
            for other in range(positions.shape[1]):
                square = squared_distance(positions[frame], marker, expected[frame], other)
                if other == marker:
                    own = square
                if square < nearest:  # never true of NaN
                    nearest = square
                    target[frame, marker] = other
            found[frame, marker] = own > factor**2 * nearest and target[frame, marker] != marker


def fitted_steps(positions: Floats, marker: int, mates: Ints, sudden: Floats, weights: Floats, seen: Floats) -> Floats:
    """Step of a marker [mm] by least squares, from the steps of its distances and from its step as seen in space.

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
    weights : ndarray, shape (n_mates + 1,)
        Of the distances, and of the step in space.
    seen : ndarray, shape (n_frames, 3), mm
        Step in space.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
    """
    result: Floats = weights[-1] * seen
    _fit_steps(positions, marker, mates, sudden, weights, result)
    return result


@kernel
def _fit_steps(positions: Floats, marker: int, mates: Ints, sudden: Floats, weights: Floats, result: Floats) -> None:
    """Replace the weighted steps in space by those that fit the distances, too."""
    for frame in range(len(sudden)):
        direct, points, (a, b, c) = weights[len(mates)], positions[frame], vector(result, frame, 0)
        xx, xy, xz, yy, yz, zz = direct, 0.0, 0.0, direct, 0.0, direct
        for mate in range(len(mates)):
            jump, (x, y, z) = sudden[frame, mate], minus(vector(points, marker, 0), vector(points, mates[mate], 0))
            length = math.sqrt(x * x + y * y + z * z)
            if length > 0.0 and not math.isnan(jump):
                x, y, z = x / length, y / length, z / length
                u, v, w = weights[mate] * x, weights[mate] * y, weights[mate] * z
                xx, xy, xz, yy, yz, zz = xx + u * x, xy + v * x, xz + w * x, yy + v * y, yz + w * y, zz + w * z
                a, b, c = a + u * jump, b + v * jump, c + w * jump
        set_vector(result, frame, 0, by_symmetric(inverse((xx, xy, xz, yy, yz, zz), TINY), (a, b, c)))
