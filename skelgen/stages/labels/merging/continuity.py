r"""Who goes on as whom: evidence from where a marker was lost and where it, or another one, is found a moment later.

The markers around carry a marker along: the rigid motion of its nearest neighbours over the gap predicts where it comes
back. How well such a prediction holds is told by the neighbours themselves. With their misfits :math:`e_k` to that
motion, n of them have

.. math:: \sigma^2 = c^2 \left(\frac{\sum_k e_k^2}{3n - 6} + (0.02\, w)^2\right), \qquad c = 0.75,

as the variance of a coordinate, w being the spacing of markers: on one limb :math:`\sigma` is the noise, however long
the gap is, and on an arm that bends it grows with the bend. In six recordings of people and machines the median error
is 0.7 to 1 of the misfit, over gaps of 0.05 to 0.5 s, and its 90th percentile 2.1 to 4 times the median, where a
deviation by the length of the gap alone leaves 3.5 to 8 times. What is found at a distance r from the prediction is the
same marker with the evidence

.. math:: E = 3 \log\frac{\sqrt{\sigma^2 + w^2}}{\sigma} - h(r / \sigma) + h(r / \sqrt{\sigma^2 + w^2}),

where h is minus the logarithm of Student's distribution in three dimensions. Distances between markers that are seen at
once do not say this: of two markers that nothing rigid is seen with, both may suit as well.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from skelgen._kernels.carried_points import carried
from skelgen._kernels.marker_pauses import Links
from skelgen.geometry.statistics import lengths_of
from skelgen.model.arrays import Bools, Floats, Ints, numbers_between
from skelgen.stages.labels import point_labels

if TYPE_CHECKING:
    from skelgen.stages.labels.merging.followed import FollowedCloud

LONGEST = 0.5
"""s; over longer gaps the neighbours do not predict a marker."""

PER_MISFIT = 0.75
"""Deviation of a coordinate of the prediction, in misfits of the neighbours."""

STEADY = 0.02
"""Misfit that is expected beforehand, in spacings."""

FREEDOM = 4.0
"""Of Student's distribution."""

FASTEST = 5000.0
"""mm/s; what is farther away than this speed and three spacings allow is another marker."""

MOST_SPOKEN = 6.0
"""nats that gaps may say for two being one marker, and against it for each gap that is too far: neighbours may be on
another limb, and then distances must say it."""

MOST_FOLLOWING = 1000
"""Parts of markers that may follow one within `LONGEST`, the first ones: in most takes there are a few dozen."""

GAPS_AT_ONCE = 2000
"""Gaps whose neighbours are held at once."""


def pauses_between(frame: Ints, track: Ints) -> Bools:
    """Return between which points of a marker it pauses, shape (n_points - 1,); where another track begins, it may.

    Parameters
    ----------
    frame, track : ndarray of intp, shape (n_points,)
        Rising frame and track of each point, -1 for none.
    """
    return np.asarray((track[1:] != track[:-1]) | (track[1:] < 0) | (np.diff(frame) > 1))


@dataclass(frozen=True, eq=False)
class Continuity:
    """A labelled take, and what its gaps say of the labels.

    Attributes
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.
    """

    take: FollowedCloud
    marker_of_point: Ints

    @cached_property
    def _n_markers(self) -> int:
        return int(self.marker_of_point.max(initial=-1)) + 1

    @cached_property
    def _frame(self) -> Ints:
        return self.take.frame_of_point()

    @cached_property
    def _owned(self) -> tuple[Ints, Ints]:
        """Points marker by marker, each one's in the order of frames, and where those of each marker begin."""
        order = np.argsort(self.marker_of_point, kind="stable")
        starts = np.searchsorted(self.marker_of_point[order], np.arange(self._n_markers + 1))
        return order[starts[0] :], starts - starts[0]

    @cached_property
    def _parts(self) -> tuple[Ints, Ints, Ints]:
        """Marker, first and last point of each part of a marker that is followed without a gap."""
        points, _ = self._owned
        marker, frame, track = self.marker_of_point[points], self._frame[points], self.take.track_of_point[points]
        begins = (marker[1:] != marker[:-1]) | pauses_between(frame, track)
        first = np.flatnonzero(np.concatenate([np.ones(min(len(points), 1), dtype=bool), begins]))
        last = np.append(first[1:], len(points)) - 1
        return marker[first].astype(np.intp), points[first], points[last[: len(first)]]

    def links(self) -> Links:
        """Return what gaps say if any part of a marker goes on as any other one that begins within `LONGEST`."""
        marker, first, last = self._parts
        begin, end = self._frame[first], self._frame[last]
        ends, begins, starts, rank = self._within_reach(begin, end)
        evidence = self._said(last[ends], first[begins], marker[ends], marker[begins])
        return Links(first, rank, starts, evidence)

    def _within_reach(self, begin: Ints, end: Ints) -> tuple[Ints, Ints, Ints, Ints]:
        """Parts that end, and parts that begin within `LONGEST`, end after end; see `Links` for the others.

        They are given by frames of their first and last points.
        """
        order = np.argsort(begin, kind="stable")
        low = np.searchsorted(begin[order], end, side="right")
        longest = int(min(LONGEST * self.take.rate, self.take.cloud.n_frames))
        count = np.searchsorted(begin[order], end + longest, side="right") - low
        count = np.minimum(count, MOST_FOLLOWING)
        behind = np.concatenate([[0], np.cumsum(count)])
        ends, place = numbers_between(low, low + count)
        begins = order[place]
        rank = np.empty(len(order), dtype=np.intp)
        rank[order] = np.arange(len(order))
        return ends, begins, np.stack([low, behind[:-1], behind[1:]]), rank

    def _said(self, before: Ints, after: Ints, *markers: Ints) -> Floats:
        """Evidence [nats] that points go on at others, 0 where neighbours are too few; see `evidence`."""
        seconds = (self._frame[after] - self._frame[before]) / self.take.rate
        away = lengths_of(self.take.cloud.points[after] - self.take.cloud.points[before])
        near = np.flatnonzero(away < FASTEST * seconds + 3.0 * self.take.spacing)
        evidence = np.full(len(before), -MOST_SPOKEN)
        evidence[near] = np.nan_to_num(self.evidence(before[near], after[near], *(owner[near] for owner in markers)))
        return evidence

    def total(self) -> float:
        """Return the evidence [nats] of all gaps within markers, but for those that leave out points of one track."""
        marker, first, last = self._parts
        within = np.flatnonzero(marker[1:] == marker[:-1])
        before, after = last[within], first[within + 1]
        counts = self._frame[after] - self._frame[before] <= LONGEST * self.take.rate
        counts &= ~self.take.is_followed_between(before, after)
        return float(np.nansum(self.evidence(before[counts], after[counts], marker[within][counts])))

    def between(self, apart: Bools) -> Floats:
        """Return the evidence [nats] that two markers are one, shape (n_markers, n_markers), 0 where nothing says so.

        Parameters
        ----------
        apart : ndarray of bool, shape (n_markers, n_markers)
            Markers that cannot be one.
        """
        marker, first, last = self._parts
        spoken = np.zeros((self._n_markers, self._n_markers))
        ends, begins = self._following(apart)
        if not len(ends):
            return spoken
        np.add.at(spoken, (marker[ends], marker[begins]), self._said(last[ends], first[begins], marker[ends]))
        return np.minimum(spoken + spoken.T, MOST_SPOKEN)

    def _following(self, apart: Bools) -> tuple[Ints, Ints]:
        """Parts of one marker that end, and parts of another that begin within `LONGEST`, with no part between."""
        marker, first, last = self._parts
        begin, end = self._frame[first], self._frame[last]
        same = marker[1:] == marker[:-1]
        next_begin = np.append(np.where(same, begin[1:], self.take.cloud.n_frames), self.take.cloud.n_frames)[
            : len(marker)
        ]
        last_end = np.append(-1, np.where(same, end[:-1], -1))[: len(marker)]
        ends, begins, _, _ = self._within_reach(begin, end)
        follows = ~apart[marker[ends], marker[begins]] & (marker[ends] != marker[begins])
        follows &= (next_begin[ends] >= begin[begins]) & (last_end[begins] <= end[ends])
        return ends[follows], begins[follows]

    def beside(self, first: Ints, last: Ints, possible: Bools) -> tuple[Floats, Ints]:
        """Evidence that pieces without a marker are part of one, by the gaps before and behind them.

        Parameters
        ----------
        first, last : ndarray of intp, shape (n_pieces,)
            First and last point of each piece.
        possible : ndarray of bool, shape (n_pieces, n_markers)
            Which markers are not seen meanwhile.

        Returns
        -------
        tuple of ndarray, shape (n_pieces, n_markers)
            Evidence [nats], and of how many gaps, up to two.
        """
        evidence, n_gaps = np.zeros(possible.shape), np.zeros(possible.shape, dtype=np.intp)
        points, starts = self._owned
        longest = LONGEST * self.take.rate
        gaps = []
        for marker in range(self._n_markers):
            own = points[starts[marker] : starts[marker + 1]]
            piece = np.flatnonzero(possible[:, marker])
            place = np.searchsorted(self._frame[own], self._frame[first[piece]])
            for ends, shift in ((first[piece], -1), (last[piece], 0)):
                inside = np.flatnonzero((place + shift >= 0) & (place + shift < len(own)))
                other, end = own[place[inside] + shift], ends[inside]
                near = np.abs(self._frame[other] - self._frame[end]) <= longest
                order = (other[near], end[near]) if shift else (end[near], other[near])
                gaps.append((piece[inside[near]], np.full(int(near.sum()), marker), *order))
        which, owner, before, after = (np.concatenate(part) for part in zip(*gaps, strict=True))
        said = self.evidence(before, after, owner)
        known = ~np.isnan(said)
        np.add.at(evidence, (which[known], owner[known]), said[known])
        np.add.at(n_gaps, (which[known], owner[known]), 1)
        return evidence, n_gaps

    def evidence(self, before: Ints, after: Ints, *markers: Ints) -> Floats:
        """Return the evidence [nats] that points go on at others, NaN where neighbours are too few, shape (n_gaps,).

        Parameters
        ----------
        before, after : ndarray of intp, shape (n_gaps,)
            Last points before gaps, and first ones behind them.
        *markers : ndarray of intp, shape (n_gaps,)
            Markers that would have the gaps, or have their points: not among the neighbours.
        """
        evidence, points = np.full(len(before), np.nan), self.take.cloud.points
        for start in range(0, len(before), GAPS_AT_ONCE):
            part = slice(start, start + GAPS_AT_ONCE)
            source, target = (self._points_beside(ends[part]) for ends in (before, after))
            for marker in markers:
                source[np.arange(len(source)), marker[part]] = -1
            expected, misfit = carried(points, before[part], source, target)
            deviation = PER_MISFIT * np.sqrt(misfit**2 + (STEADY * self.take.spacing) ** 2)
            missed = lengths_of(points[after[part]] - expected)
            evidence[part] = evidence_of_missed(missed, deviation, self.take.spacing, FREEDOM)
        return evidence

    def _points_beside(self, points: Ints) -> Ints:
        """Each marker's point in the frame of each point, -1 where it is unseen, shape (n_points, n_markers)."""
        frames, row = np.unique(self._frame[points], return_inverse=True)
        return point_labels.points_of_markers(self.take.cloud, self.marker_of_point, frames, self._n_markers)[row]


def evidence_of_missed(missed: Floats, deviation: Floats, spacing: float, freedom: float) -> Floats:
    """Return the evidence [nats] that what is found near a prediction is what was predicted; E above.

    Parameters
    ----------
    missed : ndarray, mm
        How far it is from the prediction.
    deviation : ndarray, mm
        Of a coordinate of the prediction.
    spacing : float, mm
        Typical distance of neighbouring markers.
    freedom : float
        Of Student's distribution.
    """
    wide = np.sqrt(deviation**2 + spacing**2)
    near, far = (
        (freedom + 3.0) / 2 * np.log1p((missed / one) ** 2 / freedom) for one in (deviation, wide)
    )  # minus the logarithms of its densities, but for a constant
    return np.asarray(3.0 * np.log(wide / deviation) - near + far)
