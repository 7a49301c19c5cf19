r"""Limb shapes and joints of a whole chain by maximum likelihood, with all poses free (Gaschler 2011, 5.3).

The normal matrix of all unknowns is an arrow: one block per frame (its pose), bordered by the few constants of the
skeleton. The poses are eliminated frame by frame (Schur complement), so that the cost is linear in frames:

.. math::
    S = H_{cc} - \sum_f H_{cf} H_{ff}^{-1} H_{fc}, \qquad S\,\delta c = g_c - \sum_f H_{cf} H_{ff}^{-1} g_f .

The inverse of S, times the noise variance, is the covariance of the constants: the Cramer-Rao bound at the solution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.chain import (
    DAMPING,
    Chain,
    ChainPoses,
    fit_poses,
    normal_equations,
    residuals,
    solve_damped,
    world_arms,
)
from skelgen.model.arrays import Floats

CHUNK_FLOATS = 8_000_000
"""Entries of the largest Jacobian held at once: 64 MB."""

MAX_ROUNDS = 12
STEP_TOLERANCE = 1e-7
"""mm; rounds stop when no constant moves more."""

PRIOR_SPREAD = 30.0
"""mm; constants that the frames do not determine (a joint along its hinge) lean to the start with this spread."""

FREE_RIDGE = 1e-9
"""Relative ridge of the information matrix: only its frames' own orientations, which mean nothing, are as weak."""

LEAST_NOISE = 1e-12
"""mm^2; keeps the prior's weight above zero for exact takes."""


@dataclass(frozen=True, eq=False)
class Calibration:
    """A calibrated chain.

    Attributes
    ----------
    chain : Chain
        Limbs with their maximum likelihood shapes and joints.
    poses : ChainPoses
        Poses in the frames used.
    noise : float, mm
        Standard deviation of one coordinate, with the freedoms of poses and constants taken off.
    information : ndarray, shape (3 (n_markers + n_joints), ...)
        Information matrix of marker offsets, then joints 1 .. n_limbs - 1, in 1 / mm^2 times `noise` squared.
    """

    chain: Chain
    poses: ChainPoses
    noise: float
    information: Floats


def calibrate(chain: Chain, start: ChainPoses, positions: Floats, n_rounds: int | None = None) -> Calibration:
    """Fit marker offsets and joints together with the poses of all frames.

    Parameters
    ----------
    chain : Chain
        First guess.
    start : ChainPoses
        First guess of the poses.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers of some hundred frames, NaN where unseen.
    n_rounds : int, optional
        Rounds at most; 0 keeps the chain and only finds poses, noise and information.
    """
    poses = fit_poses(chain, start, positions)
    first = chain
    squares, noise = _noise(chain, poses, positions)
    for _ in range(MAX_ROUNDS if n_rounds is None else n_rounds):
        information, right = _reduced(chain, poses, positions)
        prior = max(noise, LEAST_NOISE) / PRIOR_SPREAD**2
        away = _packed(first) - _packed(chain)
        step = np.linalg.solve(information + prior * np.eye(len(right)), right + prior * away)
        trial = _unpacked(chain, _packed(chain) + step)
        new_poses = fit_poses(trial, ChainPoses(poses.root.copy(), poses.rotations.copy()), positions)
        new_squares, new_noise = _noise(trial, new_poses, positions)
        if new_squares > squares:
            break
        chain, poses, noise = trial, new_poses, new_noise
        gain, squares = squares - new_squares, new_squares
        if np.abs(step).max() < STEP_TOLERANCE or gain <= 1e-6 * squares:
            break
    information, _ = _reduced(chain, poses, positions)
    return Calibration(chain, poses, float(np.sqrt(noise)), information)


def _packed(chain: Chain) -> Floats:
    return np.concatenate([chain.offsets.ravel(), chain.joints[1:].ravel()])


def _unpacked(chain: Chain, constants: Floats) -> Chain:
    offsets = constants[: 3 * chain.n_markers].reshape(-1, 3)
    joints = np.concatenate([np.zeros((1, 3)), constants[3 * chain.n_markers :].reshape(-1, 3)])
    return chain.moved(joints, offsets)


def _noise(chain: Chain, poses: ChainPoses, positions: Floats) -> tuple[float, float]:
    """Sum of squares [mm^2] and the variance of one coordinate, freedoms taken off."""
    error = residuals(chain, poses, positions)
    n_data = 3 * int((~np.isnan(positions[:, :, 0])).sum())
    n_poses = len(positions) * (3 + 3 * chain.n_limbs)
    freedoms = max(n_data - n_poses - 3 * (chain.n_markers + chain.n_limbs - 1), 0.05 * n_data, 1)
    squares = float((error**2).sum())
    return squares, squares / freedoms


def _reduced(chain: Chain, poses: ChainPoses, positions: Floats) -> tuple[Floats, Floats]:
    """Schur complement of the constants and its right-hand side, summed over frames."""
    n_constants = 3 * (chain.n_markers + chain.n_limbs - 1)
    information = np.zeros((n_constants, n_constants))
    right = np.zeros(n_constants)
    step = max(1, CHUNK_FLOATS // (3 * chain.n_markers * n_constants))
    for start in range(0, len(positions), step):
        part = slice(start, start + step)
        block, side = _reduced_chunk(chain, poses[part], positions[part])
        information += block
        right += side
    return information, right


def _reduced_chunk(chain: Chain, poses: ChainPoses, positions: Floats) -> tuple[Floats, Floats]:
    n_frames = len(positions)
    body_arms = chain.arms()
    hessian, gradient = normal_equations(chain, body_arms, poses, positions)
    seen = (~np.isnan(positions[:, :, 0])).astype(np.float64)
    constants = _constant_jacobian(chain, poses) * seen[:, :, np.newaxis, np.newaxis]
    pose = _pose_jacobian(body_arms, poses) * seen[:, :, np.newaxis, np.newaxis]
    constants = constants.reshape(n_frames, -1, constants.shape[-1])
    pose = pose.reshape(n_frames, -1, pose.shape[-1])
    error = residuals(chain, poses, positions).reshape(n_frames, -1)
    border = pose.swapaxes(1, 2) @ constants
    damping = np.full(n_frames, DAMPING)
    both = np.concatenate([border, gradient[..., np.newaxis]], axis=2)
    solved = solve_damped(hessian, both, damping)
    flat = constants.reshape(-1, constants.shape[-1])
    schur = flat.T @ flat - border.reshape(-1, border.shape[-1]).T @ solved[..., :-1].reshape(-1, border.shape[-1])
    side = flat.T @ error.ravel() - np.einsum("fdc,fd->c", border, solved[..., -1])
    return (schur + schur.T) / 2, side


def _pose_jacobian(body_arms: Floats, poses: ChainPoses) -> Floats:
    """How markers follow the pose, shape (n_frames, n_markers, 3, 3 + 3 n_limbs)."""
    arms = world_arms(body_arms, poses)
    n_frames, n_markers, n_limbs = arms.shape[:3]
    turns = -cross_matrix(arms).transpose(0, 1, 3, 2, 4).reshape(n_frames, n_markers, 3, 3 * n_limbs)
    shift = np.broadcast_to(np.eye(3), (n_frames, n_markers, 3, 3))
    return np.concatenate([shift, turns], axis=3)


def _constant_jacobian(chain: Chain, poses: ChainPoses) -> Floats:
    """How markers follow offsets and joints, shape (n_frames, n_markers, 3, 3 (n_markers + n_limbs - 1))."""
    n_frames, n_markers = len(poses.root), chain.n_markers
    jacobian = np.zeros((n_frames, n_markers, 3, n_markers + chain.n_limbs - 1, 3))
    for marker, limb in enumerate(chain.limb_of_marker):
        jacobian[:, marker, :, marker] = poses.rotations[:, limb]
        beyond = int(limb)
        while (parent := int(chain.parents[beyond])) >= 0:
            jacobian[:, marker, :, n_markers + beyond - 1] = poses.rotations[:, parent]
            beyond = parent
    return jacobian.reshape(n_frames, n_markers, 3, -1)
