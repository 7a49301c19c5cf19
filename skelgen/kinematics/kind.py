r"""What kind a joint is, from the rotations between its two limbs.

A direction u of the child that a hinge keeps fixed in the parent is the leading singular vector of the mean relative
rotation :math:`C = \langle R_p^T R_c \rangle`: :math:`|C u| = 1` if it never moves, and :math:`\sqrt{2 (1 - |C u|)}` is
how far it wobbles [rad]. The second singular value gives the turn about it in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats

CLEARLY_LESS = 0.5
"""A wobble within the noise makes a hinge only if it is less than this part of the main turn."""


@dataclass(frozen=True, eq=False)
class JointKind:
    """The kind of a joint.

    Attributes
    ----------
    kind : str
        ``ball``, ``hinge`` or ``rigid``.
    axis_in_parent, axis_in_child : ndarray, shape (3,)
        Unit direction that moves least; the axis of a hinge.
    main_turn, wobble : float, rad
        Root mean square turn about the axis, and of the axis.
    """

    kind: str
    axis_in_parent: Floats
    axis_in_child: Floats
    main_turn: float
    wobble: float


@dataclass(frozen=True)
class KindLimits:
    """Where one kind ends and the next begins.

    Attributes
    ----------
    noise_factor : float
        Turns below this many times the noise count as none.
    hinge_wobble : float
        Largest wobble of a hinge, noise apart, as a part of its main turn.
    least_turn : float, rad
        Limbs that turn less against each other are rigid, however exact the take.
    """

    noise_factor: float
    hinge_wobble: float
    least_turn: float


def find_kind(relative: Floats, noise: float, limits: KindLimits) -> JointKind:
    """Classify a joint.

    Parameters
    ----------
    relative : ndarray, shape (n_frames, 3, 3)
        Rotations parent from child.
    noise : float, rad
        Standard deviation of the relative rotation about one axis.
    limits : KindLimits
        Where one kind ends and the next begins.
    """
    u, singular, vt = np.linalg.svd(relative.mean(axis=0))
    wobble, main = (float(np.sqrt(max(2 * (1 - value), 0.0))) for value in singular[:2])
    level = limits.noise_factor * float(np.sqrt(2.0)) * noise
    clean_wobble = float(np.sqrt(max(wobble**2 - level**2, 0.0)))
    kind = "ball"
    if main < max(level, limits.least_turn):
        kind = "rigid"
    elif clean_wobble < limits.hinge_wobble * main and wobble < CLEARLY_LESS * main:
        kind = "hinge"
    return JointKind(kind, u[:, 0], vt[0], main, wobble)
