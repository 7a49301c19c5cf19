r"""Errors in variables: the part of a joint's information that is only noise of its angles.

The slopes of the constants are taken at angles that are slightly wrong, and wrong angles look like motion: a hinge that
wobbles by noise seems to determine its position along its axis. Of the information H the part

.. math::
    N = \sum_f \sum_{kl} \Sigma_{f,kl}\, \frac{\partial J_f}{\partial \varphi_k}^T P_f\,
        \frac{\partial J_f}{\partial \varphi_l}

is of that kind, with the covariance of the frame's angles and the projector that takes the angles' own slopes out. The
gradient of the residuals has the variance H, and the true information is H - N. So the covariance of the constants is
:math:`(H - N)^{-1} H (H - N)^{-1}`.
"""

from __future__ import annotations

import numpy as np

from skelgen.kinematics.bodies.relative_poses import RelativePoses
from skelgen.kinematics.chain.schur_complement import BorderedSolution, LinearisedProblem, gain_of_frames
from skelgen.kinematics.joints.joint_model import JointModel, linearised
from skelgen.model.arrays import Floats

STEP = 1e-5
"""rad; of numerical slopes: the error of central differences is its square."""

LEAST_SHARE = 0.05
"""Of the information: what is left at least; a direction with less is as good as unknown, and stated so."""


def covariance_of_constants(
    joint: JointModel, measured: RelativePoses, weight: Floats, solution: BorderedSolution, scale: float
) -> tuple[Floats, Floats]:
    """Return the covariance of the constants for residuals of variance 1, with the noise of the angles.

    Parameters
    ----------
    joint : JointModel
        The fitted joint.
    measured : RelativePoses
        Relative poses of the bodies.
    weight : ndarray, shape (n_frames, 6, 6)
        From `whitener`.
    solution : BorderedSolution
        Of the linearised problem at the joint.
    scale : float
        Variance of the residuals, in units of the stated one.

    Returns
    -------
    tuple of ndarray, shape (n_constants, n_constants)
        The covariance, and :math:`(H - N)^{-1}`, by which the constants follow a gradient.
    """
    values, vectors = np.linalg.eigh(solution.covariance)
    root = vectors * np.sqrt(np.maximum(values, 0.0))
    noise = scale * root.T @ _information_of_noise(joint, measured, weight) @ root
    shares, axes = np.linalg.eigh(np.eye(len(root)) - noise)
    turned, shares = root @ axes, np.maximum(shares, LEAST_SHARE)
    return (turned / shares**2) @ turned.T, (turned / shares) @ turned.T


def _information_of_noise(joint: JointModel, measured: RelativePoses, weight: Floats) -> Floats:
    linear = linearised(joint, measured, weight)
    n_angles = linear.angles.shape[2]
    inverse, gain = gain_of_frames(linear.angles)
    changes = [_change(joint, measured, weight, angle, linear) for angle in range(n_angles)]
    left = [change - linear.angles @ (gain @ change) for change in changes]
    total = np.zeros((linear.constants.shape[2],) * 2)
    for first in range(n_angles):
        for second in range(n_angles):
            weighted = inverse[:, first, second, np.newaxis, np.newaxis] * left[second]
            total += np.einsum("frc,frd->cd", left[first], weighted)
    return total


def _change(
    joint: JointModel, measured: RelativePoses, weight: Floats, angle: int, linear: LinearisedProblem
) -> Floats:
    """How the constants' slopes change with one angle of each frame, shape (n_frames, n_rows, n_constants)."""
    step = np.zeros((len(linear.angles), linear.angles.shape[2]))
    step[:, angle] = STEP
    still = np.zeros(linear.constants.shape[2])
    after, before = (linearised(joint.stepped(still, sign * step), measured, weight).constants for sign in (1, -1))
    return np.asarray((after - before) / (2 * STEP))
