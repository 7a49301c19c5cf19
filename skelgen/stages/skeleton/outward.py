"""Pose a rigid skeleton from the root outward, one limb at a time, in closed form (seed 3.8.2).

The root is placed by absolute orientation. Every other limb turns about the joint that its parent has already placed.
Frames in which too few markers of a limb are seen take its rotation from the frames around them.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.orientation import Rotator, fit_transform
from skelgen.geometry.rotations import fill_rotations, fill_vectors
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.kinematics.shape import determines_pose
from skelgen.model.arrays import Bools, Floats


def pose_outward(chain: Chain, positions: Floats, rotator: Rotator) -> tuple[ChainPoses, Bools]:
    """Pose the chain in every frame.

    Parameters
    ----------
    chain : Chain
        Known limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    rotator : callable
        Closed form of absolute orientation.

    Returns
    -------
    tuple of ChainPoses and ndarray of bool, shape (n_frames, n_limbs)
        Poses, and whether each rotation rests on markers of the frame rather than on interpolation.
    """
    seen = ~np.isnan(positions[:, :, 0])
    n_frames = len(positions)
    rotations = np.empty((n_frames, chain.n_limbs, 3, 3))
    origins = np.empty((n_frames, chain.n_limbs, 3))
    posed = np.zeros((n_frames, chain.n_limbs), dtype=bool)
    for limb in range(chain.n_limbs):
        own = chain.limb_of_marker == limb
        parent = int(chain.parents[limb])
        if parent < 0:
            turn, origins[:, limb], posed[:, limb] = _place_root(
                chain.offsets[own], positions[:, own], seen[:, own], rotator
            )
            rotations[:, limb] = turn
            continue
        origins[:, limb] = origins[:, parent] + rotations[:, parent] @ chain.joints[limb]
        relative = positions[:, own] - origins[:, limb, np.newaxis]
        turn, posed[:, limb] = _turn_about_joint(chain.offsets[own], relative, seen[:, own], rotator)
        in_parent = rotations[:, parent].swapaxes(1, 2) @ turn
        rotations[:, limb] = rotations[:, parent] @ fill_rotations(in_parent, posed[:, limb])
    return ChainPoses(origins[:, 0].copy(), rotations), posed


def _place_root(points: Floats, positions: Floats, seen: Bools, rotator: Rotator) -> tuple[Floats, Floats, Bools]:
    posed = determines_pose(points, seen)
    transform = fit_transform(points, positions, seen & posed[:, np.newaxis], rotator)
    turn = fill_rotations(transform[:, :3, :3], posed)
    somewhere: Bools = np.asarray(seen.any(axis=1))
    turned = np.einsum("fij,nj->fni", turn, points)
    count = np.maximum(seen.sum(axis=1), 1)[:, np.newaxis]
    origin = np.where(seen[..., np.newaxis], positions - turned, 0.0).sum(axis=1) / count
    return turn, fill_vectors(origin, somewhere), posed


def _turn_about_joint(points: Floats, relative: Floats, seen: Bools, rotator: Rotator) -> tuple[Floats, Bools]:
    """Rotations that best turn a limb's points onto vectors from its joint, and where two directions fix them."""
    with_joint = np.concatenate([points, np.zeros((1, 3))])
    joint_too = np.concatenate([seen, np.ones((len(seen), 1), dtype=bool)], axis=1)
    posed = determines_pose(with_joint, joint_too)
    filled = np.where(seen[..., np.newaxis], relative, 0.0)
    moments = np.einsum("fni,nj->fij", filled, points)
    turn = np.full((len(seen), 3, 3), np.nan)
    turn[posed] = rotator(moments[posed])
    return turn, posed
