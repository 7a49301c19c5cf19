r"""Joints in closed form: centres of rotation, axes of hinges, and the two axes of universal joints.

**Centre.** A joint is a point fixed in both bodies: :math:`R_a p_a + t_a = R_b p_b + t_b` in every frame. The stacked
linear system (O'Brien 2000, eq. 8-13) has the 6 x 6 normal matrix

.. math::
    \begin{pmatrix} I & -C \\ -C^T & I \end{pmatrix}, \qquad C = \langle R_a^T R_b \rangle,

so the mean relative rotation C and two mean vectors contain all that the frames determine. Along the axis of a hinge
the point is not determined; there the one nearest to both bodies is taken.

**Sphere.** If the other limb has no pose, its points stay on spheres around the joint, seen from the body. They share
the centre p: :math:`|m|^2 - 2 m \cdot p + (p^2 - r^2) = 0` is linear in p and one constant per point. Gauss-Newton
steps on the distances themselves then remove the bias of the linear form.

**Hinge.** The equations :math:`p_p - R_f p_c = t_f` leave one direction open when all rotations are about one axis:
their sixth singular vector is that axis in both bodies, and the solution of rank 5 is the point of the axis that is
nearest to both (O'Brien 2000, 3.2; Gaschler 2011, 5.2.3).

**Universal joint.** With the axis u fixed in the parent and v fixed in the child, :math:`u^T R_f v` is constant. Its
variance is a quadratic form in each of both, built from the second moments of the rotations alone. Divided by
:math:`1 - (u^T \bar R v)^2` it is the variance of the angle between the axes. That ratio is minimised over one axis at
a time, as a generalised eigenvalue problem of size 3, from directions all over the sphere. No source covers this type;
both axes are taken to meet in one point.
"""

from dataclasses import dataclass

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.ball_joint import SPHERE_RIDGE, fixed_point_sums, move_to_centre
from skelgen._kernels.joint_models import UNIVERSAL_RIDGE, alternated
from skelgen.geometry.rotations import frame_along, nearest_rotation
from skelgen.kinematics.joints.rotations import ConstrainedRotation
from skelgen.model.arrays import Floats, Ints

MIN_FRAMES = 3
"""Fewer common frames than this determine no joint."""

RELATIVE_RIDGE = 1e-7
"""Weight of nearness beside one frame's equations: its bias is below 1e-3 mm for joints that rotate by 10 degrees."""

FEWEST_ON_SPHERE = 5
MAX_STEPS = 20
N_STARTS = 48
"""Directions all over the half sphere, some 20 degrees apart: minima are wider."""

N_ROUNDS = 4
"""Rounds of alternation from each; the refinement does the rest."""

_GOLDEN = (1 + 5**0.5) / 2


@dataclass(frozen=True, eq=False)
class FixedPoint:
    """A fixed point of two bodies.

    Attributes
    ----------
    in_first, in_second : ndarray, shape (3,), mm
        The point in both bodies' frames.
    gap : float, mm^2
        Mean square over frames of the distance between the two images of the point.
    determinacy : ndarray, shape (3,)
        How well each direction is determined, rising: eigenvalues of I - C C^T, 0 where nothing rotates, at most 1.
    axis_in_first, axis_in_second : ndarray, shape (3,)
        Direction in both bodies that is determined worst: the axis, if the joint is a hinge.
    n_frames : int
        Frames that show both bodies.
    """

    in_first: Floats
    in_second: Floats
    gap: float
    determinacy: Floats
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
        Points of the bodies in their own frames (centroids of their markers), to which undetermined directions lean.
    weights : ndarray, shape (n_frames,), optional
        Of the frames, not negative; all count alike if left out.

    Returns
    -------
    FixedPoint or None
        None if fewer than `MIN_FRAMES` frames show both bodies.
    """
    weights = np.ones(len(first)) if weights is None else weights
    sums = fixed_point_sums(*contiguous(first, second, weights))
    relative, seen_from_first, seen_from_second, square, n_frames = sums
    if n_frames < MIN_FRAMES:
        return None
    normal = np.eye(6)
    normal[:3, 3:], normal[3:, :3] = -relative, -relative.T
    right = np.concatenate([seen_from_first, -seen_from_second])
    near = np.concatenate([near_first, near_second])
    point = near + np.linalg.solve(normal + RELATIVE_RIDGE * np.eye(6), right - normal @ near)
    gap = max(float(square - 2 * point @ right + point @ normal @ point), 0.0)
    u, singular, vt = np.linalg.svd(relative)
    determinacy = np.asarray(1 - np.minimum(singular, 1.0) ** 2)
    return FixedPoint(point[:3], point[3:], gap, determinacy, u[:, 0], vt[0], n_frames)


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
        A point of the body in its own frame (the centroid of its markers), to which undetermined directions lean.

    Returns
    -------
    SphereFit or None
        None if fewer than `FEWEST_ON_SPHERE` frames show the body and a point.
    """
    local = np.einsum("fji,fnj->nfi", body[:, :3, :3], points - body[:, np.newaxis, :3, 3])
    seen = ~np.isnan(local[:, :, 0])
    count = seen.sum(axis=1)
    data = local[seen]  # point by point
    if len(data) < FEWEST_ON_SPHERE * points.shape[1] or not count.all():
        return None
    shifted = data - near
    linear = _centred(np.column_stack([2 * shifted, (shifted**2).sum(axis=1)]), count)
    centre = near + _near_zero(linear)
    move_to_centre(data, np.cumsum(count), centre, np.empty((len(data), 4)), MAX_STEPS)
    distance = np.linalg.norm(data - centre, axis=1, keepdims=True)
    variances = _means(_centred(distance, count) ** 2, count)
    return SphereFit(centre, _means(distance, count)[:, 0], float(variances.mean()))


def _means(values: Floats, count: Ints) -> Floats:
    """Means over each point, whose values are side by side, shape (n_points, n_columns)."""
    return np.asarray(np.add.reduceat(values, np.cumsum(count) - count) / count[:, np.newaxis])


def _centred(values: Floats, count: Ints) -> Floats:
    """Values minus the mean over their own point: eliminates one constant per point."""
    return np.asarray(values - np.repeat(_means(values, count), count, axis=0))


def _near_zero(equations: Floats) -> Floats:
    """Least squares solution, shape (3,); a small ridge keeps it near 0 where it is not determined.

    Parameters
    ----------
    equations : ndarray, shape (n, 4)
        The matrix and, last, the right-hand side.
    """
    products = equations.T @ equations
    ridge = SPHERE_RIDGE * np.trace(products[:3, :3]) + np.finfo(np.float64).tiny
    return np.asarray(np.linalg.solve(products[:3, :3] + ridge * np.eye(3), products[:3, 3]))


def nearest_constrained(kind: str, rotations: Floats) -> ConstrainedRotation:
    """Return the joint of a type that comes nearest to some rotations.

    Parameters
    ----------
    kind : str
        ``rigid``, ``hinge`` or ``universal``.
    rotations : ndarray, shape (n, 3, 3)
        Parent from child.
    """
    if kind == "rigid":
        return ConstrainedRotation(
            nearest_rotation(rotations.mean(axis=0)), np.eye(3), 0.0, np.zeros((len(rotations), 0))
        )
    return nearest_hinge(rotations) if kind == "hinge" else nearest_universal(rotations)


def nearest_hinge(rotations: Floats) -> ConstrainedRotation:
    """Return the hinge that comes nearest to some rotations.

    The halves of the last singular vector of the stacked equations are the leading singular vectors of the mean
    rotation: both minimise the mean of :math:`|u - R_f v|^2` over unit vectors.

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Parent from child.
    """
    u, _, vt = np.linalg.svd(rotations.mean(axis=0))
    in_parent, in_child = frame_along(u[:, 0]), frame_along(vt[0])
    angles = hinge_angles(rotations, in_parent, in_child)[:, np.newaxis]
    return ConstrainedRotation(in_parent, in_child, 0.0, angles)


def hinge_angles(rotations: Floats, in_parent: Floats, in_child: Floats) -> Floats:
    """Return the angles [rad] that best rotate one plane onto the other (Gaschler 2011, eq. 5.16), shape (n,).

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Parent from child.
    in_parent, in_child : ndarray, shape (3, 3)
        Frames of the axis in both limbs; the axis is their last column.
    """
    between = in_parent.T @ rotations @ in_child
    sine = between[:, 1, 0] - between[:, 0, 1]
    cosine = between[:, 0, 0] + between[:, 1, 1]
    return np.asarray(np.arctan2(sine, cosine))


def nearest_universal(rotations: Floats) -> ConstrainedRotation:
    """Return the universal joint that comes nearest to some rotations.

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Parent from child.
    """
    mean = rotations.mean(axis=0)
    flat = (rotations - mean).reshape(len(rotations), 9)
    moments = flat.T @ flat / len(flat)
    second, variances = alternated(moments, mean.ravel(), _half_sphere(N_STARTS), N_ROUNDS)
    moments = moments.reshape(3, 3, 3, 3)
    best = int(np.argmin(variances))
    first, _ = _best_partners(moments, mean, second[best : best + 1])
    second, _ = _best_partners(moments.transpose(1, 0, 3, 2), mean.T, first)
    in_parent, in_child = frame_along(first[0]), frame_along(second[0])
    between = in_parent.T @ rotations @ in_child  # its angles are those of the Euler sequence z x z
    cosine = between[:, 2, 2].mean()
    angles = np.stack(
        [np.arctan2(between[:, 0, 2], -between[:, 1, 2]), np.arctan2(between[:, 2, 0], between[:, 2, 1])], axis=1
    )
    return ConstrainedRotation(in_parent, in_child, float(np.arccos(np.clip(cosine, -1.0, 1.0))), angles)


def _best_partners(moments: Floats, mean: Floats, known: Floats) -> tuple[Floats, Floats]:
    """Return axes on the left that keep their angle to each of some axes on the right best, and the angles' variances.

    Parameters
    ----------
    moments : ndarray, shape (3, 3, 3, 3)
        Covariances of the elements of the rotations.
    mean : ndarray, shape (3, 3)
        Their mean.
    known : ndarray, shape (n, 3)
        Unit axes on the right.
    """
    spread = np.einsum("iajb,na,nb->nij", moments, known, known)
    middle = known @ mean.T
    weight = (1 + UNIVERSAL_RIDGE) * np.eye(3) - middle[:, :, np.newaxis] * middle[:, np.newaxis, :]
    root = np.linalg.inv(np.linalg.cholesky(weight))
    values, vectors = np.linalg.eigh(root @ spread @ root.swapaxes(1, 2))
    axis = (root.swapaxes(1, 2) @ vectors[:, :, :1])[..., 0]
    return axis / np.linalg.norm(axis, axis=1, keepdims=True), values[:, 0]


def _half_sphere(count: int) -> Floats:
    """Unit vectors spread evenly over a half sphere, shape (count, 3) (Fibonacci's lattice)."""
    height = (np.arange(count) + 0.5) / count
    around = 2 * np.pi * np.arange(count) / _GOLDEN
    level = np.sqrt(1 - height**2)
    return np.stack([level * np.cos(around), level * np.sin(around), height], axis=1)
