"""The axis that points up: whole takes and projects in other world axes, and which axis is up in a take.

Programs differ in whether z or y points up. Turns are by a quarter about the x axis: coordinates change places and
signs, and no digit is lost.

Up is the axis along which the lowest point of a frame keeps still best: a body stands on something. Of an axis that
is not much better than the next, one is unsure. Where names tell shoulders, knees and ankles, up is towards the former.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.keypoints import joint_of_name
from skelgen.model import Joint, Motion, PointCloud, Poses, Project, Skeleton, Take, Trajectories
from skelgen.model.arrays import Floats, spread_frames
from skelgen.model.filled import Filled

AS_RECORDED = "as-recorded"
TURNS: dict[str, tuple[tuple[int, int, int], tuple[int, int, int]]] = {
    AS_RECORDED: ((0, 1, 2), (1, 1, 1)),
    "z-to-y": ((0, 2, 1), (1, 1, -1)),
    "y-to-z": ((0, 2, 1), (1, -1, 1)),
}
"""Which old coordinate each new one is, and with which sign: z-to-y makes what was up along z up along y."""


def with_up_axis(value: Project | Take | Filled, axes: str) -> Project | Take | Filled:
    """Return a take or a project in turned world axes, to be written; `AS_RECORDED` returns it as it is.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        Of a project, take and results are turned; places that the user named by hand are not.
    axes : str
        A key of `TURNS`.

    Raises
    ------
    InputError
        If there is no such key.
    """
    if axes not in TURNS:
        raise InputError(f"the axes {axes!r} are not known; there are {', '.join(TURNS)}")
    if axes == AS_RECORDED:
        return value
    if isinstance(value, Project):
        return _project(value, axes)
    if isinstance(value, Filled):
        return replace(value, measured=_markers(value.measured, axes), positions=_vectors(value.positions, axes))
    return _take(value, axes)


def turned_poses(poses: Floats, axes: str) -> Floats:
    """Return poses in turned world axes, shape (..., 4, 4).

    Parameters
    ----------
    poses : ndarray, shape (..., 4, 4), mm
        World from body.
    axes : str
        A key of `TURNS`.
    """
    order, signs = TURNS[axes]
    turned = poses.copy()
    turned[..., :3, :] = poses[..., order, :] * np.array(signs)[:, np.newaxis]
    return turned


def _project(project: Project, axes: str) -> Project:
    take = _take(project.take, axes)
    changes: dict[str, Any] = {"take": take}
    if project.has("labels"):
        is_take = project.trajectories is project.take
        changes["_trajectories"] = take if is_take else _markers(project.trajectories, axes)
    if project.has("joints"):
        raw = _vectors(project.topology.raw_joint_positions, axes)
        changes["_topology"] = replace(project.topology, raw_joint_positions=raw)
    if project.has("skeleton"):
        changes["_skeleton"] = _skeleton(project.skeleton, axes)
        changes["_motion"] = _motion(project.motion, axes)
    return replace(project, **changes)


def _skeleton(skeleton: Skeleton, axes: str) -> Skeleton:
    """Turn the limbs' own frames with the world: they have its axes in the reference pose."""
    return replace(
        skeleton,
        joints=tuple(_joint(joint, axes) for joint in skeleton.joints),
        loops=tuple(_joint(joint, axes) for joint in skeleton.loops),
        marker_offsets=_vectors(skeleton.marker_offsets, axes),
        offset_std=_sizes(skeleton.offset_std, axes),
        reference_pose=_frames(skeleton.reference_pose, axes),
    )


def _joint(joint: Joint, axes: str) -> Joint:
    vectors = ("position_in_parent", "position_in_child", "axis", "second_axis")
    sizes = ("std", "axis_std", "second_axis_std")
    squares = ("covariance", "covariance_in_child", "turn_covariance")
    turned: dict[str, Any] = {name: _sizes(getattr(joint, name), axes) for name in sizes}
    for name in vectors:
        turned[name] = None if getattr(joint, name) is None else _vectors(getattr(joint, name), axes)
    for name in squares:
        old = getattr(joint, name)
        turned[name] = None if old is None else _vectors(_vectors(old, axes).swapaxes(0, 1), axes).swapaxes(0, 1)
    return replace(joint, **turned)


def _motion(motion: Motion, axes: str) -> Motion:
    poses = _frames(motion.world_from_limb, axes)
    joints, markers = _vectors(motion.joint_positions, axes), _vectors(motion.marker_positions, axes)
    std = _sizes(motion.joint_std, axes)
    turned = replace(motion, world_from_limb=poses, joint_positions=joints, marker_positions=markers, joint_std=std)
    return replace(turned, compute_angles=None)  # of the skeleton as it was; writers ask the skeleton itself


def _frames(poses: Floats, axes: str) -> Floats:
    """Turn poses of frames that turn with the world."""
    turned = turned_poses(poses, axes)
    turned[..., :3, :3] = _vectors(turned[..., :3, :3], axes)
    return turned


def _sizes(std: Floats | None, axes: str) -> Floats | None:
    return None if std is None else np.abs(_vectors(std, axes))


def _take(take: Take, axes: str) -> Take:
    if isinstance(take, PointCloud):
        return replace(take, points=_vectors(take.points, axes))
    if isinstance(take, Poses):
        return replace(take, world_from_body=turned_poses(take.world_from_body, axes))
    return _markers(take, axes)


def _markers(markers: Trajectories, axes: str) -> Trajectories:
    return replace(markers, positions=_vectors(markers.positions, axes))


def _vectors(vectors: Floats, axes: str) -> Floats:
    order, signs = TURNS[axes]
    return np.asarray(vectors[..., order] * signs)


SURE, LIKELY, UNSURE = "sure", "likely", "unsure"
"""How sure an axis is."""

_FRAMES = 500  # of a take that are looked at; a second for any file
_SURE, _FAIRLY = 4.0, 1.5  # how many times more the lowest points stray along the next axis
_HIGH = 99.0  # percentile of heights that counts as the top, so that a stray point does not


@dataclass(frozen=True)
class Up:
    """Which axis is up.

    Attributes
    ----------
    axis : str
        ``x``, ``y``, ``z``, ``-x`` and so on; empty where nothing tells.
    sure : str
        `SURE`, `LIKELY` or `UNSURE`.
    height : float, mm, or None
        Of the highest points above the lowest ones.
    """

    axis: str
    sure: str
    height: float | None

    @property
    def believed(self) -> str:
        """The axis, or nothing if it is unsure."""
        return "" if self.sure == UNSURE else self.axis


def find_up(value: Take | Project) -> Up:
    """Find the axis that is up in a take of points; of a project in its labelled markers and by its joints' names."""
    take, rise = value.take if isinstance(value, Project) else value, np.zeros(3)
    if isinstance(value, Project) and value.has("labels") and not isinstance(take, Poses):
        take = value.trajectories
    if isinstance(value, Project) and value.has("skeleton"):
        joints = value.motion.joint_positions
        rise = _rise(value.skeleton.joint_names, list(joints[spread_frames(len(joints), _FRAMES)]))
    frames = sampled_points(take)
    shown = [frame for frame in frames if not np.isnan(frame).all()]
    if not rise.any():
        rise = _rise(() if isinstance(take, PointCloud) else take.names, frames)
    is_named = bool(np.sort(np.abs(rise))[-1] > _SURE * np.sort(np.abs(rise))[-2])
    if len(shown) < 2 or (isinstance(take, Poses) and not is_named):
        return Up("", UNSURE, None)
    straying = np.array([np.nanmin(frame, axis=0) for frame in shown]).std(axis=0) + 1e-3
    order = np.argsort(straying)
    axis, times, sign = int(order[0]), float(straying[order[1]] / straying[order[0]]), 1.0
    if is_named:
        axis, times = int(np.abs(rise).argmax()), np.inf
        sign = float(np.sign(rise[axis]))
    heights = [sign * frame[~np.isnan(frame[:, 0]), axis] for frame in shown]
    lowest = np.array([frame.min() for frame in heights])
    height = float(np.percentile(np.concatenate(heights), _HIGH) - np.median(lowest))
    name = "xyz"[axis] if sign > 0 else f"-{'xyz'[axis]}"
    return Up(name, SURE if times > _SURE else LIKELY if times > _FAIRLY else UNSURE, height)


def sampled_points(take: Take) -> Sequence[Floats]:
    """Return the points of some frames spread evenly over a take [mm], shape (n_points, 3), NaN where unseen."""
    chosen = spread_frames(take.n_frames, _FRAMES).tolist()
    if isinstance(take, PointCloud):
        return [take.frame(index) for index in chosen if len(take.frame(index))]
    positions = take.world_from_body[..., :3, 3] if isinstance(take, Poses) else take.positions
    return [positions[index] for index in chosen]


def up_of(value: Project | Take | Filled) -> str:
    """Return the axis that is up in what is to be written, ``z``, ``-y`` and so on; empty where that is unsure."""
    return find_up(value.measured if isinstance(value, Filled) else value).believed


def turn_to(value: Project | Take | Filled, up: str) -> str:
    """Return the turn, a key of `TURNS`, that brings what is found to be up to an axis; `AS_RECORDED` if none does.

    Parameters
    ----------
    value : Project, PointCloud, Trajectories, Poses or Filled
        What is to be written.
    up : str
        ``y`` or ``z``.
    """
    turn = f"{up_of(value)}-to-{up}"
    return turn if turn in TURNS else AS_RECORDED


def _rise(names: Sequence[str], frames: Sequence[Floats]) -> Floats:
    """Median way from knees and ankles to shoulders [mm], shape (3,), if names tell them; else zeros."""
    joints = [joint_of_name(name)[1] for name in names]
    high = [point for point, joint in enumerate(joints) if joint == "shoulder"]
    low = [point for point, joint in enumerate(joints) if joint in ("knee", "ankle")]
    if not high or not low:
        return np.zeros(3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # frames in which none is seen
        ways = np.array([np.nanmean(frame[high], axis=0) - np.nanmean(frame[low], axis=0) for frame in frames])
        return np.asarray(np.nan_to_num(np.nanmedian(ways, axis=0)))
