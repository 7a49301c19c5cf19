"""How well candidate poses of a limb explain points: each marker by the point that is nearest to where it would be."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import kernel
from skelgen._kernels.small_matrices import dot, minus, plus, turned, vector
from skelgen.model.arrays import Bools, Floats


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
        turn = vector(poses[pose], 0, 0), vector(poses[pose], 1, 0), vector(poses[pose], 2, 0)
        origin = poses[pose, 0, 3], poses[pose, 1, 3], poses[pose, 2, 3]
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
