r"""Merge markers into rigid limbs for as long as one rigid body explains two groups better than two bodies do.

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

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.limbs.parameters import LimbParameters

PRIOR_WEIGHT = 3.0
"""Degrees of freedom with which the take's noise steadies the noise estimate of a small group."""

SINGLE_PART = 1 / 3
"""A limb of one marker is rare: a marker left alone joins the limb against which it moves least, if it moves less than
this part of what neighbouring limbs usually do. Skin moves markers that are no part of a rigid plate."""

FEW_FREEDOMS = 3
"""Merged groups with no more residual freedoms (up to three markers) cannot tell noise from motion by themselves."""

TINY_VARIANCE = 1e-12
"""mm^2, keeps logarithms finite for markers that are copies of each other."""


def noise_variance(deviation: Floats) -> float:
    """Estimate the variance [mm^2] of one coordinate's noise: the median over markers of the most rigid neighbour.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    """
    others = deviation**2 / 2 + np.diag(np.full(len(deviation), np.inf))
    return max(float(np.median(others.min(axis=1))), TINY_VARIANCE)


def rigid_groups(deviation: Floats, parameters: LimbParameters) -> Ints:
    """Group markers that move as rigid bodies.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    parameters : LimbParameters
        Their `motion_factor` (c) and `pair_limit`.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        Group of each marker.
    """
    groups = _Groups(deviation**2 / 2)
    noise = noise_variance(deviation)
    groups.merge_while(lambda: _merge_order(groups, noise, parameters))
    usual = groups.usual_motion()
    groups.merge_while(lambda: _single_order(groups, usual))
    return groups.members.astype(np.intp)


class _Groups:
    """Groups of markers while they are merged: sums of pair variances between and (diagonal, ordered pairs) within."""

    def __init__(self, variance: Floats) -> None:
        self.sums = variance.copy()
        self.sizes = np.ones(len(variance))
        self.members = np.arange(len(variance))

    @property
    def across(self) -> Floats:
        """Mean variance [mm^2] across each two groups; infinite on and below the diagonal."""
        mean = self.sums / (self.sizes[:, np.newaxis] * self.sizes)
        return np.where(np.tri(len(self.sizes), dtype=bool), np.inf, mean)

    def usual_motion(self) -> float:
        """Median over limbs with several markers of the variance [mm^2] against their nearest neighbour."""
        several = self.sizes > 1
        if several.sum() < 2:
            return 0.0
        upper = self.across[np.ix_(several, several)]
        return float(np.median(np.minimum(upper, upper.T).min(axis=1)))

    def merge_while(self, order: Callable[[], Floats]) -> None:
        """Merge the pair with the smallest order, again and again, until none is finite."""
        while len(self.sizes) > 1:
            ranks = order()
            first, second = np.unravel_index(np.argmin(ranks), ranks.shape)
            if not np.isfinite(ranks[first, second]):
                break
            self._fold(int(first), int(second))

    def _fold(self, first: int, second: int) -> None:
        inner = self.sums[first, first] + self.sums[second, second] + 2 * self.sums[first, second]
        self.sums[first] += self.sums[second]
        self.sums[:, first] = self.sums[first]
        self.sums[first, first] = inner
        self.sizes[first] += self.sizes[second]
        keep = np.arange(len(self.sizes)) != second
        self.sums, self.sizes = self.sums[np.ix_(keep, keep)], self.sizes[keep]
        self.members = np.where(self.members == second, first, self.members)
        self.members = self.members - (self.members > second)


def _merge_order(groups: _Groups, noise: float, parameters: LimbParameters) -> Floats:
    """Mean variance across each two groups that pay to be merged; infinite for the others and below the diagonal."""
    return np.where(_merge_costs(groups.sums, groups.sizes, noise, parameters) < 0, groups.across, np.inf)


def _single_order(groups: _Groups, usual: float) -> Floats:
    """Mean variance across each single marker and a limb that it hardly moves against; infinite for other pairs."""
    single = groups.sizes == 1
    joins = (single[:, np.newaxis] ^ single) & (groups.across < SINGLE_PART**2 * usual)
    return np.where(joins, groups.across, np.inf)


def _merge_costs(sums: Floats, sizes: Floats, noise: float, parameters: LimbParameters) -> Floats:
    """Cost of merging each two groups [nats per frame]."""
    inner = np.diag(sums)
    freedoms, poses = _freedoms(sizes), _pose_size(sizes)
    both = sizes[:, np.newaxis] + sizes
    across = sums / (sizes[:, np.newaxis] * sizes)
    merged_inner = inner[:, np.newaxis] + inner + 2 * sums
    relative = poses[:, np.newaxis] + poses - _pose_size(both)
    alone = freedoms * np.log(_group_variance(inner, sizes, noise))
    cost = _freedoms(both) * np.log(_group_variance(merged_inner, both, noise))
    cost -= alone[:, np.newaxis] + alone
    cost -= relative * np.log(parameters.motion_factor**2 * np.maximum(across, noise))
    loose = (_freedoms(both) <= FEW_FREEDOMS) & (across > parameters.pair_limit**2 * noise)
    cost = np.where(loose, np.abs(cost), cost)
    return np.asarray(cost / 2)


def _group_variance(sums: Floats, sizes: Floats, noise: float) -> Floats:
    freedoms = _freedoms(sizes)
    mean = sums / np.maximum(sizes * (sizes - 1), 1)
    return np.asarray((PRIOR_WEIGHT * noise + freedoms * mean) / (PRIOR_WEIGHT + freedoms))


def _freedoms(sizes: Floats) -> Floats:
    return 3 * sizes - _pose_size(sizes)


def _pose_size(sizes: Floats) -> Floats:
    return np.where(sizes >= 3, 6.0, np.where(sizes == 2, 5.0, 3.0))
