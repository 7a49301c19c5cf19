r"""A joint between two bodies: its type and position, fitted to relative poses by maximum likelihood.

The type says how the child may rotate in its parent, and the position is a point of both bodies that coincides.
Together they predict the relative pose of every frame: of its six numbers, the frame's own angles explain up to three.
Of all frames of a joint that describe the same motion, `conventional` chooses the stated ones (Gaschler 2011, 5.2.2).

**Errors in variables.** The slopes of the constants are taken at angles that are slightly wrong, and wrong angles look
like motion: a hinge that wobbles by noise seems to determine its position along its axis. Of the information H the part

.. math::
    N = \sum_f \sum_{kl} \Sigma_{f,kl}\, \frac{\partial J_f}{\partial \varphi_k}^T P_f\,
        \frac{\partial J_f}{\partial \varphi_l}

is of that kind, with the covariance of the frame's angles and the projector that takes the angles' own slopes out. The
gradient of the residuals has the variance H, and the true information is H - N. So the covariance of the constants is
:math:`(H - N)^{-1} H (H - N)^{-1}`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix, frame_along
from skelgen.kinematics.chain.schur_complement import (
    BorderedSolution,
    LinearisedProblem,
    Minimum,
    gain_of_frames,
    gauss_newton,
)
from skelgen.kinematics.joints.relative_poses import RelativePoses, whitener
from skelgen.kinematics.joints.rotations import ConstrainedRotation, JointRotation
from skelgen.model.arrays import Floats

STEP = 1e-5
"""rad; of numerical slopes: the error of central differences is its square."""

LEAST_SHARE = 0.05
"""Of the information: what is left at least; a direction with less is as good as unknown, and stated so."""


@dataclass(frozen=True, eq=False)
class JointModel:
    """Rotations of a child in its parent, and the joint's position in both.

    Attributes
    ----------
    rotation : JointRotation
        Rotations parent from child.
    in_parent, in_child : ndarray, shape (3,), mm
        The joint in both bodies.
    """

    rotation: JointRotation
    in_parent: Floats
    in_child: Floats

    def shifts(self, rotations: Floats) -> Floats:
        """Return the positions of the child's origin in the parent [mm], shape (n_frames, 3)."""
        return np.asarray(self.in_parent - rotations @ self.in_child)

    def free_places(self) -> Floats:
        """Return the directions in which the position is determined: columns of (parent, child), shape (6, n).

        Along a hinge's axis both points may move together. Any point of a rigid joint is its position.
        """
        if self.rotation.kind == "rigid":
            return np.eye(6)[:, :3]
        axes = self.rotation.axes()
        if self.rotation.kind != "hinge" or axes is None:
            return np.eye(6)
        along = np.concatenate(axes) / np.sqrt(2.0)
        return np.asarray(np.linalg.svd(along[np.newaxis])[2][1:].T)

    def stepped(self, constants: Floats, angles: Floats) -> JointModel:
        """Return the joint after a step.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the position along `free_places`, then of the rotation's constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """
        free = self.free_places()
        move = free @ constants[: free.shape[1]]
        rotation = self.rotation.stepped(constants[free.shape[1] :], angles)
        return JointModel(rotation, self.in_parent + move[:3], self.in_child + move[3:])


def fit_joint_model(start: JointModel, measured: RelativePoses) -> Minimum[JointModel]:
    """Refine a joint by maximum likelihood over its position, its axes and the angles of all frames.

    Parameters
    ----------
    start : JointModel
        From a closed form.
    measured : RelativePoses
        Relative poses of the bodies.
    """
    weight = whitener(measured.covariances)
    return gauss_newton(start, lambda joint: linearised(joint, measured, weight), JointModel.stepped)


def linearised(joint: JointModel, measured: RelativePoses, weight: Floats) -> LinearisedProblem:
    """Return whitened residuals of the relative poses, and the derivatives of the model's prediction.

    Parameters
    ----------
    joint : JointModel
        Where to linearise.
    measured : RelativePoses
        Relative poses of the bodies.
    weight : ndarray, shape (n_frames, 6, 6)
        From `whitener`.
    """
    rotations = joint.rotation.rotations()
    constants, angles = joint.rotation.slopes()
    lever = cross_matrix(rotations @ joint.in_child)
    free = joint.free_places()
    place = np.concatenate([free[:3] - rotations @ free[3:], np.zeros((len(rotations), 3, free.shape[1]))], axis=1)
    by_constants = np.concatenate([place, np.concatenate([lever @ constants, constants], axis=1)], axis=2)
    by_angles = np.concatenate([lever @ angles, angles], axis=1)
    errors = measured.errors(rotations, joint.shifts(rotations))
    return LinearisedProblem((weight @ errors[..., np.newaxis])[..., 0], weight @ by_constants, weight @ by_angles)


def conventional(joint: JointModel) -> JointModel:
    """Return the same joint in conventional frames.

    The position of a hinge is the point of its axis that is nearest to both bodies' origins. Axes have a sign. The x
    axis points from the body's origin to the joint's axis.
    """
    rotation = joint.rotation
    axes = rotation.axes()
    if not isinstance(rotation, ConstrainedRotation) or axes is None:
        return joint
    in_parent, in_child = joint.in_parent, joint.in_child
    if rotation.kind == "hinge":
        first, second = axes
        along = (in_parent @ first + in_child @ second) / 2
        in_parent, in_child = in_parent - along * first, in_child - along * second
    rotation = _signed(rotation)
    parent = _conventional_frame(rotation.in_parent[:, 2], in_parent)
    child = _conventional_frame(rotation.in_child[:, 2], in_child)
    # The joint's frames turn about their axes to the convention; the angles take up the difference.
    before, after = _turn_between(rotation.in_parent, parent), _turn_between(rotation.in_child, child)
    turns = np.array([after - before] if rotation.kind == "hinge" else [-before, after])
    angles = _wrapped(rotation.angles + turns)
    return JointModel(ConstrainedRotation(parent, child, rotation.between, angles), in_parent, in_child)


def _signed(rotation: ConstrainedRotation) -> ConstrainedRotation:
    """Give axes a sign: the largest component is positive, of a universal joint for both axes on their own.

    Both frames turn by half a turn about x: the rotations stay when the angles change their sign (a hinge), or when the
    angle between the axes becomes its supplement.
    """
    half = np.diag([1.0, -1.0, -1.0])
    parent_flips, child_flips = _is_negative(rotation.in_parent[:, 2]), _is_negative(rotation.in_child[:, 2])
    if rotation.kind == "hinge":
        if not parent_flips:
            return rotation
        return ConstrainedRotation(rotation.in_parent @ half, rotation.in_child @ half, 0.0, -rotation.angles)
    between, angles = rotation.between, rotation.angles.copy()
    in_parent, in_child = rotation.in_parent, rotation.in_child
    if parent_flips:
        in_parent, between, angles[:, 0] = in_parent @ half, np.pi + between, -angles[:, 0]
    if child_flips:
        in_child, between, angles[:, 1] = in_child @ half, between - np.pi, -angles[:, 1]
    between = float(np.angle(np.exp(1j * between)))
    if between < 0:  # Rx(-b) = Rz(pi) Rx(b) Rz(-pi): an angle between axes needs no sign
        between, angles = -between, angles + np.array([np.pi, -np.pi])
    return ConstrainedRotation(in_parent, in_child, between, angles)


def _is_negative(axis: Floats) -> bool:
    return bool(axis[np.argmax(np.abs(axis))] < 0)


def _wrapped(angles: Floats) -> Floats:
    """Angles without jumps of a full turn, their first within half a turn of 0."""
    unwrapped = np.unwrap(angles, axis=0)
    return np.asarray(unwrapped - 2 * np.pi * np.round(unwrapped[0] / (2 * np.pi)))


def _conventional_frame(axis: Floats, centre: Floats) -> Floats:
    """Return the frame of an axis in a body: z along it, x from the body's origin to it, shape (3, 3).

    The plane of x and z holds the body's origin (Gaschler 2011, 5.2.2). The source's products (eq. 5.12, 5.13) give a
    left-handed system; here y is the opposite.

    Parameters
    ----------
    axis : ndarray, shape (3,)
        Unit vector.
    centre : ndarray, shape (3,), mm
        A point of the axis, seen from the body; if it lies on the line through the origin, x is any direction.
    """
    y = np.cross(axis, centre)
    size = float(np.linalg.norm(y))
    if size <= np.finfo(np.float64).eps * np.linalg.norm(centre) or size == 0:
        return frame_along(axis)
    y = y / size
    return np.stack([np.cross(y, axis), y, axis], axis=1)


def _turn_between(old: Floats, new: Floats) -> float:
    """Return the angle [rad] about their common z that rotates one frame of an axis into another, shape (3, 3) each."""
    between = old.T @ new
    return float(np.arctan2(between[1, 0], between[0, 0]))


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
    still, left = np.zeros(linear.constants.shape[2]), []
    for angle in range(n_angles):  # how the constants' slopes change with it, shape (n_frames, n_rows, n_constants)
        step = np.zeros((len(linear.angles), n_angles))
        step[:, angle] = STEP
        after, before = (linearised(joint.stepped(still, sign * step), measured, weight).constants for sign in (1, -1))
        change = (after - before) / (2 * STEP)
        left.append(change - linear.angles @ (gain @ change))
    total = np.zeros((linear.constants.shape[2],) * 2)
    for first in range(n_angles):
        for second in range(n_angles):
            weighted = inverse[:, first, second, np.newaxis, np.newaxis] * left[second]
            total += np.einsum("frc,frd->cd", left[first], weighted)
    return total
