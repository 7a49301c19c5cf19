"""What distances say of a marker's identity in each frame, and what all frames say together."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels import kernel, kernel_part
from skelgen._kernels.distance_statistics import squared_distance
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


class Distances(NamedTuple):
    """What is usual of distances, and whom they are compared with.

    Attributes
    ----------
    law : ndarray, shape (n_markers, n_markers, 3)
        Middle [mm], inverse width [1/mm], and density at the middle [1/mm] but for foul ones, of each distance; NaN if
        unknown.
    mates, rivals, reach
        As in `skelgen.stages.labels.confidence.identity.DistanceStatistics`.
    """

    law: Floats
    mates: Ints
    rivals: Ints
    reach: float


class Sight(NamedTuple):
    """What is known of markers in each frame; see `probabilities`."""

    evidence: NDArray[np.float32]
    seen: Bools
    stated: Bools
    breaks: Bools


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
        As in `skelgen.stages.labels.confidence.identity.DistanceStatistics`.
    """
    shape = positions.shape[:2]
    with np.errstate(divide="ignore", invalid="ignore"):
        law = np.stack([distance, 1.0 / spread, (1.0 - FOUL_PART) * PEAK / spread], axis=-1)
    found = np.zeros(shape, dtype=np.float32), np.full(shape, -1, dtype=np.int16), np.zeros(shape, dtype=np.int8)
    n_mates, n_rivals = mates.shape[1], rivals.shape[1]
    room = np.empty(n_mates), np.empty(n_mates), np.empty((shape[1], n_rivals + 1))
    _weigh(positions, Distances(law, mates, rivals, reach), room, found)
    return found


@kernel
def _weigh(positions: Floats, distances: Distances, room: tuple[Floats, Floats, Floats], found: Evidence) -> None:
    """Write what `evidence_of` returns; there is room for distances to mates, their densities, and gains."""
    law, mates, rivals, reach = distances
    evidence, rival, n_seen = found
    lengths, own, gain = room
    for frame in range(positions.shape[0]):
        for marker in range(positions.shape[1]):
            n_seen[frame, marker] = _fill_lengths(lengths, positions[frame], marker, mates[marker])
            for index in range(len(own)):
                own[index] = _density(lengths[index], law[marker, mates[marker, index]], reach)
            gain[marker, 0] = _against_nowhere(lengths, own, reach)
            for slot in range(rivals.shape[1]):
                gain[marker, slot + 1] = _against(rivals[marker, slot], lengths, own, mates[marker], law, reach)
        for marker in range(positions.shape[1]):
            least = gain[marker, 0]
            for slot in range(rivals.shape[1]):
                other = rivals[marker, slot]
                value = gain[marker, slot + 1]
                if other >= 0 and not math.isnan(positions[frame, other, 0]):
                    value += _returned(gain, rivals, marker, other)
                if value < least:
                    least = value
                    rival[frame, marker] = other
            evidence[frame, marker] = min(max(least, -MOST_NATS), MOST_NATS)


@kernel_part
def _fill_lengths(lengths: Floats, points: Floats, marker: int, mates: Ints) -> int:
    """Fill in the distances to mates, NaN where unknown, and return how many are known."""
    n_known = 0
    for index in range(len(mates)):
        lengths[index] = (
            math.sqrt(squared_distance(points, mates[index], points, marker)) if mates[index] >= 0 else math.nan
        )
        n_known += not math.isnan(lengths[index])
    return n_known


@kernel_part
def _density(length: float, law: Floats, reach: float) -> float:
    """Density of a distance [1/mm] about what is usual."""
    off = (length - law[0]) * law[1]
    inner = 1.0 + off * off / FREEDOMS
    density = law[2] / (inner * inner * math.sqrt(inner)) + FOUL_PART / reach
    return 1.0 / reach if math.isnan(density) else density


@kernel_part
def _against_nowhere(lengths: Floats, own: Floats, reach: float) -> float:
    """Nats for the own place against nowhere in particular."""
    product, n_known = 1.0, 0
    for index in range(len(own)):
        if not math.isnan(lengths[index]):
            product *= own[index] * reach
            n_known += 1
    return math.log(product) * min(1.0, COORDINATES / max(n_known, 1))


@kernel_part
def _against(other: int, lengths: Floats, own: Floats, mates: Ints, law: Floats, reach: float) -> float:
    """Nats for the own place against that of another marker."""
    if other < 0:
        return math.inf
    ours, theirs, n_known = 1.0, 1.0, 0
    for index in range(len(own)):
        if not math.isnan(lengths[index]) and mates[index] != other:
            ours *= own[index]
            theirs *= _density(lengths[index], law[other, mates[index]], reach)
            n_known += 1
    return math.log(ours / theirs) * min(1.0, COORDINATES / max(n_known, 1))


@kernel_part
def _returned(gain: Floats, rivals: Ints, marker: int, other: int) -> float:
    """Nats that the rival would lose by taking the marker's place in return."""
    for slot in range(rivals.shape[1]):
        if rivals[other, slot] == marker:
            return float(gain[other, slot + 1])
    return 0.0


def probabilities(
    evidence: NDArray[np.float32], share: float, seen: Bools, stated: Bools, breaks: Bools, prior: tuple[float, float]
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
    prior : tuple of float
        Probabilities that a marker is right when it is first seen, and that another one is taken for it after a break.
    """
    right, lost = prior
    total, state = np.empty(seen.shape), np.full(seen.shape[1], math.log(right / (1.0 - right)))
    _smooth(Sight(evidence, seen, stated, breaks), share, lost, state, total)
    return total


@kernel
def _smooth(sight: Sight, share: float, lost: float, state: Floats, total: Floats) -> None:
    """Write what `probabilities` returns; the `state` of each marker is its log odds before the first frame."""
    for frame in range(len(total)):
        for marker in range(total.shape[1]):
            if frame > 0:
                lose, find = (lost, FOUND) if sight.breaks[frame, marker] else (CHANGE, CHANGE)
                state[marker] = _passed(state[marker], lose, find, find, lose)
            odds = _odds(sight, share, frame, marker)
            state[marker] = total[frame, marker] = _bounded(state[marker] + odds)
    for marker in range(total.shape[1]):
        state[marker] = 0.0  # from now on: log likelihood ratio of what follows
    for frame in range(len(total) - 1, -1, -1):
        for marker in range(total.shape[1]):
            sure = 1.0 / (1.0 + math.exp(-_bounded(total[frame, marker] + state[marker])))
            total[frame, marker] = sure if sight.seen[frame, marker] else math.nan
            lose, find = (lost, FOUND) if sight.breaks[frame, marker] else (CHANGE, CHANGE)
            odds = _bounded(state[marker] + _odds(sight, share, frame, marker))
            state[marker] = _passed(odds, lose, find, lose, find)


@kernel_part
def _odds(sight: Sight, share: float, frame: int, marker: int) -> float:
    """Log odds of one frame."""
    if len(sight.stated) > 0 and sight.stated[frame, marker]:
        return MOST_NATS
    return float(sight.evidence[frame, marker] / np.float32(share)) if sight.seen[frame, marker] else 0.0


@kernel_part
def _bounded(nats: float) -> float:
    return min(max(nats, -MOST_NATS), MOST_NATS)


@kernel_part
def _passed(state: float, lose: float, find: float, gained: float, spoiled: float) -> float:
    """Log odds a frame later, or the log likelihood ratio of all that follows a frame earlier."""
    ratio = math.exp(state)
    return math.log((ratio * (1.0 - lose) + gained) / (ratio * spoiled + 1.0 - find))
