"""Which markers explain each point: those whose predicted places are within their gates, a few of many."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import contiguous, kernel
from skelgen.model.arrays import Floats, Ints

FIRST_ROOM = 2
"""Markers per point that there is room for at first: most points have one."""


def explained_points(
    points: Floats, frames: Ints, predicted: Floats, gates: Floats
) -> tuple[Ints, Ints, NDArray[np.float32]]:
    """Return points, their markers, and 1 - (distance / gate)^2 of each, above 0; point after point, shape (n,) each.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        Measured points.
    frames : ndarray of intp, shape (n_points,)
        Frame of each.
    predicted : ndarray, shape (n_frames, n_markers, 3), mm
        Where markers must be; NaN where nothing is known.
    gates : ndarray, shape (n_frames, n_markers), mm
        Largest distances that are explained, above 0.
    """
    points, predicted, factor = contiguous(points, predicted, -1.0 / gates**2)
    frames = frames.astype(np.intp)
    room = FIRST_ROOM * len(points)
    while True:
        pairs, scores = np.empty((2, room), dtype=np.intp), np.empty(room, dtype=np.float32)
        count = _write_explained(points, frames, predicted, factor, pairs, scores)
        if count <= room:
            return pairs[0, :count], pairs[1, :count], scores[:count]
        room = count


@kernel
def _write_explained(
    points: Floats, frames: Ints, predicted: Floats, factor: Floats, pairs: Ints, scores: NDArray[np.float32]
) -> int:
    """Write what `explained_points` returns as far as there is room, and return how many there are."""
    count = 0
    for point in range(len(points)):
        frame = frames[point]
        for marker in range(predicted.shape[1]):
            square = 0.0
            for axis in range(3):
                away = predicted[frame, marker, axis] - points[point, axis]
                square += away * away
            score = square * factor[frame, marker] + 1.0
            if score > 0.0:
                if count < len(scores):
                    pairs[0, count], pairs[1, count], scores[count] = point, marker, score
                count += 1
    return count
