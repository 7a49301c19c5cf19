"""Inverse kinematics: the pose of a known skeleton from markers of one frame or many.

Limbs are placed from the root outward in closed form (Schönauer 2007, 3.8.2). The whole chain is then fitted to all
markers at once, joints turning only as their kinds allow, and every joint's angles come with standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.orientation import fit_transform, rotation_by_quaternion
from skelgen.geometry.rotations import matrix_from_vector, transform_from, vector_from_matrix
from skelgen.kinematics.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.kinematics.pose_covariances import pose_covariances
from skelgen.kinematics.posing import fit_poses
from skelgen.kinematics.shape import determines_pose
from skelgen.model import Joint, Skeleton
from skelgen.model.arrays import Bools, Floats, Ints, check_floats

METHODS = ("whole-chain", "root-outward")


@dataclass(frozen=True, eq=False)
class Posture:
    """A skeleton's pose in some frames.

    Attributes
    ----------
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Pose of every limb's frame.
    joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        World positions in the order of the skeleton's joints.
    angles : tuple of ndarray, shape (n_frames, n_angles), rad
        Of each joint, 0 in the reference pose. Hinge: the angle about its axis. Universal: the angle about the axis in
        the parent, then that about the axis in the child. Ball and undetermined: the rotation vector of the child
        against the parent, in the parent's axes. Rigid: none.
    angle_std : tuple of ndarray, shape (n_frames, n_angles), rad
        Standard deviations of the angles; of balls, of small further turns about the parent's axes. At most some
        `UNKNOWN_TURN` where no marker tells.
    limb_seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether markers of the frame fix the limb's rotation; otherwise the limb is turned as its parent, as far as the
        other limbs' markers do not say otherwise.
    """

    world_from_limb: Floats
    joint_positions: Floats
    angles: tuple[Floats, ...]
    angle_std: tuple[Floats, ...]
    limb_seen: Bools


def solve(skeleton: Skeleton, positions: Floats, *, method: str = "whole-chain", noise: float | None = None) -> Posture:
    """Pose a known skeleton.

    Parameters
    ----------
    skeleton : Skeleton
        With its kinds of joints and axes.
    positions : ndarray, shape (n_frames, n_markers, 3) or (n_markers, 3), mm
        Measured markers, NaN where unseen.
    method : str
        ``whole-chain``, or ``root-outward`` for the closed form alone.
    noise : float, mm, optional
        Standard deviation of a marker's coordinate; what the skeleton's markers showed, if not given.

    Raises
    ------
    InputError
        If the markers are not those of the skeleton, a frame shows none, or there is no such method.

    Examples
    --------
    >>> posture = solve(project.skeleton, frame)  # doctest: +SKIP
    >>> posture.angles[0], posture.angle_std[0]  # doctest: +SKIP
    """
    if method not in METHODS:
        raise InputError(f"there is no method {method!r} of inverse kinematics; there are {', '.join(METHODS)}")
    positions = np.asarray(positions, dtype=np.float64)
    positions = positions[np.newaxis] if positions.ndim == 2 else positions
    positions = check_floats(positions, (None, len(skeleton.limb_of_marker), 3), "positions")
    noise = _usual_noise(skeleton) if noise is None else noise
    n_frames = len(positions)
    world = np.tile(np.eye(4), (n_frames, skeleton.n_limbs, 1, 1))
    seen = np.zeros((n_frames, skeleton.n_limbs), dtype=bool)
    turns: dict[int, Floats] = {}
    for root in skeleton.roots:
        tree = _Tree(skeleton, int(root))
        poses, fixed = _outward(tree, positions[:, tree.markers])
        if method == "whole-chain":
            poses = fit_poses(tree.chain, poses, positions[:, tree.markers], tree.articulation)
        world[:, tree.limbs] = transform_from(poses.rotations, poses.origins(tree.chain))
        seen[:, tree.limbs] = fixed
        covariances = pose_covariances(tree.chain, tree.articulation, poses, positions[:, tree.markers], noise).turns
        turns |= {int(limb): covariances[:, place] for place, limb in enumerate(tree.limbs)}
    rotations = world[..., :3, :3]
    relative = [rotations[:, one.parent].swapaxes(1, 2) @ rotations[:, one.child] for one in skeleton.joints]
    children = [one.child for one in skeleton.joints]
    return Posture(
        world_from_limb=world,
        joint_positions=world[:, children, :3, 3],
        angles=tuple(joint_angles(one, turn) for one, turn in zip(skeleton.joints, relative, strict=True)),
        angle_std=tuple(
            _deviations(one, turn, turns[one.child]) for one, turn in zip(skeleton.joints, relative, strict=True)
        ),
        limb_seen=seen,
    )


def joint_angles(joint: Joint, relative: Floats) -> Floats:
    """Return a joint's angles [rad] from rotations child against parent, shape (n_frames, n_angles); see `Posture`."""
    if joint.kind == "rigid":
        return np.zeros((len(relative), 0))
    if joint.kind == "hinge" and joint.axis is not None:
        return _about(joint.axis, relative)[:, np.newaxis]
    if joint.kind == "universal" and joint.axis is not None and joint.second_axis is not None:
        first, second = joint.axis, joint.second_axis
        start, end = np.cross(first, second), np.cross(first, relative @ second)
        swing = np.arctan2(np.cross(start, end) @ first, end @ start)
        rest = matrix_from_vector(-swing[:, np.newaxis] * first) @ relative
        return np.stack([swing, _about(second, rest)], axis=1)
    return vector_from_matrix(relative)


def _about(axis: Floats, relative: Floats) -> Floats:
    """Angle of the turn about an axis that comes nearest."""
    sine = np.stack([relative[:, 2, 1] - relative[:, 1, 2], relative[:, 0, 2] - relative[:, 2, 0]], axis=1)
    sine = np.concatenate([sine, (relative[:, 1, 0] - relative[:, 0, 1])[:, np.newaxis]], axis=1)
    along = np.einsum("i,fij,j->f", axis, relative, axis)
    return np.asarray(np.arctan2(sine @ axis, np.einsum("fii->f", relative) - along))


def _deviations(joint: Joint, relative: Floats, covariance: Floats) -> Floats:
    """Standard deviations of a joint's angles from the covariance of small turns in the parent's axes."""
    if joint.kind == "rigid":
        return np.zeros((len(relative), 0))
    axes = np.broadcast_to(np.eye(3), relative.shape)
    if joint.kind == "hinge" and joint.axis is not None:
        axes = np.broadcast_to(joint.axis[:, np.newaxis], (len(relative), 3, 1))
    elif joint.kind == "universal" and joint.axis is not None and joint.second_axis is not None:
        first = np.broadcast_to(joint.axis, (len(relative), 3))
        axes = np.linalg.pinv(np.stack([first, relative @ joint.second_axis], axis=2)).swapaxes(1, 2)
    return np.asarray(np.sqrt(np.maximum(np.einsum("fia,fij,fja->fa", axes, covariance, axes), 0.0)))


class _Tree:
    """One tree of a skeleton as a chain."""

    def __init__(self, skeleton: Skeleton, root: int) -> None:
        below = {root}
        for limb in skeleton.outward.tolist():
            if int(skeleton.parents[limb]) in below:
                below.add(limb)
        self.limbs: Ints = np.array([limb for limb in skeleton.outward.tolist() if limb in below], dtype=np.intp)
        place = {int(limb): index for index, limb in enumerate(self.limbs)}
        self.markers: Ints = np.flatnonzero([int(limb) in place for limb in skeleton.limb_of_marker])
        above = {joint.child: joint for joint in skeleton.joints}
        parents = np.array([place.get(int(skeleton.parents[limb]), -1) for limb in self.limbs], dtype=np.intp)
        places = [np.zeros(3) if limb == root else above[int(limb)].position_in_parent for limb in self.limbs]
        limb_of_marker = np.array([place[int(skeleton.limb_of_marker[one])] for one in self.markers], dtype=np.intp)
        self.chain = Chain(parents, limb_of_marker, np.array(places), skeleton.marker_offsets[self.markers])
        self.articulation = _articulation([above.get(int(limb)) for limb in self.limbs])


def _articulation(joints: list[Joint | None]) -> Articulation:
    free = Articulation.free(len(joints))
    kinds, in_parent, in_child, between = (
        ["ball"] * len(joints),
        free.in_parent.copy(),
        free.in_child.copy(),
        free.between.copy(),
    )
    for index, joint in enumerate(joints):
        if joint is None:
            continue
        if joint.axis is not None:
            in_parent[index] = in_child[index] = joint.axis
        if joint.second_axis is not None and joint.axis is not None:
            in_child[index] = joint.second_axis
            between[index] = np.arccos(np.clip(joint.axis @ joint.second_axis, -1.0, 1.0))
        kinds[index] = joint.kind if joint.axis is not None or FREEDOMS[joint.kind] in {0, 3} else "ball"
    return Articulation(tuple(kinds), in_parent, in_child, between, np.tile(np.eye(3), (len(joints), 1, 1)))


def _outward(tree: _Tree, positions: Floats) -> tuple[ChainPoses, Bools]:
    """Place limbs in closed form; those that markers do not fix are turned as their parents."""
    chain = tree.chain
    seen = ~np.isnan(positions[:, :, 0])
    if not seen.any(axis=1).all():
        frame = int(np.argmin(seen.any(axis=1)))
        raise InputError(f"frame {frame} shows no marker of limb {tree.limbs[0]} and those beyond it: leave it out")
    rotations = np.tile(np.eye(3), (len(positions), chain.n_limbs, 1, 1))
    origins = np.zeros((len(positions), chain.n_limbs, 3))
    fixed = np.zeros((len(positions), chain.n_limbs), dtype=bool)
    for limb in range(chain.n_limbs):
        own = np.flatnonzero(chain.limb_of_marker == limb)
        points, heard, places = chain.offsets[own], seen[:, own], positions[:, own]
        if chain.parents[limb] < 0:
            rotations[:, limb], origins[:, limb], fixed[:, limb] = _place_root(points, places, heard, positions)
            continue
        parent = int(chain.parents[limb])
        origins[:, limb] = origins[:, parent] + rotations[:, parent] @ chain.joints[limb]
        heard = np.concatenate([heard, np.ones((len(heard), 1), dtype=bool)], axis=1)
        fixed[:, limb] = determines_pose(np.concatenate([points, np.zeros((1, 3))]), heard)
        arms = np.nan_to_num(places - origins[:, limb, np.newaxis])
        turn = rotation_by_quaternion(np.einsum("fmi,mj->fij", arms, points))
        rotations[:, limb] = np.where(fixed[:, limb, np.newaxis, np.newaxis], turn, rotations[:, parent])
        rotations = tree.articulation.projected(chain.parents, rotations)
    return ChainPoses(origins[:, 0].copy(), rotations), fixed


def _place_root(points: Floats, places: Floats, heard: Bools, positions: Floats) -> tuple[Floats, Floats, Bools]:
    """Place the root by its markers; where it has none, at the middle of all others."""
    fixed = determines_pose(points, heard)
    poses = fit_transform(points, places, heard & fixed[:, np.newaxis])
    turn = np.where(fixed[:, np.newaxis, np.newaxis], poses[:, :3, :3], np.eye(3))
    gaps = np.where(heard[..., np.newaxis], places - np.einsum("fij,mj->fmi", turn, points), 0.0).sum(axis=1)
    count = heard.sum(axis=1)[:, np.newaxis]
    return turn, np.where(count > 0, gaps / np.maximum(count, 1), np.nanmean(positions, axis=1)), fixed


def _usual_noise(skeleton: Skeleton) -> float:
    known = skeleton.marker_std[~np.isnan(skeleton.marker_std)]
    return float(np.sqrt((known**2).mean())) if len(known) else 0.0
