r"""Angles of joints by their types, with standard deviations.

A hinge has the angle about its axis, a universal joint that about the axis in the parent and then that about the axis
in the child, a ball the rotation vector of the child against the parent (Rodrigues), in the parent's axes. All are 0 in
the reference pose.

Small rotations :math:`\omega` of the child in the parent's axes move a rotation vector v by :math:`J^{-1} \omega` with

.. math::
    J^{-1} = I - \tfrac12 [v]_\times + \left( 1 - \tfrac{|v|}2 \cot \tfrac{|v|}2 \right) \frac{[v]_\times^2}{|v|^2} .
"""

import numpy as np

from skelgen.geometry.rotations import cross_matrix, matrix_from_vector, vector_from_matrix
from skelgen.model import Joint, Motion
from skelgen.model.arrays import Floats

_SMALL = 1e-4  # rad; below, the series is exact in double precision


def angle_names(joint: Joint) -> tuple[str, ...]:
    """Return a short name for each of a joint's angles, in their order.

    Examples
    --------
    >>> angle_names(Joint(0, 1, [0, 0, 0], [0, 0, 0], "hinge", [0, 0, 1], [1, 1, 1]))
    ('turn',)
    """
    if joint.kind == "rigid":
        return ()
    if joint.kind == "hinge" and joint.axis is not None:
        return ("turn",)
    if joint.kind == "universal" and joint.axis is not None and joint.second_axis is not None:
        return ("first", "second")
    return ("x", "y", "z")


def joint_angles(joint: Joint, relative: Floats) -> Floats:
    """Return a joint's angles [rad], shape (n_frames, n_angles).

    Parameters
    ----------
    joint : Joint
        Its type and axes.
    relative : ndarray, shape (n_frames, 3, 3)
        Rotations child against parent.
    """
    if joint.kind == "rigid":
        return np.zeros((len(relative), 0))
    if joint.kind == "hinge" and joint.axis is not None:
        return _about(joint.axis, relative)[:, np.newaxis]
    if joint.kind == "universal" and joint.axis is not None and joint.second_axis is not None:
        first, second = joint.axis, joint.second_axis
        start, end = np.cross(first, second), np.cross(first, relative @ second)
        swing = np.arctan2(np.cross(start, end) @ first, end @ start)
        rest = matrix_from_vector(-swing[:, np.newaxis] * first) @ relative
        return np.stack([swing, _about(second, rest)], axis=1)
    return vector_from_matrix(relative)


def continued(joint: Joint, angles: Floats, before: Floats | None = None) -> Floats:
    """Return angles about axes without jumps of a full turn, as those of wheels have them; others as they are.

    Parameters
    ----------
    joint : Joint
        Its type and axes.
    angles : ndarray, shape (n_frames, n_angles), rad
        From `joint_angles`, in the order of time.
    before : ndarray, shape (n_angles,), rad, optional
        What this returned for the frame before.
    """
    if joint.axis is None or not len(angles):
        return angles
    return np.unwrap(np.concatenate([angles[:1] if before is None else before[np.newaxis], angles]), axis=0)[1:]


def angles_over_time(joint: Joint, motion: Motion) -> Floats:
    """Return a joint's angles [rad] in all frames, those about axes without jumps of a full turn, (n_frames, n_angles).

    Parameters
    ----------
    joint : Joint
        Of the skeleton that moves.
    motion : Motion
        Its motion.
    """
    relative = motion.rotations[:, joint.parent].swapaxes(1, 2) @ motion.rotations[:, joint.child]
    return continued(joint, joint_angles(joint, relative))


def turns_that_are_seen(joint: Joint, motion: Motion) -> Floats:
    """Return angles over time, without the full turns of frames that hide a limb: its pose there may go round.

    Parameters
    ----------
    joint, motion
        As for `angles_over_time`.
    """
    angles, turn = angles_over_time(joint, motion), 2 * np.pi
    shown = np.flatnonzero(motion.limb_seen[:, [joint.parent, joint.child]].all(axis=1))
    if not len(shown):
        return angles
    seen = continued(joint, angles[shown] - turn * np.round(angles[shown] / turn))
    last_seen = np.maximum(np.searchsorted(shown, np.arange(motion.n_frames), side="right") - 1, 0)
    return np.asarray(angles + (seen - angles[shown])[last_seen])


def angle_deviations(joint: Joint, relative: Floats, covariance: Floats) -> Floats:
    """Return the standard deviations of a joint's angles [rad], shape (n_frames, n_angles).

    Parameters
    ----------
    joint, relative
        As for `joint_angles`.
    covariance : ndarray, shape (n_frames, 3, 3), rad^2
        Of small rotations of the child in the parent's axes.
    """
    if joint.kind == "rigid":
        return np.zeros((len(relative), 0))
    slopes = _slopes(joint, relative)
    return np.asarray(np.sqrt(np.maximum(np.einsum("fai,fij,faj->fa", slopes, covariance, slopes), 0.0)))


def rotation_vector_deviations(rotations: Floats, covariance: Floats) -> Floats:
    """Return the standard deviations of rotation vectors [rad], shape (n, 3).

    Parameters
    ----------
    rotations : ndarray, shape (n, 3, 3)
        The rotations.
    covariance : ndarray, shape (n, 3, 3), rad^2
        Of small rotations that follow them, about the axes of the frame that they lead to.
    """
    origin = np.zeros(3)
    return angle_deviations(Joint(0, 1, origin, origin, "ball", None, origin), rotations, covariance)


def _slopes(joint: Joint, relative: Floats) -> Floats:
    """Derivatives of the angles by small rotations in the parent's axes, shape (n_frames, n_angles, 3)."""
    if joint.kind == "hinge" and joint.axis is not None:
        return np.broadcast_to(joint.axis, (len(relative), 1, 3))
    if joint.kind == "universal" and joint.axis is not None and joint.second_axis is not None:
        first = np.broadcast_to(joint.axis, (len(relative), 3))
        return np.asarray(np.linalg.pinv(np.stack([first, relative @ joint.second_axis], axis=2)))
    vector = vector_from_matrix(relative)
    size = np.linalg.norm(vector, axis=1)
    near = size < _SMALL
    half = np.where(near, 1.0, size) / 2
    bend = np.where(near, 1 / 12, (1 - half / np.tan(half)) / (4 * half**2))
    cross = cross_matrix(vector)
    return np.asarray(np.eye(3) - cross / 2 + bend[:, np.newaxis, np.newaxis] * (cross @ cross))


def _about(axis: Floats, relative: Floats) -> Floats:
    """Angle of the nearest rotation about an axis."""
    sine = np.stack([relative[:, 2, 1] - relative[:, 1, 2], relative[:, 0, 2] - relative[:, 2, 0]], axis=1)
    sine = np.concatenate([sine, (relative[:, 1, 0] - relative[:, 0, 1])[:, np.newaxis]], axis=1)
    along = np.einsum("i,fij,j->f", axis, relative, axis)
    return np.asarray(np.arctan2(sine @ axis, np.einsum("fii->f", relative) - along))
