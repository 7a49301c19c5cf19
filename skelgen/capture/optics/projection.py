"""Where a camera sees a point, and which ray a pixel looks along: pinhole and Brown's distortion, both ways.

The lens bends a normalised point x / z, y / z before the matrix makes pixels of it (Gaschler 2011, chapter 4.1.1;
OpenCV's k1 k2 p1 p2 k3). Newton's method bends it back.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import Camera

MAX_NEWTON_STEPS = 30
"""The seed needs 5 to 10; a lens that bends a ray by half its slope needs 15."""

NEWTON_TOLERANCE = 1e-13
"""Of a normalised coordinate: 1e-10 px at the focal lengths of real cameras."""


def project(camera: Camera, points: Floats) -> Floats:
    """Return where a camera sees points of the world.

    Parameters
    ----------
    camera : Camera
        With its place in the world.
    points : ndarray, shape (..., 3), mm
        In the world.

    Returns
    -------
    ndarray, shape (..., 2), px
        NaN behind the camera, and so far to the side that the lens model would fold the image back into itself. Pixels
        outside the image are returned as they are; see `in_image`.
    """
    return pixels_from_normalised(camera, distort(camera, _normalised(_in_camera(camera, points))))


def projection_jacobian(camera: Camera, points: Floats) -> Floats:
    """Return d pixel / d point, shape (..., 2, 3), px/mm; arguments and NaN as in `project`."""
    inside = _in_camera(camera, points)
    flat = _normalised(inside)
    by_normalised = camera.matrix[:2, :2] @ distortion_jacobian(camera, flat)
    by_camera = np.zeros((*flat.shape[:-1], 2, 3))
    by_camera[..., 0, 0] = by_camera[..., 1, 1] = 1.0
    by_camera[..., 2] = -flat
    by_camera /= inside[..., 2, np.newaxis, np.newaxis]
    return np.asarray(by_normalised @ by_camera @ camera.camera_from_world[:3, :3])


def undistort(camera: Camera, pixels: Floats) -> Floats:
    """Return the rays x / z, y / z in the camera's frame that pixels look along, by Newton's method.

    Parameters
    ----------
    camera : Camera
        Its place does not matter.
    pixels : ndarray, shape (..., 2), px
        As the camera sees them.

    Returns
    -------
    ndarray, shape (..., 2)
        Normalised coordinates; NaN where the lens sends no ray to the pixel.
    """
    wanted = normalised_from_pixels(camera, pixels)
    rays = wanted.copy()
    if not camera.distortion.any():
        return rays
    step = np.zeros_like(rays)
    with np.errstate(all="ignore"):  # a pixel that no ray reaches sends Newton's steps anywhere
        for _ in range(MAX_NEWTON_STEPS):
            bent, slope = _bent(camera.distortion, rays)
            step = _solved(slope, bent - wanted)
            rays -= step
            if not (np.abs(step) > NEWTON_TOLERANCE).any():
                break
        found = (np.abs(step) <= NEWTON_TOLERANCE * MAX_NEWTON_STEPS).all(axis=-1)
        found &= (rays * rays).sum(axis=-1) < folding_radius(camera) ** 2
    rays[~found] = np.nan
    return rays


def distort(camera: Camera, normalised: Floats) -> Floats:
    """Return normalised points, shape (..., 2), as the lens bends them; NaN beyond `folding_radius`."""
    if not camera.distortion.any():
        return np.array(normalised)
    bent, _ = _bent(camera.distortion, normalised)
    bent[~(_squared_radius(normalised) < folding_radius(camera) ** 2)] = np.nan
    return bent


def distortion_jacobian(camera: Camera, normalised: Floats) -> Floats:
    """Return d distorted / d normalised, shape (..., 2, 2)."""
    return _bent(camera.distortion, normalised)[1]


def pixels_from_normalised(camera: Camera, normalised: Floats) -> Floats:
    """Return pixels, shape (..., 2), of normalised points that the lens has bent already."""
    return np.asarray(normalised @ camera.matrix[:2, :2].T + camera.matrix[:2, 2])


def normalised_from_pixels(camera: Camera, pixels: Floats) -> Floats:
    """Return normalised points, shape (..., 2), still bent by the lens, of pixels."""
    return np.asarray((pixels - camera.matrix[:2, 2]) @ np.linalg.inv(camera.matrix[:2, :2]).T)


def in_image(camera: Camera, pixels: Floats) -> Bools:
    """Whether pixels, shape (..., 2), lie in the camera's image: between the outer edges of its border pixels."""
    x, y = pixels[..., 0], pixels[..., 1]
    with np.errstate(invalid="ignore"):
        return np.asarray((x >= -0.5) & (y >= -0.5) & (x <= camera.width - 0.5) & (y <= camera.height - 0.5))


def folding_radius(camera: Camera) -> float:
    """Return the distance x^2 + y^2 = r^2 from the axis, on the plane z = 1, from which on the lens model folds back.

    There r (1 + k1 r^2 + k2 r^4 + k3 r^6) stops to grow; infinite for a lens that never does.
    """
    k1, k2, _, _, k3 = camera.distortion
    return _folding_radius(float(k1), float(k2), float(k3))


def camera_numbers(camera: Camera) -> Floats:
    """Return what compiled functions take of a camera, shape (11,).

    Focal lengths, principal point, skew, k1 k2 p1 p2 k3, and the square of its folding radius.
    """
    matrix = camera.matrix
    own = [matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2], matrix[0, 1]]
    return np.array([*own, *camera.distortion, folding_radius(camera) ** 2])


@lru_cache(maxsize=64)
def _folding_radius(k1: float, k2: float, k3: float) -> float:
    roots = np.roots([7.0 * k3, 5.0 * k2, 3.0 * k1, 1.0])
    squares = roots.real[(np.abs(roots.imag) < 1e-9 * np.abs(roots)) & (roots.real > 0)]
    return float(np.sqrt(squares.min())) if squares.size else float("inf")


def _in_camera(camera: Camera, points: Floats) -> Floats:
    return np.asarray(points @ camera.camera_from_world[:3, :3].T + camera.camera_from_world[:3, 3])


def _normalised(inside: Floats) -> Floats:
    depth = np.where(inside[..., 2:] > 0, inside[..., 2:], np.nan)
    return np.asarray(inside[..., :2] / depth)


def _squared_radius(normalised: Floats) -> Floats:
    return np.asarray((normalised * normalised).sum(axis=-1))


def _bent(distortion: Floats, normalised: Floats) -> tuple[Floats, Floats]:
    """Bend normalised points, and the derivative of that, shapes (..., 2) and (..., 2, 2)."""
    k1, k2, p1, p2, k3 = distortion
    x, y = normalised[..., 0], normalised[..., 1]
    xx, yy, xy = x * x, y * y, x * y
    square = xx + yy
    radial = 1.0 + square * (k1 + square * (k2 + square * k3))
    growth = 2.0 * (k1 + square * (2.0 * k2 + square * 3.0 * k3))
    bent = np.empty(normalised.shape)
    bent[..., 0] = x * radial + 2.0 * p1 * xy + p2 * (square + 2.0 * xx)
    bent[..., 1] = y * radial + p1 * (square + 2.0 * yy) + 2.0 * p2 * xy
    slope = np.empty((*normalised.shape, 2))
    slope[..., 0, 0] = radial + growth * xx + 2.0 * p1 * y + 6.0 * p2 * x
    slope[..., 1, 1] = radial + growth * yy + 6.0 * p1 * y + 2.0 * p2 * x
    slope[..., 0, 1] = slope[..., 1, 0] = growth * xy + 2.0 * p1 * x + 2.0 * p2 * y
    return bent, slope


def _solved(matrix: Floats, vector: Floats) -> Floats:
    """Solve 2 x 2 systems; NaN or infinite where there is no solution."""
    a, b, c, d = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 0], matrix[..., 1, 1]
    out = np.empty(vector.shape)
    scale = 1.0 / (a * d - b * c)
    out[..., 0] = (d * vector[..., 0] - b * vector[..., 1]) * scale
    out[..., 1] = (a * vector[..., 1] - c * vector[..., 0]) * scale
    return out
