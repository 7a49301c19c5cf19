"""Tracklets merged into markers window by window: the cost grows with the length of a take, not with its square.

The window in which most tracklets are seen at once comes first; from there the windows go outwards. The new tracklets
of a window are compared with each other and with the markers found so far, whose record of distances keeps growing.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.tracklets import TrackletPoints
from skelgen.progress import SILENT, Monitor
from skelgen.stages.labels.merging.continuity import continuity_evidence
from skelgen.stages.labels.merging.likelihood import DistanceRecord, distance_sums, merge_likely, sample_frames

MOST_KEPT = 4
"""This many times the number of markers seen at once are kept for the next window; others never merge with any."""


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
    for done, span in enumerate(_outwards(spans, tracklets)):
        groups.extend(span)
        monitor.advance(done + 1, len(spans))
    return np.unique(groups.group, return_inverse=True)[1].astype(np.intp)


def _windows(tracklets: TrackletPoints, rate: float, window: WindowSize) -> list[tuple[int, int]]:
    """First frame of each window and the one after its last."""
    n_windows = max(1, -(-len(tracklets) // window.n_tracklets))
    length = max(-(-tracklets.n_frames // n_windows), int(window.least * rate), 1)
    return [(first, min(first + length, tracklets.n_frames)) for first in range(0, tracklets.n_frames, length)]


def _outwards(spans: list[tuple[int, int]], tracklets: TrackletPoints) -> list[tuple[int, int]]:
    """Windows from the one that shows most, first to the end of the take and then back to its start."""
    seen = np.concatenate([[0], np.cumsum(np.bincount(tracklets.frames, minlength=tracklets.n_frames))])
    mean = [(seen[last] - seen[first]) / (last - first) for first, last in spans]
    best = int(np.argmax(mean))
    return spans[best:] + spans[:best][::-1]


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
        self._keep(record, names, np.unique(joined), span)

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
        return DistanceRecord(tables[0], tables[1], tables[2], apart, self._spacing, prior + prior.T)

    def _keep(self, record: DistanceRecord, names: Ints, left: Ints, span: tuple[int, int]) -> None:
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
