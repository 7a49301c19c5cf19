r"""Pieces that push others on: a piece of a track takes a marker's place, and what was there goes on to another one.

Where several markers of a limb come back under each other's numbers, a piece often cannot go to its own marker, as
another wrong piece is there; and that one cannot leave, as its own marker is taken, too. An ejection chain moves the
first piece all the same. Each piece that it pushes out goes to the marker whose distances it keeps best, from where it
may push out the next one, but none that the chain has moved; what finds no marker has none for now. The whole chain is
kept if it explains the take better by `LEAST_GAIN` (`likelihood.evidence_of_labels`).

What suits a piece is judged by the usual distances of markers, medians, which short errors do not change; whether a
chain is kept, by all distances.
"""

from typing import NamedTuple

import numpy as np

from skelgen._kernels.marker_exchanges import LEAST_GAIN
from skelgen.geometry.statistics import pair_lengths
from skelgen.model.arrays import Floats, Ints
from skelgen.stages.labels import point_labels
from skelgen.stages.labels.merging.followed import MOST_MARKERS, MOST_ROUNDS, FollowedCloud
from skelgen.stages.labels.merging.leftovers import (
    MOMENTS,
    distances_beside,
    evidence_of_pieces,
    moments_of_pieces,
)
from skelgen.stages.labels.merging.likelihood import LEAST_WITNESSES, evidence_of_places, robust_laws

SUITS = 6.0
"""nats that must speak for the marker to which a chain's first piece is moved."""

GOES_ON = 3.0
"""nats that must speak for the marker to which a piece goes that is pushed out."""

LESS_LIKELY = 5.0
"""nats by which a marker may be less likely than the one that a piece has: that one's partners may be wrong, too."""

MOST_STARTS = 40
"""Pieces from which chains begin, those first whose own marker suits them worst."""

TARGETS = 3
"""Markers to which the first piece of a chain is moved for trial; of the next pieces, one more is looked at."""

DEPTH = 5
"""Pieces that a chain moves before it only looks for free places."""

LONGEST = 15
"""Pieces that a chain moves at most."""

SEEN_ENOUGH = 5
"""Moments in which a distance must be seen for its median to be usual."""

_NOBODY, _ANYONE, _FIXED = -1, -2, -3
"""Who holds a marker's place if no piece does: points that are too short to be one, or such as keep their marker."""


class _State(NamedTuple):
    """Where markers are [mm] and which piece holds their places, moment by moment, and which marker pieces have."""

    places: Floats
    holder: Ints
    marker: Ints


def push_pieces(take: FollowedCloud, marker_of_point: Ints) -> Ints:
    """Move pieces of tracks in chains while the take is explained better.

    Parameters
    ----------
    take : FollowedCloud
        The take.
    marker_of_point : ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none.

    Returns
    -------
    ndarray of intp, shape (n_points,)
        Marker of each point, -1 for none, numbered without holes; the given array if nothing is moved.
    """
    for _ in range(MOST_ROUNDS):
        n_markers = int(marker_of_point.max(initial=-1)) + 1
        if not LEAST_WITNESSES < n_markers <= MOST_MARKERS:
            return marker_of_point
        samples = moments_of_pieces(take, marker_of_point, range(-1, n_markers))
        pieces = _Pieces(take, marker_of_point, samples) if len(samples) else None
        if pieces is None or not pieces.push():
            return marker_of_point
        marker_of_point = point_labels.without_holes(pieces.applied())
    return marker_of_point


class _Pieces:
    """Pieces of tracks, which marker each has, and where they are at some moments."""

    def __init__(self, take: FollowedCloud, marker_of_point: Ints, samples: Ints) -> None:
        self._take, self._marker_of_point = take, marker_of_point
        self._n_markers = int(marker_of_point.max()) + 1
        self._moments = take.moments(self._n_markers)
        self._track = take.track_of_point[samples[:, 0]].astype(np.int64)
        self._own = marker_of_point[samples[:, 0]].astype(np.intp)
        places = point_labels.sampled_positions(take.cloud, marker_of_point, self._moments, self._n_markers)
        self._state = _State(places, self._find_rows(), self._own.copy())
        self._suits = self._evidence_of_samples(samples)
        self._weights = take.weights(self._moments)
        self._evidence = evidence_of_places(places, self._weights, take.spacing)

    def _find_rows(self) -> Ints:
        """Find the moments in which each piece is seen, and where; return who holds each marker's place."""
        take, keys = self._take, self._track * (self._n_markers + 1) + self._own
        row, point = point_labels.points_in_frames(take.cloud, self._moments)
        track, marker = take.track_of_point[point].astype(np.int64), self._marker_of_point[point]
        order = np.argsort(keys, kind="stable")
        wanted = track * (self._n_markers + 1) + marker
        piece = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
        piece[(keys[piece] != wanted) | (track < 0)] = _ANYONE
        piece[take.is_fixed[point]] = _FIXED
        holder = np.full((len(self._moments), self._n_markers), _NOBODY, dtype=np.intp)
        owned = marker >= 0
        holder[row[owned], marker[owned]] = piece[owned]
        by_piece = np.argsort(piece, kind="stable")
        starts = np.searchsorted(piece[by_piece], np.arange(len(keys)))
        self._rows = np.split(row[by_piece], starts)[1:]
        self._at = np.split(take.cloud.points[point[by_piece]], starts)[1:]
        return holder

    def _evidence_of_samples(self, samples: Ints) -> Floats:
        """How well each piece suits each marker by usual distances [nats], shape (n_pieces, n_markers)."""
        distance, _ = distances_beside(self._take, self._marker_of_point, samples.ravel(), self._n_markers)
        own = np.repeat(self._own, MOMENTS)
        distance[np.flatnonzero(own >= 0), own[own >= 0]] = np.nan
        laws = _laws(self._state.places, self._take.spacing)
        return evidence_of_pieces(distance, np.arange(len(samples)) * MOMENTS, laws, self._take.spacing)

    def push(self) -> bool:
        """Begin chains where pieces suit other markers best; whether one was kept."""
        every, has_one, n_kept = np.arange(len(self._own)), self._own >= 0, 0
        own = np.where(has_one, self._suits[every, self._own], 0.0)
        own[~np.isfinite(own)] = 0.0
        others = self._suits.copy()
        others[every[has_one], self._own[has_one]] = -np.inf
        more = others.max(axis=1) - own
        for piece in np.argsort(-more, kind="stable")[:MOST_STARTS].tolist():
            least = max(SUITS, own[piece] - LESS_LIKELY)
            for goal in np.argsort(-others[piece], kind="stable")[:TARGETS].tolist():
                is_open = self._state.marker[piece] == self._own[piece] and len(self._rows[piece])
                if is_open and others[piece, goal] >= least:
                    n_kept += self._try(piece, goal)
        return n_kept > 0

    def _try(self, piece: int, goal: int) -> bool:
        """Move a piece, and those that it pushes out; whether that explains the take better and was kept."""
        state = _State(self._state.places.copy(), self._state.holder.copy(), self._state.marker.copy())
        moved: set[int] = set()
        waiting = [(piece, goal)]
        while waiting and len(moved) < LONGEST:
            one, goal = waiting.pop(0)
            moved.add(one)
            for other in self._place(state, one, goal):
                if other in moved:
                    continue
                there = self._goal_of(state, other, moved, len(moved) < DEPTH)
                if there >= 0:
                    waiting.append((other, there))
        evidence = evidence_of_places(state.places, self._weights, self._take.spacing)
        if evidence < self._evidence + LEAST_GAIN:
            return False
        self._state, self._evidence = state, evidence
        return True

    def _place(self, state: _State, piece: int, goal: int) -> list[int]:
        """Move a piece to a marker; return the pieces that were there meanwhile, which have none then."""
        rows, was = self._rows[piece], state.marker[piece]
        if was >= 0:
            state.places[rows, was], state.holder[rows, was] = np.nan, _NOBODY
        out = np.unique(state.holder[rows, goal])
        pushed: list[int] = out[out >= 0].tolist()
        for other in pushed:
            state.places[self._rows[other], goal], state.holder[self._rows[other], goal] = np.nan, _NOBODY
            state.marker[other] = -1
        state.places[rows, goal], state.holder[rows, goal] = self._at[piece], piece
        state.marker[piece] = goal
        return pushed

    def _goal_of(self, state: _State, piece: int, moved: set[int], may_push: bool) -> int:
        """The marker that suits a piece best, of those to whose places it may go; -1 if there is none."""
        goals: list[int] = np.argsort(-self._suits[piece], kind="stable")[: TARGETS + 1].tolist()
        for goal in goals:
            there = set(state.holder[self._rows[piece], goal].tolist())
            is_open = not there & (moved | {_FIXED}) and (may_push or max(there) < 0)
            if self._suits[piece, goal] >= GOES_ON and is_open:
                return goal
        return -1

    def applied(self) -> Ints:
        """Marker of each point when pieces have moved, -1 for none."""
        track, is_fixed = self._take.track_of_point, self._take.is_fixed
        result = self._marker_of_point.copy()
        frame = self._take.frame_of_point()
        changed = np.flatnonzero(self._state.marker != self._own)
        moved = [
            np.flatnonzero((track == self._track[piece]) & (self._marker_of_point == self._own[piece]))
            for piece in changed
        ]
        for points in moved:
            result[points] = -1
        for goal, points in zip(self._state.marker[changed].tolist(), moved, strict=True):
            if goal >= 0:
                there = np.flatnonzero(result == goal)
                there = there[np.isin(frame[there], frame[points])]
                result[there[~is_fixed[there]]] = -1
                result[points[~np.isin(frame[points], frame[there[is_fixed[there]]])]] = goal
        return result


def _laws(places: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Usual distances of markers [mm] and their variances [mm^2], infinite where hardly seen."""
    n_markers = places.shape[1]
    first, second = np.triu_indices(n_markers, 1)
    lengths = pair_lengths(places, first, second)
    usual, deviation = robust_laws(lengths, spacing)
    known = (~np.isnan(lengths)).sum(axis=1) >= SEEN_ENOUGH
    mean, variance = np.zeros((n_markers, n_markers)), np.full((n_markers, n_markers), np.inf)
    for one, other in ((first[known], second[known]), (second[known], first[known])):
        mean[one, other], variance[one, other] = usual[known], deviation[known] ** 2
    return mean, variance
