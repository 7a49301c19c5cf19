"""Find measured positions that cannot belong to their marker: label errors and reflections far off the limb.

A limb whose parents are placed can reach only a sphere around its joint: a position that is much nearer to the joint or
farther from it than the marker's place on the limb is an error, whatever the limb's rotation. Where the limb is posed,
its markers must also be near their places. "Much" is counted in typical deviations of the take, so that soft tissue
passes.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.robust import SIGMA_OF_MEDIAN
from skelgen.kinematics.chain import Chain, ChainPoses
from skelgen.model.arrays import Bools, Floats

LEAST_PART = 0.02
"""Of the markers' typical distance from the joint: less than this is no gross error, however exact the take."""


def out_of_reach(chain: Chain, poses: ChainPoses, posed: Bools, positions: Floats, factor: float) -> Bools:
    """Tell which positions no rotation of their limb explains.

    Parameters
    ----------
    chain : Chain
        The limbs.
    poses : ChainPoses
        Poses from the root outward.
    posed : ndarray of bool, shape (n_frames, n_limbs)
        Whether a rotation rests on points of the frame.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    factor : float
        Deviations beyond this many typical ones are outliers.

    Returns
    -------
    ndarray of bool, shape (n_frames, n_markers)
    """
    limb = chain.limb_of_marker
    origins = poses.origins(chain)[:, limb]
    radius = np.linalg.norm(chain.offsets, axis=1)
    off_sphere = np.abs(np.linalg.norm(positions - origins, axis=2) - radius)
    counts = _parents_posed(chain, posed)[:, limb] & (chain.parents[limb] >= 0)
    return _beyond(off_sphere, counts, factor, _least(chain))


def out_of_place(chain: Chain, poses: ChainPoses, posed: Bools, positions: Floats, factor: float) -> Bools:
    """Tell which positions are far off their place on a posed limb, only the worst of each limb in each frame.

    One wrong position pulls the limb off the others: they are judged when it is gone. Parameters and result are those
    of `out_of_reach`.
    """
    limb = chain.limb_of_marker
    off_place = np.linalg.norm(positions - poses.markers(chain), axis=2)
    counts = (_parents_posed(chain, posed) & posed)[:, limb]
    far = _beyond(off_place, counts, factor, _least(chain))
    known = np.where(np.isnan(off_place), -np.inf, off_place)
    for one in range(chain.n_limbs):
        own = np.flatnonzero(limb == one)
        far[:, own] &= known[:, own] == known[:, own].max(axis=1, keepdims=True)
    return far


def _least(chain: Chain) -> float:
    return LEAST_PART * float(np.sqrt((chain.offsets**2).sum(axis=1).mean()))


def _parents_posed(chain: Chain, posed: Bools) -> Bools:
    """Whether all limbs from the root to a limb's parent are posed, shape (n_frames, n_limbs)."""
    placed = np.ones_like(posed)
    for limb in range(1, chain.n_limbs):
        parent = chain.parents[limb]
        placed[:, limb] = placed[:, parent] & posed[:, parent]
    return placed


def _beyond(deviation: Floats, counts: Bools, factor: float, limit: float) -> Bools:
    """Deviations beyond `factor` typical ones of their marker, or of all markers where those are larger."""
    known = np.where(counts & ~np.isnan(deviation), deviation, np.nan)
    heard = ~np.isnan(known).all(axis=0)
    if not heard.any():
        return np.zeros(deviation.shape, dtype=bool)
    typical = np.zeros(deviation.shape[1])
    typical[heard] = np.nanmedian(known[:, heard], axis=0) * SIGMA_OF_MEDIAN
    typical = np.maximum(typical, np.median(typical[heard]))
    return np.nan_to_num(known) > np.maximum(factor * typical, limit)
