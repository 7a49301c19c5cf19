"""The same spots labelled by OpenCV: for comparison, and where numba cannot be had."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen.capture.detection.plain import measured_spots
from skelgen.capture.detection.spots import MOST_RUNS, N_COLUMNS
from skelgen.capture.images import opencv
from skelgen.capture.values import Image

_Table = NDArray[np.int64]
_FOUR_NEIGHBOURS = 4


def histogram(image: Image, row_step: int) -> _Table:
    """Count the grey levels of every `row_step`-th row, shape (256,)."""
    counts = opencv().calcHist([np.ascontiguousarray(image[::row_step])], [0], None, [256], [0, 256])
    return np.asarray(counts, dtype=np.int64).ravel()  # a row or a column, by the version of OpenCV


def find_spots(image: Image, low: int, weights: _Table, min_area: int) -> tuple[_Table, bool]:
    """Label and measure the spots of an image; arguments and results as `plain.find_spots`."""
    cv2 = opencv()
    _, bright = cv2.threshold(np.ascontiguousarray(image), low, 255, cv2.THRESH_BINARY)
    n_labels, labels = cv2.connectedComponents(bright, connectivity=_FOUR_NEIGHBOURS, ltype=cv2.CV_32S)
    if n_labels > MOST_RUNS:
        return np.empty((0, N_COLUMNS), dtype=np.int64), True
    return measured_spots(image, labels, n_labels - 1, weights, min_area), False
