"""Pose a rigid skeleton from the root outward, one limb at a time, in closed form (seed 3.8.2).

The root is placed by absolute orientation. Every other limb turns about the joint that its parent has already placed.
Where a limb's markers do not fix its rotation, the raw joints to its children help; where these do not either, the
rotation is taken from the frames around.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.orientation import Rotator, fit_transform, moments_about
from skelgen.geometry.rotations import fill_rotations, fill_vectors
from skelgen.kinematics.bodies.shape import determines_pose
from skelgen.kinematics.chain.chain import Chain, ChainPoses
from skelgen.model.arrays import Bools, Floats


def pose_outward(
    chain: Chain, positions: Floats, raw_joints: Floats, rotator: Rotator, flatness: float
) -> tuple[ChainPoses, Bools]:
    """Pose the chain in every frame.

    Parameters
    ----------
    chain : Chain
        Known limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    raw_joints : ndarray, shape (n_frames, n_limbs, 3), mm
        Raw joint above each limb; NaN for the root and where unknown.
    rotator : callable
        Closed form of absolute orientation.
    flatness : float
        Points whose second extent is below this part of the first fix no rotation.

    Returns
    -------
    tuple of ChainPoses and ndarray of bool, shape (n_frames, n_limbs)
        Poses, and whether each rotation rests on points of the frame rather than on interpolation.
    """
    n_frames = len(positions)
    rotations = np.empty((n_frames, chain.n_limbs, 3, 3))
    origins = np.empty((n_frames, chain.n_limbs, 3))
    posed = np.zeros((n_frames, chain.n_limbs), dtype=bool)
    for limb in range(chain.n_limbs):
        parent = int(chain.parents[limb])
        points, places, seen = _points_to_fit(chain, limb, positions, raw_joints, flatness)
        posed[:, limb] = _fixes_rotation(points, seen, parent >= 0, flatness)
        if parent < 0:
            rotations[:, limb], origins[:, limb] = _place_root(points, places, seen, posed[:, limb], rotator)
            continue
        origins[:, limb] = origins[:, parent] + rotations[:, parent] @ chain.joints[limb]
        moments = moments_about(points, places, origins[:, limb], seen)
        rotations[:, limb] = _filled(rotator(moments), posed[:, limb], rotations[:, parent])
    return ChainPoses(origins[:, 0].copy(), rotations), posed


def _points_to_fit(
    chain: Chain, limb: int, positions: Floats, raw_joints: Floats, flatness: float
) -> tuple[Floats, Floats, Bools]:
    """Points of a limb in its frame and in the world, and which count: raw joints only where markers do not suffice."""
    own = chain.limb_of_marker == limb
    outer = chain.parents == limb
    points = np.concatenate([chain.offsets[own], chain.joints[outer]])
    places = np.concatenate([positions[:, own], raw_joints[:, outer]], axis=1)
    seen = ~np.isnan(places[:, :, 0])
    n_markers = int(own.sum())
    enough = _fixes_rotation(points[:n_markers], seen[:, :n_markers], bool(chain.parents[limb] >= 0), flatness)
    seen[enough, n_markers:] = False
    return points, places, seen


def _fixes_rotation(points: Floats, seen: Bools, about_joint: bool, flatness: float) -> Bools:
    """Whether the seen points fix the rotation; about a joint, the origin is one more known point."""
    if about_joint:
        points = np.concatenate([points, np.zeros((1, 3))])
        seen = np.concatenate([seen, np.ones((len(seen), 1), dtype=bool)], axis=1)
    return determines_pose(points, seen, flatness)


def _place_root(points: Floats, places: Floats, seen: Bools, posed: Bools, rotator: Rotator) -> tuple[Floats, Floats]:
    transform = fit_transform(points, places, seen & posed[:, np.newaxis], rotator)
    turn = fill_rotations(transform[:, :3, :3], posed)
    somewhere: Bools = np.asarray(seen.any(axis=1))
    turned = np.einsum("fij,nj->fni", turn, points)
    count = np.maximum(seen.sum(axis=1), 1)[:, np.newaxis]
    origin = np.where(seen[..., np.newaxis], places - turned, 0.0).sum(axis=1) / count
    return turn, fill_vectors(origin, somewhere)


def _filled(turns: Floats, posed: Bools, parents: Floats) -> Floats:
    """Rotations of a limb; where they are not posed, the parent is followed as in the frames around."""
    if posed.all():
        return turns
    missing = np.flatnonzero(~posed)
    in_parent = fill_rotations(parents.swapaxes(1, 2) @ turns, posed)
    turns[missing] = parents[missing] @ in_parent[missing]
    return turns
