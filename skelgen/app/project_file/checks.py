"""Whether the parts of a project fit each other: one indexes the other, and a file can claim anything."""

from collections.abc import Iterator, Mapping
from dataclasses import replace

from skelgen.errors import InputError, MissingResultError
from skelgen.model import (
    Identities,
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
from skelgen.model.corrections import Correction
from skelgen.model.project import STAGES


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
