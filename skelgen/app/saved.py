"""Take the result of a stage from another project file instead of computing it, as the seed's window offers."""

from __future__ import annotations

from dataclasses import replace

from skelgen.app.consistency import check_chain
from skelgen.errors import InputError, MissingResultError
from skelgen.model import Project
from skelgen.model.project import STAGES


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
