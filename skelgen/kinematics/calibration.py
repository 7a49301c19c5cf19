r"""Limb shapes and joints of a whole chain by maximum likelihood, with all poses free (Gaschler 2011, 5.3).

The normal matrix of all unknowns is an arrow: one block per frame (its pose), bordered by the few constants of the
skeleton. The poses are eliminated frame by frame (Schur complement), so that the cost is linear in frames:

.. math::
    S = H_{cc} - \sum_f H_{cf} H_{ff}^{-1} H_{fc}, \qquad S\,\delta c = g_c - \sum_f H_{cf} H_{ff}^{-1} g_f .

The inverse of S, times the noise variance, is the covariance of the constants: the Cramer-Rao bound at the solution.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.chain import (
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

STEP_PARTS = (1.0, 0.5, 0.25, 0.1)
"""Parts of a Gauss-Newton step that are tried until one lowers the sum of squares."""

LEAST_GAIN = 0.01
"""Rounds stop when the log-likelihood rises by less than this per constant: less is nothing but noise."""

PRIOR_SPREAD = 30.0
"""mm; constants that the frames do not determine (a joint along its hinge) lean to the start with this spread."""

POSE_DAMPING = 1e-6
"""Relative damping of the eliminated poses; it holds the free turns of the limbs' own frames in place."""

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
    state = _State(chain, fit_poses(chain, start, positions), positions)
    for _ in range(MAX_ROUNDS if n_rounds is None else n_rounds):
        better = _improved(state, chain, positions)
        if better is None:
            break
        moved = float(np.abs(_packed(better.chain) - _packed(state.chain)).max())
        gain = (state.squares - better.squares) / (2 * max(better.noise, LEAST_NOISE))
        state = better
        if moved < STEP_TOLERANCE or gain <= LEAST_GAIN * len(_packed(chain)):
            break
    information = _reduced(state.chain, state.poses, positions).information
    return Calibration(state.chain, state.poses, float(np.sqrt(state.noise)), information)


class _State:
    """A chain with poses, and how well they explain the markers."""

    def __init__(self, chain: Chain, poses: ChainPoses, positions: Floats) -> None:
        self.chain, self.poses = chain, poses
        self.squares, self.noise = _noise(chain, poses, positions)


def _improved(state: _State, first: Chain, positions: Floats) -> _State | None:
    """One Gauss-Newton step of constants and poses, halved until it lowers the sum of squares; None if it does not."""
    reduced = _reduced(state.chain, state.poses, positions)
    prior = max(state.noise, LEAST_NOISE) / PRIOR_SPREAD**2
    constants = _packed(state.chain)
    right = reduced.right_side + prior * (_packed(first) - constants)
    step = np.linalg.solve(reduced.information + prior * np.eye(len(right)), right)
    for part in STEP_PARTS:
        trial = _unpacked(state.chain, constants + part * step)
        poses = state.poses.stepped(part * reduced.pose_steps(step))
        better = _State(trial, poses if part == 1 else fit_poses(trial, poses, positions), positions)
        if better.squares <= state.squares:
            return better
    return None


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


@dataclass(frozen=True, eq=False)
class _Reduced:
    """Normal equations of the constants after the poses are eliminated, and how the poses follow."""

    information: Floats
    right_side: Floats
    own_steps: Floats
    """Pose steps with the constants held, shape (n_frames, d)."""
    couplings: Floats
    """How the pose steps fall with the constants, shape (n_frames, d, n_constants)."""

    def pose_steps(self, constants: NDArray[np.floating[Any]]) -> Floats:
        """Pose steps that go with a step of the constants, shape (n_frames, d)."""
        return np.asarray(self.own_steps - self.couplings @ constants)


def _reduced(chain: Chain, poses: ChainPoses, positions: Floats) -> _Reduced:
    n_constants = 3 * (chain.n_markers + chain.n_limbs - 1)
    step = max(1, CHUNK_FLOATS // (3 * chain.n_markers * n_constants))
    parts = [
        _reduced_chunk(chain, poses[slice(start, start + step)], positions[start : start + step])
        for start in range(0, len(positions), step)
    ]
    return _Reduced(
        information=np.sum([part.information for part in parts], axis=0),
        right_side=np.sum([part.right_side for part in parts], axis=0),
        own_steps=np.concatenate([part.own_steps for part in parts]),
        couplings=np.concatenate([part.couplings for part in parts]),
    )


def _reduced_chunk(chain: Chain, poses: ChainPoses, positions: Floats) -> _Reduced:
    n_frames = len(positions)
    body_arms = chain.arms()
    hessian, gradient = normal_equations(chain, body_arms, poses, positions)
    seen = (~np.isnan(positions[:, :, 0])).astype(np.float64)[:, :, np.newaxis, np.newaxis]
    constants = (_constant_jacobian(chain, poses) * seen).reshape(n_frames, 3 * chain.n_markers, -1)
    pose = (_pose_jacobian(body_arms, poses) * seen).reshape(n_frames, 3 * chain.n_markers, -1)
    border = pose.swapaxes(1, 2) @ constants
    solved = solve_damped(
        hessian, np.concatenate([border, gradient[..., np.newaxis]], axis=2), np.full(n_frames, POSE_DAMPING)
    )
    couplings, own_steps = np.ascontiguousarray(solved[..., :-1]), solved[..., -1]
    flat, flat_border = constants.reshape(-1, constants.shape[-1]), border.reshape(-1, border.shape[-1])
    schur = flat.T @ flat - flat_border.T @ couplings.reshape(flat_border.shape)
    error = residuals(chain, poses, positions).ravel()
    return _Reduced(
        information=(schur + schur.T) / 2,
        right_side=flat.T @ error - flat_border.T @ own_steps.ravel(),
        own_steps=own_steps,
        couplings=couplings,
    )


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
