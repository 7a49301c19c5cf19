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
from types import ModuleType

import numpy as np

from skelgen.compiling import in_order, loops
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
    weights = np.ones(len(first)) if weights is None else weights
    sums = ball_loops().fixed_point_sums(*in_order(first, second, weights))
    relative, seen_from_first, seen_from_second, square, n_frames = sums
    if n_frames < MIN_FRAMES:
        return None
    normal = np.eye(6)
    normal[:3, 3:], normal[3:, :3] = -relative, -relative.T
    right = np.concatenate([seen_from_first, -seen_from_second])
    near = np.concatenate([near_first, near_second])
    point = near + np.linalg.solve(normal + RELATIVE_RIDGE * np.eye(6), right - normal @ near)
    gap = square - 2 * point @ right + point @ normal @ point
    u, singular, vt = np.linalg.svd(relative)
    return FixedPoint(
        in_first=point[:3],
        in_second=point[3:],
        gap=max(float(gap), 0.0),
        turning=np.asarray(1 - np.minimum(singular, 1.0) ** 2),
        axis_in_first=u[:, 0],
        axis_in_second=vt[0],
        n_frames=n_frames,
    )


def ball_loops() -> ModuleType:
    """Return the compiled loops over frames of two bodies, or their plain twin."""
    return loops("skelgen.kinematics.compiled_ball", "skelgen.kinematics.plain_ball")
