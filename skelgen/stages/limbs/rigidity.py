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

import numpy as np

from skelgen.model.arrays import Floats, Ints
from skelgen.stages.limbs.parameters import LimbParameters

PRIOR_WEIGHT = 3.0
"""Degrees of freedom with which the take's noise steadies the noise estimate of a small group."""

NEAREST = 2
"""The noise of a take is the median deviation to this many nearest neighbours: a limb has three markers, mostly."""

FEW_FREEDOMS = 3
"""Merged groups with no more residual freedoms (up to three markers) cannot tell noise from motion by themselves."""

TINY_VARIANCE = 1e-12
"""mm^2, keeps logarithms finite for markers that are copies of each other."""


def noise_variance(deviation: Floats) -> float:
    """Estimate the variance [mm^2] of one coordinate's noise from the most rigid neighbours of each marker.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    """
    others = deviation**2 / 2 + np.diag(np.full(len(deviation), np.inf))
    nearest = np.sort(others, axis=1)[:, : min(NEAREST, len(others) - 1)]
    return max(float(np.median(nearest.mean(axis=1))), TINY_VARIANCE)


def rigid_groups(deviation: Floats, parameters: LimbParameters, n_groups: int | None = None) -> Ints:
    """Group markers that move as rigid bodies.

    Parameters
    ----------
    deviation : ndarray, shape (n_markers, n_markers), mm
        Complete standard deviations of distances.
    parameters : LimbParameters
        Their `motion_factor` (c) and `pair_limit`.
    n_groups : int, optional
        Merge until this many are left, the cheapest pair first, instead of asking the criterion.

    Returns
    -------
    ndarray of intp, shape (n_markers,)
        Group of each marker.
    """
    variance = deviation**2 / 2
    noise = noise_variance(deviation)
    members = np.arange(len(variance))
    sizes = np.ones(len(variance))
    sums = variance.copy()
    while len(sizes) > (n_groups or 1):
        cost, across = _merge_costs(sums, sizes, noise, parameters)
        order = cost if n_groups else np.where(cost < 0, across, np.inf)
        first, second = np.unravel_index(np.argmin(order), order.shape)
        if not np.isfinite(order[first, second]):
            break
        sums, sizes = _merged(sums, sizes, int(first), int(second))
        members = np.where(members == second, first, members)
        members = members - (members > second)
    return members.astype(np.intp)


def _merge_costs(sums: Floats, sizes: Floats, noise: float, parameters: LimbParameters) -> tuple[Floats, Floats]:
    """Cost of merging each two groups [nats per frame], and the mean variance across; infinite below the diagonal."""
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
    cost = np.where(loose, np.abs(cost) + across / noise, cost)
    lower = np.tri(len(sizes), dtype=bool)
    return np.where(lower, np.inf, cost / 2), np.where(lower, np.inf, across)


def _group_variance(sums: Floats, sizes: Floats, noise: float) -> Floats:
    freedoms = _freedoms(sizes)
    mean = sums / np.maximum(sizes * (sizes - 1), 1)
    return np.asarray((PRIOR_WEIGHT * noise + freedoms * mean) / (PRIOR_WEIGHT + freedoms))


def _freedoms(sizes: Floats) -> Floats:
    return 3 * sizes - _pose_size(sizes)


def _pose_size(sizes: Floats) -> Floats:
    return np.where(sizes >= 3, 6.0, np.where(sizes == 2, 5.0, 3.0))


def _merged(sums: Floats, sizes: Floats, first: int, second: int) -> tuple[Floats, Floats]:
    """Fold group `second` into `first`; the diagonal of `sums` holds ordered pairs within a group."""
    sums = sums.copy()
    inner = sums[first, first] + sums[second, second] + 2 * sums[first, second]
    sums[first] += sums[second]
    sums[:, first] = sums[first]
    sums[first, first] = inner
    keep = np.arange(len(sizes)) != second
    sizes = sizes.copy()
    sizes[first] += sizes[second]
    return sums[np.ix_(keep, keep)], sizes[keep]
