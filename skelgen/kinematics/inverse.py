"""Inverse kinematics: the pose of a known skeleton from markers of one frame or many.

Limbs are placed from the root outward in closed form (Schönauer 2007, 3.8.2). The whole chain is then fitted to all
markers at once, joints turning only as their kinds allow, and every joint's angles come with standard deviations.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.kinematics.angles import angle_deviations, joint_angles
from skelgen.kinematics.chain import ChainPoses, seen_weights
from skelgen.kinematics.closed_form import Outward, pose_outward
from skelgen.kinematics.known_tree import KnownTree
from skelgen.kinematics.pose_covariances import pose_covariances
from skelgen.kinematics.posing import fit_poses
from skelgen.kinematics.rings import fit_closed_poses
from skelgen.kinematics.uncertainty import axis_projectors
from skelgen.model import Motion, Skeleton
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
    joint_covariances : ndarray, shape (n_frames, n_joints, 3, 3), mm^2
        Of these along the world's axes, of hinges across their axes; at most some `UNKNOWN_SHIFT` squared where no
        marker tells.
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
    joint_covariances: Floats
    angles: tuple[Floats, ...]
    angle_std: tuple[Floats, ...]
    limb_seen: Bools

    @property
    def joint_std(self) -> Floats:
        """Standard deviations of the joints along the world's axes [mm], shape (n_frames, n_joints, 3)."""
        return np.asarray(np.sqrt(np.maximum(np.einsum("fjii->fji", self.joint_covariances), 0.0)))


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
    check_method(method)
    positions = np.asarray(positions, dtype=np.float64)
    positions = positions[np.newaxis] if positions.ndim == 2 else positions
    positions = check_floats(positions, (None, len(skeleton.limb_of_marker), 3), "positions")
    trees = [KnownTree(skeleton, int(root), noise) for root in skeleton.roots]
    found = []
    for tree in trees:
        seen = ~np.isnan(positions[:, tree.markers, 0])
        if not seen.any(axis=1).all():
            frame = int(np.argmin(seen.any(axis=1)))
            raise InputError(f"frame {frame} shows no marker of limb {tree.limbs[0]} and those beyond it: leave it out")
        found.append(solve_tree(tree, positions[:, tree.markers], method))
    return posture(skeleton, trees, found)


def check_method(method: str) -> None:
    """Raise `InputError` if there is no such method."""
    if method not in METHODS:
        raise InputError(f"there is no method {method!r} of inverse kinematics; there are {', '.join(METHODS)}")


def solve_tree(tree: KnownTree, positions: Floats, method: str, before: Floats | None = None) -> Outward:
    """Pose one tree; parameters are those of `pose_outward`, and the method."""
    start = pose_outward(tree, positions, before)
    if method == "root-outward":
        return start
    weights = seen_weights(positions, np.broadcast_to(tree.weights, positions.shape[:2]))
    chain, articulation = tree.chain, tree.articulation
    if tree.rings.n_rings:
        poses = fit_closed_poses(chain, tree.rings, start.poses, positions, articulation, weights)
    else:
        poses = fit_poses(chain, start.poses, positions, articulation, weights)
    return Outward(poses, start.fixed, pose_covariances(chain, articulation, poses, positions, tree.noise, weights))


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
    trees = [KnownTree(skeleton, int(root), None) for root in skeleton.roots]
    found = []
    for tree in trees:
        poses = ChainPoses(world[:, tree.limbs[0], :3, 3], world[:, tree.limbs, :3, :3])
        own = positions[frames][:, tree.markers]
        weights = seen_weights(own, np.broadcast_to(tree.weights, own.shape[:2]))
        covariances = pose_covariances(tree.chain, tree.articulation, poses, own, tree.noise, weights)
        found.append(Outward(poses, motion.limb_seen[frames][:, tree.limbs], covariances))
    return posture(skeleton, trees, found)


def posture(skeleton: Skeleton, trees: list[KnownTree], found: list[Outward]) -> Posture:
    """Gather posed trees, and add the errors of the skeleton to those of the frames."""
    n_frames, n_limbs = len(found[0].fixed), skeleton.n_limbs
    world = np.tile(np.eye(4), (n_frames, n_limbs, 1, 1))
    turns, places = np.zeros((2, n_frames, n_limbs, 3, 3))
    seen = np.zeros((n_frames, n_limbs), dtype=bool)
    for tree, one in zip(trees, found, strict=True):
        world[:, tree.limbs] = transform_from(one.poses.rotations, one.poses.origins(tree.chain))
        turns[:, tree.limbs], seen[:, tree.limbs] = one.covariances.turns + tree.turns, one.fixed
        parents = one.poses.rotations[:, np.maximum(tree.chain.parents, 0)]
        across = axis_projectors(tree.chain, tree.articulation, one.poses)
        whole = one.covariances.origins + parents @ tree.places @ parents.swapaxes(2, 3)
        places[:, tree.limbs] = across @ whole @ across
    rotations = world[..., :3, :3]
    relative = [rotations[:, one.parent].swapaxes(1, 2) @ rotations[:, one.child] for one in skeleton.joints]
    children = [one.child for one in skeleton.joints]
    turned = list(zip(skeleton.joints, relative, strict=True))
    return Posture(
        world_from_limb=world,
        joint_positions=world[:, :, :3, 3][:, children],
        joint_covariances=places[:, children],
        angles=tuple(joint_angles(one, turn) for one, turn in turned),
        angle_std=tuple(angle_deviations(one, turn, turns[:, one.child]) for one, turn in turned),
        limb_seen=seen,
    )
