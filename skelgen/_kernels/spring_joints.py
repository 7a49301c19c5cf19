"""Limbs that joints hold together like stiff springs: normal equations of their poses, steps, and predicted markers.

For each limb the unknowns are a small rotation about the world's axes [rad] and a shift of its origin [mm].
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

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
from skelgen._kernels.tree_equations import N_FREEDOMS, NormalEquations, Tree, clear, invert, solve
from skelgen.model.arrays import Floats, Ints

STEPS = 3
"""Gauss-Newton steps per fit: from the pose predicted by the last frame, three are enough."""


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
    tree : Tree
        Which limbs have a joint in common.
    places : ndarray, shape (n_joints, 6), mm
        Each joint in the frames of the parent and of the child.
    """

    limbs: Ints
    offsets: Floats
    variances: Floats
    tree: Tree
    places: Floats


class Springs(NamedTuple):
    """What holds limbs besides their markers.

    Attributes
    ----------
    prior : ndarray, shape (n_limbs, 6), 1/rad^2 and 1/mm^2
        How firmly each limb stays where it is.
    stiffness : ndarray, shape (n_joints,), 1/rad^2
        How firmly each joint keeps its angle.
    weight : float, 1/mm^2
        How firmly joints keep limbs together.
    """

    prior: Floats
    stiffness: Floats
    weight: float


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
def fit_poses(
    body: SpringBody, springs: Springs, seen: SeenMarkers, poses: LimbPoses, equations: NormalEquations, inverse: Floats
) -> None:
    """Fit poses to the points of markers.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    springs : Springs
        What holds its limbs besides.
    seen : SeenMarkers
        What was measured; the first step is not robust.
    poses : LimbPoses
        Where the skeleton is thought to be; the limbs are moved.
    equations : NormalEquations
        Room to work in.
    inverse : ndarray, shape (n_limbs, 6, 6)
        Receives each limb's block of the inverse normal matrix.
    """
    for step in range(STEPS):
        _begin(equations, springs.prior)
        add_markers(body, poses, seen, np.inf if step == 0 else seen.robust, equations)
        add_joints(body, poses, springs, equations)
        solve(body.tree, equations)
        move_limbs(poses, equations.gradient)
    invert(body.tree, equations, inverse)


@kernel_part
def _begin(equations: NormalEquations, prior: Floats) -> None:
    """Write the equations of limbs that nothing else holds."""
    for limb in range(len(prior)):
        clear(equations.bodies[limb])
        for i in range(N_FREEDOMS):
            equations.gradient[limb, i] = 0.0
            equations.bodies[limb, i, i] = prior[limb, i]
    for joint in range(len(equations.joints)):
        clear(equations.joints[joint])


@kernel
def add_markers(
    body: SpringBody, poses: LimbPoses, seen: SeenMarkers, robust: float, equations: NormalEquations
) -> None:
    """Add what the points of markers say to the normal equations.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    poses : LimbPoses
        Where it is.
    seen : SeenMarkers
        What was measured.
    robust : float
        As in `SeenMarkers`, of which it is not read.
    equations : NormalEquations
        Receive the sums.
    """
    for point in range(len(seen.points)):
        marker = seen.markers[point]
        limb, variance = body.limbs[marker], body.variances[marker]
        arm = turned(block(poses.rotations[limb], 0, 0), vector(body.offsets, marker, 0))
        error = minus(vector(seen.points, point, 0), plus(arm, vector(poses.origins, limb, 0)))
        weight = 1.0 / variance
        weight /= (1.0 + dot(error, error) / (variance * robust**2)) ** 2
        _add_block(equations.bodies[limb], weight, (arm, arm))
        _add_gradient(equations.gradient[limb], weight, (arm, error))


@kernel
def add_joints(body: SpringBody, poses: LimbPoses, springs: Springs, equations: NormalEquations) -> None:
    """Add the springs of the joints to the normal equations.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    poses : LimbPoses
        Where it is.
    springs : Springs
        How firmly joints hold.
    equations : NormalEquations
        Receive the sums.
    """
    weight = springs.weight
    for joint in range(len(body.tree.joints)):
        parent, child = body.tree.joints[joint, 0], body.tree.joints[joint, 1]
        arm = turned(block(poses.rotations[parent], 0, 0), vector(body.places, joint, 0))
        other = turned(block(poses.rotations[child], 0, 0), vector(body.places, joint, 3))
        reached = plus(vector(poses.origins, parent, 0), arm)
        apart = minus(plus(vector(poses.origins, child, 0), other), reached)
        _add_block(equations.bodies[parent], weight, (arm, arm))
        _add_block(equations.bodies[child], weight, (other, other))
        _add_block(equations.joints[joint], -weight, (other, arm))
        for i in range(3):
            equations.bodies[parent, i, i] += springs.stiffness[joint]
            equations.bodies[child, i, i] += springs.stiffness[joint]
            equations.joints[joint, i, i] -= springs.stiffness[joint]
        _add_gradient(equations.gradient[parent], weight, (arm, apart))
        _add_gradient(equations.gradient[child], -weight, (other, apart))


@kernel_part
def _add_block(normal: Floats, weight: float, arms: tuple[Vector, Vector]) -> None:
    """Add the weighted product of the derivatives of two points, [-[a]x 1]^T [-[b]x 1]."""
    a, b = arms
    along = dot(a, b)
    for i in range(3):
        for j in range(3):
            normal[i, j] -= weight * b[i] * a[j]
        normal[i, i] += weight * along
        normal[3 + i, 3 + i] += weight
        j, k = (i + 1) % 3, (i + 2) % 3
        normal[j, 3 + k] -= weight * a[i]
        normal[k, 3 + j] += weight * a[i]
        normal[3 + k, j] -= weight * b[i]
        normal[3 + j, k] += weight * b[i]


@kernel_part
def _add_gradient(gradient: Floats, weight: float, vectors: tuple[Vector, Vector]) -> None:
    """Add the weighted product of a point's derivative with its error."""
    arm, error = vectors
    moment = cross(arm, error)
    for i in range(3):
        gradient[i] += weight * moment[i]
        gradient[3 + i] += weight * error[i]


@kernel
def move_limbs(poses: LimbPoses, change: Floats) -> None:
    """Turn limbs about the world's axes, and shift their origins.

    Parameters
    ----------
    poses : LimbPoses
        Where they are; they are moved.
    change : ndarray, shape (n_limbs, 6)
        Rotation vector [rad] and shift [mm] of each.
    """
    for limb in range(len(poses.origins)):
        turn_axes(poses.rotations[limb], vector(change, limb, 0))
        for axis in range(3):
            poses.origins[limb, axis] += change[limb, 3 + axis]


@kernel
def predict_markers(body: SpringBody, poses: LimbPoses, inverse: Floats, positions: Floats, spread: Floats) -> None:
    """Predict where points of all markers will be seen.

    Parameters
    ----------
    body : SpringBody
        The skeleton.
    poses : LimbPoses
        Where it is.
    inverse : ndarray, shape (n_limbs, 6, 6)
        Of the normal matrix, each limb's block; the upper half is read.
    positions : ndarray, shape (n_markers, 3), mm
        Receives the places.
    spread : ndarray, shape (n_markers, 3, 3), mm^2
        Receives the covariances of measured points about them.
    """
    for marker in range(len(positions)):
        limb = body.limbs[marker]
        arm = turned(block(poses.rotations[limb], 0, 0), vector(body.offsets, marker, 0))
        turn, across = whole(upper_half(block(inverse[limb], 0, 0))), block(inverse[limb], 0, 3)
        shift = whole(upper_half(block(inverse[limb], 3, 3)))
        columns = transposed(cross_matrix(arm))
        mixed = product(columns, across)
        turning = product(product(columns, turn), transposed(columns))
        for i in range(3):
            positions[marker, i] = arm[i] + poses.origins[limb, i]
            for j in range(3):
                spread[marker, i, j] = turning[i][j] + mixed[i][j] + mixed[j][i] + shift[i][j]
            spread[marker, i, i] += body.variances[marker]
