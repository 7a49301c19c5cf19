"""The wand with two balls that look alike: which ball of one image is which of the others.

Two images are related by a fundamental matrix. The middles of the wand give a first one, as near as perspective leaves
them in the middle; it says of each moment which way round the balls fit better, these give a better matrix, and so on.
Where both ways fit, as the wand lies along the epipolar lines, other cameras decide, or the moment is left out.
"""

from itertools import combinations

import numpy as np

from skelgen.capture.images import opencv
from skelgen.model.arrays import Bools, Floats

ROUNDS = 4
"""From the middles to the balls: three change nothing more."""

CLEARER = 3.0
"""By how much the better way round must fit, in times of the usual misfit and in px."""


def with_equal_ends(seen: Floats, least_shared: int) -> Floats:
    """Return the balls of all images in one order in each frame.

    Parameters
    ----------
    seen : ndarray, shape (n_frames, n_cameras, 2, 2), px
        Where each image shows the two balls, in any order; NaN where it does not.
    least_shared : int
        Frames that two cameras must share to be compared.

    Returns
    -------
    ndarray, shape (n_frames, n_cameras, 2, 2), px
        NaN also where nothing says which ball is which.
    """
    shows = np.asarray(np.isfinite(seen[:, :, 0, 0]))
    n_frames, n_cameras = shows.shape
    evidence = np.zeros((n_frames, n_cameras, n_cameras))
    for one, two in combinations(range(n_cameras), 2):
        both = np.flatnonzero(shows[:, one] & shows[:, two])
        if len(both) >= least_shared:
            evidence[both, one, two] = evidence[both, two, one] = _evidence(seen[both, one], seen[both, two])
    is_turned, is_known = _ways_round(evidence, shows)
    ordered = np.where(is_turned[..., np.newaxis, np.newaxis], seen[:, :, ::-1], seen)
    ordered[~is_known] = np.nan
    return np.asarray(ordered)


def _evidence(one: Floats, two: Floats) -> Floats:
    """How much better both fit the same way round than turned, shape (n,); 0 where that is not clear."""
    cv2 = opencv()
    left, right = one.mean(axis=1), two.mean(axis=1)
    better = np.zeros(len(one))
    for _ in range(ROUNDS):
        matrix, _ = cv2.findFundamentalMat(left, right, cv2.FM_LMEDS)
        if matrix is None or matrix.shape != (3, 3):
            return np.zeros(len(one))
        straight, turned = _misfit(matrix, one, two), _misfit(matrix, one, two[:, ::-1])
        better = turned - straight
        same_way = np.where((better >= 0)[:, np.newaxis, np.newaxis], two, two[:, ::-1])
        left, right = one.reshape(-1, 2), same_way.reshape(-1, 2)
    usual = max(float(np.median(np.minimum(straight, turned))), 1.0)
    return np.where(np.abs(better) >= CLEARER * usual, better, 0.0)


def _misfit(matrix: Floats, one: Floats, two: Floats) -> Floats:
    """How far two balls lie from their epipolar lines, both together, shape (n,), px."""
    a = np.concatenate([one, np.ones((*one.shape[:2], 1))], axis=2)
    b = np.concatenate([two, np.ones((*two.shape[:2], 1))], axis=2)
    ahead, back = a @ matrix.T, b @ matrix
    off = np.abs((b * ahead).sum(axis=2))
    across = np.hypot(ahead[..., 0], ahead[..., 1]), np.hypot(back[..., 0], back[..., 1])
    return np.asarray((off / np.maximum(np.minimum(*across), 1e-12)).sum(axis=1))


def _ways_round(evidence: Floats, shows: Bools) -> tuple[Bools, Bools]:
    """Which balls are to be exchanged, and where that is certain, shapes (n_frames, n_cameras): clearest first."""
    n_frames, n_cameras = shows.shape
    is_turned, is_known = np.zeros_like(shows), np.zeros_like(shows)
    strength, frames = np.abs(evidence), np.arange(n_frames)
    is_known[frames, strength.max(axis=2).argmax(axis=1)] = strength.max(axis=(1, 2)) > 0
    for _ in range(n_cameras - 1):
        open_ends = np.where(is_known[:, :, np.newaxis] & ~is_known[:, np.newaxis], strength, 0.0)
        best = open_ends.reshape(n_frames, -1).argmax(axis=1)
        known, new = best // n_cameras, best % n_cameras
        there = frames[open_ends[frames, known, new] > 0]
        known, new = known[there], new[there]
        is_turned[there, new] = is_turned[there, known] ^ (evidence[there, known, new] < 0)
        is_known[there, new] = True
    return is_turned, is_known & shows
