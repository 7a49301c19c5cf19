"""Forward kinematics of a chain: where its limbs and markers are, frame by frame, and the residuals of the markers."""

from __future__ import annotations

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


Measured = tuple[Floats, Floats]
"""Markers [mm] frame by frame, shape (n_frames * n_markers, 3), any number where the weight is 0; weights of the
squared distances, shape (n_frames * n_markers,)."""

FramePoses = tuple[Floats, Floats]
"""World positions of the root's origin [mm], shape (n_frames, 3); world from limb by its rows, frame by frame, shape
(n_frames * n_limbs, 9)."""


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


def origins_of(parents: Ints, joints: Floats, root: Floats, rotations: Floats) -> Floats:
    """Return the world positions of the limbs' origins [mm], shape (n_frames, n_limbs, 3).

    Parameters
    ----------
    parents, joints
        See `chain.Chain`.
    root, rotations
        See `chain.ChainPoses`.
    """
    out = np.empty(rotations.shape[:3])
    out[:, 0] = root
    _write_origins(parents, joints, rotations, out)
    return out


@kernel
def _write_origins(parents: Ints, joints: Floats, rotations: Floats, out: Floats) -> None:
    """Write the origins of all limbs but the root."""
    for frame in range(len(out)):
        for limb in range(1, len(parents)):
            parent = parents[limb]
            for i in range(3):
                way = 0.0
                for j in range(3):
                    way += rotations[frame, parent, i, j] * joints[limb, j]
                out[frame, limb, i] = out[frame, parent, i] + way


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
    _write_markers(origins, rotations, limbs, offsets, out)
    return out


@kernel
def _write_markers(origins: Floats, rotations: Floats, limbs: Ints, offsets: Floats, out: Floats) -> None:
    for frame in range(len(rotations)):
        for marker in range(len(limbs)):
            limb = limbs[marker]
            for i in range(3):
                way = 0.0
                for j in range(3):
                    way += rotations[frame, limb, i, j] * offsets[marker, j]
                out[frame, marker, i] = origins[frame, limb, i] + way


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
    _turn_back(rotations, limbs, vectors, out)
    return out


@kernel
def _turn_back(rotations: Floats, limbs: Ints, vectors: Floats, out: Floats) -> None:
    for frame in range(len(vectors)):
        for marker in range(len(limbs)):
            for i in range(3):
                total = 0.0
                for j in range(3):
                    total += rotations[frame, limbs[marker], j, i] * vectors[frame, marker, j]
                out[frame, marker, i] = total


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
    out = np.empty(covariances.shape[:3])
    _write_variances(covariances.copy(), rotations, np.maximum(parents, 0), shared, axes, out)
    return out


@kernel
def _write_variances(
    totals: Floats, rotations: Floats, parents: Ints, shared: Floats, axes: Floats, out: Floats
) -> None:
    """Write the variances; what is shared is added to the covariances, which become the totals."""
    for frame in range(len(totals)):
        for limb in range(len(parents)):
            turn, axis = rotations[frame, parents[limb]], axes[frame, limb]
            total, turned = totals[frame, limb], out[frame, limb]
            for i in range(3):
                for k in range(3):
                    turned[k] = 0.0
                    for j in range(3):
                        turned[k] += turn[i, j] * shared[limb, j, k]
                for k in range(3):
                    for j in range(3):
                        total[i, k] += turned[j] * turn[k, j]
            along = 0.0
            for i in range(3):
                turned[i] = total[i, 0] * axis[0] + total[i, 1] * axis[1] + total[i, 2] * axis[2]
                along += axis[i] * turned[i]
            for i in range(3):
                turned[i] = total[i, i] + axis[i] * (along * axis[i] - 2.0 * turned[i])


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
