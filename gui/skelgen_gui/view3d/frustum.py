"""Cameras as the pyramids that they see, in lines."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats


def frustum(
    world_from_camera: Floats, size: tuple[float, float], focal: tuple[float, float], depth: float = 400.0
) -> Floats:
    """Return the edges of a camera's pyramid of sight.

    Parameters
    ----------
    world_from_camera : ndarray, shape (4, 4), translation in mm
        Pose of the camera, which looks along its z with x to the right and y down in its image.
    size : tuple of float, px
        Width and height of its image; the principal point is taken for the middle.
    focal : tuple of float, px
        Focal lengths along x and y.
    depth : float, mm
        How far before the camera the pyramid ends.

    Returns
    -------
    ndarray, shape (9, 2, 3), mm
        Both ends of: four edges from the camera's centre, four around the image, and a tick at its upper side.
    """
    half = np.array(size) / 2 / np.array(focal) * depth
    signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    corners = np.column_stack([signs * half, np.full(4, depth)])
    centre = np.zeros((4, 3))
    above = np.array([[0.0, -half[1], depth], [0.0, -1.25 * half[1], depth]])
    lines = np.concatenate(
        [np.stack([centre, corners], axis=1), np.stack([corners, np.roll(corners, -1, axis=0)], axis=1), above[None]]
    )
    return np.asarray(lines @ world_from_camera[:3, :3].T + world_from_camera[:3, 3])
