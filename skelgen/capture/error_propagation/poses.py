"""The second step: the pose of a target from its balls, each weighed by what is known of it (equation 6.3)."""

from __future__ import annotations

import numpy as np

from skelgen.capture.error_propagation.points import point_covariances, seen_by_both
from skelgen.capture.optics.matrices import inverse_symmetric
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import BodyTarget, StereoRig

LEAST_POINTS = 3
"""Balls below which a pose cannot be known."""

LEAST_EIGENVALUE = 1e-10
"""Of the scaled information: balls on one line leave a turn free, and rounding 1e-16 of it."""

_TINY = np.finfo(np.float64).tiny


def pose_covariances(rig: StereoRig, target: BodyTarget, world_from_body: Floats, seen: Bools | None = None) -> Floats:
    """Return the covariance of a target's most likely pose.

    Parameters
    ----------
    rig : StereoRig
        With the noise of its centres.
    target : BodyTarget
        The balls; deviations of their calibration count as further noise.
    world_from_body : ndarray, shape (..., 4, 4), translation in mm
        Where the target is.
    seen : ndarray of bool, shape (..., n_points), optional
        Which balls are seen; those that lie in both images, if not given.

    Returns
    -------
    ndarray, shape (..., 6, 6)
        Of a small turn about the world's axes [rad] and a shift [mm]; NaN where fewer than three balls are seen, or
        such as lie on one line.
    """
    turned = target.points @ np.swapaxes(world_from_body[..., :3, :3], -1, -2)
    points = turned + world_from_body[..., np.newaxis, :3, 3]
    seen = seen_by_both(rig, points) if seen is None else seen
    turn = world_from_body[..., np.newaxis, :3, :3]
    calibrated = (turn * target_variance(target)[:, np.newaxis, :]) @ np.swapaxes(turn, -1, -2)
    weights = inverse_symmetric(point_covariances(rig, points) + calibrated)
    weights = np.where(seen[..., np.newaxis, np.newaxis], weights, 0.0)
    slope = np.concatenate([-cross_matrix(turned), np.broadcast_to(np.eye(3), (*turned.shape, 3))], axis=-1)
    information = (np.swapaxes(slope, -1, -2) @ weights @ slope).sum(axis=-3)
    return _inverse_where(information, seen.sum(axis=-1) >= LEAST_POINTS)


def target_variance(target: BodyTarget) -> Floats:
    """Return the variances of a target's balls along its axes, shape (n_points, 3), mm^2."""
    return np.zeros_like(target.points) if target.std is None else target.std**2


def _inverse_where(information: Floats, is_known: Bools) -> Floats:
    """Inverses of the matrices that are known and regular; the diagonals are scaled, as radians and mm differ."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(information, axis1=-2, axis2=-1), _TINY))
    both = scale[..., :, np.newaxis] * scale[..., np.newaxis, :]
    scaled = information * both
    values = np.linalg.eigvalsh(scaled)
    is_known = is_known & (values[..., 0] > LEAST_EIGENVALUE)
    out = np.full_like(information, np.nan)
    out[is_known] = np.linalg.inv(scaled[is_known]) * both[is_known]
    return out
