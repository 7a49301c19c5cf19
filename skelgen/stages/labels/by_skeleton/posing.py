"""A skeleton posed in all frames of a take: limbs, joints and places of markers stay as they are.

Each tree is placed from the root outward, then fitted to all markers at once with its joints held to their types, as
the skeleton stage does after its calibration; positions that the chain does not explain are left out.
"""

from dataclasses import dataclass, replace

import numpy as np

from skelgen.geometry.rotations import transform_from
from skelgen.kinematics.chain.chain import ChainPoses
from skelgen.kinematics.inverse.root_outward import pose_by_own_markers
from skelgen.kinematics.inverse.skeleton_tree import SkeletonTree
from skelgen.model import Skeleton
from skelgen.model.arrays import Bools, Floats
from skelgen.progress import SILENT, Monitor
from skelgen.stages.skeleton import BodyOfTake, ConstrainedChain, SkeletonParameters, out_of_line, without_outliers

BLOCK_FRAMES = 8_192
"""Frames posed at once: a take of forty markers needs some 10 KB for each."""

MARGIN = 400
"""Frames on both sides of a block that are posed with it: what is not seen at its ends is interpolated as elsewhere."""


@dataclass(frozen=True, eq=False)
class SkeletonPoses:
    """Poses of a skeleton.

    Attributes
    ----------
    world_from_limb : ndarray, shape (n_frames, n_limbs, 4, 4), translations in mm
        Complete: what is not seen is interpolated.
    seen : ndarray of bool, shape (n_frames, n_limbs)
        Whether a limb's rotation rests on markers of the frame.
    inliers : ndarray, shape (n_frames, n_markers, 3), mm
        Positions without those that the skeleton does not explain.
    """

    world_from_limb: Floats
    seen: Bools
    inliers: Floats

    def local(self, skeleton: Skeleton, positions: Floats) -> Floats:
        """Return positions of markers in the frames of their limbs [mm], shape (n_frames, n_markers, 3).

        Parameters
        ----------
        skeleton : Skeleton
            What is posed.
        positions : ndarray, shape (n_frames, n_markers, 3), mm
            In the world, NaN where unseen.

        Returns
        -------
        ndarray, shape (n_frames, n_markers, 3), mm
            NaN where unseen or on no limb.
        """
        poses = self.world_from_limb[:, skeleton.limb_of_marker]
        shifted = (positions - poses[..., :3, 3])[..., np.newaxis]
        local = (poses[..., :3, :3].swapaxes(-1, -2) @ shifted)[..., 0]
        return np.asarray(np.where((skeleton.limb_of_marker >= 0)[:, np.newaxis], local, np.nan))

    def markers(self, skeleton: Skeleton) -> Floats:
        """Return where the skeleton carries its markers [mm], shape (n_frames, n_markers, 3)."""
        poses = self.world_from_limb[:, skeleton.limb_of_marker]
        carried = (poses[..., :3, :3] @ skeleton.marker_offsets[..., np.newaxis])[..., 0] + poses[..., :3, 3]
        return np.asarray(np.where((skeleton.limb_of_marker >= 0)[:, np.newaxis], carried, np.nan))


def pose_skeleton(
    skeleton: Skeleton, positions: Floats, parameters: SkeletonParameters | None = None, monitor: Monitor = SILENT
) -> SkeletonPoses:
    """Pose a skeleton in the frames of a take.

    Parameters
    ----------
    skeleton : Skeleton
        The limbs, with types and axes of joints.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers in the skeleton's order, NaN where unseen.
    parameters : SkeletonParameters, optional
        Their `rotation`, `flatness`, `outlier_limit` and `robust`.
    monitor : Monitor
        Receives progress; may cancel.
    """
    parameters = parameters or SkeletonParameters()
    n_frames = len(positions)
    world = np.tile(np.eye(4), (n_frames, skeleton.n_limbs, 1, 1))
    seen = np.zeros((n_frames, skeleton.n_limbs), dtype=np.bool_)
    inliers = np.array(positions)
    trees = [SkeletonTree(skeleton, int(root), None) for root in skeleton.roots]
    for first in range(0, n_frames, BLOCK_FRAMES):
        last = min(first + BLOCK_FRAMES, n_frames)
        start = max(first - MARGIN, 0)
        wide, inner = slice(start, min(last + MARGIN, n_frames)), slice(first - start, last - start)
        for tree in trees:
            if not len(tree.markers):
                continue
            poses, fixed, kept = _posed(tree, positions[wide][:, tree.markers], parameters)
            part = poses[inner]
            world[first:last, tree.limbs] = transform_from(part.rotations, part.origins(tree.chain))
            seen[first:last, tree.limbs] = fixed[inner]
            inliers[first:last, tree.markers] = kept[inner]
        monitor.advance(last, n_frames)
    return SkeletonPoses(world, seen, inliers)


def _posed(tree: SkeletonTree, positions: Floats, parameters: SkeletonParameters) -> tuple[ChainPoses, Bools, Floats]:
    """Poses, whether rotations rest on markers of the frame, and the positions that are explained."""
    chain = tree.chain
    held = ConstrainedChain(chain, tree.articulation, tree.loops)
    own, _ = pose_by_own_markers(chain, positions, parameters.flatness)
    joints = own[..., :3, 3]  # they place limbs that show too little: a pelvis without markers between its neighbours
    joints[:, 0] = np.nan
    body = BodyOfTake(tree.limbs, chain.parents, tree.markers, chain.limb_of_marker, positions, joints)
    inliers, start, fixed = without_outliers(body, chain, parameters, tree.articulation)
    poses = held.fit_in_time(held.projected(start), inliers, fixed)
    outliers = out_of_line(held, poses, inliers, parameters.robust)
    if outliers.any():
        inliers = np.where(outliers[..., np.newaxis], np.nan, inliers)
        poses = held.fit(poses, inliers)
    return poses, fixed, inliers


def with_free_joints(skeleton: Skeleton, which: tuple[int, ...] | None = None) -> Skeleton:
    """Return a skeleton some of whose joints, or all, are ball joints.

    Parameters
    ----------
    skeleton : Skeleton
        With its types of joints.
    which : tuple of int, optional
        Indices of joints; all if not given.
    """
    chosen = range(skeleton.n_joints) if which is None else which
    joints = list(skeleton.joints)
    for index in chosen:
        if joints[index].kind not in {"ball", "undetermined"}:
            free = replace(joints[index], kind="ball", axis=None, second_axis=None, axis_std=None, second_axis_std=None)
            joints[index] = free
    return replace(skeleton, joints=tuple(joints))
