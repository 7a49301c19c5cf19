r"""What kind a joint is: the simplest that explains the rotations between its two limbs.

Rigid, hinge and universal joints are fitted to the relative rotations by maximum likelihood. What a kind leaves over,
in units of the noise that the markers or poses show, is 1 for the true kind and grows with every turn that the kind
does not allow. The likelihood ratio of "nothing but noise" against "a turn of unknown size" is a function of that ratio
alone; both variances are estimates, so its limit is that of Fisher's F, with as many freedoms as independent frames:
soft tissue makes errors that last. A joint whose noise could hide the turns that would make it another kind is
undetermined.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtri

from skelgen._kernels import contiguous
from skelgen._kernels.joint_models import Parts, descended, linearised
from skelgen.geometry.rotations import nearest_rotation
from skelgen.kinematics.bodies.relative_poses import whitener
from skelgen.kinematics.chain.schur_complement import (
    LinearisedProblem,
    effective_frames_of_both,
    solve_bordered,
)
from skelgen.kinematics.joints.closed_form import nearest_hinge, nearest_universal
from skelgen.kinematics.joints.rotations import (
    ConstrainedRotation,
    JointRotation,
    RigidRotation,
    UniversalRotation,
    axis_covariance,
    constrained_rotation,
)
from skelgen.model.arrays import Floats

AXIS_WAY = 10.0
"""mm; a hinge is free along its axis if moving it this far disturbs the markers by less than their noise."""

ROUNDING_TURN = 1e-6
"""rad; rotations in double precision wobble by the square root of their rounding."""

ROUNDING = 1e-9
"""rad; noise of rotations that are exact in double precision."""

CLEARLY_LESS = 0.5
"""A kind counts as found if the noise cannot hide a turn of this part of those that it allows."""

RIGID_TURN = np.deg2rad(2.0)
"""rad; limbs are called rigid if noise cannot hide a turn of this size: less than any joint is ever moved by."""

MAX_ROUNDS = 8
"""Rounds of each kind's fit: the right kind needs three to five, and a wrong one is wrong by far."""

LEAST_GAIN = 1e-4
"""Part of what is left over that a round must take away for there to be another: kinds differ by far more."""

LEAST_FREEDOMS = 3.0
"""Freedoms of the noise's estimate that are counted at least: one limb with three markers in one frame."""

LEAST_BETWEEN = np.deg2rad(30.0)
"""rad; axes of universal joints are farther apart. Nearer ones turn against each other and so follow any small turn."""

KNOWN_KINDS = ("rigid", "hinge", "universal", "ball")
"""From the simplest to the one that allows all turns."""


@dataclass(frozen=True, eq=False)
class TypeFit:
    """What one kind of joint leaves unexplained.

    Attributes
    ----------
    turning : JointRotation
        The rotations that the kind allows, fitted.
    ratio : float
        Variance of what is left over, in units of the noise: 1 for the true kind.
    limit : float
        The ratio that noise alone hardly exceeds.
    wobble : float, rad
        Root mean square turn that is left over, noise included.
    true_wobble : float, rad
        The same without what noise explains.
    hidden : float, rad
        Root mean square turn that the noise could hide.
    allowed : float, rad
        Root mean square of the smallest turn that the kind allows; 0 for a rigid joint.
    axis_covariance : ndarray, shape (6, 6)
        Of the axis in the parent, then of that in the child, unit vectors; 0 for a rigid joint.
    """

    turning: JointRotation
    ratio: float
    limit: float
    wobble: float
    true_wobble: float
    hidden: float
    allowed: float
    axis_covariance: Floats


@dataclass(frozen=True, eq=False)
class JointKind:
    """The kind of a joint.

    Attributes
    ----------
    kind : str
        ``rigid``, ``hinge``, ``universal``, ``ball``, or ``undetermined`` where the limbs turn too little to tell.
    axis_in_parent, axis_in_child : ndarray, shape (3,)
        Unit axis of a hinge in both limbs. Of a universal joint: the axis fixed in the parent, and that fixed in the
        child. Of other kinds: the direction that moves least.
    main_turn : float, rad
        Root mean square turn about the axis that turns most.
    true_wobble : float, rad
        Root mean square turn besides those that the kind allows, without what noise explains.
    singular_values : ndarray, shape (3,)
        Of the mean relative rotation, falling: 1 for directions that never move.
    type_fits : mapping of str to TypeFit
        What the kinds that were tried leave over, the simplest first.
    axis_covariance : ndarray, shape (6, 6)
        Of the axis in the parent, then of that in the child; 0 for kinds without.
    """

    kind: str
    axis_in_parent: Floats
    axis_in_child: Floats
    main_turn: float
    true_wobble: float
    singular_values: Floats
    type_fits: dict[str, TypeFit]
    axis_covariance: Floats

    def with_frames(self, parent: Floats, child: Floats) -> JointKind:
        """Return the kind for limbs whose frames were turned: new from old, shape (3, 3)."""
        turn = np.zeros((6, 6))
        turn[:3, :3], turn[3:, 3:] = parent, child
        return replace(
            self,
            axis_in_parent=parent @ self.axis_in_parent,
            axis_in_child=child @ self.axis_in_child,
            axis_covariance=turn @ self.axis_covariance @ turn.T,
        )

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
    doubt : float
        Probability with which noise alone makes a joint seem to turn in more ways than it does.
    wobble_share : float
        Largest wobble of a hinge or universal joint, noise apart, as a part of the smallest turn that it allows.
    least_turn : float, rad
        Turns below this count as none, however exact the take.
    """

    doubt: float = 0.001
    wobble_share: float = 0.12
    least_turn: float = 1e-4


def find_kind(
    rotations: Floats, covariances: Floats, freedoms: float, limits: KindLimits | None = None, wanted: str | None = None
) -> JointKind:
    """Classify a joint.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames, 3, 3)
        Rotations parent from child, in the order of time.
    covariances : ndarray, shape (n_frames, 3, 3), rad^2
        Of small turns of each, in the parent's axes.
    freedoms : float
        Freedoms per frame on which the scale of the covariances rests.
    limits : KindLimits, optional
        Where one kind ends and the next begins.
    wanted : str, optional
        A kind that the user knows: it is fitted and returned without question.
    """
    limits = limits or KindLimits()
    u, singular, vt = np.linalg.svd(rotations.mean(axis=0))
    weight = whitener(covariances + ROUNDING**2 * np.eye(3))
    kind, type_fits = "ball", dict[str, TypeFit]()
    for name in KNOWN_KINDS[:-1] if wanted is None else (wanted,):
        if name == "ball":
            break
        left = type_fits[name] = _leftover(name, rotations, weight, singular, freedoms, limits)
        if wanted is not None or _explains(left, limits):
            kind = name if wanted is not None or _is_told(left) else "undetermined"
            break
    axes = (type_fits[kind].turning.axes() if kind in type_fits else None) or (u[:, 0], vt[0])
    last = next(reversed(type_fits.values()), None)
    return JointKind(
        kind=kind,
        axis_in_parent=axes[0],
        axis_in_child=axes[1],
        main_turn=float(np.sqrt(max(2 * (1 - singular[1]), 0.0))),
        true_wobble=last.true_wobble if last is not None and kind != "ball" else 0.0,
        singular_values=singular,
        type_fits=type_fits,
        axis_covariance=type_fits[kind].axis_covariance if kind in type_fits else np.zeros((6, 6)),
    )


def _leftover(
    name: str, rotations: Floats, weight: Floats, singular: Floats, freedoms: float, limits: KindLimits
) -> TypeFit:
    """Fit one kind, and weigh what it leaves over."""
    start = _start(name, rotations)
    rotations, weight = contiguous(rotations, weight)
    turning = constrained_rotation(*descended(*_held(start), rotations, weight, MAX_ROUNDS, LEAST_GAIN))
    linear = _linearised(turning, rotations, weight)
    solution = solve_bordered(linear)
    n_frames, n_rows = len(rotations), 3 - start.n_angles
    ratio = linear.squares / max(n_rows * n_frames - start.n_constants, 1)
    for_means, independent = effective_frames_of_both(solution.residuals)
    limit = float(fdtri(n_rows * independent, max(freedoms * independent, LEAST_FREEDOMS), 1 - limits.doubt))
    unweighted = np.broadcast_to(np.eye(3), rotations.shape)
    wobble = float(np.sqrt(_linearised(turning, rotations, unweighted).squares / n_frames))
    noise = wobble / np.sqrt(ratio) if ratio > 0 else 0.0
    true_wobble = float(np.sqrt(max(wobble**2 - limit * noise**2, 0.0)))
    return TypeFit(
        turning=turning,
        ratio=ratio,
        limit=limit,
        wobble=wobble,
        true_wobble=true_wobble if wobble > ROUNDING_TURN else 0.0,
        hidden=float(noise * np.sqrt(max(limit - 1, 0.0))),
        allowed=_allowed(name, singular),
        axis_covariance=ratio * n_frames / for_means * axis_covariance(turning, solution.covariance),
    )


def _explains(left: TypeFit, limits: KindLimits) -> bool:
    """Whether nothing but noise is left over, or so little that the joint is as good as its kind."""
    return left.ratio <= left.limit or left.true_wobble <= max(limits.wobble_share * left.allowed, limits.least_turn)


def _is_told(left: TypeFit) -> bool:
    """Whether a turn that the kind does not allow would have been seen."""
    if isinstance(left.turning, UniversalRotation) and np.sin(left.turning.between) < np.sin(LEAST_BETWEEN):
        return False
    return left.hidden <= (CLEARLY_LESS * left.allowed if left.turning.n_angles else RIGID_TURN)


def _allowed(name: str, singular: Floats) -> float:
    """Root mean square [rad] of the smallest turn that a kind allows, of those that are there.

    Turns of variance a, b and c about three axes leave singular values 1 - (b + c) / 2, 1 - (a + c) / 2 and
    1 - (a + b) / 2 of the mean rotation.
    """
    lost = 2 * (1 - singular)
    variances = lost.sum() / 2 - lost
    return 0.0 if name == "rigid" else float(np.sqrt(max(variances[0 if name == "hinge" else 1], 0.0)))


def _start(name: str, rotations: Floats) -> ConstrainedRotation:
    if name == "rigid":
        return RigidRotation(nearest_rotation(rotations.mean(axis=0)), len(rotations))
    return nearest_hinge(rotations) if name == "hinge" else nearest_universal(rotations)


def _linearised(turning: ConstrainedRotation, rotations: Floats, weight: Floats) -> LinearisedProblem:
    return LinearisedProblem(*linearised(*_held(turning), *contiguous(rotations, weight)))


def _held(turning: ConstrainedRotation) -> Parts:
    """Parts of a joint as kernels want them."""
    in_parent, in_child, between, angles = turning.parts()
    in_parent, in_child, angles = contiguous(in_parent, in_child, angles)
    return in_parent, in_child, between, angles
