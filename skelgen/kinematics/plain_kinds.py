"""What the kind of a joint is told by, over all frames: the NumPy twin of `compiled_kinds`."""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import vector_from_matrix
from skelgen.kinematics.chain.schur_complement import LinearisedProblem, gain_of_frames, gauss_newton
from skelgen.kinematics.joints.closed_form import best_partners
from skelgen.kinematics.joints.rotations import ConstrainedRotation, Parts, constrained_rotation
from skelgen.model.arrays import Floats


def whitened(covariances: Floats) -> Floats:
    """Return matrices W with W^T W = covariance^-1, shape (n_frames, n, n)."""
    return np.linalg.inv(np.linalg.cholesky(covariances))


def eliminate(
    residuals: Floats, constants: Floats, angles: Floats
) -> tuple[Floats, Floats, Floats, Floats, Floats, Floats, Floats]:
    """Take the frames' own unknowns out of a least squares problem.

    Parameters
    ----------
    residuals, constants, angles : ndarray
        See `arrow.LinearisedProblem`.

    Returns
    -------
    tuple of ndarray
        Inverse normal matrices of the frames' own unknowns, shape (n_frames, n_angles, n_angles); how these follow the
        constants, shape (n_frames, n_angles, n_constants), and what they are without, shape (n_frames, n_angles); the
        constants' slopes and the residuals that they leave, shapes (n_frames, n_rows, n_constants) and
        (n_frames, n_rows); the constants' normal matrix and right-hand side.
    """
    inverse, gain = gain_of_frames(angles)
    follow, alone = gain @ constants, (gain @ residuals[..., np.newaxis])[..., 0]
    reduced = constants - angles @ follow
    left = residuals - (angles @ alone[..., np.newaxis])[..., 0]
    flat = reduced.reshape(-1, reduced.shape[2])
    return inverse, follow, alone, reduced, left, flat.T @ flat, flat.T @ left.ravel()


def linearised(
    in_parent: Floats, in_child: Floats, between: float, angles: Floats, rotations: Floats, weight: Floats
) -> tuple[Floats, Floats, Floats]:
    """Return whitened errors of rotations, and how a joint's rotations follow its constants and angles.

    Parameters
    ----------
    in_parent, in_child, between, angles
        `JointRotation.parts` of a rigid joint, hinge or universal joint.
    rotations : ndarray, shape (n_frames, 3, 3)
        Measured, parent from child.
    weight : ndarray, shape (n_frames, 3, 3)
        Whitening of small turns.

    Returns
    -------
    tuple of ndarray
        Shapes (n_frames, 3), (n_frames, 3, 3 + n_angles) and (n_frames, 3, n_angles).
    """
    turning = constrained_rotation(in_parent, in_child, between, angles)
    constants, own = turning.slopes()
    errors = vector_from_matrix(rotations @ turning.rotations().swapaxes(1, 2))
    return (weight @ errors[..., np.newaxis])[..., 0], weight @ constants, weight @ own


def descended(
    in_parent: Floats,
    in_child: Floats,
    between: float,
    angles: Floats,
    rotations: Floats,
    weight: Floats,
    max_rounds: int,
    least_gain: float,
) -> Parts:
    """Fit a joint to rotations by the steps of `arrow.gauss_newton`.

    Parameters
    ----------
    in_parent, in_child, between, angles, rotations, weight
        See `linearised`; the joint is a first guess.
    max_rounds, least_gain
        See `arrow.gauss_newton`.

    Returns
    -------
    tuple
        `JointRotation.parts` of the joint that comes nearest.
    """

    def here(turning: ConstrainedRotation) -> LinearisedProblem:
        return LinearisedProblem(*linearised(*turning.parts(), rotations, weight))

    def stepped(turning: ConstrainedRotation, constants: Floats, angles: Floats) -> ConstrainedRotation:
        return turning.stepped(constants, angles)

    start = constrained_rotation(in_parent, in_child, between, angles)
    return gauss_newton(start, here, stepped, max_rounds, least_gain).state.parts()


def relative_vectors(first: Floats, second: Floats) -> Floats:
    """Return the rotation vectors [rad] of first^T second, shape (n, 3).

    Parameters
    ----------
    first : ndarray, shape (m, 3, 3)
        Rotations, repeated as often as m goes into n.
    second : ndarray, shape (n, 3, 3)
        Rotations.
    """
    return vector_from_matrix(np.tile(first.swapaxes(1, 2), (len(second) // len(first), 1, 1)) @ second)


def alternated(moments: Floats, mean: Floats, starts: Floats, n_rounds: int) -> tuple[Floats, Floats]:
    """Find two axes whose angle hardly changes, one at a time.

    Parameters
    ----------
    moments, mean
        See `universal.best_partners`.
    starts : ndarray, shape (n, 3)
        First guesses of the axis in the child.
    n_rounds : int
        How often each of the two axes is found.

    Returns
    -------
    tuple of ndarray, shapes (n, 3) and (n,)
        The axes in the child before the last round, and the angles' variances after it.
    """
    before = second = starts
    variances = np.zeros(len(starts))
    for _ in range(n_rounds):
        before = second
        first, _ = best_partners(moments, mean, second)
        second, variances = best_partners(moments.transpose(1, 0, 3, 2), mean.T, first)
    return before, variances
