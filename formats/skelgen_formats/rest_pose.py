"""The pose in which bones rest: the skeleton's reference, the first frame, or a T or an A of a person.

Trunk and head stand upright and face along the axis on which animation programs see a face (z where y is up, -y where z
is), legs hang, knees and elbows bend in the planes in which they bend in the take. Arms are held aside (T) or halfway
down (A), elbows bending forward. Heads, hands and feet keep their mean rotation to what carries them. The motion stays.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from skelgen.geometry.rotations import nearest_rotation, unit_vectors
from skelgen.model import Motion, Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen_formats.bones import bone_end
from skelgen_formats.options import A_POSE, FIRST_FRAME, REFERENCE, T_POSE, Writable

_LEG, _ARM = ("thigh", "shank", "foot"), ("upper arm", "forearm", "hand")
_SIDES = ("left", "right")
_FACING = {1: 2, 2: 1, 0: 1}  # which axis faces where which is up
_STRAIGHT = 0.2  # how much the hips' direction counts beside that about which a knee or an elbow bends


def with_rest_pose(value: Writable, rest: str) -> Writable:
    """Return a project whose bones rest in another pose; values that are no finished project stay as they are.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What will be written.
    rest : str
        One of the choices of `REST`; who is no person keeps the reference instead of a T or an A.
    """
    if rest == REFERENCE or not isinstance(value, Project) or not value.has("skeleton") or not value.motion.n_frames:
        return value
    if rest == FIRST_FRAME:
        rotations = value.motion.rotations[0]
    elif not is_person(value.skeleton):
        return value
    else:
        rotations = _standing(value, rest)
    pose = _posed(value.skeleton, rotations)
    if rest != FIRST_FRAME:
        pose[:, :3, 3] -= _ground(value, pose)
    return value.with_skeleton(replace(value.skeleton, reference_pose=pose), value.motion, value.reports["skeleton"])


def is_person(skeleton: Skeleton) -> bool:
    """Whether limbs are called as those of a person, with both sides of arms and legs."""
    wanted = {f"{side} {segment}" for side in _SIDES for segment in (*_LEG[:2], *_ARM[:1])}
    return wanted <= set(skeleton.limb_names)


def remarks_on_rest(project: Project, rest: str) -> tuple[str, ...]:
    """Say that a pose at rest is not the one that was wanted.

    Parameters
    ----------
    project : Project
        Finished.
    rest : str
        One of the choices of `REST`.
    """
    if rest not in (T_POSE, A_POSE) or is_person(project.skeleton):
        return ()
    if len(project.skeleton.bodies) > 1:
        return (f"Bones rest in the reference pose: a {rest} is that of one body in a file of its own.",)
    why = "the limbs are not known as those of a person with left and right"
    return (f"Bones rest in the reference pose: {why}, so that there is no {rest} (name them with --names).",)


@dataclass(frozen=True, eq=False)
class _Axes:
    """Where the world's up, forward and left are, each of shape (3,)."""

    up: Floats
    forward: Floats
    left: Floats


def _standing(project: Project, rest: str) -> Floats:
    """Rotations of all limbs in a T or an A, shape (n_limbs, 3, 3)."""
    skeleton, motion = project.skeleton, project.motion
    joints = _joint_places(skeleton, motion)
    hips, shoulders = ([joints[side, segment] for side in _SIDES] for segment in ("thigh", "upper arm"))
    trunk = (shoulders[0] + shoulders[1] - hips[0] - hips[1]) / 2
    axes = _world(trunk)
    lefts = {"pelvis": hips[0] - hips[1], "abdomen": hips[0] - hips[1], "chest": shoulders[0] - shoulders[1]}
    wanted = {segment: ((trunk, axes.up), (left, axes.left)) for segment, left in lefts.items()}
    for side, outward in zip(_SIDES, (axes.left, -axes.left), strict=True):
        held = outward if rest == T_POSE else (outward - axes.up) / np.sqrt(2.0)
        for chain, along, bends in ((_LEG, -axes.up, axes.left), (_ARM, held, np.cross(held, axes.forward))):
            ways = [unit_vectors(joints[side, after] - joints[side, before]) for before, after in pairwise(chain)]
            turning = np.cross(ways[0], ways[1])
            if chain is _LEG:
                turning = turning + _STRAIGHT * unit_vectors(hips[0] - hips[1])
            for segment, way in zip(chain[:2], ways, strict=True):
                wanted[f"{side} {segment}"] = ((way, along), (turning, bends))
    return _turned(skeleton, motion, wanted)


_Aims = Mapping[str, tuple[tuple[Floats, Floats], tuple[Floats, Floats]]]


def _turned(skeleton: Skeleton, motion: Motion, wanted: _Aims) -> Floats:
    """Rotations in which two directions of each segment that is wanted point where they should, the first exactly."""
    rotations = np.tile(np.eye(3), (skeleton.n_limbs, 1, 1))
    for limb in skeleton.outward.tolist():
        segment = _segment(skeleton, limb)
        own = motion.rotations[:, limb]
        if segment in wanted:
            (first, to_first), (second, to_second) = wanted[segment]
            means = [np.einsum("fji,fj->i", own, vectors) for vectors in (unit_vectors(first), second)]
            rotations[limb] = _frame(to_first, to_second) @ _frame(*means).T
        elif skeleton.parents[limb] >= 0:
            parent = int(skeleton.parents[limb])
            mean = np.einsum("fji,fjk->ik", motion.rotations[:, parent], own)
            rotations[limb] = rotations[parent] @ nearest_rotation(mean)
    return rotations


def _frame(first: Floats, second: Floats) -> Floats:
    """Axes, as columns, of which the first is along one vector and the second as near to another as can be."""
    one = unit_vectors(first)
    other = unit_vectors(second - (second @ one) * one)
    return np.stack([one, other, np.cross(one, other)], axis=1)


def _joint_places(skeleton: Skeleton, motion: Motion) -> dict[tuple[str, str], Floats]:
    """Where each segment of arms and legs begins, and where the last one ends, by side and segment, (n_frames, 3)."""
    places: dict[tuple[str, str], Floats] = {}
    for side in _SIDES:
        for chain in (_LEG, _ARM):
            for number, segment in enumerate(chain):
                later = {f"{side} {name}" for name in chain[number:]}
                for index, joint in enumerate(skeleton.joints):
                    ends = {_segment(skeleton, joint.parent), _segment(skeleton, joint.child)}
                    if f"{side} {segment}" in ends and len(ends & later) == 1:
                        places.setdefault((side, segment), motion.joint_positions[:, index])
                if (side, segment) not in places:  # one that has no limb: where the limb before it ends
                    limb = skeleton.limb_names.index(f"{side} {chain[number - 1]}")
                    pose = motion.world_from_limb[:, limb]
                    places[side, segment] = pose[:, :3, 3] + pose[:, :3, :3] @ bone_end(skeleton, limb)
    return places


def _segment(skeleton: Skeleton, limb: int) -> str:
    """Name of a limb without the number that tells pieces of one segment apart."""
    return skeleton.limb_names[limb].rstrip("0123456789 ")


def _world(trunk: Floats) -> _Axes:
    """Up is the axis of the world that the trunk points along; faces look along the axis that programs expect."""
    mean = unit_vectors(trunk).mean(axis=0)
    axis = int(np.abs(mean).argmax())
    up = np.eye(3)[axis] * (1.0 if mean[axis] > 0 else -1.0)
    forward = np.eye(3)[_FACING[axis]] * (-1.0 if axis == 2 else 1.0)
    return _Axes(up, forward, np.cross(up, forward))


def _posed(skeleton: Skeleton, rotations: Floats) -> Floats:
    """Poses of all limbs with these rotations, joints closed and roots where they are, shape (n_limbs, 4, 4)."""
    pose = skeleton.reference_pose.copy()
    pose[:, :3, :3] = rotations
    for joint in skeleton.joints:  # from the roots outward
        place = pose[joint.parent, :3, 3] + rotations[joint.parent] @ joint.position_in_parent
        pose[joint.child, :3, 3] = place - rotations[joint.child] @ joint.position_in_child
    return pose


def _ground(project: Project, pose: Floats) -> Floats:
    """The point of the ground below the root: as high as the lowest marker, shape (3,)."""
    skeleton = project.skeleton
    carried = skeleton.limb_of_marker >= 0
    limbs = skeleton.limb_of_marker[carried]
    places = (pose[limbs, :3, :3] @ skeleton.marker_offsets[carried, :, np.newaxis])[..., 0] + pose[limbs, :3, 3]
    joints = _joint_places(skeleton, project.motion)
    hips, shoulders = (joints["left", segment] + joints["right", segment] for segment in ("thigh", "upper arm"))
    up = _world(shoulders - hips).up
    root = pose[int(skeleton.roots[0]), :3, 3]
    return np.asarray(root - (root @ up) * up + (places @ up).min() * up)
