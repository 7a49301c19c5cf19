"""How sure it is that each marker is the one that it is called: a probability per marker and frame.

Every marker has mates, the markers whose distances to it vary least, wherever they sit. In each frame the distances
:math:`d_j` to the mates that are seen give identity evidence: their likelihood at the marker's own place against that
at the best rival, which is another marker's place or any place at all. Over time a marker is in one of two states,
right or wrong; it seldom changes while it is seen without a break, and more easily over a gap. The probability of being
right, given the evidence of all frames, comes from the forward-backward recursion of this hidden Markov chain (Rabiner
1989).

Before that stand the statistics of distances: which markers keep theirs best, which are alike in place, and which may
be one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels.identity_evidence import evidence_of, probabilities
from skelgen.geometry.statistics import median_and_deviation, pair_lengths
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints, spread_frames

CORRELATED_SECONDS = 0.4
"""Evidence within this time is correlated, as a pose lasts: together it counts like that of one frame."""

PIECE_RIGHT = 0.1
"""Probability that a marker exists although another one fits its place and is never seen together with it."""

RARELY_SEEN = 0.2
"""Part of the frames; a marker seen in fewer is a piece of another one about as often as not."""

ALONE_RIGHT = 0.3
"""Probability of a marker that has no known distance to another one."""

JUMP_DEVIATIONS = 20.0
"""Where tracks are not known, a step that deviates by this many times the median deviation counts as a break."""


class Prior(NamedTuple):
    """Probabilities before any distance is compared.

    Attributes
    ----------
    right : float
        Probability that a marker is right when it is first seen.
    lost : float
        Probability that another marker is taken for one that was out of sight, or was followed anew.
    rare : float
        Probability that a marker which is seldom seen is no piece of another one; NaN: that is not doubted.
    """

    right: float
    lost: float
    rare: float


LABELS_FOUND = Prior(right=0.9, lost=0.1, rare=0.5)
"""For takes that came as points."""

LABELS_GIVEN = Prior(right=0.97, lost=0.05, rare=np.nan)
"""For takes that came with labels: somebody has checked them."""


@dataclass(frozen=True, eq=False)
class IdentityConfidence:
    """How sure the identity of each marker is in each frame.

    Attributes
    ----------
    confidence : ndarray, shape (n_frames, n_markers)
        Probability that the marker is the one that it is called; NaN where it is unseen.
    rival : ndarray of int16, shape (n_frames, n_markers)
        The marker whose place fits next best, -1 = any place.
    n_mates : ndarray of int8, shape (n_frames, n_markers)
        Mates seen in the frame.
    evidence : ndarray of float32, shape (n_frames, n_markers), nats
        For the marker's own place against the best rival, from this frame alone.
    original : ndarray of intp, shape (n_markers,)
        The marker that each one is probably a piece of: its place is the same, and both are never seen together.
        -1 = none.
    alone : ndarray of bool, shape (n_markers,)
        Markers that have no known distance to another one.
    rare : ndarray of bool, shape (n_markers,)
        Markers that are seen so seldom that they may be pieces of others, although no other one fits.
    twins : tuple of (int, int)
        Pairs that are seen together, but that no distance distinguishes.
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
    trajectories: Trajectories, breaks: Bools | None = None, stated: Bools | None = None, prior: Prior = LABELS_GIVEN
) -> IdentityConfidence:
    """Compute how sure the identity of every marker is in every frame.

    Parameters
    ----------
    trajectories : Trajectories
        Labelled markers, however they were labelled.
    breaks : ndarray of bool, shape (n_frames, n_markers), optional
        Frames in which a marker is not simply followed from the frame before; by default after gaps and jumps.
    stated : ndarray of bool, shape (n_frames, n_markers), optional
        Frames in which the user says that the marker is the one that it is called.
    prior : Prior
        Probabilities before any distance is compared.
    """
    if breaks is None:
        breaks = jumps(trajectories)
    statistics = distance_statistics(trajectories)
    original, twins = look_alikes(statistics, trajectories.seen)
    alone: Bools = np.asarray((statistics.mates < 0).all(axis=1))
    rare: Bools = (trajectories.seen.mean(axis=0) < RARELY_SEEN) & (original < 0) & ~alone & ~np.isnan(prior.rare)
    if stated is not None:
        sure = stated.any(axis=0)
        original[sure], alone[sure], rare[sure] = -1, False, False
    statistics = statistics.without_pieces(original)
    seen = trajectories.seen
    usual, compared = (statistics.distance, statistics.spread), (statistics.mates, statistics.rivals)
    evidence, rival, n_seen = evidence_of(trajectories.positions, *usual, *compared, statistics.reach)
    stated = np.zeros((0, 0), dtype=np.bool_) if stated is None else stated
    share = max(1.0, CORRELATED_SECONDS * trajectories.rate)
    breaks = breaks.copy()
    breaks[1:] |= seen[1:] & ~seen[:-1]
    confidence = probabilities(evidence, share, seen, stated, breaks, (prior.right, prior.lost))
    confidence[:, original >= 0] *= PIECE_RIGHT
    confidence[:, alone] *= ALONE_RIGHT
    confidence[:, rare] *= prior.rare
    confidence.flags.writeable = False
    return IdentityConfidence(confidence, rival, n_seen, evidence, original, alone, rare, twins)


def jumps(trajectories: Trajectories) -> Bools:
    """Frames in which a marker is far from where its last step would have brought it, shape (n_frames, n_markers)."""
    deviation = np.linalg.norm(np.diff(trajectories.positions, n=2, axis=0), axis=2)
    known = deviation[~np.isnan(deviation)]
    result = np.zeros(trajectories.seen.shape, dtype=np.bool_)
    if len(known):
        result[2:] = deviation > JUMP_DEVIATIONS * max(float(np.median(known)), TINY_SPREAD)
    return result


N_MATES = 6
"""Mates of each marker: a point has three coordinates, and some mates may be hidden."""

N_RIVALS = 4
"""Other markers whose places are tried: the most similar ones."""

SAMPLE_FRAMES = 300
"""Frames from which the statistics are taken."""

MOST_SAMPLES = 20_000_000
"""Distances from which the statistics are taken: with very many markers fewer frames are sampled."""

CHUNK_VALUES = 1_000_000
"""Distances held at once: 8 MB per array."""

LEAST_SAMPLES = 20
"""Frames that are sampled in any case."""

LEAST_COMMON = 8
"""Common frames that a distance needs."""

LEAST_SPREAD = 1e-3
"""Of a distance: the least spread, however exact the take."""

TINY_SPREAD = 1e-9
"""mm; keeps the density of distances finite for markers that coincide."""

LOOK_ALIKE = 2.0
"""Root mean square of the standard deviations by which distances must differ, or two markers look alike."""

COMMON_PART = 0.02
"""Part of its frames in which a piece of a marker may be seen together with the rest, because of false points."""


@dataclass(frozen=True, eq=False)
class DistanceStatistics:
    """Median and spread of all distances between markers, and which markers each one is compared with.

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
        Largest distance of two markers; a point that belongs to no marker may lie anywhere within it.
    """

    distance: Floats
    spread: Floats
    mates: Ints
    rivals: Ints
    separation: Floats
    reach: float

    def without_pieces(self, original: Ints) -> DistanceStatistics:
        """Return the statistics without rivals that are pieces of the marker itself; `original` as in `look_alikes`."""
        own = (self.rivals >= 0) & (original[self.rivals] == np.arange(len(original))[:, np.newaxis])
        return replace(self, rivals=np.where(own, -1, self.rivals))


def distance_statistics(trajectories: Trajectories) -> DistanceStatistics:
    """Take median and spread of all distances, and find mates and rivals of each marker."""
    n_markers = trajectories.n_markers
    bounded = MOST_SAMPLES // max(1, trajectories.n_markers**2)
    n_samples = min(SAMPLE_FRAMES, max(LEAST_SAMPLES, bounded))
    frames = spread_frames(trajectories.n_frames, n_samples)
    positions = trajectories.positions[frames]
    distance, spread = np.full((2, n_markers, n_markers), np.nan)
    pairs = np.stack(np.triu_indices(n_markers, 1))
    step = max(1, CHUNK_VALUES // max(1, len(positions)))
    for start in range(0, pairs.shape[1], step):
        first, second = pairs[:, start : start + step]
        middle, deviation, count = median_and_deviation(pair_lengths(positions, first, second))
        for table, values in ((distance, middle), (spread, deviation)):
            table[first, second] = table[second, first] = np.where(count >= LEAST_COMMON, values, np.nan)
    reach = float(np.nanmax(distance, initial=0.0))
    # Bound spreads from below by half of the median spread of each marker's steadiest distance
    known = ~np.isnan(spread)
    steadiest = np.where(known, spread, np.inf).min(axis=1, initial=np.inf)
    steadiest = steadiest[np.isfinite(steadiest)]
    least = float(np.median(steadiest)) / 2 if len(steadiest) else 0.0
    spread = np.maximum(spread, np.maximum(max(least, TINY_SPREAD), LEAST_SPREAD * distance))
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
    return DistanceStatistics(distance, spread, mates, rivals, separation, max(reach, TINY_SPREAD))


def _separations(marker: int, mates: Ints, distance: Floats, spread: Floats) -> Floats:
    """Root mean square deviations between the distances of each marker and of one to that one's mates, (n_markers,)."""
    mates = mates[mates >= 0]
    result = np.full(len(distance), np.inf)
    if not len(mates):
        return result
    apart = (distance[:, mates] - distance[marker, mates]) / np.hypot(spread[:, mates], spread[marker, mates])
    known = ~np.isnan(apart)
    squares = np.where(known, apart**2, 0.0).sum(axis=1)
    some = known.any(axis=1)
    result[some] = np.sqrt(squares[some] / known[some].sum(axis=1))
    result[marker] = np.inf
    return result


def look_alikes(statistics: DistanceStatistics, seen: Bools) -> tuple[Ints, tuple[tuple[int, int], ...]]:
    """Find which marker each one is probably a piece of, and which pairs no distance tells apart.

    Parameters
    ----------
    statistics : DistanceStatistics
        Of the markers.
    seen : ndarray of bool, shape (n_frames, n_markers)
        When each marker is seen.

    Returns
    -------
    original : ndarray of intp, shape (n_markers,)
        The marker that lies in the same place, is seen longer, and hardly ever together with this one; -1 = none.
    twins : tuple of (int, int)
        Pairs that are seen together.
    """
    counts = seen.sum(axis=0)
    original = np.full(len(counts), -1, dtype=np.intp)
    twins = set()
    for marker, slot in np.argwhere(statistics.separation < LOOK_ALIKE).tolist():
        other = int(statistics.rivals[marker, slot])
        together = int((seen[:, marker] & seen[:, other]).sum())
        if together > COMMON_PART * min(counts[marker], counts[other]):
            if not _differ(marker, other, statistics):
                twins.add((min(marker, other), max(marker, other)))
        elif (counts[other], -other) > (counts[marker], -marker) and original[marker] < 0:
            original[marker] = other
    return original, tuple(sorted(twins))


def _differ(first: int, second: int, statistics: DistanceStatistics) -> bool:
    """Whether the distance to any third marker would change visibly if two were exchanged.

    The change is the mean Kullback-Leibler divergence between the normal distributions of both distances, the nats that
    a frame loses by the exchange. With equal spreads it is the square of the standard deviations by which both differ.
    A rigid and a loose distance differ, too, whatever their medians.
    """
    apart = statistics.distance[first] - statistics.distance[second]
    ours, theirs = statistics.spread[first] ** 2, statistics.spread[second] ** 2
    change = ((ours + apart**2) / theirs + (theirs + apart**2) / ours - 2.0) / 4.0
    change[[first, second]] = np.nan
    return bool((change > LOOK_ALIKE**2).any())
