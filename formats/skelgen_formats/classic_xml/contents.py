"""What the classic XML file holds: as values, and as flat rows of numbers while it is read."""

from __future__ import annotations

from array import array
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from skelgen.errors import FormatError, InputError
from skelgen.model import Joint, Motion, Skeleton, Trajectories
from skelgen.model.arrays import Floats, Ints, check_floats
from skelgen.model.skeleton import joint_between
from skelgen.model.topology import outward_order
from skelgen_formats.bones import matrix_from_xyzw


@dataclass(frozen=True)
class MarkerDistance:
    """How constant the distance between a marker and a joint is over all frames in which both are there.

    Attributes
    ----------
    marker : int
        Marker index.
    mean : float, mm
        Average distance.
    sigma : float, mm
        Standard deviation of the distance.
    """

    marker: int
    mean: float
    sigma: float


@dataclass(frozen=True)
class JointStats:
    """How the minimisation of the joint cost went for one joint: the file's ``StatsElements``.

    Attributes
    ----------
    first_bone, second_bone : int
        Parent and child limb.
    alpha : float
        Weight of the mean distance in the joint cost.
    first, second : tuple of MarkerDistance
        Markers of the parent and of the child; one that is never seen together with the joint is left out.
    n_iterations : int
        Iterations of the minimisation.
    value : float, mm^2
        Joint cost at the solution; NaN if unknown.
    """

    first_bone: int
    second_bone: int
    alpha: float
    first: tuple[MarkerDistance, ...]
    second: tuple[MarkerDistance, ...]
    n_iterations: int
    value: float


@dataclass(frozen=True, eq=False)
class ClassicXml:
    """Everything that a classic XML file holds.

    Attributes
    ----------
    detail : str
        How much the file holds of every frame: ``motion``, ``joints`` or ``all``.
    trajectories : Trajectories
        Tracked positions [mm] with the names of the markers; NaN where unseen, and throughout without them.
    skeleton : Skeleton
        Limbs, joints and markers on the limbs.
    motion : Motion
        Poses, final joint positions and reconstructed markers in every frame.
    bone_translations : ndarray, shape (n_frames, n_limbs, 3), mm
        Translation of each bone relative to its parent, of a root to the world, as in the file.
    bone_rotations_xyzw : ndarray, shape (n_frames, n_limbs, 4)
        Rotation of each bone relative to its parent, of a root to the world, as in the file.
    raw_joint_positions : ndarray, shape (n_frames, n_joints, 3), mm
        Joints before the fit of rigid limbs; NaN where not determined, and throughout without them.
    offsets_from_center : ndarray, shape (n_markers, 3), mm
        Each marker relative to the centre of mass of its limb's markers, along the axes of the limb's frame; NaN for
        markers that are left out.
    centers_of_mass : ndarray, shape (n_limbs, 3), mm
        Centre of mass of each limb's markers in the limb's frame; NaN for a limb without markers.
    joint_stats : tuple of JointStats
        One per joint, in the order of the skeleton's joints.
    """

    trajectories: Trajectories
    skeleton: Skeleton
    motion: Motion
    bone_translations: Floats
    bone_rotations_xyzw: Floats
    raw_joint_positions: Floats
    offsets_from_center: Floats
    centers_of_mass: Floats
    joint_stats: tuple[JointStats, ...]
    detail: str = "all"

    def __post_init__(self) -> None:
        n_frames, n_limbs = self.motion.n_frames, self.skeleton.n_limbs
        n_markers, n_joints = self.trajectories.n_markers, self.skeleton.n_joints
        shapes = {
            "bone_translations": (n_frames, n_limbs, 3),
            "bone_rotations_xyzw": (n_frames, n_limbs, 4),
            "raw_joint_positions": (n_frames, n_joints, 3),
            "offsets_from_center": (n_markers, 3),
            "centers_of_mass": (n_limbs, 3),
        }
        for name, shape in shapes.items():
            object.__setattr__(self, name, check_floats(getattr(self, name), shape, name))
        object.__setattr__(self, "joint_stats", tuple(self.joint_stats))


_Key = TypeVar("_Key", int, tuple[int, int])


@dataclass
class JointFacts:
    """The file's ``JOINT``; numbers as in `skelgen.model.Joint`."""

    kind: str
    open_directions: int
    usual_directions: int
    is_placed_by_marker_set: bool
    position_in_parent: list[float]
    position_in_child: list[float]
    std: list[float]
    axis: list[float] | None
    second_axis: list[float] | None
    deviations: dict[str, list[float]]
    name: str


@dataclass
class Bone:
    """The file's ``BONE``, without what follows from the rest."""

    parent: int
    local_translation: list[float]
    local_rotation: list[float]
    joint: JointFacts | None
    name: str


@dataclass
class Contents:
    """Everything in the file, as it comes: flat rows of numbers by bone, joint and marker."""

    take: str = ""
    detail: str = "all"
    rate: float = 0.0
    names: list[str] = field(default_factory=list)
    bone_of_marker: list[int] = field(default_factory=list)
    stats: list[JointStats] = field(default_factory=list)
    bones: dict[int, Bone] = field(default_factory=dict)
    tracks: dict[int, array[float]] = field(default_factory=dict)
    seen: dict[int, bytearray] = field(default_factory=dict)
    raw_joints: dict[tuple[int, int], array[float]] = field(default_factory=dict)
    final_joints: dict[tuple[int, int], array[float]] = field(default_factory=dict)
    offsets: dict[int, list[float]] = field(default_factory=dict)
    sigmas: dict[int, float] = field(default_factory=dict)
    offset_stds: dict[int, list[float]] = field(default_factory=dict)
    noises: dict[int, float] = field(default_factory=dict)
    centers: dict[int, list[float]] = field(default_factory=dict)
    final_markers: array[float] = field(default_factory=lambda: array("d"))
    tracked_markers: array[float] = field(default_factory=lambda: array("d"))
    n_marker_frames: int = 0

    @property
    def n_frames(self) -> int:
        """Number of frames: as many as have markers, or, without them, keys."""
        if self.detail == "all":
            return self.n_marker_frames
        return max((len(seen) for seen in self.seen.values()), default=0)


def assemble(path: Path, contents: Contents) -> ClassicXml:
    """Build the values from what was read.

    Parameters
    ----------
    path : Path
        The file, for errors.
    contents : Contents
        What was read.

    Raises
    ------
    FormatError
        If parts of the file are missing or contradict each other.
    """
    n_limbs = len(contents.bones)
    if sorted(contents.bones) != list(range(n_limbs)):
        raise FormatError(path, "", f"the {n_limbs} bones must have the ids 0 to {n_limbs - 1}")
    parents = np.array([contents.bones[limb].parent for limb in range(n_limbs)], dtype=np.intp)
    if len(outward_order(parents)) != n_limbs:
        raise FormatError(path, "", "the parents of the bones form no tree: a cycle, or a parent that is no bone")
    children = [int(limb) for limb in outward_order(parents) if parents[limb] >= 0]
    edges = [(int(parents[child]), child) for child in children]
    _check_complete(path, contents, len(parents), edges)
    try:
        with np.errstate(all="ignore"):  # absurd numbers become infinite and are refused by the values
            return _values(contents, parents, edges)
    except InputError as error:
        raise FormatError(path, "", str(error)) from error


def _check_complete(path: Path, contents: Contents, n_limbs: int, edges: list[tuple[int, int]]) -> None:
    if contents.n_frames:
        _check_keys(path, "TRACK", contents.tracks, list(range(n_limbs)))
        if contents.detail != "motion":
            _check_keys(path, "RawJointPositions", contents.raw_joints, edges)
            _check_keys(path, "FinalJointPositions", contents.final_joints, edges)
    lengths = {contents.n_frames, *(len(seen) for seen in contents.seen.values())}
    lengths |= {len(row) // 3 for rows in (contents.raw_joints, contents.final_joints) for row in rows.values()}
    if len(lengths) > 1:
        raise FormatError(path, "", f"tracks, joints and markers have {sorted(lengths)} frames; they must agree")
    if any(not -1 <= bone < n_limbs for bone in contents.bone_of_marker):
        raise FormatError(path, "", f"a marker sits on a bone that does not exist; bones are 0 to {n_limbs - 1}")


def _check_keys(path: Path, tag: str, found: Mapping[_Key, object], wanted: list[_Key]) -> None:
    if set(found) != set(wanted):
        raise FormatError(path, "", f"<{tag}> has {sorted(found)} where {sorted(wanted)} belong")


def _values(contents: Contents, parents: Ints, edges: list[tuple[int, int]]) -> ClassicXml:
    n_frames, n_markers, n_limbs = contents.n_frames, len(contents.names), len(parents)
    keys = _columns(contents.tracks, list(range(n_limbs)), (n_frames, 7))
    offsets = _table(contents.offsets, n_markers)
    centers = _table(contents.centers, n_limbs)
    tracked = np.full((n_frames, n_markers, 3), np.nan)
    if contents.detail == "all":
        tracked = np.frombuffer(contents.tracked_markers).reshape(tracked.shape)
    raw = np.full((n_frames, len(edges), 3), np.nan)
    if contents.detail != "motion":
        raw = _columns(contents.raw_joints, edges, (n_frames, 3))
    skeleton = _skeleton(contents, parents, edges, offsets, centers)
    return ClassicXml(
        trajectories=Trajectories(tracked, tuple(contents.names), contents.rate, contents.take),
        skeleton=skeleton,
        motion=_motion(contents, skeleton, keys, tracked),
        bone_translations=keys[..., :3],
        bone_rotations_xyzw=keys[..., 3:],
        raw_joint_positions=raw,
        offsets_from_center=offsets,
        centers_of_mass=centers,
        joint_stats=tuple(contents.stats),
        detail=contents.detail,
    )


def _skeleton(
    contents: Contents, parents: Ints, edges: list[tuple[int, int]], offsets: Floats, centers: Floats
) -> Skeleton:
    limb_of_marker = np.array(contents.bone_of_marker, dtype=np.intp)
    names = tuple(contents.bones[limb].name for limb in range(len(parents)))
    centers_and_none = np.concatenate([centers, np.full((1, 3), np.nan)])  # row -1 is for markers that are left out
    return Skeleton(
        parents=parents,
        joints=tuple(_joint(edge, contents.bones[edge[1]].joint, names) for edge in edges),
        limb_of_marker=limb_of_marker,
        marker_offsets=offsets + centers_and_none[limb_of_marker],
        marker_std=_of_markers(contents.sigmas, len(limb_of_marker)),
        reference_pose=np.array([_world_from_bone(contents.bones[limb]) for limb in range(len(parents))]).reshape(
            -1, 4, 4
        ),
        offset_std=_table(contents.offset_stds, len(limb_of_marker)) if contents.offset_stds else None,
        marker_noise=_of_markers(contents.noises, len(limb_of_marker)) if contents.noises else None,
        limb_names=names,
    )


def _joint(edge: tuple[int, int], facts: JointFacts | None, limb_names: Sequence[str]) -> Joint:
    parent, child = edge
    if facts is None:
        raise InputError(f"the joint between bones {parent} and {child} is not described")
    axis, second = (None if vector is None else np.array(vector) for vector in (facts.axis, facts.second_axis))
    places = np.array(facts.position_in_parent), np.array(facts.position_in_child)
    deviations: dict[str, Any] = {
        name: np.reshape(values, (3, 3) if len(values) == 9 else 3) for name, values in facts.deviations.items()
    }
    return Joint(
        parent,
        child,
        *places,
        kind=facts.kind,
        axis=axis,
        std=np.array(facts.std),
        second_axis=second,
        open_directions=facts.open_directions,
        usual_directions=facts.usual_directions,
        is_placed_by_marker_set=facts.is_placed_by_marker_set,
        name="" if facts.name == joint_between(limb_names[parent], limb_names[child]) else facts.name,
        **deviations,
    )


def _of_markers(values: Mapping[int, float], n_markers: int) -> Floats:
    """Values by marker, NaN for markers without one, shape (n_markers,)."""
    return np.array([values.get(marker, np.nan) for marker in range(n_markers)])


def _world_from_bone(bone: Bone) -> Floats:
    """Invert the local transform, which brings a vertex from the world in the reference pose into bone space."""
    pose = np.eye(4)
    pose[:3, :3] = matrix_from_xyzw(np.array(bone.local_rotation)).T
    pose[:3, 3] = -pose[:3, :3] @ np.array(bone.local_translation)
    return pose


def _motion(contents: Contents, skeleton: Skeleton, keys: Floats, tracked: Floats) -> Motion:
    edges = [(joint.parent, joint.child) for joint in skeleton.joints]
    seen = np.zeros((len(tracked), skeleton.n_limbs), dtype=np.bool_)
    for limb, marks in contents.seen.items():
        seen[:, limb] = np.frombuffer(marks, dtype=np.uint8)
    # compose the keys, which are relative to the parents, from the roots outward
    poses = np.zeros((len(keys), skeleton.n_limbs, 4, 4))
    poses[:, :, 3, 3] = 1.0
    for limb in skeleton.outward.tolist():
        poses[:, limb, :3, :3] = matrix_from_xyzw(keys[:, limb, 3:])
        poses[:, limb, :3, 3] = keys[:, limb, :3]
        if skeleton.parents[limb] >= 0:
            poses[:, limb] = poses[:, skeleton.parents[limb]] @ poses[:, limb]
    if contents.detail == "all":
        rebuilt = np.frombuffer(contents.final_markers).reshape(tracked.shape)
    else:  # markers that are left out have no offset
        rebuilt = _carried(poses[:, skeleton.limb_of_marker], skeleton.marker_offsets)
    if contents.detail == "motion":
        joints = _joints_on_limbs(skeleton, poses)
    else:
        joints = _columns(contents.final_joints, edges, (len(tracked), 3))
    return Motion(
        world_from_limb=poses,
        joint_positions=joints,
        marker_positions=rebuilt,
        residuals=np.linalg.norm(tracked - rebuilt, axis=2),
        limb_seen=seen,
        rate=contents.rate,
    )


def _joints_on_limbs(skeleton: Skeleton, poses: Floats) -> Floats:
    """Joints carried along by their parents [mm], shape (n_frames, n_joints, 3)."""
    places = np.array([joint.position_in_parent for joint in skeleton.joints]).reshape(-1, 3)
    return _carried(poses[:, [joint.parent for joint in skeleton.joints]], places)


def _carried(poses: Floats, places: Floats) -> Floats:
    """World positions of places on bodies, (n_frames, n, 3), from poses (n_frames, n, 4, 4) and places (n, 3)."""
    return np.asarray(np.einsum("fnik,nk->fni", poses[..., :3, :3], places) + poses[..., :3, 3])


def _columns(rows: Mapping[_Key, array[float]], order: list[_Key], shape: tuple[int, int]) -> Floats:
    """Stack flat rows of numbers, one per bone or joint, into an array of shape (n_frames, n_keys, width)."""
    n_frames, width = shape
    columns = np.empty((n_frames, len(order), width))
    for column, key in enumerate(order if n_frames else []):
        columns[:, column] = np.frombuffer(rows[key]).reshape(shape)
    return columns


def _table(rows: dict[int, list[float]], length: int) -> Floats:
    table = np.full((length, 3), np.nan)
    for index, row in rows.items():
        if not 0 <= index < length:
            raise InputError(f"the bone {index} does not exist")
        table[index] = row
    return table
