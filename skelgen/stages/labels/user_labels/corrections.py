"""Corrections that the user makes to labels: markers merged, split, renamed, deleted and exchanged."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.errors import InputError
from skelgen.geometry.frame_rate import smoothed
from skelgen.model import Labelling, Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.corrections import Correction, named_marker, names_after
from skelgen.model.labelling import Doubt, Tracklets
from skelgen.progress import counted
from skelgen.stages.labels.confidence.identity import LABELS_FOUND, LABELS_GIVEN, identity_confidence
from skelgen.stages.labels.confidence.label_quality import doubtful_spans


@dataclass(frozen=True, eq=False)
class CorrectedLabels:
    """Labels after corrections.

    Attributes
    ----------
    trajectories : Trajectories
        The corrected markers.
    source : ndarray of int32, shape (n_frames, n_markers)
        Marker before the corrections that each position comes from, -1 where it is unseen.
    touched : ndarray of bool, shape (n_frames, n_markers)
        Positions whose marker the user has stated.
    deleted : ndarray of bool, shape (n_frames, n_markers_before)
        Positions before the corrections that are no marker, as the user states.
    notices : tuple of str
        Positions that were lost; by a calibrated skeleton also which corrections were applied.
    """

    trajectories: Trajectories
    source: Ints
    touched: Bools
    deleted: Bools
    notices: tuple[str, ...]


def apply_corrections(
    trajectories: Trajectories, corrections: tuple[Correction, ...], *, by_subject: bool = False
) -> CorrectedLabels:
    """Apply the corrections of labels, in their order.

    Parameters
    ----------
    trajectories : Trajectories
        As the labels stage made them.
    corrections : tuple of Correction
        Those of other stages are passed over.
    by_subject : bool
        Whether a calibrated skeleton labelled the take: its markers stay although no position of them is left, a
        correction that cannot be applied to its labels is passed over, and notices say what was done with each.

    Raises
    ------
    InputError
        If a correction names a marker that is not there, or gives a name twice.
    """
    editor = _Editor(trajectories, trajectories.n_markers if by_subject else 0)
    for correction in corrections:
        act = editor.acts.get(correction.kind)
        if act:
            try:
                act(correction, editor.find(correction))
            except InputError as error:
                if not by_subject:
                    raise
                editor.notices.append(f"passed over, as the calibrated skeleton labels this take: {error}")
            else:
                editor.notices += [f"as stated: {correction.sentence}"] if by_subject else []
    return editor.result()


def corrected_quality(
    before: Labelling, edits: CorrectedLabels, are_found: bool, stated: Bools | None = None
) -> Labelling:
    """Compute the label quality of corrected labels: what the user corrected is certain.

    All else is judged by what it was judged by before: where tracks break, and which labels were given back.

    Parameters
    ----------
    before : Labelling
        The label quality before the corrections.
    edits : CorrectedLabels
        The corrected labels.
    are_found : bool
        Whether the take came as points without labels.
    stated : ndarray of bool, shape (n_frames, n_markers), optional
        Positions of the corrected labels whose marker the user has stated earlier.
    """
    prior = LABELS_FOUND if are_found else LABELS_GIVEN
    tracklets = None if before.tracklets is None else _followed(before, before.tracklets, edits)
    breaks = None if tracklets is None else _track_breaks(tracklets, edits.trajectories.seen)
    stated = edits.touched if stated is None else edits.touched | stated
    certainty = identity_confidence(edits.trajectories, breaks, stated, prior)
    lost = np.maximum(np.isfinite(before.confidence).sum(axis=1) - edits.trajectories.seen.sum(axis=1), 0)
    doubts = (*_given_back(before, edits), *doubtful_spans(edits.trajectories, certainty))
    return dataclasses.replace(
        before,
        confidence=certainty.confidence,
        doubts=tuple(sorted(doubts, key=lambda doubt: doubt.first_frame)),
        twins=certainty.twins,
        left_out=before.left_out + lost,
        tracklets=tracklets,
    )


def stated_positions(trajectories: Trajectories, corrections: Sequence[Correction]) -> Bools:
    """Return where corrections that are applied already state the marker, shape (n_frames, n_markers).

    Parameters
    ----------
    trajectories : Trajectories
        The labels after these corrections.
    corrections : sequence of Correction
        Those whose markers are there no more are passed over.
    """
    stated = np.zeros(trajectories.seen.shape, dtype=np.bool_)
    for correction, called in zip(corrections, names_after(corrections), strict=True):
        if correction.kind in _STATING:
            names = {*called} & {*trajectories.names}
            frames = _frames(correction) if correction.kind in {"swap", "confirm"} else slice(None)
            stated[frames, [trajectories.names.index(name) for name in names]] = True
    return stated & trajectories.seen


class _Editor:
    """Markers while they are corrected."""

    def __init__(self, trajectories: Trajectories, n_staying: int) -> None:
        self._original, self._n_staying = trajectories, n_staying
        self.names = list(trajectories.names)
        here = np.arange(trajectories.n_markers, dtype=np.int32)
        self.source = np.where(trajectories.seen, here, np.int32(-1))
        self.touched = np.zeros(self.source.shape, dtype=np.bool_)
        self.deleted = np.zeros(self.source.shape, dtype=np.bool_)
        self.notices: list[str] = []
        acts = (self.merge, self.split, self.rename, self.delete, self.swap, self.confirm, self.smooth)
        self.acts = {act.__name__: act for act in acts}

    def find(self, correction: Correction) -> list[int]:
        """Indices of the markers that a correction names."""
        return [named_marker(correction, which, self.names, self._row) for which in range(len(correction.names))]

    def _row(self, frame: int) -> Floats:
        if frame >= len(self.source):
            return np.empty((0, 3))
        source = self.source[frame]
        return np.where(source[:, np.newaxis] >= 0, self._original.positions[frame, source], np.nan)

    def merge(self, correction: Correction, markers: list[int]) -> None:
        """Several markers become the first of them; where two are seen at once, the one named earlier stays."""
        kept, n_lost = markers[0], 0
        for marker in markers[1:]:
            free = self.source[:, kept] < 0
            n_lost += int(((self.source[:, marker] >= 0) & ~free).sum())
            self.source[free, kept] = self.source[free, marker]
            self.source[:, marker] = -1
        if n_lost:
            lost = counted(n_lost, "position seen at the same time is", "positions seen at the same time are")
            self.notices.append(f"{correction.sentence}: {lost} left out")
        self.touched[:, kept] = True
        self._drop(markers[1:])

    def split(self, correction: Correction, markers: list[int]) -> None:
        """Some frames of a marker become a new one."""
        frames = _frames(correction)
        column = np.full(len(self.source), -1, dtype=np.int32)
        column[frames] = self.source[frames, markers[0]]
        self.source[frames, markers[0]] = -1
        self.source = np.column_stack([self.source, column])
        self.touched = np.column_stack([self.touched, np.ones(len(column), dtype=np.bool_)])
        self.touched[:, markers[0]] = True
        self._add_name(correction, correction.value)

    def rename(self, correction: Correction, markers: list[int]) -> None:
        """Another name."""
        if correction.value != self.names[markers[0]]:
            self._add_name(correction, correction.value)
            self.names[markers[0]] = self.names.pop()

    def delete(self, correction: Correction, markers: list[int]) -> None:
        """Leave positions out; a marker without any left is removed."""
        for marker in markers:
            frames = np.arange(len(self.source))[_frames(correction)]
            frames = frames[self.source[frames, marker] >= 0]
            self.deleted[frames, self.source[frames, marker]] = True
            self.source[frames, marker] = -1
        self._drop([marker for marker in markers if (self.source[:, marker] < 0).all()])

    def swap(self, correction: Correction, markers: list[int]) -> None:
        """Two markers change places in some frames."""
        frames = _frames(correction)
        self.source[frames, markers] = self.source[frames, markers[::-1]]
        self.touched[frames, markers] = True

    def confirm(self, correction: Correction, markers: list[int]) -> None:
        """Markers are those that they are called, in some frames: nothing changes, but that is certain now."""
        self.touched[_frames(correction), markers] = True

    def smooth(self, correction: Correction, markers: list[int]) -> None:
        """The paths of markers without what is faster than a frequency."""
        frames = _frames(correction)
        positions = self._original.positions.copy()
        for marker in markers:
            source = self.source[:, marker]
            path = np.where(source[:, np.newaxis] >= 0, positions[np.arange(len(source)), source], np.nan)
            smooth = smoothed(path, self._original.rate, float(correction.value))
            here = np.arange(len(source))[frames]
            here = here[source[here] >= 0]
            positions[here, source[here]] = smooth[here]
        self._original = dataclasses.replace(self._original, positions=positions)

    def _add_name(self, correction: Correction, name: str) -> None:
        if name in self.names:
            raise InputError(f"{correction.sentence}: there is a marker {name!r} already; choose another name")
        self.names.append(name)

    def _drop(self, markers: list[int]) -> None:
        markers = [marker for marker in markers if marker >= self._n_staying]
        self.source, self.touched = (np.delete(values, markers, axis=1) for values in (self.source, self.touched))
        self.names = [name for marker, name in enumerate(self.names) if marker not in markers]

    def result(self) -> CorrectedLabels:
        """The corrected labels."""
        if not self.names:
            raise InputError("the corrections leave no marker; take one of them back")
        positions = np.take_along_axis(self._original.positions, np.maximum(self.source, 0)[..., np.newaxis], axis=1)
        positions[self.source < 0] = np.nan
        notices = (*self._original.notices, *self.notices)
        changed = dataclasses.replace(self._original, positions=positions, names=tuple(self.names), notices=notices)
        return CorrectedLabels(
            changed, self.source, self.touched & (self.source >= 0), self.deleted, tuple(self.notices)
        )


_STATING = frozenset({"merge", "split", "swap", "confirm"})
"""Kinds that say of positions which marker they are."""


def _frames(correction: Correction) -> slice:
    last = correction.last_frame
    return slice(correction.first_frame or 0, None if last is None else last + 1)


def _followed(before: Labelling, tracklets: Tracklets, edits: CorrectedLabels) -> Tracklets:
    """Parts of tracklets with the markers that they went to after the corrections, as their middle frames tell.

    Parts that are no marker, as the user states, are left out: nobody asks again which marker they are.
    """
    middle, seen, found = (tracklets.first + tracklets.last) // 2, np.isfinite(before.confidence), tracklets.marker
    for part in np.flatnonzero((found >= 0) & ~seen[middle, found]).tolist():  # the middle is in a gap
        span = slice(tracklets.first[part], tracklets.last[part] + 1)
        shown = np.flatnonzero(seen[span, found[part]])
        middle[part] = span.start + shown[len(shown) // 2] if len(shown) else middle[part]
    there = edits.source[middle] == found[:, np.newaxis]
    marker = np.where(there.any(axis=1) & (found >= 0), there.argmax(axis=1), -1)
    is_deleted = edits.deleted[middle, found] & (found >= 0)
    return dataclasses.replace(tracklets, marker=marker).of(~is_deleted)


def _track_breaks(tracklets: Tracklets, seen: Bools) -> Bools:
    """Frames in which a marker is of another track than in the frame before, or of none, shape as `seen`."""
    track = np.full(seen.shape, -1, dtype=np.int32)
    for part in np.argsort(tracklets.first - tracklets.last, kind="stable").tolist():  # within gaps of the long ones
        if tracklets.marker[part] >= 0:
            track[tracklets.first[part] : tracklets.last[part] + 1, tracklets.marker[part]] = tracklets.track[part]
    track[~seen] = -1
    breaks = np.zeros(seen.shape, dtype=np.bool_)
    breaks[1:] = seen[1:] & ((track[1:] != track[:-1]) | (track[1:] < 0))
    return breaks


def _given_back(before: Labelling, edits: CorrectedLabels) -> list[Doubt]:
    """Return spans in which swaps were repaired, with today's markers; none of which the user stated anything."""
    kept = []
    for doubt in (doubt for doubt in before.doubts if doubt.kind == "repaired"):
        middle = (doubt.first_frame + doubt.last_frame) // 2
        now = np.flatnonzero(edits.source[middle] == doubt.marker)
        if len(now) and not edits.touched[doubt.first_frame : doubt.last_frame + 1, now[0]].any():
            rival = np.flatnonzero(edits.source[middle] == doubt.rival) if doubt.rival >= 0 else now[:0]
            kept.append(dataclasses.replace(doubt, marker=int(now[0]), rival=int(rival[0]) if len(rival) else -1))
    return kept
