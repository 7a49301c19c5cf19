"""Where the limbs and markers of a chain are, over all frames: the NumPy twin of `compiled_chain`."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Floats, Ints


def origins_of(parents: Ints, joints: Floats, root: Floats, rotations: Floats) -> Floats:
    """Return the world positions of the limbs' origins [mm], shape (n_frames, n_limbs, 3).

    Parameters
    ----------
    parents, joints
        See `chain.Chain`.
    root, rotations
        See `chain.ChainPoses`.
    """
    origins = np.empty((*rotations.shape[:2], 3))
    origins[:, 0] = root
    for limb in range(1, len(parents)):
        parent = parents[limb]
        origins[:, limb] = origins[:, parent] + rotations[:, parent] @ joints[limb]
    return origins


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
    return np.asarray(origins[:, limbs] + np.einsum("fmij,mj->fmi", rotations[:, limbs], offsets))


def errors_of(positions: Floats, markers: Floats) -> Floats:
    """Return measured minus predicted positions [mm], zero where unseen, shape (n_frames, n_markers, 3)."""
    return np.nan_to_num(positions - markers)


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
    return np.asarray((rotations[:, limbs].swapaxes(2, 3) @ vectors[..., np.newaxis])[..., 0])


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
    turn = rotations[:, np.maximum(parents, 0)]
    total = covariances + turn @ shared @ turn.swapaxes(2, 3)
    across = np.eye(3) - axes[..., np.newaxis] * axes[..., np.newaxis, :]
    return np.asarray(((across @ total) * across).sum(axis=3))
