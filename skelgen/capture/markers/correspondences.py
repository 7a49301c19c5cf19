"""Stereo correspondences of a recording: which of the pairs of balls that fit each other are one marker.

Two balls on one epipolar line fit each other by chance, in one frame or in many. But two images of one marker fit in
every frame in which both are seen, and a ball of one image belongs to at most one ball of the other. So evidence is
summed for pairs of tracks, not for pairs of balls: each frame in which they fit counts for them, each frame in which
both are seen and do not fit counts against them. Pairs are accepted in the order of their evidence. An accepted pair
rules out all pairs in which one of its tracks would have a second partner at the same time.

Short tracks give little evidence. So the pairs that are accepted first show which distances stay constant. Candidates
that share a ball are then weighed again by the rigid triangles that they make with others (`rigidity`); the triangles
of known targets count, too.
"""

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from skelgen.capture.markers import rigidity
from skelgen.capture.markers.candidates import Candidates
from skelgen.geometry.statistics import SIGMA_OF_MEDIAN
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.model.rig import BodyTarget

CHANCE_SPREAD = 30.0
"""Distance [px] from an epipolar line at which unrelated balls lie, in order of magnitude."""

MAX_LOSS = 9.0
"""Largest loss of log likelihood by a misfit: balls that are partly hidden exceed all noise."""

MISMATCH = 3.0
"""Evidence [nats] of a frame in which two tracks do not fit against them: a true pair does not fit in one frame of
twenty, as balls are hidden in part."""

MAX_EVIDENCE = 9.0
"""Largest evidence [nats] of triangles for or against a candidate: more cannot be measured from a few thousand."""

NO_MARKER = -2
"""Stands for the marker of pairs of tracks that are only a small part of one."""

Spans = tuple[Sequence[int], Sequence[int]]
"""First and last frame of the tracks of one camera."""


@dataclass(frozen=True, eq=False)
class TrackPairs:
    """Pairs of a left and a right track whose balls fit each other.

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


def find_markers(
    candidates: Candidates, pairs: TrackPairs, noise: float, step: float, targets: Sequence[BodyTarget] = ()
) -> Bools:
    """Return which candidates are markers.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of a recording.
    pairs : TrackPairs
        Their pairs of tracks.
    noise : float, px
        Standard deviation of a misfit by the rig's settings.
    step : float, s
        Time between frames.
    targets : sequence of BodyTarget
        Rigid bodies that are known.

    Returns
    -------
    ndarray of bool, shape (n,)
        At most one candidate of each ball.
    """
    evidence = evidence_over_time(candidates, pairs, noise)
    accepted = accept_best_first(pairs, evidence)
    n_independent_frames = rigidity.n_independent(np.bincount(pairs.of_candidate, minlength=len(pairs)), step)
    shared = share_a_ball(candidates, (evidence > -MAX_EVIDENCE * n_independent_frames)[pairs.of_candidate])
    if shared.any():
        scale = noise_scale(candidates, noise)
        kept, markers = accepted[pairs.of_candidate], markers_of_pairs(pairs, accepted)
        triangles = rigidity.learned_triangles(candidates, kept, markers.marker[pairs.of_candidate], scale)
        triangles += rigidity.triangles_of_targets(targets)
        ratios = rigidity.log_ratios(candidates, kept, markers.own[pairs.of_candidate], triangles, shared, scale)
        evidence += rigidity.evidence_of_rigidity(ratios, shared, pairs.of_candidate, len(pairs), step)
        accepted = accept_best_first(pairs, evidence)
    return np.asarray(accepted[pairs.of_candidate])


def noise_scale(candidates: Candidates, noise: float) -> float:
    """Return how large the noise of a recording is, as a part of what the rig's settings state.

    Parameters
    ----------
    candidates : Candidates
        All pairs of balls of the recording; most of them are right, so that their median misfit measures the noise.
    noise : float, px
        Standard deviation of a misfit by the rig's settings. It is an upper bound.

    Returns
    -------
    float
        Above 0, at most 1.
    """
    return min(1.0, _typical_misfit(candidates.misfit.astype(np.float64)) / noise) or 1.0


def share_a_ball(candidates: Candidates, possible: Bools) -> Bools:
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
class PairMarkers:
    """The marker that each pair of tracks belongs to.

    Attributes
    ----------
    marker : ndarray of intp, shape (n_pairs,)
        Accepted pairs that share a track are one marker: one camera followed it while the other lost it.
    own : ndarray of intp, shape (n_pairs,)
        The marker of pairs that make up most of it: triangles that were learned from it are no evidence for them.
        `NO_MARKER` for all others.
    """

    marker: Ints
    own: Ints


def markers_of_pairs(pairs: TrackPairs, accepted: Bools) -> PairMarkers:
    """Return the marker that each pair of tracks belongs to.

    Parameters
    ----------
    pairs : TrackPairs
        All pairs of tracks.
    accepted : ndarray of bool, shape (n_pairs,)
        Which of them are accepted.
    """
    left, right = pairs.tracks.T
    n_left, n_right = int(left.max(initial=-1)) + 1, int(right.max(initial=-1)) + 1
    shape = (n_left + n_right, n_left + n_right)
    links = coo_array((np.ones(int(accepted.sum())), (left[accepted], n_left + right[accepted])), shape)
    marker = connected_components(links, directed=False)[1][left].astype(np.intp)
    counts = np.bincount(pairs.of_candidate, minlength=len(pairs))
    whole = np.bincount(marker[accepted], counts[accepted], int(marker.max(initial=-1)) + 1)
    return PairMarkers(marker, np.where(accepted & (2 * counts > whole[marker]), marker, NO_MARKER))


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
        np.stack([np.asarray(spans[end], np.intp)[own] for spans, own in zip((left, right), tracks.T, strict=True)], 1)
        for end in (0, 1)
    )
    return TrackPairs(tracks, first, last, of_candidate)


def evidence_over_time(candidates: Candidates, pairs: TrackPairs, noise: float) -> Floats:
    """Return the log likelihood ratio of one marker against chance for each pair of tracks, shape (n_pairs,), nats.

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
    misfit = candidates.misfit.astype(np.float64)
    deviation = max(_typical_misfit(misfit), noise)
    fits = np.log(CHANCE_SPREAD / deviation) - np.minimum((misfit / deviation) ** 2 / 2, MAX_LOSS)
    counts = np.bincount(pairs.of_candidate, minlength=len(pairs))
    return np.asarray(np.bincount(pairs.of_candidate, fits, len(pairs)) - MISMATCH * (together - counts))


def _typical_misfit(misfit: Floats) -> float:
    """Return the standard deviation [px] of the misfits of right pairs, by the median: most candidates are right."""
    return SIGMA_OF_MEDIAN * float(np.median(misfit)) if len(misfit) else 0.0


def accept_best_first(pairs: TrackPairs, evidence: Floats) -> Bools:
    """Accept pairs of tracks in the order of their evidence, unless a track has another partner at that time.

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
    is_accepted = np.zeros(len(pairs), dtype=np.bool_)
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
        is_accepted[pair] = True
        for side in (0, 1):
            partners[side][tracks[side]].append((first[1 - side], last[1 - side]))
    return is_accepted
