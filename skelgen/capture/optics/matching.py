"""Balls of two images to points in space: all pairs that can be one ball are kept, and those that share a ball marked.

Of 40 balls in each image some five pairs too many lie within the noise of one epipolar plane. Which of them are real
is decided by what is known beside one pair of images: the rigid bodies, or the time before.
"""

from __future__ import annotations

import numpy as np

from skelgen._kernels.stereo_matching import find_pairs
from skelgen.capture.optics.triangulation import geometry_of, triangulate_pairs, view_of
from skelgen.capture.values import Balls, StereoPoints
from skelgen.model.arrays import Bools, Ints
from skelgen.model.rig import StereoRig

GATE = 5.0
"""Standard deviations from the epipolar constraint up to which a pair is kept: of two million true pairs one is lost,
and a calibration that errs by more than its noise says still works."""


def match_and_triangulate(left: Balls, right: Balls, rig: StereoRig, gate: float = GATE) -> StereoPoints:
    """Return the points that pairs of balls may be.

    Parameters
    ----------
    left, right : Balls
        What was found in both images of one moment.
    rig : StereoRig
        The cameras; its noise is the least that a centre has.
    gate : float
        Pairs farther from the epipolar constraint than so many standard deviations are left out.

    Returns
    -------
    StereoPoints
        In the order of the left balls, then of the right ones; only points in front of both cameras.
    """
    in_left, in_right = (
        view_of(camera, balls.centres, np.fmax(balls.std, rig.noise))
        for camera, balls in ((rig.left, left), (rig.right, right))
    )
    pairs = find_pairs(in_left, in_right, geometry_of(rig), gate)
    found = triangulate_pairs(rig, in_left, in_right, pairs)
    is_point = np.isfinite(found.points[:, 0]) & np.isfinite(found.covariance[:, 0, 0])
    first, second = pairs[is_point].T
    distance = np.hypot(
        found.shifts[is_point, 0] * in_left.std[first], found.shifts[is_point, 1] * in_right.std[second]
    )
    shared = _is_shared(first, len(left)) | _is_shared(second, len(right))
    return StereoPoints(found.points[is_point], found.covariance[is_point], first, second, distance, shared)


def _is_shared(balls: Ints, n_balls: int) -> Bools:
    """Whether a ball is part of more than one pair."""
    return np.asarray(np.bincount(balls, minlength=n_balls)[balls] > 1)
