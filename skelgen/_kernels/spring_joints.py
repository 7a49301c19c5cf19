"""Limbs that joints hold together like stiff springs: normal equations of their poses, steps, and predicted markers.

For each limb the unknowns are a small rotation about the world's axes [rad] and a shift of its origin [mm].
"""

from __future__ import annotations

from typing import NamedTuple

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.rotations import turn_axes
from skelgen._kernels.small_matrices import (
    Vector,
    block,
    cross,
    cross_matrix,
    dot,
    minus,
    plus,
    product,
    transposed,
    turned,
    upper_half,
    vector,
    whole,
)
from skelgen.model.arrays import Floats, Ints

N_FREEDOMS = 6


class SpringBody(NamedTuple):
    """A skeleton with its markers.

    Attributes
    ----------
    limbs : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    offsets : ndarray, shape (n_markers, 3), mm
        Markers in the frames of their limbs.
    variances : ndarray, shape (n_markers,), mm^2
        Of each marker, per coordinate.
    joints : ndarray of intp, shape (n_joints, 2)
        Parent and child of each joint.
    places : ndarray, shape (n_joints, 6), mm
        The joint in the frames of the parent and of the child.
    """

    limbs: Ints
    offsets: Floats
    variances: Floats
    joints: Ints
    places: Floats


class LimbPoses(NamedTuple):
    """Where limbs are.

    Attributes
    ----------
    rotations : ndarray, shape (n_limbs, 3, 3)
        World from limb.
    origins : ndarray, shape (n_limbs, 3), mm
        World.
    """

    rotations: Floats
    origins: Floats


class SeenMarkers(NamedTuple):
    """Points whose markers are known.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        The points.
    markers : ndarray of intp, shape (n,)
        Marker of each.
    robust : float
        A point that deviates by so many standard deviations has lost three quarters of its weight.
    """

    points: Floats
    markers: Ints
    robust: float


@kernel
def add_markers(body: SpringBody, poses: LimbPoses, seen: SeenMarkers, normal: Floats, gradient: Floats) -> None:
    """Add what the points of markers say to the normal equations.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    poses : LimbPoses
        Where it is.
    seen : SeenMarkers
        What was measured.
    normal, gradient : ndarray, shapes (6 n_limbs, 6 n_limbs) and (6 n_limbs,)
        Receive the sums; of the matrix the upper half and the diagonal blocks.
    """
    for point in range(len(seen.points)):
        marker = seen.markers[point]
        limb, variance = body.limbs[marker], body.variances[marker]
        arm = turned(block(poses.rotations[limb], 0, 0), vector(body.offsets, marker, 0))
        error = minus(vector(seen.points, point, 0), plus(arm, vector(poses.origins, limb, 0)))
        weight = 1.0 / variance
        weight /= (1.0 + dot(error, error) / (variance * seen.robust**2)) ** 2
        first = N_FREEDOMS * limb
        _add_block(normal, first, first, weight, (arm, arm))
        _add_gradient(gradient, first, weight, (arm, error))


@kernel
def add_joints(
    body: SpringBody, poses: LimbPoses, stiffness: Floats, weight: float, normal: Floats, gradient: Floats
) -> None:
    """Add the springs of the joints to the normal equations.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    poses : LimbPoses
        Where it is.
    stiffness : ndarray, shape (n_joints,), 1/rad^2
        How firmly each joint keeps its angle.
    weight : float, 1/mm^2
        How firmly joints keep limbs together.
    normal, gradient : ndarray, shapes (6 n_limbs, 6 n_limbs) and (6 n_limbs,)
        Receive the sums; of the matrix the upper half and the diagonal blocks.
    """
    for joint in range(len(body.joints)):
        parent, child = body.joints[joint, 0], body.joints[joint, 1]
        arm = turned(block(poses.rotations[parent], 0, 0), vector(body.places, joint, 0))
        other = turned(block(poses.rotations[child], 0, 0), vector(body.places, joint, 3))
        reached = plus(vector(poses.origins, parent, 0), arm)
        apart = minus(plus(vector(poses.origins, child, 0), other), reached)
        first, second = N_FREEDOMS * parent, N_FREEDOMS * child
        _add_block(normal, first, first, weight, (arm, arm))
        _add_block(normal, second, second, weight, (other, other))
        if parent < child:
            _add_block(normal, first, second, -weight, (arm, other))
        else:
            _add_block(normal, second, first, -weight, (other, arm))
        for i in range(3):
            normal[first + i, first + i] += stiffness[joint]
            normal[second + i, second + i] += stiffness[joint]
            normal[min(first, second) + i, max(first, second) + i] -= stiffness[joint]
        _add_gradient(gradient, first, weight, (arm, apart))
        _add_gradient(gradient, second, -weight, (other, apart))


@kernel_part
def _add_block(normal: Floats, row: int, column: int, weight: float, arms: tuple[Vector, Vector]) -> None:
    """Add the weighted product of the derivatives of two points, [-[a]x 1]^T [-[b]x 1]."""
    a, b = arms
    along = dot(a, b)
    for i in range(3):
        for j in range(3):
            normal[row + i, column + j] -= weight * b[i] * a[j]
        normal[row + i, column + i] += weight * along
        normal[row + 3 + i, column + 3 + i] += weight
        j, k = (i + 1) % 3, (i + 2) % 3
        normal[row + j, column + 3 + k] -= weight * a[i]
        normal[row + k, column + 3 + j] += weight * a[i]
        normal[row + 3 + k, column + j] -= weight * b[i]
        normal[row + 3 + j, column + k] += weight * b[i]


@kernel_part
def _add_gradient(gradient: Floats, first: int, weight: float, vectors: tuple[Vector, Vector]) -> None:
    """Add the weighted product of a point's derivative with its error."""
    arm, error = vectors
    moment = cross(arm, error)
    for i in range(3):
        gradient[first + i] += weight * moment[i]
        gradient[first + 3 + i] += weight * error[i]


@kernel
def move_limbs(poses: LimbPoses, change: Floats) -> None:
    """Turn limbs about the world's axes, and shift their origins.

    Parameters
    ----------
    poses : LimbPoses
        Where they are; they are moved.
    change : ndarray, shape (6 n_limbs,)
        Rotation vector [rad] and shift [mm] of each.
    """
    for limb in range(len(poses.origins)):
        first = N_FREEDOMS * limb
        turn_axes(poses.rotations[limb], (change[first], change[first + 1], change[first + 2]))
        for axis in range(3):
            poses.origins[limb, axis] += change[first + 3 + axis]


@kernel
def predict_markers(body: SpringBody, poses: LimbPoses, inverse: Floats, positions: Floats, spread: Floats) -> None:
    """Predict where points of all markers will be seen.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    poses : LimbPoses
        Where it is.
    inverse : ndarray, shape (6 n_limbs, 6 n_limbs)
        Of the normal matrix; the upper half is read.
    positions : ndarray, shape (n_markers, 3), mm
        Receives the places.
    spread : ndarray, shape (n_markers, 3, 3), mm^2
        Receives the covariances of measured points about them.
    """
    for marker in range(len(positions)):
        limb = body.limbs[marker]
        arm = turned(block(poses.rotations[limb], 0, 0), vector(body.offsets, marker, 0))
        first = N_FREEDOMS * limb
        turn, across = whole(upper_half(block(inverse, first, first))), block(inverse, first, first + 3)
        shift = whole(upper_half(block(inverse, first + 3, first + 3)))
        columns = transposed(cross_matrix(arm))
        mixed = product(columns, across)
        turning = product(product(columns, turn), transposed(columns))
        for i in range(3):
            positions[marker, i] = arm[i] + poses.origins[limb, i]
            for j in range(3):
                spread[marker, i, j] = turning[i][j] + mixed[i][j] + mixed[j][i] + shift[i][j]
            spread[marker, i, i] += body.variances[marker]
