"""Rotations inside kernels: of small vectors, of poses, and the way from one pose to another."""

from __future__ import annotations

import math

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.small_matrices import (
    Matrix,
    Vector,
    block,
    column,
    cross,
    dot,
    minus,
    plus,
    product,
    times,
    transposed,
    upper_of_product,
)
from skelgen.model.arrays import Floats

SMALL_ANGLE = 1e-8
"""rad; below this the series of sin(x)/x is exact to double precision with its first term."""


@kernel_part
def rotation_by(vector: Vector) -> Matrix:
    """Return the rotation about a vector by 2 arctan(length / 2): of a small vector, by its length."""
    scale = 1.0 / (1.0 + dot(vector, vector) / 4.0)
    x, y, z = vector
    xx, xy, xz, yy, yz, zz = upper_of_product(vector, times(scale / 2.0, vector))
    x, y, z = x * scale, y * scale, z * scale
    return (1.0 - yy - zz, xy - z, xz + y), (xy + z, 1.0 - xx - zz, yz - x), (xz - y, yz + x, 1.0 - xx - yy)


@kernel_part
def proper(matrix: Matrix) -> Matrix:
    """Return a rotation that is proper to rounding, of one that has drifted: a step of Newton for the polar factor."""
    x, y, z = transposed(matrix)
    square = ((dot(x, x), dot(x, y), dot(x, z)), (dot(y, x), dot(y, y), dot(y, z)), (dot(z, x), dot(z, y), dot(z, z)))
    away = product(matrix, square)
    return (
        minus(times(1.5, matrix[0]), times(0.5, away[0])),
        minus(times(1.5, matrix[1]), times(0.5, away[1])),
        minus(times(1.5, matrix[2]), times(0.5, away[2])),
    )


@kernel
def write_pose_error(pose: Floats, found: Floats, error: Floats) -> None:
    """Write the rotation about the world's axes and the shift from one pose to another.

    Parameters
    ----------
    pose, found : ndarray, shape (4, 4), mm
        World from body, before and after.
    error : ndarray, shape (6,)
        Receives a rotation vector [rad], no longer than half a turn, and a shift [mm].
    """
    turn = product(block(found, 0, 0), transposed(block(pose, 0, 0)))
    across = turn[2][1] - turn[1][2], turn[0][2] - turn[2][0], turn[1][0] - turn[0][1]
    sine, cosine = math.sqrt(dot(across, across)), turn[0][0] + turn[1][1] + turn[2][2] - 1.0
    scale = math.atan2(sine, cosine) / sine if sine > 0.0 else 0.5
    error[0], error[1], error[2] = times(scale, across)
    if sine == 0.0 and cosine < 0.0:  # a half turn about an axis that does not matter: it is too far
        error[0] = math.pi
    for axis in range(3):
        error[3 + axis] = found[axis, 3] - pose[axis, 3]


@kernel_part
def turn_axes(frame: Floats, step: Vector) -> None:
    """Turn the first three columns of a frame about the world's axes (Rodrigues).

    Parameters
    ----------
    frame : ndarray, shape (3, 3) or (4, 4)
        World from body, which is turned.
    step : tuple of float, rad
        Rotation vector.
    """
    angle, sine, half = math.sqrt(dot(step, step)), 1.0, 0.5
    if angle > SMALL_ANGLE:
        sine, half = math.sin(angle) / angle, 2.0 * (math.sin(angle / 2.0) / angle) ** 2
    for which in range(3):
        axis = column(frame, which)
        once = cross(step, axis)
        frame[0, which], frame[1, which], frame[2, which] = plus(
            plus(axis, times(sine, once)), times(half, cross(step, once))
        )


@kernel
def move_pose(pose: Floats, step: Floats) -> None:
    """Rotate a pose about the world's axes by the first half of a step, and shift it by the second.

    Parameters
    ----------
    pose : ndarray, shape (4, 4), mm
        World from body, which is moved.
    step : ndarray, shape (6,)
        Rotation vector [rad] and shift [mm].
    """
    turn_axes(pose, (step[0], step[1], step[2]))
    for axis in range(3):
        pose[axis, 3] += step[3 + axis]
