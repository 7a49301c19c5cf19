"""Inverse kinematics: the pose of a calibrated skeleton from markers of one frame or many.

Limbs are posed from the root outward in closed form (Schönauer 2007, 3.8.2). Then the whole chain is fitted to all
markers at once, and joints rotate only as their types allow. Every joint's angles come with standard deviations.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.kinematics.chain.chain import ChainPoses
from skelgen.kinematics.inverse.loop_closure import fit_closed_poses
from skelgen.kinematics.inverse.poses import fit_poses, pose_covariances
from skelgen.kinematics.inverse.root_outward import KnownJoints, PosedTree, outward_covariances, pose_outward
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.kinematics.joints.angles import angle_deviations, joint_angles
from skelgen.model import Motion, Project, Skeleton
from skelgen.model.arrays import Bools, Floats, Ints, as_floats, check_floats

METHODS = ("whole-chain", "root-outward")

LEAST_SPREAD = 50.0
"""mm; points of a limb with fewer or nearer markers are that far apart."""


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
        Of these along the world's axes, of hinges across their axes; at most about `UNKNOWN_SHIFT` squared where no
        marker determines them.
    angles : tuple of ndarray, shape (n_frames, n_angles), rad
        Of each joint, 0 in the reference pose. Hinge: the angle about its axis. Universal: the angle about the axis in
        the parent, then that about the axis in the child. Ball and undetermined: the rotation vector of the child
        against the parent, in the parent's axes. Rigid: none.
    angle_std : tuple of ndarray, shape (n_frames, n_angles), rad
        Standard deviations of the angles against the limbs' markers, by noise of the frame and errors of the skeleton;
        at most about `UNKNOWN_TURN` where no marker determines an angle. The zero comes from a measured frame: its
        error is the same in all frames and not included.
    limb_seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether markers of the frame fix the limb's rotation. Otherwise it follows from the parent and from the markers
        of the limbs beyond.
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
    """Pose a calibrated skeleton; its kinematic loops stay closed.

    Parameters
    ----------
    skeleton : Skeleton
        With its types of joints and axes.
    positions : ndarray, shape (n_frames, n_markers, 3) or (n_markers, 3), mm
        Measured markers, NaN or masked where unseen.
    method : str
        ``whole-chain``, or ``root-outward`` for the closed form alone.
    noise : float, mm, optional
        Standard deviation of a marker's coordinate; that of the skeleton's markers if not given.

    Raises
    ------
    InputError
        If the markers are not those of the skeleton, a frame shows none, or there is no such method.

    Examples
    --------
    >>> import skelgen
    >>> project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)
    >>> posture = solve(project.skeleton, project.trajectories.positions[:5])
    >>> posture.angles[0].shape, posture.angle_std[0].shape  # of the first joint
    ((5, 3), (5, 3))
    """
    _check_method(method)
    positions = as_floats(positions, "positions", "3 axes")
    positions = positions[np.newaxis] if positions.ndim == 2 else positions
    positions = check_floats(positions, (None, len(skeleton.limb_of_marker), 3), "positions")
    trees = [SkeletonTree(skeleton, int(root), noise) for root in skeleton.roots]
    found = []
    for tree in trees:
        seen = ~np.isnan(positions[:, tree.markers, 0])
        if not seen.any(axis=1).all():
            frame = int(np.argmin(seen.any(axis=1)))
            raise InputError(f"frame {frame} shows no marker of limb {tree.limbs[0]} and those beyond it: leave it out")
        found.append(_solve_tree(tree, positions[:, tree.markers], method))
    return posture(skeleton, trees, found)


def hold_joints(skeleton: Skeleton, world_from_limb: Floats, fixed: Sequence[int] = ()) -> Floats:
    """Return the poses nearest to given ones in which joints turn only as their types allow, in the same shape.

    Four points of each limb are fitted, as far apart as its markers are, so that all of its turns count.

    Parameters
    ----------
    skeleton : Skeleton
        With its types of joints and axes.
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Poses whose joints are closed but turn otherwise.
    fixed : sequence of int
        Limbs that give way least.
    """
    corners = []
    for limb in range(skeleton.n_limbs):
        markers = skeleton.marker_offsets[skeleton.markers_of(limb)]
        middle = markers.mean(axis=0) if len(markers) else np.zeros(3)
        spread = float(np.linalg.norm(markers - middle, axis=1).max(initial=0.0))
        corners.append(middle + max(spread, LEAST_SPREAD) * np.vstack([np.zeros(3), np.eye(3)]))
    offsets = np.array(corners)
    shown = world_from_limb[:, :, np.newaxis, :3, :3] @ offsets[..., np.newaxis]
    points = (shown[..., 0] + world_from_limb[:, :, np.newaxis, :3, 3]).reshape(len(world_from_limb), -1, 3)
    limb_of_point = np.repeat(np.arange(skeleton.n_limbs), len(offsets[0]))
    marked = replace(
        skeleton,
        limb_of_marker=limb_of_point,
        marker_offsets=offsets.reshape(-1, 3),
        marker_std=np.ones(len(limb_of_point)),
        offset_std=None,
        marker_noise=np.where(np.isin(limb_of_point, list(fixed)), 0.0, 1.0) if len(fixed) else None,
    )
    return solve(marked, points).world_from_limb


def _check_method(method: str) -> None:
    """Raise `InputError` if there is no such method."""
    if method not in METHODS:
        raise InputError(f"there is no method {method!r} of inverse kinematics; there are {', '.join(METHODS)}")


def _solve_tree(tree: SkeletonTree, positions: Floats, method: str, before: Floats | None = None) -> PosedTree:
    """Pose one tree of a skeleton.

    Parameters
    ----------
    tree : SkeletonTree
        The limbs.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Markers of the tree, NaN where unseen; every frame shows one.
    method : str
        One of `METHODS`.
    before : ndarray, shape (n_limbs, 3, 3), optional
        World from limb in the frame before; that of the reference pose if not given.
    """
    before = np.tile(np.eye(3), (tree.chain.n_limbs, 1, 1)) if before is None else before
    start, fixed = pose_outward(tree.chain, positions, joints=KnownJoints(tree.articulation, before))
    if method == "root-outward":
        return PosedTree(start, fixed, outward_covariances(tree, start, fixed, positions))
    observed = tree.observed(start, positions)
    if tree.loops.n_loops:
        poses = fit_closed_poses(observed, tree.loops)
    else:
        poses = fit_poses(tree.chain, start, positions, tree.articulation, observed.weights)
    return PosedTree(poses, fixed, pose_covariances(replace(observed, poses=poses), tree.noise))


def posture_of(skeleton: Skeleton, motion: Motion, positions: Floats, frames: Ints | None = None) -> Posture:
    """Return the angles and joints of a motion with their standard deviations.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.
    motion : Motion
        Its motion.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers of all frames, NaN where unseen: the deviations of a frame depend on which are seen.
    frames : ndarray of intp, optional
        Some frames; all if not given.

    Examples
    --------
    >>> import skelgen
    >>> project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)
    >>> posture_of(project.skeleton, project.motion, project.trajectories.positions).joint_std.shape
    (100, 2, 3)
    """
    frames = np.arange(motion.n_frames) if frames is None else frames
    world = motion.world_from_limb[frames]
    trees = [SkeletonTree(skeleton, int(root), None) for root in skeleton.roots]
    found = []
    for tree in trees:
        poses = ChainPoses(world[:, tree.limbs[0], :3, 3], world[:, tree.limbs, :3, :3])
        covariances = pose_covariances(tree.observed(poses, positions[frames][:, tree.markers]), tree.noise)
        found.append(PosedTree(poses, motion.limb_seen[frames][:, tree.limbs], covariances))
    return posture(skeleton, trees, found)


def posture(skeleton: Skeleton, trees: list[SkeletonTree], found: list[PosedTree]) -> Posture:
    """Gather posed trees, and add the errors of the skeleton to those of the frames.

    Parameters
    ----------
    skeleton : Skeleton
        The skeleton.
    trees : list of SkeletonTree
        One for each of its roots.
    found : list of PosedTree
        Their poses, in the same order.
    """
    n_frames, n_limbs = len(found[0].fixed), skeleton.n_limbs
    world = np.tile(np.eye(4), (n_frames, n_limbs, 1, 1))
    turns, places = np.zeros((2, n_frames, n_limbs, 3, 3))
    seen = np.zeros((n_frames, n_limbs), dtype=bool)
    for tree, one in zip(trees, found, strict=True):
        world[:, tree.limbs] = transform_from(one.poses.rotations, one.poses.origins(tree.chain))
        turns[:, tree.limbs], seen[:, tree.limbs] = one.covariances.turns + tree.turns, one.fixed
        parents = one.poses.rotations[:, np.maximum(tree.chain.parents, 0)]
        across = tree.articulation.across_hinges(tree.chain.parents, one.poses.rotations)
        whole = one.covariances.origins + parents @ tree.places @ parents.swapaxes(2, 3)
        places[:, tree.limbs] = across @ whole @ across
    rotations = world[..., :3, :3]
    relative = [rotations[:, one.parent].swapaxes(1, 2) @ rotations[:, one.child] for one in skeleton.joints]
    children = [one.child for one in skeleton.joints]
    turned = list(zip(skeleton.joints, relative, strict=True))
    angles = tuple(joint_angles(one, turn) for one, turn in turned)
    angle_std = tuple(angle_deviations(one, turn, turns[:, one.child]) for one, turn in turned)
    return Posture(world, world[:, :, :3, 3][:, children], places[:, children], angles, angle_std, seen)


class LiveSkeleton:
    """Poses a calibrated skeleton in live use, one frame after the other.

    A limb that a frame does not show keeps its rotation against the parent from the frame before. A tree that it does
    not show at all stays where it was. Both are marked in `limb_seen`, and their deviations are large.

    Parameters
    ----------
    skeleton : Skeleton or Project
        With its types of joints and axes, as a project has it.
    method : str
        ``root-outward``, the closed form, which is quick; or ``whole-chain``, which is nearer to the truth.
    noise : float, mm, optional
        Standard deviation of a marker's coordinate; that of the skeleton's markers if not given.

    Raises
    ------
    InputError
        If there is no such method, or the skeleton is none.

    Examples
    --------
    >>> import skelgen
    >>> project = skelgen.reconstruct(skelgen.simulate("rods", n_frames=100).take)
    >>> live = LiveSkeleton(project.skeleton)
    >>> for frame in project.trajectories.positions[:2]:
    ...     posture = live.see(frame)
    ...     print(posture.angles[0].shape, bool(posture.limb_seen.all()))
    (1, 3) True
    (1, 3) True
    """

    def __init__(
        self, skeleton: Skeleton | Project, *, method: str = "root-outward", noise: float | None = None
    ) -> None:
        _check_method(method)
        skeleton = skeleton.skeleton if isinstance(skeleton, Project) else skeleton
        if not isinstance(skeleton, Skeleton):
            raise InputError(f"the skeleton is {skeleton!r:.60}; a Skeleton or Project belongs there")
        self._skeleton, self._method = skeleton, method
        self._trees = [SkeletonTree(skeleton, int(root), noise) for root in skeleton.roots]
        self._before: list[ChainPoses | None] = [None] * len(self._trees)

    def see(self, positions: Floats) -> Posture:
        """Pose the skeleton in the next frame.

        Parameters
        ----------
        positions : ndarray, shape (n_markers, 3), mm
            Measured markers, NaN where unseen.

        Returns
        -------
        Posture
            Of one frame.

        Raises
        ------
        InputError
            If the markers are not those of the skeleton, or a tree has never been seen.
        """
        positions = check_floats(positions, (len(self._skeleton.limb_of_marker), 3), "positions")
        found = [self._posed(index, positions[np.newaxis, tree.markers]) for index, tree in enumerate(self._trees)]
        self._before = [one.poses for one in found]
        return posture(self._skeleton, self._trees, found)

    def _posed(self, index: int, positions: Floats) -> PosedTree:
        tree, before = self._trees[index], self._before[index]
        if not np.isnan(positions[:, :, 0]).all():
            return _solve_tree(tree, positions, self._method, None if before is None else before.rotations[0])
        if before is None:
            raise InputError(f"the first frame shows no marker of limb {tree.limbs[0]} and those beyond it")
        unknown = pose_covariances(tree.observed(before, positions), tree.noise)
        return PosedTree(before, np.zeros((1, len(tree.limbs)), dtype=bool), unknown)
