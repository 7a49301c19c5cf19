"""Compiled loops for what jumps and slips are told by; `steps` is the NumPy twin and says what each function returns.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.compiling import compile_function
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.repair.steps import LEAST_LINE, LEAST_SEEN, LINE_FRAMES


@compile_function
def jumps(series: Floats) -> Floats:
    """How far the line through the frames from each on lies from that through the frames before it."""
    n_frames, n_series = series.shape
    result, sums = np.zeros((n_frames, n_series)), np.empty((5, n_series))
    result[:1] = math.nan  # nothing is before it
    for first in range(1 - LINE_FRAMES, n_frames):
        _fill_sums(sums, series, first)
        beyond = first + LINE_FRAMES
        for column in range(n_series):
            if first >= 0:
                result[first, column] += _line_end(sums[:, column], 0.5)
            if beyond < n_frames:
                result[beyond, column] -= _line_end(sums[:, column], 0.5 - LINE_FRAMES)
    return result


@compile_function
def _fill_sums(sums: Floats, series: Floats, first: int) -> None:
    """Number of known values in the frames from one on, sums of their times from 0, squares, values, and products."""
    sums[:] = 0.0
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


@compile_function
def _line_end(sums: Floats, start: float) -> float:
    """Value at time 0 of the line through frames of which the first is at `start`; NaN if too few are known."""
    n = sums[0]
    if n < LEAST_LINE:
        return math.nan
    t, tx = sums[1] + start * n, sums[4] + start * sums[3]
    tt = sums[2] + start * (sums[1] + t)
    return float((tt * sums[3] - t * tx) / (n * tt - t * t))


@compile_function
def changes(series: Floats, window: int, skipped: int = 0) -> Floats:
    """Mean over the `window` frames from each on, or some later, less that over those before."""
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


@compile_function
def lengths(positions: Floats, marker: int, others: Ints) -> Floats:
    """Distances [mm] of one marker to others."""
    result = np.empty((len(positions), len(others)))
    for frame in range(len(positions)):
        for column in range(len(others)):
            total = 0.0
            for axis in range(3):
                away = positions[frame, marker, axis] - positions[frame, others[column], axis]
                total += away * away
            result[frame, column] = math.sqrt(total)
    return result


@compile_function
def relative_steps(steps: Floats, marker: int, others: Ints) -> Floats:
    """Steps of a marker [mm] less the median of the known steps of others, the lower one of two."""
    result = np.empty((len(steps), 3))
    values = np.empty(len(others))
    for frame in range(len(steps)):
        for axis in range(3):
            for index in range(len(others)):
                values[index] = steps[frame, others[index], axis]
            usual = _lower_median(values)
            result[frame, axis] = steps[frame, marker, axis] - (0.0 if math.isnan(usual) else usual)
    return result


@compile_function
def _lower_median(values: Floats) -> float:
    """Median of few known values, the lower one of two; NaN if none is known."""
    n_known = 0
    for value in values:
        n_known += value == value  # noqa: PLR0124 - not so of NaN
    wanted = (n_known - 1) // 2
    for value in values:
        n_below, n_like = 0, 0
        for other in values:
            n_below += other < value
            n_like += other == value
        if n_below <= wanted < n_below + n_like:
            return float(value)
    return math.nan


@compile_function
def expected_places(positions: Floats, chosen: Ints, neighbours: Ints, longest: float) -> tuple[Floats, Floats]:
    """Expect each chosen label where it was last, moved on by the median step of its neighbours."""
    n_frames = len(positions)
    places, ages = np.empty((n_frames, len(chosen), 3)), np.empty((n_frames, len(chosen)))
    places[:], ages[:] = math.nan, math.inf
    values = np.empty(neighbours.shape[1])
    for column in range(len(chosen)):
        marker, last = chosen[column], -1
        travelled, then = np.zeros(3), np.zeros(3)
        for frame in range(1, n_frames):
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


@compile_function
def strayed(positions: Floats, expected: Floats, factor: float) -> tuple[Bools, Ints]:
    """Which labels are `factor` times nearer to another one's expected place than to their own, and to whose."""
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


@compile_function
def fitted_steps(
    positions: Floats, marker: int, mates: Ints, sudden: Floats, weights: Floats, seen: Floats, direct: float
) -> Floats:
    """Step of a marker [mm] by least squares from those of its distances and from that which is seen in space."""
    result = np.empty((len(sudden), 3))
    normal, towards = np.empty((3, 3)), np.empty(3)
    for frame in range(len(sudden)):
        normal[:] = 0.0
        for axis in range(3):
            normal[axis, axis] = direct
            result[frame, axis] = direct * seen[frame, axis]
        for mate in range(len(weights)):
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


@compile_function
def _fill_direction(towards: Floats, start: Floats, end: Floats) -> float:
    """Fill in the direction from one point to another, and return how far [mm] it is."""
    for axis in range(3):
        towards[axis] = end[axis] - start[axis]
    length = math.sqrt(towards[0] * towards[0] + towards[1] * towards[1] + towards[2] * towards[2])
    for axis in range(3):
        towards[axis] /= length
    return length


@compile_function
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
