"""What the limbs of a project are called: as the user says, as the bodies of the take are, by names of markers, or by
shape and motion; and the tables in which the user says it: names of limbs, and a hierarchy.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from skelgen_formats.classic_texts import LIMB_COLUMNS
from skelgen_formats.options import OWN_NAMES
from skelgen_formats.text import split_cells, undefused

from skelgen.app.constraints import corrected_marker
from skelgen.errors import FormatError, InputError
from skelgen.files import read_content
from skelgen.model import Limbs, Motion, Poses, Project, Skeleton
from skelgen.model.arrays import Ints
from skelgen.model.corrections import Correction
from skelgen.model.limbs import BODY_END, names_of_bodies
from skelgen.model.topology import limbs_of_bodies
from skelgen.progress import SILENT, Monitor

if TYPE_CHECKING:
    from skelgen.stages.names import WornShape


_Value = TypeVar("_Value")


def with_stated_names(project: Project, names: Mapping[str, str]) -> Project:
    """Return a project in which limbs are called as the user says; later runs obey.

    Parameters
    ----------
    project : Project
        With or without limbs.
    names : mapping of str to str
        A marker on each limb, and the limb's name.
    """
    stated = tuple(Correction("name", (marker,), value=name) for marker, name in names.items())
    project = replace(project, corrections=(*project.corrections, *stated))
    return renamed_limbs(project) if stated and project.has("limbs") else project


def renamed_limbs(project: Project) -> Project:
    """Return a project whose limbs are called as its corrections say now; nothing is computed anew.

    Parameters
    ----------
    project : Project
        With limbs.
    """
    worn = marker_set_of(project)
    if project.has("skeleton"):
        return project.with_limb_names(names_in_motion(project, project.skeleton, project.motion, worn))
    limbs = _of_trees(project.limbs, project.topology.parents) if project.has("joints") else project.limbs
    return project.with_limb_names(named_limbs(project, limbs, worn).names)


def with_segment_names(value: _Value, bone_names: object) -> _Value | Project:
    """Return a project in which limbs that the user renamed are called as segments of a person, for a bone profile.

    A name of the user's that is itself that of a segment stays.

    Parameters
    ----------
    value : Project or another
        What will be written; only a project with a skeleton changes.
    bone_names : object
        The profile, one of the choices of `skelgen_formats.options.BONE_NAMES`; without one the project stays as it is.
    """
    from skelgen_formats.bone_profiles import is_segment  # noqa: PLC0415 - reads tables

    if bone_names in (None, OWN_NAMES) or not isinstance(value, Project) or not value.has("skeleton"):
        return value
    others = tuple(one for one in value.corrections if one.kind != "name")
    if others == value.corrections:
        return value
    own = value.skeleton.limb_names
    found = renamed_limbs(replace(value, corrections=others)).skeleton.limb_names
    pairs = zip(own, found, strict=True)
    segments = [old if is_segment(old) or not is_segment(new) or new in own else new for old, new in pairs]
    return value.with_limb_names(segments)


def renamed_joints(project: Project) -> Project:
    """Return a project whose joints are called as its corrections say now; nothing is computed anew.

    Parameters
    ----------
    project : Project
        With a skeleton.
    """
    skeleton = with_joint_names(project, project.skeleton)
    return project.with_skeleton(skeleton, project.motion, project.reports["skeleton"])


def with_joint_names(project: Project, skeleton: Skeleton) -> Skeleton:
    """Return a skeleton with the names that corrections give its joints; limbs that it does not join are passed over.

    Parameters
    ----------
    project : Project
        With limbs and corrections.
    skeleton : Skeleton
        Of these limbs.

    Raises
    ------
    InputError
        If a correction names a marker that does not exist.
    """
    stated: dict[frozenset[int], str] = {}
    for correction in (one for one in project.corrections if one.kind == "name-joint"):
        ends = (corrected_marker(project.trajectories, correction, which) for which in (0, 1))
        stated[frozenset(int(project.limbs.limb_of_marker[end]) for end in ends)] = correction.value
    joints = (replace(one, name=stated.get(frozenset((one.parent, one.child)), "")) for one in skeleton.joints)
    return replace(skeleton, joints=tuple(joints))


def marker_set_of(project: Project) -> str:
    """Return the marker set that the limbs of a project were found with: a name, ``auto`` or ``none``."""
    return str(project.reports["limbs"].parameters.get("marker_set", "auto")) if "limbs" in project.reports else "auto"


def names_in_motion(
    project: Project, skeleton: Skeleton, motion: Motion, marker_set: str, monitor: Monitor = SILENT
) -> tuple[str, ...]:
    """Return the names of limbs, by their shape and motion if nothing else names them.

    Parameters
    ----------
    project : Project
        With limbs.
    skeleton, motion : Skeleton and Motion
        Of these limbs.
    marker_set : str
        See `named_limbs`; ``none`` gives no names by shape either.
    monitor : Monitor
        Receives a notice of what the shape is, and of where it contradicts names of sides.
    """
    limbs = _of_trees(project.limbs, skeleton.parents)
    names = named_limbs(project, limbs, marker_set).names
    if marker_set == "none" or isinstance(project.take, Poses) or not motion.n_frames:
        return names
    from skelgen.stages.names import contradicts_sides, names_by_shape  # noqa: PLC0415 - reads tables

    stated = stated_names(project, limbs)
    if any(name != f"limb{limb}" for limb, name in enumerate(names) if limb not in stated):
        if contradicts_sides(replace(skeleton, limb_names=names), motion):
            monitor.notice(
                "the names say left where bending knees and feet say right: the recording is mirrored, or the names of "
                "both sides are exchanged"
            )
        return names
    found = names_by_shape(skeleton, motion, stated, lambda: worn_by_shape(project))
    for sentence in found.sentences:
        monitor.notice(sentence)
    return names_with_stated(found.names, stated)


def _of_trees(limbs: Limbs, parents: Ints) -> Limbs:
    """Limbs without names; each tree is a body."""
    body_of_limb = np.zeros(limbs.n_limbs, dtype=np.intp)
    for body, members in enumerate(limbs_of_bodies(parents)):
        body_of_limb[members] = body
    return replace(limbs, names=(), body_of_limb=body_of_limb, body_probability=np.zeros(0))


def worn_by_shape(project: Project) -> list[WornShape]:
    """Return the marker sets whose shape the markers of a body have; left and right may be exchanged.

    Parameters
    ----------
    project : Project
        With limbs.
    """
    from skelgen.stages.limbs import markers_of_set  # noqa: PLC0415 - loads the stage
    from skelgen.stages.names import MARKER_SET_CHOICES, WornShape, find_marker_set, name_limbs  # noqa: PLC0415

    limbs, found = project.limbs, []
    for body in range(limbs.n_bodies):
        markers = np.flatnonzero((limbs.limb_of_marker >= 0) & (limbs.body_of_limb[limbs.limb_of_marker] == body))
        on_limbs = project.trajectories.positions[:, markers], limbs.limb_of_marker[markers]
        alike = markers_of_set(*on_limbs) if len(markers) else None
        if alike is None or alike[0] not in MARKER_SET_CHOICES:
            continue
        names = [f"M{marker}" for marker in range(limbs.n_markers)]
        for marker, name in zip(markers.tolist(), alike[1], strict=True):
            names[marker] = name or names[marker]
        worn = find_marker_set(alike[0], names)
        called = enumerate(name_limbs(limbs, names, worn))
        own = {limb: one for limb, one in called if one != f"limb{limb}" and limbs.body_of_limb[limb] == body}
        found.append(WornShape(own, alike[2], worn.title))
    return found


def names_of_shape(project: Project) -> list[str]:
    """What the marker sets whose shape the markers have call the limbs; left and right may be exchanged."""
    names = [f"limb{limb}" for limb in range(project.limbs.n_limbs)]
    for worn in worn_by_shape(project):
        for limb, name in worn.called.items():
            names[limb] = name
    return names


def named_limbs(project: Project, limbs: Limbs, marker_set: str, monitor: Monitor = SILENT) -> Limbs:
    """Return limbs with their names.

    Parameters
    ----------
    project : Project
        With labels.
    limbs : Limbs
        What is named.
    marker_set : str
        ``auto``, ``none`` or a marker set; see `skelgen.stages.names.MARKER_SET_CHOICES`.
    monitor : Monitor
        Receives a notice of the marker set that is recognised.

    Raises
    ------
    InputError
        If a correction names a marker that does not exist, or calls two limbs the same.
    """
    if isinstance(project.take, Poses):
        names = project.take.names
    elif project.trajectories.are_keypoints:
        from skelgen.stages.names import name_bones  # noqa: PLC0415 - reads tables

        names = name_bones(limbs, project.trajectories.names)
    elif marker_set == "none":
        names = replace(limbs, names=()).names
    else:
        from skelgen.stages.names import (  # noqa: PLC0415 - reads tables
            find_marker_set,
            name_limbs,
            recognised_set,
            set_among_others,
        )

        markers = project.trajectories.names
        worn = recognised_set(markers) if marker_set == "auto" else find_marker_set(marker_set, markers)
        if worn is not None:
            monitor.notice(worn.sentence)
        elif (likely := set_among_others(markers)) is not None:
            monitor.notice(likely.hint)
        names = name_limbs(limbs, markers, worn)
    return replace(limbs, names=names_with_stated(names, stated_names(project, limbs)))


def stated_names(project: Project, limbs: Limbs) -> dict[int, str]:
    """Return the names that corrections of a project give its limbs; errors as `named_limbs`.

    The limb that is named last has the name alone; limbs of two bodies may be called alike, and the one that is named
    later has the name of its body before it.

    Parameters
    ----------
    project : Project
        With labels.
    limbs : Limbs
        What is named.
    """
    stated: dict[int, str] = {}
    body_of = {int(limb): body for body, members in enumerate(limbs.bodies) for limb in members}
    called = names_of_bodies(limbs.bodies, limbs.names)
    for correction in (one for one in project.corrections if one.kind == "name"):
        limb, name = limb_of(project, limbs, correction), correction.value
        if any(one == name and body_of[other] != body_of[limb] for other, one in stated.items()):
            name = f"{called[body_of[limb]]}{BODY_END}{name}"
        stated = {other: one for other, one in stated.items() if one != name} | {limb: name}
    return stated


def names_with_stated(names: Sequence[str], stated: Mapping[int, str]) -> tuple[str, ...]:
    """Return names of limbs with those that the user gave; another limb that had such a name gets its number.

    Parameters
    ----------
    names : sequence of str, length n_limbs
        Without them.
    stated : mapping of int to str
        From `stated_names`.
    """
    taken = set(stated.values())
    rest = (f"limb{limb}" if name in taken else name for limb, name in enumerate(names))
    return tuple(stated.get(limb, name) for limb, name in enumerate(rest))


def limb_of(project: Project, limbs: Limbs, correction: Correction) -> int:
    """Return the limb that most of a correction's markers are on; raise `InputError` if none is on a limb.

    Parameters
    ----------
    project : Project
        With labels.
    limbs : Limbs
        Of its markers.
    correction : Correction
        It names markers.
    """
    markers = [corrected_marker(project.trajectories, correction, which) for which in range(len(correction.names))]
    on_limbs = [limb for limb in limbs.limb_of_marker[markers].tolist() if limb >= 0]
    if not on_limbs:
        raise InputError(f"the correction '{correction.sentence}' names no marker that is on a limb; take it back")
    return int(max(sorted(set(on_limbs)), key=on_limbs.count))


def read_hierarchy(path: Path | str) -> dict[str, str]:
    """Read a hierarchy: a line ``child,parent`` for every limb, the parent of a root left empty.

    Lines that begin with ``#`` and empty lines are skipped.

    Raises
    ------
    FormatError
        If a line has another form, or a child has two parents.
    """
    return _read_pairs(Path(path), "child,parent", "limb")


def read_limb_names(path: Path | str) -> dict[str, str]:
    """Read names of limbs: a line ``marker,name`` calls the limb of the marker by the name.

    Lines that begin with ``#``, empty lines, and a header ``marker,name`` are skipped. The table of limbs that a run
    writes (``take.limbs.csv``) is read, too: it names those limbs that have more than their number.

    Raises
    ------
    FormatError
        If a line has another form, or a marker stands twice.
    """
    path = Path(path)
    lines = _lines_of(path)
    if lines and lines[0] == ",".join(LIMB_COLUMNS):
        return _names_in_table(path, lines)
    names = _read_pairs(path, "marker,name", "marker")
    nameless = next((marker for marker, name in names.items() if not name), None)
    if nameless is not None:
        raise FormatError(path, "", f"the limb of {nameless} gets no name; write marker,name")
    return names


def _names_in_table(path: Path, lines: Sequence[str]) -> dict[str, str]:
    """One marker of each limb that has more than a number, and its name."""
    names: dict[str, str] = {}
    for number, line in enumerate(lines[1:], start=2):
        row = split_cells(path, line, number, ",")
        if len(row) != len(LIMB_COLUMNS):
            raise FormatError(path, number, f"{len(row)} cells where {', '.join(LIMB_COLUMNS)} belong")
        marker, limb, name = row[0], row[1], undefused(row[2])
        if name not in {"", f"limb{limb}", *names.values()}:
            names[undefused(marker)] = name
    return names


def _lines_of(path: Path) -> list[str]:
    try:
        return read_content(path).decode("utf-8-sig").splitlines()
    except UnicodeDecodeError as error:
        raise FormatError(path, "", "is no text in UTF-8") from error


def _read_pairs(path: Path, form: str, what: str) -> dict[str, str]:
    """Map the first cell of each line to the rest of the line."""
    pairs: dict[str, str] = {}
    for number, line in enumerate(_lines_of(path), start=1):
        if not line.strip() or line.lstrip().startswith("#") or (not pairs and line.replace(" ", "").lower() == form):
            continue
        first, _, second = (part.strip() for part in line.partition(","))
        if not first or "," in second:
            raise FormatError(path, number, f"{line.strip()[:60]!r} where {form} belongs")
        if first in pairs:
            raise FormatError(path, number, f"{first!r} stands twice; a line {form} belongs to each {what}")
        pairs[first] = second
    if not pairs:
        raise FormatError(path, "", f"names no {what}; a line {form} belongs to each")
    return pairs
