"""Markers that stand still until the end of a take while others move, and what is asked of them."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from skelgen.app.constraints import corrected_marker
from skelgen.errors import InputError
from skelgen.geometry.standing import rest_begins
from skelgen.model import Project
from skelgen.model.corrections import names_after
from skelgen.model.questions import LEFT_OUT_SHARE, Question, by_worth, questions_on

_OF_A_LIMB = 3
"""If so many markers of a limb stand still together, the limb rests, and its markers are all right."""


def standing_markers(project: Project) -> tuple[tuple[int, int], ...]:
    """Find markers that stand still until they are last seen, though most others move and their limbs do not rest.

    Parameters
    ----------
    project : Project
        With labels; without limbs all markers count as one limb.

    Returns
    -------
    tuple of (int, int)
        Marker, and the frame from which on it stands still; not of markers that the user has confirmed.
    """
    markers = project.trajectories
    found = [(marker, rest_begins(markers.positions[:, marker], markers.rate)) for marker in range(markers.n_markers)]
    still = [(marker, first) for marker, first in found if first is not None]
    if 2 * len(still) >= markers.n_markers:
        return ()
    limbs = project.limbs.limb_of_marker if project.has("limbs") else np.zeros(markers.n_markers, dtype=np.intp)
    counts = np.bincount(limbs[[marker for marker, _ in still]] + 1, minlength=1)
    counts[0] = 0 if project.has("limbs") else counts[0]  # on no limb
    single = [(marker, first) for marker, first in still if counts[limbs[marker] + 1] < _OF_A_LIMB]
    confirmed = _confirmed(project) if single else set()
    return tuple((marker, first) for marker, first in single if marker not in confirmed)


def open_questions(project: Project) -> tuple[Question, ...]:
    """Return what the labels of a project leave open, what settles most first.

    Beside what labels say of themselves (`questions_on`) it is asked whether what stands still is a marker on a body: a
    reflection that stays is as steady as any marker. What the user has named, confirmed or deleted is not asked for.

    Parameters
    ----------
    project : Project
        With or without labels.
    """
    if not project.has_labelling:
        return ()
    seen = project.trajectories.seen
    stated = {one.name for one in project.identities.entries} if project.identities is not None else set()
    by_user = {marker for marker, name in enumerate(project.trajectories.names) if name in stated}
    found = [one for one in questions_on(project.labelling) if one.kind != "real" or one.markers[0] not in by_user]
    for marker, first in standing_markers(project):
        frames = np.flatnonzero(seen[first:, marker]) + first
        last, settles = int(frames[-1]), LEFT_OUT_SHARE * len(frames)
        found.append(Question("still", (marker,), first, last, settles, spans=((first, last),)))
    return by_worth(found)


def _confirmed(project: Project) -> set[int]:
    """Markers that the user has confirmed, whatever they were called then: by their places, or by later names."""
    found: set[int] = set()
    for one, called in zip(project.corrections, names_after(project.corrections), strict=True):
        for which, name in enumerate(called if one.kind == "confirm" else ()):
            now = replace(one, names=(name,), places=one.places[which : which + 1])
            with suppress(InputError):  # it is no more
                found.add(corrected_marker(project.trajectories, now, 0))
    return found
