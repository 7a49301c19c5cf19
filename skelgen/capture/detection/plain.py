"""The plain twin of the compiled pass: the same whole numbers from SciPy's labels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
    RIGHT,
    TOP,
)
from skelgen.capture.values import Image

_Table = NDArray[np.int64]


def histogram(image: Image, row_step: int) -> _Table:
    """Count the grey levels of every `row_step`-th row, shape (256,)."""
    return np.bincount(image[::row_step].ravel(), minlength=256).astype(np.int64)


def find_spots(image: Image, low: int, weights: _Table, min_area: int) -> tuple[_Table, bool]:
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
        The columns of `skelgen.capture.detection.spots`; the order depends on the twin.
    is_noise : bool
        Whether there are too many runs of bright pixels to be balls; `spots` is empty then.
    """
    from scipy import ndimage  # noqa: PLC0415 - the compiled twin needs none of it

    bright = image > low
    starts = bright.copy()
    starts[:, 1:] &= ~bright[:, :-1]
    if np.count_nonzero(starts) > MOST_RUNS:
        return np.empty((0, N_COLUMNS), dtype=np.int64), True
    labels, n_spots = ndimage.label(bright)
    return measured_spots(image, labels, int(n_spots), weights, min_area), False


def measured_spots(image: Image, labels: NDArray[np.integer], n_spots: int, weights: _Table, min_area: int) -> _Table:
    """Return the table of spots that are labelled 1 .. `n_spots` already, shape (n_spots, N_COLUMNS)."""
    y, x = np.nonzero(labels)
    spot, weight = labels[y, x] - 1, weights[image[y, x]]
    is_edge = (weight < FULL).astype(np.int64)
    terms = {AREA: np.ones_like(weight), M00: weight, M10: weight * x, M01: weight * y, M20: weight * x * x}
    terms |= {M11: weight * x * y, M02: weight * y * y, EDGE: is_edge, EDGE_X: is_edge * x, EDGE_Y: is_edge * y}
    terms |= {EDGE_XX: is_edge * x * x, EDGE_YY: is_edge * y * y}
    spots = np.zeros((n_spots, N_COLUMNS), dtype=np.int64)
    for column, values in terms.items():
        np.add.at(spots[:, column], spot, values)
    spots[:, LEFT], spots[:, TOP] = image.shape[1], image.shape[0]
    np.minimum.at(spots[:, LEFT], spot, x)
    np.minimum.at(spots[:, TOP], spot, y)
    np.maximum.at(spots[:, RIGHT], spot, x)
    np.maximum.at(spots[:, BOTTOM], spot, y)
    return spots[spots[:, AREA] >= min_area]
