r"""How sure it is that each marker is the one that it is called: a probability per marker and frame.

Every marker has mates, the markers whose distances to it vary least, wherever they sit. In each frame the distances
:math:`d_j` to the mates that are seen are weighed: the likelihood of what they usually are against that of the best
rival, which is another marker's place, or nowhere in particular. Over time a marker is in one of two states, right or
wrong; it seldom changes while it is seen without a break, more easily over a gap. The probability of being right, given
the evidence of all frames, comes from the forward-backward recursion of that hidden Markov chain (Rabiner 1989).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.usual import TINY_SPREAD, Usual, look_alikes, usual_distances

FREEDOMS = 4.0
"""Degrees of freedom of the law of distances, Student's t: heavier tails than normal, as skin has them."""

FOUL_PART = 0.02
"""Part of the distances that say nothing, because the mate itself is wrong."""

COORDINATES = 3
"""A point has three: distances to more mates repeat each other."""

CORRELATED_SECONDS = 0.4
"""Evidence within this time repeats itself, as a pose lasts: together it counts as one frame's."""

MOST_NATS = 20.0
"""Evidence of one frame at most, either way."""

CHUNK_VALUES = 2_000_000
"""Distances weighed at once: 16 MB per array."""


PIECE_RIGHT = 0.1
"""Probability that a marker is one of its own although another one fits it and is never seen together with it."""

RARELY_SEEN = 0.2
"""Part of the frames below which a marker that was found is as often a piece of another one as one of its own."""

ALONE_RIGHT = 0.3
"""Probability of a marker whose distance to no other one is known."""

CHANGE = 1e-5
"""Probability per frame that a marker which is followed without a break changes between right and wrong."""

FOUND = 0.5
"""Probability that a wrong marker is right again after such a break."""

JUMP_DEVIATIONS = 20.0
"""A step that surprises by this many times what is usual is a break, where nothing else tells of tracks."""


class Prior(NamedTuple):
    """What is believed before distances speak.

    Attributes
    ----------
    right : float
        Probability that a marker is right when it is first seen.
    lost : float
        Probability that another marker is taken for one that was out of sight, or was followed anew.
    rare : float
        Probability that a marker which is seldom seen is one of its own; NaN: that is not doubted.
    """

    right: float
    lost: float
    rare: float


LABELS_FOUND = Prior(right=0.9, lost=0.1, rare=0.5)
"""Of takes that came as points."""

LABELS_GIVEN = Prior(right=0.97, lost=0.05, rare=np.nan)
"""Of takes that came with labels: somebody has looked at them."""


@dataclass(frozen=True, eq=False)
class Certainty:
    """What is known of identities in each frame.

    Attributes
    ----------
    confidence : ndarray, shape (n_frames, n_markers)
        Probability that the marker is the one that it is called; NaN where it is unseen.
    rival : ndarray of int16, shape (n_frames, n_markers)
        The marker whose place fits next best, -1 = nowhere in particular.
    n_mates : ndarray of int8, shape (n_frames, n_markers)
        Mates seen in the frame.
    evidence : ndarray of float32, shape (n_frames, n_markers), nats
        For the marker's own place against the best rival's, from the frame alone.
    original : ndarray of intp, shape (n_markers,)
        The marker that each one is probably a piece of: it lies where that belongs and is never seen together with it;
        -1 = none.
    alone : ndarray of bool, shape (n_markers,)
        Markers whose distance to no other one is known.
    rare : ndarray of bool, shape (n_markers,)
        Markers that are seen so seldom that they may be pieces of others although none fits.
    twins : tuple of (int, int)
        Pairs that no distance tells apart although they are seen together.
    """

    confidence: Floats
    rival: NDArray[np.int16]
    n_mates: NDArray[np.int8]
    evidence: NDArray[np.float32]
    original: Ints
    alone: Bools
    rare: Bools
    twins: tuple[tuple[int, int], ...]


def identity_confidence(
    trajectories: Trajectories,
    breaks: Bools | None = None,
    stated: Bools | None = None,
    prior: Prior = LABELS_GIVEN,
) -> Certainty:
    """Judge the identity of every marker in every frame.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers, however they were labelled.
    breaks : ndarray of bool, shape (n_frames, n_markers), optional
        Frames in which a marker is not simply followed from the frame before; by default after gaps and jumps.
    stated : ndarray of bool, shape (n_frames, n_markers), optional
        Frames in which the user says that the marker is the one that it is called.
    prior : Prior
        What is believed beforehand.
    """
    if breaks is None:
        breaks = jumps(trajectories)
    usual = usual_distances(trajectories)
    original, twins = look_alikes(usual, trajectories.seen)
    alone: Bools = np.asarray((usual.mates < 0).all(axis=1))
    rare: Bools = (trajectories.seen.mean(axis=0) < RARELY_SEEN) & (original < 0) & ~alone & ~np.isnan(prior.rare)
    if stated is not None:
        told = stated.any(axis=0)
        original[told], alone[told], rare[told] = -1, False, False
    usual = usual.without_pieces(original)
    evidence, rival, n_seen = _frame_by_frame(trajectories, usual)
    seen = trajectories.seen
    odds = _Odds(evidence, seen, stated, max(1.0, CORRELATED_SECONDS * trajectories.rate))
    confidence = _smoothed(odds, seen, breaks | _after_gaps(seen), prior)
    confidence[:, original >= 0] *= PIECE_RIGHT
    confidence[:, alone] *= ALONE_RIGHT
    confidence[:, rare] *= prior.rare
    confidence.flags.writeable = False
    return Certainty(confidence, rival, n_seen, evidence, original, alone, rare, twins)


def _frame_by_frame(
    trajectories: Trajectories, usual: Usual
) -> tuple[NDArray[np.float32], NDArray[np.int16], NDArray[np.int8]]:
    """What `_evidence` says of all frames, in portions that bound the memory, and in short numbers."""
    n_frames, n_markers = trajectories.n_frames, trajectories.n_markers
    evidence = np.zeros((n_frames, n_markers), dtype=np.float32)
    rival = np.full((n_frames, n_markers), -1, dtype=np.int16)
    n_seen = np.zeros((n_frames, n_markers), dtype=np.int8)
    step = max(1, CHUNK_VALUES // max(1, n_markers * (usual.rivals.shape[1] + 1) * max(1, usual.mates.shape[1])))
    for start in range(0, n_frames, step):
        part = slice(start, start + step)
        evidence[part], rival[part], n_seen[part] = _evidence(trajectories.positions[part], usual)
    return evidence, rival, n_seen


def _evidence(positions: Floats, usual: Usual) -> tuple[Floats, Ints, Ints]:
    """Nats for each marker's own place against its best rival, that rival, and the number of mates seen."""
    mates, rivals = usual.mates, usual.rivals
    there = mates >= 0
    lengths = np.linalg.norm(positions[:, mates] - positions[:, :, np.newaxis], axis=3)
    lengths[:, ~there] = np.nan
    known = ~np.isnan(lengths)
    rows = np.arange(len(mates))[:, np.newaxis]
    nowhere = -np.log(usual.reach)
    own = _log_density(lengths, usual.distance[rows, mates], usual.spread[rows, mates], nowhere)
    n_seen = known.sum(axis=2)
    gain = np.empty((*positions.shape[:2], rivals.shape[1] + 1))
    gain[..., 0] = _total(np.where(known, own - nowhere, 0.0), known)
    for slot in range(rivals.shape[1]):
        other = rivals[:, [slot]]
        theirs = _log_density(lengths, usual.distance[other, mates], usual.spread[other, mates], nowhere)
        told = known & (mates != other) & (other >= 0)
        gain[..., slot + 1] = _total(np.where(told, own - theirs, 0.0), told)
        gain[..., slot + 1][:, rivals[:, slot] < 0] = np.inf
    gain[..., 1:] = _with_return(gain[..., 1:], rivals, ~np.isnan(positions[..., 0]))
    best = gain.argmin(axis=2)
    named = np.concatenate([np.full((len(rivals), 1), -1, dtype=np.intp), rivals], axis=1)
    rival = named[np.arange(len(rivals)), best]
    evidence = np.take_along_axis(gain, best[..., np.newaxis], axis=2)[..., 0]
    return np.clip(evidence, -MOST_NATS, MOST_NATS), rival, n_seen


def _log_density(lengths: Floats, middle: Floats, spread: Floats, nowhere: float) -> Floats:
    """Log density of distances [1/mm] about what is usual; a few say nothing; what is unknown may be anything."""
    from scipy.special import gammaln  # noqa: PLC0415 - heavy

    top = gammaln((FREEDOMS + 1) / 2) - gammaln(FREEDOMS / 2) - 0.5 * np.log(FREEDOMS * np.pi)
    off = (lengths - middle) / spread
    fair = np.exp(top) / spread * (1.0 + off * off / FREEDOMS) ** (-(FREEDOMS + 1) / 2)
    density = np.log((1.0 - FOUL_PART) * fair + FOUL_PART * np.exp(nowhere))
    return np.asarray(np.where(np.isnan(density), nowhere, density))


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


def jumps(trajectories: Trajectories) -> Bools:
    """Frames in which a marker is far from where its last step would have brought it, shape (n_frames, n_markers)."""
    surprise = np.linalg.norm(np.diff(trajectories.positions, n=2, axis=0), axis=2)
    known = surprise[~np.isnan(surprise)]
    result = np.zeros(trajectories.seen.shape, dtype=np.bool_)
    if len(known):
        result[2:] = np.nan_to_num(surprise) > JUMP_DEVIATIONS * max(float(np.median(known)), TINY_SPREAD)
    return result


def _after_gaps(seen: Bools) -> Bools:
    result = np.zeros(seen.shape, dtype=np.bool_)
    result[1:] = seen[1:] & ~seen[:-1]
    return result


class _Odds:
    """Log odds of each frame, from its evidence; made frame by frame, for a long take has many."""

    def __init__(self, evidence: NDArray[np.float32], seen: Bools, stated: Bools | None, share: float) -> None:
        self._evidence, self._seen, self._stated, self._share = evidence, seen, stated, np.float32(share)

    def __getitem__(self, frame: int) -> NDArray[np.float32]:
        odds = np.where(self._seen[frame], self._evidence[frame] / self._share, np.float32(0.0))
        if self._stated is not None:
            odds[self._stated[frame]] = MOST_NATS
        return odds


def _smoothed(odds: _Odds, seen: Bools, breaks: Bools, prior: Prior) -> Floats:
    """Probability of being right from the log odds of all frames; NaN where unseen, shape (n_frames, n_markers)."""
    total = np.full(seen.shape, np.nan)
    state = np.full(seen.shape[1], np.log(prior.right / (1.0 - prior.right)))
    for frame in range(len(seen)):
        if frame:
            lose, find = np.where(breaks[frame], prior.lost, CHANGE), np.where(breaks[frame], FOUND, CHANGE)
            ratio = np.exp(state)
            state = np.log((ratio * (1.0 - lose) + find) / (ratio * lose + 1.0 - find))
        state = total[frame] = np.clip(state + odds[frame], -MOST_NATS, MOST_NATS)
    state = np.zeros(seen.shape[1])  # from now on: log likelihood ratio of what follows
    for frame in range(len(seen) - 1, -1, -1):
        total[frame] = 1.0 / (1.0 + np.exp(-np.clip(total[frame] + state, -MOST_NATS, MOST_NATS)))
        lose, find = np.where(breaks[frame], prior.lost, CHANGE), np.where(breaks[frame], FOUND, CHANGE)
        ratio = np.exp(np.clip(state + odds[frame], -MOST_NATS, MOST_NATS))
        state = np.log((ratio * (1.0 - lose) + lose) / (ratio * find + 1.0 - find))
    total[~seen] = np.nan
    return total
