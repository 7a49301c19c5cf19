"""What a correction of the user changes at once: corrections are added and taken back, labels are apply_corrections."""

from dataclasses import replace

import numpy as np

from skelgen.app.constraints import corrected_marker, corrections_of
from skelgen.app.limb_names import renamed_limbs
from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Project, Trajectories
from skelgen.model.corrections import RULES, Correction, Place
from skelgen.progress import Monitor

_EDITS = frozenset({"merge", "split", "rename", "delete", "swap"})
"""Kinds of corrections that change labels at once, without a new run."""


def with_correction(project: Project, correction: Correction) -> Project:
    """Return a project with one more correction; results that contradict it are dropped, labels corrected at once.

    Parameters
    ----------
    project : Project
        With the result of the stage that the correction is about, or without.
    correction : Correction
        What the user states.

    Raises
    ------
    InputError
        If it names a marker that does not exist.
    """
    added = replace(project, corrections=(*project.corrections, correction))
    if correction.kind in _EDITS and project.has("labels"):
        return _with_edited_labels(added, correction)
    for which in range(len(correction.names)):
        if project.has("labels"):
            corrected_marker(project.trajectories, correction, which)  # raises if it does not exist
    if correction.kind == "name":
        return renamed_limbs(added) if project.has("limbs") else added
    return added.before(correction.stage)


def without_correction(project: Project, index: int) -> Project:
    """Return a project without one of its corrections; the results of its stage and of all after it are dropped.

    Parameters
    ----------
    project : Project
        With corrections.
    index : int
        Which of them.
    """
    kept = (*project.corrections[:index], *project.corrections[index + 1 :])
    if project.corrections[index].kind == "name":
        bare = replace(project, corrections=kept)
        return renamed_limbs(bare) if project.has("limbs") else bare
    return replace(project, corrections=kept).before(project.corrections[index].stage)


def with_number(project: Project, kind: str, number: int | None) -> Project:
    """Return a project with a stated number of markers or limbs; the results that rest on it are dropped.

    Parameters
    ----------
    project : Project
        Perhaps with another number stated.
    kind : str
        ``n_markers`` or ``n_limbs``.
    number : int or None
        The number; None lets it be found.
    """
    others = tuple(correction for correction in project.corrections if correction.kind != kind)
    stated = () if number is None else (Correction(kind, value=str(number)),)
    return replace(project, corrections=(*others, *stated)).before(RULES[kind].stage)


def place_of(trajectories: Trajectories, marker: int, frame: int) -> Place:
    """Return where a marker is seen nearest in time to a frame.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers.
    marker, frame : int
        Their indices.

    Raises
    ------
    InputError
        If the marker is never seen.
    """
    seen = np.flatnonzero(trajectories.seen[:, marker])
    if not len(seen):
        raise InputError(f"{trajectories.names[marker]} is seen in no frame")
    nearest = int(seen[np.abs(seen - frame).argmin()])
    x, y, z = trajectories.positions[nearest, marker].tolist()
    return Place(nearest, (x, y, z))


def corrected_labels(
    project: Project, trajectories: Trajectories, labelling: Labelling | None, monitor: Monitor
) -> tuple[Trajectories, Labelling | None]:
    """Apply the corrections of a project to labels that a stage has found.

    Parameters
    ----------
    project : Project
        With or without corrections.
    trajectories : Trajectories
        The labels.
    labelling : Labelling or None
        How sure they are.
    monitor : Monitor
        Receives a notice for each correction.
    """
    if not any(correction.kind in _EDITS for correction in project.corrections):
        return trajectories, labelling
    from skelgen.stages.labels import apply_corrections, corrected_quality  # noqa: PLC0415 - loads scipy

    corrections_of(project, "labels", monitor)
    edits = apply_corrections(trajectories, project.corrections)
    for sentence in edits.notices:
        monitor.notice(sentence)
    if labelling is not None:
        labelling = corrected_quality(labelling, edits, isinstance(project.take, PointCloud))
    return edits.trajectories, labelling


def _with_edited_labels(project: Project, correction: Correction) -> Project:
    """The labels with one more correction; a new name changes nothing else."""
    from skelgen.stages.labels import apply_corrections, corrected_quality  # noqa: PLC0415 - loads scipy

    edits = apply_corrections(project.trajectories, (correction,))
    if correction.kind == "rename":
        return project.renamed(edits.trajectories.names)
    labelling = project.labelling if project.has_labelling else None
    if labelling is not None:
        labelling = corrected_quality(labelling, edits, isinstance(project.take, PointCloud))
    report = project.reports["labels"]
    notices = tuple(dict.fromkeys((*report.notices, correction.sentence, *edits.notices)))
    return project.with_trajectories(edits.trajectories, replace(report, notices=notices), labelling)
