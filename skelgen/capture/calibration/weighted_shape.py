r"""The shape of a rigid body from many frames, each point weighed with its covariance (Gaschler 2011, 4.18 and 4.19).

Triangulated points err several times as much in depth as across, and in other directions from frame to frame. The
shape M, in its normal form, and the poses T of all frames minimise :math:`\sum r^T \Sigma^{-1} r` by Gauss-Newton; the
poses are eliminated frame by frame, and what is left is the information matrix of the shape.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix, matrix_from_vector
from skelgen.model.arrays import Bools, Floats

MAX_STEPS = 20
STEP_TOLERANCE = 1e-7
"""mm; steps below change nothing that anyone could measure."""

POSE_FREEDOMS = 6


@dataclass(frozen=True, eq=False)
class WeightedShape:
    """A rigid body in its normal form.

    Attributes
    ----------
    points : ndarray, shape (n_points, 3), mm
        First at the origin, second on x, third in the xy plane.
    covariance : ndarray, shape (3 n_points, 3 n_points), mm^2
        Of all coordinates; 0 for those that the normal form fixes.
    world_from_body : ndarray, shape (n_frames, 4, 4)
        Poses.
    noise : float
        Root mean square residual in stated standard deviations, freedoms taken off; 1 if they are true.
    """

    points: Floats
    covariance: Floats
    world_from_body: Floats
    noise: float


def fit_weighted_shape(points: Floats, poses: Floats, positions: Floats, covariances: Floats) -> WeightedShape:
    """Refine a body's shape and poses.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        First guess, in the normal form.
    poses : ndarray, shape (n_frames, 4, 4)
        World from body, first guess.
    positions : ndarray, shape (n_frames, n_points, 3), mm
        Measured; NaN where unseen. Every frame must fix a pose.
    covariances : ndarray, shape (n_frames, n_points, 3, 3), mm^2
        Of the measured points; what is unseen is not looked at.

    Returns
    -------
    WeightedShape
        Its covariance is never smaller than the residuals say.
    """
    seen = ~np.isnan(positions[:, :, 0])
    weights = np.linalg.inv(np.where(seen[..., np.newaxis, np.newaxis], covariances, np.eye(3)))
    weights[~seen] = 0.0
    free = _free(len(points))
    points, poses = points.copy(), poses.copy()
    for _ in range(MAX_STEPS):
        information, pull, back = _reduced(points, poses, np.nan_to_num(positions), weights)
        step = np.zeros(points.size)
        step[free] = np.linalg.solve(information[np.ix_(free, free)], pull[free])
        points += step.reshape(points.shape)
        poses = _stepped(poses, back(step))
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    information, _, _ = _reduced(points, poses, np.nan_to_num(positions), weights)
    noise = _noise(points, poses, positions, weights, seen)
    covariance = np.zeros((points.size, points.size))
    covariance[np.ix_(free, free)] = max(noise, 1.0) ** 2 * np.linalg.inv(information[np.ix_(free, free)])
    return WeightedShape(points, covariance, poses, noise)


def _free(n_points: int) -> Bools:
    """Which coordinates the normal form leaves free, shape (3 n_points,)."""
    point, axis = np.divmod(np.arange(3 * n_points), 3)
    return np.asarray(axis < point)


def _residuals(points: Floats, poses: Floats, positions: Floats) -> tuple[Floats, Floats]:
    arms = np.einsum("fij,kj->fki", poses[:, :3, :3], points)
    return arms, positions - arms - poses[:, np.newaxis, :3, 3]


def _reduced(
    points: Floats, poses: Floats, positions: Floats, weights: Floats
) -> tuple[Floats, Floats, Callable[[Floats], Floats]]:
    """Information and pull of the shape with the poses eliminated, and the step of the poses that goes with one."""
    arms, residuals = _residuals(points, poses, positions)
    slopes = np.concatenate([-cross_matrix(arms), np.broadcast_to(np.eye(3), (*arms.shape, 3))], axis=3)
    turns = poses[:, np.newaxis, :3, :3]
    pushed = slopes.swapaxes(2, 3) @ weights
    of_poses = np.linalg.inv((pushed @ slopes).sum(axis=1))
    mixed = (pushed @ turns).transpose(0, 2, 1, 3).reshape(len(poses), POSE_FREEDOMS, -1)
    pull_poses = (pushed @ residuals[..., np.newaxis]).sum(axis=1)[..., 0]
    own = (turns.swapaxes(2, 3) @ weights @ turns).sum(axis=0)
    pull = (turns.swapaxes(2, 3) @ weights @ residuals[..., np.newaxis]).sum(axis=0).ravel()
    information = np.zeros((points.size, points.size))
    for point in range(len(points)):
        block = slice(3 * point, 3 * point + 3)
        information[block, block] = own[point]
    eliminated = of_poses @ mixed
    information -= np.einsum("fai,faj->ij", mixed, eliminated)
    pull -= np.einsum("fai,fa->i", eliminated, pull_poses)

    def back(step: Floats) -> Floats:
        return np.asarray(np.einsum("fab,fb->fa", of_poses, pull_poses - mixed @ step))

    return information, pull, back


def _stepped(poses: Floats, steps: Floats) -> Floats:
    poses = poses.copy()
    poses[:, :3, :3] = matrix_from_vector(steps[:, :3]) @ poses[:, :3, :3]
    poses[:, :3, 3] += steps[:, 3:]
    return poses


def _noise(points: Floats, poses: Floats, positions: Floats, weights: Floats, seen: Bools) -> float:
    _, residuals = _residuals(points, poses, np.nan_to_num(positions))
    squares = float(np.einsum("fki,fkij,fkj->", residuals, weights, residuals))
    freedoms = 3 * int(seen.sum()) - POSE_FREEDOMS * len(poses) - int(_free(len(points)).sum())
    return float(np.sqrt(squares / max(freedoms, 1)))
