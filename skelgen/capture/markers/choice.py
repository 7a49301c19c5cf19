"""Which of the pairs of balls that fit each other are one marker: what their tracks say over time.

Two balls on one epipolar line fit each other by chance, in one frame or in many. But balls that are one fit in every
frame in which both are seen, and a ball of one image is one ball of the other at most. So pairs of tracks are judged,
not pairs of balls: each frame in which they fit speaks for them by how well they do, each frame in which both are seen
and do not fit speaks against them. The surest pair is believed first, and rules out all pairs in which one of its
tracks would have a second partner at the same time.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from skelgen.capture.markers.candidates import Candidates
from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats, Ints

SPREAD = 30.0
"""Distance [px] from an epipolar line over which balls that do not belong to it lie, in order of magnitude."""

WORST = 9.0
"""Least log likelihood of a misfit: balls that are partly hidden are beyond all noise."""

MISSED = 3.0
"""What a frame in which two tracks do not fit speaks against them [nats]: balls that are hidden in part are seen so
badly in one frame of twenty."""

Spans = tuple[Sequence[int], Sequence[int]]
"""First and last frame of the tracks of one camera."""


def chosen(candidates: Candidates, left: Spans, right: Spans, noise: float) -> Bools:
    """Tell which candidates are markers.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    left, right : Spans
        When the tracks of both cameras begin and end.
    noise : float, px
        Least standard deviation of a misfit, that of the rig; the recording's own is taken where it is larger.

    Returns
    -------
    ndarray of bool, shape (n,)
        At most one candidate of each ball.
    """
    if not len(candidates.left):
        return np.zeros(0, dtype=np.bool_)
    n_right = len(right[0])
    keys, pair_of, counts = np.unique(
        candidates.left.astype(np.int64) * n_right + candidates.right, return_inverse=True, return_counts=True
    )
    pairs = np.stack(np.divmod(keys, n_right), axis=1)
    starts = np.stack([np.asarray(spans[0])[pairs[:, side]] for side, spans in enumerate((left, right))], axis=1)
    ends = np.stack([np.asarray(spans[1])[pairs[:, side]] for side, spans in enumerate((left, right))], axis=1)
    together = ends.min(axis=1) - starts.max(axis=1) + 1
    fits = _log_likelihood_ratios(candidates.misfit.astype(np.float64), noise)
    evidence = np.bincount(pair_of, fits, len(keys)) - MISSED * (together - counts)
    return np.asarray(_surest_first(pairs, starts, ends, evidence)[pair_of])


def _log_likelihood_ratios(misfit: Floats, noise: float) -> Floats:
    """How much better each misfit is explained by one marker than by chance [nats]."""
    deviation = max(SIGMA_OF_MEDIAN * float(np.median(misfit)), noise)  # most candidates are right
    return np.asarray(np.log(SPREAD / deviation) - np.minimum((misfit / deviation) ** 2 / 2, WORST))


def _surest_first(pairs: Ints, starts: Ints, ends: Ints, evidence: Floats) -> Bools:
    """Believe pairs of tracks in the order of their evidence, unless a track has another partner at that time."""
    is_believed = np.zeros(len(pairs), dtype=np.bool_)
    partners: tuple[dict[int, list[tuple[int, int]]], ...] = (defaultdict(list), defaultdict(list))
    for pair in np.argsort(-evidence, kind="stable").tolist():
        if evidence[pair] <= 0:
            break
        tracks, first, last = pairs[pair].tolist(), starts[pair].tolist(), ends[pair].tolist()
        if any(
            first[1 - side] <= other_last and other_first <= last[1 - side]
            for side in (0, 1)
            for other_first, other_last in partners[side][tracks[side]]
        ):
            continue
        is_believed[pair] = True
        for side in (0, 1):
            partners[side][tracks[side]].append((first[1 - side], last[1 - side]))
    return is_believed
