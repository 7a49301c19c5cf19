r"""Rotations of a child in its parent, by type of joint, with their derivatives.

All types are one product of the axes in both limbs and two angles about them,

.. math::
    R = C_p\, R_z(\varphi_1)\, R_x(\beta)\, R_z(\varphi_2)\, C_c^T .

A hinge has :math:`\beta = \varphi_2 = 0`. A universal joint has a constant :math:`\beta`, the angle between its axes. A
ball is free in every frame, and a rigid joint has one rotation for all frames. Small rotations act on the left,
:math:`R' = \exp([\delta]_\times) R`, so :math:`\delta` is in the parent's axes.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Protocol, Self

import numpy as np

from skelgen._kernels.joint_models import Parts
from skelgen.geometry.rotations import matrix_from_vector
from skelgen.model.arrays import Floats

X = np.eye(3)[0]


class JointRotation(Protocol):
    """Rotations parent from child of all frames, as one type of joint allows them."""

    kind: ClassVar[str]
    n_constants: ClassVar[int]
    n_angles: ClassVar[int]

    def rotations(self) -> Floats:
        """Return the rotations parent from child, shape (n_frames, 3, 3)."""

    def axes(self) -> tuple[Floats, Floats] | None:
        """Return the unit axis fixed in the parent and that fixed in the child; None for types without axes."""

    def slopes(self) -> tuple[Floats, Floats]:
        """Return the derivatives of small rotations [rad].

        Returns
        -------
        ndarray, shape (n_frames, 3, n_constants)
            By the constants.
        ndarray, shape (n_frames, 3, n_angles)
            By the angles of the frame.
        """

    def stepped(self, constants: Floats, angles: Floats) -> Self:
        """Return the rotations after a step.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """


@dataclass(frozen=True, eq=False)
class BallRotation:
    """A ball: any rotation in every frame, shape (n_frames, 3, 3)."""

    kind: ClassVar[str] = "ball"
    n_constants: ClassVar[int] = 0
    n_angles: ClassVar[int] = 3
    free: Floats

    def rotations(self) -> Floats:
        """Return the rotations."""
        return self.free

    def axes(self) -> None:
        """Return None: there are no axes."""

    def slopes(self) -> tuple[Floats, Floats]:
        """Return no constants, and three free rotations (Rodrigues)."""
        n_frames = len(self.free)
        return np.zeros((n_frames, 3, 0)), np.tile(np.eye(3), (n_frames, 1, 1))

    def stepped(self, constants: Floats, angles: Floats) -> BallRotation:
        """Rotate every frame on its own.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """
        return BallRotation(matrix_from_vector(angles) @ self.free)


@dataclass(frozen=True, eq=False)
class RigidRotation:
    """A rigid joint: one rotation, shape (3, 3), for `n_frames` frames."""

    kind: ClassVar[str] = "rigid"
    n_constants: ClassVar[int] = 3
    n_angles: ClassVar[int] = 0
    rotation: Floats
    n_frames: int

    def rotations(self) -> Floats:
        """Return the rotation for every frame."""
        return np.tile(self.rotation, (self.n_frames, 1, 1))

    def axes(self) -> None:
        """Return None: there are no axes."""

    def parts(self) -> Parts:
        """Return the parts of the rotations."""
        return self.rotation, np.eye(3), 0.0, np.zeros((self.n_frames, 0))

    def slopes(self) -> tuple[Floats, Floats]:
        """Return three constant rotations, and no angles."""
        return np.tile(np.eye(3), (self.n_frames, 1, 1)), np.zeros((self.n_frames, 3, 0))

    def stepped(self, constants: Floats, angles: Floats) -> RigidRotation:
        """Rotate all frames together.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """
        return RigidRotation(matrix_from_vector(constants) @ self.rotation, self.n_frames)


@dataclass(frozen=True, eq=False)
class HingeRotation:
    """A hinge.

    Attributes
    ----------
    in_parent, in_child : ndarray, shape (3, 3)
        Rotations limb from joint: their last column is the axis.
    angles : ndarray, shape (n_frames,), rad
        Angle about the axis.
    """

    kind: ClassVar[str] = "hinge"
    n_constants: ClassVar[int] = 4
    n_angles: ClassVar[int] = 1
    in_parent: Floats
    in_child: Floats
    angles: Floats

    def rotations(self) -> Floats:
        """Return the rotations."""
        return np.asarray(self.in_parent @ about_z(self.angles) @ self.in_child.T)

    def axes(self) -> tuple[Floats, Floats]:
        """Return the axis in the parent and in the child."""
        return self.in_parent[:, 2], self.in_child[:, 2]

    def parts(self) -> Parts:
        """Return the parts of the rotations."""
        return self.in_parent, self.in_child, 0.0, self.angles[:, np.newaxis]

    def slopes(self) -> tuple[Floats, Floats]:
        """Return tilts of the axis in the parent and in the child (two each), and the rotation about it."""
        n_frames = len(self.angles)
        tilts = np.tile(self.in_parent[:, :2], (n_frames, 1, 1))
        turned = -(self.in_parent @ about_z(self.angles))[:, :, :2]
        return np.concatenate([tilts, turned], axis=2), np.tile(self.in_parent[:, 2:], (n_frames, 1, 1))

    def stepped(self, constants: Floats, angles: Floats) -> HingeRotation:
        """Tilt the axis and rotate about it.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """
        in_parent, in_child = _tilted(self.in_parent, constants[:2]), _tilted(self.in_child, constants[2:])
        return HingeRotation(in_parent, in_child, self.angles + angles[:, 0])


@dataclass(frozen=True, eq=False)
class UniversalRotation:
    """A universal joint.

    Attributes
    ----------
    in_parent, in_child : ndarray, shape (3, 3)
        Rotations limb from joint: their last columns are the axis fixed in the parent and that fixed in the child.
    between : float, rad
        Angle between the two axes.
    angles : ndarray, shape (n_frames, 2), rad
        Angles about both.
    """

    kind: ClassVar[str] = "universal"
    n_constants: ClassVar[int] = 5
    n_angles: ClassVar[int] = 2
    in_parent: Floats
    in_child: Floats
    between: float
    angles: Floats

    def rotations(self) -> Floats:
        """Return the rotations."""
        first, second = about_z(self.angles[:, 0]), about_z(self.angles[:, 1])
        return np.asarray(self.in_parent @ first @ matrix_from_vector(self.between * X) @ second @ self.in_child.T)

    def axes(self) -> tuple[Floats, Floats]:
        """Return the axis in the parent and in the child."""
        return self.in_parent[:, 2], self.in_child[:, 2]

    def parts(self) -> Parts:
        """Return the parts of the rotations."""
        return self.in_parent, self.in_child, self.between, self.angles

    def slopes(self) -> tuple[Floats, Floats]:
        """Return tilts of both axes (two each) and the angle between them, and the rotations about them."""
        first = self.in_parent @ about_z(self.angles[:, 0])
        both = first @ matrix_from_vector(self.between * X) @ about_z(self.angles[:, 1])
        tilts = np.tile(self.in_parent[:, :2], (len(self.angles), 1, 1))
        constants = np.concatenate([tilts, -both[:, :, :2], first[:, :, :1]], axis=2)
        own = np.tile(self.in_parent[:, 2:], (len(self.angles), 1, 1))
        return constants, np.concatenate([own, both[:, :, 2:]], axis=2)

    def stepped(self, constants: Floats, angles: Floats) -> UniversalRotation:
        """Tilt the axes and rotate about them.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """
        in_parent, in_child = _tilted(self.in_parent, constants[:2]), _tilted(self.in_child, constants[2:4])
        return UniversalRotation(in_parent, in_child, self.between + float(constants[4]), self.angles + angles)


ConstrainedRotation = RigidRotation | HingeRotation | UniversalRotation
"""Rotations of a joint that is not free."""


def about_z(angles: Floats) -> Floats:
    """Return rotations about z by angles [rad], shape (..., 3, 3) from (...)."""
    turns = np.zeros((*np.shape(angles), 3, 3))
    turns[..., 0, 0] = turns[..., 1, 1] = np.cos(angles)
    turns[..., 1, 0] = np.sin(angles)
    turns[..., 0, 1] = -turns[..., 1, 0]
    turns[..., 2, 2] = 1.0
    return turns


def axis_covariance(rotation: JointRotation, covariance: Floats) -> Floats:
    """Return the covariance of both axes, shape (6, 6), from that of the constants; 0 for types without axes.

    Parameters
    ----------
    rotation : JointRotation
        The rotations.
    covariance : ndarray, shape (n_constants, n_constants)
        Of their constants.

    Notes
    -----
    A tilt by (a, b) about x and y of an axis' frame moves its z by (b, -a).
    """
    if not isinstance(rotation, HingeRotation | UniversalRotation):
        return np.zeros((6, 6))
    moves = np.zeros((6, 4))
    for row, frame in ((0, rotation.in_parent), (1, rotation.in_child)):
        moves[3 * row : 3 * row + 3, 2 * row] = -frame[:, 1]
        moves[3 * row : 3 * row + 3, 2 * row + 1] = frame[:, 0]
    return np.asarray(moves @ covariance[:4, :4] @ moves.T)


def frame_along(axis: Floats) -> Floats:
    """Return a rotation whose last column is a unit axis, shape (3, 3); the other two are any."""
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(axis, first), axis], axis=1)


def _tilted(frame: Floats, tilt: Floats) -> Floats:
    return np.asarray(frame @ matrix_from_vector(np.array([tilt[0], tilt[1], 0.0])))
