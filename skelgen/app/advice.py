"""What the user could do about doubtful labels, and is asked: short sentences that follow from the facts of a project.

Markers that stand still until the end of a take while others move may have fallen off.
"""

from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace

import numpy as np

from skelgen.app.constraints import corrected_marker
from skelgen.errors import InputError
from skelgen.geometry.standing import rest_begins
from skelgen.model import Labelling, PointCloud, Project, Trajectories
from skelgen.model.arrays import Ints
from skelgen.model.corrections import names_after
from skelgen.model.labelling import Doubt, seen_runs
from skelgen.model.questions import LEFT_OUT_SHARE, Question, by_worth, questions_on

RARELY_SEEN = 0.2
"""Share of the frames; of a marker that is seen in fewer, the advice says so."""

_OFTEN_MISSING = 0.85
"""Mean share of the frames in which markers are seen; if it is lower, the advice is about cameras."""

_MANY_GHOSTS = 0.02
"""Share of all points that belong to no marker; if it is higher, the advice is about ghosts."""

_MANY_DOUBTS = 0.1
"""Share of all positions in doubtful spans; if it is higher, all labels are to be checked."""

_MANY_LOSSES = 30.0
"""Losses per marker and minute; if there are more, the advice is about how points are followed."""

_LONG_SECONDS = 1.0
"""s; tracks of false points are usually shorter."""

_LEAST_OF_BODY = 4
"""Tracks left out at once that may be a body: the pose of three markers is free, a fourth one shows that they belong
together."""

_LASTING_SECONDS = 0.25
"""s; if a marker is off its place for a shorter time, the advice does not mention it."""

UNREAL = ("piece", "alone")
"""Kinds of doubt that question whether the marker exists."""

MOST_NAMED = 4
"""Markers that a sentence names; the rest is counted."""

REMEDIES = {
    "piece": "if the two are one marker, give the number of markers or name both by hand",
    "alone": "a reflection? a larger min_range drops such short tracks",
    "rare": "if it is a marker of its own, name it by hand; otherwise give the number of markers",
    "rival": "look there; if it is wrong, name the marker in one of these frames by hand",
    "misfit": "see whether the marker was touched, has slipped, or a false point was taken for it",
    "unsupported": "one more marker on its limb, or a camera that sees the others there",
    "repaired": "compare one of these frames with the video",
}
"""What can be done about a doubtful span of each kind."""


def advice_on(project: Project) -> tuple[str, ...]:
    """Return what the user could do for surer labels, the most useful first.

    Parameters
    ----------
    project : Project
        With or without `labelling`; without it there is no advice.
    """
    if not project.has_labelling or not project.trajectories.n_frames or not project.trajectories.n_markers:
        return ()
    return (*_about_standing(project), *_sentences(project.take, project.trajectories, project.labelling))


def doubtful_share(labelling: Labelling) -> float:
    """Part of all seen positions that lie in doubtful spans."""
    return float(labelling.doubtful.sum()) / max(int((~np.isnan(labelling.confidence)).sum()), 1)


def left_out_share(project: Project) -> float:
    """Part of all points of an unlabelled take that belong to no marker; 0 for other takes."""
    if not isinstance(project.take, PointCloud):
        return 0.0
    return float(project.labelling.left_out.sum()) / max(project.take.n_points, 1)


def _sentences(take: object, markers: Trajectories, labelling: Labelling) -> Iterator[str]:
    share = doubtful_share(labelling)
    if share > _MANY_DOUBTS:
        yield (
            f"{100 * share:.0f} % of all positions are doubtful: do not rely on these labels as a whole before the "
            "causes below are gone"
        )
    body = _body_left_out(markers, labelling) if labelling.subject else 0
    if body:
        yield (
            f"up to {body} tracks longer than {_LONG_SECONDS:g} s are left out at the same time: another body may be "
            "in the take; give its skeleton too, one --skeleton for each body"
        )
    yield from _about_split_markers(markers, labelling)
    yield from _about_rare_markers(markers, labelling)
    if labelling.twins:
        named = _named([f"{markers.names[one]} and {markers.names[two]}" for one, two in labelling.twins])
        yield f"no distance tells {named} apart: place the markers of such a limb less evenly"
    unsupported = Counter(doubt.marker for doubt in labelling.doubts if doubt.kind == "unsupported")
    if unsupported:
        named = _named([markers.names[marker] for marker, _ in unsupported.most_common()])
        yield f"too few markers are seen beside {named} when they come back: one more marker on such a limb helps"
    yield from _about_misfits(markers, labelling)
    if isinstance(take, PointCloud) and not body:
        yield from _about_ghosts(take, markers, labelling)
    if not body:
        yield from _about_visibility(markers)


def _about_standing(project: Project) -> Iterator[str]:
    found = standing_markers(project)
    if found:
        named = _named([f"{project.trajectories.names[marker]} from frame {first} on" for marker, first in found])
        yield (
            f"while others move, these stand still until the end: {named}; such a marker may have fallen off, or be a "
            "reflection: delete it from there on"
        )


def _about_split_markers(markers: Trajectories, labelling: Labelling) -> Iterator[str]:
    pieces = {doubt.marker: doubt.rival for doubt in labelling.doubts if doubt.kind == "piece"}
    if not pieces:
        return
    named = _named([f"{markers.names[one]} of {markers.names[whole]}" for one, whole in sorted(pieces.items())])
    suspicious = {doubt.marker for doubt in labelling.doubts if doubt.kind in UNREAL}
    likely = markers.n_markers - len(suspicious)
    if labelling.subject:
        yield f"some markers look like pieces of others ({named}): name them by hand"
        return
    yield (
        f"some markers look like pieces of others ({named}): if the body carries {likely}, say so with --n-markers, or "
        "name them by hand"
    )


def _about_rare_markers(markers: Trajectories, labelling: Labelling) -> Iterator[str]:
    shares = markers.seen.mean(axis=0)
    shares[[doubt.marker for doubt in labelling.doubts if doubt.kind in UNREAL]] = 0.0  # another sentence is about them
    rare = np.flatnonzero((shares < RARELY_SEEN) & (shares > 0))
    if len(rare):
        named = _named([f"{markers.names[one]} in {100 * shares[one]:.0f} %" for one in rare[np.argsort(shares[rare])]])
        yield f"seen in few of the frames: {named}; leave them out, or move a camera so that it sees them"


def _about_misfits(markers: Trajectories, labelling: Labelling) -> Iterator[str]:
    least = _LASTING_SECONDS * markers.rate
    worst = [doubt for doubt in labelling.doubts if doubt.kind == "misfit" and _n_frames(doubt) >= least]
    if worst:
        one = max(worst, key=_n_frames)
        yield (
            f"{markers.names[one.marker]} is not where it should be in frames {one.first_frame} to {one.last_frame}: "
            "see whether it was touched, has slipped, or is a false point"
        )


def _about_ghosts(take: PointCloud, markers: Trajectories, labelling: Labelling) -> Iterator[str]:
    share = float(labelling.left_out.sum()) / max(take.n_points, 1)
    if share > _MANY_GHOSTS:
        yield (
            f"{100 * share:.1f} % of the points belong to no marker: raise the cameras' threshold, or cover what "
            "shines in the room"
        )
    long = len(_long_lost_tracks(markers, labelling)[0])
    if long:
        what = "1 track is" if long == 1 else f"{long} tracks are"
        remedy = "name it by hand" if labelling.subject else "try --n-markers with one more"
        yield (
            f"{what} left out although they last longer than {_LONG_SECONDS:g} s: a reflection, or a marker that "
            f"was not recognised; {remedy}"
        )


def _body_left_out(markers: Trajectories, labelling: Labelling) -> int:
    """How many long tracks are left out at the same time, if there are as many as a body has; else 0."""
    first, last = _long_lost_tracks(markers, labelling)
    change = np.zeros(markers.n_frames + 1, dtype=np.intp)
    np.add.at(change, first, 1)
    np.add.at(change, last + 1, -1)
    most = int(np.cumsum(change).max())
    return most if most >= _LEAST_OF_BODY else 0


def _long_lost_tracks(markers: Trajectories, labelling: Labelling) -> tuple[Ints, Ints]:
    """First and last frames of long tracks that belong to no marker."""
    tracklets = labelling.tracklets
    if tracklets is None:
        return np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp)
    first, last = tracklets.spans
    lost = last - first + 1 >= _LONG_SECONDS * markers.rate
    lost[tracklets.track[tracklets.marker >= 0]] = False
    return first[lost], last[lost]


def _about_visibility(markers: Trajectories) -> Iterator[str]:
    seen = markers.seen[:, markers.seen.any(axis=0)]  # who is never there is no matter of cameras
    if seen.size and seen.mean() < _OFTEN_MISSING:
        yield f"markers are seen in {100 * seen.mean():.0f} % of the frames on average: more cameras see more"
    minutes = markers.n_frames / markers.rate / 60.0
    losses = (len(seen_runs(seen)[0]) - markers.n_markers) / markers.n_markers / max(minutes, 1.0 / 60.0)
    if losses > _MANY_LOSSES:
        yield f"a marker is lost {losses:.0f} times a minute: more cameras, or a higher frame rate, keep it longer"


def _n_frames(doubt: Doubt) -> int:
    return doubt.last_frame - doubt.first_frame + 1


def _named(items: list[str]) -> str:
    shown = ", ".join(items[:MOST_NAMED])
    return f"{shown} and {len(items) - MOST_NAMED} more" if len(items) > MOST_NAMED else shown


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
