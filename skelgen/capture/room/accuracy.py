"""What the errors of a calibration make of points: to first order, and up to a motion of the whole room."""

import numpy as np

from skelgen.capture.calibration.bundle_adjustment import pixels_and_slopes
from skelgen.capture.optics import in_image
from skelgen.geometry.rotations import cross_matrix
from skelgen.model.arrays import Floats
from skelgen.model.rig import N_CAMERA_STD, CameraRig

FEWEST = 2
"""Cameras that a point needs."""


def point_covariances(rig: CameraRig, covariance: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return the covariances of points by errors of the calibration and of balls, seen by all cameras that can.

    Parameters
    ----------
    rig : CameraRig
        The cameras; its noise is that of the balls.
    covariance : ndarray, shape (15 n_cameras, 15 n_cameras)
        Of their numbers, in the order of `CameraRig.std`.
    points : ndarray, shape (n, 3), mm
        In the rig's world.

    Returns
    -------
    calibrated : ndarray, shape (3 m, 3 m), mm^2
        Covariance of those of the points that two cameras see, by the errors of the calibration alone, up to a
        motion of all points as one.
    noisy : ndarray, shape (m, 3, 3), mm^2
        Covariance of each by the noise of the balls alone.
    """
    normal = np.zeros((len(points), 3, 3))
    change = np.zeros((len(points), 3, N_CAMERA_STD * len(rig.cameras)))
    count = np.zeros(len(points), dtype=np.intp)
    for index, eye in enumerate(rig.cameras):
        turn = eye.camera_from_world[:3, :3]
        inside = points @ turn.T + eye.camera_from_world[:3, 3]
        with np.errstate(all="ignore"):
            pixels, by_intrinsic, by_point = pixels_and_slopes(eye, inside)
        seen = in_image(eye, pixels) & (inside[:, 2] > 0)
        by_camera = np.concatenate([by_intrinsic, -by_point @ cross_matrix(inside), -by_point], axis=-1)
        slope = (by_point @ turn) * seen[:, np.newaxis, np.newaxis]
        normal += np.swapaxes(slope, 1, 2) @ slope
        change[..., index * N_CAMERA_STD : (index + 1) * N_CAMERA_STD] = np.swapaxes(slope, 1, 2) @ by_camera
        count += seen
    usable = count >= FEWEST
    inverse = np.linalg.inv(normal[usable])
    slopes = _without_motion((-inverse @ change[usable]).reshape(-1, change.shape[2]), points[usable])
    return slopes @ covariance @ slopes.T, np.asarray(rig.noise**2 * inverse, dtype=np.float64)


def _without_motion(slopes: Floats, points: Floats) -> Floats:
    """Derivatives of points, shape (3 m, n), without what moves all of them as one."""
    about = points - points.mean(axis=0)
    motions = np.concatenate([np.tile(np.eye(3), (len(points), 1)), cross_matrix(about).reshape(-1, 3)], axis=1)
    basis = np.linalg.qr(motions)[0]
    return np.asarray(slopes - basis @ (basis.T @ slopes))


def room_grid(room: Floats, steps: int = 6) -> Floats:
    """Return a grid of points in the middle of the volume in which points were, shape (steps^3, 3), mm.

    Parameters
    ----------
    room : ndarray, shape (n, 3), mm
        Where it was.
    steps : int
        Points along each side.
    """
    low, high = np.quantile(room, 0.1, axis=0), np.quantile(room, 0.9, axis=0)
    sides = [np.linspace(*pair, steps) for pair in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*sides, indexing="ij"), axis=-1).reshape(-1, 3)
