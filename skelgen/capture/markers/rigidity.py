"""Evidence of rigid bodies for pairs of balls: triangles of known targets, and distances that stay constant over time.

Three balls on one rigid body keep their triangle wherever they go. The triangles of the settings' targets are known.
Others are learned from three accepted pairs of tracks whose distances change no more than noise explains. A triangle
has no names, so that it is evidence for balls whose tracks were lost since, too. A candidate that makes a known
triangle with two others is probably a marker. How probably is counted in the recording itself: how often candidates
that are surely right make triangles, and how often the same do at wrong depths.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.spatial import cKDTree

from skelgen.capture.bodies import table_of_target
from skelgen.capture.markers.candidates import Candidates, FrameCandidates, frames_of
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import BodyTarget

MAX_NEIGHBOURS = 8
"""Rigid neighbours of a pair of tracks of which triangles are made, the steadiest first."""

LEARNING_SPANS = 10
"""Blocks of `SPAN_FRAMES` frames, spread over longer recordings, in which distances are learned."""

INDEPENDENT = 0.25
"""Time [s] after which candidates of the same tracks count as independent: by then bodies have moved."""

CHECKED_FRAMES = 300
"""Frames in which it is counted how often right and wrong candidates make triangles."""

NO_PAIR = -1
"""Stands for the pair of tracks of a triangle that is known of a target."""
GATE = 3.0
"""Standard deviations within which two distances are the same."""

MIN_FRAMES = 6
"""Frames in which two pairs of tracks must be seen together before their distance can count as constant."""

SPAN_FRAMES = 200
"""Frames that are summed at once."""


@dataclass(frozen=True, eq=False)
class Triangles:
    """Rigid triangles, each three times: once for each of its balls.

    Attributes
    ----------
    sides : ndarray, shape (n, 3), mm
        From the ball to the nearer one of the others, to the farther one, and between these.
    std : ndarray, shape (n,), mm
        Standard deviation of the sides.
    learned_from : ndarray of intp, shape (n, 3)
        The pairs of tracks that they were learned from; `NO_PAIR` for targets.
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
        no_pair = np.full(corners.shape, NO_PAIR)
        at, std = (corners[:, [0, 0, 1]], corners[:, [1, 2, 2]]), np.sqrt(table.distance_variances)
        found += _by_ball(table.distances[at], std[at].max(axis=1, initial=0.0), no_pair)
    return found


def learned_triangles(candidates: Candidates, kept: Bools, pairs: Ints, scale: float = 1.0) -> Triangles:
    """Return triangles whose sides stay constant over time.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are accepted.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks of each candidate.
    scale : float
        Noise of the recording as a part of the stated one; see `noise_scale`.
    """
    edges = rigid_edges(candidates, kept, pairs, scale, _learning_frames(len(candidates.per_frame)))
    names, ends = np.unique(edges.ends, return_inverse=True)
    neighbours: list[dict[int, int]] = [{} for _ in names]  # by pair of tracks: the edge to each neighbour
    for edge in np.argsort(edges.std, kind="stable").tolist():
        one, other = ends.reshape(-1, 2)[edge].tolist()
        if len(neighbours[one]) < MAX_NEIGHBOURS and len(neighbours[other]) < MAX_NEIGHBOURS:
            neighbours[one][other] = neighbours[other][one] = edge
    rows = [
        (*names[[one, other, third]], neighbours[one][other], neighbours[one][third], neighbours[other][third])
        for one in range(len(names))
        for other, third in combinations(sorted(neighbours[one]), 2)
        if one < other and third in neighbours[other]
    ]
    if not rows:
        return _no_triangles()
    table = np.array(rows, dtype=np.intp)
    triples, sides = table[:, :3], table[:, 3:]
    return _by_ball(edges.lengths[sides], edges.std[sides].max(axis=1), triples)


def log_ratios(
    candidates: Candidates, kept: Bools, pairs: Ints, triangles: Triangles, queried: Bools, scale: float = 1.0
) -> Floats:
    """Return the log likelihood ratio of a marker against chance by the triangles of candidates, shape (n,), nats.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are accepted: triangles are made with these.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks of each candidate.
    triangles : Triangles
        The known ones.
    queried : ndarray of bool, shape (n,)
        Candidates whose ratio is wanted; it is 0 for all others.
    scale : float
        Noise of the recording as a part of the stated one; see `noise_scale`.
    """
    ratios = np.zeros(len(queried))
    if not len(triangles):
        return ratios
    index = _TriangleIndex(triangles, scale)
    for_right, for_wrong = _triangle_rates(candidates, kept, pairs, index, ~queried)
    if_hit, if_missed = np.log(for_right / for_wrong), np.log((1 - for_right) / (1 - for_wrong))
    n_queried = np.bincount(candidates.frames[queried], minlength=len(candidates.per_frame))
    for start, end in frames_of(candidates, n_queried > 0):
        here = np.arange(start, end)
        wanted, witnesses = here[queried[start:end]], here[kept[start:end]]
        seen, others = (FrameCandidates.of(candidates, indices, pairs) for indices in (wanted, witnesses))
        hits = index.make_known_triangles(seen, others)
        ratios[wanted] = np.where(hits, if_hit, if_missed)
    return ratios


def evidence_of_rigidity(ratios: Floats, queried: Bools, pairs: Ints, n_pairs: int, step: float) -> Floats:
    """Return the evidence of triangles for each pair of tracks, shape (n_pairs,), nats.

    Parameters
    ----------
    ratios : ndarray, shape (n,), nats
        See `log_ratios`.
    queried : ndarray of bool, shape (n,)
        Candidates with a ratio.
    pairs : ndarray of intp, shape (n,)
        The pair of tracks of each candidate.
    n_pairs : int
        Number of pairs of tracks.
    step : float, s
        Time between frames: neighbouring frames give the same evidence.
    """
    counts = np.bincount(pairs[queried], minlength=n_pairs)
    sums = np.bincount(pairs[queried], ratios[queried], n_pairs)
    return np.asarray(sums / np.maximum(counts, 1) * n_independent(counts, step))


def n_independent(counts: Ints, step: float) -> Floats:
    """Return how many independent candidates a number of neighbouring frames is worth, at least one.

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


def _by_ball(sides: Floats, std: Floats, learned_from: Ints) -> Triangles:
    """Triangles of the sides 01, 02, 12, as each of the three balls sees them."""
    views = []
    for first, second, opposite in ((0, 1, 2), (0, 2, 1), (1, 2, 0)):
        own = np.sort(sides[:, [first, second]], axis=1)
        views.append(np.column_stack([own, sides[:, opposite]]))
    return Triangles(np.concatenate(views), np.tile(std, 3), np.tile(learned_from, (3, 1)))


class _TriangleIndex:
    """Known triangles by their sides, to look candidates up in."""

    def __init__(self, triangles: Triangles, scale: float) -> None:
        self._triangles, self._scale = triangles, scale
        self._tree = cKDTree(triangles.sides)
        self._lengths = np.sort(triangles.sides[:, :2], axis=None)
        self._std = float(np.median(triangles.std))

    def make_known_triangles(self, queried: FrameCandidates, witnesses: FrameCandidates) -> Bools:
        """Return whether each candidate makes a known triangle with two others, shape (n,)."""
        found = np.zeros(len(queried.points), dtype=np.bool_)
        lengths, std = self._measured(queried, witnesses)
        between, their_std = self._measured(witnesses, witnesses)
        low, high = (np.searchsorted(self._lengths, lengths + part * GATE * std) for part in (-1, 1))
        near = np.isfinite(lengths) & (low < high)  # some triangle has such a side
        queries, radii, whose = [], [], []
        for candidate in np.flatnonzero(near.sum(axis=1) >= 2):
            neighbours = np.flatnonzero(near[candidate])
            one, other = neighbours[np.stack(np.triu_indices(len(neighbours), 1))]
            kept = np.isfinite(between[one, other])
            one, other = one[kept], other[kept]
            own = np.sort(np.stack([lengths[candidate, one], lengths[candidate, other]], axis=1), axis=1)
            queries.append(np.column_stack([own, between[one, other]]))
            radii.append(np.max([std[candidate, one], std[candidate, other], their_std[one, other]], axis=0))
            whose.append(np.full(len(one), candidate))
        if queries:
            self._look_up(np.concatenate(queries), np.concatenate(radii), np.concatenate(whose), queried.pairs, found)
        return found

    def _look_up(self, queries: Floats, std: Floats, whose: Ints, pairs: Ints, found: Bools) -> None:
        """Mark candidates whose triangle is known and was not learned from themselves."""
        rows = self._tree.query_ball_point(queries, GATE * std, p=np.inf)
        lengths = np.array([len(row) for row in rows], dtype=np.intp)
        if lengths.sum():
            known, candidate = np.concatenate([row for row in rows if row]).astype(np.intp), np.repeat(whose, lengths)
            is_other = (self._triangles.learned_from[known] != pairs[candidate, np.newaxis]).all(axis=1)
            found[candidate[is_other]] = True

    def _measured(self, seen: FrameCandidates, others: FrameCandidates) -> tuple[Floats, Floats]:
        lengths, variances = seen.distances_to(others)
        return lengths, np.sqrt(self._scale**2 * variances + self._std**2)


def _triangle_rates(
    candidates: Candidates, kept: Bools, pairs: Ints, index: _TriangleIndex, sure: Bools
) -> tuple[float, float]:
    """Parts of right and of wrong candidates that make known triangles, by Laplace's rule of succession."""
    is_wanted = np.zeros(len(candidates.per_frame), dtype=np.bool_)
    is_wanted[np.linspace(0, len(is_wanted) - 1, CHECKED_FRAMES).astype(np.intp)] = True
    hits, n = np.ones(2), 2.0
    for start, end in frames_of(candidates, is_wanted):
        witnesses = np.flatnonzero(kept[start:end]) + start
        right = witnesses[sure[witnesses]]
        if len(right) < 2:
            continue
        seen, others = FrameCandidates.of(candidates, right, pairs), FrameCandidates.of(candidates, witnesses, pairs)
        places = seen.points * (np.roll(seen.points[:, 2:], 1, axis=0) / seen.points[:, 2:])
        displaced = FrameCandidates(places, seen.covariance, seen.left, seen.right, seen.pairs)
        hits += index.make_known_triangles(seen, others).sum(), index.make_known_triangles(displaced, others).sum()
        n += len(right)
    return float(hits[0] / n), float(hits[1] / n)


def _learning_frames(n_frames: int) -> Bools:
    is_wanted = np.ones(n_frames, dtype=np.bool_)
    if n_frames > LEARNING_SPANS * SPAN_FRAMES:
        starts = np.linspace(0, n_frames - SPAN_FRAMES, LEARNING_SPANS).astype(np.intp)
        is_wanted[:] = False
        is_wanted[starts[:, np.newaxis] + np.arange(SPAN_FRAMES)] = True
    return is_wanted


@dataclass(frozen=True, eq=False)
class RigidEdges:
    """Distances that stay constant over time.

    Attributes
    ----------
    ends : ndarray of intp, shape (n, 2)
        Names of their two ends, the smaller first.
    lengths, std : ndarray, shape (n,), mm
        The distances and their standard deviations.
    """

    ends: Ints
    lengths: Floats
    std: Floats


def rigid_edges(
    candidates: Candidates, kept: Bools, names: Ints, scale: float = 1.0, wanted: Bools | None = None
) -> RigidEdges:
    """Return the distances that change no more than noise explains.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    kept : ndarray of bool, shape (n,)
        Which of them are accepted.
    names : ndarray of intp, shape (n,)
        What each candidate is: its pair of tracks, or its marker.
    scale : float
        Noise of the recording as a part of the stated one; see `noise_scale`.
    wanted : ndarray of bool, shape (n_frames,), optional
        In which frames to look; by default in all of them.
    """
    everywhere = np.ones(len(candidates.per_frame), dtype=np.bool_)
    frames = list(frames_of(candidates, everywhere if wanted is None else wanted))
    sums = np.empty((0, 6))
    for first in range(0, len(frames), SPAN_FRAMES):  # distances of a long recording would not fit into memory
        block = _spans_of(candidates, kept, names, frames[first : first + SPAN_FRAMES])
        sums = _summed(np.concatenate([sums, block]))
    keys, counts, weights, firsts, seconds, variances = sums[sums[:, 1] >= MIN_FRAMES].T
    mean = firsts / weights
    misfit = np.maximum(seconds - firsts * mean, 0.0) / scale**2
    expected = counts - 1  # chi-square: its mean, and half its variance
    is_rigid = misfit <= expected + GATE * np.sqrt(2 * expected)
    std = scale * np.sqrt(variances / counts * np.maximum(misfit / expected, 1.0) / counts)
    ends = np.stack(np.divmod(keys.astype(np.int64), int(names.max(initial=-1)) + 1), axis=1).astype(np.intp)
    return RigidEdges(ends[is_rigid], mean[is_rigid], std[is_rigid])


def _spans_of(candidates: Candidates, kept: Bools, names: Ints, frames: Sequence[tuple[int, int]]) -> Floats:
    """Sum up the distances between each two named balls over some frames.

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
        seen = FrameCandidates.of(candidates, here, names)
        distances, variances = seen.distances_to(seen)
        one, other = np.nonzero(np.isfinite(distances) & (seen.pairs[:, np.newaxis] < seen.pairs))
        key = (seen.pairs[one] * n_names + seen.pairs[other]).astype(np.float64)
        rows.append(np.column_stack([key, distances[one, other], variances[one, other]]))
    keys, lengths, variances = np.concatenate(rows).T
    weights = 1 / variances
    ones = np.ones(len(keys))
    return _summed(np.column_stack([keys, ones, weights, weights * lengths, weights * lengths**2, variances]))


def _summed(rows: Floats) -> Floats:
    """Sums of the rows with equal keys."""
    keys, of_row = np.unique(rows[:, 0], return_inverse=True)
    return np.column_stack([keys, *(np.bincount(of_row, column, len(keys)) for column in rows[:, 1:].T)])
