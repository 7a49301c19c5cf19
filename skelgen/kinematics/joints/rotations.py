r"""Rotations of a child in its parent, by type of joint, with their derivatives.

All types are one product of the axes in both limbs and two angles about them,

.. math::
    R = C_p\, R_z(\varphi_1)\, R_x(\beta)\, R_z(\varphi_2)\, C_c^T .

A hinge has :math:`\beta = \varphi_2 = 0`. A universal joint has a constant :math:`\beta`, the angle between its axes. A
ball is free in every frame, and a rigid joint has one rotation for all frames. Small rotations act on the left,
:math:`R' = \exp([\delta]_\times) R`, so :math:`\delta` is in the parent's axes.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector, vector_from_matrix
from skelgen.model.arrays import Floats

X = np.eye(3)[0]


@dataclass(frozen=True, eq=False)
class BallRotation:
    """A ball: any rotation in every frame, shape (n_frames, 3, 3)."""

    kind: ClassVar[str] = "ball"
    n_constants: ClassVar[int] = 0
    n_angles: ClassVar[int] = 3
    between: ClassVar[float] = 0.0
    free: Floats

    @property
    def angles(self) -> Floats:
        """Rotation vectors [rad], shape (n_frames, 3)."""
        return vector_from_matrix(self.free)

    def rotations(self) -> Floats:
        """Return the rotations parent from child, shape (n_frames, 3, 3)."""
        return self.free

    def axes(self) -> None:
        """Return None: there are no axes."""

    def slopes(self) -> tuple[Floats, Floats]:
        """Return the derivatives of small rotations [rad] by no constants, and by three free rotations (Rodrigues)."""
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
class ConstrainedRotation:
    """A joint that is not free: rigid, a hinge, or a universal joint, by the number of its angles.

    Attributes
    ----------
    in_parent, in_child : ndarray, shape (3, 3)
        Rotations limb from joint: their last columns are the axis fixed in the parent and that fixed in the child.
    between : float, rad
        Angle between the two axes of a universal joint; 0 for others.
    angles : ndarray, shape (n_frames, n_angles), rad
        Angles about the axes.
    """

    in_parent: Floats
    in_child: Floats
    between: float
    angles: Floats

    @property
    def n_angles(self) -> int:
        """Number of angles in a frame."""
        return int(self.angles.shape[1])

    @property
    def kind(self) -> str:
        """The type of the joint."""
        return ("rigid", "hinge", "universal")[self.n_angles]

    @property
    def n_constants(self) -> int:
        """Rotations of a rigid joint, or two tilts of each axis, and the angle between those of a universal joint."""
        return 3 + self.n_angles

    def _turned(self) -> tuple[Floats, Floats]:
        """The joint's frame in the parent after the turn about the first axis and after all, shape (n_frames, 3, 3)."""
        if self.n_angles == 0:
            rigid = np.tile(self.in_parent, (len(self.angles), 1, 1))
            return rigid, rigid
        first = self.in_parent @ about_z(self.angles[:, 0])
        if self.n_angles == 1:
            return first, first
        return first, first @ matrix_from_vector(self.between * X) @ about_z(self.angles[:, 1])

    def rotations(self) -> Floats:
        """Return the rotations parent from child, shape (n_frames, 3, 3)."""
        return np.asarray(self._turned()[1] @ self.in_child.T)

    def axes(self) -> tuple[Floats, Floats] | None:
        """Return the unit axis fixed in the parent and that fixed in the child; None for a rigid joint."""
        return (self.in_parent[:, 2], self.in_child[:, 2]) if self.n_angles else None

    def slopes(self) -> tuple[Floats, Floats]:
        """Return the derivatives of small rotations [rad] by the constants and by the angles of the frame.

        The constants are tilts of both axes (two each) and the angle between them; a rigid joint has three rotations,
        and no angles. Shapes (n_frames, 3, n_constants) and (n_frames, 3, n_angles).
        """
        first, both = self._turned()
        own = np.tile(self.in_parent, (len(self.angles), 1, 1))
        if self.n_angles == 0:
            return np.tile(np.eye(3), (len(own), 1, 1)), np.zeros((len(own), 3, 0))
        is_universal = self.n_angles == 2
        constants = np.concatenate([own[:, :, :2], -both[:, :, :2], first[:, :, : int(is_universal)]], axis=2)
        return constants, np.concatenate([own[:, :, 2:], both[:, :, 2 : 2 + is_universal]], axis=2)

    def stepped(self, constants: Floats, angles: Floats) -> ConstrainedRotation:
        """Tilt the axes and rotate about them, or rotate all frames of a rigid joint together.

        Parameters
        ----------
        constants : ndarray, shape (n_constants,)
            Step of the constants.
        angles : ndarray, shape (n_frames, n_angles), rad
            Steps of the angles.
        """
        if self.n_angles == 0:
            return replace(self, in_parent=matrix_from_vector(constants) @ self.in_parent)
        tilts = np.zeros((2, 3))
        tilts[:, :2] = constants[:4].reshape(2, 2)
        in_parent, in_child = np.stack([self.in_parent, self.in_child]) @ matrix_from_vector(tilts)
        return ConstrainedRotation(in_parent, in_child, self.between + float(constants[4:].sum()), self.angles + angles)


JointRotation = BallRotation | ConstrainedRotation
"""Rotations parent from child of all frames, as one type of joint allows them."""


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
    if not isinstance(rotation, ConstrainedRotation) or rotation.kind == "rigid":
        return np.zeros((6, 6))
    moves = np.zeros((6, 4))
    for row, frame in ((0, rotation.in_parent), (1, rotation.in_child)):
        moves[3 * row : 3 * row + 3, 2 * row] = -frame[:, 1]
        moves[3 * row : 3 * row + 3, 2 * row + 1] = frame[:, 0]
    return np.asarray(moves @ covariance[:4, :4] @ moves.T)
