"""What may enter: checks of a take, takes of bodies with orientation, and arguments of the face.

Bodies become markers; sensors that slipped or were exchanged are repaired; joints may hold for a span of the take.
Arguments are refused in a sentence where nothing can be done with their type.
"""

from __future__ import annotations

import dataclasses
import inspect
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, ParamSpec, TypeVar

import numpy as np

from skelgen.app.set_prior import HeldNotices
from skelgen.errors import InputError
from skelgen.geometry.rotations import transform_from
from skelgen.model import Identities, Limbs, PointCloud, Poses, Project, Take, Topology, Trajectories
from skelgen.model.arrays import Floats, Ints, check_coordinates
from skelgen.progress import Monitor, counted

if TYPE_CHECKING:
    from skelgen.stages.joints import JointConstraints

MIN_FRAMES = 3
"""Fewer frames hold no motion from which a joint could be found."""

_MIN_MARKERS = 2
"""A single marker has no distance that could be constant."""

_STILL_RANGE = 1e-6
"""Range of motion [mm] below which nothing moves: a nanometre is finer than any tracker and any file resolves."""

AXIS_LENGTHS = (50.0, 400.0)
"""Distance [mm] of a body's axis markers from its origin, at least and at most: they stay near a limb."""

_BODY_POINT_NAMES = ("o", "x", "y", "z", "-x", "-y", "-z")
"""Markers that stand for a body: its origin and both ends of its axes, so that none of its errors pulls another."""

_BODY_POINTS = np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
_AXIS_MARKERS = 6  # which tell the rotation; the origin helps to tell the position


def check_take(take: Take) -> None:
    """Raise `InputError`, naming the take, if no stage could ever work on it.

    Parameters
    ----------
    take : PointCloud, Trajectories or Poses
        What was read.
    """
    _check_n_frames(take)
    if isinstance(take, PointCloud):
        if take.n_points == 0:
            raise InputError(f"{_name(take)}: no marker is seen in any frame; check the recording")
    elif isinstance(take, Trajectories):
        check_trajectories(take)
    elif np.isnan(take.world_from_body[:, :, 0, 0]).all():
        raise InputError(f"{_name(take)}: no body is seen in any frame; check the recording")
    else:
        check_coordinates(take.world_from_body, _name(take))


def check_trajectories(trajectories: Trajectories) -> None:
    """Raise `InputError`, naming the take, if no limbs can be found in labelled markers.

    Parameters
    ----------
    trajectories : Trajectories
        Needs 3 frames, 2 markers that are seen, and some motion.
    """
    name = _name(trajectories)
    _check_n_frames(trajectories)
    check_coordinates(trajectories.positions, name)
    n_seen = int(trajectories.seen.any(axis=0).sum())
    if n_seen == 0:
        raise InputError(f"{name}: no marker is seen in any frame; check the recording")
    if n_seen < _MIN_MARKERS:
        raise InputError(f"{name}: only 1 marker is seen; limbs need at least {_MIN_MARKERS}")
    if _range_of_motion(trajectories.positions) <= _STILL_RANGE:
        raise InputError(f"{name}: nothing moves; limbs and joints show only in motion")


def trajectories_from_poses(poses: Poses, length: float | None = None) -> Trajectories:
    """Put virtual markers on every body: its origin and both ends of its axes.

    The farther the ends, the more the rotations count. By default errors of position and of rotation have the same
    effect, as estimated from the frames (`noise_size`).

    Parameters
    ----------
    poses : Poses
        Bodies with orientation.
    length : float, mm, optional
        How far the ends are; found from the frames if left out.

    Returns
    -------
    Trajectories
        Markers ``body:o``, ``body:x``, ``body:-x`` and so on for every body.
    """
    from skelgen.kinematics.joints.relative_poses import noise_size  # noqa: PLC0415 - scipy costs 0.1 s, and few takes are poses

    if length is None:
        length = float(np.clip(noise_size(poses) * np.sqrt(len(_BODY_POINTS) / _AXIS_MARKERS), *AXIS_LENGTHS))
    rotations, origins = poses.world_from_body[..., :3, :3], poses.world_from_body[..., :3, 3]
    points = np.einsum("fbij,kj->fbki", rotations, length * _BODY_POINTS) + origins[:, :, np.newaxis]
    names = tuple(f"{body}:{point}" for body in poses.names for point in _BODY_POINT_NAMES)
    return Trajectories(points.reshape(poses.n_frames, len(names), 3), names, poses.rate, poses.name, poses.notices)


def poses_of_markers(trajectories: Trajectories) -> Floats:
    """Return world_from_body of bodies from their virtual markers, shape (n_frames, n_bodies, 4, 4), lengths in mm.

    Parameters
    ----------
    trajectories : Trajectories
        From `trajectories_from_poses`, perhaps with positions taken out; bodies that are not whole are NaN.
    """
    points = trajectories.positions.reshape(trajectories.n_frames, -1, len(_BODY_POINTS), 3)
    points = np.where(np.isnan(points).any(axis=(2, 3), keepdims=True), np.nan, points)
    axes = points[:, :, 1:4] - points[:, :, :1]
    turns = (axes / np.linalg.norm(axes, axis=3, keepdims=True)).swapaxes(2, 3)
    return transform_from(turns, points[:, :, 0])


def body_of(marker: str) -> str:
    """Return the body of a virtual marker, by its name."""
    return marker.rpartition(":")[0]


def limbs_from_poses(poses: Poses, trajectories: Trajectories) -> Limbs:
    """Make every body one limb.

    Parameters
    ----------
    poses : Poses
        Bodies with orientation.
    trajectories : Trajectories
        Their virtual markers, from `trajectories_from_poses`.
    """
    limb_of_marker = np.repeat(np.arange(poses.n_bodies), len(_BODY_POINTS))
    columns = [_deviations(trajectories.positions, marker) for marker in range(trajectories.n_markers)]
    return Limbs(limb_of_marker, np.array(columns))


def _check_n_frames(take: Take) -> None:
    if take.n_frames < MIN_FRAMES:
        raise InputError(f"{_name(take)}: {counted(take.n_frames, 'frame')} where at least {MIN_FRAMES} are needed")


def _range_of_motion(positions: Floats) -> float:
    unseen = np.isnan(positions)
    highest = np.where(unseen, -np.inf, positions).max(axis=0)
    lowest = np.where(unseen, np.inf, positions).min(axis=0)
    return float((highest - lowest).max())


def _name(take: Take) -> str:
    return take.name or "the take"


def limbs_with_parts(
    trajectories: Trajectories, split: tuple[tuple[str, ...], ...], find: Callable[[Trajectories], Limbs]
) -> Limbs:
    """Find limbs with one part of every split marker, and put the other parts on the limb of that.

    Parameters
    ----------
    trajectories : Trajectories
        With all parts.
    split : tuple of tuple of str
        Names of parts, those of one marker with the same first name.
    find : callable (trajectories) -> Limbs
        Groups markers.
    """
    part_of = _representatives(trajectories, split)
    kept = np.flatnonzero(part_of == np.arange(trajectories.n_markers))
    if len(kept) == trajectories.n_markers:
        return find(trajectories)
    names = tuple(trajectories.names[int(np.argmax(part_of == marker))] for marker in kept)  # as the user knows it
    found = find(dataclasses.replace(trajectories, positions=trajectories.positions[:, kept], names=names))
    deviation = np.full((trajectories.n_markers, trajectories.n_markers), np.nan)
    deviation[np.ix_(kept, kept)] = found.distance_deviation
    for marker in np.flatnonzero(part_of != np.arange(trajectories.n_markers)):
        deviation[marker] = deviation[:, marker] = _deviations(trajectories.positions, int(marker))
    whole = np.searchsorted(kept, part_of)
    membership = None if found.membership is None else found.membership[whole]
    return Limbs(found.limb_of_marker[whole], deviation, membership=membership)


def _representatives(trajectories: Trajectories, split: tuple[tuple[str, ...], ...]) -> Ints:
    """For each marker the part that stands for it: the one of its parts that is seen in most frames."""
    result, seen = np.arange(trajectories.n_markers), trajectories.seen.sum(axis=0)
    index = {name: marker for marker, name in enumerate(trajectories.names)}
    for first in dict.fromkeys(names[0] for names in split):
        parts = {index[name] for names in split if names[0] == first for name in names if name in index}
        if parts:
            result[sorted(parts)] = max(sorted(parts), key=lambda part: int(seen[part]))
    return result


def _deviations(positions: Floats, marker: int) -> Floats:
    """Standard deviation of a marker's distance to all [mm], NaN where never seen together, 0 to itself."""
    lengths = np.linalg.norm(positions - positions[:, [marker]], axis=2)
    known = ~np.isnan(lengths)
    count = known.sum(axis=0)
    mean = np.where(known, lengths, 0.0).sum(axis=0) / np.maximum(count, 1)
    squares = np.where(known, (lengths - mean) ** 2, 0.0).sum(axis=0)
    return np.where(count > 0, np.sqrt(squares / np.maximum(count, 1)), np.nan)


def repaired_sensors(poses: Poses, monitor: Monitor) -> Poses:
    """Return bodies whose exchanged sensors are exchanged back, and whose sensors that slipped are moved back.

    Parameters
    ----------
    poses : Poses
        As they were recorded.
    monitor : Monitor
        Receives a notice of each.
    """
    from skelgen.stages.joints import slips_moved_back  # noqa: PLC0415 - loads the stage
    from skelgen.stages.repair import exchanged_back  # noqa: PLC0415

    world_from_body, exchanges = exchanged_back(poses.world_from_body)
    for one, other, frame in exchanges:
        pair = f"{poses.names[one]} and {poses.names[other]}"
        monitor.notice(f"the sensors of {pair} are exchanged from frame {frame} on; they are exchanged back")
    bodies, slips = slips_moved_back(replace(poses, world_from_body=world_from_body) if exchanges else poses)
    for slip in slips:
        monitor.notice(slip.sentence(poses.names[slip.limb]))
    return bodies


def joints_of_bodies(
    project: Project, find: Callable[..., Topology], constraints: JointConstraints, monitor: Monitor
) -> Topology:
    """Return the tree of bodies with orientation, and joints beyond it that hold for a part of the take only.

    Parameters
    ----------
    project : Project
        With limbs.
    find : callable (constraints, monitor) -> Topology
        Finds joints and tree.
    constraints : JointConstraints
        What the user states of the tree.
    monitor : Monitor
        Receives progress and notices.
    """
    from skelgen.stages.joints import find_joint_spans  # noqa: PLC0415 - loads the stage

    held = HeldNotices(monitor)
    topology = find(constraints=constraints, monitor=held)
    markers = project.trajectories
    spans, parted = find_joint_spans(poses_of_markers(markers), topology.parents, markers.rate)
    if parted and constraints.parents is None and not set(parted) & set(constraints.joined):
        topology = find(constraints=replace(constraints, parted=(*constraints.parted, *parted)))
    else:
        held.release()
    for span in spans:
        monitor.notice(span.sentence(project.limbs.names))
    return replace(topology, spans=spans)


_P = ParamSpec("_P")
_R = TypeVar("_R")

_KINDS: Mapping[str, tuple[type, ...]] = {
    **dict.fromkeys(("format", "kind", "root"), (str,)),
    **dict.fromkeys(("joined", "names", "parted", "takes"), (Iterable,)),
    **dict.fromkeys(("output", "path"), (Path, str)),
    "frames": (Sequence,),
    "identities": (Identities, Path, str),
    "index": (int,),
    "inputs": (Iterable, Path, str),
    "monitor": (Monitor,),
    "project": (Project,),
    "subject": (Project, Path, str, Sequence),
    "take": (PointCloud, Trajectories, Poses, Project),
}
"""Types of arguments that no value checks when it is made."""


def with_checked_arguments(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Decorate a function: unknown arguments, and those of a wrong type, are errors in a sentence."""
    signature = inspect.signature(function)

    @wraps(function)
    def checked(*args: _P.args, **kwargs: _P.kwargs) -> _R:
        try:
            given = signature.bind(*args, **kwargs).arguments
        except TypeError as error:
            takes = ", ".join(signature.parameters)
            raise InputError(f"{function.__name__} {error}; its arguments are {takes}") from error
        for name, value in given.items():
            kinds = _KINDS.get(name, (object,))
            if not isinstance(value, kinds) and value is not signature.parameters[name].default:
                wanted = " or ".join(kind.__name__ for kind in kinds)
                raise InputError(f"{name} is {value!r:.60}; {function.__name__} takes a {wanted} there")
        return function(*args, **kwargs)

    return checked
