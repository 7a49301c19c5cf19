r"""Errors from the images to the angles (Gaschler 2011, 6.1): centres of balls, points, poses of bodies, joint angles.

A joint's frames :math:`R_p` and :math:`R_c` in the world differ by the rotation :math:`R_p^T R_c`. Small rotations
:math:`\delta` of the bodies about the world's axes rotate it by :math:`R_p^T (\delta_c - \delta_p)`.
"""

import numpy as np

from skelgen.capture.optics import in_image, project, projection_jacobian
from skelgen.geometry.rotations import cross_matrix, slopes_by_motion
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import BodyTarget, StereoRig, TargetJoint


def point_covariances(rig: StereoRig, points: Floats) -> Floats:
    """Return the covariance of triangulated points (equation 6.2, for the most likely point).

    With J the derivative of the four pixel coordinates by the point it is sigma^2 (J^T J)^-1, which no unbiased
    estimate can be below (Cramer and Rao).

    Parameters
    ----------
    rig : StereoRig
        With the noise of its centres.
    points : ndarray, shape (..., 3), mm
        In the world.

    Returns
    -------
    ndarray, shape (..., 3, 3), mm^2
        NaN for points that are behind a camera; see `seen_by_both` for the images' borders.
    """
    slope = np.concatenate([projection_jacobian(rig.left, points), projection_jacobian(rig.right, points)], axis=-2)
    return rig.noise**2 * _inverse_where_finite(np.swapaxes(slope, -1, -2) @ slope)


def seen_by_both(rig: StereoRig, points: Floats) -> Bools:
    """Return whether points lie in both images, shape (...).

    Parameters
    ----------
    rig : StereoRig
        The cameras.
    points : ndarray, shape (..., 3), mm
        In the world.
    """
    return np.asarray(in_image(rig.left, project(rig.left, points)) & in_image(rig.right, project(rig.right, points)))


LEAST_POINTS = 3
"""Balls below which a pose cannot be known."""

LEAST_EIGENVALUE = 1e-10
"""Of the scaled information: balls on one line leave a rotation undetermined, up to rounding of 1e-16."""

_TINY = np.finfo(np.float64).tiny


def pose_covariances(rig: StereoRig, target: BodyTarget, world_from_body: Floats) -> Floats:
    """Return the covariance of a target's most likely pose.

    Parameters
    ----------
    rig : StereoRig
        With the noise of its centres.
    target : BodyTarget
        The balls; deviations of their calibration count as further noise.
    world_from_body : ndarray, shape (..., 4, 4), translation in mm
        Where the target is; those balls are seen that lie in both images.

    Returns
    -------
    ndarray, shape (..., 6, 6)
        Of a small rotation about the world's axes [rad] and a shift [mm]; NaN where fewer than three balls are seen, or
        such as lie on one line.
    """
    turned = target.points @ np.swapaxes(world_from_body[..., :3, :3], -1, -2)
    points = turned + world_from_body[..., np.newaxis, :3, 3]
    seen = seen_by_both(rig, points)
    turn = world_from_body[..., np.newaxis, :3, :3]
    variance = np.zeros_like(target.points) if target.std is None else target.std**2
    calibrated = (turn * variance[:, np.newaxis, :]) @ np.swapaxes(turn, -1, -2)
    weights = _inverse_where_finite(point_covariances(rig, points) + calibrated)
    weights = np.where(seen[..., np.newaxis, np.newaxis], weights, 0.0)
    slope = slopes_by_motion(turned)
    information = (np.swapaxes(slope, -1, -2) @ weights @ slope).sum(axis=-3)
    return _inverse_where(information, seen.sum(axis=-1) >= LEAST_POINTS)


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


HINGE = "hinge"


def angle_covariance(
    joint: TargetJoint, poses: tuple[Floats, Floats], covariances: tuple[Floats, Floats], *, is_joined: bool = False
) -> Floats:
    """Return the covariance of a joint's angles.

    Parameters
    ----------
    joint : TargetJoint
        With its frames in both bodies.
    poses : tuple of ndarray, shape (..., 4, 4), mm
        world_from_body of the parent and of the child.
    covariances : tuple of ndarray, shape (..., 6, 6)
        Of small rotations about the world's axes [rad] and shifts [mm] of both.
    is_joined : bool
        Whether the estimate uses that the joint holds the bodies together: at its centre, a hinge along its axis as
        well. Otherwise each body is posed by its own balls alone, as in Gaschler (2011).

    Returns
    -------
    ndarray, shape (..., 3, 3) or (..., 1, 1), rad^2
        Of small rotations about the axes of the joint's frame in the parent; of the angle for a hinge.
    """
    both = block_diagonal(*covariances)
    slope = rotation_slope(joint, poses)
    if is_joined:
        constraint = constraint_slope(joint, poses)
        gain = both @ np.swapaxes(constraint, -1, -2)
        both = both - gain @ np.linalg.solve(constraint @ gain, np.swapaxes(gain, -1, -2))
    slope = slope[..., 2:, :] if joint.kind == HINGE else slope
    return np.asarray(slope @ both @ np.swapaxes(slope, -1, -2))


def block_diagonal(*blocks: Floats) -> Floats:
    """Return the covariance of quantities together whose errors are independent, from that of each."""
    ends = np.cumsum([0, *(block.shape[-1] for block in blocks)])
    out = np.zeros((*blocks[0].shape[:-2], ends[-1], ends[-1]))
    for start, end, block in zip(ends[:-1], ends[1:], blocks, strict=True):
        out[..., start:end, start:end] = block
    return out


def rotation_slope(joint: TargetJoint, poses: tuple[Floats, Floats]) -> Floats:
    """Return the derivative of the joint's rotation, in the axes of its frame in the parent, shape (..., 3, 12).

    Parameters
    ----------
    joint : TargetJoint
        With its frames in both bodies.
    poses : tuple of ndarray, shape (..., 4, 4), mm
        world_from_body of the parent and of the child.
    """
    parent_axes = np.swapaxes(poses[0][..., :3, :3] @ joint.parent_from_joint[:3, :3], -1, -2)
    slope = np.zeros((*parent_axes.shape[:-2], 3, 12))
    slope[..., :3], slope[..., 6:9] = -parent_axes, parent_axes
    return slope


def constraint_slope(joint: TargetJoint, poses: tuple[Floats, Floats]) -> Floats:
    """Return the derivative of a joint's constraints, shape (..., 3, 12) for a ball, (..., 5, 12) for a hinge.

    These are the way [mm] from its centre in the parent to that in the child, in the world, and for a hinge the tilts
    [rad] about x and y of its frame in the parent.

    Parameters
    ----------
    joint : TargetJoint
        With its frames in both bodies.
    poses : tuple of ndarray, shape (..., 4, 4), mm
        world_from_body of the parent and of the child.
    """
    parent_arm = poses[0][..., :3, :3] @ joint.parent_from_joint[:3, 3]
    child_arm = poses[1][..., :3, :3] @ joint.child_from_joint[:3, 3]
    slope = np.zeros((*parent_arm.shape[:-1], 3, 12))
    slope[..., :3], slope[..., 6:9] = cross_matrix(parent_arm), -cross_matrix(child_arm)
    slope[..., 3:6], slope[..., 9:] = -np.eye(3), np.eye(3)
    return np.concatenate([slope, rotation_slope(joint, poses)[..., :2, :]], axis=-2) if joint.kind == HINGE else slope


def _inverse_where_finite(matrices: Floats) -> Floats:
    """Inverses of matrices, shape (..., 3, 3); NaN where one holds NaN, for which LAPACK would refuse all."""
    out, is_finite = np.full_like(matrices, np.nan), np.isfinite(matrices).all(axis=(-1, -2))
    out[is_finite] = np.linalg.inv(matrices[is_finite])
    return out
