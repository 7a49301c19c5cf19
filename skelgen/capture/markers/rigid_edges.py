"""Distances between balls that held over time: they changed no more than the noise of the points explains."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from skelgen.capture.markers.candidates import Candidates
from skelgen.model.arrays import Bools, Floats, Ints

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
