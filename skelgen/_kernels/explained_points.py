"""How points are explained by places that are predicted of markers.

Of markers in one pose: which explain each point, those whose predicted places are within their gates, a few of many. Of
many candidate poses of a limb: how well each explains the points, each marker by the point that is nearest to where it
would be.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import contiguous, kernel
from skelgen._kernels.distance_statistics import squared_distance
from skelgen._kernels.small_matrices import block, column, dot, minus, plus, turned, vector
from skelgen.model.arrays import Bools, Floats, Ints

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
            score = squared_distance(predicted[frame], marker, points, point) * factor[frame, marker] + 1.0
            if score > 0.0:
                if count < len(scores):
                    pairs[0, count], pairs[1, count], scores[count] = point, marker, score
                count += 1
    return count


class LimbMarkers(NamedTuple):
    """Markers of a limb.

    Attributes
    ----------
    offsets : ndarray, shape (n_markers, 3), mm
        In the frame of the limb.
    deviations : ndarray, shape (n_markers,), mm
        Of each marker, per coordinate.
    """

    offsets: Floats
    deviations: Floats


def scores_of_poses(poses: Floats, limb: LimbMarkers, points: Floats, chance: float) -> tuple[Floats, Bools]:
    """Log likelihood of points by each pose over chance [nats], and the points that it explains.

    Parameters
    ----------
    poses : ndarray, shape (n_poses, 4, 4)
        World from limb.
    limb : LimbMarkers
        What it carries.
    points : ndarray, shape (n_points, 3), mm
        One frame.
    chance : float
        Logarithm of the volume [mm^3] in which one point is expected by chance.

    Returns
    -------
    tuple of ndarray, shapes (n_poses,) and (n_poses, n_points)
        Markers that no point explains better than chance count nothing.
    """
    scores, used = np.zeros(len(poses)), np.zeros((len(poses), len(points)), dtype=np.bool_)
    peaks = chance - 1.5 * np.log(2.0 * np.pi * limb.deviations**2)
    _add_scores(poses, limb, points, peaks, scores, used)
    return scores, used


@kernel
def _add_scores(poses: Floats, limb: LimbMarkers, points: Floats, peaks: Floats, scores: Floats, used: Bools) -> None:
    for pose in range(len(poses)):
        turn, origin = block(poses[pose], 0, 0), column(poses[pose], 3)
        for marker in range(len(peaks)):
            place = plus(turned(turn, vector(limb.offsets, marker, 0)), origin)
            nearest, least = 0, math.inf
            for point in range(len(points)):
                away = minus(place, vector(points, point, 0))
                square = dot(away, away)
                if square < least:
                    nearest, least = point, square
            gain = peaks[marker] - 0.5 * least / limb.deviations[marker] ** 2
            if gain > 0.0:
                scores[pose] += gain
                used[pose, nearest] = True
