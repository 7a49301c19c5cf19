r"""The type of a joint: the simplest that explains the rotations between its two limbs.

Rigid, hinge and universal joints are fitted to the relative rotations by maximum likelihood. The variance of what is
left over, in units of the noise of markers or poses, is 1 for the true type and grows with every rotation that the type
does not allow. The likelihood ratio of "only noise" against "a rotation of unknown size" is a function of that ratio
alone. Both variances are estimates, so its limit is that of Fisher's F, with as many freedoms as there are independent
frames: soft tissue makes errors that last. A joint is undetermined if its noise could hide the rotations that would
make it another type.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from skelgen._kernels import contiguous
from skelgen._kernels.joint_models import linearised
from skelgen.kinematics.chain.schur_complement import LinearisedProblem, effective_frames_of_both, gauss_newton
from skelgen.kinematics.joints.closed_form import nearest_constrained
from skelgen.kinematics.joints.relative_poses import whitener
from skelgen.kinematics.joints.rotations import ConstrainedRotation, axis_covariance
from skelgen.model.arrays import Floats

AXIS_WAY = 10.0
"""mm; a hinge is free along its axis if a shift of this length disturbs the markers by less than their noise."""

ROUNDING_TURN = 1e-6
"""rad; rotations in double precision wobble by the square root of their rounding."""

ROUNDING = 1e-9
"""rad; noise of rotations that are exact in double precision."""

CLEARLY_LESS = 0.5
"""A type is determined if the noise cannot hide a rotation of this part of those that it allows."""

RIGID_TURN = np.deg2rad(2.0)
"""rad; a joint is called rigid if noise cannot hide a rotation of this size, which is less than any joint moves."""

MAX_ROUNDS = 8
"""Rounds of each type's fit: the right type needs three to five, and a wrong one is wrong by far."""

LEAST_GAIN = 1e-4
"""Part of the sum of squares that a round must gain for there to be another: types differ by far more."""

LEAST_FREEDOMS = 3.0
"""Freedoms of the noise's estimate that are counted at least: one limb with three markers in one frame."""

LEAST_BETWEEN = np.deg2rad(30.0)
"""rad; axes of universal joints are farther apart. Nearer ones together explain any small rotation."""

DETERMINED_TYPES = ("rigid", "hinge", "universal", "ball")
"""From the simplest to the one that allows all rotations."""


@dataclass(frozen=True, eq=False)
class TypeFit:
    """How well one type of joint explains the rotations.

    Attributes
    ----------
    rotation : ConstrainedRotation
        The rotations that the type allows, fitted.
    ratio : float
        Variance of the residuals, in units of that of the noise: 1 for the true type.
    limit : float
        Ratio that noise alone exceeds with the probability of `TypeLimits.doubt`.
    wobble : float, rad
        Root mean square rotation that is left over, noise included.
    true_wobble : float, rad
        The same without what noise explains.
    hidden : float, rad
        Root mean square rotation that the noise could hide.
    allowed : float, rad
        Root mean square of the smallest rotation that the type allows; 0 for a rigid joint.
    axis_covariance : ndarray, shape (6, 6)
        Of the axis in the parent, then of that in the child, unit vectors; 0 for a rigid joint.
    """

    rotation: ConstrainedRotation
    ratio: float
    limit: float
    wobble: float
    true_wobble: float
    hidden: float
    allowed: float
    axis_covariance: Floats


@dataclass(frozen=True, eq=False)
class JointType:
    """The type of a joint.

    Attributes
    ----------
    kind : str
        ``rigid``, ``hinge``, ``universal``, ``ball``, or ``undetermined`` where the limbs rotate too little.
    axis_in_parent, axis_in_child : ndarray, shape (3,)
        Unit axis of a hinge in both limbs. Of a universal joint: the axis fixed in the parent, and that fixed in the
        child. Of other types: the direction that moves least.
    main_turn : float, rad
        Root mean square rotation about the axis with most.
    true_wobble : float, rad
        Root mean square rotation besides those that the type allows, without what noise explains.
    singular_values : ndarray, shape (3,)
        Of the mean relative rotation, falling: 1 for directions that never move.
    type_fits : mapping of str to TypeFit
        Fits of the types that were tried, the simplest first.
    axis_covariance : ndarray, shape (6, 6)
        Of the axis in the parent, then of that in the child; 0 for types without axes.
    """

    kind: str
    axis_in_parent: Floats
    axis_in_child: Floats
    main_turn: float
    true_wobble: float
    singular_values: Floats
    type_fits: dict[str, TypeFit]
    axis_covariance: Floats

    def with_frames(self, parent: Floats, child: Floats) -> JointType:
        """Return the type for limbs whose frames were rotated.

        Parameters
        ----------
        parent, child : ndarray, shape (3, 3)
            New frame from old frame of both limbs.
        """
        turn = np.zeros((6, 6))
        turn[:3, :3], turn[3:, 3:] = parent, child
        first, second = parent @ self.axis_in_parent, child @ self.axis_in_child
        covariance = turn @ self.axis_covariance @ turn.T
        return replace(self, axis_in_parent=first, axis_in_child=second, axis_covariance=covariance)

    def freedom_along_axis(self, noise: float) -> float:
        """Return how free the joint is along its axis: 1 for a perfect hinge, 0 where its wobble fixes it.

        A shift of the joint along its axis tears its limbs apart by the wobble times the shift. That is ignored while
        it stays within the noise of a single marker: many frames average the noise, but not the errors of a real hinge.

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
class TypeLimits:
    """Limits between the types of joints.

    Attributes
    ----------
    doubt : float
        Probability with which noise alone makes a joint seem to have more degrees of freedom than it has.
    wobble_share : float
        Largest wobble of a hinge or universal joint, noise apart, as a part of the smallest rotation that it allows.
    least_turn : float, rad
        Smaller rotations count as none, however exact the take.
    """

    doubt: float = 0.001
    wobble_share: float = 0.12
    least_turn: float = 1e-4


def find_joint_type(
    rotations: Floats, covariances: Floats, freedoms: float, limits: TypeLimits | None = None, wanted: str | None = None
) -> JointType:
    """Classify a joint.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames, 3, 3)
        Rotations parent from child, in the order of time.
    covariances : ndarray, shape (n_frames, 3, 3), rad^2
        Of small rotations of each, in the parent's axes.
    freedoms : float
        Freedoms per frame from which the scale of the covariances was estimated.
    limits : TypeLimits, optional
        Limits between the types.
    wanted : str, optional
        A type that the user states: it is fitted and returned without question.
    """
    limits = limits or TypeLimits()
    u, singular, vt = np.linalg.svd(rotations.mean(axis=0))
    weight = whitener(covariances + ROUNDING**2 * np.eye(3))
    kind, type_fits = "ball", dict[str, TypeFit]()
    for name in DETERMINED_TYPES[:-1] if wanted is None else (wanted,):
        if name == "ball":
            break
        left = type_fits[name] = _type_fit(name, rotations, weight, singular, freedoms, limits)
        # Only noise is left over, or so little that it makes no difference.
        tolerated = max(limits.wobble_share * left.allowed, limits.least_turn)
        if wanted is not None or left.ratio <= left.limit or left.true_wobble <= tolerated:
            kind = name if wanted is not None or _is_determined(left) else "undetermined"
            break
    axes = (type_fits[kind].rotation.axes() if kind in type_fits else None) or (u[:, 0], vt[0])
    last = next(reversed(type_fits.values()), None)
    main_turn = float(np.sqrt(max(2 * (1 - singular[1]), 0.0)))
    true_wobble = last.true_wobble if last is not None and kind != "ball" else 0.0
    covariance = type_fits[kind].axis_covariance if kind in type_fits else np.zeros((6, 6))
    return JointType(kind, axes[0], axes[1], main_turn, true_wobble, singular, type_fits, covariance)


def _type_fit(
    name: str, rotations: Floats, weight: Floats, singular: Floats, freedoms: float, limits: TypeLimits
) -> TypeFit:
    """Fit one type, and compare its residuals with the noise."""
    start = nearest_constrained(name, rotations)
    rotations, weight = contiguous(rotations, weight)
    found = gauss_newton(
        start, lambda joint: _linearised(joint, rotations, weight), ConstrainedRotation.stepped, MAX_ROUNDS, LEAST_GAIN
    )
    rotation, solution = found.state, found.solution
    n_frames, n_rows = len(rotations), 3 - start.n_angles
    ratio = found.squares / max(n_rows * n_frames - start.n_constants, 1)
    for_means, independent = effective_frames_of_both(solution.residuals)
    from scipy.special import fdtri  # noqa: PLC0415 - a fifth of a second, which the window's start need not wait for

    limit = float(fdtri(n_rows * independent, max(freedoms * independent, LEAST_FREEDOMS), 1 - limits.doubt))
    unweighted = np.broadcast_to(np.eye(3), rotations.shape)
    wobble = float(np.sqrt(_linearised(rotation, rotations, unweighted).squares / n_frames))
    noise = wobble / np.sqrt(ratio) if ratio > 0 else 0.0
    torn = float(np.sqrt(max(wobble**2 - limit * noise**2, 0.0)))
    true_wobble, hidden = torn if wobble > ROUNDING_TURN else 0.0, float(noise * np.sqrt(max(limit - 1, 0.0)))
    # The smallest rotation that the type allows, of those that are there: variances a, b, c about three axes give the
    # singular values 1 - (b + c) / 2, 1 - (a + c) / 2 and 1 - (a + b) / 2 of the mean rotation.
    lost = 2 * (1 - singular)
    variances = lost.sum() / 2 - lost
    allowed = 0.0 if name == "rigid" else float(np.sqrt(max(variances[0 if name == "hinge" else 1], 0.0)))
    covariance = ratio * n_frames / for_means * axis_covariance(rotation, solution.covariance)
    return TypeFit(rotation, ratio, limit, wobble, true_wobble, hidden, allowed, covariance)


def _is_determined(left: TypeFit) -> bool:
    """Whether a rotation that the type does not allow would have been seen."""
    if left.rotation.kind == "universal" and np.sin(left.rotation.between) < np.sin(LEAST_BETWEEN):
        return False
    return left.hidden <= (CLEARLY_LESS * left.allowed if left.rotation.n_angles else RIGID_TURN)


def _linearised(rotation: ConstrainedRotation, rotations: Floats, weight: Floats) -> LinearisedProblem:
    in_parent, in_child, angles = contiguous(rotation.in_parent, rotation.in_child, rotation.angles)
    parts = in_parent, in_child, rotation.between, angles
    return LinearisedProblem(*linearised(parts, *contiguous(rotations, weight)))
