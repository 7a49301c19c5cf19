r"""Universal joints in closed form: the two axes whose angle never changes.

With the axis u fixed in the parent and v fixed in the child, :math:`u^T R_f v` is constant. Its variance is a form of
second degree in each of both, built from the second moments of the rotations alone. Divided by
:math:`1 - (u^T \bar R v)^2` it is the variance of the angle between the axes; that ratio is minimised over one axis at
a time, as a generalised eigenvalue problem of size 3, from directions all over the sphere. Nothing in the sources
covers this kind; both axes are taken to meet in one point.
"""

from __future__ import annotations

import numpy as np

from skelgen.kinematics.arrow import kind_loops
from skelgen.kinematics.turning import TwoAxisTurning, frame_along
from skelgen.model.arrays import Floats

N_STARTS = 48
"""Directions all over the half sphere, some 20 degrees apart: minima are wider."""

N_ROUNDS = 4
"""Rounds of alternation from each; the refinement does the rest."""

UNIVERSAL_RIDGE = 1e-6
"""Of unit variance: axes that never move against each other make no universal joint."""

_GOLDEN = (1 + 5**0.5) / 2


def universal_turning(rotations: Floats) -> TwoAxisTurning:
    """Return the universal joint that comes nearest to some rotations.

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        Parent from child.
    """
    mean = rotations.mean(axis=0)
    flat = (rotations - mean).reshape(len(rotations), 9)
    moments = (flat.T @ flat / len(flat)).reshape(3, 3, 3, 3)
    second, variances = kind_loops().alternated(moments, mean, _half_sphere(N_STARTS), N_ROUNDS)
    best = int(np.argmin(variances))
    first, _ = best_partners(moments, mean, second[best : best + 1])
    second, _ = best_partners(moments.transpose(1, 0, 3, 2), mean.T, first)
    return _turning(rotations, first[0], second[0])


def best_partners(moments: Floats, mean: Floats, known: Floats) -> tuple[Floats, Floats]:
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


def _turning(rotations: Floats, first: Floats, second: Floats) -> TwoAxisTurning:
    """The joint with two given axes; its angles are those of the Euler sequence z x z."""
    in_parent, in_child = frame_along(first), frame_along(second)
    between = in_parent.T @ rotations @ in_child
    cosine = between[:, 2, 2].mean()
    angles = np.stack(
        [np.arctan2(between[:, 0, 2], -between[:, 1, 2]), np.arctan2(between[:, 2, 0], between[:, 2, 1])], axis=1
    )
    return TwoAxisTurning(in_parent, in_child, float(np.arccos(np.clip(cosine, -1.0, 1.0))), angles)


def _half_sphere(count: int) -> Floats:
    """Unit vectors spread evenly over a half sphere, shape (count, 3) (Fibonacci's lattice)."""
    height = (np.arange(count) + 0.5) / count
    around = 2 * np.pi * np.arange(count) / _GOLDEN
    level = np.sqrt(1 - height**2)
    return np.stack([level * np.cos(around), level * np.sin(around), height], axis=1)
