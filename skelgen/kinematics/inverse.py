"""Inverse kinematics: the pose of a known skeleton from markers of one frame or many.

Limbs are placed from the root outward in closed form (Schönauer 2007, 3.8.2). The whole chain is then fitted to all
markers at once, joints turning only as their kinds allow, and every joint's angles come with standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.orientation import fit_transform, rotation_by_quaternion
from skelgen.geometry.rotations import transform_from
from skelgen.kinematics.angles import angle_deviations, joint_angles
from skelgen.kinematics.articulation import FREEDOMS, Articulation
from skelgen.kinematics.chain import Chain, ChainPoses, seen_weights
from skelgen.kinematics.pose_covariances import pose_covariances
from skelgen.kinematics.posing import fit_poses
from skelgen.kinematics.rings import Rings, fit_closed_poses
from skelgen.kinematics.shape import determines_pose
from skelgen.kinematics.uncertainty import axis_projectors
from skelgen.model import Joint, Motion, Skeleton
from skelgen.model.arrays import Bools, Floats, Ints, check_floats

METHODS = ("whole-chain", "root-outward")

LEAST_SHARE = 0.1
"""Of the usual noise: no marker counts as surer than this."""


@dataclass(frozen=True, eq=False)
class Posture:
    """A skeleton's pose in some frames.

    Attributes
    ----------
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Pose of every limb's frame.
    joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        World positions in the order of the skeleton's joints.
    joint_std : ndarray, shape (n_frames, n_joints, 3), mm
        Their standard deviations along the world's axes, of hinges across their axes; at most some `UNKNOWN_SHIFT`
        where no marker tells.
    angles : tuple of ndarray, shape (n_frames, n_angles), rad
        Of each joint, 0 in the reference pose. Hinge: the angle about its axis. Universal: the angle about the axis in
        the parent, then that about the axis in the child. Ball and undetermined: the rotation vector of the child
        against the parent, in the parent's axes. Rigid: none.
    angle_std : tuple of ndarray, shape (n_frames, n_angles), rad
        Standard deviations of the angles against the limbs' markers: noise of the frame and errors of the skeleton. At
        most some `UNKNOWN_TURN` where no marker tells. That the zero was taken from a measured frame adds one constant
        to all frames, which is not counted.
    limb_seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether markers of the frame fix the limb's rotation; otherwise the limb is turned as its parent, as far as the
        other limbs' markers do not say otherwise.
    """

    world_from_limb: Floats
    joint_positions: Floats
    joint_std: Floats
    angles: tuple[Floats, ...]
    angle_std: tuple[Floats, ...]
    limb_seen: Bools


def solve(skeleton: Skeleton, positions: Floats, *, method: str = "whole-chain", noise: float | None = None) -> Posture:
    """Pose a known skeleton; rings that it closes stay closed.

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
    trees = [_Tree(skeleton, int(root), noise) for root in skeleton.roots]
    poses, seen = [], np.zeros((len(positions), skeleton.n_limbs), dtype=bool)
    for tree in trees:
        own = positions[:, tree.markers]
        start, seen[:, tree.limbs] = _outward(tree, own)
        weights = seen_weights(own, np.broadcast_to(tree.weights, own.shape[:2]))
        poses.append(_fitted(tree, start, own, weights) if method == "whole-chain" else start)
    return _posture(skeleton, trees, poses, positions, seen)


def _fitted(tree: _Tree, start: ChainPoses, positions: Floats, weights: Floats) -> ChainPoses:
    if tree.rings.n_rings:
        return fit_closed_poses(tree.chain, tree.rings, start, positions, tree.articulation, weights)
    return fit_poses(tree.chain, start, positions, tree.articulation, weights)


def posture_of(skeleton: Skeleton, motion: Motion, positions: Floats, frames: Ints | None = None) -> Posture:
    """Return angles, joints and their standard deviations of a motion that is known.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.
    motion : Motion
        Its motion.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers of all frames, NaN where unseen: which are seen says how sure a frame is.
    frames : ndarray of intp, optional
        Some frames; all if not given.

    Examples
    --------
    >>> posture = posture_of(project.skeleton, project.motion, project.trajectories.positions)  # doctest: +SKIP
    """
    frames = np.arange(motion.n_frames) if frames is None else frames
    world = motion.world_from_limb[frames]
    trees = [_Tree(skeleton, int(root), None) for root in skeleton.roots]
    poses = [ChainPoses(world[:, tree.limbs[0], :3, 3], world[:, tree.limbs, :3, :3]) for tree in trees]
    return _posture(skeleton, trees, poses, positions[frames], motion.limb_seen[frames])


def _posture(
    skeleton: Skeleton, trees: list[_Tree], poses: list[ChainPoses], positions: Floats, seen: Bools
) -> Posture:
    n_frames = len(positions)
    world = np.tile(np.eye(4), (n_frames, skeleton.n_limbs, 1, 1))
    turns, places = np.zeros((2, n_frames, skeleton.n_limbs, 3, 3))
    for tree, posed in zip(trees, poses, strict=True):
        world[:, tree.limbs] = transform_from(posed.rotations, posed.origins(tree.chain))
        turns[:, tree.limbs], places[:, tree.limbs] = _frame_errors(tree, posed, positions[:, tree.markers])
    rotations = world[..., :3, :3]
    relative = [rotations[:, one.parent].swapaxes(1, 2) @ rotations[:, one.child] for one in skeleton.joints]
    children = [one.child for one in skeleton.joints]
    turned = list(zip(skeleton.joints, relative, strict=True))
    return Posture(
        world_from_limb=world,
        joint_positions=world[:, :, :3, 3][:, children],
        joint_std=np.sqrt(np.maximum(np.einsum("fjii->fji", places[:, children]), 0.0)),
        angles=tuple(joint_angles(one, turn) for one, turn in turned),
        angle_std=tuple(angle_deviations(one, turn, turns[:, one.child]) for one, turn in turned),
        limb_seen=seen,
    )


class _Tree:
    """One tree of a skeleton as a chain."""

    def __init__(self, skeleton: Skeleton, root: int, noise: float | None) -> None:
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
        joints = [above.get(int(limb)) for limb in self.limbs]
        self.articulation = _articulation(joints)
        loops = [joint for joint in skeleton.loops if joint.parent in place and joint.child in place]
        pairs = np.array([[place[joint.parent], place[joint.child]] for joint in loops], dtype=np.intp).reshape(-1, 2)
        ends = [(joint.position_in_parent, joint.position_in_child) for joint in loops]
        self.rings = Rings(pairs, np.array(ends).reshape(-1, 2, 3))
        self.turns = np.array([_or_zero(joint, "turn_covariance") for joint in joints])
        self.places = np.array([_or_zero(joint, "covariance") for joint in joints])
        deviations = _noise_of_markers(skeleton, noise)[self.markers]
        self.noise = float(np.median(deviations)) if len(deviations) else 0.0
        self.weights: Floats = (self.noise / deviations) ** 2 if self.noise > 0 else np.ones(len(deviations))


def _or_zero(joint: Joint | None, name: str) -> Floats:
    """A covariance of a joint, 0 where it was not estimated."""
    value = None if joint is None else getattr(joint, name)
    return np.zeros((3, 3)) if value is None else value


def _noise_of_markers(skeleton: Skeleton, noise: float | None) -> Floats:
    """Standard deviation [mm] of each marker's coordinates, none far below the usual one."""
    if noise is not None:
        return np.full(len(skeleton.limb_of_marker), noise)
    known = skeleton.marker_std if skeleton.marker_noise is None else skeleton.marker_noise
    heard = known[~np.isnan(known)]
    usual = float(np.sqrt((heard**2).mean())) if len(heard) else 0.0
    if skeleton.marker_noise is None:
        return np.full(len(known), usual)
    return np.where(np.isnan(known), usual, np.maximum(known, LEAST_SHARE * usual))


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


def _frame_errors(tree: _Tree, poses: ChainPoses, positions: Floats) -> tuple[Floats, Floats]:
    """Covariances of turns against the parents in their axes [rad^2], and of joints in the world [mm^2].

    Both of shape (n_frames, n_limbs, 3, 3): what the frame leaves open, and the errors of the skeleton.
    """
    chain, articulation = tree.chain, tree.articulation
    weights = seen_weights(positions, np.broadcast_to(tree.weights, positions.shape[:2]))
    found = pose_covariances(chain, articulation, poses, positions, tree.noise, weights)
    parents = poses.rotations[:, np.maximum(chain.parents, 0)]
    across = axis_projectors(chain, articulation, poses)
    places = across @ (found.origins + parents @ tree.places @ parents.swapaxes(2, 3)) @ across
    return found.turns + tree.turns, places
