r"""Rigid bodies calibrated from many frames: their points in one normal form, with covariance (Gaschler 2011, 4.2).

The points and the poses of all frames minimise :math:`\sum_f \|P_f - T_f M\|^2`; `fit_shape` finds both. The frame of a
body is a choice: its normal form has the first point at the origin, the second on the x axis and the third
in the xy plane, from a QR decomposition. The other 3 n - 6 numbers have a covariance of full rank.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import cross_matrix, transform_from
from skelgen.kinematics.bodies.shape import fit_shape
from skelgen.model import Limbs, Trajectories
from skelgen.model.arrays import Bools, Floats, check_floats

POSE_FREEDOMS = 6
FEWEST_POINTS = 3


@dataclass(frozen=True, eq=False)
class RigidBody:
    """A calibrated rigid body.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        Points in the normal form.
    covariance : ndarray, shape (n_points, 3, n_points, 3), mm^2
        Of the points' coordinates; 0 for those that the normal form fixes.
    noise : float, mm
        Standard deviation of one measured coordinate, freedoms taken off.
    world_from_body : ndarray, shape (n_frames, 4, 4)
        Poses of the normal form; NaN in frames that do not determine one.
    """

    points: Floats
    covariance: Floats
    noise: float
    world_from_body: Floats

    @property
    def std(self) -> Floats:
        """Standard deviation [mm] of each coordinate, shape (n_points, 3)."""
        size = self.points.size
        return np.sqrt(np.diag(self.covariance.reshape(size, size))).reshape(self.points.shape)


def calibrate_rigid_body(positions: Floats) -> RigidBody:
    """Estimate the points of a rigid body from many frames.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_points, 3), mm
        Measured points, the same order in every frame; NaN where unseen.

    Raises
    ------
    InputError
        If fewer than three points off a line are seen together, or the first three points are on one line.
    """
    positions = check_floats(positions, (None, None, 3), "positions of a rigid body")
    if positions.shape[1] < FEWEST_POINTS:
        raise InputError(f"a rigid body of {positions.shape[1]} points has no shape; it needs {FEWEST_POINTS}")
    shape = fit_shape(positions, np.arange(len(positions)))
    if not shape.has_pose:
        raise InputError("no frame shows three points of the body that are off a line, so that it has no shape")
    points, body_from_limb = normal_form(shape.points)
    poses = shape.world_from_limb @ np.linalg.inv(body_from_limb)
    seen = ~np.isnan(positions[:, :, 0]) & shape.posed[:, np.newaxis]
    carried = np.einsum("fij,nj->fni", poses[:, :3, :3], points) + poses[:, np.newaxis, :3, 3]
    squares = float((np.where(seen[..., np.newaxis], positions - carried, 0.0) ** 2).sum())
    n_poses = int(seen.any(axis=1).sum())
    freedoms = 3 * int(seen.sum()) - POSE_FREEDOMS * n_poses - (3 * len(points) - POSE_FREEDOMS)
    noise = float(np.sqrt(squares / max(freedoms, 1)))
    return RigidBody(points, noise**2 * _unit_covariance(points, seen), noise, poses)


def limb_bodies(trajectories: Trajectories, limbs: Limbs) -> dict[int, RigidBody]:
    """Calibrate each limb as a rigid body from its markers alone, in the normal form, with covariance.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    limbs : Limbs
        Which marker is on which limb.

    Returns
    -------
    dict of int to RigidBody
        By limb, points in the order of its markers; limbs whose first three markers are on one line, or that have
        fewer, are not there.
    """
    found = {}
    for limb in range(limbs.n_limbs):
        try:
            found[limb] = calibrate_rigid_body(trajectories.positions[:, limbs.markers_of(limb)])
        except InputError:
            continue
    return found


def normal_form(points: Floats) -> tuple[Floats, Floats]:
    """Move points to their normal form (eq. 4.15, 4.16).

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The first three must not lie on one line.

    Returns
    -------
    tuple of ndarray, shapes (n_points, 3) and (4, 4)
        The points in the normal form, and the transform normal from given.

    Raises
    ------
    InputError
        If the first three points are on one line.
    """
    spans = (points[1:] - points[0]).T
    q, upper = np.linalg.qr(spans)
    size = np.linalg.norm(spans[:, :2])
    if min(abs(upper[0, 0]), abs(upper[1, 1])) <= np.sqrt(np.finfo(np.float64).eps) * size:
        raise InputError("the first three points of the body are on one line; list three others first")
    first, second = np.sign(upper[0, 0]) * q[:, 0], np.sign(upper[1, 1]) * q[:, 1]
    turn = np.stack([first, second, np.cross(first, second)])
    normal = (points - points[0]) @ turn.T
    normal.reshape(-1)[_fixed(len(points))] = 0.0
    return normal, transform_from(turn, -turn @ points[0])


def _fixed(n_points: int) -> Bools:
    """Which coordinates the normal form fixes at 0, shape (3 n_points,)."""
    fixed = np.zeros((n_points, 3), dtype=bool)
    fixed[0], fixed[1, 1:], fixed[2, 2] = True, True, True
    return fixed.ravel()


def _unit_covariance(points: Floats, seen: Bools) -> Floats:
    """Covariance of the points for unit noise, all poses free (eq. 4.19), shape (n_points, 3, n_points, 3)."""
    n_points = len(points)
    motion = np.concatenate([np.tile(np.eye(3), (n_points, 1, 1)), -cross_matrix(points)], axis=2).reshape(-1, 6)
    information = np.zeros((3 * n_points, 3 * n_points))
    patterns, counts = np.unique(seen[seen.any(axis=1)], axis=0, return_counts=True)
    for pattern, count in zip(patterns, counts, strict=True):
        shown = np.repeat(pattern, 3).astype(np.float64)
        moved = motion * shown[:, np.newaxis]
        information += count * (np.diag(shown) - moved @ np.linalg.pinv(moved))
    free = np.flatnonzero(~_fixed(n_points))
    covariance = np.zeros_like(information)
    covariance[np.ix_(free, free)] = np.linalg.pinv(information[np.ix_(free, free)], hermitian=True)
    return covariance.reshape(n_points, 3, n_points, 3)
