r"""How much each marker, and each of its positions, is worth to a fit: soft tissue and outliers count less.

A marker's variance is what its residuals leave, divided by the part of its noise that the fit lets through. Estimates
of few frames scatter: they are drawn to their common mean by as much as chance explains. Single positions that are far
off count by Huber's weights.
"""

from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import cross_matrix
from skelgen.kinematics.articulation import Articulation
from skelgen.kinematics.border import with_ridge
from skelgen.kinematics.chain import Chain, ChainPoses, normal_equations, residuals, seen_weights, world_arms
from skelgen.kinematics.correlated import effective_frames
from skelgen.model.arrays import Floats

FAR = 4.5
"""Standard deviations of a coordinate: of normal residuals one of ten thousand is longer, so that noise alone loses
nothing by Huber's weights."""

LEAST_REDUNDANCY = 0.02
"""A marker whose noise the fit absorbs more than this has no variance of its own to see."""

LEAST_SHARE = 0.1
"""Of the mean variance: a marker that fits better than that does so by chance."""


def redundancy(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats
) -> Floats:
    """Part of each position's noise variance that residuals show, 0 .. 1, shape (n_frames, n_markers)."""
    body_arms = chain.arms()
    hessian, _ = normal_equations(chain, body_arms, poses, positions, weights)
    turns, _ = articulation.bases(chain.parents, poses.rotations)
    own = turns.swapaxes(1, 2) @ hessian @ turns
    inverse = np.linalg.inv(with_ridge(own))
    spread = turns @ inverse @ turns.swapaxes(1, 2)
    n_frames, n_limbs = poses.rotations.shape[:2]
    taken = np.empty(weights.shape)
    for marker in range(chain.n_markers):
        arms = world_arms(body_arms[marker : marker + 1], poses)[:, 0]
        turning = -cross_matrix(arms).transpose(0, 2, 1, 3).reshape(n_frames, 3, 3 * n_limbs)
        slope = np.concatenate([np.broadcast_to(np.eye(3), (n_frames, 3, 3)), turning], axis=2)
        taken[:, marker] = np.einsum("fip,fpi->f", slope @ spread, slope.swapaxes(1, 2)) / 3
    return np.clip(1 - taken * weights, 0.0, 1.0)


def marker_weights(
    chain: Chain, articulation: Articulation, poses: ChainPoses, positions: Floats, weights: Floats | None = None
) -> Floats:
    """Return what each marker is worth, 1 on average, shape (n_markers,).

    Parameters
    ----------
    chain, articulation, poses
        A calibrated chain, and where it is.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers), optional
        That were used.
    """
    weights = seen_weights(positions, weights)
    left = redundancy(chain, articulation, poses, positions, weights) * (weights > 0)
    error = residuals(chain, poses, positions)
    shown = left.sum(axis=0)
    squares = np.einsum("fmi,fm->m", error**2, (weights > 0).astype(np.float64)) / 3
    clear = (shown > LEAST_REDUNDANCY * np.maximum((weights > 0).sum(axis=0), 1)) & (squares > 0)
    if clear.sum() < 2:
        return np.ones(chain.n_markers)
    common = squares.sum() / max(shown.sum(), np.finfo(np.float64).tiny)
    variance = np.full(chain.n_markers, common)
    variance[clear] = np.maximum(squares[clear] / shown[clear], LEAST_SHARE * common)
    logs = np.log(variance[clear])
    chance = np.array([2 / _freedoms(error[:, marker], shown[marker]) for marker in np.flatnonzero(clear)])
    between = max(float(logs.var() - chance.mean()), 0.0)
    mean = float(np.average(logs, weights=1 / (between + chance)))
    variance[clear] = np.exp(mean + between / (between + chance) * (logs - mean))
    variance[~clear] = np.exp(mean)
    return np.asarray(1 / variance / (1 / variance).mean())


def _freedoms(error: Floats, shown: float) -> float:
    """Freedoms that a marker's variance rests on: residuals that last tell less."""
    independent = effective_frames(error, of_squares=True) / max(len(error), 1)
    return max(3 * shown * independent, 1.0)


def huber_weights(chain: Chain, poses: ChainPoses, positions: Floats, weights: Floats, noise: float) -> Floats:
    """Return weights of positions, those far off their places made smaller, shape (n_frames, n_markers).

    Parameters
    ----------
    chain, poses
        A fitted chain.
    positions : ndarray, shape (n_frames, n_markers, 3), mm
        Measured markers, NaN where unseen.
    weights : ndarray, shape (n_frames, n_markers)
        Of the markers.
    noise : float, mm
        Standard deviation of a coordinate of weight 1.
    """
    size = np.linalg.norm(residuals(chain, poses, positions), axis=2) * np.sqrt(weights)
    limit = FAR * noise
    return np.asarray(weights * np.where(size > limit, limit / np.maximum(size, np.finfo(np.float64).tiny), 1.0))
