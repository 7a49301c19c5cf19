"""Bright spots of an image: its histogram, spots by union-find over runs of pixels, centres from the spots' edges.

Brightness is a weight of 0 .. `FULL`, a whole number, so that sums over pixels have no rounding. A spot is one row of
such sums. Two runs of bright pixels belong to one spot if they touch in neighbouring rows (four neighbours).

The brightness-weighted centre of a ball uses what lies between the two thresholds, which after saturation is a thin rim
that the grid of pixels cuts at random. A better centre comes from the whole edge: the grey values I of a ring about the
rim are weighted with h = exp(-(rho - r)^2 / (2 w^2)), where rho is the distance from the centre c. The sum of
I h (p - c) / rho vanishes where c is the middle of a shape that is symmetric about it. That is the filter matched to a
blurred edge, and two steps of Newton's method from the weighted centre find its zero.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen.model.arrays import Floats

FULL = 4096
"""Weight of a pixel at or above the upper threshold: finer than 8 bits, so that rounding does not count."""

MOST_PIXELS = 16_384
"""Longest side [px] of an image whose second moments cannot overflow 63 bits."""

MOST_RUNS = 30_000
"""Runs of bright pixels beyond which an image is noise: 40 balls have about 1000."""

(
    AREA,  # pixels above the lower threshold
    M00,  # sum of weights w
    M10,  # sum of w x
    M01,
    M20,  # sum of w x^2
    M11,
    M02,
    EDGE,  # pixels between both thresholds, which alone carry the noise of the camera into the centre
    EDGE_X,  # sum of their x
    EDGE_Y,
    EDGE_XX,  # sum of their x^2
    EDGE_YY,
    LEFT,  # first and last column and row
    RIGHT,
    TOP,
    BOTTOM,
) = range(16)
"""Columns of a table of spots. Those before `LEFT` are sums."""

N_COLUMNS = 16

RING = 0.7
"""Width w [px] of the ring: up to 1.4 px noise does as little harm, but dull metal beside a ball does more."""

REACH = 3.0
"""Widths to both sides of the rim within which the ring is drawn."""

NEWTON_STEPS = 2
"""The second step moves a centre by less than 1e-3 px."""

NEAREST = 0.5
"""Distance [px] from the centre within which a pixel has no direction."""

_NO_PARENT = -1

Image = NDArray[np.uint8]
SpotTable = NDArray[np.int64]


@array_kernel
def histogram(image: Image, row_step: int) -> NDArray[np.int64]:
    """Count the grey levels of some rows of an image.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        Grey image.
    row_step : int
        Every so many rows one is counted.

    Returns
    -------
    ndarray of int64, shape (256,)
        Number of pixels of each grey level.
    """
    counts = np.zeros((4, 256), dtype=np.int64)  # four in turn: a count need not wait for the one before
    for y in range(0, image.shape[0], row_step):
        for x in range(image.shape[1]):
            counts[x & 3, image[y, x]] += 1
    total = np.zeros(256, dtype=np.int64)
    for level in range(256):
        total[level] = counts[0, level] + counts[1, level] + counts[2, level] + counts[3, level]
    return total


@array_kernel
def find_spots(image: Image, low: int, weights: NDArray[np.int64], min_area: int) -> tuple[SpotTable, bool]:
    """Label and measure the spots of an image: pixels brighter than `low`, joined to their four neighbours.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        Grey image.
    low : int, grey levels
        The lower threshold.
    weights : ndarray of int64, shape (256,)
        Weight of each grey level, 0 .. `FULL`.
    min_area : int, px
        Spots of fewer pixels are left out.

    Returns
    -------
    spots : ndarray of int64, shape (n_spots, N_COLUMNS)
        Sums of each spot by the columns above, in the order of their first runs.
    is_noise : bool
        Whether there are too many runs of bright pixels to be balls; `spots` is empty then.
    """
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
            parents[n_runs], ranks[n_runs] = _NO_PARENT, 0  # as runs come: nothing else is ever touched
            x = _sum_run(image, y, x, low, weights, runs[n_runs])
            while above < end and runs[above, RIGHT] < runs[n_runs, LEFT]:
                above += 1
            other = above
            while other < end and runs[other, LEFT] <= runs[n_runs, RIGHT]:
                _join(parents, ranks, n_runs, other)
                other += 1
            n_runs += 1
    return _sums_of_spots(runs[:n_runs], parents, min_area), False


@kernel_part
def _sum_run(image: Image, y: int, start: int, low: int, weights: NDArray[np.int64], run: NDArray[np.int64]) -> int:
    """Fill the sums of the run that begins at `start`; return the column behind its last pixel."""
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


@kernel_part
def _root(parents: NDArray[np.int64], run: int) -> int:
    """Return the root of a run's tree, and halve the path to it."""
    while parents[run] != _NO_PARENT:
        above = parents[run]
        if parents[above] == _NO_PARENT:
            return int(above)
        parents[run] = parents[above]
        run = int(above)
    return run


@kernel_part
def _join(parents: NDArray[np.int64], ranks: NDArray[np.int64], one: int, other: int) -> None:
    """Join two trees by rank."""
    one, other = _root(parents, one), _root(parents, other)
    if one == other:
        return
    if ranks[one] < ranks[other]:
        one, other = other, one
    parents[other] = one
    if ranks[one] == ranks[other]:
        ranks[one] += 1


@array_part
def _sums_of_spots(runs: SpotTable, parents: NDArray[np.int64], min_area: int) -> SpotTable:
    """Return the sums of each spot that is large enough, in the order of their first runs."""
    for run in range(len(runs)):
        root = _root(parents, run)
        if root == run:
            continue
        for column in range(LEFT):
            runs[root, column] += runs[run, column]
        runs[root, LEFT], runs[root, RIGHT] = (
            min(runs[root, LEFT], runs[run, LEFT]),
            max(runs[root, RIGHT], runs[run, RIGHT]),
        )
        runs[root, TOP], runs[root, BOTTOM] = (
            min(runs[root, TOP], runs[run, TOP]),
            max(runs[root, BOTTOM], runs[run, BOTTOM]),
        )
    n_spots = 0
    for run in range(len(runs)):
        if parents[run] == _NO_PARENT and runs[run, AREA] >= min_area:
            n_spots += 1
    spots = np.empty((n_spots, N_COLUMNS), dtype=np.int64)
    spot = 0
    for run in range(len(runs)):
        if parents[run] == _NO_PARENT and runs[run, AREA] >= min_area:
            spots[spot] = runs[run]
            spot += 1
    return spots


@array_kernel
def edge_centres(image: Image, spots: SpotTable, background: float) -> Floats:
    """Return the centres of spots that are one ball each, from their edges.

    Parameters
    ----------
    image : ndarray of uint8, shape (height, width)
        Grey image.
    spots : ndarray of int64, shape (n_spots, N_COLUMNS)
        All spots of the image.
    background : float, grey levels
        Brightness of what is dark.

    Returns
    -------
    ndarray, shape (n_spots, 3)
        x and y [px], and the standard deviation of each for a noise of one grey level [px]. NaN for a spot whose ring
        leaves the image, touches another spot, or does not converge.
    """
    centres = np.empty((len(spots), 3))
    for spot in range(len(spots)):
        x, y = spots[spot, M10] / spots[spot, M00], spots[spot, M01] / spots[spot, M00]
        radius = math.sqrt(spots[spot, M00] / (FULL * math.pi))
        reach = radius + REACH * RING
        window = math.floor(x - reach), math.ceil(x + reach), math.floor(y - reach), math.ceil(y + reach)
        left, right, top, bottom = window
        is_free = left >= 0 and top >= 0 and right < image.shape[1] and bottom < image.shape[0]
        for other in range(len(spots)):
            is_beside = spots[other, LEFT] > right or spots[other, RIGHT] < left
            is_beside = is_beside or spots[other, TOP] > bottom or spots[other, BOTTOM] < top
            is_free = is_free and (other == spot or is_beside)
        for column in range(3):
            centres[spot, column] = np.nan
        if is_free:
            _centre_of_edge(image, window, (x, y, radius), background, centres[spot])
    return centres


@kernel_part
def _centre_of_edge(
    image: Image, window: tuple[int, int, int, int], disc: tuple[float, float, float], background: float, centre: Floats
) -> None:
    """Fill a centre and its deviation by Newton's steps from a disc x, y, radius; leave it if they diverge."""
    left, right, top, bottom = window
    x, y, radius = disc
    spread, slope = 0.0, 0.0
    for _ in range(NEWTON_STEPS):
        spread, slope, sum_x, sum_y = 0.0, 0.0, 0.0, 0.0
        for row in range(top, bottom + 1):
            for column in range(left, right + 1):
                across, down = column - x, row - y
                distance = max(math.sqrt(across * across + down * down), NEAREST)
                off = distance - radius
                ring = math.exp(-off * off / (2.0 * RING * RING))
                light = (image[row, column] - background) * ring
                spread += ring * ring
                slope += light * (1.0 / distance - off / (RING * RING)) / 2.0
                sum_x += light * across / distance
                sum_y += light * down / distance
        if slope <= 0.0:
            return
        x += sum_x / slope
        y += sum_y / slope
    if math.hypot(x - disc[0], y - disc[1]) < RING:
        centre[0], centre[1], centre[2] = x, y, math.sqrt(spread / 2.0) / slope
