r"""Covariances of joints in the world from the information of a whole-chain fit, and the Cramer-Rao bound.

A joint's position in the world follows the frame's pose by J and the constants by C. With the pose's information H, its
coupling B to the constants and the constants' information S (poses eliminated), the covariance of the position is

.. math::
    \sigma^2 \left( J H^{-1} J^T + D S^{-1} D^T \right), \qquad D = C - J H^{-1} B,

by noise of the frame, and by errors of the skeleton. Directions of S that nothing determines (the free frames of the
limbs, a hinge along its axis) are left out.

The Cramer-Rao bound is the same at the truth: no unbiased method can locate the joints better.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.chain.chain import Chain, ChainPoses, ObservedChain, world_arms
from skelgen.kinematics.chain.normal_equations import frame_blocks, frames_together, total_information
from skelgen.kinematics.inverse.poses import weak_prior
from skelgen.model.arrays import Bools, Floats

RANK_TOLERANCE = 1e-8
"""Of the largest: information below this part is none. The ridge under the poses leaves some 1e-10."""

_LOG_RANGE = (-14.0, 20.0)
_LOG_STEPS = 137  # a quarter apart: the trapezoidal rule is exact to 1e-4 for so smooth a bell

DETERMINED = 10.0
"""Times its median: a joint is determined in the frames in which its bound is no larger."""


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


Spectrum = tuple[Floats, Floats, Floats, Bools]
"""Eigenvalues, eigenvectors, scale and what is determined of an information matrix, see `scaled_spectrum`."""


def inverse_root(spectrum: Spectrum) -> Floats:
    """Return W with W W^T the inverse of an information matrix where it is determined, shape (n, n_determined)."""
    values, vectors, scale, determined = spectrum
    return np.asarray(vectors[:, determined] / np.sqrt(values[determined]) / scale[:, np.newaxis])


def scaled_spectrum(information: Floats) -> Spectrum:
    """Return eigenvalues and eigenvectors of an information matrix, its diagonal scaled to 1 where it is not 0.

    Returns
    -------
    values : ndarray, shape (n,)
        Eigenvalues, rising.
    vectors : ndarray, shape (n, n)
        Eigenvectors, as columns.
    scale : ndarray, shape (n,)
        What rows and columns were divided by.
    determined : ndarray of bool, shape (n,)
        Directions whose information is more than rounding.
    """
    own = np.diag(information)  # a coordinate in one frame informs by 1
    scale = np.sqrt(np.where(own > RANK_TOLERANCE, own, 1.0))
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    determined = values > RANK_TOLERANCE * max(float(values[-1]), 1.0)
    return values, vectors, scale, determined


def frame_covariances(observed: ObservedChain, root: Floats, noise: float) -> FrameCovariances:
    """Return the covariances of the joints in every frame.

    Parameters
    ----------
    observed : ObservedChain
        A calibrated chain, and where it is.
    root : ndarray, shape (n_constants, n)
        Root of the inverse information of the constants for noise 1, see `inverse_root`.
    noise : float, mm
        Standard deviation of a coordinate of weight 1.
    """
    parts = [_covariances(part, root, noise) for part in observed.in_parts(frames_together(observed))]
    joints, shares = [part.joints for part in parts], [part.constant_share for part in parts]
    return FrameCovariances(np.concatenate(joints), np.concatenate(shares))


def _covariances(observed: ObservedChain, root: Floats, noise: float) -> FrameCovariances:
    block = frame_blocks(observed, poses_only=True)
    by_pose, by_constants = joint_slopes(observed.chain, observed.poses)
    by_constants = np.concatenate([by_constants, by_pose @ block.tilts], axis=2)
    by_pose = by_pose @ block.turns
    inverse = np.linalg.inv(block.own + weak_prior(observed.articulation, noise))
    spread = by_pose @ inverse
    own = noise**2 * _diagonal_blocks(spread, by_pose)
    change = noise * (by_constants - spread @ block.coupling) @ root
    constant = _diagonal_blocks(change, change)
    return FrameCovariances(own + constant, constant)


def _diagonal_blocks(first: Floats, second: Floats) -> Floats:
    """Blocks of 3 x 3 on the diagonal of first second^T, shape (n_frames, n_limbs, 3, 3)."""
    n_frames, n_rows, n_columns = first.shape
    shape = (n_frames, n_rows // 3, 3, n_columns)
    return np.asarray(first.reshape(shape) @ second.reshape(shape).swapaxes(2, 3))


def joint_slopes(chain: Chain, poses: ChainPoses) -> tuple[Floats, Floats]:
    """Return the derivatives of the world positions of all limbs' origins.

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Their poses.

    Returns
    -------
    ndarray, shape (n_frames, 3 n_limbs, 3 + 3 n_limbs)
        By translation and rotations of the limbs.
    ndarray, shape (n_frames, 3 n_limbs, 3 (n_markers + n_limbs - 1))
        By marker offsets and joints.
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
    r"""Return the mean length of normal vectors with given covariances, shape (...) from (..., 3, 3).

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
        Mean distance from the truth that these covariances give.
    determined : ndarray of bool, shape (n_frames, n_limbs)
        Whether the frame shows enough markers to locate the joint.
    information : ndarray, shape (n_constants, n_constants)
        Of the constants, for noise 1.
    """

    covariances: Floats
    distance: Floats
    determined: Bools
    information: Floats


def cramer_rao_bound(truth: ObservedChain, noise: float) -> Bound:
    """Return the smallest possible uncertainty of the joints of a take whose truth is known.

    Parameters
    ----------
    truth : ObservedChain
        The true chain and its true poses. Of the measured markers only the weights count.
    noise : float, mm
        Standard deviation of a marker's coordinate.
    """
    information = total_information(truth)
    exact = np.where(np.isnan(truth.positions), np.nan, truth.poses.markers(truth.chain))
    found = frame_covariances(replace(truth, positions=exact), inverse_root(scaled_spectrum(information)), noise)
    across = truth.articulation.across_hinges(truth.chain.parents, truth.poses.rotations)
    covariances = across @ found.joints @ across
    distance = expected_distance(covariances)
    return Bound(covariances, distance, distance <= DETERMINED * np.median(distance, axis=0), information)
