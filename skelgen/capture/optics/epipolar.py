"""Which ball of the left image can be which of the right one: both must lie in one plane with both cameras.

The measure is the first order of the optimal correction (Sampson), in standard deviations of the balls' centres: for
two balls that are one, it is normal with deviation 1 wherever they are and whatever the lens does there.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.capture.optics.projection import distortion_jacobian, undistort
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera, StereoRig


@dataclass(frozen=True, eq=False)
class Rays:
    """Directions that balls were seen in, each with its noise.

    Attributes
    ----------
    normalised : ndarray, shape (n_balls, 2)
        Undistorted x / z, y / z; NaN where the lens sends no ray to the pixel.
    spread : ndarray, shape (n_balls, 2, 2)
        d normalised / d pixel, times the standard deviation of the centre: spread spread^T is the covariance.
    """

    normalised: Floats
    spread: Floats


def rays_of(camera: Camera, pixels: Floats, std: Floats) -> Rays:
    """Return the rays of pixels, shape (n, 2), with standard deviations [px] along one axis, shape (n,)."""
    normalised = undistort(camera, pixels)
    slope = camera.matrix[:2, :2] @ distortion_jacobian(camera, normalised)
    spread = np.empty_like(slope)
    a, b, c, d = slope[:, 0, 0], slope[:, 0, 1], slope[:, 1, 0], slope[:, 1, 1]
    scale = std / (a * d - b * c)
    spread[:, 0, 0], spread[:, 0, 1] = d * scale, -b * scale
    spread[:, 1, 0], spread[:, 1, 1] = -c * scale, a * scale
    return Rays(normalised, spread)


def essential_matrix(rig: StereoRig) -> Floats:
    """Return E with x'^T E x = 0 for normalised points x of the left, x' of the right camera, shape (3, 3)."""
    right_from_left = rig.right_from_left
    return np.asarray(cross_matrix(right_from_left[:3, 3]) @ right_from_left[:3, :3])


def fundamental_matrix(rig: StereoRig) -> Floats:
    """Return F with x'^T F x = 0 for undistorted pixels x of the left, x' of the right camera, shape (3, 3).

    Its scale is such that the largest element is 1 or -1.
    """
    left, right = np.linalg.inv(rig.left.matrix), np.linalg.inv(rig.right.matrix)
    matrix = right.T @ essential_matrix(rig) @ left
    return np.asarray(matrix / np.abs(matrix).max())


def sampson_distances(essential: Floats, left: Rays, right: Rays) -> Floats:
    """Return the distance of all pairs of balls from the epipolar constraint, in standard deviations, with its sign.

    Parameters
    ----------
    essential : ndarray, shape (3, 3)
        See `essential_matrix`.
    left, right : Rays
        Balls of both images.

    Returns
    -------
    ndarray, shape (n_left, n_right)
        x'^T E x over the standard deviation that the noise of both centres gives it; NaN where a ray is.
    """
    from_left, from_right = homogeneous(left.normalised), homogeneous(right.normalised)
    lines_in_right, lines_in_left = from_left @ essential.T, from_right @ essential
    residual = lines_in_right @ from_right.T
    by_left = np.einsum("lik,ri->lrk", left.spread, lines_in_left[:, :2])
    by_right = np.einsum("rik,li->lrk", right.spread, lines_in_right[:, :2])
    variance = (by_left * by_left).sum(axis=-1) + (by_right * by_right).sum(axis=-1)
    return np.asarray(residual / np.sqrt(variance))


def candidates(distances: Floats, gate: float) -> Bools:
    """Whether pairs lie within `gate` standard deviations of the epipolar constraint; never where NaN is."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(distances) <= gate)


def homogeneous(normalised: Floats) -> Floats:
    """Return points x y 1, shape (..., 3), of points x y."""
    return np.concatenate([normalised, np.ones((*normalised.shape[:-1], 1))], axis=-1)
