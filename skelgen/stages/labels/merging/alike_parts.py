r"""Parts of bodies that are alike, as a left and a right leg, and went on as each other while both were hidden.

When a leg comes back while the other one is hidden, all its markers may go on as the other leg's: distances within both
are the same, and those to the rest of the body, which tell them apart, vary with the posture. From then on everything
is consistent in itself, so that no exchange of two markers, and no chain of pieces, explains the take better.

Which markers correspond is found first. From each pair of markers a correspondence grows, each time by the pair for
which the steady distances to what corresponds already speak most, as left and right markers lie as far from their
neighbours, to within what hands place markers alike (`_kernels.alike_parts`). The best correspondences, which may pair
the limbs of two people, too, are divided by a tree of clusters, whose nodes are feet, legs, sides. The pairs of each
are exchanged for trial in all spans of time at whose ends both of a pair are hidden. What explains the take better by
`LEAST_GAIN` is kept, of exchanges with a marker in common the best one.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from skelgen._kernels.alike_parts import LEAST_PAIRS, MomentsOfPairs, Room, UsualDistances, grow_part, weigh_spans
from skelgen._kernels.marker_exchanges import LEAST_GAIN, explained, of_witnesses
from skelgen._kernels.tracklet_evidence import WITNESSES
from skelgen.geometry.statistics import pair_lengths
from skelgen.model.arrays import Bools, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.followed import MOST_ROUNDS, FollowedCloud
from skelgen.stages.labels.merging.likelihood import robust_laws

MOST_MARKERS = 128
"""Of more, none are looked at: time grows with the fourth power of their number."""

STEADY = 0.5
"""Spacings by which a distance may vary that tells which markers correspond."""

MOST_ALIKE = 60
"""Correspondences that are looked at, those for which most speaks."""

SHARED_PART = 0.8
"""Part of the pairs of a correspondence that one for which more speaks may have, too."""

MOST_ENDS = 32
"""Moments at which spans begin or end, those at which most pairs are hidden."""


class _Exchange(NamedTuple):
    """Pairs of markers (n_pairs, 2) that are exchanged between two moments, and what is explained then [nats]."""

    pairs: Ints
    first: int
    end: int
    evidence: float


def exchange_alike(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Exchange parts that are alike while the take is explained better.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none; the given array if nothing is exchanged.
    """
    n_markers = int(marker_of_point.max(initial=-1)) + 1
    if not 2 * LEAST_PAIRS <= n_markers <= MOST_MARKERS:
        return marker_of_point
    for _ in range(MOST_ROUNDS):
        parts = _AlikeParts(take, marker_of_point, n_markers)
        exchanges = parts.best_exchanges()
        if not exchanges:
            break
        marker_of_point = parts.exchanged(exchanges)
    return marker_of_point


class _AlikeParts:
    """Markers, when they are hidden, and the distances between them up to each moment."""

    def __init__(self, take: FollowedCloud, marker: Ints, n_markers: int) -> None:
        self._marker, self._spacing, self._frame = marker, take.spacing, take.frame_of_point()
        self._n_frames, self._is_fixed = take.cloud.n_frames, take.is_fixed
        self._free = ~take.is_stated(marker, n_markers)
        self._moments = take.moments(n_markers)
        self._own = self._moments >= take.n_known
        self._hidden: dict[tuple[int, int], Bools] = {}
        places = point_labels.sampled_positions(take.cloud, marker, self._moments, n_markers)
        self._is_placed = ~np.isnan(places[..., 0])
        self._is_seen = np.zeros((self._n_frames, n_markers), dtype=bool)
        self._is_seen[self._frame[marker >= 0], marker[marker >= 0]] = True
        first, second = np.triu_indices(n_markers)
        lengths = pair_lengths(places, first, second)
        known = ~np.isnan(lengths)
        filled = np.where(known, lengths, 0.0)
        self._before = np.zeros((len(self._moments) + 1, 3, n_markers, n_markers))
        for number, table in enumerate((known, filled, filled**2)):
            sums = np.cumsum(table * take.weights(self._moments), axis=1).T
            self._before[1:, number, first, second] = self._before[1:, number, second, first] = sums
        self._gains = explained(self._before[-1], self._spacing)
        self._told = of_witnesses(self._gains)[0]
        self._usual, self._deviation = np.zeros((2, n_markers, n_markers))
        for table, values in zip((self._usual, self._deviation), robust_laws(lengths, self._spacing), strict=True):
            table[first, second] = table[second, first] = values
        np.fill_diagonal(self._usual, np.nan)

    def best_exchanges(self) -> list[_Exchange]:
        """Find exchanges with which the take is explained better, of those with markers in common the best."""
        found, best = list[_Exchange](), list[_Exchange]()
        n_ends, n_markers = len(self._moments) + 1, len(self._gains)
        evidence, least = np.empty((n_ends, n_ends)), float(self._told.sum()) + LEAST_GAIN
        row, partner = np.empty(n_markers), np.empty(n_markers, dtype=np.intp)
        room = Room(np.empty(self._gains.shape), row, partner, np.empty(WITNESSES))
        for pairs in self._parts():
            hidden = self._hidden_at(pairs)
            moments = MomentsOfPairs(self._before, self._gains, self._told, pairs, hidden, self._spacing)
            weigh_spans(moments, least, room, evidence)
            first, end = np.unravel_index(int(evidence.argmax()), evidence.shape)
            if evidence[first, end] > least:
                some = pairs[hidden[first] & hidden[end]]
                found.append(_Exchange(some, int(first), int(end), float(evidence[first, end])))
        for exchange in sorted(found, key=lambda one: -one.evidence):
            if not any(np.isin(exchange.pairs, other.pairs).any() for other in best):
                best.append(exchange)
        return best

    def exchanged(self, exchanges: Sequence[_Exchange]) -> Ints:
        """Return the marker of each point after exchanges."""
        result = self._marker.copy()
        for pairs, first, end, _ in exchanges:
            for one, other in pairs:
                begin, behind = (self._frame_of_end(moment, one, other) for moment in (first, end))
                inside = (self._frame >= begin) & (self._frame < behind) & ~self._is_fixed
                result[inside & (self._marker == one)] = other
                result[inside & (self._marker == other)] = one
        return result

    def _frame_of_end(self, moment: int, one: int, other: int) -> int:
        """The first frame between a moment and that before it in which two markers are hidden."""
        if moment == len(self._moments):
            return self._n_frames
        begin = int(self._moments[moment - 1]) + 1
        hidden = ~self._is_seen[begin : self._moments[moment] + 1][:, [one, other]].any(axis=1)
        return begin + int(hidden.argmax())

    def _hidden_at(self, pairs: Ints) -> Bools:
        """Whether both of each pair are hidden in front of each moment, at the moments that matter most."""
        hidden = np.stack([self._hidden_pair(one, other) for one, other in pairs.tolist()], axis=1)
        placed: Bools = np.asarray(self._is_placed[:, pairs].any(axis=(1, 2)))
        count = hidden.sum(axis=1)
        for row in range(1, len(self._moments)):
            if not placed[row - 1] and count[row] <= count[row - 1]:  # nothing of the part is placed between the two
                hidden[row] = False
        count = hidden.sum(axis=1)
        hidden[np.argsort(-count, kind="stable")[MOST_ENDS:]] = False
        hidden[-1] = True
        return hidden

    def _hidden_pair(self, one: int, other: int) -> Bools:
        """Whether two markers are hidden in a frame between each moment and that before it, shape (n_moments + 1,)."""
        if (hidden := self._hidden.get((one, other))) is None:
            unseen = ~(self._is_seen[:, one] | self._is_seen[:, other])[: self._moments[-1] + 1]
            hidden = np.zeros(len(self._moments) + 1, dtype=bool)
            if len(self._moments) > 1:
                hidden[1:-1] = np.logical_or.reduceat(unseen, self._moments[:-1] + 1) & self._own[1:]
            self._hidden[one, other] = self._hidden[other, one] = hidden
        return hidden

    def _parts(self) -> list[Ints]:
        """Pairs of markers that correspond, part by part: nodes of the trees of the best correspondences."""
        parts = [part for pairs in self._correspondences() for part in self._nodes(pairs)]
        return list({frozenset(_names(part)): part for part in parts}.values())

    def _correspondences(self) -> list[Ints]:
        """Pairs of markers that correspond, each shape (n_pairs, 2), that for which most speaks first."""
        n_markers = len(self._gains)
        steady = (self._deviation < STEADY * self._spacing) & ~np.isnan(self._usual)
        usual, variance = np.nan_to_num(self._usual), np.nan_to_num(self._deviation) ** 2
        distances, score = UsualDistances(usual, variance, steady, self._spacing), np.empty(usual.shape)
        grown, is_covered = list[tuple[float, Ints]](), np.zeros((n_markers, n_markers), dtype=bool)
        for one, other in np.argwhere(np.triu(self._free[:, np.newaxis] & self._free, 1)):
            if not is_covered[one, other]:
                pairs = np.full((n_markers // 2, 2), -1, dtype=np.intp)
                pairs[0] = one, other
                speaks = grow_part(distances, self._free.copy(), score, pairs)
                pairs = pairs[pairs[:, 0] >= 0]
                is_covered[pairs[:, 0], pairs[:, 1]] = is_covered[pairs[:, 1], pairs[:, 0]] = True
                grown.append((speaks, pairs))
        kept = list[set[tuple[int, ...]]]()
        chosen = list[Ints]()
        for _, pairs in sorted(grown, key=lambda part: -part[0]):
            names = _names(pairs)
            if len(pairs) >= LEAST_PAIRS and all(len(names & other) <= SHARED_PART * len(names) for other in kept):
                kept.append(names)
                chosen.append(pairs)
            if len(chosen) == MOST_ALIKE:
                break
        return chosen

    def _nodes(self, pairs: Ints) -> list[Ints]:
        """The nodes of a tree of clusters of pairs, whose distances on both sides are steadiest within."""
        from scipy.cluster.hierarchy import linkage  # noqa: PLC0415 - heavy

        apart = np.maximum(*(self._deviation[np.ix_(side, side)] for side in pairs.T))
        first, second = np.triu_indices(len(pairs), 1)
        known = apart[first, second]
        links = linkage(np.where(np.isnan(known), np.nanmax(known, initial=self._spacing), known), "average")
        members = [[index] for index in range(len(pairs))]
        for one, other in links[:, :2].astype(np.intp):
            members.append(members[one] + members[other])
        return [pairs[some] for some in members[len(pairs) :]]


def _names(pairs: Ints) -> set[tuple[int, ...]]:
    """Pairs of markers, whichever of both stands first."""
    return {tuple(pair) for pair in np.sort(pairs, axis=1).tolist()}
