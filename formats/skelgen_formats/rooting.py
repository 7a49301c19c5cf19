"""A skeleton hung on another of its limbs: motion stays, joints on the way between both roots are turned round."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from skelgen.model import Joint, Project
from skelgen.model.arrays import Floats
from skelgen.model.topology import joint_children


def rooted_at(project: Project, limb: int) -> Project:
    """Return a finished project whose tree hangs on a limb; the frames of limbs on the way begin at their new parents.

    Parameters
    ----------
    project : Project
        Finished.
    limb : int
        The new root of its tree.
    """
    skeleton, motion = project.skeleton, project.motion
    way = [limb]
    while skeleton.parents[way[-1]] >= 0:
        way.append(int(skeleton.parents[way[-1]]))
    if len(way) == 1:
        return project
    above = {joint.child: joint for joint in skeleton.joints}
    shifts = np.zeros((skeleton.n_limbs, 3))  # mm, of the origins in the limbs' frames
    markers = skeleton.markers_of(limb)
    shifts[limb] = skeleton.marker_offsets[markers].mean(axis=0) if len(markers) else 0.0
    parents = np.array(skeleton.parents)
    parents[limb] = -1
    for child, parent in pairwise(way):
        parents[parent], shifts[parent] = child, above[child].position_in_parent
    turned = {frozenset(pair) for pair in pairwise(way)}
    number_of = {frozenset((joint.parent, joint.child)): number for number, joint in enumerate(skeleton.joints)}
    order = [number_of[frozenset((child, int(parents[child])))] for child in joint_children(parents).tolist()]
    joints = [_moved(skeleton.joints[number], shifts) for number in order]
    carried = skeleton.limb_of_marker >= 0
    offsets = np.where(carried[:, np.newaxis], skeleton.marker_offsets - shifts[skeleton.limb_of_marker], np.nan)
    hung = replace(
        skeleton,
        parents=parents,
        joints=tuple(_reversed(one) if frozenset((one.parent, one.child)) in turned else one for one in joints),
        loops=tuple(_moved(loop, shifts) for loop in skeleton.loops),
        marker_offsets=offsets,
        reference_pose=_shifted(skeleton.reference_pose, shifts),
        length_std=None,
    )
    moved = replace(
        motion,
        world_from_limb=_shifted(motion.world_from_limb, shifts),
        joint_positions=motion.joint_positions[:, order],
        joint_std=None if motion.joint_std is None else motion.joint_std[:, order],
        compute_angles=None,
    )
    return project.with_skeleton(hung, moved, project.reports["skeleton"])


def _moved(joint: Joint, shifts: Floats) -> Joint:
    """A joint of limbs whose origins are shifted."""
    in_parent = joint.position_in_parent - shifts[joint.parent]
    return replace(joint, position_in_parent=in_parent, position_in_child=joint.position_in_child - shifts[joint.child])


def _reversed(joint: Joint) -> Joint:
    """A joint whose child is the parent."""
    is_universal = joint.second_axis is not None
    known = joint.covariance_in_child
    return replace(
        joint,
        parent=joint.child,
        child=joint.parent,
        position_in_parent=joint.position_in_child,
        position_in_child=joint.position_in_parent,
        axis=joint.second_axis if is_universal else joint.axis,
        second_axis=joint.axis if is_universal else None,
        axis_std=joint.second_axis_std,
        second_axis_std=joint.axis_std,
        covariance=joint.covariance_in_child,
        covariance_in_child=joint.covariance,
        std=joint.std if known is None else np.sqrt(np.maximum(np.diag(known), 0.0)),
    )


def _shifted(poses: Floats, shifts: Floats) -> Floats:
    """Poses, shape (..., n_limbs, 4, 4), of frames whose origins are shifted."""
    moved = poses.copy()
    moved[..., :3, 3] += (poses[..., :3, :3] @ shifts[:, :, np.newaxis])[..., 0]
    return moved
