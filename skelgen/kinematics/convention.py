"""One description of each joint: of all frames that mean the same, the stated ones (Gaschler 2011, 5.2.2)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from skelgen.kinematics.placed import Placed
from skelgen.kinematics.turning import AxisTurning, TwoAxisTurning, frame_along
from skelgen.model.arrays import Floats


def conventional(joint: Placed) -> Placed:
    """Return the same joint in the stated frames.

    A hinge's place is the point of its axis that is nearest to both bodies' origins; axes have a sign; x points from
    the body's origin to the axis.
    """
    turning = joint.turning
    if not isinstance(turning, AxisTurning | TwoAxisTurning):
        return joint
    in_parent, in_child = joint.in_parent, joint.in_child
    if isinstance(turning, AxisTurning):
        first, second = turning.axes()
        along = (in_parent @ first + in_child @ second) / 2
        in_parent, in_child = in_parent - along * first, in_child - along * second
    return Placed(_with_frames(_signed(turning), in_parent, in_child), in_parent, in_child)


def _signed(turning: AxisTurning | TwoAxisTurning) -> AxisTurning | TwoAxisTurning:
    """Give axes a sign: the largest component is positive, of a universal joint for both axes on their own.

    Both frames turn by half a turn about x: the rotations stay when the angles change their sign (a hinge), or when the
    angle between the axes becomes its supplement.
    """
    half = np.diag([1.0, -1.0, -1.0])
    parent_flips, child_flips = _is_negative(turning.in_parent[:, 2]), _is_negative(turning.in_child[:, 2])
    if isinstance(turning, AxisTurning):
        if not parent_flips:
            return turning
        return AxisTurning(turning.in_parent @ half, turning.in_child @ half, -turning.angles)
    between, angles = turning.between, turning.angles.copy()
    in_parent, in_child = turning.in_parent, turning.in_child
    if parent_flips:
        in_parent, between, angles[:, 0] = in_parent @ half, np.pi + between, -angles[:, 0]
    if child_flips:
        in_child, between, angles[:, 1] = in_child @ half, between - np.pi, -angles[:, 1]
    return _between_zero_and_pi(TwoAxisTurning(in_parent, in_child, between, angles))


def _between_zero_and_pi(turning: TwoAxisTurning) -> TwoAxisTurning:
    """Rx(-b) = Rz(pi) Rx(b) Rz(-pi): an angle between axes needs no sign."""
    between = float(np.angle(np.exp(1j * turning.between)))
    angles = turning.angles
    if between < 0:
        between, angles = -between, angles + np.array([np.pi, -np.pi])
    return replace(turning, between=between, angles=angles)


def _is_negative(axis: Floats) -> bool:
    return bool(axis[np.argmax(np.abs(axis))] < 0)


def _with_frames(
    turning: AxisTurning | TwoAxisTurning, in_parent: Floats, in_child: Floats
) -> AxisTurning | TwoAxisTurning:
    """Turn the joint's frames about their axes to the convention; the angles take up the difference."""
    parent = conventional_frame(turning.in_parent[:, 2], in_parent)
    child = conventional_frame(turning.in_child[:, 2], in_child)
    before, after = turn_between(turning.in_parent, parent), turn_between(turning.in_child, child)
    if isinstance(turning, AxisTurning):
        return AxisTurning(parent, child, _wrapped(turning.angles - before + after))
    return TwoAxisTurning(parent, child, turning.between, _wrapped(turning.angles + np.array([-before, after])))


def _wrapped(angles: Floats) -> Floats:
    """Angles without jumps of a full turn, their first within half a turn of 0."""
    unwrapped = np.unwrap(angles, axis=0)
    return np.asarray(unwrapped - 2 * np.pi * np.round(unwrapped[0] / (2 * np.pi)))


def conventional_frame(axis: Floats, centre: Floats) -> Floats:
    """Return the frame of an axis in a body: z along it, x from the body's origin to it, shape (3, 3).

    The plane of x and z holds the body's origin (Gaschler 2011, 5.2.2). The source's products (eq. 5.12, 5.13) give a
    left-handed system; here y is the opposite.

    Parameters
    ----------
    axis : ndarray, shape (3,)
        Unit vector.
    centre : ndarray, shape (3,), mm
        A point of the axis, seen from the body; if it lies on the line through the origin, x is any direction.
    """
    y = np.cross(axis, centre)
    size = float(np.linalg.norm(y))
    if size <= np.finfo(np.float64).eps * np.linalg.norm(centre) or size == 0:
        return frame_along(axis)
    y = y / size
    return np.stack([np.cross(y, axis), y, axis], axis=1)


def turn_between(old: Floats, new: Floats) -> float:
    """Return the angle [rad] about their common z that turns one frame of an axis into another."""
    between = old.T @ new
    return float(np.arctan2(between[1, 0], between[0, 0]))
