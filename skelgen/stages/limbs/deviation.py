"""How much the distance between each two markers varies."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.parameters import LimbParameters

CHUNK_FLOATS = 4_000_000
"""Coordinates held at once: 32 MB."""

MIN_COMMON_SAMPLES = 8
"""Fewer sampled frames with both markers say nothing about rigidity; all frames are then asked."""


def sample_frames(n_frames: int, parameters: LimbParameters, seed: int | tuple[int, ...]) -> Ints:
    """Choose frames at regular steps with jitter, so that periodic motion cannot hide (Kirk et al. 2005).

    Parameters
    ----------
    n_frames : int
        Frames in the take.
    parameters : LimbParameters
        Their `sampling`, `samples` and `jitter`.
    seed : int or tuple of int
        Seed of the jitter.

    Returns
    -------
    ndarray of intp
        Rising frame indices, without repetition.
    """
    step = parameters.sampling or max(1.0, n_frames / parameters.samples)
    grid = np.arange(0, n_frames, step, dtype=np.float64)
    if step > 1:
        grid = grid + np.random.default_rng(seed).uniform(-0.5, 0.5, len(grid)) * parameters.jitter * step
    return np.unique(np.clip(np.rint(grid), 0, n_frames - 1).astype(np.intp))


def distance_deviation(positions: Floats, frames: Ints) -> tuple[Floats, Ints]:
    """Return the standard deviation of each pairwise distance over the sampled frames, and how many show the pair.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    frames : ndarray of intp
        Sampled frames. Pairs that fewer than `MIN_COMMON_SAMPLES` of them show are computed over all frames.

    Returns
    -------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Symmetric, zero on the diagonal; NaN for pairs that share fewer than two frames.
    common : ndarray of intp, shape (n_markers, n_markers)
        Frames that the deviation rests on, in the density of the samples.
    """
    deviation, common = _deviation(positions[frames])
    rare = (common < MIN_COMMON_SAMPLES) & (len(frames) < len(positions))
    markers = np.flatnonzero(rare.any(axis=1))
    if len(markers):
        over_all, _ = _deviation(positions[:, markers])
        block = np.ix_(markers, markers)
        deviation[block] = np.where(rare[block], over_all, deviation[block])
    return deviation, common


def _deviation(positions: Floats) -> tuple[Floats, Ints]:
    n_frames, n_markers = positions.shape[:2]
    seen: Bools = ~np.isnan(positions[:, :, 0])
    common = seen.T.astype(np.float64) @ seen.astype(np.float64)
    total, squares, shift = np.zeros((3, n_markers, n_markers))
    step = max(1, CHUNK_FLOATS // max(1, 3 * n_markers))
    for start in range(0, n_frames, step):
        shown = np.ascontiguousarray(seen[start : start + step].T)
        places = np.ascontiguousarray(np.moveaxis(positions[start : start + step], 0, 2).swapaxes(0, 1))
        places[:, ~shown] = 0.0
        for marker in range(n_markers - 1):
            later = slice(marker + 1, None)
            both = shown[later] & shown[marker]
            distance = np.sqrt(((places[:, later] - places[:, marker : marker + 1]) ** 2).sum(axis=0))
            if start == 0:
                shift[marker, later] = distance[np.arange(len(both)), both.argmax(axis=1)]
            distance = (distance - shift[marker, later, np.newaxis]) * both
            total[marker, later] += distance.sum(axis=1)
            squares[marker, later] += np.einsum("mf,mf->m", distance, distance)
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = (squares + squares.T) / common - ((total + total.T) / common) ** 2
    variance[common < 2] = np.nan
    np.fill_diagonal(variance, 0.0)
    return np.sqrt(np.maximum(variance, 0.0)), common.astype(np.intp)
