"""Keypoints, which sit on joints: bones between them are limbs, and the stages 2 to 4 are closed forms.

`bones` finds which points a bone joins, and the tree; here stands what stages 2 to 4 make of it.
"""

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.statistics import mean_of_known
from skelgen.kinematics.inverse.motion import MotionAngles
from skelgen.model import Joint, Limbs, Motion, Skeleton, Topology, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.topology import joint_children
from skelgen.progress import SILENT, Monitor
from skelgen.stages.keypoints.bones import Bones, PosedBones, find_bones, pose_bones

_SIGMA_PER_QUARTILES = 0.7413  # the deviation of a normal distribution, in the range between its quartiles


def find_keypoint_limbs(trajectories: Trajectories, root: str | None = None, monitor: Monitor = SILENT) -> Limbs:
    """Make the bones between keypoints limbs; a point belongs to the bone that ends in it.

    Parameters
    ----------
    trajectories : Trajectories
        Keypoints.
    root : str, optional
        Name of a point of the root; the pelvis, or the bone with most joints, if left out.
    monitor : Monitor
        Receives notices.

    Raises
    ------
    InputError
        If no point is called like the root.
    """
    if root is not None and root not in trajectories.names:
        known = f"they are {', '.join(trajectories.names)}"[:200]
        raise InputError(f"{trajectories.name}: the root of keypoints is named by one of them, not {root!r}; {known}")
    bones = find_bones(trajectories, () if root is None else (trajectories.names.index(root),))
    n_single = sum(len(points) == 2 for points in bones.points)
    if n_single:
        monitor.notice(
            f"{n_single} of {len(bones.points)} limbs are bones between two points, which do not say how a bone turns "
            "about itself: it turns as little as it can against its parent"
        )
    return Limbs(bones.bone_of_point, _SIGMA_PER_QUARTILES * bones.ranges)


def find_keypoint_joints(trajectories: Trajectories, limbs: Limbs) -> Topology:
    """Join the bones between keypoints in the points where they meet.

    Parameters
    ----------
    trajectories : Trajectories
        Keypoints.
    limbs : Limbs
        From `find_keypoint_limbs`.

    Raises
    ------
    InputError
        If the limbs are others.
    """
    bones = _bones_of(trajectories, limbs)
    costs = np.full((len(bones.points),) * 2, np.nan)
    np.fill_diagonal(costs, 0.0)
    for bone, parent in enumerate(bones.parents.tolist()):
        if parent >= 0:
            costs[bone, parent] = costs[parent, bone] = _variance(bones, bone)
    children = joint_children(bones.parents)
    begins = [int(bones.points[child][0]) for child in children]
    values = np.array([costs[child, bones.parents[child]] for child in children])
    return Topology(
        parents=bones.parents,
        joint_costs=costs,
        raw_joint_positions=trajectories.positions[:, begins],
        n_iterations=np.zeros(len(children), dtype=np.intp),
        values=values,
        alpha=0.0,
    )


def fit_keypoint_skeleton(trajectories: Trajectories, limbs: Limbs) -> tuple[Skeleton, Motion]:
    """Give the bones between keypoints constant shapes, and pose them in every frame.

    Parameters
    ----------
    trajectories : Trajectories
        Keypoints.
    limbs : Limbs
        From `find_keypoint_limbs`.

    Raises
    ------
    InputError
        If the limbs are others.
    """
    bones = _bones_of(trajectories, limbs)
    posed = pose_bones(trajectories.positions, bones)
    offsets = np.full((trajectories.n_markers, 3), np.nan)
    for bone in range(len(bones.points)):
        own = bones.own_points(bone)
        offsets[own] = posed.offsets[bone][-len(own) :]
    limb = limbs.limb_of_marker
    at = posed.poses[:, limb]
    carried = np.einsum("fpij,pj->fpi", at[..., :3, :3], offsets) + at[..., :3, 3]
    carried[:, limb < 0] = np.nan
    residuals = np.linalg.norm(trajectories.positions - carried, axis=2)
    reference = np.tile(np.eye(4), (len(bones.points), 1, 1))
    reference[:, :3, 3] = posed.poses[posed.reference, :, :3, 3]
    children = joint_children(bones.parents)
    spread = np.sqrt(np.nan_to_num(mean_of_known(residuals**2)) / 3.0)
    skeleton = Skeleton(
        parents=bones.parents,
        joints=tuple(_joint(bones, posed, int(child), spread, trajectories.n_frames) for child in children),
        limb_of_marker=limb,
        marker_offsets=offsets,
        marker_std=np.where(limb < 0, np.nan, spread),
        reference_pose=reference,
    )
    motion = Motion(
        world_from_limb=posed.poses,
        joint_positions=posed.poses[:, children][..., :3, 3],
        marker_positions=carried,
        residuals=residuals,
        limb_seen=posed.posed,
        rate=trajectories.rate,
        compute_angles=MotionAngles(skeleton, trajectories.positions),
    )
    return skeleton, motion


def _bones_of(trajectories: Trajectories, limbs: Limbs) -> Bones:
    """Return the bones that limbs were made of."""
    bones = find_bones(trajectories, limbs.markers_of(0).tolist())
    if not np.array_equal(bones.bone_of_point, limbs.limb_of_marker):
        name = trajectories.name or "the take"
        what = "limbs of keypoints are the bones between them and cannot be changed; run the stage limbs again"
        raise InputError(f"{name}: {what}, or read the points as markers (`--points markers`)")
    return bones


def _variance(bones: Bones, bone: int) -> float:
    """Mean variance of a bone's lengths from the point in which it begins [mm^2]."""
    begin, *own = bones.points[bone].tolist()
    return float(np.mean((_SIGMA_PER_QUARTILES * bones.ranges[begin, own]) ** 2))


def _joint(bones: Bones, posed: PosedBones, child: int, spread: Floats, n_frames: int) -> Joint:
    parent, begin = int(bones.parents[child]), int(bones.points[child][0])
    place = posed.offsets[parent][np.flatnonzero(bones.points[parent] == begin)[0]]
    std = np.full(3, spread[begin] / np.sqrt(max(n_frames, 1)))
    return Joint(parent, child, place, np.zeros(3), "ball", None, std)
