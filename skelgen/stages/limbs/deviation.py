"""How much the distance between each two markers varies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from skelgen.compiling import loops
from skelgen.model.arrays import Bools, Floats, Ints
from skelgen.stages.limbs.parameters import LimbParameters

CHUNK_FLOATS = 4_000_000
"""Coordinates held at once: 32 MB."""

MIN_COMMON_SAMPLES = 8
"""Fewer sampled frames with both markers say nothing about rigidity; other frames are then asked."""


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


@dataclass(frozen=True, eq=False)
class Deviations:
    """How much the distance between each two markers varies.

    Attributes
    ----------
    plain : ndarray, shape (n_markers, n_markers), mm
        Standard deviation; symmetric, zero on the diagonal, NaN for pairs that share fewer than two frames.
    steady : ndarray, shape (n_markers, n_markers), mm
        The same without the few distances that are far from all others, as wrong labels make them.
    common : ndarray of intp, shape (n_markers, n_markers)
        Frames that they rest on, in the density of the samples.
    """

    plain: Floats
    steady: Floats
    common: Ints

    def of(self, markers: Ints) -> Deviations:
        """Return those between some of the markers."""
        block = np.ix_(markers, markers)
        return Deviations(self.plain[block], self.steady[block], self.common[block])


def distance_deviations(positions: Floats, frames: Ints) -> Deviations:
    """Return how much each distance varies over the sampled frames.

    Parameters
    ----------
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        NaN where unseen.
    frames : ndarray of intp
        Sampled frames. Pairs that fewer than `MIN_COMMON_SAMPLES` of them show are computed over other frames that
        do, as many as there are samples.
    """
    plain, steady, common = _deviations(positions[frames])
    rare = (common < MIN_COMMON_SAMPLES) & ~np.eye(len(common), dtype=bool) & (len(frames) < len(positions))
    others = _frames_with_both(positions, rare, len(frames))
    if len(others):
        markers = np.flatnonzero(rare.any(axis=1))
        block = np.ix_(markers, markers)
        over_others = _deviations(positions[np.ix_(others, markers)])
        for table, found in ((plain, over_others[0]), (steady, over_others[1])):
            table[block] = np.where(rare[block], found, table[block])
    return Deviations(plain, steady, common)


def _frames_with_both(positions: Floats, pairs: Bools, most: int) -> Ints:
    """Frames that show both markers of some pairs, at most so many for each, evenly."""
    if not pairs.any():
        return np.zeros(0, dtype=np.intp)
    seen = np.ascontiguousarray(~np.isnan(positions[:, :, 0]).T)
    found = []
    for first, second in np.argwhere(np.triu(pairs)):
        both = np.flatnonzero(seen[first] & seen[second])
        found.append(both[np.unique(np.linspace(0, len(both) - 1, min(most, len(both))).astype(np.intp))])
    return np.unique(np.concatenate(found))


def _deviations(positions: Floats) -> tuple[Floats, Floats, Ints]:
    n_frames, n_markers = positions.shape[:2]
    fast = loops(f"{__package__}.compiled_pair_sums", f"{__package__}.pair_sums")
    sums, steady_sums = np.zeros((2, 3, n_markers, n_markers))
    shift = np.full((n_markers, n_markers), np.nan)
    step = max(1, CHUNK_FLOATS // max(1, 3 * n_markers))
    for start in range(0, n_frames, step):
        plain, steady = fast.pair_sums(positions[start : start + step], shift)
        sums += plain
        steady_sums += steady
    plain, steady = (_standard_deviation(*table) for table in (sums, steady_sums))
    return plain, steady, (sums[0] + sums[0].T).astype(np.intp)


def _standard_deviation(count: Floats, total: Floats, squares: Floats) -> Floats:
    """Symmetric deviations from sums above the diagonal; NaN where fewer than two values were summed."""
    count, total, squares = (table + table.T for table in (count, total, squares))
    with np.errstate(invalid="ignore", divide="ignore"):
        variance = squares / count - (total / count) ** 2
    variance[count < 2] = np.nan
    np.fill_diagonal(variance, 0.0)
    return np.sqrt(np.maximum(variance, 0.0))
