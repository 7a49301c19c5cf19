"""Values as plain JSON data plus named arrays, and back: what the project file is made of.

A dataclass becomes ``{"type": name, "fields": {...}}``, an array ``{"array": member}``, a mapping
``{"mapping": {...}}``, a number that JSON does not know ``{"number": "nan"}``; tuples become lists. What comes back is
checked: one part of a project indexes another, and a file can claim anything.
"""

import dataclasses
import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from types import UnionType
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from skelgen.errors import InputError, MissingResultError
from skelgen.model import (
    Identities,
    Identity,
    Joint,
    Labelling,
    Limbs,
    Motion,
    PointCloud,
    Poses,
    Project,
    Skeleton,
    Topology,
    Trajectories,
)
from skelgen.model.arrays import displayable
from skelgen.model.corrections import Correction, Place
from skelgen.model.joint_spans import JointSpan
from skelgen.model.labelling import Agreement, Doubt, Finding, Tracklets
from skelgen.model.project import STAGES, Source

_TAKES = (PointCloud, Trajectories, Poses, Identities, Identity, Correction, Place, Source)
_RESULTS = (Labelling, Tracklets, Doubt, Finding, Agreement, Limbs, Topology, JointSpan, Skeleton, Joint, Motion)
_VALUES: dict[str, type] = {cls.__name__: cls for cls in (*_TAKES, *_RESULTS)}

_FORMER_FIELDS = {("Labelling", "seed_method"): "classic"}
"""Present names of fields that older files name otherwise, by type and former name."""

_ODD_NUMBERS = ("nan", "inf", "-inf")


def packed(value: Any, member: str, arrays: dict[str, NDArray[Any]]) -> Any:
    """Return `value` as JSON data and put its arrays into `arrays`.

    Parameters
    ----------
    value : object
        A value of `skelgen.model`, an array, a mapping, a tuple, a text, a number or None.
    member : str
        Name under which arrays of this value are stored, e.g. ``limbs``.
    arrays : dict of str to ndarray
        Receives the arrays by name.
    """
    if isinstance(value, np.ndarray):
        arrays[member] = value
        return {"array": member}
    if isinstance(value, Mapping):
        items = enumerate(value.items())  # a key may hold what no file name can
        return {"mapping": {key: packed(item, f"{member}/{index}", arrays) for index, (key, item) in items}}
    if isinstance(value, tuple | list):
        return [packed(item, f"{member}/{index}", arrays) for index, item in enumerate(value)]
    if dataclasses.is_dataclass(value):
        kind = _type_name(value)
        stored = [field.name for field in dataclasses.fields(value) if field.metadata.get("is_stored", True)]
        fields = {name: packed(getattr(value, name), f"{member}/{name}", arrays) for name in stored}
        return {"type": kind, "fields": fields}
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(value)}
    return value


def unpacked(data: Any, array: Callable[[str], NDArray[Any]]) -> Any:
    """Return the value that `packed` made `data` from.

    Parameters
    ----------
    data : object
        JSON data.
    array : callable (member) -> ndarray
        Delivers an array by its name.

    Raises
    ------
    ValueError
        If `data` is not what `packed` returns.
    InputError
        If a value refuses its fields.
    """
    if isinstance(data, list):
        return tuple(unpacked(item, array) for item in data)
    if not isinstance(data, dict):
        return displayable(data) if isinstance(data, str) else data
    if set(data) == {"array"} and isinstance(data["array"], str):
        return array(data["array"])
    if set(data) == {"number"} and data["number"] in _ODD_NUMBERS:
        return float(data["number"])
    if set(data) == {"mapping"} and isinstance(data["mapping"], dict):
        return {key: unpacked(item, array) for key, item in data["mapping"].items()}
    if set(data) == {"type", "fields"} and isinstance(data["fields"], dict):
        fields = {key: unpacked(item, array) for key, item in data["fields"].items()}
        if data["type"] == Source.__name__:
            fields["path"] = data["fields"]["path"]  # as the disk has it, be it UTF-8 or not
        return _value(data["type"], fields)
    raise ValueError(f"an object with the keys {', '.join(sorted(data)) or 'none'} means nothing here")


def _type_name(value: Any) -> str:
    """Name of the dataclass of a value; a subclass that computes fields on demand has that of its base."""
    return next(cls.__name__ for cls in type(value).__mro__ if "__dataclass_fields__" in vars(cls))


def _value(type_name: Any, fields: dict[str, object]) -> Any:
    if type_name not in _VALUES:
        raise ValueError(f"there is no value of type {type_name!r}")
    cls = _VALUES[type_name]
    fields = {_FORMER_FIELDS.get((type_name, name), name): value for name, value in fields.items()}
    declared = dataclasses.fields(cls)
    unset = dataclasses.MISSING
    needed = {field.name for field in declared if field.default is unset and field.default_factory is unset}
    known = {field.name for field in declared}
    if not needed <= set(fields) <= known:  # older files lack what was added since, with a default
        odd = ", ".join(sorted((needed - set(fields)) | (set(fields) - known)))
        raise ValueError(f"the fields of a {type_name} do not fit: {odd}")
    hints = get_type_hints(cls)
    for name, value in fields.items():
        if not _fits(value, hints[name]):
            raise ValueError(f"{name} of a {type_name} is of the wrong type, {type(value).__name__}")
    try:
        return cls(**fields)
    except (TypeError, AttributeError, IndexError) as error:
        raise ValueError(f"a field of a {type_name} has the wrong type: {error}") from error


def _fits(value: Any, hint: Any) -> bool:
    """Whether a value is of the type that a field declares."""
    kind, parts = get_origin(hint), get_args(hint)
    if kind is UnionType:
        return any(_fits(value, part) for part in parts)
    if kind is tuple:
        same = len(parts) == 2 and parts[1] is ...
        wanted = parts[:1] * len(value) if same and isinstance(value, tuple) else parts
        return isinstance(value, tuple) and len(value) == len(wanted) and all(map(_fits, value, wanted))
    if kind is Mapping:
        return isinstance(value, Mapping) and all(_fits(item, parts[1]) for item in value.values())
    if hint is float:
        return isinstance(value, float | int) and not isinstance(value, bool)
    if hint is int:
        return isinstance(value, int) and not isinstance(value, bool)
    return hint is Any or (kind is not Callable and isinstance(value, kind or hint))


def check_chain(project: Project) -> None:
    """Raise `InputError` if a part is of the wrong kind, is missing, or does not fit the part it was computed from.

    Parameters
    ----------
    project : Project
        As it was read.
    """
    _check_kinds(project)
    _check_statements(project)
    for what, have, want in _counts(project):
        if have != want:
            raise InputError(f"{what} is {have} where {want} belong")
    if project.has("skeleton"):
        _check_indices(project.skeleton)


def _check_kinds(project: Project) -> None:
    if not isinstance(project.take, PointCloud | Trajectories | Poses):
        raise InputError("the take is not a take")
    parts = (project._trajectories, project._limbs, project._topology, project._skeleton, project._motion)
    kinds = (Trajectories, Limbs, Topology, Skeleton, Motion)
    missing = ""
    for part, kind in zip(parts, kinds, strict=True):
        if part is None:
            missing = kind.__name__
        elif not isinstance(part, kind):
            raise InputError(f"a {type(part).__name__} stands where a {kind.__name__} belongs")
        elif missing:
            raise InputError(f"there is a {kind.__name__} but no {missing}")
    if project._labelling is not None and not isinstance(project._labelling, Labelling):
        raise InputError(f"a {type(project._labelling).__name__} stands where a Labelling belongs")
    if project.has_labelling and not project.has("labels"):
        raise InputError("there is a Labelling but no Trajectories")
    if missing == "Motion" and project._skeleton is not None:
        raise InputError("there is a Skeleton but no Motion")


def _check_statements(project: Project) -> None:
    if not all(isinstance(correction, Correction) for correction in project.corrections):
        raise InputError("a correction is none")
    if not isinstance(project.identities, Identities | None):
        raise InputError("the identities are none")
    if type(project.seed) is not int or project.seed < 0:
        raise InputError("the seed is no whole number from 0 up")
    for name, report in project.reports.items():
        if not isinstance(report.parameters, Mapping) or not all(isinstance(text, str) for text in report.notices):
            raise InputError(f"the report of the stage {name!r} holds no parameters, or notices that are no text")
        if not all(isinstance(value, str | int | float | None) for value in report.parameters.values()):
            raise InputError(f"the report of the stage {name!r} holds a parameter that is neither a number nor text")


def _counts(project: Project) -> Iterator[tuple[str, int, int]]:
    if project.has_labelling:
        n_frames, n_markers = project.labelling.confidence.shape
        yield "the number of markers of the labelling", n_markers, project.trajectories.n_markers
        yield "the number of frames of the labelling", n_frames, project.trajectories.n_frames
    if project.has("limbs"):
        yield "the number of markers of the limbs", project.limbs.n_markers, project.trajectories.n_markers
    if project.has("joints"):
        raw = project.topology.raw_joint_positions
        yield "the number of limbs of the tree", project.topology.n_limbs, project.limbs.n_limbs
        yield "the number of frames of the raw joints", len(raw), project.trajectories.n_frames
    if project.has("skeleton"):
        skeleton, motion, trajectories = project.skeleton, project.motion, project.trajectories
        yield "the number of limbs of the skeleton", skeleton.n_limbs, project.topology.n_limbs
        yield "the number of markers of the skeleton", len(skeleton.limb_of_marker), trajectories.n_markers
        yield "the number of frames of the motion", motion.n_frames, trajectories.n_frames
        yield "the number of limbs of the motion", motion.limb_seen.shape[1], skeleton.n_limbs
        yield "the number of joints of the motion", motion.joint_positions.shape[1], skeleton.n_joints
        yield "the number of markers of the motion", motion.marker_positions.shape[1], trajectories.n_markers


def _check_indices(skeleton: Skeleton) -> None:
    if ((skeleton.limb_of_marker < -1) | (skeleton.limb_of_marker >= skeleton.n_limbs)).any():
        raise InputError("a marker of the skeleton sits on a limb that does not exist")
    if any(joint.parent != skeleton.parents[joint.child] for joint in skeleton.joints):
        raise InputError("a joint's parent is not the parent of its limb")
    if any(not 0 <= limb < skeleton.n_limbs for joint in skeleton.loops for limb in (joint.parent, joint.child)):
        raise InputError("a joint that closes a loop names a limb that does not exist")


def with_saved(project: Project, saved: Project, stage: str) -> Project:
    """Return a project with one stage's result from another project of the same take; what comes after is dropped.

    Parameters
    ----------
    project : Project
        With the results of the stages before.
    saved : Project
        Where the result comes from.
    stage : str
        ``labels``, ``limbs``, ``joints`` or ``skeleton``.

    Raises
    ------
    MissingResultError
        If either project lacks what is needed.
    InputError
        If the two are not of the same take.
    """
    if not saved.has(stage):
        raise MissingResultError(f"{saved.name or 'that project'} has no result of the stage {stage!r}")
    _check_same_take(project, saved, stage)
    report = replace(saved.reports[stage], notices=(*saved.reports[stage].notices, "taken from a saved project"))
    if stage == "labels":
        result = project.with_trajectories(saved.trajectories, report, saved.labelling if saved.has_labelling else None)
    elif stage == "limbs":
        result = project.with_limbs(saved.limbs, report)
    elif stage == "joints":
        result = project.with_topology(saved.topology, report)
    else:
        result = project.with_skeleton(saved.skeleton, saved.motion, report)
    check_chain(result)
    return result


def _check_same_take(project: Project, saved: Project, stage: str) -> None:
    if saved.take.n_frames != project.take.n_frames:
        raise InputError(
            f"the saved result is of {saved.take.n_frames} frames, this take has {project.take.n_frames}: they are not "
            "of the same recording"
        )
    if stage != STAGES[0] and project.has("labels") and saved.trajectories.names != project.trajectories.names:
        raise InputError("the saved result is of markers with other names; take the labels of that project first")
