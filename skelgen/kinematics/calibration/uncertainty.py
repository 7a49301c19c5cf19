r"""Standard deviations of what a whole-chain fit gives, from the inverse of its information matrix.

A joint's place in the world follows the frame's pose by J and the constants by C. With the pose's own information H,
border B and the constants' reduced information S, its covariance is

.. math::
    \sigma^2 \left( J H^{-1} J^T + D S^{-1} D^T \right), \qquad D = C - J H^{-1} B,

noise of the frame, and error of the skeleton. Directions of S that nothing determines (the free frames of the limbs, a
hinge along its axis) are left out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.chain.articulation import Articulation
from skelgen.kinematics.chain.chain import Chain, ChainPoses, world_arms
from skelgen.kinematics.chain.normal_equations import Frames, frames_together, linearised, total_information
from skelgen.kinematics.inverse.poses import LEAST_NOISE, UNKNOWN_SHIFT, UNKNOWN_TURN
from skelgen.model.arrays import Bools, Floats

RANK_TOLERANCE = 1e-8
"""Of the largest: information below this part is none. The ridge under the poses leaves some 1e-10."""

_LOG_RANGE = (-14.0, 20.0)
_LOG_STEPS = 137  # a quarter apart: the trapezoidal rule is exact to 1e-4 for so smooth a bell


DETERMINED = 10.0
"""Frames count in which a joint's bound is at most this many times its median: in others too few markers are seen."""


@dataclass(frozen=True, eq=False)
class FrameCovariances:
    """What is uncertain in each frame.

    Attributes
    ----------
    joints : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Of the joint above each limb in the world; of the root, its origin.
    constant_share : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        The part of it that is an error of the skeleton and the same in all frames.
    """

    joints: Floats
    constant_share: Floats


def inverse_root(information: Floats, tolerance: float = RANK_TOLERANCE) -> Floats:
    """Return W with W W^T the inverse of an information matrix where it is determined, shape (n, n_determined)."""
    scale = np.sqrt(np.maximum(np.diag(information), np.finfo(np.float64).tiny))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    known = values > tolerance * max(float(values[-1]), np.finfo(np.float64).tiny)
    return np.asarray(vectors[:, known] / np.sqrt(values[known]) / scale[:, np.newaxis])


def frame_covariances(
    chain: Chain,
    articulation: Articulation,
    poses: ChainPoses,
    positions: Floats,
    root: Floats,
    noise: float,
    weights: Floats | None = None,
) -> FrameCovariances:
    """Return the covariances of the joints in every frame.

    Parameters
    ----------
    chain, articulation, poses
        A calibrated chain, and where it is.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    root : ndarray, shape (n_constants, n)
        Root of the inverse information of the constants for noise 1, see `inverse_root`.
    noise : float, mm
        Standard deviation of a coordinate of weight 1.
    weights : ndarray, shape (n_frames, n_markers), optional
        Of the squared distances.
    """
    together = frames_together(chain, articulation)
    parts = []
    for first in range(0, len(positions), together):
        part = slice(first, first + together)
        heard = None if weights is None else weights[part]
        block = linearised(chain, articulation, poses[part], positions[part], heard, poses_only=True)
        parts.append(_covariances(chain, articulation, poses[part], block, root, noise))
    return FrameCovariances(
        joints=np.concatenate([part.joints for part in parts]),
        constant_share=np.concatenate([part.constant_share for part in parts]),
    )


def axis_projectors(chain: Chain, articulation: Articulation, poses: ChainPoses) -> Floats:
    """Projectors across the hinges' axes in the world, the identity elsewhere, shape (n_frames, n_limbs, 3, 3)."""
    axes = hinge_axes(chain, articulation, poses)
    return np.asarray(np.eye(3) - axes[..., np.newaxis] * axes[..., np.newaxis, :])


def hinge_axes(chain: Chain, articulation: Articulation, poses: ChainPoses) -> Floats:
    """Unit axes of the hinges in the world, 0 for other limbs, shape (n_frames, n_limbs, 3)."""
    result = np.zeros((len(poses.root), chain.n_limbs, 3))
    for limb, kind in enumerate(articulation.kinds):
        if kind == "hinge":
            result[:, limb] = poses.rotations[:, chain.parents[limb]] @ articulation.in_parent[limb]
    return result


def _covariances(
    chain: Chain, articulation: Articulation, poses: ChainPoses, block: Frames, root: Floats, noise: float
) -> FrameCovariances:
    by_pose, by_constants = joint_slopes(chain, poses)
    by_constants = np.concatenate([by_constants, by_pose @ block.tilts], axis=2)
    by_pose = by_pose @ block.turns
    inverse = np.linalg.inv(block.own + weak_prior(articulation, noise))
    spread = by_pose @ inverse
    own = noise**2 * _diagonal_blocks(spread, by_pose)
    change = noise * (by_constants - spread @ block.border) @ root
    constant = _diagonal_blocks(change, change)
    return FrameCovariances(own + constant, constant)


def weak_prior(articulation: Articulation, noise: float) -> Floats:
    """What is known of poses without any marker, as information for noise 1; it keeps deviations finite."""
    noise = max(noise, LEAST_NOISE)
    level = np.full(articulation.n_freedoms, (noise / UNKNOWN_TURN) ** 2)
    level[:3] = (noise / UNKNOWN_SHIFT) ** 2
    return np.diag(level)


def _diagonal_blocks(first: Floats, second: Floats) -> Floats:
    """Blocks of 3 x 3 on the diagonal of first second^T, shape (n_frames, n_limbs, 3, 3)."""
    n_frames, n_rows, n_columns = first.shape
    shape = (n_frames, n_rows // 3, 3, n_columns)
    return np.asarray(first.reshape(shape) @ second.reshape(shape).swapaxes(2, 3))


def joint_slopes(chain: Chain, poses: ChainPoses) -> tuple[Floats, Floats]:
    """How the world places of all limbs' origins follow translation and turns, and offsets and joints.

    Shapes (n_frames, 3 n_limbs, 3 + 3 n_limbs) and (n_frames, 3 n_limbs, 3 (n_markers + n_limbs - 1)).
    """
    n_limbs, n_frames = chain.n_limbs, len(poses.root)
    points = Chain(chain.parents, np.arange(n_limbs), chain.joints, np.zeros((n_limbs, 3)))
    levers = world_arms(points.arms(), poses)
    turns = -cross_matrix(levers).transpose(0, 1, 3, 2, 4).reshape(n_frames, 3 * n_limbs, 3 * n_limbs)
    shift = np.broadcast_to(np.tile(np.eye(3), (n_limbs, 1)), (n_frames, 3 * n_limbs, 3))
    slopes = np.zeros((n_frames, n_limbs, 3, chain.n_markers + n_limbs - 1, 3))
    for limb in range(1, n_limbs):
        parent = int(chain.parents[limb])
        slopes[:, limb] = slopes[:, parent]
        slopes[:, limb, :, chain.n_markers + limb - 1] = poses.rotations[:, parent]
    return np.concatenate([shift, turns], axis=2), slopes.reshape(n_frames, 3 * n_limbs, -1)


def expected_distance(covariances: Floats) -> Floats:
    r"""Mean length of normal vectors with given covariances, shape (...) from (..., 3, 3).

    With eigenvalues :math:`\lambda_i`, :math:`E\sqrt q = \frac1{2\sqrt\pi}\int_0^\infty (1 - \prod_i (1 + 2 \lambda_i
    t)^{-1/2})\, t^{-3/2} dt`, taken over the logarithm of t by the trapezoidal rule.
    """
    values = np.maximum(np.linalg.eigvalsh(covariances), 0.0)
    total = values.sum(axis=-1)
    share = values / np.where(total > 0, total, 1.0)[..., np.newaxis]
    logs = np.linspace(*_LOG_RANGE, _LOG_STEPS)
    result = np.zeros(total.shape)
    for log in logs:
        t = np.exp(log)
        result += (1 - np.prod(1 + 2 * share * t, axis=-1) ** -0.5) * np.exp(-log / 2)
    lowest = np.exp(_LOG_RANGE[0] / 2)  # below the range the bracket is t
    highest = np.exp(-_LOG_RANGE[1] / 2)  # above it is 1
    integral = result * (logs[1] - logs[0]) + 2 * lowest + 2 * highest
    return np.asarray(np.sqrt(total) * integral / (2 * np.sqrt(np.pi)))


@dataclass(frozen=True, eq=False)
class Bound:
    """The smallest possible uncertainty of joints.

    Attributes
    ----------
    covariances : ndarray, shape (n_frames, n_limbs, 3, 3), mm^2
        Of the joint above each limb in the world; of hinges across their axes.
    distance : ndarray, shape (n_frames, n_limbs), mm
        Mean distance from the truth that goes with it.
    determined : ndarray of bool, shape (n_frames, n_limbs)
        Whether the frame shows enough to place the joint.
    information : ndarray, shape (n_constants, n_constants)
        Of the constants, for noise 1.
    """

    covariances: Floats
    distance: Floats
    determined: Bools
    information: Floats


def cramer_rao_bound(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, noise: float
) -> Bound:
    """Return the bound at the truth.

    Parameters
    ----------
    chain, articulation, poses
        The truth.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers: only which are seen counts.
    noise : float, mm
        Standard deviation of a marker's coordinate.
    """
    information = total_information(chain, articulation, poses, positions)
    exact = np.where(np.isnan(positions), np.nan, poses.markers(chain))
    found = frame_covariances(chain, articulation, poses, exact, inverse_root(information), noise)
    across = axis_projectors(chain, articulation, poses)
    covariances = across @ found.joints @ across
    distance = expected_distance(covariances)
    return Bound(covariances, distance, distance <= DETERMINED * np.median(distance, axis=0), information)
