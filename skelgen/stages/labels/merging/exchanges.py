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

import itertools
from typing import NamedTuple

import numpy as np

from skelgen.geometry.statistics import SIGMA_OF_MEDIAN, median_of_known
from skelgen.model import PointCloud
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.likelihood import (
    EXISTENCE,
    LEAST_DEVIATION,
    WITNESSES,
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

MOST_MISFIT = 5.0
"""nats that one distance says at most against a point."""


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
        promising = search.promising()
        for pair in itertools.combinations(sorted(free), 2):
            if changed & set(pair):
                found[pair] = search.best(*pair) if promising[pair] else NOTHING
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
        self._pauses = [self._pauses_of(one) for one in range(n_markers)]
        self._distance = np.empty((n_moments, n_markers, n_markers))
        self._before = np.zeros((n_moments + 1, 3, n_markers, n_markers))
        self._usual, self._deviation, self._gains = np.empty((3, n_markers, n_markers))
        self._misfits = np.empty((n_moments, n_markers, n_markers))
        self._witnesses = [np.empty(0, dtype=np.intp)] * n_markers
        self._measure(list(range(n_markers)))

    def promising(self) -> Bools:
        """Which pairs are worth a trial: near ones, and those whose points suit each other's distances for a while."""
        count, total, _ = self._sums
        is_near = (count > 0) & (total <= NEAR * self._spacing * count)
        both = self._suits + self._suits.transpose(0, 2, 1)
        best, run = np.zeros((2, *both.shape[1:]))
        for moment in both:
            run = np.maximum(run + moment, 0.0)
            best = np.maximum(best, run)
        return np.asarray(is_near | (best > LEAST_GAIN))

    def best(self, one: int, other: int) -> _Exchange:
        """The exchange of two markers that gains most."""
        moments, frames = self._spans(one, other)
        if not len(moments):
            return NOTHING
        pair = [one, other]
        first, end = (self._before[moments[:, [side]], :, pair] for side in (0, 1))
        inside = (end - first).swapaxes(1, 2)  # span, kind, of two, marker
        sums = self._sums[:, pair] - inside + inside[:, :, ::-1]
        seen = np.stack([inside[:, 0, 0, one], inside[:, 0, 1, other]], axis=1)
        before = self._sums[0, pair, pair]
        n_fewer = (before > 0).sum() - (before - seen + seen[:, ::-1] > 0).sum(axis=1)
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
        self._pauses[one], self._pauses[other] = self._pauses_of(one), self._pauses_of(other)
        self._measure([one, other])

    def _spans(self, one: int, other: int) -> tuple[Ints, Ints]:
        """Spans between common pauses in which an exchange may gain: first and end as moments and frames, (n, 2)."""
        moment, frame = self._common_pauses(one, other)
        both = self._suits[:, one, other] + self._suits[:, other, one]
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

    def _pauses_of(self, marker: int) -> tuple[Ints, Ints]:
        """Last frames before pauses of a marker and first ones after them; where another track begins, it may pause."""
        points = np.flatnonzero(self.marker_of_point == marker)
        frame, track = self._frame[points], self._track[points]
        ends = np.flatnonzero((track[1:] != track[:-1]) | (track[1:] < 0) | (np.diff(frame) > 1))
        last = np.concatenate([[-1], frame[ends], frame[-1:]])
        following = np.concatenate([frame[:1], frame[ends + 1], [self._n_frames]])
        return last, following

    def _measure(self, changed: list[int]) -> None:
        """Sums of all distances before each moment, what they explain, and how points suit other markers.

        All is measured anew that depends on the markers `changed`.
        """
        distance = np.linalg.norm(self._places[:, changed, np.newaxis] - self._places[:, np.newaxis], axis=3)
        self._distance[:, changed] = distance
        self._distance[:, :, changed] = distance.swapaxes(1, 2)
        known = ~np.isnan(distance)
        filled = np.where(known, distance, 0.0)
        for kind, table in enumerate((known, filled, filled**2)):
            sums = np.cumsum(table, axis=0, dtype=np.float64)
            self._before[1:, kind, changed] = sums
            self._before[1:, kind, :, changed] = np.moveaxis(sums, 1, 0)
        self._sums = self._before[-1]
        gains = explained(self._sums[:, changed], self._spacing)
        self._gains[changed], self._gains[:, changed] = gains, gains.T
        self._witnessed = of_witnesses(self._gains)
        self._judge(distance, changed)

    def _judge(self, distance: Floats, changed: list[int]) -> None:
        """How much better a marker's point suits another one's usual distances [nats], (n_moments, n, n).

        Distances [mm] are those of the markers `changed`.
        """
        shape = distance.shape
        flat = distance.reshape(len(distance), -1)
        usual = median_of_known(flat)
        spread = median_of_known(np.abs(flat - usual)).reshape(shape[1:])
        deviation = np.maximum(SIGMA_OF_MEDIAN * spread, LEAST_DEVIATION * self._spacing)
        for table, rows in ((self._usual, usual.reshape(shape[1:])), (self._deviation, deviation)):
            table[changed], table[:, changed] = rows, rows.T
        for marker, gain in enumerate(self._gains):
            witnesses = np.argsort(-gain, kind="stable")[:WITNESSES]
            witnesses = witnesses[gain[witnesses] > 0.0]
            is_new = marker in changed or not np.array_equal(witnesses, self._witnesses[marker])
            is_new = is_new or bool(np.isin(changed, witnesses).any())
            self._witnesses[marker] = witnesses
            points = list(range(len(self._gains))) if is_new else changed
            self._misfits[:, points, marker] = self._misfit(marker, points)
        own = self._misfits.diagonal(axis1=1, axis2=2)[:, :, np.newaxis]
        self._suits = own - self._misfits

    def _misfit(self, marker: int, others: list[int]) -> Floats:
        """How badly points of some markers suit a marker's usual distances [nats], shape (n_moments, n_others)."""
        witnesses = self._witnesses[marker]
        distance = self._distance[:, np.array(others)[:, np.newaxis], witnesses]
        squares = ((distance - self._usual[marker, witnesses]) / self._deviation[marker, witnesses]) ** 2
        squares[:, np.array(others)[:, np.newaxis] == witnesses] = 0.0  # its own distance to itself
        return np.asarray(np.minimum(np.nan_to_num(squares / 2), MOST_MISFIT).sum(axis=2))
