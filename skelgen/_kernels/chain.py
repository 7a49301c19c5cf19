"""Forward kinematics of a chain over frames: where its limbs and markers are, and how far off what is measured."""

from __future__ import annotations

import math

import numpy as np

from skelgen._kernels import kernel
from skelgen.model.arrays import Floats, Ints


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
    """Return measured minus predicted positions [mm], zero where unseen, shape (n_frames, n_markers, 3)."""
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
