r"""How much distances between markers vary, and rigid limbs found by these variances alone.

A group of n markers with 3 n coordinates and p pose parameters in each frame leaves d = 3 n - p of them to noise
(p = 3, 5, 6 for one, two, more markers). Describing two groups by one body costs, in nats per frame,

.. math::
    \Delta = d_{ab} \log\sigma_{ab} - d_a \log\sigma_a - d_b \log\sigma_b - (p_a + p_b - p_{ab}) \log(c\,\sigma_\times)

with the noise :math:`\sigma` of a group from the deviations of its inner distances, :math:`\sigma_\times` from the
distances across, and c times :math:`\sigma_\times` as the width of the prior of the relative motion. Groups with a
negative cost are merged, the pair with the smallest deviation across first, until none is left. The criterion is
scale-free: it needs no threshold in millimetres, neither for a rigid plate nor for soft tissue.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from skelgen._kernels.distance_statistics import pair_sums
from skelgen.model.arrays import Bools, Floats, Ints, evenly_spread
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
    least = max(1.0, n_frames / MIN_COMMON_SAMPLES)  # a step across the take would leave nothing to compare
    spread = max(1.0, n_frames / parameters.samples)
    step = spread if parameters.sampling < 0 else min(max(parameters.sampling, 1), least)
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

    def between(self, groups: Ints) -> PairSums:
        """Return the sums of what varies within groups of markers, and between them; each known pair counts as one.

        Parameters
        ----------
        groups : ndarray of intp, shape (n_markers,)
            Group of each marker.
        """
        known = ~np.isnan(self.steady)
        return PairSums(np.where(known, self.steady, 0.0) ** 2 / 2, known.astype(np.float64), groups)


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
        found.append(evenly_spread(both, most))
    return np.unique(np.concatenate(found))


def _deviations(positions: Floats) -> tuple[Floats, Floats, Ints]:
    n_frames, n_markers = positions.shape[:2]
    sums, steady_sums = np.zeros((2, 3, n_markers, n_markers))
    shift = np.full((n_markers, n_markers), np.nan)
    step = max(1, CHUNK_FLOATS // max(1, 3 * n_markers))
    for start in range(0, n_frames, step):
        plain, steady = pair_sums(positions[start : start + step], shift)
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


PRIOR_WEIGHT = 3.0
"""Degrees of freedom with which the take's noise steadies the noise estimate of a small group."""

SINGLE_PART = 1 / 3
"""A limb of one marker is rare: a marker left alone joins the limb against which it moves least, if it moves less than
this part of what neighbouring limbs usually do. Skin moves markers that are no part of a rigid plate."""

FEW_FREEDOMS = 3
"""Merged groups with no more residual freedoms (up to three markers) cannot distinguish noise from motion."""

FULL_POSE = 3
"""Markers move only between limbs that have so many without them: then no limb's number of pose parameters changes."""

LEAST_GAIN = 0.25
"""nats per frame; a marker that moves to another limb must gain clearly: what rests for a while fits any limb."""

TINY_VARIANCE = 1e-12
"""mm^2, keeps logarithms finite for markers that are copies of each other."""


def noise_variance(deviation: Floats) -> float:
    """Estimate the variance [mm^2] of one coordinate's noise: the median over markers of the most rigid neighbour.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Standard deviations of distances; NaN or infinite where unknown.
    """
    others = np.where(np.isnan(deviation), np.inf, deviation) ** 2 / 2 + np.diag(np.full(len(deviation), np.inf))
    nearest = others.min(axis=1)
    return max(float(np.median(nearest[np.isfinite(nearest)], axis=0)), TINY_VARIANCE)


def rigid_groups(deviation: Floats, parameters: LimbParameters, weight: Floats | None = None) -> Ints:
    """Group markers that move as rigid bodies.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Standard deviations of distances.
    parameters : LimbParameters
        Their `motion_factor` (c) and `pair_limit`.
    weight : ndarray, shape (n_markers, n_markers), optional
        Weight of each pair, 0 where it is never seen together; all alike by default.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        Group of each marker.
    """
    weight = np.ones_like(deviation) if weight is None else weight
    known = weight > 0
    noise = noise_variance(np.where(known, deviation, np.nan))
    variance = np.where(known, deviation, 0.0) ** 2 / 2
    groups = PairSums(variance, weight)
    groups.merge_while(lambda: np.where(merge_costs(groups, noise, parameters) < 0, groups.across, np.inf))
    groups = PairSums(variance, weight, _moved_to_best(groups.members, variance, weight, noise))
    usual = groups.neighbour_motion()
    groups.merge_while(lambda: single_order(groups, usual))
    return groups.members.astype(np.intp)


class PairSums:
    """Groups of markers while they are merged: sums over pairs of markers, between groups and (diagonal) within."""

    def __init__(self, variance: Floats, weight: Floats, members: Ints | None = None) -> None:
        self.members = np.arange(len(variance)) if members is None else members
        one_hot = np.eye(self.members.max() + 1)[self.members]
        off = ~np.eye(len(variance), dtype=bool)
        self.sums = one_hot.T @ (variance * weight * off) @ one_hot
        self.weights = one_hot.T @ (weight * off) @ one_hot
        self.sizes = one_hot.sum(axis=0)
        self._across: Floats | None = None

    @property
    def across(self) -> Floats:
        """Mean variance [mm^2] across each two groups; infinite on and below the diagonal and where unknown."""
        if self._across is None:
            hidden = np.tri(len(self.sizes), dtype=bool) | (self.weights <= 0)
            self._across = np.where(hidden, np.inf, self.sums / np.where(hidden, 1.0, self.weights))
        return self._across

    def neighbour_motion(self) -> float:
        """Median over limbs with several markers of the variance [mm^2] against their nearest neighbour."""
        several = self.sizes > 1
        if several.sum() < 2:
            return 0.0
        upper = self.across[np.ix_(several, several)]
        nearest = np.minimum(upper, upper.T).min(axis=1)
        return float(np.median(nearest[np.isfinite(nearest)])) if np.isfinite(nearest).any() else 0.0

    def merge_while(self, order: Callable[[], Floats], least: int = 1) -> None:
        """Merge the pair with the smallest order, again and again.

        Parameters
        ----------
        order : callable
            Returns the order of merging, shape (n_groups, n_groups), infinite for pairs that stay apart.
        least : int
            Number of groups at which merging stops.
        """
        while len(self.sizes) > least:
            ranks = order()
            first, second = np.unravel_index(np.argmin(ranks), ranks.shape)
            if not np.isfinite(ranks[first, second]):
                break
            self._fold(int(first), int(second))

    def _fold(self, first: int, second: int) -> None:
        self._across = None
        keep = np.arange(len(self.sizes)) != second
        self.sums = _folded(self.sums, first, second)[np.ix_(keep, keep)]
        self.weights = _folded(self.weights, first, second)[np.ix_(keep, keep)]
        self.sizes[first] += self.sizes[second]
        self.sizes = self.sizes[keep]
        self.members = np.where(self.members == second, first, self.members)
        self.members = self.members - (self.members > second)


def _folded(table: Floats, first: int, second: int) -> Floats:
    inner = table[first, first] + table[second, second] + 2 * table[first, second]
    table = table.copy()
    table[first] += table[second]
    table[:, first] = table[first]
    table[first, first] = inner
    return table


def single_order(groups: PairSums, usual: float) -> Floats:
    """Return the order of merging single markers with limbs that they hardly move against.

    Parameters
    ----------
    groups : PairSums
        The groups.
    usual : float, mm^2
        Usual variance against a neighbouring limb, see `PairSums.neighbour_motion`.

    Returns
    -------
    ndarray, shape (n_groups, n_groups), mm^2
        Mean variance across, infinite for other pairs.
    """
    single = groups.sizes == 1
    joins = (single[:, np.newaxis] ^ single) & (groups.across < SINGLE_PART**2 * usual)
    return np.where(joins, groups.across, np.inf)


def merge_costs(groups: PairSums, noise: float, parameters: LimbParameters) -> Floats:
    """Return the cost of merging each two groups.

    Parameters
    ----------
    groups : PairSums
        The groups.
    noise : float, mm^2
        Variance of the take's noise.
    parameters : LimbParameters
        Their `motion_factor` and `pair_limit`.

    Returns
    -------
    ndarray, shape (n_groups, n_groups), nats per frame
        Only the entries above the diagonal count.
    """
    sums, weights, sizes = groups.sums, groups.weights, groups.sizes
    both = sizes[:, np.newaxis] + sizes
    across = np.where(np.isfinite(groups.across), groups.across, noise)
    alone = _misfit(np.diag(sums), np.diag(weights), sizes, noise)
    together = [np.diag(table)[:, np.newaxis] + np.diag(table) + 2 * table for table in (sums, weights)]
    relative = _pose_size(sizes)[:, np.newaxis] + _pose_size(sizes) - _pose_size(both)
    cost = _misfit(together[0], together[1], both, noise) - alone[:, np.newaxis] - alone
    cost -= relative * np.log(parameters.motion_factor**2 * np.maximum(across, noise)) / 2
    loose = (_freedoms(both) <= FEW_FREEDOMS) & (across > parameters.pair_limit**2 * noise)
    return np.where(loose, np.abs(cost), cost)


def _moved_to_best(members: Ints, variance: Floats, weight: Floats, noise: float) -> Ints:
    """Move markers, one at a time and the most profitable first, to the group that describes all groups best."""
    members = members.copy()
    off = ~np.eye(len(members), dtype=bool)
    for _ in range(len(members)):
        one_hot = np.eye(members.max() + 1)[members]
        to_group = [(table * off) @ one_hot for table in (variance * weight, weight)]
        inner = [np.einsum("mg,mg->g", one_hot, table) for table in to_group]
        sizes = one_hot.sum(axis=0)
        now = _misfit(inner[0], inner[1], sizes, noise)
        with_it = _misfit(inner[0] + 2 * to_group[0], inner[1] + 2 * to_group[1], sizes + 1, noise) - now
        own = np.arange(len(members)), members
        left = [total[members] - 2 * table[own] for total, table in zip(inner, to_group, strict=True)]
        without = _misfit(left[0], left[1], sizes[members] - 1, noise) - now[members]
        gain = with_it + without[:, np.newaxis]
        gain[own] = 0.0
        full = (sizes[members] > FULL_POSE)[:, np.newaxis] & (sizes >= FULL_POSE)
        gain[~full | (to_group[1] <= 0)] = 0.0
        marker, group = np.unravel_index(np.argmin(gain), gain.shape)
        if gain[marker, group] > -LEAST_GAIN:
            break
        members[marker] = group
    return members.astype(np.intp)


def _misfit(sums: Floats, weights: Floats, sizes: Floats, noise: float) -> Floats:
    """Cost of a group's inner deviations [nats per frame]; `sums` and `weights` run over ordered pairs."""
    freedoms = np.maximum(_freedoms(sizes), 0.0)
    mean = np.where(weights > 0, sums / np.where(weights > 0, weights, 1.0), noise)
    variance = (PRIOR_WEIGHT * noise + freedoms * np.maximum(mean, 0.0)) / (PRIOR_WEIGHT + freedoms)
    return np.asarray(freedoms * np.log(variance) / 2)


def _freedoms(sizes: Floats) -> Floats:
    return 3 * sizes - _pose_size(sizes)


def _pose_size(sizes: Floats) -> Floats:
    return np.where(sizes >= 3, 6.0, np.where(sizes == 2, 5.0, 3.0))
