"""How far apart two Marker Sets are at best, once the poses in which they are seen are aligned.

The distance of sets i and j is the least |m_i,a - A m_j,b| over frames a of i and b of j, where A brings the pose of
frame b onto that of frame a by the sets that both frames share (Kirk, O'Brien and Forsyth 2005; Schönauer 2007, 3.3).
The local alignment uses only the shared sets nearest to i, as an arm repeats its pose sooner than a whole body (5.2).

The minimum over many frames also finds poses that differ and in which the two sets meet by accident. The misfit of the
aligned poses, the root mean square distance between the sets that both frames share, is therefore added in squares:
``sqrt(|m_i,a - A m_j,b|^2 + weight misfit^2)``; with weight 0 it is the distance of the thesis.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from skelgen.geometry.orientation import rotation_by_svd
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.tracklets import TrackletPoints
from skelgen.progress import SILENT, Monitor

LEAST_SHARED = 3
"""Points that a rotation needs."""

LEAST_FLATNESS = 0.01
"""Share of the shared points' scatter that lies across its first axis: points on a line do not fix a rotation."""

DEFAULT_SAMPLING = 10
"""Interval of the compared frames, where none is asked for."""

MOST_SAMPLES = 100
"""Frames that are compared with each other, where no interval is asked for: bounds the pairs to its square."""

REFINED_NEIGHBOURS = 4
"""Nearest sets whose distances are refined: only these matter for grouping."""

POINTS_PER_BATCH = 400_000
"""Points that are aligned at once, so that memory stays below some 100 MB."""

REFINED_FRAMES = 9
"""Frames that the refinement compares, from one sample before the best to one behind it."""


@dataclass(frozen=True)
class Alignment:
    """How poses are aligned before Marker Sets are compared.

    Attributes
    ----------
    n_neighbours : int or None
        Sets that are aligned at most, those nearest to the compared one; None aligns all.
    misfit_weight : float
        How much the misfit of the aligned poses counts.
    sampling : int, frames
        Interval of the frames that are compared; 0 takes a usual one, wider in long takes.
    """

    n_neighbours: int | None
    misfit_weight: float
    sampling: int

    def step(self, n_frames: int) -> int:
        """Return the interval of the frames that are compared first in a take of so many frames."""
        return self.sampling or max(DEFAULT_SAMPLING, -(-n_frames // MOST_SAMPLES))


class _Best(NamedTuple):
    """The least distance of each two sets [mm], shape (n_sets, n_sets), and the frames in which it was found."""

    distance: Floats
    frame_a: Ints
    frame_b: Ints


class _Pairs(NamedTuple):
    """Pairs of sets i and j, and the frames a and b in which they are compared, shape (n,) each."""

    i: Ints
    j: Ints
    frame_a: Ints
    frame_b: Ints


class _Motions(NamedTuple):
    """Rigid motions: rotations (n, 3, 3), shifts (n, 3) [mm], weighted squared misfits (n,) [mm^2]."""

    rotation: Floats
    shift: Floats
    misfit: Floats

    def taken(self, rows: Ints) -> _Motions:
        """The motions of some rows."""
        return _Motions(self.rotation[rows], self.shift[rows], self.misfit[rows])


def find_distances(
    points: Floats, sets: TrackletPoints, overlaps: Bools, alignment: Alignment, monitor: Monitor = SILENT
) -> Floats:
    """Find the distance between each two Marker Sets.

    Parameters
    ----------
    points : ndarray, shape (n_points, 3), mm
        The cloud's points.
    sets : TrackletPoints
        What to compare.
    overlaps : ndarray of bool, shape (n_sets, n_sets)
        Sets that cannot be the same marker, and need not be compared.
    alignment : Alignment
        How poses are aligned.
    monitor : Monitor
        Receives progress and may cancel.

    Returns
    -------
    ndarray, shape (n_sets, n_sets), mm
        Symmetric; infinite where two sets overlap in time, or share fewer than three others in every pair of frames;
        0 on the diagonal.
    """
    n_sets = len(sets)
    frame_a, frame_b = (np.zeros((n_sets, n_sets), dtype=np.intp) for _ in range(2))
    best = _Best(np.full((n_sets, n_sets), np.inf), frame_a, frame_b)
    if not overlaps.all():
        # Frames at the sampling interval, and the middle of each set between them
        regular = np.arange(0, sets.n_frames, alignment.step(sets.n_frames))
        found = (sets.indices_at(regular) >= 0).any(axis=0)
        middles = sets.frames[(sets.starts[:-1] + sets.starts[1:]) // 2]
        frames = np.unique(np.concatenate([regular, middles[~found]]))
        poses = sets.positions_at(points, frames)
        for a in range(len(frames)):
            _compare_with_all(poses, frames, a, ~overlaps, alignment, best)
            monitor.advance(a + 1, len(frames))
        _refine(points, sets, alignment, best)
    distance = np.minimum(best.distance, best.distance.T)
    np.fill_diagonal(distance, 0.0)
    return distance


def _compare_with_all(poses: Floats, frames: Ints, a: int, allowed: Bools, alignment: Alignment, best: _Best) -> None:
    """Compare the sets seen in sample a with those seen in any other sample."""
    seen = ~np.isnan(poses[..., 0])
    present = np.flatnonzero(seen[a])
    come = seen & ~seen[a]
    b, i = np.nonzero(seen[a] & ~seen & come.any(axis=1)[:, np.newaxis])
    for batch in _batches(len(b), len(present)):
        some_b, some_i = b[batch], i[batch]
        row, j = np.nonzero(come[some_b] & allowed[some_i])
        source = poses[some_b[:, np.newaxis], present]
        motions = _align(source, poses[np.newaxis, a, present], poses[a, some_i], alignment)
        distance = _distance(motions.taken(row), poses[some_b[row], j], poses[a, some_i[row]])
        _improve(best, _Pairs(some_i[row], j, np.full(len(j), frames[a]), frames[some_b[row]]), distance)


def _refine(points: Floats, sets: TrackletPoints, alignment: Alignment, best: _Best) -> None:
    """Look around the best samples of the nearest sets: first at the frames next to a, then at those next to b."""
    nearest = np.argsort(best.distance, axis=1, kind="stable")[:, :REFINED_NEIGHBOURS]
    i = np.repeat(np.arange(len(sets)), nearest.shape[1])
    j = nearest.ravel()
    known = np.isfinite(best.distance[i, j])
    i, j = i[known], j[known]
    around = alignment.sampling or DEFAULT_SAMPLING
    offsets = np.unique(np.linspace(-around, around, REFINED_FRAMES).astype(np.intp))
    many_i, many_j = np.repeat(i, len(offsets)), np.repeat(j, len(offsets))
    move = np.tile(offsets, len(i))
    for move_a, move_b in ((move, 0), (0, move)):
        frame_a = np.clip(np.repeat(best.frame_a[i, j], len(offsets)) + move_a, 0, sets.n_frames - 1)
        frame_b = np.clip(np.repeat(best.frame_b[i, j], len(offsets)) + move_b, 0, sets.n_frames - 1)
        in_time = np.argsort(frame_a, kind="stable")
        for batch in _batches(len(in_time), len(sets)):
            some = in_time[batch]
            pairs = _Pairs(many_i[some], many_j[some], frame_a[some], frame_b[some])
            _improve(best, pairs, _compare_at(points, sets, pairs, alignment))


def _compare_at(points: Floats, sets: TrackletPoints, pairs: _Pairs, alignment: Alignment) -> Floats:
    """Distance of set i in frame a to set j in frame b, pair by pair; NaN where it is unknown."""
    frames, where = np.unique(np.concatenate([pairs.frame_a, pairs.frame_b]), return_inverse=True)
    poses = sets.positions_at(points, frames)
    a, b = np.split(where.ravel(), 2)
    present = np.flatnonzero(~np.isnan(poses[np.unique(a), :, 0]).all(axis=0))
    source, target = poses[b[:, np.newaxis], present], poses[a[:, np.newaxis], present]
    return _distance(_align(source, target, poses[a, pairs.i], alignment), poses[b, pairs.j], poses[a, pairs.i])


def _improve(best: _Best, pairs: _Pairs, distance: Floats) -> None:
    """Keep what is nearer than what was found before; NaN never is."""
    better = np.flatnonzero(distance < best.distance[pairs.i, pairs.j])
    better = better[np.argsort(-distance[better], kind="stable")]  # of doublets the last one stays: the least
    i, j = pairs.i[better], pairs.j[better]
    best.distance[i, j] = distance[better]
    best.frame_a[i, j] = pairs.frame_a[better]
    best.frame_b[i, j] = pairs.frame_b[better]


def _align(source: Floats, target: Floats, centre: Floats, alignment: Alignment) -> _Motions:
    """Find the motions that bring `source` onto `target` by the points next to `centre` that both have.

    `source` has shape (n, k, 3), `target` (n or 1, k, 3), with NaN where a set is unseen, and `centre` (n, 3), all in
    mm. Motions are NaN where fewer than three points off a line are shared.
    """
    away = np.linalg.norm(target - centre[:, np.newaxis], axis=2)
    away[np.isnan(away) | np.isnan(source[..., 0])] = np.inf
    count = min(alignment.n_neighbours or away.shape[1], away.shape[1])
    nearest = np.argpartition(away, count - 1, axis=1)[:, :count]
    shared = np.isfinite(np.take_along_axis(away, nearest, axis=1))
    n_shared = shared.sum(axis=1)
    target = np.broadcast_to(target, (len(nearest), *target.shape[1:]))
    source_centre, source = _centred(np.take_along_axis(source, nearest[..., np.newaxis], axis=1), shared)
    target_centre, target = _centred(np.take_along_axis(target, nearest[..., np.newaxis], axis=1), shared)
    rotation = rotation_by_svd(np.swapaxes(target, 1, 2) @ source)
    left = source @ np.swapaxes(rotation, 1, 2) - target
    misfit = alignment.misfit_weight * np.sum(left * left, axis=(1, 2)) / np.maximum(n_shared, 1)
    shift = target_centre - (rotation @ source_centre[..., np.newaxis])[..., 0]
    shift[(n_shared < LEAST_SHARED) | _on_a_line(source) | _on_a_line(target)] = np.nan
    return _Motions(rotation, shift, misfit)


def _distance(motions: _Motions, moving: Floats, fixed: Floats) -> Floats:
    """Distance [mm] of moved points, shape (n, 3), to fixed ones, the misfit of the poses included."""
    apart = (motions.rotation @ moving[..., np.newaxis])[..., 0] + motions.shift - fixed
    return np.asarray(np.sqrt(np.sum(apart * apart, axis=1) + motions.misfit))


def _centred(points: Floats, shared: Bools) -> tuple[Floats, Floats]:
    """Centres of the shared points and all points relative to them; 0 where not shared."""
    points = np.where(shared[..., np.newaxis], points, 0.0)
    centre = points.sum(axis=1) / np.maximum(shared.sum(axis=1), 1)[:, np.newaxis]
    return centre, np.where(shared[..., np.newaxis], points - centre[:, np.newaxis], 0.0)


def _on_a_line(centred: Floats) -> Bools:
    """Whether centred points, shape (n, k, 3), hardly leave a line: their scatter's second axis against the first.

    With eigenvalues l1 >= l2 >= l3 of the scatter, half of (trace^2 - trace of the square) is l1 l2 + l1 l3 + l2 l3.
    """
    scatter = np.swapaxes(centred, 1, 2) @ centred
    trace = np.trace(scatter, axis1=1, axis2=2)
    second = 0.5 * (trace**2 - np.sum(scatter**2, axis=(1, 2)))
    return np.asarray(second <= LEAST_FLATNESS * trace**2)


def _batches(n_rows: int, n_columns: int) -> Iterator[slice]:
    """Cut rows of so many points into batches of bounded size."""
    size = max(1, POINTS_PER_BATCH // max(n_columns, 1))
    return (slice(first, first + size) for first in range(0, n_rows, size))
