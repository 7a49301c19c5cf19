"""Which of the pairs of balls that fit each other are one marker: what their tracks say over time.

Two balls on one epipolar line fit each other by chance, in one frame or in many. But balls that are one fit in every
frame in which both are seen, and a ball of one image is one ball of the other at most. So pairs of tracks are judged,
not pairs of balls: each frame in which they fit speaks for them by how well they do, each frame in which both are seen
and do not fit speaks against them. The surest pair is believed first, and rules out all pairs in which one of its
tracks would have a second partner at the same time.

Where tracks are short, time says little. So what is believed after a first pass tells which distances hold, and
candidates that share a ball are then judged by the rigid triangles that they make (`rigidity`), those of the settings'
targets among them.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from skelgen.capture.markers.candidates import Candidates
from skelgen.capture.markers.rigidity import (
    evidence_of_rigidity,
    independent,
    learned_triangles,
    log_ratios,
    triangles_of_targets,
)
from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import BodyTarget

SPREAD = 30.0
"""Distance [px] from an epipolar line over which balls that do not belong to it lie, in order of magnitude."""

WORST = 9.0
"""Least log likelihood of a misfit: balls that are partly hidden are beyond all noise."""

MISSED = 3.0
"""What a frame in which two tracks do not fit speaks against them [nats]: balls that are hidden in part are seen so
badly in one frame of twenty."""

MOST_TOLD = 9.0
"""What triangles may say of a candidate at most [nats]: the odds that a few thousand candidates can tell."""

FREE = -2
"""Owner of what no learned triangle was learned from."""

Spans = tuple[Sequence[int], Sequence[int]]
"""First and last frame of the tracks of one camera."""


@dataclass(frozen=True, eq=False)
class TrackPairs:
    """Pairs of a left and a right track of which balls fit each other.

    Attributes
    ----------
    tracks : ndarray of intp, shape (n_pairs, 2)
        The left and the right track.
    first, last : ndarray of intp, shape (n_pairs, 2)
        Frames in which these tracks begin and end.
    of_candidate : ndarray of intp, shape (n,)
        The pair of each candidate.
    """

    tracks: Ints
    first: Ints
    last: Ints
    of_candidate: Ints

    def __len__(self) -> int:
        return len(self.tracks)


def chosen(
    candidates: Candidates, pairs: TrackPairs, noise: float, step: float, targets: Sequence[BodyTarget] = ()
) -> Bools:
    """Tell which candidates are markers.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    pairs : TrackPairs
        Their pairs of tracks.
    noise : float, px
        Standard deviation of a misfit that the rig's settings tell.
    step : float, s
        Time between frames.
    targets : sequence of BodyTarget
        Rigid bodies that are known.

    Returns
    -------
    ndarray of bool, shape (n,)
        At most one candidate of each ball.
    """
    evidence = evidence_of_time(candidates, pairs, noise)
    believed = surest_first(pairs, evidence)
    n_told = independent(np.bincount(pairs.of_candidate, minlength=len(pairs)), step)
    shared = is_shared(candidates, (evidence > -MOST_TOLD * n_told)[pairs.of_candidate])
    if shared.any():
        scale = noise_scale(candidates, noise)
        kept, makers = believed[pairs.of_candidate], makers_of(pairs, believed)
        triangles = learned_triangles(candidates, kept, makers.marker[pairs.of_candidate], scale)
        triangles += triangles_of_targets(targets)
        ratios = log_ratios(candidates, kept, makers.own[pairs.of_candidate], triangles, shared, scale)
        evidence += evidence_of_rigidity(ratios, shared, pairs.of_candidate, len(pairs), step)
        believed = surest_first(pairs, evidence)
    return np.asarray(believed[pairs.of_candidate])


def noise_scale(candidates: Candidates, noise: float) -> float:
    """Return the recording's own noise by that of the settings, at most 1: they say how large it is at most."""
    return min(1.0, usual_misfit(candidates.misfit.astype(np.float64)) / noise) or 1.0


def is_shared(candidates: Candidates, possible: Bools) -> Bools:
    """Return which candidates share a ball with another one that is possible too.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    possible : ndarray of bool, shape (n,)
        Which of them may be markers.

    Returns
    -------
    ndarray of bool, shape (n,)
    """
    frames = candidates.frames[possible]
    shared = np.zeros(len(frames), dtype=np.bool_)
    for tracks in (candidates.left[possible], candidates.right[possible]):  # a track has one ball in a frame
        keys = frames * (int(tracks.max(initial=0)) + 1) + tracks
        _, ball, counts = np.unique(keys, return_inverse=True, return_counts=True)
        shared |= counts[ball] > 1
    found = np.zeros(len(possible), dtype=np.bool_)
    found[possible] = shared
    return found


@dataclass(frozen=True, eq=False)
class Makers:
    """What believed pairs of tracks belong to.

    Attributes
    ----------
    marker : ndarray of intp, shape (n_pairs,)
        Pairs that share a track are one marker: one camera followed it while the other lost it.
    own : ndarray of intp, shape (n_pairs,)
        The marker of pairs that are most of it, so that it is no witness for them; -2 for all others.
    """

    marker: Ints
    own: Ints


def makers_of(pairs: TrackPairs, believed: Bools) -> Makers:
    """Return what pairs of tracks belong to.

    Parameters
    ----------
    pairs : TrackPairs
        All pairs of tracks.
    believed : ndarray of bool, shape (n_pairs,)
        Which of them are markers.
    """
    left, right = pairs.tracks.T
    n_left, n_right = int(left.max(initial=-1)) + 1, int(right.max(initial=-1)) + 1
    shape = (n_left + n_right, n_left + n_right)
    links = coo_array((np.ones(int(believed.sum())), (left[believed], n_left + right[believed])), shape)
    marker = connected_components(links, directed=False)[1][left].astype(np.intp)
    counts = np.bincount(pairs.of_candidate, minlength=len(pairs))
    whole = np.bincount(marker[believed], counts[believed], int(marker.max(initial=-1)) + 1)
    return Makers(marker, np.where(believed & (2 * counts > whole[marker]), marker, FREE))


def track_pairs(candidates: Candidates, left: Spans, right: Spans) -> TrackPairs:
    """Return the pairs of tracks behind the candidates.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    left, right : Spans
        When the tracks of both cameras begin and end.
    """
    n_right = max(len(right[0]), 1)
    keys, of_candidate = np.unique(candidates.left.astype(np.int64) * n_right + candidates.right, return_inverse=True)
    tracks = np.stack(np.divmod(keys, n_right), axis=1)
    first, last = (
        np.stack(
            [np.asarray(spans[end], dtype=np.intp)[tracks[:, side]] for side, spans in enumerate((left, right))], 1
        )
        for end in (0, 1)
    )
    return TrackPairs(tracks, first, last, of_candidate)


def evidence_of_time(candidates: Candidates, pairs: TrackPairs, noise: float) -> Floats:
    """Return how much better each pair of tracks is explained by one marker than by chance, shape (n_pairs,), nats.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    pairs : TrackPairs
        Their pairs of tracks.
    noise : float, px
        Least standard deviation of a misfit, that of the rig; the recording's own is taken where it is larger.
    """
    together = pairs.last.min(axis=1) - pairs.first.max(axis=1) + 1
    fits = _log_likelihood_ratios(candidates.misfit.astype(np.float64), noise)
    counts = np.bincount(pairs.of_candidate, minlength=len(pairs))
    return np.asarray(np.bincount(pairs.of_candidate, fits, len(pairs)) - MISSED * (together - counts))


def usual_misfit(misfit: Floats) -> float:
    """Return the standard deviation [px] of the misfits of right pairs: most candidates are right."""
    return SIGMA_OF_MEDIAN * float(np.median(misfit)) if len(misfit) else 0.0


def _log_likelihood_ratios(misfit: Floats, noise: float) -> Floats:
    """How much better each misfit is explained by one marker than by chance [nats]."""
    deviation = max(usual_misfit(misfit), noise)
    return np.asarray(np.log(SPREAD / deviation) - np.minimum((misfit / deviation) ** 2 / 2, WORST))


def surest_first(pairs: TrackPairs, evidence: Floats) -> Bools:
    """Believe pairs of tracks in the order of their evidence, unless a track has another partner at that time.

    Parameters
    ----------
    pairs : TrackPairs
        All pairs of tracks.
    evidence : ndarray, shape (n_pairs,), nats
        For each of them.

    Returns
    -------
    ndarray of bool, shape (n_pairs,)
        Which pairs are markers; at no time two of one track.
    """
    is_believed = np.zeros(len(pairs), dtype=np.bool_)
    partners: tuple[dict[int, list[tuple[int, int]]], ...] = (defaultdict(list), defaultdict(list))
    for pair in np.argsort(-evidence, kind="stable").tolist():
        if evidence[pair] <= 0:
            break
        tracks, first, last = pairs.tracks[pair].tolist(), pairs.first[pair].tolist(), pairs.last[pair].tolist()
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
