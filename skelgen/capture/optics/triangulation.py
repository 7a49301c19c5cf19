"""Points in space from pairs of centres, with the covariance that the noise in both images gives them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.capture.optics.correction import Corrected, correct
from skelgen.capture.optics.epipolar import Rays, essential_matrix, homogeneous, rays_of
from skelgen.capture.optics.matrices import inverse_symmetric
from skelgen.model.arrays import Floats
from skelgen.model.rig import StereoRig


class Triangulated(NamedTuple):
    """Points of pairs of centres.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        In the rig's world; NaN where the rays do not meet in front of both cameras.
    covariance : ndarray, shape (n, 3, 3), mm^2
        In the world; NaN where the point is.
    corrected : Corrected
        The rays that meet there.
    """

    points: Floats
    covariance: Floats
    corrected: Corrected


def triangulate(rig: StereoRig, left: Floats, right: Floats, std: float | None = None) -> Triangulated:
    """Return the most likely points of corresponding pixels.

    Parameters
    ----------
    rig : StereoRig
        Both cameras.
    left, right : ndarray, shape (n, 2), px
        What the cameras see, lens included; the n-th belongs to the n-th.
    std : float, px, optional
        Standard deviation of a pixel along one axis; that of the rig if not given.
    """
    noise = np.full(len(left), rig.noise if std is None else std)
    return triangulate_rays(rig, rays_of(rig.left, left, noise), rays_of(rig.right, right, noise))


def triangulate_rays(rig: StereoRig, left: Rays, right: Rays) -> Triangulated:
    """Return the most likely points of pairs of rays, the n-th with the n-th; see `triangulate`."""
    right_from_left = rig.right_from_left
    turn, shift = right_from_left[:3, :3], right_from_left[:3, 3]
    with np.errstate(all="ignore"):  # NaN stands for rays that do not meet
        corrected = correct(essential_matrix(rig), (-turn.T @ shift, shift), left, right)
        inside = _meeting(turn, shift, corrected)
        covariance = _covariance(turn, inside, inside @ turn.T + shift, left, right)
    back = rig.left.camera_from_world[:3, :3].T
    points = (inside - rig.left.camera_from_world[:3, 3]) @ back.T
    return Triangulated(points, np.asarray(back @ covariance @ back.T), corrected)


def _meeting(turn: Floats, shift: Floats, corrected: Corrected) -> Floats:
    """Where rays that meet do so, in the left camera's frame, shape (n, 3)."""
    from_left, from_right = homogeneous(corrected.left), homogeneous(corrected.right)
    across = np.cross(from_right, from_left @ turn.T)
    depth = -(np.cross(from_right, shift) * across).sum(axis=1) / (across * across).sum(axis=1)
    points = from_left * depth[:, np.newaxis]
    is_before_both = (depth > 0) & (points @ turn[2] + shift[2] > 0)
    points[~is_before_both] = np.nan
    return np.asarray(points)


def _covariance(turn: Floats, in_left: Floats, in_right: Floats, left: Rays, right: Rays) -> Floats:
    """Covariance in the left camera's frame, shape (n, 3, 3): (J^T J)^-1 with J of the four whitened coordinates."""
    slope = np.concatenate([_slope(in_left, left), _slope(in_right, right) @ turn], axis=1)
    return inverse_symmetric(np.swapaxes(slope, 1, 2) @ slope)


def _slope(points: Floats, rays: Rays) -> Floats:
    """Derivative of whitened coordinates by the point in a camera's frame, shape (n, 2, 3)."""
    slope = np.zeros((len(points), 2, 3))
    slope[:, 0, 0] = slope[:, 1, 1] = 1.0
    slope[:, :, 2] = -points[:, :2] / points[:, 2:]
    return np.asarray(np.linalg.solve(rays.spread, slope / points[:, 2:, np.newaxis]))
