r"""The joint cost: how constant the distances from a joint to the markers of its two limbs are (Schönauer 2007, 3.5).

.. math::
    jc = \frac1n \sum_m \left[ \frac1{|F_m|} \sum_{f \in F_m} (d_{mf} - \bar d_m)^2 + \alpha\, \bar d_m \right],
    \qquad d_{mf} = |c_f - x_{mf}|

with one joint position :math:`c_f` per frame, the n markers of both limbs, and the frames :math:`F_m` that show
marker m.
"""

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import mean_distances
from skelgen.model.arrays import Floats
from skelgen.stages.classic.conjugate_gradient import Objective

TINY = 1e-12
"""mm; keeps the gradient finite for a joint that sits on a marker."""

LOCAL_STEPS = 30
LOCAL_DAMPING = 1e-3
DAMPING_RANGE = (1e-9, 1e9)
LOCAL_TOLERANCE = 1e-7
"""mm; a frame is settled when its joint moves less."""


def joint_cost(markers: Floats, alpha: float) -> Objective:
    """Return the joint cost as a function of the joint's positions.

    Parameters
    ----------
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    alpha : float
        Weight of the mean distance [mm].

    Returns
    -------
    callable
        Takes positions [mm], shape (n_frames, 3); returns cost [mm^2] and gradient [mm], shape (n_frames, 3).
    """
    seen = ~np.isnan(markers[:, :, 0])
    filled = np.where(seen[..., np.newaxis], markers, 0.0)
    weight = seen / np.maximum(seen.sum(axis=0), 1)
    n_markers = max(int(seen.any(axis=0).sum()), 1)

    def cost(joint: Floats) -> tuple[float, Floats]:
        offset = joint[:, np.newaxis] - filled
        distance = np.sqrt(np.einsum("fmi,fmi->fm", offset, offset)) + TINY
        mean = (distance * weight).sum(axis=0)
        deviation = distance - mean
        value = ((deviation**2 * weight).sum() + alpha * mean.sum()) / n_markers
        factor = weight * (2 * deviation + alpha) / distance / n_markers
        return float(value), np.einsum("fm,fmi->fi", factor, offset)

    return cost


def local_optimum(joint: Floats, markers: Floats, max_residual: float, max_fallback: int) -> Floats:
    """Move the joint in every frame to where its distances to the markers are nearest to their means.

    This is the local optimisation of Schönauer (2007, 3.5.2). The frames are independent: all are solved at once by
    damped Gauss-Newton steps on three unknowns each. A frame that ends above `max_residual` is tried again from the
    positions of up to `max_fallback` earlier frames.

    Parameters
    ----------
    joint : ndarray, shape (n_frames, 3), mm
        Positions from the global optimisation.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of both limbs, NaN where unseen.
    max_residual : float, mm^2
        Mean squared error of the distances above which a frame is solved again.
    max_fallback : int
        From how many frames back it may start then.
    """
    radii, _ = mean_distances(*contiguous(joint, markers))
    settled, cost = _multilaterate(joint, markers, radii)
    for back in range(1, max_fallback + 1):
        bad = np.flatnonzero(cost > max_residual)
        bad = bad[bad >= back]
        if not len(bad):
            break
        again, new_cost = _multilaterate(settled[bad - back], markers[bad], radii)
        better = new_cost < cost[bad]
        settled[bad[better]], cost[bad[better]] = again[better], new_cost[better]
    return settled


def _multilaterate(joint: Floats, markers: Floats, radii: Floats) -> tuple[Floats, Floats]:
    """Positions and mean squared distance error [mm^2] per frame."""
    seen = ~np.isnan(markers[:, :, 0])
    filled = np.where(seen[..., np.newaxis], markers, 0.0)
    count = np.maximum(seen.sum(axis=1), 1)
    point = joint.copy()

    def residuals(at: Floats) -> tuple[Floats, Floats]:
        offset = at[:, np.newaxis] - filled
        distance = np.linalg.norm(offset, axis=2) + TINY
        return (distance - radii) * seen, offset / distance[..., np.newaxis] * seen[..., np.newaxis]

    error, slope = residuals(point)
    damping = np.full(len(point), LOCAL_DAMPING)
    for _ in range(LOCAL_STEPS):
        normal = np.einsum("fmi,fmj->fij", slope, slope) + damping[:, np.newaxis, np.newaxis] * np.eye(3)
        step = -np.linalg.solve(normal, np.einsum("fmi,fm->fi", slope, error)[..., np.newaxis])[..., 0]
        new_error, new_slope = residuals(point + step)
        better = (new_error**2).sum(axis=1) <= (error**2).sum(axis=1)
        point = np.where(better[:, np.newaxis], point + step, point)
        error = np.where(better[:, np.newaxis], new_error, error)
        slope = np.where(better[:, np.newaxis, np.newaxis], new_slope, slope)
        damping = np.clip(np.where(better, damping / 5, damping * 10), *DAMPING_RANGE)
        if np.abs(step[better]).max(initial=0.0) < LOCAL_TOLERANCE:
            break
    return point, (error**2).sum(axis=1) / count
