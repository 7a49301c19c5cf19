"""Balls of two images to points in space: all pairs that can be one ball are kept, and which share a ball is told.

Of 40 balls in each image some five pairs too many lie within the noise of one epipolar plane. Which of them are real
is decided by what is known beside one pair of images: the rigid bodies, or the time before.
"""

from __future__ import annotations

import numpy as np

from skelgen.capture.blobs import Balls, StereoPoints
from skelgen.capture.optics.epipolar import Rays, candidates, essential_matrix, rays_of, sampson_distances
from skelgen.capture.optics.triangulation import triangulate_rays
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import Camera, StereoRig

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
    from_left, from_right = _rays(rig.left, left, rig.noise), _rays(rig.right, right, rig.noise)
    distances = sampson_distances(essential_matrix(rig), from_left, from_right)
    first, second = np.nonzero(candidates(distances, gate))
    found = triangulate_rays(rig, _taken(from_left, first), _taken(from_right, second))
    shift = np.hypot(
        found.corrected.left_shift * _noise(left, rig.noise)[first],
        found.corrected.right_shift * _noise(right, rig.noise)[second],
    )
    is_before = np.isfinite(found.points[:, 0]) & np.isfinite(found.covariance[:, 0, 0])
    first, second = first[is_before], second[is_before]
    shared = _shared(first, len(left)) | _shared(second, len(right))
    return StereoPoints(found.points[is_before], found.covariance[is_before], first, second, shift[is_before], shared)


def _rays(camera: Camera, balls: Balls, noise: float) -> Rays:
    return rays_of(camera, balls.centres, _noise(balls, noise))


def _noise(balls: Balls, noise: float) -> Floats:
    """Standard deviations [px]: what the detection predicts, never below the rig's, which calibration limits."""
    return np.asarray(np.fmax(balls.std, noise))


def _taken(rays: Rays, indices: Ints) -> Rays:
    return Rays(rays.normalised[indices], rays.spread[indices])


def _shared(indices: Ints, n_balls: int) -> Bools:
    """Whether a ball is part of more than one pair."""
    return np.asarray(np.bincount(indices, minlength=n_balls)[indices] > 1)
