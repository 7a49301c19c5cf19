"""The compiled pass over an image that finds runs of bright pixels, sums their moments and joins them to spots.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.detection.edges import NEAREST, REACH, RING, STEPS
from skelgen.capture.detection.spots import (
    AREA,
    BOTTOM,
    EDGE,
    EDGE_X,
    EDGE_XX,
    EDGE_Y,
    EDGE_YY,
    FULL,
    LEFT,
    M00,
    M01,
    M02,
    M10,
    M11,
    M20,
    MOST_RUNS,
    N_COLUMNS,
    N_SUMS,
    RIGHT,
    TOP,
)
from skelgen.capture.values import Image
from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats

_Table = NDArray[np.int64]

_NOBODY = -1  # parent of a root: the seed's null pointer


@compile_function
def histogram(image: Image, row_step: int) -> _Table:
    """Count the grey levels of every `row_step`-th row, shape (256,)."""
    counts = np.zeros((4, 256), dtype=np.int64)  # four in turn: a count need not wait for the one before
    for y in range(0, image.shape[0], row_step):
        for x in range(image.shape[1]):
            counts[x & 3, image[y, x]] += 1
    total: _Table = counts[0]
    for part in range(1, 4):
        total += counts[part]
    return total


@compile_function
def _root(parents: _Table, run: int) -> int:
    """Root of a run's tree; the path to it is halved."""
    while parents[run] != _NOBODY:
        above = parents[run]
        if parents[above] == _NOBODY:
            return int(above)
        parents[run] = parents[above]
        run = int(above)
    return run


@compile_function
def _join(parents: _Table, ranks: _Table, one: int, other: int) -> None:
    """Join two trees by rank."""
    one, other = _root(parents, one), _root(parents, other)
    if one == other:
        return
    if ranks[one] < ranks[other]:
        one, other = other, one
    parents[other] = one
    if ranks[one] == ranks[other]:
        ranks[one] += 1


@compile_function
def _sum_run(image: Image, y: int, start: int, low: int, weights: _Table, run: _Table) -> int:
    """Fill the sums of the run that starts at `start`; returns where it stops."""
    run[:] = 0
    x = start
    while x < image.shape[1] and image[y, x] > low:
        weight = weights[image[y, x]]
        run[M00] += weight
        run[M10] += weight * x
        run[M20] += weight * x * x
        if weight < FULL:
            run[EDGE] += 1
            run[EDGE_X] += x
            run[EDGE_XX] += x * x
        x += 1
    run[AREA] = x - start
    run[M01], run[M11], run[M02] = y * run[M00], y * run[M10], y * y * run[M00]
    run[EDGE_Y], run[EDGE_YY] = y * run[EDGE], y * y * run[EDGE]
    run[LEFT], run[RIGHT], run[TOP], run[BOTTOM] = start, x - 1, y, y
    return x


@compile_function
def _add(spot: _Table, run: _Table) -> None:
    """Add a run's sums and extent to its spot's."""
    for column in range(N_SUMS):
        spot[column] += run[column]
    spot[LEFT], spot[RIGHT] = min(spot[LEFT], run[LEFT]), max(spot[RIGHT], run[RIGHT])
    spot[TOP], spot[BOTTOM] = min(spot[TOP], run[TOP]), max(spot[BOTTOM], run[BOTTOM])


@compile_function
def find_spots(image: Image, low: int, weights: _Table, min_area: int) -> tuple[_Table, bool]:
    """Label and measure the spots of an image; arguments and results as `plain.find_spots`."""
    runs = np.empty((MOST_RUNS, N_COLUMNS), dtype=np.int64)
    parents, ranks = np.empty(MOST_RUNS, dtype=np.int64), np.empty(MOST_RUNS, dtype=np.int64)
    n_runs, above, row = 0, 0, 0  # runs so far; first run of the row above that may still touch; first of this row
    for y in range(image.shape[0]):
        above, row, x = row, n_runs, 0
        end = row
        while x < image.shape[1]:
            if image[y, x] <= low:
                x += 1
                continue
            if n_runs == MOST_RUNS:
                return runs[:0], True
            parents[n_runs], ranks[n_runs] = _NOBODY, 0  # as runs come: nothing else is ever touched
            x = _sum_run(image, y, x, low, weights, runs[n_runs])
            while above < end and runs[above, RIGHT] < runs[n_runs, LEFT]:
                above += 1
            other = above
            while other < end and runs[other, LEFT] <= runs[n_runs, RIGHT]:
                _join(parents, ranks, n_runs, other)
                other += 1
            n_runs += 1
    return _gathered(runs[:n_runs], parents, min_area), False


@compile_function
def _gathered(runs: _Table, parents: _Table, min_area: int) -> _Table:
    """Sums of each spot that is large enough, in the order of their first runs."""
    for run in range(len(runs)):
        root = _root(parents, run)
        if root != run:
            _add(runs[root], runs[run])
    n_spots = 0
    for run in range(len(runs)):
        if parents[run] == _NOBODY and runs[run, AREA] >= min_area:
            n_spots += 1
    spots = np.empty((n_spots, N_COLUMNS), dtype=np.int64)
    place = 0
    for run in range(len(runs)):
        if parents[run] == _NOBODY and runs[run, AREA] >= min_area:
            spots[place] = runs[run]
            place += 1
    return spots


@compile_function
def _length(x: float, y: float) -> float:
    """Length of a vector of pixels, which needs none of the care of `math.hypot`."""
    return math.sqrt(x * x + y * y)


@compile_function
def edge_centres(image: Image, spots: _Table, background: float) -> Floats:
    """Return centres of spots from their edges; arguments and result as `edges.edge_centres`."""
    found = np.empty((len(spots), 3))
    for spot in range(len(spots)):
        x, y = spots[spot, M10] / spots[spot, M00], spots[spot, M01] / spots[spot, M00]
        radius = math.sqrt(spots[spot, M00] / (FULL * math.pi))
        reach = radius + REACH * RING
        left, right, top, bottom = (
            math.floor(x - reach),
            math.ceil(x + reach),
            math.floor(y - reach),
            math.ceil(y + reach),
        )
        is_free = left >= 0 and top >= 0 and right < image.shape[1] and bottom < image.shape[0]
        for other in range(len(spots)):
            is_beside = spots[other, LEFT] > right or spots[other, RIGHT] < left
            is_free = is_free and (
                other == spot or is_beside or spots[other, TOP] > bottom or spots[other, BOTTOM] < top
            )
        for column in range(3):
            found[spot, column] = np.nan
        if is_free:
            _settle(image, left, right, top, bottom, x, y, radius, background, found[spot])
    return found


@compile_function
def _settle(
    image: Image,
    left: int,
    right: int,
    top: int,
    bottom: int,
    x: float,
    y: float,
    radius: float,
    background: float,
    found: Floats,
) -> None:
    """Fill a centre and its deviation by Newton's steps from x and y."""
    start_x, start_y, spread, slope = x, y, 0.0, 0.0
    for _ in range(STEPS):
        spread, slope, pull_x, pull_y = 0.0, 0.0, 0.0, 0.0
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                distance = max(_length(column - x, row - y), NEAREST)
                off = distance - radius
                ring = math.exp(-off * off / (2.0 * RING * RING))
                light = (image[row, column] - background) * ring
                spread += ring * ring
                slope += light * (1.0 / distance - off / (RING * RING)) / 2.0
                pull_x += light * (column - x) / distance
                pull_y += light * (row - y) / distance
        if slope <= 0.0:
            return
        x += pull_x / slope
        y += pull_y / slope
    if math.hypot(x - start_x, y - start_y) < RING:
        found[0], found[1], found[2] = x, y, math.sqrt(spread / 2.0) / slope
