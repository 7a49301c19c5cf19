r"""Markers that go on as each other for a while: exchanged where that explains the take better.

When several markers of a limb were hidden at once, and no limb tells which is which, they may come back under each
other's numbers. Then each is steady before and after, but its distances to all that it is seen with jump; and what was
one marker's for a moment keeps that marker's two parts from being joined. Two markers that both pause are exchanged
from there on, or until they both pause again, if the evidence of the whole take (`evidence_of_labels`) grows, the
exchange that gains most first. One of the two may be a marker that is not seen in that time. So the evidence never
falls, and what is cyclically exchanged is put right by several exchanges.

Which exchanges are tried is told by how well each point suits the usual distances of either marker: medians, which a
short exchange does not change.
"""

from typing import NamedTuple

import numpy as np

from skelgen._kernels.tracklet_evidence import WITNESSES, write_misfits
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, median_of_known, pair_lengths
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.likelihood import (
    EXISTENCE,
    LEAST_DEVIATION,
    explained,
    of_witnesses,
    sample_frames,
)

LEAST_GAIN = 12.0
"""nats; what is gained by less may be chance: distances on soft limbs vary with the pose, too."""

NEAR = 2.0
"""Spacings between markers that may be exchanged unasked; others are if their points suit each other's distances."""

MOST_DISTANCES = 1_000_000
"""Distances that are held at once: of long takes, fewer moments are looked at."""

MOST_MARKERS = 200
"""Of more, no pairs are tried."""

TRIED = 8
"""Spans in which two markers are exchanged for trial, those in which the other marker's distances suit best."""

MOST_PAUSES = 200
"""Of more common pauses of two markers, the longest ones are looked at: spans are between any two of them."""


class _Exchange(NamedTuple):
    """What an exchange of two markers gains [nats], and its first moment and frame, and those behind its last."""

    gain: float
    moments: tuple[int, int]
    frames: tuple[int, int]


NOTHING = _Exchange(-np.inf, (0, 0), (0, 0))


def exchange_markers(
    cloud: PointCloud, track_of_point: Ints, marker_of_point: Ints, rate: float, spacing: float, fixed: Bools
) -> Ints:
    """Exchange markers between pauses while the take is explained better.

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
        Marker of each point, -1 for none, numbered without holes; the given array if nothing is exchanged.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    if not n_markers or n_markers > MOST_MARKERS:
        return marker_of_point
    moments = sample_frames(rate, 0, cloud.n_frames)
    moments = moments[:: max(1, -(-len(moments) * n_markers**2 // MOST_DISTANCES))]
    is_held = np.bincount(marker_of_point[fixed & (marker_of_point >= 0)], minlength=n_markers) > 0
    search = _Search(cloud, track_of_point, marker_of_point, moments, spacing)
    found: dict[tuple[int, int], _Exchange] = {}
    changed = set(np.flatnonzero(~is_held).tolist())
    free = frozenset(changed)
    while True:
        for one, is_promising in zip(sorted(changed), search.promising(sorted(changed)), strict=True):
            for other in free - {one}:
                pair = min(one, other), max(one, other)
                if other > one or other not in changed:
                    found[pair] = search.best(*pair) if is_promising[other] else NOTHING
        pair = max(found, key=lambda one: found[one].gain, default=(0, 0))
        best = found.get(pair, NOTHING)
        if best.gain < LEAST_GAIN:
            break
        found[pair] = search.best(*pair)  # others may have been exchanged since
        changed = set()
        if found[pair].gain < LEAST_GAIN:
            continue
        search.exchange(*pair, found[pair])
        changed = set(pair)
    if search.marker_of_point is marker_of_point:
        return marker_of_point
    counts = np.bincount(search.marker_of_point[search.marker_of_point >= 0], minlength=1)
    return point_labels.renumbered(search.marker_of_point, counts > 0)


class _Search:
    """Markers at some moments, and what exchanging them for a while gains."""

    def __init__(self, cloud: PointCloud, track: Ints, marker: Ints, moments: Ints, spacing: float) -> None:
        self.marker_of_point = marker
        self._track, self._moments, self._spacing, self._n_frames = track, moments, spacing, cloud.n_frames
        self._frame = np.repeat(np.arange(cloud.n_frames, dtype=np.int32), cloud.points_per_frame)
        self._places = point_labels.sampled_positions(cloud, marker, moments)
        n_moments, n_markers = self._places.shape[:2]
        order = np.argsort(marker.astype(np.int16), kind="stable")  # such small numbers are sorted quickly
        parts = np.split(order, np.searchsorted(marker[order], np.arange(n_markers)))[1:]
        self._pauses = [self._pauses_of(points) for points in parts]
        self._distance = np.empty((n_markers, n_markers, n_moments))
        self._before = np.zeros((n_markers, n_markers, 3, n_moments + 1))
        self._usual, self._deviation, self._gains = np.empty((3, n_markers, n_markers))
        self._misfits = np.empty((n_markers, n_markers, n_moments))
        self._witnesses = np.full((n_markers, WITNESSES), -1, dtype=np.intp)
        self._measure(np.arange(n_markers), *np.triu_indices(n_markers))

    def promising(self, markers: list[int]) -> Bools:
        """Whether some markers' exchange with any is worth a trial, shape (len(markers), n_markers).

        That is with near ones, and with those whose points suit each other's distances for a while.
        """
        count, total, _ = self._sums[:, markers]
        is_near = (count > 0) & (total <= NEAR * self._spacing * count)
        both = self._suits[markers] + self._suits[:, markers].swapaxes(0, 1)
        best, run = np.zeros((2, *both.shape[:2]))
        for moment in np.ascontiguousarray(np.moveaxis(both, 2, 0)):
            run = np.maximum(run + moment, 0.0)
            best = np.maximum(best, run)
        return np.asarray(is_near | (best > LEAST_GAIN))

    def best(self, one: int, other: int) -> _Exchange:
        """The exchange of two markers that gains most."""
        moments, frames = self._spans(one, other)
        if not len(moments):
            return NOTHING
        pair = [one, other]
        begins, ends = moments.T
        inside = np.stack([self._before[marker][..., ends] - self._before[marker][..., begins] for marker in pair])
        inside = inside.transpose(3, 2, 0, 1)  # span, kind, of two, marker
        sums = self._sums[:, pair] - inside + inside[:, :, ::-1]
        seen = np.stack([inside[:, 0, 0, one], inside[:, 0, 1, other]], axis=1)
        samples = self._sums[0, pair, pair]
        n_fewer = (samples > 0).sum() - (samples - seen + seen[:, ::-1] > 0).sum(axis=1)
        sums[..., pair] = 0.0
        gains = explained(np.moveaxis(sums, 1, 0), self._spacing)
        gains[:, 0, other] = gains[:, 1, one] = self._gains[one, other]
        best = int((of_witnesses(gains).sum(axis=1) + EXISTENCE * n_fewer).argmax())
        changed = self._gains.copy()
        changed[pair] = gains[best]
        changed[:, pair] = gains[best].T
        gain = float((of_witnesses(changed) - self._witnessed).sum() + EXISTENCE * n_fewer[best])
        (first, end), (begin, behind) = moments[best].tolist(), frames[best].tolist()
        return _Exchange(gain, (first, end), (begin, behind))

    def exchange(self, one: int, other: int, chosen: _Exchange) -> None:
        """Exchange two markers in a span."""
        inside = self._places[chosen.moments[0] : chosen.moments[1]]
        inside[:, [one, other]] = inside[:, [other, one]]
        points = (self._frame >= chosen.frames[0]) & (self._frame < chosen.frames[1])
        marker = self.marker_of_point.copy()
        marker[points & (self.marker_of_point == one)] = other
        marker[points & (self.marker_of_point == other)] = one
        self.marker_of_point = marker
        for changed in (one, other):
            self._pauses[changed] = self._pauses_of(np.flatnonzero(marker == changed))
        n_markers = len(self._gains)
        self._measure(np.array([one, other]), np.repeat([one, other], n_markers), np.tile(np.arange(n_markers), 2))

    def _spans(self, one: int, other: int) -> tuple[Ints, Ints]:
        """Spans between common pauses in which an exchange may gain: first and end as moments and frames, (n, 2)."""
        moment, frame = self._common_pauses(one, other)
        both = self._suits[one, other] + self._suits[other, one]
        total = np.concatenate([[0.0], both.cumsum()])[moment]
        # What begins with the take ends elsewhere: exchanging all else is the same, but for the markers' numbers
        gain = total - total[1:, np.newaxis]
        gain = np.triu(np.maximum(gain, total[-1] - gain)[:-1], 2)
        count, distance, _ = self._sums[:, one, other]
        is_tried = np.zeros(gain.shape, dtype=bool)
        if count > 0 and distance <= NEAR * self._spacing * count:
            is_tried[:, -1] = True
        gaining = np.flatnonzero(gain > 0.0)
        is_tried.flat[gaining[np.argsort(-gain.flat[gaining], kind="stable")[:TRIED]]] = True
        first, end = np.nonzero(is_tried)
        spans = np.stack([first + 1, end], axis=1)
        return moment[spans], frame[spans]

    def _common_pauses(self, one: int, other: int) -> tuple[Ints, Ints]:
        """Moments before which two markers both pause longest, and the frames, the longest pause of each; both ends."""
        frames = np.union1d(self._pauses[one][1], self._pauses[other][1])
        begin, end = np.zeros_like(frames), np.full_like(frames, self._n_frames)
        for last, following in (self._pauses[one], self._pauses[other]):
            pause = np.minimum(np.searchsorted(following, frames), len(last) - 1)
            begin, end = np.maximum(begin, last[pause]), np.minimum(end, following[pause])
        longest = np.argsort(begin - end, kind="stable")
        frames = frames[longest[((begin < frames) & (frames <= end))[longest]]][:MOST_PAUSES]
        moment, place = np.unique(np.searchsorted(self._moments, frames), return_index=True)
        inner = (moment > 0) & (moment < len(self._moments))
        moment = np.concatenate([[0], moment[inner], [len(self._moments)]])
        return moment, np.concatenate([[0], frames[place[inner]], [self._n_frames]])

    def _pauses_of(self, points: Ints) -> tuple[Ints, Ints]:
        """Last frames before pauses of a marker and first ones after them; where another track begins, it may pause."""
        frame, track = self._frame[points], self._track[points]
        ends = np.flatnonzero((track[1:] != track[:-1]) | (track[1:] < 0) | (np.diff(frame) > 1))
        last = np.concatenate([[-1], frame[ends], frame[-1:]])
        following = np.concatenate([frame[:1], frame[ends + 1], [self._n_frames]])
        return last, following

    def _measure(self, changed: Ints, first: Ints, second: Ints) -> None:
        """Sums of distances before each moment, what they explain, and how points suit other markers.

        All is measured anew that depends on the markers `changed`: the distances between `first` and `second`.
        """
        lengths = pair_lengths(self._places, first, second)
        known = ~np.isnan(lengths)
        filled = np.where(known, lengths, 0.0)
        sums = np.cumsum(np.stack([known, filled, filled**2], axis=1), axis=2)
        for one, other in ((first, second), (second, first)):
            self._distance[one, other] = lengths
            self._before[one, other, :, 1:] = sums
        self._sums = np.ascontiguousarray(self._before[..., -1].transpose(2, 0, 1))
        gains = explained(self._sums[:, changed], self._spacing)
        self._gains[changed], self._gains[:, changed] = gains, gains.T
        self._witnessed = of_witnesses(self._gains)
        usual = median_of_known(lengths.T)
        spread = median_of_known(np.abs(lengths - usual[:, np.newaxis]).T)
        deviation = np.maximum(SIGMA_OF_MEDIAN * spread, LEAST_DEVIATION * self._spacing)
        for table, values in ((self._usual, usual), (self._deviation, deviation)):
            table[first, second] = table[second, first] = values
        self._judge(changed)

    def _judge(self, changed: Ints) -> None:
        """How much better a marker's point suits another one's usual distances [nats], (n, n, n_moments)."""
        witnesses = np.argsort(-self._gains, axis=1, kind="stable")[:, :WITNESSES]
        witnesses = np.where(np.take_along_axis(self._gains, witnesses, axis=1) > 0.0, witnesses, -1)
        is_new = (witnesses != self._witnesses[:, : witnesses.shape[1]]).any(axis=1)
        is_new |= np.isin(witnesses, changed).any(axis=1)
        is_new[changed] = True
        self._witnesses = witnesses
        everyone = np.arange(len(witnesses))
        for marker, chosen in enumerate(witnesses):
            points = everyone if is_new[marker] else changed
            write_misfits(marker, points, chosen, self._distance, (self._usual, self._deviation), self._misfits)
        own = self._misfits.diagonal().T
        self._suits = own[:, np.newaxis] - self._misfits
