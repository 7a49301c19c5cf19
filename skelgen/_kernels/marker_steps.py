"""Changes of series, steps of neighbours, and where labels are expected: what jumps of labels are found by."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel, kernel_part
from skelgen.model.arrays import Bools, Floats, Ints

LINE_FRAMES = 8
"""Frames of the lines: as many as markers move straight for."""

LEAST_LINE = 5
"""Of these, those in which the series must be known."""

LEAST_SEEN = 0.5
"""Part of the frames of a window in which the series must be known for its mean."""


@kernel
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
    n_frames, n_series = series.shape
    result, sums = np.zeros((n_frames, n_series)), np.empty((5, n_series))
    for column in range(n_series if n_frames > 0 else 0):
        result[0, column] = math.nan  # nothing is before it
    for first in range(1 - LINE_FRAMES, n_frames):
        _fill_sums(sums, series, first)
        beyond = first + LINE_FRAMES
        for column in range(n_series):
            if first >= 0:
                result[first, column] += _line_end(sums, column, 0.5)
            if beyond < n_frames:
                result[beyond, column] -= _line_end(sums, column, 0.5 - LINE_FRAMES)
    return result


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


@kernel
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
    n_frames, n_series = series.shape
    result = np.full((n_frames, n_series), np.nan)
    if n_frames < 2 * window + skipped:
        return result
    total, count = np.zeros((n_frames + 1, n_series)), np.zeros((n_frames + 1, n_series), dtype=np.int64)
    for frame in range(n_frames):
        for column in range(n_series):
            value = series[frame, column]
            known = not math.isnan(value)
            total[frame + 1, column] = total[frame, column] + (value if known else 0.0)
            count[frame + 1, column] = count[frame, column] + known
    for frame in range(window, n_frames - window - skipped + 1):
        first = frame + skipped
        for column in range(n_series):
            before = count[frame, column] - count[frame - window, column]
            after = count[first + window, column] - count[first, column]
            if min(before, after) >= LEAST_SEEN * window:
                mean = (total[frame, column] - total[frame - window, column]) / before
                result[frame, column] = (total[first + window, column] - total[first, column]) / after - mean
    return result


@kernel
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
    for frame in range(len(positions)):
        for column in range(len(others)):
            total = 0.0
            for axis in range(3):
                away = positions[frame, marker, axis] - positions[frame, others[column], axis]
                total += away * away
            result[frame, column] = math.sqrt(total)
    return result


@kernel
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
    values = np.empty(len(others))
    for frame in range(len(steps)):
        for axis in range(3):
            for index in range(len(others)):
                values[index] = steps[frame, others[index], axis]
            usual = _lower_median(values)
            result[frame, axis] = steps[frame, marker, axis] - (0.0 if math.isnan(usual) else usual)
    return result


@kernel_part
def _lower_median(values: Floats) -> float:
    """Median of few known values, the lower one of two; NaN if none is known."""
    n_known = 0
    for index in range(len(values)):
        n_known += not math.isnan(values[index])
    wanted = (n_known - 1) // 2
    for index in range(len(values)):
        n_below, n_like = 0, 0
        for other in range(len(values)):
            n_below += values[other] < values[index]
            n_like += values[other] == values[index]
        if n_below <= wanted < n_below + n_like:
            return float(values[index])
    return math.nan


@kernel
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
    n_frames = len(positions)
    places, ages = np.empty((n_frames, len(chosen), 3)), np.empty((n_frames, len(chosen)))
    values, travelled, then = np.empty(neighbours.shape[1]), np.empty(3), np.empty(3)
    for column in range(len(chosen)):
        marker, last = chosen[column], -1
        for axis in range(3):
            travelled[axis] = then[axis] = 0.0
        for frame in range(n_frames):
            ages[frame, column] = math.inf
            for axis in range(3):
                places[frame, column, axis] = math.nan
            if frame == 0:
                continue
            if not math.isnan(positions[frame - 1, marker, 0]):
                last = frame - 1
                for axis in range(3):
                    then[axis] = travelled[axis]
            for axis in range(3):
                for index in range(len(values)):
                    other = neighbours[marker, index]
                    values[index] = positions[frame, other, axis] - positions[frame - 1, other, axis]
                step = _lower_median(values)
                travelled[axis] += 0.0 if math.isnan(step) else step
            if last >= 0:
                ages[frame, column] = frame - last
                if frame - last <= longest:
                    for axis in range(3):
                        places[frame, column, axis] = positions[last, marker, axis] + travelled[axis] - then[axis]
    return places, ages


@kernel
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
    n_frames, n_markers = positions.shape[:2]
    found, target = np.zeros((n_frames, n_markers), dtype=np.bool_), np.zeros((n_frames, n_markers), dtype=np.intp)
    for frame in range(n_frames):
        for marker in range(n_markers):
            own, nearest = math.nan, math.inf
            for other in range(n_markers):
                x = positions[frame, marker, 0] - expected[frame, other, 0]
                y = positions[frame, marker, 1] - expected[frame, other, 1]
                z = positions[frame, marker, 2] - expected[frame, other, 2]
                square = x * x + y * y + z * z
                if other == marker:
                    own = square
                if square < nearest:  # never true of NaN
                    nearest = square
                    target[frame, marker] = other
            found[frame, marker] = own > factor**2 * nearest and target[frame, marker] != marker
    return found, target


@kernel
def fitted_steps(positions: Floats, marker: int, mates: Ints, sudden: Floats, weights: Floats, seen: Floats) -> Floats:
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
    weights : ndarray, shape (n_mates + 1,)
        Of the distances, and of the step in space.
    seen : ndarray, shape (n_frames, 3), mm
        Step in space.

    Returns
    -------
    ndarray, shape (n_frames, 3), mm
    """
    result = np.empty((len(sudden), 3))
    normal, towards, direct = np.empty((3, 3)), np.empty(3), weights[len(mates)]
    for frame in range(len(sudden)):
        for axis in range(3):
            for other in range(axis):
                normal[axis, other] = 0.0
            normal[axis, axis] = direct
            result[frame, axis] = direct * seen[frame, axis]
        for mate in range(len(mates)):
            jump = sudden[frame, mate]
            length = _fill_direction(towards, positions[frame, mates[mate]], positions[frame, marker])
            if length > 0.0 and not math.isnan(jump):
                for axis in range(3):
                    weighted = weights[mate] * towards[axis]
                    result[frame, axis] += weighted * jump
                    for other in range(axis + 1):
                        normal[axis, other] += weighted * towards[other]
        _solve(normal, result[frame])
    return result


@kernel_part
def _fill_direction(towards: Floats, start: Floats, end: Floats) -> float:
    """Fill in the direction from one point to another, and return how far [mm] it is."""
    for axis in range(3):
        towards[axis] = end[axis] - start[axis]
    length = math.sqrt(towards[0] * towards[0] + towards[1] * towards[1] + towards[2] * towards[2])
    for axis in range(3):
        towards[axis] /= length
    return length


@kernel_part
def _solve(normal: Floats, right: Floats) -> None:
    """Solve a system of three equations in place by Cholesky's factor, of whose matrix the lower half is given."""
    for row in range(3):
        for column in range(row + 1):
            for known in range(column):
                normal[row, column] -= normal[row, known] * normal[column, known]
            normal[row, column] = (
                math.sqrt(normal[row, row]) if row == column else normal[row, column] / normal[column, column]
            )
        for known in range(row):
            right[row] -= normal[row, known] * right[known]
        right[row] /= normal[row, row]
    for row in range(2, -1, -1):
        for known in range(row + 1, 3):
            right[row] -= normal[known, row] * right[known]
        right[row] /= normal[row, row]
