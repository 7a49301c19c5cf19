"""Compiled loops over frames of a chain: where its limbs and markers are; `plain_chain` is the NumPy twin.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.compiling import compile_function
from skelgen.model.arrays import Floats, Ints


@compile_function
def origins_of(parents: Ints, joints: Floats, root: Floats, rotations: Floats) -> Floats:
    """Return the world positions of the limbs' origins; see `plain_chain.origins_of`."""
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


@compile_function
def markers_of(origins: Floats, rotations: Floats, limbs: Ints, offsets: Floats) -> Floats:
    """Return the world positions of markers; see `plain_chain.markers_of`."""
    out = np.empty((len(rotations), len(limbs), 3))
    for frame in range(len(rotations)):
        for marker in range(len(limbs)):
            limb = limbs[marker]
            for i in range(3):
                turn = rotations[frame, limb, i]
                way = turn[0] * offsets[marker, 0] + turn[1] * offsets[marker, 1] + turn[2] * offsets[marker, 2]
                out[frame, marker, i] = origins[frame, limb, i] + way
    return out


@compile_function
def errors_of(positions: Floats, markers: Floats) -> Floats:
    """Return measured minus predicted positions, zero where unseen; see `plain_chain.errors_of`."""
    out = np.zeros(positions.shape)
    for frame in range(len(positions)):
        for marker in range(positions.shape[1]):
            for i in range(3):
                error = positions[frame, marker, i] - markers[frame, marker, i]
                if not math.isnan(error):
                    out[frame, marker, i] = error
    return out


@compile_function
def turned_back(rotations: Floats, limbs: Ints, vectors: Floats) -> Floats:
    """Return vectors of the world in the frames of limbs; see `plain_chain.turned_back`."""
    out = np.empty(vectors.shape)
    for frame in range(len(vectors)):
        for marker in range(len(limbs)):
            turn, vector = rotations[frame, limbs[marker]], vectors[frame, marker]
            for i in range(3):
                out[frame, marker, i] = turn[0, i] * vector[0] + turn[1, i] * vector[1] + turn[2, i] * vector[2]
    return out


@compile_function
def variances_across(covariances: Floats, rotations: Floats, parents: Ints, shared: Floats, axes: Floats) -> Floats:
    """Return variances along the world's axes, across an axis where there is one; see `plain_chain`."""
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
