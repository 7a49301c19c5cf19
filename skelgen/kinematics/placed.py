"""A joint between two bodies with its place: the model that is fitted to relative poses by maximum likelihood.

A kind of joint says how the child may turn in its parent; the place is a point of both bodies that coincides. Together
they predict the relative pose of every frame, six numbers, of which the frame's own angles explain up to three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.arrow import Descent, Linear, descend
from skelgen.kinematics.relative import RelativePoses, whitener
from skelgen.kinematics.turning import Turning
from skelgen.model.arrays import Floats


@dataclass(frozen=True, eq=False)
class Placed:
    """How the child turns, and where.

    Attributes
    ----------
    turning : Turning
        Rotations parent from child.
    in_parent, in_child : ndarray, shape (3,), mm
        The joint in both bodies.
    """

    turning: Turning
    in_parent: Floats
    in_child: Floats

    def shifts(self, rotations: Floats) -> Floats:
        """Places of the child's origin in the parent [mm], shape (n_frames, 3)."""
        return np.asarray(self.in_parent - rotations @ self.in_child)

    def free_places(self) -> Floats:
        """Directions in which the place can be told: columns of (parent, child), shape (6, n).

        Along a hinge's axis both points may move together; of a rigid joint, any point is one.
        """
        if self.turning.kind == "rigid":
            return np.eye(6)[:, :3]
        axes = self.turning.axes()
        if self.turning.kind != "hinge" or axes is None:
            return np.eye(6)
        along = np.concatenate(axes) / np.sqrt(2.0)
        return np.asarray(np.linalg.svd(along[np.newaxis])[2][1:].T)

    def stepped(self, constants: Floats, angles: Floats) -> Placed:
        """Change place, constants of the turning, and angles."""
        free = self.free_places()
        move = free @ constants[: free.shape[1]]
        turning = self.turning.stepped(constants[free.shape[1] :], angles)
        return Placed(turning, self.in_parent + move[:3], self.in_child + move[3:])


def fit_placed(start: Placed, measured: RelativePoses) -> Descent[Placed]:
    """Refine a joint by maximum likelihood over its place, its axes and the angles of all frames.

    Parameters
    ----------
    start : Placed
        From a closed form.
    measured : RelativePoses
        What the bodies say.
    """
    weight = whitener(measured.covariances)
    return descend(start, lambda joint: linearised(joint, measured, weight), Placed.stepped)


def linearised(joint: Placed, measured: RelativePoses, weight: Floats) -> Linear:
    """Return whitened residuals of the relative poses, and how the model's prediction follows its unknowns."""
    rotations = joint.turning.rotations()
    constants, angles = joint.turning.slopes()
    lever = cross_matrix(rotations @ joint.in_child)
    free = joint.free_places()
    place = np.concatenate([free[:3] - rotations @ free[3:], np.zeros((len(rotations), 3, free.shape[1]))], axis=1)
    by_constants = np.concatenate([place, np.concatenate([lever @ constants, constants], axis=1)], axis=2)
    by_angles = np.concatenate([lever @ angles, angles], axis=1)
    errors = measured.errors(rotations, joint.shifts(rotations))
    return Linear((weight @ errors[..., np.newaxis])[..., 0], weight @ by_constants, weight @ by_angles)
