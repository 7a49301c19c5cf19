r"""What kind a joint is, from the rotations between its two limbs.

A direction u of the child that a hinge keeps fixed in the parent is the leading singular vector of the mean relative
rotation :math:`C = \langle R_p^T R_c \rangle`: :math:`|C u| = 1` if it never moves, and :math:`\sqrt{2 (1 - |C u|)}` is
how far it wobbles [rad]. The second singular value gives the turn about it in the same way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.model.arrays import Floats

AXIS_WAY = 10.0
"""mm; a hinge is free along its axis if moving it this far disturbs the markers by less than their noise."""

ROUNDING_TURN = 1e-6
"""rad; rotations in double precision wobble by the square root of their rounding."""

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
    true_wobble : float, rad
        The wobble without what noise explains; 0 for a perfect hinge.
    """

    kind: str
    axis_in_parent: Floats
    axis_in_child: Floats
    main_turn: float
    wobble: float
    true_wobble: float

    def freedom_along_axis(self, noise: float) -> float:
        """How free the joint is to lie anywhere along its axis: 1 for a perfect hinge, 0 where its wobble fixes it.

        A joint that is moved along its axis tears its limbs apart by the wobble times the way. That counts as nothing
        when it stays within the noise: the many frames that could average the noise do not average the errors of a
        real hinge.

        Parameters
        ----------
        noise : float, mm
            Standard deviation of a marker's coordinate.
        """
        if self.kind != "hinge":
            return 0.0
        torn = self.true_wobble * AXIS_WAY
        return noise**2 / (noise**2 + torn**2) if torn > 0 else 1.0


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
    return JointKind(kind, u[:, 0], vt[0], main, wobble, clean_wobble if wobble > ROUNDING_TURN else 0.0)
