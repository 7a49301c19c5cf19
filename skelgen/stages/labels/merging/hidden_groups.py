r"""Markers that were hidden at once, matched anew as a group with what came back.

When an arm is hidden for a while, all its markers come back as new tracks, and distances to the rest of the body, which
is not rigid with it, tell little of which is which. Matched one by one, a first wrong match draws the next ones on, as
the pieces' distances to each other are then compared with others' distances; and with all of the arm permuted, no
single exchange explains the take better.

Here the take is cut at a frame in which several markers are hidden. Those of one side, and the lasting tracks of that
side that have no marker, are matched with the markers of the other side together. With the sums of distances on either
side, what two of a side's markers i, j gain when they are a and b of the other side is the evidence of the distance
(a, b) with those samples added, less that of both apart (`_kernels.marker_exchanges.explained`); so it is for their
distances to what is not hidden. Only the steadiest distances of each count. The best matching of the whole group is
found by a beam over its members, those seen longest first, and kept if it explains the take better by `LEAST_GAIN`.
A whole body that left and came back is matched, too, in the order in which its markers are tied to each other: left and
right limbs are alike but for what they hang on.
"""

from typing import NamedTuple

import numpy as np

from skelgen._kernels.group_matching import Choices, Gains, Side, best_matching, gains_of_goals
from skelgen._kernels.marker_exchanges import EXISTENCE, LEAST_GAIN, explained
from skelgen.geometry.statistics import pair_lengths
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.followed import MOST_MARKERS, MOST_ROUNDS, FollowedCloud
from skelgen.stages.labels.merging.likelihood import evidence_of_places
from skelgen.stages.labels.merging.markers import with_leftovers

LEFTOVERS = 24
"""Lasting tracks without a marker that are looked at, the longest."""

LEFTOVERS_AT_ONCE = 8
"""Of these, at one cut."""

LEAST_MOMENTS = 2
"""Moments in which such a track must be seen."""

LEAST_HIDDEN = 3
"""Members and goals together: one of each is what it is."""

MOST_HIDDEN, MOST_OF_BODY = 26, 64
"""Larger groups are not matched, and larger ones of which nothing is seen that they are steady with: time and memory
grow with the fourth power. 45 markers of a body take 0.3 s. Where a part of a body is seen, it says more of the rest by
smaller groups."""

STEADIEST = 8
"""Distances of each marker that count on either side of a cut."""

BEAM = 60
"""Matchings that are kept."""

LEAST_SCORE = 6.0
"""nats that a matching must gain by these distances to be weighed by all."""

UNMATCHED = 1000.0
"""nats against a marker of both sides that stays without one: more than any distances tell."""


def match_hidden(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Match groups of hidden markers anew while the take is explained better.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes; the given array if nothing changes.
    """
    for _ in range(MOST_ROUNDS):
        n_markers = int(marker_of_point.max(initial=-1)) + 1
        if not 2 < n_markers <= MOST_MARKERS:
            return marker_of_point
        better = _Cuts(take, marker_of_point).matched()
        if better is None:
            return marker_of_point
        marker_of_point = point_labels.without_holes(better)
    return marker_of_point


class _Group(NamedTuple):
    """What is matched at a cut: members with goals, by sums of distances (3, n, n) on their side and on the other."""

    members: Ints
    goals: Ints
    inside: Floats
    outside: Floats

    def key(self) -> tuple[bytes, ...]:
        """The same for groups of which no member and no goal is seen between their cuts."""
        n_inside, n_outside = self.inside[0].diagonal(), self.outside[0].diagonal()
        return tuple(
            part.tobytes() for part in (self.members, self.goals, n_inside[self.members], n_outside[self.goals])
        )


class _Cuts:
    """Markers, and tracks without one behind them, at some moments, and the distances up to each moment."""

    def __init__(self, take: FollowedCloud, marker: Ints) -> None:
        cloud, is_fixed = take.cloud, take.is_fixed
        self._cloud, self._spacing, self._n_markers = cloud, take.spacing, int(marker.max()) + 1
        extended = with_leftovers(take.track_of_point, marker)
        extended[(extended >= self._n_markers + LEFTOVERS) | (is_fixed & (marker < 0))] = -1
        self._marker, n_all = extended, max(int(extended.max()) + 1, self._n_markers)
        self._moments = take.moments(n_all)
        self._places = point_labels.sampled_positions(cloud, extended, self._moments, n_all)
        self._weights = take.weights(self._moments)
        self._frame = take.frame_of_point()
        self._n_known, self._is_stated = take.n_known, take.is_stated(marker, n_all)
        self._is_seen = np.zeros((cloud.n_frames, n_all), dtype=bool)
        owned = extended >= 0
        self._is_seen[self._frame[owned], extended[owned]] = True
        self._is_known = np.asarray(self._is_seen[: take.n_known].any(axis=0))
        first, second = np.triu_indices(n_all)
        lengths = pair_lengths(self._places, first, second)
        known = ~np.isnan(lengths)
        filled = np.where(known, lengths, 0.0)
        self._before = np.zeros((len(self._moments) + 1, 3, n_all, n_all))
        for number, table in enumerate((known, filled, filled**2)):
            sums = np.cumsum(table * self._weights, axis=1).T
            self._before[1:, number, first, second] = self._before[1:, number, second, first] = sums

    def matched(self) -> Ints | None:
        """Marker of each point by the matching that explains the take best; None if none does so better."""
        evidence, seen = evidence_of_places(self._places[:, : self._n_markers], self._weights, self._spacing), set()
        best, most = None, evidence + LEAST_GAIN
        for moment, cut in self._cuts():
            for is_later in (True, False):
                group = self._group(moment, cut, is_later)
                if group is None or (known := group.key()) in seen:
                    continue
                seen.add(known)
                goal = _matching(group, self._n_markers, self._spacing)
                inside = slice(moment, None) if is_later else slice(0, moment)
                if goal is not None:
                    places = self._places_if(group.members, goal, inside)
                    explains = evidence_of_places(places, self._weights, self._spacing)
                    if explains >= most:
                        best, most = (group.members, goal, cut, is_later), explains
        return None if best is None else self._applied(*best)

    def _cuts(self) -> list[tuple[int, int]]:
        """Between each two moments the frame in which most markers are hidden: the moment behind it, and the frame."""
        n_seen = self._is_seen[:, : self._n_markers].sum(axis=1)
        ends = zip(self._moments[:-1].tolist(), self._moments[1:].tolist(), strict=True)
        return [
            (row + 1, int(first + 1 + n_seen[first + 1 : end + 1].argmin()))
            for row, (first, end) in enumerate(ends)
            if end > self._n_known
        ]

    def _group(self, moment: int, cut: int, is_later: bool) -> _Group | None:
        """What is hidden at a cut; None if there is too little to match, or too much."""
        before, after = self._before[moment], self._before[-1] - self._before[moment]
        inside, outside = (after, before) if is_later else (before, after)
        n_inside, n_outside = inside[0].diagonal(), outside[0].diagonal()
        hidden = np.flatnonzero(~self._is_seen[cut] & ~self._is_stated)
        members, goals = (hidden[(hidden < self._n_markers) & (count[hidden] > 0)] for count in (n_inside, n_outside))
        members = members if is_later else members[~self._is_known[members]]
        left = hidden[(hidden >= self._n_markers) & (n_outside[hidden] == 0) & (n_inside[hidden] >= LEAST_MOMENTS)]
        left = left[np.argsort(-n_inside[left], kind="stable")[:LEFTOVERS_AT_ONCE]]
        if not (is_later or len(left)):  # the other side's members say the same
            return None
        members = np.concatenate([members, left])
        if len(members) + len(goals) < LEAST_HIDDEN or not (len(members) and len(goals)):
            return None
        group = _Group(members, goals, inside, outside)
        largest = max(len(members), len(goals))
        is_small = largest <= MOST_HIDDEN or (largest <= MOST_OF_BODY and self._is_apart(group))
        return group if is_small else None

    def _is_apart(self, group: _Group) -> bool:
        """Whether a group is steady with nothing that is seen."""
        others = np.setdiff1d(np.arange(self._n_markers), np.union1d(group.members, group.goals))
        ties = explained(group.inside, self._spacing)[np.ix_(group.members, others)]
        return not (ties > 0.0).any()

    def _places_if(self, members: Ints, goal: Ints, inside: slice) -> Floats:
        """Markers at the moments if members have these goals."""
        places = self._places[:, : self._n_markers].copy()
        places[inside, members[members < self._n_markers]] = np.nan
        for member, there in zip(members, goal, strict=True):
            if 0 <= there < self._n_markers:
                own, block = self._places[inside, member], places[inside, there]
                places[inside, there] = np.where(np.isnan(own), block, own)
        return places

    def _applied(self, members: Ints, goal: Ints, cut: int, is_later: bool) -> Ints:
        """Marker of each point if members have these goals on one side of the cut, -1 for none."""
        moved = np.append(np.arange(self._before.shape[-1], dtype=np.int32), -1)
        moved[members] = goal
        inside = (self._frame >= cut) == is_later
        result = np.where(inside, moved[self._marker], self._marker)
        result[result >= self._n_markers] = -1
        return point_labels.one_point_a_frame(self._cloud, result.astype(np.int32))


def _matching(group: _Group, n_markers: int, spacing: float) -> Ints | None:
    """The goal of each member by which distances are explained best, -1 for none; None if that is what they have."""
    members, goals = group.members, group.goals
    gains = _gains(group, n_markers, spacing)
    kept = np.searchsorted(goals, members)
    kept = np.where(goals[np.minimum(kept, len(goals) - 1)] == members, kept, -1)
    clash = group.inside[0][np.ix_(members, members)] > 0
    choices = Choices(clash, np.where(kept >= 0, -UNMATCHED, 0.0), _order(group, n_markers, spacing))
    best, score = best_matching(gains, choices, BEAM)
    if (best == kept).all() or score < _score(kept, gains) + LEAST_SCORE:
        return None
    stays = np.where(kept >= 0, -1, members)
    return np.where(best >= 0, goals[best], stays)


def _order(group: _Group, n_markers: int, spacing: float) -> Ints:
    """The order in which members are matched: those seen longest first, leftovers last.

    In large groups each is tied by steady distances to one before it, so that what is matched speaks of the next ones.
    """
    members = group.members
    last, seen = members >= n_markers, group.inside[0][members, members]
    if max(len(members), len(group.goals)) <= MOST_HIDDEN:
        return np.lexsort([-seen, last])
    ties = explained(group.inside, spacing)[np.ix_(members, members)]
    order = [int(np.lexsort([-seen, last])[0])]
    while len(order) < len(members):
        tied = ties[order].max(axis=0)
        tied[order] = -np.inf
        order.append(int(np.lexsort([-seen, -tied, last + 2 * np.isinf(tied)])[0]))
    return np.array(order)


def _gains(group: _Group, n_markers: int, spacing: float) -> Gains:
    """What members gain as goals; what has no marker yet explains nothing by itself."""
    members, goals, inside, outside = group
    told_in, told_out = explained(inside, spacing), explained(outside, spacing)
    steady_in, steady_out = _steadiest(told_in), _steadiest(told_out)
    told_in[n_markers:] = told_in[:, n_markers:] = 0.0
    others = np.setdiff1d(np.arange(n_markers), np.union1d(members, goals))
    sides = Side(members, inside, told_in, steady_in), Side(goals, outside, told_out, steady_out)
    gains = gains_of_goals(*sides, others, spacing)
    gains.alone[members < n_markers] += EXISTENCE
    return gains


def _steadiest(told: Floats) -> Bools:
    """Which distances are among the steadiest ones of either marker, shape (n_markers, n_markers)."""
    chosen = np.argsort(-told, axis=1, kind="stable")[:, :STEADIEST]
    counts = np.zeros(told.shape, dtype=bool)
    np.put_along_axis(counts, chosen, values=True, axis=1)
    counts &= told > 0.0
    return np.asarray(counts | counts.T)


def _score(goal: Ints, gains: Gains) -> float:
    """What a matching gains [nats]; -1 stands for no goal."""
    members = np.flatnonzero(goal >= 0)
    goal = goal[members]
    both = gains.pairs[members[:, np.newaxis], goal[:, np.newaxis], members, goal]
    return float(gains.alone[members, goal].sum() + np.triu(both, 1).sum())
