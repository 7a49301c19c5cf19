r"""A joint between a body with known poses and single points of another limb that has none.

Seen from the body, a point of the other limb stays on a sphere around the joint. All points of the limb share the
centre p: :math:`|m|^2 - 2 m \cdot p + (p^2 - r^2) = 0` is linear in p and one constant per point; Gauss-Newton steps on
the distances themselves then remove the bias of the linear form.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats, Ints

FEWEST_ON_SPHERE = 5
MAX_STEPS = 20
STEP_TOLERANCE = 1e-9
"""mm."""

RIDGE = 1e-9
"""Weight of nearness in the linear form, relative to the points' spread: it decides only what nothing else does."""


@dataclass(frozen=True, eq=False)
class SphereFit:
    """A centre of rotation seen from a body.

    Attributes
    ----------
    centre : ndarray, shape (3,), mm
        In the body's frame.
    radii : ndarray, shape (n_points,), mm
        Distance of each point.
    variance : float, mm^2
        Mean over points of the variance of their distance to the centre.
    """

    centre: Floats
    radii: Floats
    variance: float


def fit_sphere(body: Floats, points: Floats, near: Floats) -> SphereFit | None:
    """Fit the common centre of spheres on which points move around a body.

    Parameters
    ----------
    body : ndarray, shape (n_frames, 4, 4)
        world_from_body; NaN where unknown.
    points : ndarray, shape (n_frames, n_points, 3), mm
        World positions; NaN where unseen.
    near : ndarray, shape (3,), mm
        Where the body is in its own frame: undetermined directions lean there.

    Returns
    -------
    SphereFit or None
        None if fewer than `FEWEST_ON_SPHERE` frames show the body and a point.
    """
    local = np.einsum("fji,fnj->fni", body[:, :3, :3], points - body[:, np.newaxis, :3, 3])
    seen = ~np.isnan(local[:, :, 0])
    which = np.broadcast_to(np.arange(points.shape[1]), seen.shape)[seen]
    data = local[seen]
    if len(data) < FEWEST_ON_SPHERE * points.shape[1] or len(np.unique(which)) < points.shape[1]:
        return None
    centre = _linear_centre(data, which, near)
    for _ in range(MAX_STEPS):
        step = _gauss_newton_step(data, which, centre)
        centre = centre + step
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    distance = np.linalg.norm(data - centre, axis=1)
    count = np.bincount(which)
    radii = np.bincount(which, distance) / count
    variances = np.bincount(which, (distance - radii[which]) ** 2) / count
    return SphereFit(centre, radii, float(variances.mean()))


def _centred(values: Floats, which: Ints) -> Floats:
    """Values minus the mean over their own point: eliminates one constant per point."""
    count = np.bincount(which)[:, np.newaxis]
    means = np.stack([np.bincount(which, column) for column in values.T], axis=1) / count
    return np.asarray(values - means[which])


def _linear_centre(data: Floats, which: Ints, near: Floats) -> Floats:
    shifted = data - near
    matrix = 2 * _centred(shifted, which)
    right = _centred((shifted**2).sum(axis=1, keepdims=True), which)[:, 0]
    normal = matrix.T @ matrix
    ridge = RIDGE * np.trace(normal) + np.finfo(np.float64).tiny
    return np.asarray(near + np.linalg.solve(normal + ridge * np.eye(3), matrix.T @ right))


def _gauss_newton_step(data: Floats, which: Ints, centre: Floats) -> Floats:
    offset = data - centre
    distance = np.maximum(np.linalg.norm(offset, axis=1), np.finfo(np.float64).tiny)
    residual = _centred(distance[:, np.newaxis], which)[:, 0]
    jacobian = -_centred(offset / distance[:, np.newaxis], which)
    normal = jacobian.T @ jacobian
    ridge = RIDGE * np.trace(normal) + np.finfo(np.float64).tiny
    return np.asarray(-np.linalg.solve(normal + ridge * np.eye(3), jacobian.T @ residual))
