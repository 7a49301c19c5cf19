r"""Markers that go on as each other after a pause: exchanged where that explains the take better.

When several markers of a limb were hidden at once, and no limb tells which is which, they may come back under each
other's numbers. Then each is steady before and after, but its distances to all that it is seen with jump. Two markers
that both pause are exchanged from there on if the evidence of the whole take (`evidence_of_labels`) grows, the exchange
that gains most first. So the evidence never falls, and what is cyclically exchanged is put right by several exchanges.
"""

import itertools
from typing import NamedTuple

import numpy as np

from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.likelihood import explained, of_witnesses, sample_frames

LEAST_GAIN = 12.0
"""nats; what is gained by less may be chance: distances on soft limbs vary with the pose, too."""

NEAR = 2.0
"""Spacings between markers that may be exchanged; others are told apart by where they are."""

MOST_DISTANCES = 1_000_000
"""Distances that are held at once: of long takes, fewer moments are looked at."""

MOST_MARKERS = 200
"""Of more, no pairs are tried."""


class _Exchange(NamedTuple):
    """What an exchange of two markers gains [nats], and from which moment and frame on."""

    gain: float
    moment: int
    frame: int


NOTHING = _Exchange(-np.inf, 0, 0)


def exchange_markers(
    cloud: PointCloud, track_of_point: Ints, marker_of_point: Ints, rate: float, spacing: float, fixed: Bools
) -> Ints:
    """Exchange markers after pauses while the take is explained better.

    Parameters
    ----------
    cloud : PointCloud
        The take.
    track_of_point, marker_of_point : ndarray of intp, shape (n_points,)
        Track and marker of each point, -1 for none.
    rate : float, Hz
        Frame rate.
    spacing : float, mm
        Typical distance of neighbouring markers.
    fixed : ndarray of bool, shape (n_points,)
        Points that keep their marker.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; the given array if nothing is exchanged.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    if n_markers > MOST_MARKERS:
        return marker_of_point
    moments = sample_frames(rate, 0, cloud.n_frames)
    moments = moments[:: max(1, -(-len(moments) * n_markers**2 // MOST_DISTANCES))]
    held = np.bincount(marker_of_point[fixed & (marker_of_point >= 0)], minlength=n_markers) > 0
    search = _Search(cloud, track_of_point, marker_of_point, moments, spacing)
    free = np.flatnonzero(~held).tolist()
    found = {pair: search.best(*pair) for pair in itertools.combinations(free, 2)}
    while found:
        pair = max(found, key=lambda one: found[one].gain)
        if found[pair].gain < LEAST_GAIN:
            break
        found[pair] = search.best(*pair)  # others may have been exchanged since
        if found[pair].gain < LEAST_GAIN:
            continue
        search.exchange(*pair, found[pair])
        found |= {other: search.best(*other) for other in found if set(other) & set(pair)}
    return search.marker_of_point


class _Search:
    """Markers at some moments, and what exchanging them from a moment on gains."""

    def __init__(self, cloud: PointCloud, track: Ints, marker: Ints, moments: Ints, spacing: float) -> None:
        self.marker_of_point = marker
        self._track, self._moments, self._spacing, self._n_frames = track, moments, spacing, cloud.n_frames
        self._frame = np.repeat(np.arange(cloud.n_frames, dtype=np.int32), cloud.points_per_frame)
        self._places = point_labels.sampled_positions(cloud, marker, moments)
        self._pauses = [self._pauses_of(one) for one in range(self._places.shape[1])]
        self._measure()

    def best(self, one: int, other: int) -> _Exchange:
        """The exchange of two markers that gains most."""
        count, total, _ = self._sums[:, one, other]
        if count > 0 and total > NEAR * self._spacing * count:
            return NOTHING
        frames = np.union1d(self._pauses[one][1], self._pauses[other][1])
        begin, end = np.zeros_like(frames), np.full_like(frames, self._n_frames)
        for last, following in (self._pauses[one], self._pauses[other]):
            pause = np.minimum(np.searchsorted(following, frames), len(last) - 1)
            begin, end = np.maximum(begin, last[pause]), np.minimum(end, following[pause])
        longest = np.argsort(begin - end, kind="stable")
        frames = frames[longest[((begin < frames) & (frames <= end))[longest]]]  # in which both pause, longest first
        moment, place = np.unique(np.searchsorted(self._moments, frames), return_index=True)
        tried, frames = moment[moment > 0], frames[place[moment > 0]]
        if not len(tried):
            return NOTHING
        before = self._sums_before([one, other], tried)  # kind, moment, of two, marker
        after = self._sums[:, np.newaxis, [one, other]] - before
        sums = before + after[:, :, ::-1]
        sums[..., [one, other]] = 0.0
        gains = explained(sums, self._spacing)
        between = self._gains[one, other]
        gains[:, 0, other] = gains[:, 1, one] = between
        best = int(of_witnesses(gains).sum(axis=1).argmax())
        changed = self._gains.copy()
        changed[[one, other]] = gains[best]
        changed[:, [one, other]] = gains[best].T
        gain = float((of_witnesses(changed) - of_witnesses(self._gains)).sum())
        return _Exchange(gain, int(tried[best]), int(frames[best]))

    def exchange(self, one: int, other: int, chosen: _Exchange) -> None:
        """Exchange two markers from a frame on."""
        later = self._places[chosen.moment :]
        later[:, [one, other]] = later[:, [other, one]]
        later_points = self._frame >= chosen.frame
        marker = self.marker_of_point.copy()
        marker[later_points & (self.marker_of_point == one)] = other
        marker[later_points & (self.marker_of_point == other)] = one
        self.marker_of_point = marker
        self._pauses[one], self._pauses[other] = self._pauses_of(one), self._pauses_of(other)
        self._measure()

    def _pauses_of(self, marker: int) -> tuple[Ints, Ints]:
        """Last frames before pauses of a marker and first ones after them; where another track begins, it may pause."""
        points = np.flatnonzero(self.marker_of_point == marker)
        frame, track = self._frame[points], self._track[points]
        ends = np.flatnonzero((track[1:] != track[:-1]) | (track[1:] < 0) | (np.diff(frame) > 1))
        last = np.concatenate([[-1], frame[ends], frame[-1:]])
        following = np.concatenate([frame[:1], frame[ends + 1], [self._n_frames]])
        return last, following

    def _measure(self) -> None:
        """Sums of all distances, and what they explain."""
        every = np.arange(self._places.shape[1])
        self._sums = self._sums_before(every.tolist(), np.array([len(self._moments)]))[:, 0]
        self._gains = explained(self._sums, self._spacing)

    def _sums_before(self, markers: list[int], tried: Ints) -> Floats:
        """Number, sum and sum of squares of distances of some markers to all, before some moments."""
        distance = np.linalg.norm(self._places[:, markers, np.newaxis] - self._places[:, np.newaxis], axis=3)
        known = ~np.isnan(distance)
        distance = np.where(known, distance, 0.0)
        return np.stack(
            [table.cumsum(axis=0)[tried - 1] for table in (known.astype(np.float64), distance, distance**2)]
        )
