"""What distances say of a marker's identity in each frame, and what all frames say together, in NumPy.

`compiled_weighing` does the same in compiled loops; this is its meaning.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from skelgen.model.arrays import Bools, Floats, Ints

FREEDOMS = 4.0
"""Degrees of freedom of the law of distances, Student's t: heavier tails than normal, as skin has them."""

PEAK = math.gamma((FREEDOMS + 1) / 2) / math.gamma(FREEDOMS / 2) / math.sqrt(FREEDOMS * math.pi)
"""Its density at zero."""

FOUL_PART = 0.02
"""Part of the distances that say nothing, because the mate itself is wrong."""

COORDINATES = 3
"""A point has three: distances to more mates repeat each other."""

MOST_NATS = 20.0
"""Evidence of one frame at most, either way."""

CHANGE = 1e-5
"""Probability per frame that a marker which is followed without a break changes between right and wrong."""

FOUND = 0.5
"""Probability that a wrong marker is right again after such a break."""

CHUNK_VALUES = 2_000_000
"""Distances weighed at once: 16 MB per array."""

Evidence = tuple[NDArray[np.float32], NDArray[np.int16], NDArray[np.int8]]
"""Nats for each marker's own place against its best rival, that rival (-1 = nowhere in particular), mates seen."""


def evidence_of(
    positions: Floats, distance: Floats, spread: Floats, mates: Ints, rivals: Ints, reach: float
) -> Evidence:
    """Weigh the distances of each frame, shape (n_frames, n_markers) each.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    distance, spread, mates, rivals, reach
        As in `skelgen.stages.labels.confidence.distance_statistics.Usual`.
    """
    n_frames, n_markers = positions.shape[:2]
    evidence = np.zeros((n_frames, n_markers), dtype=np.float32)
    rival = np.full((n_frames, n_markers), -1, dtype=np.int16)
    n_seen = np.zeros((n_frames, n_markers), dtype=np.int8)
    step = max(1, CHUNK_VALUES // max(1, n_markers * (rivals.shape[1] + 1) * max(1, mates.shape[1])))
    for start in range(0, n_frames, step):
        part = slice(start, start + step)
        gain, n_seen[part] = _gains(positions[part], distance, spread, mates, rivals, reach)
        best = gain.argmin(axis=2)
        named = np.concatenate([np.full((n_markers, 1), -1, dtype=np.intp), rivals], axis=1)
        rival[part] = named[np.arange(n_markers), best]
        least = np.take_along_axis(gain, best[..., np.newaxis], axis=2)[..., 0]
        evidence[part] = np.clip(least, -MOST_NATS, MOST_NATS)
    return evidence, rival, n_seen


def probabilities(
    evidence: NDArray[np.float32], share: float, seen: Bools, stated: Bools, breaks: Bools, right: float, lost: float
) -> Floats:
    """Probability that each marker is right, from all frames; NaN where unseen, shape (n_frames, n_markers).

    Parameters
    ----------
    evidence : ndarray of float32, shape (n_frames, n_markers), nats
        Of each frame.
    share : float
        Frames that count as one.
    seen : ndarray of bool, shape (n_frames, n_markers)
        When each marker is seen.
    stated : ndarray of bool, shape (n_frames, n_markers) or (0, 0)
        Frames in which a marker is certainly right; none.
    breaks : ndarray of bool, shape (n_frames, n_markers)
        Frames in which a marker is not simply followed from the frame before.
    right, lost : float
        Probabilities that a marker is right when it is first seen, and that another one is taken for it after a break.
    """
    odds = _Odds(evidence, seen, stated, share)
    total = np.full(seen.shape, np.nan)
    state = np.full(seen.shape[1], np.log(right / (1.0 - right)))
    for frame in range(len(seen)):
        if frame:
            lose, find = np.where(breaks[frame], lost, CHANGE), np.where(breaks[frame], FOUND, CHANGE)
            ratio = np.exp(state)
            state = np.log((ratio * (1.0 - lose) + find) / (ratio * lose + 1.0 - find))
        state = total[frame] = np.clip(state + odds[frame], -MOST_NATS, MOST_NATS)
    state = np.zeros(seen.shape[1])  # from now on: log likelihood ratio of what follows
    for frame in range(len(seen) - 1, -1, -1):
        total[frame] = 1.0 / (1.0 + np.exp(-np.clip(total[frame] + state, -MOST_NATS, MOST_NATS)))
        lose, find = np.where(breaks[frame], lost, CHANGE), np.where(breaks[frame], FOUND, CHANGE)
        ratio = np.exp(np.clip(state + odds[frame], -MOST_NATS, MOST_NATS))
        state = np.log((ratio * (1.0 - lose) + lose) / (ratio * find + 1.0 - find))
    total[~seen] = np.nan
    return total


class _Odds:
    """Log odds of each frame, from its evidence; made frame by frame, for a long take has many."""

    def __init__(self, evidence: NDArray[np.float32], seen: Bools, stated: Bools, share: float) -> None:
        self._evidence, self._seen, self._stated, self._share = evidence, seen, stated, np.float32(share)

    def __getitem__(self, frame: int) -> NDArray[np.float32]:
        odds = np.where(self._seen[frame], self._evidence[frame] / self._share, np.float32(0.0))
        if len(self._stated):
            odds[self._stated[frame]] = MOST_NATS
        return odds


def _gains(
    positions: Floats, distance: Floats, spread: Floats, mates: Ints, rivals: Ints, reach: float
) -> tuple[Floats, Ints]:
    """Nats for each own place against nowhere and each rival, (n_frames, n_markers, 1 + n_rivals), and mates seen."""
    lengths = np.linalg.norm(positions[:, mates] - positions[:, :, np.newaxis], axis=3)
    lengths[:, mates < 0] = np.nan
    known = ~np.isnan(lengths)
    rows = np.arange(len(mates))[:, np.newaxis]
    own = _log_density(lengths, distance[rows, mates], spread[rows, mates], reach)
    gain = np.empty((*positions.shape[:2], rivals.shape[1] + 1))
    gain[..., 0] = _total(np.where(known, own + np.log(reach), 0.0), known)
    for slot in range(rivals.shape[1]):
        other = rivals[:, [slot]]
        theirs = _log_density(lengths, distance[other, mates], spread[other, mates], reach)
        told = known & (mates != other) & (other >= 0)
        gain[..., slot + 1] = _total(np.where(told, own - theirs, 0.0), told)
        gain[..., slot + 1][:, rivals[:, slot] < 0] = np.inf
    gain[..., 1:] = _with_return(gain[..., 1:], rivals, ~np.isnan(positions[..., 0]))
    return gain, known.sum(axis=2)


def _log_density(lengths: Floats, middle: Floats, spread: Floats, reach: float) -> Floats:
    """Log density of distances [1/mm] about what is usual; a few say nothing; what is unknown may be anything."""
    off = (lengths - middle) / spread
    fair = PEAK / spread * (1.0 + off * off / FREEDOMS) ** (-(FREEDOMS + 1) / 2)
    density = np.log((1.0 - FOUL_PART) * fair + FOUL_PART / reach)
    return np.asarray(np.where(np.isnan(density), -np.log(reach), density))


def _total(gains: Floats, told: Bools) -> Floats:
    """Sum over mates, as if no more than three had spoken."""
    count = told.sum(axis=2)
    return np.asarray(gains.sum(axis=2) * np.minimum(1.0, COORDINATES / np.maximum(count, 1)))


def _with_return(gain: Floats, rivals: Ints, seen: Bools) -> Floats:
    """Add, where the rival is seen too, what it would gain or lose by taking the marker's place in return."""
    result = gain.copy()
    for slot in range(rivals.shape[1]):
        other = np.maximum(rivals[:, slot], 0)
        back = rivals[other] == np.arange(len(rivals))[:, np.newaxis]
        mutual = back.any(axis=1) & (rivals[:, slot] >= 0)
        returned = gain[:, other, back.argmax(axis=1)]
        result[..., slot] += np.where(mutual & seen[:, other], returned, 0.0)
    return result
