"""Tracklets merged into markers window by window: the cost grows with the length of a take, not with its square.

The window in which most tracklets are seen at once comes first; from there the windows go outwards. The new tracklets
of a window are compared with each other and with the markers found so far, whose record of distances keeps growing.
To the evidence of distances comes that of continuity: a tracklet may begin where a marker that was lost a moment before
must be by now.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from skelgen._kernels.carried_points import carried
from skelgen.geometry.statistics import lengths_of
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames
from skelgen.model.tracklets import TrackletPoints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.merging.continuity import LONGEST, evidence_of_missed
from skelgen.stages.labels.merging.likelihood import DistanceRecord, distance_sums, merge_likely, sample_frames

MOST_KEPT = 4
"""This many times the number of markers seen at once are kept for the next window; others never merge with any."""

TRIED_FRAMES = 40
"""Frames from which the error of predictions is measured."""

TRIED_GAPS = (0.1, 0.25, 0.5, 0.75, 1.0)
"""Parts of `LONGEST` over which it is measured."""

FREEDOM = 2.0
"""Of Student's distribution: heavy tails."""

CHI_MEDIAN = 1.538
"""Median length of a vector of three normal numbers."""

PAIRS_AT_ONCE = 2000
"""Pairs of tracklets whose neighbours are held at once."""


CARRIED_AT_ONCE = 250
"""Of these, those that are carried over their gaps at once: their neighbours stay in the processor's cache."""


class WindowSize(NamedTuple):
    """How large a window is.

    Attributes
    ----------
    n_tracklets : int
        New tracklets that are compared with each other and with the markers found so far.
    least : float, s
        Shortest window; a shorter one hardly shows how limbs move.
    """

    n_tracklets: int = 600
    least: float = 5.0


def merge_tracklets(
    points: Floats,
    tracklets: TrackletPoints,
    rate: float,
    spacing: float,
    monitor: Monitor = SILENT,
    window: WindowSize | None = None,
) -> Ints:
    """Group tracklets into markers by the likelihood of their distances.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    tracklets : TrackletPoints
        What to group.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.
    monitor : Monitor
        Receives progress and may cancel.
    window : WindowSize, optional
        How many tracklets are compared at once.

    Returns
    -------
    ndarray of intp, shape (n_tracklets,)
        Group of each tracklet, from 0 without holes; tracklets of one group never overlap in time.
    """
    groups = _Groups(points, tracklets, rate, spacing)
    spans = _windows(tracklets, rate, window or WindowSize())
    # Windows from the one that shows most, first to the end of the take and then back to its start
    seen = np.concatenate([[0], np.cumsum(np.bincount(tracklets.frames, minlength=tracklets.n_frames))])
    mean = [(seen[last] - seen[first]) / (last - first) for first, last in spans]
    best = int(np.argmax(mean))
    for done, span in enumerate(spans[best:] + spans[:best][::-1]):
        groups.extend(span)
        monitor.advance(done + 1, len(spans))
    return np.unique(groups.group, return_inverse=True)[1].astype(np.intp)


def _windows(tracklets: TrackletPoints, rate: float, window: WindowSize) -> list[tuple[int, int]]:
    """First frame of each window and the one after its last."""
    n_windows = max(1, -(-len(tracklets) // window.n_tracklets))
    length = max(-(-tracklets.n_frames // n_windows), int(window.least * rate), 1)
    return [(first, min(first + length, tracklets.n_frames)) for first in range(0, tracklets.n_frames, length)]


class _Groups:
    """Groups of tracklets so far and what is known of their distances; grows window by window."""

    def __init__(self, points: Floats, tracklets: TrackletPoints, rate: float, spacing: float) -> None:
        self._points, self._tracklets, self._rate, self._spacing = points, tracklets, rate, spacing
        self._first, self._last = tracklets.first, tracklets.last
        self.group = np.full(len(tracklets), -1, dtype=np.intp)  # a tracklet's group is called by one of its tracklets
        self._names = np.zeros(0, dtype=np.intp)
        self._tables: list[Floats] = [np.zeros((0, 0)) for _ in range(3)]
        self._apart: Bools = np.zeros((0, 0), dtype=bool)

    def extend(self, span: tuple[int, int]) -> None:
        """Merge the tracklets of a window with each other and with the groups so far."""
        inside = np.flatnonzero((self._first < span[1]) & (self._last >= span[0]))
        if not len(inside):
            return
        new = inside[self.group[inside] < 0]
        self.group[new] = new
        names = np.concatenate([self._names, np.setdiff1d(self.group[inside], self._names)])
        order = np.argsort(names)
        row = order[np.searchsorted(names[order], self.group[inside])]  # of each tracklet's group in the tables
        record = self._record(span, inside, row, names)
        joined = merge_likely(record)
        target = names[joined]
        place = {int(name): index for index, name in enumerate(names)}
        member = np.isin(self.group, names)
        self.group[member] = target[[place[int(name)] for name in self.group[member]]]
        self._keep(record, names, np.unique(joined))

    def _record(self, span: tuple[int, int], inside: Ints, row: Ints, names: Ints) -> DistanceRecord:
        """Distances of all groups and new tracklets, those of the window added to what is known."""
        tracklets = self._tracklets.within(inside, *span)
        used, place = np.unique(row, return_inverse=True)
        tables = [_padded(table, len(names)) for table in self._tables]
        block = np.ix_(used, used)
        poses = tracklets.merged(place.ravel()).positions_at(self._points, sample_frames(self._rate, *span))
        for table, more in zip(tables, distance_sums(poses), strict=True):
            table[block] += more
        apart = _padded(self._apart, len(names)).astype(np.bool_)
        begins_before = self._first[inside][:, np.newaxis] <= self._last[inside]
        first, second = np.nonzero(begins_before & begins_before.T)
        apart[row[first], row[second]] = True
        prior = np.zeros(apart.shape)
        before, after, evidence = continuity_evidence(self._points, tracklets, self._rate, self._spacing)
        np.add.at(prior, (row[before], row[after]), evidence)
        return DistanceRecord(np.stack(tables), apart, self._spacing, prior + prior.T)

    def _keep(self, record: DistanceRecord, names: Ints, left: Ints) -> None:
        """Keep the groups that are seen most for the next window."""
        samples = np.diag(record.count)[left]
        at_once = record.count[np.ix_(left, left)] > 0
        most = MOST_KEPT * max(int(np.median(at_once.sum(axis=1))), 1)
        left = left[np.sort(np.argsort(-samples, kind="stable")[:most])]
        block = np.ix_(left, left)
        self._names = names[left]
        self._tables = [table[block] for table in (record.count, record.total, record.squares)]
        self._apart = record.apart[block]


def _padded(table: Floats | Bools, size: int) -> Floats:
    """A square table with rows and columns of zeros added."""
    padded = np.zeros((size, size))
    padded[: len(table), : len(table)] = table
    return padded


def continuity_evidence(
    points: Floats, tracklets: TrackletPoints, rate: float, spacing: float
) -> tuple[Ints, Ints, Floats]:
    """Evidence that one tracklet goes on where another ended.

    The rigid motion of a marker's nearest neighbours over the gap predicts where it comes back (`continuity`). Here the
    deviation of such predictions is that after the same time, measured on the tracklets themselves; Student's
    distribution has few degrees of freedom, because the predictions of some markers err far more than those of most.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    tracklets : TrackletPoints
        What may be joined.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.

    Returns
    -------
    before, after : ndarray of intp, shape (n,)
        Pairs of tracklets of which the first ends and the second begins within `LONGEST`.
    evidence : ndarray, shape (n,), nats
        That they are one marker; 0 where too few neighbours are seen.
    """
    gap = tracklets.first - tracklets.last[:, np.newaxis]
    before, after = np.nonzero((gap > 0) & (gap <= LONGEST * rate))
    evidence = np.zeros(len(before))
    deviation = _error_deviation(points, tracklets, rate)
    if deviation is None:
        return before, after, evidence
    for start in range(0, len(before), PAIRS_AT_ONCE):
        part = slice(start, start + PAIRS_AT_ONCE)
        i, j = before[part], after[part]
        distance = _missed(points, tracklets, (i, j), (tracklets.last[i], tracklets.first[j]))
        known = ~np.isnan(distance)
        sigma = deviation(gap[i[known], j[known]] / rate)
        said = evidence_of_missed(distance[known], sigma, spacing, FREEDOM)
        evidence[start + np.flatnonzero(known)] = said
    return before, after, evidence


def _missed(points: Floats, tracklets: TrackletPoints, which: tuple[Ints, Ints], frames: tuple[Ints, Ints]) -> Floats:
    """Distance [mm] of tracklets j from where neighbours carry tracklets i; NaN where neighbours are too few."""
    used = np.unique(np.concatenate(frames))
    table = tracklets.indices_at(used)
    rows = [np.searchsorted(used, frame) for frame in frames]
    begin, end = (table[row, tracklet] for row, tracklet in zip(rows, which, strict=True))
    # Few tracklets of a long take are seen in one frame: candidates are those, padded with -1
    n_seen = (table >= 0).sum(axis=1)
    listed = np.argsort(table < 0, axis=1, kind="stable")[:, : n_seen.max()]
    missed = np.empty(len(begin))
    for start in range(0, len(begin), CARRIED_AT_ONCE):
        part = slice(start, start + CARRIED_AT_ONCE)
        others = listed[rows[0][part]]
        before, after = (table[row[part, np.newaxis], others] for row in rows)
        for tracklet in which:
            before[others == tracklet[part, np.newaxis]] = -1
        expected, _ = carried(points, begin[part], before, after)
        missed[part] = lengths_of(points[end[part]] - expected)
    return missed


def _error_deviation(points: Floats, tracklets: TrackletPoints, rate: float) -> Callable[[Floats], Floats] | None:
    """Deviation of a coordinate of predictions [mm] by the time over which they reach [s]; None if nothing shows it.

    It is measured on tracklets that are seen before and after.
    """
    times, deviations = [], []
    for part in TRIED_GAPS:
        gap = max(1, round(part * LONGEST * rate))
        first = spread_frames(max(1, tracklets.n_frames - gap), TRIED_FRAMES)
        if tracklets.n_frames <= gap:
            continue
        both = (tracklets.indices_at(first) >= 0) & (tracklets.indices_at(first + gap) >= 0)
        if not both.any():
            continue
        frame, which = np.nonzero(both)
        missed = _missed(points, tracklets, (which, which), (first[frame], first[frame] + gap))
        if not np.isnan(missed).all():
            times.append(gap / rate)
            deviations.append(max(float(np.nanmedian(missed)) / CHI_MEDIAN, np.finfo(np.float64).eps))
    reached, largest = np.array(times), np.maximum.accumulate(np.array(deviations))
    return (lambda time: np.asarray(np.interp(time, reached, largest))) if times else None
