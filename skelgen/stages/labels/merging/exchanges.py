r"""Markers that go on as each other for a while: exchanged where that explains the take better.

When several markers of a limb were hidden at once, and no limb tells which is which, they may come back under each
other's numbers. Then each is steady before and after, but its distances to all that it is seen with jump; and what was
one marker's for a moment keeps that marker's two parts from being joined. Two markers that both pause are exchanged
from there on, or until they both pause again, if the evidence of the whole take (`evidence_of_labels`) grows, the
exchange that gains most first. One of the two may be a marker that is not seen in that time. So the evidence never
falls, and what is cyclically exchanged is put right by several exchanges.

Which exchanges are tried is told by how well each point suits the usual distances of either marker: medians, which a
short exchange does not change. Where both pause, gaps say, too, who goes on as whom (`continuity`); what they say is
looked up once for every two parts of markers, with the labels from which the search begins.
"""

import numpy as np

from skelgen._kernels.marker_exchanges import (
    LEAST_GAIN,
    NEAR,
    MarkerDistances,
    explained,
    of_witnesses,
    weigh_exchanges,
)
from skelgen._kernels.marker_pauses import NO_LINKS, Links, Pauses
from skelgen._kernels.tracklet_evidence import WITNESSES, write_misfits
from skelgen.geometry.statistics import pair_lengths
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.continuity import pauses_between
from skelgen.stages.labels.merging.followed import MOST_MARKERS, MOST_ROUNDS, FollowedCloud
from skelgen.stages.labels.merging.handedness import evidence_of_sides
from skelgen.stages.labels.merging.likelihood import robust_laws


def exchange_markers(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Exchange markers between pauses while the take is explained better.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes; the given array if nothing is exchanged.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    if not n_markers or n_markers > MOST_MARKERS:
        return marker_of_point
    search = _Search(take, marker_of_point, n_markers)
    free = np.flatnonzero(~take.is_stated(marker_of_point, n_markers))
    search.weigh(free[np.stack(np.triu_indices(len(free), 1), axis=1)])
    for _ in range(MOST_ROUNDS * n_markers):
        if search.gain.max() < LEAST_GAIN:
            break
        pair = np.array(np.unravel_index(search.gain.argmax(), search.gain.shape))
        search.weigh(pair[np.newaxis])  # others may have been exchanged since
        if search.gain[tuple(pair)] < LEAST_GAIN:
            continue
        if search.exchange(*pair):
            search.weigh(_pairs_with(pair, free))
        else:
            search.gain[tuple(pair)] = -np.inf
    if search.marker_of_point is marker_of_point:
        return marker_of_point
    return point_labels.without_holes(search.marker_of_point)


def _pairs_with(pair: Ints, free: Ints) -> Ints:
    """Both of two markers with any that may be exchanged, each pair once, shape (n_pairs, 2)."""
    others = free[~np.isin(free, pair)]
    with_others = np.stack([np.repeat(pair, len(others)), np.tile(others, 2)], axis=1)
    return np.sort(np.concatenate([pair[np.newaxis], with_others]), axis=1)


class GainsThatGrow:
    """What changes that can be made and undone gained when they were made last.

    Usual distances and sides change with the labels, so that both an exchange and the one that undoes it may seem to
    gain. What gained more is right; made again and again, they would never end.
    """

    def __init__(self) -> None:
        self._last: dict[tuple[int, ...], float] = {}

    def grows(self, change: tuple[int, ...], gain: float) -> bool:
        """Return whether a change gains more than it did when it was made last, and remember it if it does.

        Parameters
        ----------
        change : tuple of int
            What is made by the same step as it is undone.
        gain : float, nats
            What it gains now, above 0.
        """
        if gain <= self._last.get(change, 0.0):
            return False
        self._last[change] = gain
        return True


class _Search:
    """Markers at some moments, and what exchanging them for a while gains.

    Attributes
    ----------
    marker_of_point : ndarray of intp, shape (n_points,)
        As exchanged so far.
    gain : ndarray, shape (n_markers, n_markers), nats
        What an exchange gains when it was weighed last, above the diagonal; -inf for nothing.
    """

    def __init__(self, take: FollowedCloud, marker: Ints, n_markers: int) -> None:
        self.marker_of_point = marker
        self._track, self._spacing, self._n_frames = take.track_of_point, take.spacing, take.cloud.n_frames
        self._n_known = take.n_known
        self._moments = np.ascontiguousarray(take.moments(n_markers))
        self._weights = take.weights(self._moments)
        self._frame = take.frame_of_point()
        self._places = point_labels.sampled_positions(take.cloud, marker, self._moments)
        n_moments = len(self._moments)
        order = np.argsort(marker.astype(np.int16), kind="stable")  # such small numbers are sorted quickly
        self._links, self._part = self._heard(take)
        owned = np.split(order, np.searchsorted(marker[order], np.arange(n_markers)))[1:]
        self._pauses = [self._pauses_of(points) for points in owned]
        self._distance = np.empty((n_markers, n_markers, n_moments))
        self._before = np.zeros((n_markers, n_markers, 3, n_moments + 1))
        self._usual, self._deviation, self._gains = np.empty((3, n_markers, n_markers))
        self._misfits = np.empty((n_markers, n_markers, n_moments))
        self._witnesses = np.full((n_markers, WITNESSES), -1, dtype=np.intp)
        self._measure(np.arange(n_markers), *np.triu_indices(n_markers))
        self.gain = np.full((n_markers, n_markers), -np.inf)
        self._spans = np.zeros((n_markers, n_markers, 4), dtype=np.intp)
        self._made = GainsThatGrow()

    def weigh(self, pairs: Ints) -> None:
        """Weigh exchanges of some pairs of markers, shape (n_pairs, 2)."""
        distances = MarkerDistances(self._before, self._misfits, self._gains, self._witnessed, self._spacing)
        last, following, part = (np.concatenate(ends).astype(np.intp) for ends in zip(*self._pauses, strict=True))
        starts = np.concatenate([[0], np.cumsum([len(pauses[0]) for pauses in self._pauses])])
        one, other = pairs.T
        pauses = Pauses(starts, last, following, self._moments, part, self._links)
        sides = self._sides(pairs)
        self.gain[one, other], self._spans[one, other] = weigh_exchanges(pairs, distances, pauses, sides)

    def _sides(self, pairs: Ints) -> Floats:
        """What exchanging two near markers gains by their sides at each moment [nats], shape (n_pairs, n_moments)."""
        one, other = pairs.T
        count, total = self._before[one, other, 0, -1], self._before[one, other, 1, -1]
        near = np.flatnonzero((count > 0.0) & (total <= NEAR * self._spacing * count))
        sides = np.zeros((len(pairs), len(self._moments)))
        sides[near] = evidence_of_sides(pairs[near], self._places, self._gains, self._spacing)
        return sides

    def exchange(self, one: int, other: int) -> bool:
        """Exchange two markers where that gains most; return whether they were."""
        if not self._made.grows((one, other, *self._spans[one, other].tolist()), float(self.gain[one, other])):
            return False
        first, end, begin, behind = self._spans[one, other]
        inside = self._places[first:end]
        inside[:, [one, other]] = inside[:, [other, one]]
        points = (self._frame >= begin) & (self._frame < behind)
        marker = self.marker_of_point.copy()
        marker[points & (self.marker_of_point == one)] = other
        marker[points & (self.marker_of_point == other)] = one
        self.marker_of_point = marker
        for changed in (one, other):
            self._pauses[changed] = self._pauses_of(np.flatnonzero(marker == changed))
        n_markers = len(self._gains)
        self._measure(np.array([one, other]), np.repeat([one, other], n_markers), np.tile(np.arange(n_markers), 2))
        return True

    def _heard(self, take: FollowedCloud) -> tuple[Links, Ints | None]:
        """What gaps say, and the part that begins at each point, -1 for none; None if they are not listened to."""
        gaps = take.continuity(self.marker_of_point) if take.exchanges_over_gaps else None
        if gaps is None:
            return NO_LINKS, None
        links = gaps.links()
        part = np.full(len(self.marker_of_point), -1, dtype=np.int32)
        part[links.first_point] = np.arange(len(links.first_point))
        return links, part

    def _pauses_of(self, points: Ints) -> tuple[Ints, Ints, Ints]:
        """Last frames before pauses of a marker and first ones after them; where another track begins, it may pause.

        Behind them stand its parts between, -1 where gaps are not listened to.
        """
        frame = self._frame[points]
        if self._part is None:
            pauses = np.flatnonzero(pauses_between(frame, self._track[points]) & (frame[1:] >= self._n_known))
            begins = np.append(0, pauses + 1)[: len(points)]
            part = np.full(len(begins), -1)
        else:
            begins = np.flatnonzero(self._part[points] >= 0)  # also where an exchange has joined parts of a track
            part = self._part[points[begins]]
        last = np.concatenate([[-1], frame[begins[1:] - 1], frame[-1:]])
        return last, np.append(frame[begins], self._n_frames), np.append(part, -1)

    def _measure(self, changed: Ints, first: Ints, second: Ints) -> None:
        """Sums of distances before each moment, what they explain, and how badly points suit other markers.

        All is measured anew that depends on the markers `changed`: the distances between `first` and `second`.
        """
        lengths = pair_lengths(self._places, first, second)
        known = ~np.isnan(lengths)
        filled = np.where(known, lengths, 0.0)
        sums = np.cumsum(np.stack([known, filled, filled**2], axis=1) * self._weights, axis=2)
        for one, other in ((first, second), (second, first)):
            self._distance[one, other] = lengths
            self._before[one, other, :, 1:] = sums
        gains = explained(np.moveaxis(self._before[changed, ..., -1], 2, 0), self._spacing)
        self._gains[changed], self._gains[:, changed] = gains, gains.T
        self._witnessed = of_witnesses(self._gains)
        usual, deviation = robust_laws(lengths, self._spacing)
        for table, values in ((self._usual, usual), (self._deviation, deviation)):
            table[first, second] = table[second, first] = values
        self._judge(changed)

    def _judge(self, changed: Ints) -> None:
        """Weigh how badly markers' points suit other markers' usual distances."""
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
