"""Which markers the cameras of a simulated room see: they stand on a ring around the walk, and limbs hide markers.

A marker is seen when at least two of them see past all limbs to it.
"""

import numpy as np

from skelgen.model.arrays import Bools, Floats
from skelgen.simulation.articulated import Structure

CAMERA_HEIGHT = 2200.0
"""Height [mm] of the cameras above the floor: on tripods, or on a rail below the ceiling."""

CAMERAS_NEEDED = 2
"""Cameras that must see a marker for its position to be known."""

_RING_MARGIN = 2000.0  # mm between the farthest marker and the ring
_STANDOFF = 25.0  # mm before the marker where a line of sight ends: a limb does not hide what it touches
_TINY = 1e-12  # mm^2: a line of sight or a limb of no length


def camera_ring(positions: Floats, n_cameras: int) -> Floats:
    """Return the positions of cameras around all markers, shape (n_cameras, 3), mm.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Everything that the cameras are to see.
    n_cameras : int
        Number of cameras.
    """
    level = positions[..., :2].reshape(-1, 2)
    centre = (level.min(axis=0) + level.max(axis=0)) / 2
    radius = np.linalg.norm(level - centre, axis=1).max() + _RING_MARGIN
    angles = 2 * np.pi * np.arange(n_cameras) / n_cameras
    ring = centre + radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    return np.column_stack([ring, np.full(n_cameras, CAMERA_HEIGHT)])


def seen_by_cameras(structure: Structure, world_from_limb: Floats, positions: Floats, cameras: Floats) -> Bools:
    """Return which markers enough cameras see.

    Parameters
    ----------
    structure : Structure
        Its limbs' capsules block the view.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Poses of the limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        True places of the markers.
    cameras : ndarray, shape (n_cameras, 3), mm
        Places of the cameras.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    blocked = [blocked_by_limbs(structure, world_from_limb, positions, camera) for camera in cameras]
    return np.asarray((~np.array(blocked)).sum(axis=0) >= CAMERAS_NEEDED)


def blocked_by_limbs(structure: Structure, world_from_limb: Floats, positions: Floats, camera: Floats) -> Bools:
    """Return which markers limbs hide from one camera, shape (n_frames, n_markers).

    Parameters
    ----------
    structure, world_from_limb, positions
        As in `seen_by_cameras`.
    camera : ndarray, shape (3,), mm
        Its place.
    """
    blocked = np.zeros(positions.shape[:2], dtype=np.bool_)
    for index, limb in enumerate(structure.limbs):  # one limb at a time keeps the memory at the size of the markers
        poses = world_from_limb[:, index, np.newaxis]
        ends = (poses[..., :3, :3] @ limb.segment[..., np.newaxis])[..., 0] + poses[..., :3, 3]
        blocked |= _squared_distances(camera, positions, ends[:, 0], ends[:, 1]) < limb.radius**2
    return blocked


def _squared_distances(camera: Floats, positions: Floats, start: Floats, tip: Floats) -> Floats:
    """Squared distances between lines of sight and one limb's axis, as segments (Ericson 2005, section 5.1.9).

    With c the camera, s d the line of sight and p + t u the axis, alternate between the best s for t and t for s; the
    first t follows from the unbounded lines, and one more step after clamping is exact for segments.
    """
    sight = positions - camera
    a = np.maximum(np.sqrt(_dot(sight, sight)) ** 2, _TINY)
    axis, offset = (tip - start)[:, np.newaxis], (camera - start)[:, np.newaxis]
    b, c, f = _dot(sight, axis), _dot(sight, offset), _dot(axis, offset)
    e = np.maximum(_dot(axis, axis), _TINY)
    end = np.maximum(1 - _STANDOFF / np.sqrt(a), 0.0)
    s = np.clip((b * f - c * e) / np.maximum(a * e - b * b, _TINY), 0.0, end)
    t = np.clip((b * s + f) / e, 0.0, 1.0)
    s = np.clip((b * t - c) / a, 0.0, end)
    gap = offset + s[..., np.newaxis] * sight - t[..., np.newaxis] * axis
    return _dot(gap, gap)


def _dot(first: Floats, second: Floats) -> Floats:
    products = first * second
    return products[..., 0] + products[..., 1] + products[..., 2]  # NumPy sums axes of three numbers slowly
