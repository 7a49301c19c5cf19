"""The kind of a joint between two bodies with poses, and its fit: found, or as the user knows it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.geometry.rotations import vector_from_matrix
from skelgen.kinematics.arrow import solve_arrow
from skelgen.kinematics.joint_fit import JointFit, fit_kind, linear_place
from skelgen.kinematics.kind import KNOWN_KINDS, ROUNDING, JointKind, KindLimits, find_kind
from skelgen.kinematics.placed import Placed, fit_placed, linearised
from skelgen.kinematics.relative import MIN_FRAMES, RelativePoses, relative_poses, whitener
from skelgen.kinematics.turning import FreeTurning
from skelgen.model import Poses
from skelgen.model.arrays import Floats

FREEDOMS_OF_GAP = 3.0
"""Per frame: what poses alone tell of their noise is how far a ball joint's two images are apart."""


VARIANCE_OF_THIRD = 20.0
"""Of third differences of independent numbers of variance 1: 1 + 9 + 9 + 1."""


@dataclass(frozen=True, eq=False)
class KindChoice:
    """The kind of a joint and what speaks for it.

    Attributes
    ----------
    kind : str
        ``ball``, ``hinge``, ``universal``, ``rigid``, or ``undetermined``.
    fit : JointFit
        Fit of that kind; of an undetermined joint, of the simplest kind that explains what is seen.
    evidence : JointKind
        What each kind that was tried leaves unexplained; its singular values are those of the mean rotation.
    """

    kind: str
    fit: JointFit
    evidence: JointKind

    @property
    def sentence(self) -> str:
        """What was found, in words."""
        turn = f"turns by {np.rad2deg(self.evidence.main_turn):.3g} deg"
        if self.kind == "undetermined":
            last = list(self.evidence.leftovers.values())[-1]
            hidden = f"noise could hide {np.rad2deg(last.hidden):.2g} deg"
            return f"not enough motion to tell the kind of joint: it {turn}, and {hidden}"
        values = " ".join(f"{value:.2g}" for value in self.fit.singular_values)
        tried = ", ".join(
            f"{name} leaves {left.ratio:.3g} times the noise (limit {left.limit:.3g})"
            for name, left in self.evidence.leftovers.items()
        )
        return f"{self.kind}: {turn}" + (f"; {tried}" if tried else "") + f"; singular values {values}"


def choose_kind(
    poses: Poses,
    parent: int | str,
    child: int | str,
    covariances: Floats | None = None,
    size: float | None = None,
    *,
    wanted: str | None = None,
    limits: KindLimits | None = None,
) -> KindChoice:
    """Find the kind of the joint between two bodies, and fit it.

    Parameters
    ----------
    poses, parent, child, covariances, size
        As for `fit_ball`.
    wanted : str, optional
        A kind that the user knows; it is fitted without question.
    limits : KindLimits, optional
        Where one kind ends and the next begins.

    Raises
    ------
    InputError
        If `wanted` is no kind, there is no such body, or too few frames show both.

    Examples
    --------
    >>> choice = choose_kind(poses, "thigh", "shank")  # doctest: +SKIP
    >>> choice.kind, choice.fit.axis_in_parent  # doctest: +SKIP
    ('hinge', array([0.02, 0.99, -0.11]))
    """
    if wanted is not None and wanted not in KNOWN_KINDS:
        raise InputError(f"there is no joint of kind {wanted!r}; kinds are {', '.join(KNOWN_KINDS)}")
    return choose(relative_poses(poses, parent, child, covariances, size), wanted, limits)


def choose(measured: RelativePoses, wanted: str | None = None, limits: KindLimits | None = None) -> KindChoice:
    """Find the kind of the joint behind relative poses, and fit it; see `choose_kind`."""
    rotations, covariances = _settled_rotations(measured)
    evidence = find_kind(rotations, covariances, FREEDOMS_OF_GAP, limits, wanted)
    simplest = next(reversed(evidence.leftovers)) if evidence.kind == "undetermined" else evidence.kind
    return KindChoice(evidence.kind, fit_kind(simplest, measured), evidence)


def _settled_rotations(measured: RelativePoses) -> tuple[Floats, Floats]:
    """Rotations that also heed the positions, which a joint ties to them, with their covariances."""
    _, place = linear_place(measured)
    ball = fit_placed(Placed(FreeTurning(measured.rotations), place[:3], place[3:]), measured)
    solution = solve_arrow(linearised(ball.state, measured, whitener(measured.covariances)))
    n_frames = len(measured.frames)
    variance = ball.squares / max(3 * n_frames - solution.rank, 1)
    rotations = ball.state.turning.rotations()
    if measured.is_scaled:
        return rotations, max(variance, 1.0) * solution.angle_covariance
    covariances = variance * solution.angle_covariance + ROUNDING**2 * np.eye(3)
    shaking = _shaking(measured) / np.einsum("fii->f", covariances).mean()
    return rotations, max(float(shaking), 1.0) * covariances


def _shaking(measured: RelativePoses) -> float:
    """Variance [rad^2] of what changes from each frame to the next, all axes together.

    Third differences of smooth motion are next to nothing; those of independent errors have 20 times their variance.
    Medians keep out what is neither.
    """
    steps = vector_from_matrix(measured.rotations[:-1].swapaxes(1, 2) @ measured.rotations[1:])
    third = np.diff(steps[np.diff(measured.frames) == 1], n=2, axis=0)
    if len(third) < MIN_FRAMES:
        return 0.0
    return float(((SIGMA_OF_MEDIAN * np.median(np.abs(third), axis=0)) ** 2).sum() / VARIANCE_OF_THIRD)
