"""The skeleton in its reference pose, and the two views that show it best."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model import Skeleton
from skelgen.model.arrays import Floats

_FLAT = 0.3  # an axis along which the body extends less than this share of its size is hardly the vertical
_SUNK = 0.05  # of the body's size: markers that lie farther below zero are not above a floor at zero
_RARELY = 0.01  # of the frames, in which a stray may lie below


@dataclass(frozen=True, eq=False)
class View:
    """One parallel projection.

    Attributes
    ----------
    title : str
        What it shows.
    across, up, toward : ndarray, shape (3,)
        Unit vectors of the world: to the right, upward, and toward the viewer.
    """

    title: str
    across: Floats
    up: Floats
    toward: Floats


def find_views(points: Floats, marker_positions: Floats) -> tuple[View, View]:
    """Choose a front and a side view.

    The vertical is taken for the coordinate axis along which nothing lies below zero, where most systems have their
    floor; of several, or if there is none, for that along which the lowest marker moves least over the take: feet stay
    near the floor. The front is the horizontal direction in which the reference pose is widest.

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        The reference pose.
    marker_positions : ndarray, shape (n_frames, n_markers, 3), mm
        The whole take; NaN allowed.
    """
    vertical = _vertical(points, marker_positions)
    up = np.eye(3)[vertical]
    level = points - points.mean(axis=0)
    level = level - np.outer(level @ up, up)
    across = np.linalg.svd(level, full_matrices=False)[2][0] if np.ptp(level) > 0 else np.eye(3)[vertical - 1]
    across = across - (across @ up) * up
    across /= np.linalg.norm(across)
    across *= -1.0 if across[np.argmax(np.abs(across))] < 0 else 1.0
    toward = np.cross(across, up)
    return View("Front view (widest side)", across, up, toward), View("Side view", -toward, up, across)


def _vertical(points: Floats, marker_positions: Floats) -> int:
    lowest = np.fmin.reduce(marker_positions, axis=1)
    lowest = lowest[~np.isnan(lowest[:, 0])]
    extent = np.ptp(points, axis=0)
    is_flat = extent < _FLAT * extent.max()
    is_below = (lowest < -_SUNK * extent.max()).mean(axis=0) > _RARELY
    refused = is_flat | is_below if (~is_flat & ~is_below).any() else is_flat
    return int(np.argmin(lowest.std(axis=0) + np.where(refused, np.inf, 0.0)))


def reference_joints(skeleton: Skeleton) -> Floats:
    """Return the joints in the reference pose [mm], shape (n_joints, 3)."""
    placed = [
        skeleton.reference_pose[joint.parent, :3, :3] @ joint.position_in_parent
        + skeleton.reference_pose[joint.parent, :3, 3]
        for joint in skeleton.joints
    ]
    return np.array(placed).reshape(-1, 3)


def reference_markers(skeleton: Skeleton) -> Floats:
    """Return the markers in the reference pose [mm], shape (n_markers, 3); NaN for those that are left out."""
    placed = np.full_like(skeleton.marker_offsets, np.nan)
    on_limb = skeleton.limb_of_marker >= 0
    poses = skeleton.reference_pose[skeleton.limb_of_marker[on_limb]]
    placed[on_limb] = np.einsum("nij,nj->ni", poses[:, :3, :3], skeleton.marker_offsets[on_limb]) + poses[:, :3, 3]
    return placed
