"""The questions that labels leave open, ordered by how much each answer would settle."""

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.model.labelling import Doubt, Labelling
from skelgen.progress import listed

LEAST_SETTLED = 10.0
"""Positions; what settles less is not worth an answer."""

LEFT_OUT_SHARE = 0.5
"""Of the positions of a track without a marker that count: whether it is one is as open as can be."""

MOST_SPANS = 4
"""Spans that a question tells; all are in the summary."""

_KIND_OF_DOUBT = {"piece": "same", "rival": "which", "alone": "real", "rare": "real"}


@dataclass(frozen=True)
class Question:
    """Something that the take does not decide, and the user may know.

    Attributes
    ----------
    kind : str
        ``same``: are two markers one? ``which``: is it this marker or the other? ``real``: is it a marker at all?
        ``still``: is what stands still while others move a marker on a body?
        ``whose``: which marker is a track that was left out?
    markers : tuple of int
        Markers that it is about: the doubtful one, and for ``same`` and ``which`` the one that it may be; none for
        ``whose``.
    first_frame, last_frame : int
        Where to look, both included: the longest span that is doubtful.
    settles : float
        Number of positions whose label is expected to be wrong as long as it is open: those of the doubtful marker in
        all `spans`, or half of those that were left out.
    point : int or None
        Of ``whose``: index of the point within the first frame, from 0. None in projects that were saved before it was
        known.
    position : tuple of three floats, mm, or None
        Of ``whose``: where that point is in the first frame.
    spans : tuple of (int, int)
        First and last frame of all spans that the answer is about, both included; empty for ``whose``.
    """

    kind: str
    markers: tuple[int, ...]
    first_frame: int
    last_frame: int
    settles: float
    point: int | None = None
    position: tuple[float, float, float] | None = None
    spans: tuple[tuple[int, int], ...] = ()

    def sentence(self, names: Sequence[str]) -> str:
        """Return the question in words.

        Parameters
        ----------
        names : sequence of str
            All markers.
        """
        spans = self.spans or ((self.first_frame, self.last_frame),)
        shown = [f"{first} to {last}" for first, last in spans[:MOST_SPANS]]
        shown += [f"{len(spans) - MOST_SPANS} more spans"] * (len(spans) > MOST_SPANS)
        frames, called = f"frames {listed(shown)}", [names[marker] for marker in self.markers]
        if self.kind == "same":
            asked = f"are {called[1]} and {called[0]} one marker"
        elif self.kind == "which":
            asked = f"is {called[0]} in {frames} not {called[1]}"
        elif self.kind == "real":
            asked = f"is {called[0]} a marker ({frames})"
        elif self.kind == "still":
            asked = f"is {called[0]}, which stands still in {frames} while others move, a marker on a body"
        elif self.position is None:
            asked = f"which marker is the point that is left out in {frames}"
        else:
            place = ", ".join(f"{value:.1f}" for value in self.position)
            asked = (
                f"which marker is the point that is left out in {frames}, point {self.point} of frame "
                f"{self.first_frame} at ({place}) mm"
            )
        return f"{asked}? That settles about {self.settles:.0f} positions"


def questions_on(labelling: Labelling) -> tuple[Question, ...]:
    """Return what the labels leave open, what settles most first.

    Parameters
    ----------
    labelling : Labelling
        With its doubtful spans and tracklets.
    """
    return by_worth([*_on_doubts(labelling), *_on_tracks(labelling)])


def by_worth(questions: Iterable[Question]) -> tuple[Question, ...]:
    """Return questions in the order of how much their answers settle, the most first."""
    return tuple(sorted(questions, key=lambda one: (-one.settles, one.first_frame, one.markers)))


def _on_doubts(labelling: Labelling) -> Iterator[Question]:
    """One question per kind, doubtful marker and other one: what is said of one of a pair says nothing of the other."""
    asked: dict[tuple[str, tuple[int, ...]], list[Doubt]] = defaultdict(list)
    for doubt in labelling.doubts:
        kind = _KIND_OF_DOUBT.get(doubt.kind)
        if kind is None or (kind in {"same", "which"} and doubt.rival < 0):
            continue
        asked[kind, (doubt.marker,) if kind == "real" else (doubt.marker, doubt.rival)].append(doubt)
    wrong = np.nan_to_num(1.0 - labelling.confidence)
    for (kind, markers), doubts in asked.items():
        spans = tuple(sorted((doubt.first_frame, doubt.last_frame) for doubt in doubts))
        settles = float(sum(wrong[first : last + 1, markers[0]].sum() for first, last in spans))
        first, last = max(spans, key=lambda span: span[1] - span[0])
        if settles >= LEAST_SETTLED:
            yield Question(kind, markers, first, last, settles, spans=spans)


def _on_tracks(labelling: Labelling) -> Iterator[Question]:
    tracklets = labelling.tracklets
    if tracklets is None:
        return
    for part in np.flatnonzero(tracklets.marker < 0).tolist():
        settles = LEFT_OUT_SHARE * float(tracklets.n_points[part])
        if settles >= LEAST_SETTLED:
            asked = Question("whose", (), int(tracklets.first[part]), int(tracklets.last[part]), settles)
            if tracklets.first_point is not None and tracklets.first_position is not None:
                x, y, z = tracklets.first_position[part].tolist()
                asked = replace(asked, point=int(tracklets.first_point[part]), position=(x, y, z))
            yield asked
