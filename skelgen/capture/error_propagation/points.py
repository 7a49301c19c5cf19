"""The first step of the propagation: how far a ball's place in space scatters for the noise of its two centres."""

from __future__ import annotations

import numpy as np

from skelgen.capture.optics.matrices import inverse_symmetric
from skelgen.capture.optics.projection import in_image, project, projection_jacobian
from skelgen.model.arrays import Bools, Floats
from skelgen.model.rig import StereoRig


def point_covariances(rig: StereoRig, points: Floats) -> Floats:
    """Return the covariance of triangulated points (equation 6.2, for the most likely point).

    With J the derivative of the four pixel coordinates by the point it is sigma^2 (J^T J)^-1, which no unbiased
    estimate can be below (Cramer and Rao).

    Parameters
    ----------
    rig : StereoRig
        With the noise of its centres.
    points : ndarray, shape (..., 3), mm
        In the world.

    Returns
    -------
    ndarray, shape (..., 3, 3), mm^2
        NaN for points that are behind a camera; see `seen_by_both` for the images' borders.
    """
    slope = np.concatenate([projection_jacobian(rig.left, points), projection_jacobian(rig.right, points)], axis=-2)
    return rig.noise**2 * inverse_symmetric(np.swapaxes(slope, -1, -2) @ slope)


def seen_by_both(rig: StereoRig, points: Floats) -> Bools:
    """Whether points, shape (..., 3), mm, lie in both images."""
    return np.asarray(in_image(rig.left, project(rig.left, points)) & in_image(rig.right, project(rig.right, points)))
