"""Balls of two images to points in space: all pairs that can be one ball are kept, and which share a ball is told.

Of 40 balls in each image some five pairs too many lie within the noise of one epipolar plane. Which of them are real
is decided by what is known beside one pair of images: the rigid bodies, or the time before.
"""

from __future__ import annotations

from functools import cache
from types import ModuleType
from typing import NamedTuple

import numpy as np

from skelgen.capture.optics.epipolar import Rays, candidates, essential_matrix, rays_of, sampson_distances
from skelgen.capture.optics.projection import camera_numbers
from skelgen.capture.optics.triangulation import triangulate_rays
from skelgen.capture.values import Balls, StereoPoints
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import Camera, StereoRig

GATE = 5.0
"""Standard deviations from the epipolar constraint up to which a pair is kept: of two million true pairs one is lost,
and a calibration that errs by more than its noise says still works."""


class _Matched(NamedTuple):
    """Pairs of balls (n, 2), their points in the world, covariances, and shifts [px]."""

    pairs: Ints
    points: Floats
    covariance: Floats
    shift: Floats


def match_and_triangulate(
    left: Balls, right: Balls, rig: StereoRig, gate: float = GATE, compiled: bool = True
) -> StereoPoints:
    """Return the points that pairs of balls may be.

    Parameters
    ----------
    left, right : Balls
        What was found in both images of one moment.
    rig : StereoRig
        The cameras; its noise is the least that a centre has.
    gate : float
        Pairs farther from the epipolar constraint than so many standard deviations are left out.
    compiled : bool
        Use the compiled twin; NumPy's is used in any case where numba cannot keep what it compiles.

    Returns
    -------
    StereoPoints
        In the order of the left balls, then of the right ones; only points in front of both cameras.
    """
    twin = _compiled_twin() if compiled else None
    found = None if twin is None else _match_compiled(twin, left, right, rig, gate)
    pairs, points, covariance, shift = _match_plain(left, right, rig, gate) if found is None else found
    shared = _shared(pairs[:, 0], len(left)) | _shared(pairs[:, 1], len(right))
    return StereoPoints(points, covariance, pairs[:, 0], pairs[:, 1], shift, shared)


def _match_plain(left: Balls, right: Balls, rig: StereoRig, gate: float) -> _Matched:
    from_left, from_right = _rays(rig.left, left, rig.noise), _rays(rig.right, right, rig.noise)
    distances = sampson_distances(essential_matrix(rig), from_left, from_right)
    first, second = np.nonzero(candidates(distances, gate))
    found = triangulate_rays(rig, _taken(from_left, first), _taken(from_right, second))
    shift = np.hypot(
        found.corrected.left_shift * _noise(left, rig.noise)[first],
        found.corrected.right_shift * _noise(right, rig.noise)[second],
    )
    is_before = np.isfinite(found.points[:, 0]) & np.isfinite(found.covariance[:, 0, 0])
    pairs = np.stack([first, second], axis=1)[is_before]
    return _Matched(pairs, found.points[is_before], found.covariance[is_before], shift[is_before])


def _match_compiled(twin: ModuleType, left: Balls, right: Balls, rig: StereoRig, gate: float) -> _Matched | None:
    """The same, compiled; None if a pair lies next to an epipole."""
    seen = [
        (np.ascontiguousarray(balls.centres, dtype=np.float64), _noise(balls, rig.noise), camera_numbers(eye))
        for balls, eye in ((left, rig.left), (right, rig.right))
    ]
    right_from_left = rig.right_from_left
    turn, shift = np.ascontiguousarray(right_from_left[:3, :3]), np.ascontiguousarray(right_from_left[:3, 3])
    pairs, inside, covariance, shifts, is_sure = twin.match(*seen, turn, shift, cross_matrix(shift) @ turn, gate)
    if not is_sure:
        return None
    pose = rig.left.camera_from_world
    back = pose[:3, :3].T
    return _Matched(pairs, (inside - pose[:3, 3]) @ back.T, back @ covariance @ back.T, shifts)


@cache
def _compiled_twin() -> ModuleType | None:
    try:
        from skelgen.capture.optics import compiled  # noqa: PLC0415 - numba takes a second to import
    except (ImportError, RuntimeError):
        return None
    return compiled


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
