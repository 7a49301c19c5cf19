r"""Ball joints between bodies whose poses are known, in closed form.

A joint is a point fixed in both bodies: :math:`R_a p_a + t_a = R_b p_b + t_b` in every frame. The stacked linear
system (O'Brien 2000, eq. 8-13) has the 6 x 6 normal matrix

.. math::
    \begin{pmatrix} I & -C \\ -C^T & I \end{pmatrix}, \qquad C = \langle R_a^T R_b \rangle,

so that the mean relative rotation C and two mean vectors hold all that the frames say. Directions in which the relative
rotation never turns (the axis of a hinge) are not determined; there the point nearest to both bodies is taken.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats

MIN_FRAMES = 3
"""Fewer common frames than this determine no joint."""

RELATIVE_RIDGE = 1e-7
"""Weight of nearness beside one frame's equations: its bias is below 1e-3 mm for joints that turn by 10 degrees."""


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """A fixed point of two bodies.

    Attributes
    ----------
    in_first, in_second : ndarray, shape (3,), mm
        The point in both bodies' frames.
    gap : float, mm^2
        Mean square over frames of the distance between the two images of the point.
    turning : ndarray, shape (3,)
        How well each direction is determined, rising: eigenvalues of I - C C^T between 0 (never turned) and 1.
    axis_in_first, axis_in_second : ndarray, shape (3,)
        Direction in both bodies that is determined worst: the axis, if the joint is a hinge.
    n_frames : int
        Frames that show both bodies.
    """

    in_first: Floats
    in_second: Floats
    gap: float
    turning: Floats
    axis_in_first: Floats
    axis_in_second: Floats
    n_frames: int


def fit_fixed_point(
    first: Floats, second: Floats, near_first: Floats, near_second: Floats, weights: Floats | None = None
) -> FixedPoint | None:
    """Fit the point that is fixed in two bodies.

    Parameters
    ----------
    first, second : ndarray, shape (n_frames, 4, 4)
        world_from_body of both; NaN where unknown.
    near_first, near_second : ndarray, shape (3,), mm
        Where the bodies are in their own frames (centroids of their markers): undetermined directions lean there.
    weights : ndarray, shape (n_frames,), optional
        Of the frames, not negative; all count alike if left out.

    Returns
    -------
    FixedPoint or None
        None if fewer than `MIN_FRAMES` frames show both bodies.
    """
    both = ~np.isnan(first[:, 0, 0]) & ~np.isnan(second[:, 0, 0])
    if both.sum() < MIN_FRAMES:
        return None
    share = np.ones(int(both.sum())) if weights is None else weights[both]
    share = share / share.sum()
    ra, rb = first[both, :3, :3], second[both, :3, :3]
    between = second[both, :3, 3] - first[both, :3, 3]
    weighted = share[:, np.newaxis, np.newaxis] * ra
    relative = np.tensordot(weighted, rb, ((0, 1), (0, 1)))
    seen_from_first = np.tensordot(weighted, between, ((0, 1), (0, 1)))
    seen_from_second = np.einsum("f,fji,fj->i", share, rb, between)
    normal = np.block([[np.eye(3), -relative], [-relative.T, np.eye(3)]])
    right = np.concatenate([seen_from_first, -seen_from_second])
    near = np.concatenate([near_first, near_second])
    point = near + np.linalg.solve(normal + RELATIVE_RIDGE * np.eye(6), right - normal @ near)
    gap = share @ (between**2).sum(axis=1) - 2 * point @ right + point @ normal @ point
    u, singular, vt = np.linalg.svd(relative)
    return FixedPoint(
        in_first=point[:3],
        in_second=point[3:],
        gap=max(float(gap), 0.0),
        turning=np.asarray(1 - np.minimum(singular, 1.0) ** 2),
        axis_in_first=u[:, 0],
        axis_in_second=vt[0],
        n_frames=int(both.sum()),
    )
