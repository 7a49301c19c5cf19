"""What the user states: corrections are added, taken back, applied to labels at once; points are said to be markers."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from skelgen_formats.identities_csv import read_identities

from skelgen.app import limb_names
from skelgen.app.constraints import check_no_contradiction, corrected_marker, corrections_of
from skelgen.errors import InputError
from skelgen.model import Identities, Identity, Labelling, PointCloud, Project, Trajectories
from skelgen.model.arrays import Ints
from skelgen.model.corrections import RULES, Correction, Place
from skelgen.model.limbs import BODY_END, body_and_limb
from skelgen.progress import Monitor, listed

EDITS = frozenset({"merge", "split", "rename", "delete", "swap", "confirm", "smooth"})
"""Kinds of corrections that change labels at once, without a new run."""


OBEYED_BY_SUBJECT = EDITS | {"name", "name-joint", "fill"}
"""Kinds that a take obeys although a calibrated skeleton labels it; of limbs and joints the skeleton decides."""


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
        If it names a marker or a frame that does not exist, says what is so already, or contradicts another one.
    """
    last = max(correction.first_frame or 0, correction.last_frame or 0)
    if last >= project.take.n_frames:
        raise InputError(f"{correction.kind}: there is no frame {last}; the last one is {project.take.n_frames - 1}")
    if correction.kind == "move" and project.has("limbs"):
        correction = _with_whole_limb(project, correction)
    if project.has("labels"):
        check_no_contradiction(project, correction)
    added = replace(project, corrections=(*project.corrections, correction))
    if correction.kind in EDITS and project.has("labels"):
        return _with_edited_labels(added, correction)
    for which in range(len(correction.names)):
        if project.has("labels"):
            corrected_marker(project.trajectories, correction, which)  # raises if it does not exist
    if correction.kind == "fill":
        return added
    if correction.kind == "name":
        return _renamed_limbs(added) if project.has("limbs") else added
    if correction.kind == "name-joint":
        return _with_named_joint(added, correction) if project.has("skeleton") else added
    return added.before(correction.stage)


def without_correction(project: Project, index: int) -> Project:
    """Return a project without one of its corrections; the results of its stage and of all after it are dropped.

    Of a take that a calibrated skeleton labelled, those stay that the correction did not change: see
    `skelgen.app.taking_back.taken_back` for the others.

    Parameters
    ----------
    project : Project
        With corrections.
    index : int
        Which of them.
    """
    kept = (*project.corrections[:index], *project.corrections[index + 1 :])
    if project.corrections[index].kind == "fill":
        return replace(project, corrections=kept)
    if project.corrections[index].kind not in OBEYED_BY_SUBJECT and is_by_subject(project):
        return replace(project, corrections=kept)
    if project.corrections[index].kind == "name":
        bare = replace(project, corrections=kept)
        return _renamed_limbs(bare, project.corrections[index]) if project.has("limbs") else bare
    if project.corrections[index].kind == "name-joint":
        bare = replace(project, corrections=kept)
        return limb_names.renamed_joints(bare) if project.has("skeleton") else bare
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


def is_by_subject(project: Project) -> bool:
    """Return whether a calibrated skeleton labelled the take, and its limbs and joints are still the result."""
    is_labelled = project.has_labelling and bool(project.labelling.subject) and project.has("skeleton")
    return is_labelled and not project.reports["limbs"].parameters  # limbs that were found have parameters


def frames_seen_together(project: Project, names: Sequence[str]) -> int:
    """Return in how many frames two or more of some markers are seen.

    Parameters
    ----------
    project : Project
        With labels.
    names : sequence of str
        Of the markers.
    """
    columns = [project.trajectories.names.index(name) for name in names]
    return int((project.trajectories.seen[:, columns].sum(axis=1) > 1).sum())


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


def with_places(project: Project, correction: Correction, frame: int) -> Correction:
    """Return a correction with the place of each marker, by which later runs find it; unchanged if one is never seen.

    Parameters
    ----------
    project : Project
        What it is about.
    correction : Correction
        Without places.
    frame : int
        Places are those nearest in time to it.
    """
    if correction.places or not correction.names or not project.has("labels"):
        return correction
    names, seen = project.trajectories.names, project.trajectories.seen
    if not all(name in names and seen[:, names.index(name)].any() for name in correction.names):
        return correction
    places = tuple(place_of(project.trajectories, names.index(name), frame) for name in correction.names)
    return replace(correction, places=places)


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
    if not any(correction.kind in EDITS for correction in project.corrections):
        return trajectories, labelling
    from skelgen.stages.labels import apply_corrections, corrected_quality  # noqa: PLC0415 - loads scipy

    corrections_of(project, "labels", monitor)
    edits = apply_corrections(trajectories, project.corrections)
    for sentence in edits.notices:
        monitor.notice(sentence)
    if labelling is not None:
        labelling = corrected_quality(labelling, edits, isinstance(project.take, PointCloud))
    return edits.trajectories, labelling


def with_stated_limb_names(project: Project) -> Project:
    """Return a project in which limbs and joints that the user named are called so, and all others as they are.

    Parameters
    ----------
    project : Project
        With a skeleton.
    """
    named = project.with_limb_names(
        limb_names.names_with_stated(project.limbs.names, limb_names.stated_names(project, project.limbs))
    )
    stated = limb_names.with_joint_names(named, named.skeleton).joints
    joints = (new if new.name else old for new, old in zip(stated, named.skeleton.joints, strict=True))
    return named.with_skeleton(replace(named.skeleton, joints=tuple(joints)), named.motion, named.reports["skeleton"])


def _renamed_limbs(project: Project, taken_back: Correction | None = None) -> Project:
    """The project with limbs as its corrections call them; other limbs of a calibrated skeleton keep their names."""
    if not is_by_subject(project):
        return limb_names.renamed_limbs(project)
    names = list(project.limbs.names)
    if taken_back is not None:
        limb, bodies = limb_names.limb_of(project, project.limbs, taken_back), project.bodies
        found = limb_names.renamed_limbs(project).limbs.names[limb]
        body = next((body.name for body in bodies if limb in body.limbs), "")
        names[limb] = f"{body}{BODY_END}{body_and_limb(found)[1]}" if len(bodies) > 1 else found
    return project.with_limb_names(limb_names.names_with_stated(names, limb_names.stated_names(project, project.limbs)))


def _with_named_joint(project: Project, correction: Correction) -> Project:
    """The project with one more name of a joint; refuse it if the limbs share none."""
    ends = [corrected_marker(project.trajectories, correction, which) for which in (0, 1)]
    one, other = project.limbs.limb_of_marker[ends].tolist()
    tree = [{joint.parent, joint.child} for joint in project.skeleton.joints]
    if {one, other} not in tree:
        names = project.skeleton.limb_names
        near = [names[limb] for pair in tree if one in pair for limb in pair - {one}]
        what = f"{names[one]} is joined to {listed(near) or 'no limb'}" if one != other else f"both are on {names[one]}"
        raise InputError(f"there is no joint between the limbs of {listed(correction.names)}: {what}")
    return limb_names.renamed_joints(project)


def _with_edited_labels(project: Project, correction: Correction) -> Project:
    """The project with corrected labels; results after them are kept if a marker is renamed or confirmed.

    A calibrated skeleton stays in any case, and is posed anew.
    """
    from skelgen.stages.labels import (  # noqa: PLC0415 - loads scipy
        apply_corrections,
        corrected_quality,
        stated_positions,
    )

    edits = apply_corrections(project.trajectories, (correction,))
    if correction.kind == "rename":
        return project.renamed(edits.trajectories.names)
    if by_subject := is_by_subject(project):
        edits = apply_corrections(project.trajectories, (correction,), by_subject=True)
    labelling = project.labelling if project.has_labelling else None
    if labelling is not None:
        stated = stated_positions(edits.trajectories, project.corrections)
        labelling = corrected_quality(labelling, edits, isinstance(project.take, PointCloud), stated)
    if correction.kind == "confirm":
        return replace(project, _labelling=labelling)
    report = project.reports["labels"]
    sentences = edits.notices if by_subject else (correction.sentence, *edits.notices)
    notices = tuple(dict.fromkeys((*report.notices, *sentences)))
    edited = project.with_trajectories(edits.trajectories, replace(report, notices=notices), labelling)
    return _reposed(project, edited) if by_subject else edited


def _reposed(before: Project, edited: Project) -> Project:
    """A project with corrected markers, and with the calibrated skeleton that it had, posed by them."""
    from skelgen.stages.subject import reposed_subject  # noqa: PLC0415 - loads scipy

    skeleton, motion = reposed_subject(before.skeleton, edited.trajectories)
    limbs, reports, n_markers = before.limbs, before.reports, len(skeleton.limb_of_marker)
    if n_markers != limbs.n_markers:
        unknown = np.full((n_markers, n_markers), np.nan)
        limbs = replace(limbs, limb_of_marker=skeleton.limb_of_marker, distance_deviation=unknown, membership=None)
    posed = edited.with_limbs(limbs, reports["limbs"]).with_topology(before.topology, reports["joints"])
    return posed.with_skeleton(skeleton, motion, reports["skeleton"])


def _with_whole_limb(project: Project, correction: Correction) -> Correction:
    """The correction with all markers of the limb that its marker goes to, so that this limb stays whole."""
    limbs, names = project.limbs, project.trajectories.names
    markers = [corrected_marker(project.trajectories, correction, which) for which in range(len(correction.names))]
    own, target = (int(limbs.limb_of_marker[marker]) for marker in markers[:2])
    if target < 0:
        raise InputError(f"{correction.names[1]} is on no limb; name a marker of the limb that it is to go to")
    if own == target:
        raise InputError(f"{correction.names[0]} is on the limb of {correction.names[1]} already")
    if len(markers) == 2:
        mates = limbs.markers_of(own).tolist() if own >= 0 else []
        markers += [mate for mate in mates if mate != markers[0]][:1]
    if len(markers) == 2:  # it leaves no other marker behind
        return replace(correction, kind="together", names=_named(names, markers, limbs.markers_of(target)), places=())
    stated = _named(names, markers, limbs.markers_of(target))
    moved = replace(correction, names=stated, places=())
    return with_places(project, moved, correction.places[0].frame) if correction.places else moved


def _named(names: Sequence[str], markers: Sequence[int], others: Ints) -> tuple[str, ...]:
    """Names of markers, and of others that are not among them."""
    return tuple(names[marker] for marker in dict.fromkeys([*markers, *others.tolist()]))


def with_identities(project: Project, identities: Identities | Path | str | None) -> Project:
    """Return a project whose labels, once they are found anew, obey what the user states; as it is without statements.

    Parameters
    ----------
    project : Project
        With or without labels.
    identities : Identities, Path, str or None
        The statements, or the file that holds them; they replace earlier ones.
    """
    stated = read_identities(identities) if isinstance(identities, Path | str) else identities
    if stated is None:
        return project
    earlier = project.identities or Identities(())
    known = set(earlier.names)
    is_own = bool(earlier.source)  # beside the lines of a file there are none but own points
    added = [one for one in earlier.entries if is_own and not one.line and one.name in stated.names]
    for name in stated.names:
        if name not in known and not _is_seen_where_stated(project, name, stated.entries):
            added += own_point(project, name)
    return replace(project, identities=Identities((*added, *stated.entries), stated.source))


def own_point(project: Project, name: str) -> tuple[Identity, ...]:
    """Return a statement on a point amid the longest track of the marker of this name, if there is one.

    Names that the program gives come anew with the labels. Beside this statement, one on another point means that the
    point goes on with the marker; alone it would make a marker of that point's track.

    Parameters
    ----------
    project : Project
        With or without labels.
    name : str
        What the marker is called now.
    """
    if not isinstance(project.take, PointCloud) or not project.has_labelling or project.labelling.tracklets is None:
        return ()
    markers, tracklets = project.trajectories, project.labelling.tracklets
    marker = markers.names.index(name) if name in markers.names else -1
    parts = np.flatnonzero((tracklets.marker == marker) & (marker >= 0))
    if not len(parts):
        return ()
    longest = parts[tracklets.n_points[parts].argmax()]
    first, last = int(tracklets.first[longest]), int(tracklets.last[longest])
    frames = first + np.flatnonzero(markers.seen[first : last + 1, marker])
    if not len(frames):
        return ()
    frame = int(frames[len(frames) // 2])
    x, y, z = markers.positions[frame, marker].tolist()
    return (Identity(name, frame, (x, y, z)),)


def _is_seen_where_stated(project: Project, name: str, stated: Sequence[Identity]) -> bool:
    """Whether the marker of this name is seen where it is stated: then its point may be meant to be another one's."""
    if not project.has("labels") or name not in project.trajectories.names:
        return False
    seen = project.trajectories.seen[:, project.trajectories.names.index(name)]
    return any(one.name == name and one.frame < len(seen) and bool(seen[one.frame]) for one in stated)
