"""What is to be done until all markers have their names: rows of markers, what a name means, answers to questions."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from skelgen.app.corrections import own_point
from skelgen.errors import InputError
from skelgen.model import Labelling, PointCloud, Project
from skelgen.model.arrays import Floats, Ints
from skelgen.model.corrections import NOBODY, Correction, Identities, Identity
from skelgen.model.labelling import seen_runs
from skelgen.model.questions import Question
from skelgen_gui.model import translate
from skelgen_gui.model.wording import limb_words

Span = tuple[int, int]
"""First and last frame, both included."""


@dataclass(frozen=True)
class MarkerRow:
    """A marker, and what needs work on it.

    Attributes
    ----------
    marker : int
        Its index.
    name, limb : str
        What it and its limb are called; without a limb, empty.
    seen : float
        Part of the frames in which it is seen.
    gaps : int
        Number of its gaps between frames in which it is seen.
    doubts : int
        Number of its doubtful spans.
    work : float, frames
        Frames that are expected to be called wrongly.
    """

    marker: int
    name: str
    limb: str
    seen: float
    gaps: int
    doubts: int
    work: float


def marker_rows(project: Project) -> tuple[MarkerRow, ...]:
    """Return all markers of a project with labels; what needs most work first, then what has most gaps."""
    trajectories = project.trajectories
    seen = trajectories.seen
    doubts, work = np.zeros(len(trajectories.names), dtype=np.intp), np.zeros(len(trajectories.names))
    if project.has_labelling:
        doubts, work = _doubts_of(project.labelling, len(trajectories.names))
    gaps = np.maximum((np.diff(seen.astype(np.int8), axis=0, prepend=0) == 1).sum(axis=0) - 1, 0)
    part = seen.mean(axis=0) if len(seen) else np.zeros(seen.shape[1])
    limbs = project.limbs.limb_of_marker.tolist() if project.has("limbs") else [-1] * len(part)
    rows = [
        MarkerRow(marker, name, limb_words(project, limb) if limb >= 0 else "", *numbers)
        for marker, (name, limb, *numbers) in enumerate(
            zip(trajectories.names, limbs, part.tolist(), gaps.tolist(), doubts.tolist(), work.tolist(), strict=True)
        )
    ]
    return tuple(sorted(rows, key=lambda row: (-row.work, -row.gaps, row.marker)))


def _doubts_of(labelling: Labelling, n_markers: int) -> tuple[Ints, Floats]:
    """Number of doubtful spans of each marker, and frames that are expected to be wrong in them."""
    wrong = np.nan_to_num(1.0 - labelling.confidence)
    counts, work = np.zeros(n_markers, dtype=np.intp), np.zeros(n_markers)
    for doubt in labelling.doubts:
        counts[doubt.marker] += 1
        work[doubt.marker] += wrong[doubt.first_frame : doubt.last_frame + 1, doubt.marker].sum()
    return counts, work


def set_choices() -> dict[str, str]:
    """Return the marker sets whose names are offered, with their titles."""
    from skelgen.stages.names import MARKER_SET_CHOICES, find_marker_set  # noqa: PLC0415 - reads tables

    names = (name for name in MARKER_SET_CHOICES if name not in {"auto", "none"})
    return {name: translate("Labelling", find_marker_set(name, ()).title) for name in names}


def set_of(project: Project) -> str:
    """Return the marker set whose names a project's markers have, or an empty text."""
    from skelgen.stages.names import recognised_set  # noqa: PLC0415 - reads tables

    found = recognised_set(project.trajectories.names)
    return "" if found is None else found.name


def names_left(project: Project, marker_set: str) -> tuple[str, ...]:
    """Return the names of a marker set that no marker has yet, however it is written (``r.ASIS``, ``R_ASIS``).

    Parameters
    ----------
    project : Project
        With labels.
    marker_set : str
        One of `set_choices`, or empty for none.
    """
    from skelgen.stages.names import marker_names, plain_name  # noqa: PLC0415 - reads tables

    taken = {plain_name(name) for name in project.trajectories.names}
    return tuple(name for name in marker_names(marker_set) if plain_name(name) not in taken) if marker_set else ()


def naming(project: Project, marker: int, name: str, frame: int, span: Span | None = None) -> Correction | None:
    """Return the correction that a name states which the user types for a marker; None if it states nothing.

    A new name renames the marker. The name of another marker merges both if they are never seen at the same time;
    otherwise it swaps them, in a span that the user states or in the doubtful or seen stretch around the frame. The
    marker's own name confirms its labels there.

    Parameters
    ----------
    project : Project
        With labels.
    marker : int
        The marker that is named.
    name : str
        How.
    frame : int
        The frame that is shown.
    span : tuple of int, optional
        First and last frame for which the name is stated; by default found around the frame.
    """
    names, seen = project.trajectories.names, project.trajectories.seen
    name, own = name.strip(), names[marker]
    if not name:
        return None
    if name == own:
        first, last = span or _stretch(project, marker, frame)
        return Correction("confirm", (own,), first, last)
    if name not in names:
        return Correction("rename", (own,), value=name)
    other = names.index(name)
    if span is None and not (seen[:, marker] & seen[:, other]).any():
        return Correction("merge", (name, own))
    first, last = span or _stretch(project, marker, frame)
    return Correction("swap", (own, name), first, last)


def _stretch(project: Project, marker: int, frame: int) -> Span:
    """The doubtful span of a marker around a frame, else the stretch in which it is seen, else all."""
    doubts = project.labelling.doubts if project.has_labelling else ()
    around = [one for one in doubts if one.marker == marker and one.first_frame <= frame <= one.last_frame]
    if around:
        return around[0].first_frame, around[0].last_frame
    _, first, last = seen_runs(project.trajectories.seen[:, [marker]])
    here = np.flatnonzero((first <= frame) & (frame <= last))
    if len(here):
        return int(first[here[0]]), int(last[here[0]])
    return 0, project.trajectories.n_frames - 1


@dataclass(frozen=True)
class Answer:
    """An answer that the user can give to a question.

    Attributes
    ----------
    words : str
        Of the button.
    corrections : tuple of Correction
        What it states.
    """

    words: str
    corrections: tuple[Correction, ...]


def question_words(question: Question, names: Iterable[str]) -> str:
    """Return a question as a sentence that begins with a capital letter.

    Parameters
    ----------
    question : Question
        What is asked.
    names : iterable of str
        All markers.
    """
    text = question.sentence(tuple(names))
    return text[0].upper() + text[1:]


def answers(project: Project, question: Question) -> tuple[Answer, ...]:
    """Return what can be answered; none where a name must be said, see `with_point_named`.

    Parameters
    ----------
    project : Project
        With labels.
    question : Question
        One of its questions.
    """
    if question.kind == "whose":
        return ()
    called = tuple(project.trajectories.names[marker] for marker in question.markers)
    own = called[0]
    spans = question.spans or ((question.first_frame, question.last_frame),)
    confirmed = tuple(Correction("confirm", (own,), *span) for span in spans)
    if question.kind == "same":
        return (
            Answer(translate("Labelling", "One marker"), (Correction("merge", called[::-1]),)),
            Answer(translate("Labelling", "Two markers"), confirmed),
        )
    if question.kind in {"real", "still"}:
        seen = np.flatnonzero(project.trajectories.seen[:, question.markers[0]])
        is_later = question.kind == "still" and len(seen) and seen[0] < question.first_frame
        first = question.first_frame if is_later else None  # what fell off was a marker before
        return (
            Answer(translate("Labelling", "A marker"), confirmed),
            Answer(translate("Labelling", "No marker"), (Correction("delete", called, first),)),
        )
    swapped = tuple(Correction("swap", called, *span) for span in spans)
    return (
        Answer(translate("Labelling", "It is {0}").format(own), confirmed),
        Answer(translate("Labelling", "It is {0}").format(called[1]), swapped),
    )


def with_point_named(project: Project, question: Question, name: str) -> Project:
    """Return a project that states which marker a track is that was left out; its labels are to be found anew.

    A marker that has the name by now is stated by a point of its own, too: else the track would be a marker by itself.

    Parameters
    ----------
    project : Project
        An unlabelled take with labels.
    question : Question
        Of the kind ``whose``.
    name : str
        The marker, or `NOBODY`.
    """
    stated = () if project.identities is None else project.identities.entries
    position = question.position or _only_point(project, question.first_frame)
    entry = Identity(name.strip() or NOBODY, question.first_frame, position, last_frame=question.last_frame)
    own = () if entry.name in {one.name for one in stated} else own_point(project, entry.name)
    return replace(project, identities=Identities((*stated, *own, entry))).before("labels")


def _only_point(project: Project, frame: int) -> tuple[float, float, float]:
    """The one point of a frame that is no marker: projects saved earlier do not know which one is meant."""
    take = project.take
    if not isinstance(take, PointCloud):
        raise InputError("only of a take without labels are tracks left out")
    points = take.frame(frame)
    off = np.abs(points[:, np.newaxis] - project.trajectories.positions[frame]).max(axis=2)
    left = points[~(np.nan_to_num(off, nan=np.inf) == 0).any(axis=1)]
    if len(left) != 1:
        raise InputError(
            f"{len(left)} points of frame {frame} are left out, and this project was saved before it was stored which "
            "of them is asked for: find its labels anew"
        )
    x, y, z = left[0].tolist()
    return x, y, z
