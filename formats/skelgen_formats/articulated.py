"""A skeleton as bodies that turn about axes one after the other, which is how programs for robots and muscles pose it.

A joint is written as its type only if the motion keeps to it, as bearings do. The fit lets joints that wobble turn
freely, however clearly they are hinges; knees would lose centimetres of the motion as hinges, so they become balls
unless the user wants the types.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from xml.etree.ElementTree import Comment, Element

import numpy as np

from skelgen.geometry.rotations import (
    euler_angles,
    gimbal_distance,
    matrix_from_vector,
    transform_from,
    vector_from_matrix,
)
from skelgen.geometry.standing import fixed_limbs
from skelgen.model import Joint, Project, Skeleton
from skelgen.model.arrays import Floats
from skelgen_formats.bones import bone_names, parent_from_child, plain_names
from skelgen_formats.options import AS_FOUND, AS_MOVED, JOINTS, Options
from skelgen_formats.writing import choices_in
from skelgen_formats.xml_text import comment_text

_HELD = float(np.deg2rad(0.1))  # frames between recorded ones leave universal joints by less
_PLAY, _WIDE = 0.025, np.pi / 2
"""Part of a joint's turns, up to a right angle, by which bearings may leave its type; knees leave it by 8 %."""

ANGLE_MARGIN, PLACE_MARGIN = float(np.deg2rad(5.0)), 0.1
"""Least margins of the ranges of angles [rad] and places [m]."""

_MARGIN = 0.1  # of a range, beyond what was seen at either end
_NEAR_GIMBAL = np.deg2rad(10.0)  # there, angles change six times as fast as the rotation
_SHORTEST_BONE = 1.0  # mm; what is shorter has no direction that anyone could see
_MOVED = 1e-3  # mm; less is the rounding of poses that are kept
_ANGLE_NAMES = {"hinge": ("turn",), "universal": ("first", "second"), "rigid": ()}


@dataclass(frozen=True, eq=False)
class Link:
    """A limb with the joint above it.

    Attributes
    ----------
    limb, parent : int
        Limb indices; a parent of -1 is the world.
    name, parent_name : str
        Names of the limb and of that above, such as ``limb1``; the parent of a root is ``world``.
    joint : str
        Name of the joint, such as ``limb0-limb1``; that of a root is ``world-limb0``.
    kind : str
        ``free`` for a root, or ``rigid`` if it is fixed in the room; else ``ball``, ``universal``, ``hinge`` or
        ``rigid``.
    place : ndarray, shape (3,), mm
        The joint in the parent's frame, where the limb's own frame begins; of a root, its place in the reference pose.
    axes : ndarray, shape (n_angles, 3)
        Unit vectors in the limb's frame: each is turned by the turns before it.
    angles : ndarray, shape (n_frames, n_angles), rad
        Right-handed, 0 in the reference pose, without jumps of a full turn.
    translations : ndarray, shape (n_frames, 3), mm
        Of the limb's frame in the parent's; `place` in every frame but for free roots.
    rotations : ndarray, shape (n_frames, 3, 3)
        Of the limb against its parent.
    """

    limb: int
    parent: int
    name: str
    parent_name: str
    joint: str
    kind: str
    place: Floats
    axes: Floats
    angles: Floats
    translations: Floats
    rotations: Floats

    @property
    def turn(self) -> Floats:
        """Limb from body, shape (3, 3): robots turn about z, so the body of a hinge has its (last) axis there."""
        return rotation_of_z_to(self.axes[-1]) if self.kind in {"hinge", "universal"} else np.eye(3)

    @property
    def rest(self) -> Floats:
        """Parent from limb without any turns, shape (3, 3): upright, but for a root that is fixed in the room."""
        return self.rotations[0] if self.kind == "rigid" else np.eye(3)

    @property
    def angle_names(self) -> tuple[str, ...]:
        """Name of each angle: of the joint, and ``turn``, ``first``, ``second``, or ``rx``, ``ry``, ``rz``."""
        return tuple(f"{self.joint}_{name}" for name in _ANGLE_NAMES.get(self.kind, ("rx", "ry", "rz")))


def links_of(project: Project, joints: str) -> tuple[Link, ...]:
    """Return all limbs from the roots outward, posed as near to the motion as joints that keep their types can be.

    Parameters
    ----------
    project : Project
        From `skelgen_formats.options.moving_project`.
    joints : str
        A choice of `JOINTS`.
    """
    world, fixed = project.motion.world_from_limb, _fixed_roots(project)
    links = _links(project.skeleton, world, joints, ())
    moved = _moved_markers(project.skeleton, world, links)
    if moved <= _MOVED and not fixed:
        return links
    from skelgen.kinematics.inverse.inverse_kinematics import hold_joints  # noqa: PLC0415 - scipy is slow to load

    freed = {link.limb for link in links if link.kind == "ball"}
    kinds = tuple(
        replace(joint, kind="ball", axis=None, axis_std=None, second_axis=None, second_axis_std=None)
        if joint.child in freed
        else joint
        for joint in project.skeleton.joints
    )
    skeleton = replace(project.skeleton, joints=kinds)
    held = _links(skeleton, hold_joints(skeleton, _at_rest(world, fixed), fixed), AS_FOUND, fixed)
    return held if fixed or _moved_markers(skeleton, world, held) < moved else links


def posed(links: Sequence[Link]) -> Floats:
    """Return where a reader of the links puts the limbs: world_from_limb [mm], shape (n_frames, n_limbs, 4, 4)."""
    poses = np.tile(np.eye(4), (len(links[0].angles), len(links), 1, 1))
    for link in links:
        own = transform_from(link.rest @ _turned(link.axes, link.angles), link.translations)
        poses[:, link.limb] = own if link.parent < 0 else poses[:, link.parent] @ own
    return poses


def add_choices(document: Element, project: Project) -> None:
    """Say in comments what limbs and joints are called that the file must call otherwise, and which joints are choices.

    Parameters
    ----------
    document : Element
        Root of the file.
    project : Project
        Finished.
    """
    skeleton = project.skeleton
    pairs = [*zip(bone_names(skeleton), skeleton.limb_names, strict=True)]
    pairs += zip(plain_names(skeleton.joint_names), skeleton.joint_names, strict=True)
    called = [f"{plain} is {own!r}" for plain, own in pairs if own not in {plain, plain.replace("_", " ")}]
    for sentence in (*called, *choices_in(project)):
        document.append(Comment(comment_text(sentence)))


def markers_on(project: Project, limb: int) -> list[tuple[int, Floats]]:
    """Return the markers of a limb: index, and place in its frame [mm].

    Parameters
    ----------
    project : Project
        Finished.
    limb : int
        Limb index.
    """
    skeleton = project.skeleton
    return [(marker, skeleton.marker_offsets[marker]) for marker in skeleton.markers_of(limb).tolist()]


def bones_of(project: Project, link: Link) -> list[Floats]:
    """Return where the bones of a limb end, in its frame [mm]: at its children's joints, or amid its markers.

    Parameters
    ----------
    project : Project
        Finished.
    link : Link
        The limb.
    """
    skeleton = project.skeleton
    ends = [joint.position_in_parent for joint in skeleton.joints if joint.parent == link.limb]
    if not ends and len(skeleton.markers_of(link.limb)):
        ends = [skeleton.marker_offsets[skeleton.markers_of(link.limb)].mean(axis=0)]
    return [end for end in ends if np.linalg.norm(end) > _SHORTEST_BONE]


def range_of(values: Floats, rest: float, least: float) -> tuple[float, float]:
    """Return the range of a coordinate: what the motion and the pose at rest need, and a margin.

    Parameters
    ----------
    values : ndarray, shape (n_frames,), rad or m
        The coordinate in the motion.
    rest : float, rad or m
        Its value at rest.
    least : float, rad or m
        The margin, unless a tenth of the range is more.
    """
    low, high = min(float(values.min()), rest), max(float(values.max()), rest)
    margin = max(least, _MARGIN * (high - low))
    return low - margin, high + margin


def turns_fully(angles: Floats) -> bool:
    """Whether a coordinate [rad] goes through a full turn, as that of a wheel does: such a joint has no limits."""
    return bool(np.ptp(angles) >= 2 * np.pi)


def rotation_of_z_to(direction: Floats) -> Floats:
    """Return the rotation, shape (3, 3), by the smallest angle that turns z to a direction of any length but zero."""
    turn = np.cross([0.0, 0.0, 1.0], direction)
    sine = float(np.linalg.norm(turn))
    about = turn / sine if sine > 0 else np.array([1.0, 0.0, 0.0])
    return matrix_from_vector(about * np.arctan2(sine, direction[2]))


def remarks_on_joints(project: Project, options: Options, *, by_three_angles: bool) -> tuple[str, ...]:
    """Say what becomes of joints that wobble, of closed loops, and of balls near the gimbal position.

    Parameters
    ----------
    project : Project
        What will be written.
    options : Options
        With the choice of joints.
    by_three_angles : bool
        Whether the format turns balls by three angles.
    """
    links = links_of(project, options.joints)
    remarks = [*_on_wobble(project, links)]
    if project.skeleton.loops:
        remarks.append("Joints that close loops are left out; the motion keeps the loops closed all the same.")
    by_angles = [link for link in links if link.kind in {"ball", "free"}]
    near = [link.joint for link in by_angles if (gimbal_distance(link.angles) < _NEAR_GIMBAL).any()]
    if by_three_angles and near:
        remarks.append(f"Near the gimbal position, where poses are right but angles turn fast, come {', '.join(near)}.")
    return tuple(remarks)


def _fixed_roots(project: Project) -> list[int]:
    """Roots that are fixed in the room, as the bases of most machines are."""
    skeleton, positions = project.skeleton, project.trajectories.positions
    markers = [positions[:, skeleton.markers_of(limb)] for limb in range(skeleton.n_limbs)]
    return [limb for limb in fixed_limbs(markers, skeleton.parents) if skeleton.parents[limb] < 0]


def _at_rest(world: Floats, fixed: Sequence[int]) -> Floats:
    """Poses of limbs, those of fixed ones in all frames as in the mean."""
    world = world.copy()
    for limb in fixed:
        mean = vector_from_matrix(world[:, limb, :3, :3]).mean(axis=0)
        world[:, limb] = transform_from(matrix_from_vector(mean), world[:, limb, :3, 3].mean(axis=0))
    return world


def _links(skeleton: Skeleton, world: Floats, joints: str, fixed: Sequence[int]) -> tuple[Link, ...]:
    called = plain_names(skeleton.joint_names)
    above = {joint.child: (joint, name) for joint, name in zip(skeleton.joints, called, strict=True)}
    bones = bone_names(skeleton)
    return tuple(
        _link(*above[limb], bones, world, joints)
        if limb in above
        else _root(skeleton, limb, bones[limb], world, limb in fixed)
        for limb in skeleton.outward.tolist()
    )


def _root(skeleton: Skeleton, limb: int, name: str, world: Floats, is_fixed: bool) -> Link:
    poses, named = world[:, limb], (name, "world", f"world-{name}")
    places, rotations = poses[:, :3, 3], poses[:, :3, :3]
    if is_fixed:
        return Link(limb, -1, *named, "rigid", places[0], np.zeros((0, 3)), rotations[:, 0, :0], places, rotations)
    place, angles = skeleton.reference_pose[limb, :3, 3], euler_angles("XYZ", rotations)
    return Link(limb, -1, *named, "free", place, np.eye(3), angles, places, rotations)


def _link(joint: Joint, name: str, bones: Sequence[str], world: Floats, joints: str) -> Link:
    _, rotations = parent_from_child(world[:, joint.parent], world[:, joint.child])
    kind, axes, angles = _by_kind(joint, rotations)
    if joints == AS_MOVED and _departure(axes, angles, rotations) > _play(angles):
        kind, axes, angles = "ball", np.eye(3), euler_angles("XYZ", rotations)
    place = joint.position_in_parent
    translations = np.broadcast_to(place, (len(world), 3))
    named = (bones[joint.child], bones[joint.parent], name)
    return Link(joint.child, joint.parent, *named, kind, place, axes, angles, translations, _turned(axes, angles))


def _by_kind(joint: Joint, rotations: Floats) -> tuple[str, Floats, Floats]:
    from skelgen.kinematics.joints.angles import angle_names, continued, joint_angles  # noqa: PLC0415 - scipy is slow to load

    if len(angle_names(joint)) == 3:  # also a kind without its axes
        return "ball", np.eye(3), euler_angles("XYZ", rotations)
    axes = [axis for axis in (joint.axis, joint.second_axis) if axis is not None]
    angles = continued(joint, joint_angles(joint, rotations))
    return joint.kind, np.array(axes[: angles.shape[1]]).reshape(-1, 3), angles


def _turned(axes: Floats, angles: Floats) -> Floats:
    """Turns about axes one after the other, shape (n_frames, 3, 3)."""
    rotations = np.tile(np.eye(3), (len(angles), 1, 1))
    for axis, angle in zip(axes, angles.T, strict=True):
        rotations = rotations @ matrix_from_vector(angle[:, np.newaxis] * axis)
    return rotations


def _play(angles: Floats) -> float:
    """How far [rad] a joint with these turns may leave its type."""
    turns = float(np.ptp(angles, axis=0).min()) if angles.size else 0.0
    return max(_HELD, _PLAY * min(_WIDE, turns))


def _departure(axes: Floats, angles: Floats, rotations: Floats) -> float:
    """Largest angle [rad] between rotations and what a joint makes of them."""
    apart = vector_from_matrix(_turned(axes, angles).swapaxes(1, 2) @ rotations)
    return float(np.linalg.norm(apart, axis=1).max())


def _on_wobble(project: Project, links: Sequence[Link]) -> Iterator[str]:
    fixed = [link.name for link in links if link.parent < 0 and link.kind == "rigid"]
    moved = _moved_markers(project.skeleton, project.motion.world_from_limb, links)
    if fixed:
        yield f"What stands still in the room is fixed there: {', '.join(fixed)}."
    if moved > _MOVED:
        yield f"Joints kept to their kinds{' and what is fixed' if fixed else ''} move markers by up to {moved:.3g} mm."
    found = {joint.child: joint.kind for joint in project.skeleton.joints}
    freed = [link.joint for link in links if link.kind == "ball" and found[link.limb] not in {"ball", "undetermined"}]
    if freed:
        yield (
            f"These joints wobble and are written as balls, so that the motion stays as it is: {', '.join(freed)}; with"
            f" {JOINTS.name}={AS_FOUND} they are of the types found."
        )


def _moved_markers(skeleton: Skeleton, world: Floats, links: Sequence[Link]) -> float:
    """How far [mm] the farthest marker comes to lie from where these poses of limbs have it."""
    used = np.flatnonzero(skeleton.limb_of_marker >= 0)
    apart = (posed(links) - world)[:, skeleton.limb_of_marker[used]]
    moved = (apart[..., :3, :3] @ skeleton.marker_offsets[used, :, np.newaxis])[..., 0] + apart[..., :3, 3]
    return float(np.linalg.norm(moved, axis=2).max(initial=0.0))
