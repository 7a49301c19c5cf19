"""Unit quaternions x y z w for the files that store rotations so, and poses relative to a parent.

The usual active rotation v' = q v q*, Hamilton's product; q and -q are the same rotation, and either may appear.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def xyzw_from_matrix(rotations: Floats) -> Floats:
    """Return unit quaternions, shape (..., 4), of rotation matrices, shape (..., 3, 3).

    The matrix determines all sixteen products 4 q_i q_j; the row with the largest diagonal is a multiple of q and the
    one that rounding hurts least (Shepperd 1978).
    """
    r = np.moveaxis(np.asarray(rotations, dtype=np.float64), (-2, -1), (0, 1))
    products = np.stack(
        [
            np.stack([1 + r[0, 0] - r[1, 1] - r[2, 2], r[0, 1] + r[1, 0], r[0, 2] + r[2, 0], r[2, 1] - r[1, 2]], -1),
            np.stack([r[0, 1] + r[1, 0], 1 - r[0, 0] + r[1, 1] - r[2, 2], r[1, 2] + r[2, 1], r[0, 2] - r[2, 0]], -1),
            np.stack([r[0, 2] + r[2, 0], r[1, 2] + r[2, 1], 1 - r[0, 0] - r[1, 1] + r[2, 2], r[1, 0] - r[0, 1]], -1),
            np.stack([r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], 1 + r[0, 0] + r[1, 1] + r[2, 2]], -1),
        ],
        axis=-2,
    )
    largest = np.argmax(np.diagonal(products, axis1=-2, axis2=-1), axis=-1)
    row = np.take_along_axis(products, largest[..., np.newaxis, np.newaxis], axis=-2)[..., 0, :]
    return np.asarray(row / np.linalg.norm(row, axis=-1, keepdims=True))


def matrix_from_xyzw(quaternions: Floats) -> Floats:
    """Return rotation matrices, shape (..., 3, 3), of quaternions of any length but zero, shape (..., 4)."""
    norms = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    x, y, z, w = np.moveaxis(quaternions / norms, -1, 0)
    rows = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


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
