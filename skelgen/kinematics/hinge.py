r"""Hinges in closed form: the axis, where it is, and the turn about it.

The equations of a ball joint, :math:`p_p - R_f p_c = t_f`, leave one direction open when all turns are about one axis:
their sixth singular vector is that axis in both bodies, and the solution of rank 5 is the point of the axis that is
nearest to both (O'Brien 2000, 3.2; Gaschler 2011, 5.2.3).
"""

from __future__ import annotations

import numpy as np

from skelgen.kinematics.turning import AxisTurning, frame_along
from skelgen.model.arrays import Floats


def hinge_turning(rotations: Floats) -> AxisTurning:
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
    return AxisTurning(in_parent, in_child, hinge_angles(rotations, in_parent, in_child))


def hinge_angles(rotations: Floats, in_parent: Floats, in_child: Floats) -> Floats:
    """Return the angles [rad] that best turn one plane onto the other, by two-dimensional least squares (eq. 5.16)."""
    between = in_parent.T @ rotations @ in_child
    sine = between[:, 1, 0] - between[:, 0, 1]
    cosine = between[:, 0, 0] + between[:, 1, 1]
    return np.asarray(np.arctan2(sine, cosine))
