r"""The third step: joint angles from the poses of both bodies (equations 5.7 and 5.18).

With the joint's frames :math:`R_p` and :math:`R_c` in the world its rotation is :math:`R_p^T R_c`. Small turns
:math:`\delta` of the bodies about the world's axes turn it by :math:`R_p^T (\delta_c - \delta_p)`: three angles of a
ball joint, of which a hinge keeps the one about its axis.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import JointModel

BALL, HINGE = "ball", "hinge"


def angle_covariance(
    joint: JointModel,
    poses: tuple[Floats, Floats],
    covariances: tuple[Floats, Floats],
    *,
    is_joined: bool = False,
) -> Floats:
    """Return the covariance of a joint's angles.

    Parameters
    ----------
    joint : JointModel
        With its frames in both bodies.
    poses : tuple of ndarray, shape (..., 4, 4), mm
        world_from_body of the parent and of the child.
    covariances : tuple of ndarray, shape (..., 6, 6)
        Of small turns about the world's axes [rad] and shifts [mm] of both.
    is_joined : bool
        Whether the estimate uses that the joint holds the bodies together: at its centre, a hinge along its axis as
        well. Otherwise each body is posed by its own balls alone, as the seed does.

    Returns
    -------
    ndarray, shape (..., 3, 3) or (..., 1, 1), rad^2
        Of small turns about the axes of the joint's frame in the parent; of the angle for a hinge.
    """
    both = block_diagonal(*covariances)
    slope = turn_slope(joint, poses)
    if is_joined:
        held = held_slope(joint, poses)
        gain = both @ np.swapaxes(held, -1, -2)
        both = both - gain @ np.linalg.solve(held @ gain, np.swapaxes(gain, -1, -2))
    slope = slope[..., 2:, :] if joint.kind == HINGE else slope
    return np.asarray(slope @ both @ np.swapaxes(slope, -1, -2))


def block_diagonal(first: Floats, second: Floats) -> Floats:
    """Return the covariance of both bodies together, shape (..., 12, 12), rad and mm: they err independently."""
    out = np.zeros((*first.shape[:-2], 12, 12))
    out[..., :6, :6], out[..., 6:, 6:] = first, second
    return out


def turn_slope(joint: JointModel, poses: tuple[Floats, Floats]) -> Floats:
    """Return the derivative of the joint's turn, in the axes of its frame in the parent, shape (..., 3, 12).

    Parameters
    ----------
    joint : JointModel
        With its frames in both bodies.
    poses : tuple of ndarray, shape (..., 4, 4), mm
        world_from_body of the parent and of the child.
    """
    parent_axes = np.swapaxes(poses[0][..., :3, :3] @ joint.parent_from_joint[:3, :3], -1, -2)
    slope = np.zeros((*parent_axes.shape[:-2], 3, 12))
    slope[..., :3], slope[..., 6:9] = -parent_axes, parent_axes
    return slope


def held_slope(joint: JointModel, poses: tuple[Floats, Floats]) -> Floats:
    """Return the derivative of what a joint holds at zero, shape (..., 3, 12) for a ball, (..., 5, 12) for a hinge.

    That is the way [mm] from its centre in the parent to that in the child, in the world, and for a hinge the tilts
    [rad] about x and y of its frame in the parent. Parameters as for `turn_slope`.
    """
    parent_arm = poses[0][..., :3, :3] @ joint.parent_from_joint[:3, 3]
    child_arm = poses[1][..., :3, :3] @ joint.child_from_joint[:3, 3]
    slope = np.zeros((*parent_arm.shape[:-1], 3, 12))
    slope[..., :3], slope[..., 6:9] = cross_matrix(parent_arm), -cross_matrix(child_arm)
    slope[..., 3:6], slope[..., 9:] = -np.eye(3), np.eye(3)
    return np.concatenate([slope, turn_slope(joint, poses)[..., :2, :]], axis=-2) if joint.kind == HINGE else slope
