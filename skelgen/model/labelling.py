"""How sure the identities of markers are: tracklets before and after, confidence, doubtful spans, what is left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from skelgen.errors import InputError
from skelgen.model.arrays import Bools, Floats, Ints, check_floats, check_ints, set_fields
from skelgen.model.renaming import with_renamed_markers

DOUBT_KINDS = ("piece", "alone", "rare", "rival", "misfit", "unsupported", "repaired")
"""Why a span is doubtful. ``piece``: the marker is probably a part of another one. ``alone``: its distance to no other
marker is known. ``rare``: it is seen in few frames. ``rival``: the place of another marker fits as well. ``misfit``: no
place fits. ``unsupported``: too few markers beside it are seen. ``repaired``: its labels were exchanged in the file."""

FINDING_KINDS = ("exchanged", "moved", "slipped", "fallen", "filled", "spike")
"""What is wrong: labels exchanged, on another marker, or on one that slipped or fell; gaps that were filled; spikes."""


@dataclass(frozen=True, eq=False)
class Tracklets:
    """Tracks of points, as they were followed, in the parts that went to one marker each.

    Attributes
    ----------
    track : ndarray of intp, shape (n_parts,)
        Track of each part, rising from 0 without holes.
    marker : ndarray of intp, shape (n_parts,)
        Marker that the part went to, -1 = left out.
    first, last : ndarray of intp, shape (n_parts,)
        First and last frame of the part, both included.
    n_points : ndarray of intp, shape (n_parts,)
        Its points.
    first_point : ndarray of intp, shape (n_parts,), or None
        Index of its point within the first frame; None in projects that were saved before this was known.
    first_position : ndarray, shape (n_parts, 3), mm, or None
        Where that point is.
    """

    track: Ints
    marker: Ints
    first: Ints
    last: Ints
    n_points: Ints
    first_point: Ints | None = None
    first_position: Floats | None = None

    def __post_init__(self) -> None:
        track = check_ints(self.track, (None,), "track")
        for name in ("marker", "first", "last", "n_points"):
            object.__setattr__(self, name, check_ints(getattr(self, name), (len(track),), name))
        if (self.first_point is None) != (self.first_position is None):
            raise InputError("of the first points of tracklets either both index and position are known, or neither")
        if self.first_point is not None and self.first_position is not None:
            set_fields(self, first_point=check_ints(self.first_point, (len(track),), "first_point"))
            set_fields(self, first_position=check_floats(self.first_position, (len(track), 3), "first_position"))
        steps = np.diff(track, prepend=-1)
        if (steps < 0).any() or (steps > 1).any():
            raise InputError("the parts of tracklets must be sorted by track, numbered from 0 without holes")
        if (self.marker < -1).any() or (self.first < 0).any() or (self.last < self.first).any():
            raise InputError("a part of a tracklet goes to an impossible marker or ends before it begins")
        object.__setattr__(self, "track", track)

    @property
    def n_parts(self) -> int:
        """Number of parts."""
        return len(self.track)

    @property
    def n_tracklets(self) -> int:
        """Number of tracks."""
        return int(self.track.max(initial=-1)) + 1

    @property
    def spans(self) -> tuple[Ints, Ints]:
        """First and last frame of every track, each of shape (n_tracklets,)."""
        if not self.n_parts:
            return self.first, self.last
        starts = np.searchsorted(self.track, np.arange(self.n_tracklets))
        return np.minimum.reduceat(self.first, starts), np.maximum.reduceat(self.last, starts)

    def of(self, parts: Bools) -> Tracklets:
        """Return some of the parts; their tracks are numbered anew.

        Parameters
        ----------
        parts : ndarray of bool, shape (n_parts,)
            Which parts stay.
        """
        track = np.unique(self.track[parts], return_inverse=True)[1].reshape(-1)
        point = None if self.first_point is None else self.first_point[parts]
        position = None if self.first_position is None else self.first_position[parts]
        marker, first, last, n_points = (one[parts] for one in (self.marker, self.first, self.last, self.n_points))
        return Tracklets(track, marker, first, last, n_points, point, position)

    @property
    def n_left_out(self) -> int:
        """Number of tracks of which no point went to a marker."""
        used = np.zeros(self.n_tracklets, dtype=np.bool_)
        used[self.track[self.marker >= 0]] = True
        return int((~used).sum())

    @property
    def n_divided(self) -> int:
        """Number of tracks whose points went to more than one marker."""
        pairs = np.unique(np.stack([self.track, self.marker], axis=1)[self.marker >= 0], axis=0)
        return int((np.bincount(pairs[:, 0]) > 1).sum()) if len(pairs) else 0


@dataclass(frozen=True)
class Doubt:
    """A span of frames in which it is not sure that a marker is the one that it is called.

    Attributes
    ----------
    marker : int
        Index of the marker.
    first_frame, last_frame : int
        Both included.
    kind : str
        One of `DOUBT_KINDS`.
    rival : int
        Index of the marker that it may be instead, or was exchanged with; -1 = none.
    confidence : float
        The lowest within the span.
    reason : str
        A sentence.
    """

    marker: int
    first_frame: int
    last_frame: int
    kind: str
    rival: int
    confidence: float
    reason: str

    def __post_init__(self) -> None:
        if self.kind not in DOUBT_KINDS:
            raise InputError(f"a doubt of the kind {self.kind!r}; kinds are {', '.join(DOUBT_KINDS)}")
        if not 0 <= self.first_frame <= self.last_frame:
            raise InputError(f"a doubtful span from frame {self.first_frame} to frame {self.last_frame}")

    def renamed(self, before: Sequence[str], now: Sequence[str]) -> Doubt:
        """Return the same with other names in its reason; what the file called a marker stays.

        Parameters
        ----------
        before, now : sequence of str
            Names of all markers.
        """
        names = {before[self.marker]: now[self.marker]}
        if self.rival >= 0:
            names |= {before[self.rival]: (before if self.kind == "repaired" else now)[self.rival]}
        return replace(self, reason=with_renamed_markers([self.reason], names, ())[0])


@dataclass(frozen=True)
class Finding:
    """An error of the labels that came with the take.

    Attributes
    ----------
    kind : str
        One of `FINDING_KINDS`.
    names : tuple of str
        The labels, as in the file; of a slipped marker that is split, the label and the new name of its second part.
    first_frame, last_frame : int
        Both included.
    evidence : str
        The evidence for it, in words.
    outcome : str
        What was done about it.
    """

    kind: str
    names: tuple[str, ...]
    first_frame: int
    last_frame: int
    evidence: str
    outcome: str

    def __post_init__(self) -> None:
        if self.kind not in FINDING_KINDS:
            raise InputError(f"a finding of the kind {self.kind!r}; kinds are {', '.join(FINDING_KINDS)}")
        object.__setattr__(self, "names", tuple(self.names))


@dataclass(frozen=True)
class Agreement:
    """What another method of labelling gave on the same take.

    Attributes
    ----------
    method : str
        Its name.
    n_markers : int
        Markers that it found.
    n_points : int
        Points that it gave to a marker.
    share : float
        Of the points that either method gave to a marker: those to which both gave the same one, each marker being
        paired with the one that it has most points in common with.
    """

    method: str
    n_markers: int
    n_points: int
    share: float


@dataclass(frozen=True, eq=False)
class Labelling:
    """How sure the identities of a project's trajectories are.

    Attributes
    ----------
    confidence : ndarray, shape (n_frames, n_markers)
        Probability that the marker is the one that it is called, 0 .. 1; NaN where it is unseen.
    doubts : tuple of Doubt
        Doubtful spans, in the order of their first frames.
    twins : tuple of (int, int)
        Pairs of markers that no distance distinguishes.
    left_out : ndarray of intp, shape (n_frames,)
        Points of each frame that belong to no marker.
    tracklets : Tracklets or None
        As points were followed; None for takes that came with labels.
    classic : Agreement or None
        What the thesis' method gave, where it was asked for beside another one (`labels.compare`).
    findings : tuple of Finding
        Errors of labels that came with the take, in the order of their first frames.
    subject : str
        The calibrated take whose skeleton labelled this one, its file or name; empty for takes labelled otherwise.
    """

    confidence: Floats
    doubts: tuple[Doubt, ...]
    twins: tuple[tuple[int, int], ...]
    left_out: Ints
    tracklets: Tracklets | None = None
    classic: Agreement | None = None
    findings: tuple[Finding, ...] = ()
    subject: str = ""

    def __post_init__(self) -> None:
        confidence = check_floats(self.confidence, (None, None), "confidence")
        if ((confidence < 0) | (confidence > 1)).any():
            raise InputError("a confidence lies outside 0 .. 1")
        n_frames, n_markers = confidence.shape
        doubts, twins = tuple(self.doubts), tuple((int(first), int(second)) for first, second in self.twins)
        if any(not -1 <= each.rival < n_markers or not 0 <= each.marker < n_markers for each in doubts):
            raise InputError(f"a doubt about a marker that does not exist: there are {n_markers}")
        if any(each.last_frame >= n_frames for each in doubts):
            raise InputError(f"a doubtful span goes on after the last of {n_frames} frames")
        if any(not 0 <= marker < n_markers for pair in twins for marker in pair):
            raise InputError(f"twins that do not exist: there are {n_markers} markers")
        if self.tracklets is not None and self.tracklets.marker.max(initial=-1) >= n_markers:
            raise InputError(f"a tracklet went to a marker that does not exist: there are {n_markers}")
        left_out = check_ints(self.left_out, (n_frames,), "left_out")
        if (left_out < 0).any():
            raise InputError(f"points that belong to no marker are counted, and {left_out.min()} in a frame is below 0")
        set_fields(self, confidence=confidence, doubts=doubts, findings=tuple(self.findings))
        set_fields(self, twins=twins, left_out=left_out)

    @property
    def split(self) -> tuple[tuple[str, ...], ...]:
        """Names of markers that are parts of one physical marker, which slipped: they sit on one limb."""
        return tuple(finding.names for finding in self.findings if finding.kind == "slipped" and len(finding.names) > 1)

    @property
    def marker_confidence(self) -> Floats:
        """Mean confidence of each marker, shape (n_markers,); NaN where it is never seen."""
        seen = ~np.isnan(self.confidence)
        total = np.where(seen, self.confidence, 0.0).sum(axis=0)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(seen.any(axis=0), total / np.maximum(seen.sum(axis=0), 1), np.nan))

    @property
    def doubtful(self) -> Bools:
        """Frames and markers within doubtful spans, shape (n_frames, n_markers)."""
        result = np.zeros(self.confidence.shape, dtype=np.bool_)
        for doubt in self.doubts:
            result[doubt.first_frame : doubt.last_frame + 1, doubt.marker] = True
        return result & ~np.isnan(self.confidence)


def seen_runs(seen: Bools) -> tuple[Ints, Ints, Ints]:
    """Return the stretches in which markers are seen without a gap.

    Parameters
    ----------
    seen : ndarray of bool, shape (n_frames, n_markers)
        When each marker is seen.

    Returns
    -------
    marker, first, last : ndarray of intp, shape (n_runs,)
        Sorted by marker, then frame; both frames included.
    """
    framed = np.zeros((seen.shape[1], seen.shape[0] + 2), dtype=np.int8)
    framed[:, 1:-1] = seen.T
    edges = np.diff(framed, axis=1)
    marker, first = np.nonzero(edges == 1)
    return marker, first, np.nonzero(edges == -1)[1] - 1
