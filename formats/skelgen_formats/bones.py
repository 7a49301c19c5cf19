"""Poses of bones relative to their parents, and the quaternions x y z w that files store them with.

The usual active rotation v' = q v q*, Hamilton's product; q and -q are the same rotation, and either may be in a file.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import matrix_from_quaternion, quaternion_from_matrix
from skelgen.model.arrays import Floats


def xyzw_from_matrix(rotations: Floats) -> Floats:
    """Return unit quaternions with w >= 0, shape (..., 4), of rotation matrices, shape (..., 3, 3)."""
    return np.roll(quaternion_from_matrix(rotations), -1, axis=-1)


def matrix_from_xyzw(quaternions: Floats) -> Floats:
    """Return rotation matrices, shape (..., 3, 3), of quaternions of any length but zero, shape (..., 4)."""
    units = quaternions / np.linalg.norm(quaternions, axis=-1, keepdims=True)
    return matrix_from_quaternion(np.roll(units, 1, axis=-1))


def parent_from_child(world_from_parent: Floats, world_from_child: Floats) -> tuple[Floats, Floats]:
    """Return a child's pose relative to its parent.

    Parameters
    ----------
    world_from_parent, world_from_child : ndarray, shape (..., 4, 4), translations in mm
        Rigid transforms.

    Returns
    -------
    translation : ndarray, shape (..., 3), mm
    rotation : ndarray, shape (..., 3, 3)
    """
    parent_from_world = world_from_parent[..., :3, :3].swapaxes(-1, -2)
    apart = world_from_child[..., :3, 3] - world_from_parent[..., :3, 3]
    translation = (parent_from_world @ apart[..., np.newaxis])[..., 0]
    return translation, parent_from_world @ world_from_child[..., :3, :3]


def bone_transforms(poses: Floats, parent: int, limb: int) -> tuple[Floats, Floats]:
    """Return one limb's translation [mm], shape (..., 3), and rotation, shape (..., 3, 3), relative to its parent.

    Parameters
    ----------
    poses : ndarray, shape (..., n_limbs, 4, 4)
        world_from_limb of all limbs.
    parent, limb : int
        Limb indices; a parent of -1 is the world.
    """
    if parent < 0:
        return poses[..., limb, :3, 3], poses[..., limb, :3, :3]
    return parent_from_child(poses[..., parent, :, :], poses[..., limb, :, :])
