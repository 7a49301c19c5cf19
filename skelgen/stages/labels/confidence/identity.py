r"""How sure it is that each marker is the one that it is called: a probability per marker and frame.

Every marker has mates, the markers whose distances to it vary least, wherever they sit. In each frame the distances
:math:`d_j` to the mates that are seen give identity evidence: their likelihood at the marker's own place against that
at the best rival, which is another marker's place or any place at all. Over time a marker is in one of two states,
right or wrong; it seldom changes while it is seen without a break, and more easily over a gap. The probability of being
right, given the evidence of all frames, comes from the forward-backward recursion of this hidden Markov chain (Rabiner
1989).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from skelgen._kernels.identity_evidence import evidence_of, probabilities
from skelgen.model import Trajectories
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.labels.confidence.distance_statistics import TINY_SPREAD, distance_statistics, look_alikes

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
