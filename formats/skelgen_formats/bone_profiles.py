"""Bones called as other programs call those of a person; limbs that such a profile lacks are left out.

The skeleton may be hung on another of its limbs: motion stays, joints on the way between both roots are turned round.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise

import numpy as np

from skelgen.errors import WriteError
from skelgen.model import Joint, Motion, Project, Skeleton
from skelgen.model.arrays import Floats, Ints
from skelgen.model.limbs import BODY_END, body_and_limb
from skelgen.model.topology import joint_children
from skelgen_formats.options import OWN_NAMES, Writable
from skelgen_formats.text import words_of

_SIDES = ("left", "right")
_HIPS = "pelvis"  # the root of every profile
_profiles = partial(words_of, "bone_names")


def with_bone_names(value: Writable, profile: str) -> Writable:
    """Return a project whose limbs are called as a profile calls them, without those that it lacks.

    The pelvis becomes the root. Joints keep their names. Limbs that the profile has no name for are left out from the
    tips inward; one that carries a bone of the profile stays with its own name. Values that are no finished project
    stay as they are.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What will be written.
    profile : str
        One of the choices of `BONE_NAMES`.

    Raises
    ------
    WriteError
        If no limb is known as one of a person.
    """
    if profile == OWN_NAMES or not isinstance(value, Project) or not value.has("skeleton"):
        return value
    skeleton = value.skeleton
    names = _profile_names(skeleton, profile)
    if not names:
        raise WriteError(
            f"no limb is known as one of a person, so that none has a name of {_profiles()[profile]['title']}; name "
            "them first: skelgen run --marker-set or --names"
        )
    value = _hung(value)
    skeleton = value.skeleton
    kept = _kept(skeleton, names)
    called = tuple(names.get(limb, skeleton.limb_names[limb]) for limb in range(skeleton.n_limbs))
    joints = tuple(replace(joint, name=skeleton.joint_name(joint)) for joint in skeleton.joints)
    loops = tuple(replace(loop, name=skeleton.joint_name(loop)) for loop in skeleton.loops)
    named = _of_limbs(value, replace(skeleton, limb_names=called, joints=joints, loops=loops), kept)
    root = _profiles()[profile].get("root")
    return named if root is None else _on_still_root(named, str(root))


def is_segment(name: str) -> bool:
    """Return whether a limb of this name is a segment of a person for which some profile has a bone."""
    side, segment = _side_and_segment(body_and_limb(name)[1])
    patterns = [profile["names"].get(segment) for profile in _profiles().values()]
    return any(pattern is not None and ("{}" in pattern) == bool(side) for pattern in patterns)


def remarks_on_bone_names(project: Project, profile: str) -> tuple[str, ...]:
    """Say which limbs a profile leaves out, and what its users will miss.

    Parameters
    ----------
    project : Project
        Finished.
    profile : str
        One of the choices of `BONE_NAMES`.
    """
    if profile == OWN_NAMES:
        return ()
    title = str(_profiles()[profile]["title"])
    hung = _hung(project)
    skeleton = hung.skeleton
    names = _profile_names(skeleton, profile)
    kept = set(_kept(skeleton, names).tolist())
    lost = [skeleton.limb_names[limb] for limb in range(skeleton.n_limbs) if limb not in kept]
    odd = [skeleton.limb_names[limb] for limb in sorted(kept) if limb not in names]
    remarks = [f"{title} has no bone for {', '.join(lost)}: left out."] if lost else []
    remarks += [f"{title} has no bone for {', '.join(odd)}, which carry others: kept by their names."] if odd else []
    if names and hung is not project:
        remarks.append(f"{title} has the pelvis as root: the bones hang on it.")
    if names and "root" in _profiles()[profile]:
        remarks.append(f"{title} has a bone {_profiles()[profile]['root']!r} below all: it stays at the origin.")
    return tuple(remarks)


def _hung(project: Project) -> Project:
    """The project with the pelvis of each body that has one as its root."""
    names = project.skeleton.limb_names
    for limbs in project.skeleton.bodies:
        hips = next((limb for limb in limbs.tolist() if body_and_limb(names[limb])[1] == _HIPS), None)
        project = project if hips is None else rooted_at(project, hips)
    return project


def _profile_names(skeleton: Skeleton, profile: str) -> dict[int, str]:
    """The profile's name of each limb that it has a bone for, after that of its body if the limb's begins so."""
    table = _profiles()[profile]
    found = {}
    for limb, name in enumerate(skeleton.limb_names):
        body, own = body_and_limb(name)
        begin = body and body + BODY_END
        side, segment = _side_and_segment(own)
        pattern = table["names"].get(segment)
        if segment == "chest" and f"{begin}abdomen" not in skeleton.limb_names:
            pattern = table["trunk"]
        if pattern is not None and ("{}" in pattern) == bool(side):
            found[limb] = begin + str(pattern).format(table.get(side, ""))
    return found


def _side_and_segment(name: str) -> tuple[str, str]:
    side = next((side for side in _SIDES if name.startswith(f"{side} ")), "")
    return side, name.removeprefix(f"{side} ")


def _kept(skeleton: Skeleton, names: Mapping[int, str]) -> Ints:
    """Limbs that have a name or carry one that has, shape (n_kept,), rising."""
    carries = np.isin(np.arange(skeleton.n_limbs), list(names))
    for limb in skeleton.outward[::-1].tolist():
        if carries[limb] and skeleton.parents[limb] >= 0:
            carries[skeleton.parents[limb]] = True
    return np.flatnonzero(carries)


def _of_limbs(project: Project, skeleton: Skeleton, kept: Ints) -> Project:
    """The project with some of its limbs alone; markers of the others are left out."""
    new = np.full(skeleton.n_limbs + 1, -1)
    new[kept] = np.arange(len(kept))  # the last entry says that none stays none
    parents = new[skeleton.parents[kept]]
    above = {int(new[joint.child]): index for index, joint in enumerate(skeleton.joints)}
    joints = [above[child] for child in joint_children(parents).tolist()]
    limb_of_marker = new[skeleton.limb_of_marker]
    gone = (limb_of_marker < 0)[:, np.newaxis]

    def renumbered(joint: Joint) -> Joint:
        return replace(joint, parent=int(new[joint.parent]), child=int(new[joint.child]))

    reduced = replace(
        skeleton,
        parents=parents,
        joints=tuple(renumbered(skeleton.joints[index]) for index in joints),
        limb_of_marker=limb_of_marker,
        marker_offsets=np.where(gone, np.nan, skeleton.marker_offsets),
        reference_pose=skeleton.reference_pose[kept],
        length_std=None,
        loops=tuple(renumbered(loop) for loop in skeleton.loops if min(new[loop.parent], new[loop.child]) >= 0),
        limb_names=tuple(skeleton.limb_names[limb] for limb in kept.tolist()),
    )
    motion = project.motion
    moved = Motion(
        motion.world_from_limb[:, kept],
        motion.joint_positions[:, joints],
        np.where(gone, np.nan, motion.marker_positions),
        np.where(gone[:, 0], np.nan, motion.residuals),
        motion.limb_seen[:, kept],
        motion.rate,
        None if motion.joint_std is None else motion.joint_std[:, joints],
    )
    return project.with_skeleton(reduced, moved, project.reports["skeleton"])


def _on_still_root(project: Project, name: str) -> Project:
    """The project with one limb more, at the origin of the world, that stays still and carries all roots."""
    skeleton, motion = project.skeleton, project.motion
    root, roots = skeleton.n_limbs, skeleton.roots
    parents = skeleton.parents.copy()
    parents[roots] = root
    joints = [
        Joint(root, int(limb), skeleton.reference_pose[limb, :3, 3], np.zeros(3), "undetermined", None, np.zeros(3))
        for limb in roots
    ]
    children = joint_children(np.append(parents, -1)).tolist()
    places = dict(zip((joint.child for joint in (*skeleton.joints, *joints)), (*skeleton.joints, *joints), strict=True))
    columns = {joint.child: motion.joint_positions[:, index] for index, joint in enumerate(skeleton.joints)}
    columns |= {int(limb): motion.world_from_limb[:, limb, :3, 3] for limb in roots}
    still = np.broadcast_to(np.eye(4), (motion.n_frames, 1, 4, 4))
    carried = replace(
        skeleton,
        parents=np.append(parents, -1),
        joints=tuple(places[child] for child in children),
        reference_pose=np.concatenate([skeleton.reference_pose, np.eye(4)[np.newaxis]]),
        length_std=None,
        limb_names=(*skeleton.limb_names, name),
    )
    moved = replace(
        motion,
        world_from_limb=np.concatenate([motion.world_from_limb, still], axis=1),
        joint_positions=np.stack([columns[child] for child in children], axis=1),
        limb_seen=np.concatenate([motion.limb_seen, np.ones((motion.n_frames, 1), dtype=bool)], axis=1),
        joint_std=None,
    )
    return project.with_skeleton(carried, moved, project.reports["skeleton"])


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
