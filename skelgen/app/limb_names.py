"""What the limbs of a project are called: as the user says, as the bodies of the take are, or by names of markers."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from skelgen.app.constraints import corrected_marker
from skelgen.errors import InputError
from skelgen.model import Limbs, Poses, Project
from skelgen.model.corrections import Correction
from skelgen.progress import SILENT, Monitor


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
    worn = str(project.reports["limbs"].parameters.get("marker_set", "auto")) if "limbs" in project.reports else "auto"
    return project.with_limb_names(named_limbs(project, project.limbs, worn).names)


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
        Is told which marker set is recognised.

    Raises
    ------
    InputError
        If a correction names a marker that does not exist, or calls two limbs the same.
    """
    if isinstance(project.take, Poses):
        names = list(project.take.names)
    elif marker_set == "none":
        names = list(replace(limbs, names=()).names)
    else:
        from skelgen.stages.names import find_marker_set, name_limbs, recognised_set  # noqa: PLC0415 - reads tables

        markers = project.trajectories.names
        worn = recognised_set(markers) if marker_set == "auto" else find_marker_set(marker_set, markers)
        if worn is not None:
            monitor.notice(worn.sentence)
        names = list(name_limbs(limbs, markers, worn))
    for correction in (one for one in project.corrections if one.kind == "name"):
        limb = _limb_of(project, limbs, correction)
        if correction.value in names and names.index(correction.value) != limb:
            names[names.index(correction.value)] = f"limb{names.index(correction.value)}"
        names[limb] = correction.value
    return replace(limbs, names=tuple(names))


def with_names_of_limbs(sentence: str, limbs: Limbs) -> str:
    """Return a sentence of a stage with the names of limbs in the place of their numbers.

    Parameters
    ----------
    sentence : str
        It speaks of ``limb 3``, ``limbs 3 and 4``, ``limb 3 and 4`` or ``limbs 3, 4 and 5``.
    limbs : Limbs
        What they are called; limbs without a name keep their numbers.
    """

    def named(match: re.Match[str]) -> str:
        numbers = [int(number) for number in re.findall(r"[0-9]+", match[0])]
        if any(number >= limbs.n_limbs or limbs.called(number) == f"limb {number}" for number in numbers):
            return match[0]
        return re.sub(r"(?:limbs? )?([0-9]+)", lambda number: limbs.names[int(number[1])], match[0])

    return re.sub(r"\blimbs? [0-9]+(?:(?:, | and (?:limb )?)[0-9]+\b)*(?![.,]?[0-9])", named, sentence)


def _limb_of(project: Project, limbs: Limbs, correction: Correction) -> int:
    """The limb that most of a correction's markers are on."""
    markers = [corrected_marker(project.trajectories, correction, which) for which in range(len(correction.names))]
    on_limbs = [limb for limb in limbs.limb_of_marker[markers].tolist() if limb >= 0]
    if not on_limbs:
        raise InputError(f"the correction '{correction.sentence}' names no marker that is on a limb; take it back")
    return int(max(sorted(set(on_limbs)), key=on_limbs.count))
