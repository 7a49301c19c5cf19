"""What the user corrected by hand, as the stages are told of it; and what a new correction changes at once."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Project, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.corrections import RULES, Correction, Place, named_marker
from skelgen.progress import Monitor

EDITS = frozenset({"merge", "split", "rename", "delete", "swap"})
"""Kinds of corrections that change labels at once, without a new run."""


def with_correction(project: Project, correction: Correction) -> Project:
    """Add a correction; what it contradicts is dropped, and labels are corrected at once.

    Parameters
    ----------
    project : Project
        With the result of the stage that the correction is about, or without.
    correction : Correction
        What the user says.

    Raises
    ------
    InputError
        If it names a marker that is not there.
    """
    added = replace(project, corrections=(*project.corrections, correction))
    if correction.kind in EDITS and project.has("labels"):
        return _labels_edited(added, correction)
    for which in range(len(correction.names)):
        if project.has("labels"):
            _marker(project.trajectories, correction, which)
    return added.before(correction.stage)


def without_correction(project: Project, index: int) -> Project:
    """Take a correction back; the results of its stage and of all after it are dropped."""
    taken = project.corrections[index]
    kept = (*project.corrections[:index], *project.corrections[index + 1 :])
    return replace(project, corrections=kept).before(taken.stage)


def with_number(project: Project, kind: str, number: int | None) -> Project:
    """State the number of markers or limbs, or let it be found; the results that rest on it are dropped.

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
    """Return where a marker is seen nearest in time to a frame."""
    seen = np.flatnonzero(trajectories.seen[:, marker])
    if not len(seen):
        raise InputError(f"{trajectories.names[marker]} is seen in no frame")
    nearest = int(seen[np.abs(seen - frame).argmin()])
    x, y, z = trajectories.positions[nearest, marker].tolist()
    return Place(nearest, (x, y, z))


def corrected_labels(
    project: Project, trajectories: Trajectories, labelling: Labelling | None, monitor: Monitor
) -> tuple[Trajectories, Labelling | None]:
    """Apply the corrections of labels to what the stage has found."""
    if not any(correction.kind in EDITS for correction in project.corrections):
        return trajectories, labelling
    from skelgen.stages.labels import edited, judged_again  # noqa: PLC0415 - loads scipy

    edits = edited(trajectories, project.corrections)
    for sentence in (*_said(project, "labels"), *edits.notices):
        monitor.notice(sentence)
    if labelling is not None:
        labelling = judged_again(labelling, edits, isinstance(project.take, PointCloud))
    return edits.trajectories, labelling


def limb_wishes(project: Project, monitor: Monitor) -> dict[str, Any]:
    """Return what `find_limbs` is told: markers that share a limb, and markers that do not."""
    together, apart = [], []
    for correction in _of_stage(project, "limbs", monitor):
        names = [project.trajectories.names[marker] for marker in _markers(project, correction)]
        if correction.kind == "apart":
            apart.append(names)
        elif correction.kind in {"together", "move"}:
            together.append(names[:2] if correction.kind == "move" else names)
            apart += [[names[0], old] for old in names[2:] if correction.kind == "move"]
    wishes = {"together": together, "apart": apart}
    return {name: groups for name, groups in wishes.items() if groups}


def number_of(project: Project, kind: str) -> int | None:
    """Return the number of markers or limbs that was stated last, or None."""
    stated = [int(correction.value) for correction in project.corrections if correction.kind == kind]
    return stated[-1] if stated else None


def joint_wishes(project: Project, monitor: Monitor) -> dict[str, Any]:
    """Return what `find_joints` is told: pairs of limbs that are joined, or are not, and the root."""
    pairs: dict[tuple[int, int], bool] = {}
    wishes: dict[str, Any] = {}
    for correction in _of_stage(project, "joints", monitor):
        limbs = _limbs(project, correction)
        if correction.kind == "root":
            wishes["root"] = limbs[0]
        else:
            pairs[min(limbs), max(limbs)] = correction.kind == "join"
    for name, wanted in (("joined", True), ("parted", False)):
        if wanted in pairs.values():
            wishes[name] = [pair for pair, is_there in pairs.items() if is_there is wanted]
    return wishes


def known_kinds(project: Project, monitor: Monitor) -> dict[int, str]:
    """Return kinds of joints that the user knows, by the joint's child limb."""
    kinds: dict[int, str] = {}
    parents = project.topology.parents
    for correction in _of_stage(project, "skeleton", monitor):
        first, second = _limbs(project, correction)
        child = second if parents[second] == first else first if parents[first] == second else -1
        if child < 0:
            monitor.notice(f"not obeyed, for the tree has no such joint: {correction.sentence}")
        else:
            kinds[child] = correction.value
    return kinds


def _labels_edited(project: Project, correction: Correction) -> Project:
    """The labels with one more correction; a new name changes nothing else."""
    from skelgen.stages.labels import edited, judged_again  # noqa: PLC0415 - loads scipy

    edits = edited(project.trajectories, (correction,))
    if correction.kind == "rename":
        return project.renamed(edits.trajectories.names)
    labelling = project.labelling if project.has_labelling else None
    if labelling is not None:
        labelling = judged_again(labelling, edits, isinstance(project.take, PointCloud))
    report = project.reports["labels"]
    said = tuple(dict.fromkeys((*report.notices, correction.sentence, *edits.notices)))
    return project.with_trajectories(edits.trajectories, replace(report, notices=said), labelling)


def _of_stage(project: Project, stage: str, monitor: Monitor) -> list[Correction]:
    for sentence in _said(project, stage):
        monitor.notice(sentence)
    return [correction for correction in project.corrections if correction.stage == stage and correction.names]


def _said(project: Project, stage: str) -> list[str]:
    return [f"as you said: {one.sentence}" for one in project.corrections if one.stage == stage]


def _markers(project: Project, correction: Correction) -> list[int]:
    return [_marker(project.trajectories, correction, which) for which in range(len(correction.names))]


def _limbs(project: Project, correction: Correction) -> list[int]:
    limbs = [int(project.limbs.limb_of_marker[marker]) for marker in _markers(project, correction)]
    for name, limb in zip(correction.names, limbs, strict=True):
        if limb < 0:
            raise InputError(f"the correction '{correction.sentence}' names {name}, which is on no limb; take it back")
    if len(limbs) == 2 and limbs[0] == limbs[1]:
        first, second = correction.names
        raise InputError(
            f"the correction '{correction.sentence}' is about a joint, but {first} and {second} share a limb now; "
            "take it back"
        )
    return limbs


def _marker(trajectories: Trajectories, correction: Correction, which: int) -> int:
    return named_marker(correction, which, trajectories.names, partial(_row, trajectories))


def _row(trajectories: Trajectories, frame: int) -> Floats:
    return trajectories.positions[frame] if frame < trajectories.n_frames else np.empty((0, 3))
