"""Markers that stand still to within their noise until the end of a take while others move, and what is asked of them.

What is fixed in the room shows white noise: its successive differences have twice the variance of its positions, von
Neumann's ratio (Annals of Mathematical Statistics 12, 1941). A body that holds still sways, however little, so that its
ratio is lower.
"""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from skelgen.app.constraints import corrected_marker
from skelgen.errors import InputError
from skelgen.model import Project, Trajectories
from skelgen.model.arrays import Floats
from skelgen.model.corrections import names_after
from skelgen.model.questions import LEFT_OUT_SHARE, Question, by_worth, questions_on

STILL_SECONDS = 2.0
"""s; shorter rests do not count."""

_END_SECONDS = 1.0
"""s; the end of a path, from which place and noise of the marker are estimated."""

_OFF_PLACE = 5.0
"""Standard deviations of the noise; a resting marker is never farther from its place."""

_ROUNDING = 1e-3
"""mm; resolution of positions in files: less noise than that counts as none."""

_WHITE = 3.0
"""Standard deviations by which the ratio of white noise may be below 2."""

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
    found = [(marker, _rest_begins(markers, marker)) for marker in range(markers.n_markers)]
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


def _rest_begins(markers: Trajectories, marker: int) -> int | None:
    """The frame from which on a marker stands still; None if it does not, or not for long."""
    frames = np.flatnonzero(markers.seen[:, marker])
    path, least = markers.positions[frames, marker], max(3, round(STILL_SECONDS * markers.rate))
    if len(path) < least:
        return None
    end = path[-max(3, round(_END_SECONDS * markers.rate)) :]
    place = np.median(end, axis=0)
    noise = float(np.sqrt(np.square(end - place).mean()))
    limit = _OFF_PLACE * noise + _ROUNDING
    if np.abs(path[-least:] - place).max() > limit:  # of most markers, without a look at all of a long take
        return None
    away = np.flatnonzero(np.abs(path - place).max(axis=1) > limit)
    begin = int(away[-1]) + 1 if len(away) else 0
    return int(frames[begin]) if _is_white(path[begin:]) else None


def _is_white(path: Floats) -> bool:
    """Whether positions (n, 3) vary by noise alone."""
    variance = float(path.var(axis=0).sum())
    if variance <= _ROUNDING**2:
        return True
    ratio = float(np.square(np.diff(path, axis=0)).mean(axis=0).sum()) / variance
    return bool(ratio > 2.0 - _WHITE * 2.0 / np.sqrt(len(path)))
