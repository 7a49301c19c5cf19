r"""How sure it is that each marker is the one that it is called: a probability per marker and frame.

Every marker has mates, the markers whose distances to it vary least, wherever they sit. In each frame the distances
:math:`d_j` to the mates that are seen are weighed: the likelihood of what they usually are against that of the best
rival, which is another marker's place, or nowhere in particular. Over time a marker is in one of two states, right or
wrong; it seldom changes while it is seen without a break, more easily over a gap. The probability of being right, given
the evidence of all frames, comes from the forward-backward recursion of that hidden Markov chain (Rabiner 1989).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints

N_MATES = 6
"""Mates of each marker: a point has three coordinates, the others stand in for mates that are hidden."""

N_RIVALS = 4
"""Other markers whose places are tried: the most similar ones."""

SAMPLE_FRAMES = 300
"""Frames from which the usual distances are taken."""

MOST_SAMPLES = 20_000_000
"""Distances looked at for the usual ones: with very many markers fewer frames are sampled."""

LEAST_SAMPLES = 20
"""Frames that are sampled in any case."""

LEAST_COMMON = 8
"""Fewer common frames say nothing of a distance."""

LEAST_SPREAD = 1e-3
"""Of a distance: what even an exact take may vary."""

TINY_SPREAD = 1e-9
"""mm; keeps the law of distances finite for markers that coincide."""

FREEDOMS = 4.0
"""Degrees of freedom of the law of distances, Student's t: heavier tails than normal, as skin has them."""

FOUL_PART = 0.02
"""Part of the distances that say nothing, because the mate itself is wrong."""

COORDINATES = 3
"""A point has three: distances to more mates repeat each other."""

CORRELATED_SECONDS = 0.1
"""Evidence within this time repeats itself: together it counts as one frame's."""

MOST_NATS = 20.0
"""Evidence of one frame at most, either way."""

CHUNK_VALUES = 2_000_000
"""Distances weighed at once: 16 MB per array."""


TOLD_APART = 2.0
"""Standard deviations by which distances must differ, root mean square, for two markers to be told apart."""

TWINS_APART = 1.0

COMMON_PART = 0.02
"""Part of its frames in which a piece of a marker may be seen together with the rest of it: false points."""

PIECE_RIGHT = 0.1
"""Probability that a marker is one of its own although another one fits it and is never seen together with it."""

ALONE_RIGHT = 0.3
"""Probability of a marker whose distance to no other one is known."""

STAY_WRONG = 1e-4
"""Probability per frame that a marker which is seen without a break changes between right and wrong."""

LOST = 0.03
"""Probability that another marker is taken for one that was out of sight."""

FOUND = 0.5
"""Probability that a wrong marker is right again after a gap."""

FIRST_RIGHT = 0.9
"""Probability of being right before anything is known."""


@dataclass(frozen=True, eq=False)
class Certainty:
    """What is known of identities in each frame.

    Attributes
    ----------
    confidence : ndarray, shape (n_frames, n_markers)
        Probability that the marker is the one that it is called; NaN where it is unseen.
    rival : ndarray of intp, shape (n_frames, n_markers)
        The marker whose place fits next best, -1 = nowhere in particular.
    n_mates : ndarray of intp, shape (n_frames, n_markers)
        Mates seen in the frame.
    evidence : ndarray, shape (n_frames, n_markers), nats
        For the marker's own place against the best rival's, from the frame alone.
    original : ndarray of intp, shape (n_markers,)
        The marker that each one is probably a piece of: it lies where that belongs and is never seen together with it;
        -1 = none.
    alone : ndarray of bool, shape (n_markers,)
        Markers whose distance to no other one is known.
    twins : tuple of (int, int)
        Pairs that no distance tells apart although they are seen together.
    """

    confidence: Floats
    rival: Ints
    n_mates: Ints
    evidence: Floats
    original: Ints
    alone: Bools
    twins: tuple[tuple[int, int], ...]


@dataclass(frozen=True, eq=False)
class Usual:
    """Usual distances between all markers, and who is compared with whom.

    Attributes
    ----------
    distance, spread : ndarray, shape (n_markers, n_markers), mm
        Median and robust standard deviation; NaN where two are never seen together for long enough.
    mates : ndarray of intp, shape (n_markers, n_mates)
        Markers whose distances vary least; -1 = none.
    rivals : ndarray of intp, shape (n_markers, n_rivals)
        Markers with the most similar distances to the mates; -1 = none.
    separation : ndarray, shape (n_markers, n_rivals)
        By how many standard deviations their distances differ, root mean square.
    reach : float, mm
        How far markers are apart at most: where a point lies that is nowhere in particular.
    """

    distance: Floats
    spread: Floats
    mates: Ints
    rivals: Ints
    separation: Floats
    reach: float


def usual_distances(trajectories: Trajectories) -> Usual:
    """Take median and spread of all distances, and find mates and rivals of each marker."""
    n_markers = trajectories.n_markers
    frames = _sampled(trajectories)
    positions = trajectories.positions[frames]
    distance, spread = np.full((2, n_markers, n_markers), np.nan)
    reach = 0.0
    for marker in range(n_markers - 1):
        lengths = np.linalg.norm(positions[:, marker + 1 :] - positions[:, [marker]], axis=2)
        middle, deviation = _median_and_spread(lengths)
        distance[marker, marker + 1 :] = distance[marker + 1 :, marker] = middle
        spread[marker, marker + 1 :] = spread[marker + 1 :, marker] = deviation
        reach = max(reach, float(np.nanmax(middle, initial=0.0)))
    spread = _with_floor(distance, spread)
    n_mates, n_rivals = min(N_MATES, n_markers - 1), min(N_RIVALS, n_markers - 1)
    order = np.argsort(np.where(np.isnan(spread), np.inf, spread), axis=1, kind="stable")[:, :n_mates]
    mates = np.where(np.isfinite(np.take_along_axis(spread, order, axis=1)), order, -1)
    rivals = np.full((n_markers, n_rivals), -1, dtype=np.intp)
    separation = np.full((n_markers, n_rivals), np.inf)
    for marker in range(n_markers):
        apart = _separations(marker, mates[marker], distance, spread)
        nearest = np.argsort(apart, kind="stable")[:n_rivals]
        rivals[marker] = np.where(np.isfinite(apart[nearest]), nearest, -1)
        separation[marker] = apart[nearest]
    return Usual(distance, spread, mates, rivals, separation, max(reach, TINY_SPREAD))


def _sampled(trajectories: Trajectories) -> Ints:
    bounded = MOST_SAMPLES // max(1, trajectories.n_markers**2)
    n_samples = min(trajectories.n_frames, SAMPLE_FRAMES, max(LEAST_SAMPLES, bounded))
    return np.unique(np.linspace(0, max(trajectories.n_frames - 1, 0), n_samples).astype(np.intp))


def _median_and_spread(values: Floats) -> tuple[Floats, Floats]:
    """Median and robust standard deviation of each column without its NaN; NaN for columns with few values."""
    count = (~np.isnan(values)).sum(axis=0)
    place = np.maximum(count - 1, 0)[np.newaxis] // 2
    middle = np.take_along_axis(np.sort(values, axis=0), place, axis=0)[0]
    off = np.take_along_axis(np.sort(np.abs(values - middle), axis=0), place, axis=0)[0]
    enough = count >= LEAST_COMMON
    return np.where(enough, middle, np.nan), np.where(enough, SIGMA_OF_MEDIAN * off, np.nan)


def _with_floor(distance: Floats, spread: Floats) -> Floats:
    """No distance is surer than half of what the steadiest distance of a marker usually is."""
    known = ~np.isnan(spread)
    steadiest = np.where(known, spread, np.inf).min(axis=1, initial=np.inf)
    steadiest = steadiest[np.isfinite(steadiest)]
    usual = float(np.median(steadiest)) / 2 if len(steadiest) else 0.0
    return np.asarray(np.maximum(spread, np.maximum(max(usual, TINY_SPREAD), LEAST_SPREAD * distance)))


def _separations(marker: int, mates: Ints, distance: Floats, spread: Floats) -> Floats:
    """How far, in standard deviations, each marker's distances to the mates of one differ from its own, (n_markers,)."""
    mates = mates[mates >= 0]
    result = np.full(len(distance), np.inf)
    if not len(mates):
        return result
    apart = (distance[:, mates] - distance[marker, mates]) / np.hypot(spread[:, mates], spread[marker, mates])
    told = ~np.isnan(apart)
    squares = np.where(told, apart**2, 0.0).sum(axis=1)
    some = told.any(axis=1)
    result[some] = np.sqrt(squares[some] / told[some].sum(axis=1))
    result[marker] = np.inf
    return result


def identity_confidence(trajectories: Trajectories) -> Certainty:
    """Judge the identity of every marker in every frame.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers, however they were labelled.
    """
    n_frames, n_markers = trajectories.n_frames, trajectories.n_markers
    usual = usual_distances(trajectories)
    evidence, rival = np.zeros((n_frames, n_markers)), np.full((n_frames, n_markers), -1, dtype=np.intp)
    n_seen = np.zeros((n_frames, n_markers), dtype=np.intp)
    step = max(1, CHUNK_VALUES // max(1, n_markers * (usual.rivals.shape[1] + 1) * max(1, usual.mates.shape[1])))
    for start in range(0, n_frames, step):
        part = slice(start, start + step)
        evidence[part], rival[part], n_seen[part] = _evidence(trajectories.positions[part], usual)
    confidence = _smoothed(evidence, trajectories.seen, trajectories.rate)
    original, twins = _look_alikes(usual, trajectories.seen)
    confidence[:, original >= 0] *= PIECE_RIGHT
    alone = (usual.mates < 0).all(axis=1)
    confidence[:, alone] *= ALONE_RIGHT
    return Certainty(confidence, rival, n_seen, evidence, original, alone, twins)


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


def _smoothed(evidence: Floats, seen: Bools, rate: float) -> Floats:
    """Probability of being right from the evidence of all frames; NaN where unseen, shape (n_frames, n_markers)."""
    calm = max(1.0, CORRELATED_SECONDS * rate)
    odds = np.where(seen, evidence / calm, 0.0)
    forward, backward = np.zeros_like(odds), np.zeros_like(odds)
    state = np.full(odds.shape[1], np.log(FIRST_RIGHT / (1.0 - FIRST_RIGHT)))
    gone = np.zeros(odds.shape[1], dtype=np.bool_)
    for frame in range(len(odds)):
        if frame:
            state = _moved_on(state, gone & seen[frame])
        state = np.clip(state + odds[frame], -MOST_NATS, MOST_NATS)
        forward[frame] = state
        gone = ~seen[frame]
    state = np.zeros(odds.shape[1])
    gone = np.zeros(odds.shape[1], dtype=np.bool_)
    for frame in range(len(odds) - 1, -1, -1):
        backward[frame] = state
        state = np.clip(state + odds[frame], -MOST_NATS, MOST_NATS)
        begins = seen[frame] & ~seen[frame - 1] if frame else gone
        state = _moved_back(state, begins)
    return np.where(seen, 1.0 / (1.0 + np.exp(-np.clip(forward + backward, -MOST_NATS, MOST_NATS))), np.nan)


def _moved_on(state: Floats, after_gap: Bools) -> Floats:
    """Log odds of being right, one frame later."""
    lose, find = np.where(after_gap, LOST, STAY_WRONG), np.where(after_gap, FOUND, STAY_WRONG)
    ratio = np.exp(state)
    return np.asarray(np.log((ratio * (1.0 - lose) + find) / (ratio * lose + 1.0 - find)))


def _moved_back(state: Floats, after_gap: Bools) -> Floats:
    """Log likelihood ratio of what follows, one frame earlier."""
    lose, find = np.where(after_gap, LOST, STAY_WRONG), np.where(after_gap, FOUND, STAY_WRONG)
    ratio = np.exp(state)
    return np.asarray(np.log((ratio * (1.0 - lose) + lose) / (ratio * find + 1.0 - find)))


def _look_alikes(usual: Usual, seen: Bools) -> tuple[Ints, tuple[tuple[int, int], ...]]:
    """Which marker each one is a piece of, and which pairs no distance tells apart."""
    counts = seen.sum(axis=0)
    original = np.full(len(counts), -1, dtype=np.intp)
    twins = set()
    for marker, slot in np.argwhere(usual.separation < TOLD_APART).tolist():
        other = int(usual.rivals[marker, slot])
        together = int((seen[:, marker] & seen[:, other]).sum())
        if together > COMMON_PART * counts[marker]:
            if usual.separation[marker, slot] < TWINS_APART:
                twins.add((min(marker, other), max(marker, other)))
        elif (counts[other], -other) > (counts[marker], -marker) and original[marker] < 0:
            original[marker] = other
    return original, tuple(sorted(twins))
