"""How much the distance between each two markers varies."""

from __future__ import annotations

import numpy as np

from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.parameters import LimbParameters

CHUNK_FLOATS = 4_000_000
"""Distances held at once: 32 MB."""

MIN_COMMON_SAMPLES = 8
"""Fewer sampled frames with both markers say nothing about rigidity; all frames are then asked."""


def sample_frames(n_frames: int, parameters: LimbParameters, seed: int) -> Ints:
    """Choose frames at regular steps with jitter, so that periodic motion cannot hide (Kirk et al. 2005).

    Parameters
    ----------
    n_frames : int
        Frames in the take.
    parameters : LimbParameters
        Their `sampling`, `samples` and `jitter`.
    seed : int
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
    n_markers = positions.shape[1]
    seen: Bools = ~np.isnan(positions[:, :, 0])
    filled = np.where(seen[..., np.newaxis], positions, 0.0)
    common = seen.T.astype(np.float64) @ seen.astype(np.float64)
    shift = _first_distance(filled, seen)
    total = np.zeros((n_markers, n_markers))
    squares = np.zeros_like(total)
    step = max(1, CHUNK_FLOATS // max(1, n_markers * n_markers * 3))
    for start in range(0, len(positions), step):
        part, both = filled[start : start + step], seen[start : start + step]
        distance = np.linalg.norm(part[:, :, np.newaxis] - part[:, np.newaxis], axis=3) - shift
        distance *= both[:, :, np.newaxis] & both[:, np.newaxis]
        total += distance.sum(axis=0)
        squares += np.einsum("fij,fij->ij", distance, distance)
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = squares / common - (total / common) ** 2
    variance[common < 2] = np.nan
    np.fill_diagonal(variance, 0.0)
    return np.sqrt(np.maximum(variance, 0.0)), common.astype(np.intp)


def _first_distance(filled: Floats, seen: Bools) -> Floats:
    """A typical distance of each pair: subtracting it keeps the one-pass variance accurate."""
    n_seen = np.maximum(seen.sum(axis=0), 1)[:, np.newaxis]
    centre = filled.sum(axis=0) / n_seen
    first = np.argmax(seen[:, :, np.newaxis] & seen[:, np.newaxis], axis=0)
    index = np.arange(len(centre))
    rows, columns = np.meshgrid(index, index, indexing="ij")
    return np.asarray(np.linalg.norm(filled[first, rows] - filled[first, columns], axis=2))
