"""Which of the pairs of balls stand where a rigid body has a ball: known targets, and distances that hold over time.

Three balls on one rigid body keep their triangle wherever they go. Triangles are known of the targets of the settings;
others are learned: three pairs of tracks that were believed, and whose distances changed no more than noise explains.
They need no names, so that a triangle that was learned once speaks for balls whose tracks were lost since. A candidate
that makes a triangle with two others is where a ball belongs; how much that says is counted in the recording itself, on
candidates that are surely right, and on the same at depths where they are surely wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.bodies.finder import table_of_target
from skelgen.capture.markers.candidates import Candidates
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import BodyTarget

MOST_MATES = 8
"""Rigid mates of a pair of tracks of which triangles are made, the steadiest first."""

LEARNING_SPANS = 10
"""Of `SPAN_FRAMES` each, spread over longer recordings: where distances are learned. A minute shows a body whole."""

INDEPENDENT = 0.25
"""Time [s] after which candidates of the same tracks make new triangles: by then moving bodies have other distances."""

CHECKED_FRAMES = 300
"""Frames in which it is counted how often right and wrong candidates make triangles."""

NOBODY = -1
"""Pair of tracks of a triangle that was not learned."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Rigid triangles, each three times: once for each of its balls.

    Attributes
    ----------
    sides : ndarray, shape (n, 3), mm
        From the ball to the nearer one of the others, to the farther one, and between these.
    std : ndarray, shape (n,), mm
        How well the sides are known.
    learned_from : ndarray of intp, shape (n, 3)
        The pairs of tracks that they were learned from; `NOBODY` for targets.
    """

    sides: Floats
    std: Floats
    learned_from: Ints

    def __len__(self) -> int:
        return len(self.sides)

    def __add__(self, other: Triangles) -> Triangles:
        return Triangles(
            np.concatenate([self.sides, other.sides]),
            np.concatenate([self.std, other.std]),
            np.concatenate([self.learned_from, other.learned_from]),
        )


def triangles_of_targets(targets: Sequence[BodyTarget]) -> Triangles:
    """Return the triangles of all targets."""
    found = _no_triangles()
    for target in targets:
        table = table_of_target(target)
        corners = np.array(list(combinations(range(len(table.points)), 3)), dtype=np.intp).reshape(-1, 3)
        nobody = np.full(corners.shape, NOBODY)
        found += _from_every_ball(corners, table.distances, np.sqrt(table.distance_variances), nobody)
    return found


def learned_triangles(candidates: Candidates, kept: Bools, pairs: Ints, scale: float = 1.0) -> Triangles:
    """Return triangles whose sides held over time.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are believed.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks of each candidate.
    scale : float
        Deviations of points by what their covariances say.
    """
    edges = rigid_edges(candidates, kept, pairs, scale, _learning_frames(len(candidates.per_frame)))
    names, ends = np.unique(edges.ends, return_inverse=True)
    mates: list[dict[int, int]] = [{} for _ in names]  # by pair of tracks: the edge to each mate
    for edge in np.argsort(edges.std, kind="stable").tolist():
        one, other = ends.reshape(-1, 2)[edge].tolist()
        if len(mates[one]) < MOST_MATES and len(mates[other]) < MOST_MATES:
            mates[one][other] = mates[other][one] = edge
    rows = [
        (names[one], names[other], names[third], mates[one][other], mates[one][third], mates[other][third])
        for one in range(len(names))
        for other, third in combinations(sorted(mates[one]), 2)
        if one < other and third in mates[other]
    ]
    if not rows:
        return _no_triangles()
    table = np.array(rows, dtype=np.intp)
    triples, sides = table[:, :3], table[:, 3:]
    return _by_ball(edges.lengths[sides], edges.std[sides].max(axis=1), triples)


def log_ratios(
    candidates: Candidates, kept: Bools, pairs: Ints, triangles: Triangles, asked: Bools, scale: float = 1.0
) -> Floats:
    """Return how much more the triangles of candidates speak for a marker than for chance, shape (n,), nats.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are believed: they are witnesses.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks of each candidate.
    triangles : Triangles
        What is rigid.
    asked : ndarray of bool, shape (n,)
        Of which candidates it is asked; 0 for all others.
    scale : float
        Deviations of points by what their covariances say.
    """
    ratios = np.zeros(len(asked))
    if not len(triangles):
        return ratios
    book = _Book(triangles, scale)
    for_right, for_wrong = _told_by_triangles(candidates, kept, pairs, book, ~asked)
    if_hit, if_missed = np.log(for_right / for_wrong), np.log((1 - for_right) / (1 - for_wrong))
    for start, end in frames_of(
        candidates, np.bincount(candidates.frames[asked], minlength=len(candidates.per_frame)) > 0
    ):
        here = np.arange(start, end)
        wanted, witnesses = here[asked[start:end]], here[kept[start:end]]
        hits = book.hits(Seen.of(candidates, wanted, pairs), Seen.of(candidates, witnesses, pairs))
        ratios[wanted] = np.where(hits, if_hit, if_missed)
    return ratios


def evidence_of_rigidity(ratios: Floats, asked: Bools, pairs: Ints, n_pairs: int, step: float) -> Floats:
    """Return what triangles say of each pair of tracks, shape (n_pairs,), nats.

    Parameters
    ----------
    ratios : ndarray, shape (n,), nats
        See `log_ratios`.
    asked : ndarray of bool, shape (n,)
        Of which candidates it was asked.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks of each candidate.
    n_pairs : int
        Number of pairs of tracks.
    step : float, s
        Time between frames: candidates of neighbouring frames say the same.
    """
    counts = np.bincount(pairs[asked], minlength=n_pairs)
    sums = np.bincount(pairs[asked], ratios[asked], n_pairs)
    return np.asarray(sums / np.maximum(counts, 1) * independent(counts, step))


def independent(counts: Ints, step: float) -> Floats:
    """Return as how many independent candidates those of so many neighbouring frames count; at least as one.

    Parameters
    ----------
    counts : ndarray of intp
        Numbers of frames.
    step : float, s
        Time between frames.
    """
    return np.asarray(np.maximum(counts * step / INDEPENDENT, 1.0))


def _no_triangles() -> Triangles:
    return Triangles(np.empty((0, 3)), np.empty(0), np.empty((0, 3), dtype=np.intp))


def _from_every_ball(corners: Ints, edges: Floats, std: Floats, learned_from: Ints) -> Triangles:
    one, other, third = corners.T
    at = ((one, other), (one, third), (other, third))
    sides = np.stack([edges[pair] for pair in at], axis=1)
    return _by_ball(sides, np.max([std[pair] for pair in at], axis=0, initial=0.0), learned_from)


def _by_ball(sides: Floats, std: Floats, learned_from: Ints) -> Triangles:
    """Triangles of the sides 01, 02, 12, as each of the three balls sees them."""
    views = []
    for first, second, opposite in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
        own = np.sort(sides[:, [first, second]], axis=1)
        views.append(np.column_stack([own, sides[:, opposite]]))
    return Triangles(np.concatenate(views), np.tile(std, 3), np.tile(learned_from, (3, 1)))


class _Book:
    """Triangles to look candidates up in."""

    def __init__(self, triangles: Triangles, scale: float) -> None:
        self._triangles, self._scale = triangles, scale
        self._tree = cKDTree(triangles.sides)
        self._lengths = np.sort(triangles.sides[:, :2], axis=None)
        self._std = float(np.median(triangles.std))

    def hits(self, asked: Seen, witnesses: Seen) -> Bools:
        """Whether each candidate makes a known triangle with two witnesses, shape (n,)."""
        found = np.zeros(len(asked.points), dtype=np.bool_)
        lengths, std = self._measured(asked, witnesses)
        between, their_std = self._measured(witnesses, witnesses)
        near = self._is_known(lengths, std)
        queries, radii, whose = [], [], []
        for candidate in np.flatnonzero(near.sum(axis=1) >= 2):
            mates = np.flatnonzero(near[candidate])
            one, other = mates[np.stack(np.triu_indices(len(mates), 1))]
            kept = np.isfinite(between[one, other])
            one, other = one[kept], other[kept]
            own = np.sort(np.stack([lengths[candidate, one], lengths[candidate, other]], axis=1), axis=1)
            queries.append(np.column_stack([own, between[one, other]]))
            radii.append(np.max([std[candidate, one], std[candidate, other], their_std[one, other]], axis=0))
            whose.append(np.full(len(one), candidate))
        if queries:
            self._look_up(np.concatenate(queries), np.concatenate(radii), np.concatenate(whose), asked.pairs, found)
        return found

    def _look_up(self, queries: Floats, std: Floats, whose: Ints, pairs: Ints, found: Bools) -> None:
        """Mark those whose triangle is known, and was not learned from themselves."""
        rows = self._tree.query_ball_point(queries, GATE * std, p=np.inf)
        lengths = np.array([len(row) for row in rows], dtype=np.intp)
        if lengths.sum():
            known, candidate = np.concatenate([row for row in rows if row]).astype(np.intp), np.repeat(whose, lengths)
            is_other = (self._triangles.learned_from[known] != pairs[candidate, np.newaxis]).all(axis=1)
            found[candidate[is_other]] = True

    def _measured(self, seen: Seen, others: Seen) -> tuple[Floats, Floats]:
        lengths, variances = seen.spans(others)
        return lengths, np.sqrt(self._scale**2 * variances + self._std**2)

    def _is_known(self, lengths: Floats, std: Floats) -> Bools:
        """Whether some triangle has such a side."""
        low = np.searchsorted(self._lengths, lengths - GATE * std)
        return np.asarray(np.isfinite(lengths) & (low < np.searchsorted(self._lengths, lengths + GATE * std)))


def _told_by_triangles(
    candidates: Candidates, kept: Bools, pairs: Ints, book: _Book, sure: Bools
) -> tuple[float, float]:
    """Parts of right and of wrong candidates that make triangles; Laplace's rule of succession."""
    is_wanted = np.zeros(len(candidates.per_frame), dtype=np.bool_)
    is_wanted[np.linspace(0, len(is_wanted) - 1, CHECKED_FRAMES).astype(np.intp)] = True
    hits, n = np.ones(2), 2.0
    for start, end in frames_of(candidates, is_wanted):
        witnesses = np.flatnonzero(kept[start:end]) + start
        right = witnesses[sure[witnesses]]
        if len(right) < 2:
            continue
        seen, others = Seen.of(candidates, right, pairs), Seen.of(candidates, witnesses, pairs)
        places = seen.points * (np.roll(seen.points[:, 2:], 1, axis=0) / seen.points[:, 2:])
        displaced = Seen(places, seen.covariance, seen.left, seen.right, seen.pairs)
        hits += book.hits(seen, others).sum(), book.hits(displaced, others).sum()
        n += len(right)
    return float(hits[0] / n), float(hits[1] / n)


def _learning_frames(n_frames: int) -> Bools:
    is_wanted = np.ones(n_frames, dtype=np.bool_)
    if n_frames > LEARNING_SPANS * SPAN_FRAMES:
        starts = np.linspace(0, n_frames - SPAN_FRAMES, LEARNING_SPANS).astype(np.intp)
        is_wanted[:] = False
        is_wanted[starts[:, np.newaxis] + np.arange(SPAN_FRAMES)] = True
    return is_wanted


GATE = 3.0
"""Standard deviations within which two distances are the same."""

LEAST_SEEN = 6
"""Frames in which two pairs of tracks are seen together before their distance is known to hold."""

SPAN_FRAMES = 200
"""Frames that are summed at once."""


@dataclass(frozen=True, eq=False)
class RigidEdges:
    """Distances that held over time.

    Attributes
    ----------
    ends : ndarray of intp, shape (n, 2)
        Names of what they are between, the smaller first.
    lengths, std : ndarray, shape (n,), mm
        The distances, and how well they are known.
    """

    ends: Ints
    lengths: Floats
    std: Floats


def rigid_edges(
    candidates: Candidates, kept: Bools, names: Ints, scale: float = 1.0, wanted: Bools | None = None
) -> RigidEdges:
    """Return the distances that changed no more than noise explains.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are believed.
    names : ndarray of intp, shape (n,)
        What each candidate is: its pair of tracks, or its marker.
    scale : float
        Deviations of points by what their covariances say.
    wanted : ndarray of bool, shape (n_frames,), optional
        In which frames to look; by default in all of them.
    """
    frames = list(
        frames_of(candidates, np.ones(len(candidates.per_frame), dtype=np.bool_) if wanted is None else wanted)
    )
    sums = np.empty((0, 6))
    for first in range(0, len(frames), SPAN_FRAMES):  # distances of a long recording would not fit into memory
        block = _spans_of(candidates, kept, names, frames[first : first + SPAN_FRAMES])
        sums = _summed(np.concatenate([sums, block]))
    keys, counts, weights, firsts, seconds, variances = sums[sums[:, 1] >= LEAST_SEEN].T
    mean = firsts / weights
    misfit = np.maximum(seconds - firsts * mean, 0.0) / scale**2
    expected = counts - 1  # chi-square: its mean, and half its variance
    is_rigid = misfit <= expected + GATE * np.sqrt(2 * expected)
    std = scale * np.sqrt(variances / counts * np.maximum(misfit / expected, 1.0) / counts)
    ends = np.stack(np.divmod(keys.astype(np.int64), int(names.max(initial=-1)) + 1), axis=1).astype(np.intp)
    return RigidEdges(ends[is_rigid], mean[is_rigid], std[is_rigid])


@dataclass(frozen=True, eq=False)
class Seen:
    """Candidates of one frame."""

    points: Floats
    covariance: Floats
    left: Ints
    right: Ints
    pairs: Ints

    @classmethod
    def of(cls, candidates: Candidates, indices: Ints, pairs: Ints) -> Seen:
        """Return some of all candidates, and the pair of tracks or marker that each is."""
        return cls(
            candidates.points[indices],
            candidates.covariance(indices),
            candidates.left[indices].astype(np.intp),
            candidates.right[indices].astype(np.intp),
            pairs[indices],
        )

    def spans(self, other: Seen) -> tuple[Floats, Floats]:
        """Distances [mm] to others, shape (n, n_others), and their variances; infinite where both would be one ball."""
        between = self.points[:, np.newaxis] - other.points
        lengths = np.linalg.norm(between, axis=2)
        along = between / np.where(lengths > 0, lengths, 1.0)[..., np.newaxis]
        own = np.einsum("abi,aij,abj->ab", along, self.covariance, along)
        theirs = np.einsum("abi,bij,abj->ab", along, other.covariance, along)
        shared = (self.left[:, np.newaxis] == other.left) | (self.right[:, np.newaxis] == other.right)
        return np.where(shared | (lengths == 0), np.inf, lengths), own + theirs


def frames_of(candidates: Candidates, wanted: Bools) -> Iterator[tuple[int, int]]:
    """First candidate and the one after the last of each wanted frame that has any."""
    ends = np.cumsum(candidates.per_frame)
    for frame in np.flatnonzero(wanted & (candidates.per_frame > 0)).tolist():
        yield int(ends[frame] - candidates.per_frame[frame]), int(ends[frame])


def _spans_of(candidates: Candidates, kept: Bools, names: Ints, frames: Sequence[tuple[int, int]]) -> Floats:
    """What each two names' distances in some frames add up to.

    Returns
    -------
    ndarray, shape (n, 6)
        Key of the two names; number of distances; sums of their weights, of weighted distances and squares, of
        variances.
    """
    n_names = int(names.max(initial=-1)) + 1
    rows = [np.empty((0, 3))]
    for start, end in frames:
        here = np.flatnonzero(kept[start:end]) + start
        seen = Seen.of(candidates, here, names)
        distances, variances = seen.spans(seen)
        one, other = np.nonzero(np.isfinite(distances) & (seen.pairs[:, np.newaxis] < seen.pairs))
        key = (seen.pairs[one] * n_names + seen.pairs[other]).astype(np.float64)
        rows.append(np.column_stack([key, distances[one, other], variances[one, other]]))
    keys, lengths, variances = np.concatenate(rows).T
    weights = 1 / variances
    ones = np.ones(len(keys))
    return _summed(np.column_stack([keys, ones, weights, weights * lengths, weights * lengths**2, variances]))


def _summed(rows: Floats) -> Floats:
    """Rows of one key added."""
    keys, of_row = np.unique(rows[:, 0], return_inverse=True)
    return np.column_stack([keys, *(np.bincount(of_row, column, len(keys)) for column in rows[:, 1:].T)])
