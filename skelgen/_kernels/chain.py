"""Forward kinematics of a chain: where its limbs and markers are, frame by frame, and the residuals of the markers."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import fixed, kernel, kernel_part
from skelgen._kernels.small_matrices import Vector, dot, matrix, minus, plus, set_vector, turned, vector
from skelgen.model.arrays import Floats, Ints

PARENT, FREEDOMS, START = fixed(0, 1, 2)
"""Columns of `ChainTable.limbs`."""

IN_PARENT, IN_CHILD, JOINT = fixed(0, 3, 6)
"""Where the vectors in `ChainTable.joints` begin."""

ROTATION, ORIGIN, LINK, STEP_TURN, STEP_SHIFT, SPIN, N_PLACE = fixed(0, 9, 12, 15, 18, 21, 30)
"""Where the parts of a limb's place begin, and its length."""

ARM, ERROR, WEIGHT, N_ARM = fixed(0, 3, 6, 7)
"""The same of a marker's."""

ROOT, FREE = fixed(0, 3)
"""The root's limb, and the freedoms of a turn that nothing restricts."""


class ChainTable(NamedTuple):
    """A chain with what its joints allow; markers are sorted by limb.

    Attributes
    ----------
    limbs : ndarray of intp, shape (n_limbs + 1, 3)
        Parent of each limb, how many turns its joint allows, and where its markers begin; the last row ends them.
    joints : ndarray, shape (n_limbs, 9)
        Axes in parent and child, of `Articulation`, and the joint in the parent [mm], of `Chain`.
    markers : ndarray of intp, shape (n_markers,)
        Markers in the order of their limbs.
    offsets : ndarray, shape (n_markers, 3), mm
        Of the markers in this order, in their limbs.
    """

    limbs: Ints
    joints: Floats
    markers: Ints
    offsets: Floats


class Place(NamedTuple):
    """Where a chain is in one frame.

    Attributes
    ----------
    limbs : ndarray, shape (n_limbs, 30)
        World from limb by its rows, origin in the world [mm], and the way to it from the parent's [mm]; the step to
        there: turn [rad], shift [mm], and the turn as a rotation.
    markers : ndarray, shape (n_markers, 7), mm
        Each limb's markers from its origin, the residuals of the measured ones, and their weights.
    """

    limbs: Floats
    markers: Floats


@kernel
def origins_of(parents: Ints, joints: Floats, root: Floats, rotations: Floats) -> Floats:
    """Return the world positions of the limbs' origins [mm], shape (n_frames, n_limbs, 3).

    Parameters
    ----------
    parents, joints
        See `chain.Chain`.
    root, rotations
        See `chain.ChainPoses`.
    """
    n_frames, n_limbs = rotations.shape[:2]
    out = np.empty((n_frames, n_limbs, 3))
    for frame in range(n_frames):
        for limb in range(n_limbs):
            parent = parents[limb]
            for i in range(3):
                if limb == 0:
                    out[frame, limb, i] = root[frame, i]
                else:
                    turn = rotations[frame, parent, i]
                    way = turn[0] * joints[limb, 0] + turn[1] * joints[limb, 1] + turn[2] * joints[limb, 2]
                    out[frame, limb, i] = out[frame, parent, i] + way
    return out


@kernel
def markers_of(origins: Floats, rotations: Floats, limbs: Ints, offsets: Floats) -> Floats:
    """Return the world positions of markers [mm], shape (n_frames, n_markers, 3).

    Parameters
    ----------
    origins : ndarray, shape (n_frames, n_limbs, 3), mm
        Of the limbs.
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        World from limb.
    limbs : ndarray of intp, shape (n_markers,)
        Limb of each marker.
    offsets : ndarray, shape (n_markers, 3), mm
        Markers in the frames of their limbs.
    """
    out = np.empty((len(rotations), len(limbs), 3))
    for frame in range(len(rotations)):
        for marker in range(len(limbs)):
            limb = limbs[marker]
            for i in range(3):
                turn = rotations[frame, limb, i]
                way = turn[0] * offsets[marker, 0] + turn[1] * offsets[marker, 1] + turn[2] * offsets[marker, 2]
                out[frame, marker, i] = origins[frame, limb, i] + way
    return out


@kernel
def errors_of(positions: Floats, markers: Floats) -> Floats:
    """Return measured minus predicted positions [mm], zero where unseen, shape (n_frames, n_markers, 3).

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured; NaN where unseen.
    markers : ndarray, shape (n_frames, n_markers, 3), mm
        Predicted.
    """
    out = np.zeros(positions.shape)
    for frame in range(len(positions)):
        for marker in range(positions.shape[1]):
            for i in range(3):
                error = positions[frame, marker, i] - markers[frame, marker, i]
                if not math.isnan(error):
                    out[frame, marker, i] = error
    return out


@kernel
def turned_back(rotations: Floats, limbs: Ints, vectors: Floats) -> Floats:
    """Return vectors of the world in the frames of limbs.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        World from limb.
    limbs : ndarray of intp, shape (n_vectors,)
        Limb of each.
    vectors : ndarray, shape (n_frames, n_vectors, 3)
        The vectors.
    """
    out = np.empty(vectors.shape)
    for frame in range(len(vectors)):
        for marker in range(len(limbs)):
            turn, vector = rotations[frame, limbs[marker]], vectors[frame, marker]
            for i in range(3):
                out[frame, marker, i] = turn[0, i] * vector[0] + turn[1, i] * vector[1] + turn[2, i] * vector[2]
    return out


@kernel
def variances_across(covariances: Floats, rotations: Floats, parents: Ints, shared: Floats, axes: Floats) -> Floats:
    """Return variances of places along the world's axes, shape (n_frames, n_limbs, 3).

    Parameters
    ----------
    covariances : ndarray, shape (n_frames, n_limbs, 3, 3)
        Of the places in the world.
    rotations : ndarray, shape (n_frames, n_limbs, 3, 3)
        World from limb.
    parents : ndarray of intp, shape (n_limbs,)
        Parents, -1 for the root.
    shared : ndarray, shape (n_limbs, 3, 3)
        What is added to the covariance in every frame, in the axes of the parent.
    axes : ndarray, shape (n_frames, n_limbs, 3)
        Unit axes in the world along which nothing counts; 0 where all does.
    """
    out, total, turned = np.empty(covariances.shape[:3]), np.empty((3, 3)), np.empty(3)
    for frame in range(len(covariances)):
        for limb in range(len(parents)):
            turn = rotations[frame, max(parents[limb], 0)]
            for i in range(3):
                for k in range(3):
                    turned[k] = 0.0
                    for j in range(3):
                        turned[k] += turn[i, j] * shared[limb, j, k]
                for k in range(3):
                    total[i, k] = covariances[frame, limb, i, k]
                    for j in range(3):
                        total[i, k] += turned[j] * turn[k, j]
            axis = axes[frame, limb]
            along = 0.0
            for i in range(3):
                turned[i] = total[i, 0] * axis[0] + total[i, 1] * axis[1] + total[i, 2] * axis[2]
                along += axis[i] * turned[i]
            for i in range(3):
                out[frame, limb, i] = total[i, i] + axis[i] * (along * axis[i] - 2.0 * turned[i])
    return out


@kernel_part
def copy_rotations(rotations: Floats, first: int, limbs: Floats) -> None:
    """Copy the rotations of a frame, of which the first is in a given row.

    Parameters
    ----------
    rotations : ndarray, shape (n_frames * n_limbs, 9)
        World from limb by its rows, frame by frame.
    first : int
        Row of the frame's first limb.
    limbs : ndarray, shape (n_limbs, 30)
        Receives them; see `Place.limbs`.
    """
    for limb in range(len(limbs)):
        for column in range(9):
            limbs[limb, column] = rotations[first + limb, column]


@kernel_part
def forward_kinematics(table: ChainTable, positions: Floats, weights: Floats, first: int, place: Place) -> float:
    """Place limbs and markers by the root's origin and rotations; return the weighted sum of squares.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    positions : ndarray, shape (n_frames * n_markers, 3), mm
        Measured markers; any number where the weight is 0.
    weights : ndarray, shape (n_frames * n_markers,)
        Of the squared distances.
    first : int
        Row of the frame's first marker.
    place : Place
        Holds the root's origin and the rotations, receives the rest.
    """
    squares = 0.0
    for limb in range(len(table.joints)):
        rotation, origin = matrix(place.limbs, limb, ROTATION), vector(place.limbs, limb, ORIGIN)
        if limb > 0:
            parent = table.limbs[limb, PARENT]
            link = turned(matrix(place.limbs, parent, ROTATION), vector(table.joints, limb, JOINT))
            origin = plus(vector(place.limbs, parent, ORIGIN), link)
            set_vector(place.limbs, limb, LINK, link)
            set_vector(place.limbs, limb, ORIGIN, origin)
        for own in range(table.limbs[limb, START], table.limbs[limb + 1, START]):
            row = first + table.markers[own]
            place.markers[own, WEIGHT] = weights[row]
            if weights[row] > 0.0:
                arm = turned(rotation, vector(table.offsets, own, ROOT))
                error = minus(minus(vector(positions, row, ROOT), arm), origin)
                set_vector(place.markers, own, ARM, arm)
                set_vector(place.markers, own, ERROR, error)
                squares += weights[row] * dot(error, error)
    return squares


@kernel_part
def world_axis(table: ChainTable, place: Place, limb: int, axis: int) -> Vector:
    """Return an axis of a limb's joint in the world, the first fixed in the parent, a second in the limb.

    Parameters
    ----------
    table : ChainTable
        The limbs, and what their joints allow.
    place : Place
        Where the chain is.
    limb : int
        The limb.
    axis : int
        Which of its axes: 0 or 1.
    """
    if axis == 0:
        return turned(matrix(place.limbs, table.limbs[limb, PARENT], ROTATION), vector(table.joints, limb, IN_PARENT))
    return turned(matrix(place.limbs, limb, ROTATION), vector(table.joints, limb, IN_CHILD))
