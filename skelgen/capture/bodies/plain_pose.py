r"""The pose of a matched target with its covariance, in NumPy: the twin that the compiled one is tested against.

From Umeyama's closed form on, Gauss-Newton steps minimise

.. math::
    \sum_i r_i^T (\Sigma_i + R V_i R^T)^{-1} r_i, \qquad r_i = y_i - R x_i - t,

with the covariance of each triangulated point, which is long in depth, and of each calibrated ball. The inverse of the
normal matrix is the covariance of the pose: of a small turn about the world's axes and a shift.

Each ball must fit, and all of them together: a wrong matching may leave no ball far off, but hardly all of them near.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from skelgen.capture.bodies.tables import Rules, Scene, TargetTable
from skelgen.geometry.orientation import fit_transform, rotation_by_svd
from skelgen.geometry.rotations import cross_matrix, matrix_from_vector
from skelgen.model.arrays import Bools, Floats, Ints

EXACT = 1e-6
"""mm; what at least is taken as the standard deviation of a point, so that exact ones can be weighed."""
MAX_STEPS = 10
STEP_TOLERANCE = 1e-10
"""rad and mm; steps below change nothing that anyone could measure."""


class Settled(NamedTuple):
    """A target that was found: its pose, its covariance, which point is which ball, and what is left over.

    `rms` [mm] is that of the distances, `misfit` the sum of their squares in deviations.
    """

    pose: Floats
    covariance: Floats
    matched: Ints
    rms: float
    misfit: float
    is_sound: bool


def settle(target: TargetTable, scene: Scene, matched: Ints, free: Bools, rules: Rules) -> Settled:
    """Fit the pose of a matched target, drop balls that do not belong to it and take up those that do.

    Parameters
    ----------
    target : TargetTable
        k balls.
    scene : Scene
        n points.
    matched : ndarray of intp, shape (k,)
        From the search.
    free : ndarray of bool, shape (n,)
        Points that may be taken up.
    rules : Rules
        See `BodyParameters`.

    Returns
    -------
    Settled
        Not sound if fewer balls than needed are within the gate.
    """
    matched = matched.copy()
    pose, covariance = fit_pose(target, scene, matched)
    while True:
        deviations = np.where(matched >= 0, _deviations(target, scene, matched, pose, rules), 0.0)
        n_matched = int((matched >= 0).sum())
        if deviations.max() <= rules.gate and (deviations**2).sum() <= fit_limit(3 * n_matched - 6, rules.gate):
            break
        if n_matched <= rules.min_points:
            return Settled(pose, covariance, matched, np.inf, np.inf, False)
        matched[deviations.argmax()] = -1
        pose, covariance = fit_pose(target, scene, matched)
    if _take_up(target, scene, matched, free, rules, pose, covariance):
        pose, covariance = fit_pose(target, scene, matched)
    seen = matched >= 0
    left_over = scene.points[matched[seen]] - target.points[seen] @ pose[:3, :3].T - pose[:3, 3]
    rms = float(np.sqrt((left_over**2).sum(axis=1).mean()))
    misfit = float((_deviations(target, scene, matched, pose, rules)[seen] ** 2).sum())
    return Settled(pose, covariance, matched, rms, misfit, rms <= rules.max_distance)


def fit_limit(n_free: int, gate: float) -> float:
    """Return the sum of squared deviations that a right fit exceeds as rarely as a normal variable exceeds a gate.

    The chi-squared distribution's quantile, by Wilson and Hilferty's cube (1931).

    Parameters
    ----------
    n_free : int
        Degrees of freedom, above 0.
    gate : float
        In standard deviations.
    """
    spread = 2.0 / (9.0 * n_free)
    return float(n_free * (1.0 - spread + gate * spread**0.5) ** 3)


def fit_pose(target: TargetTable, scene: Scene, matched: Ints) -> tuple[Floats, Floats]:
    """Return the most likely pose, shape (4, 4), and its covariance, shape (6, 6)."""
    seen = matched >= 0
    balls, points = target.points[seen], scene.points[matched[seen]]
    pose = fit_transform(balls, points, np.ones(len(balls), dtype=bool), rotation_by_svd)
    for _ in range(MAX_STEPS):
        arms = balls @ pose[:3, :3].T
        weights = np.linalg.inv(_ball_covariances(target, scene, matched, pose)[seen])
        slopes = np.concatenate([-cross_matrix(arms), np.tile(np.eye(3), (len(arms), 1, 1))], axis=2)
        normal = np.einsum("nai,nab,nbj->ij", slopes, weights, slopes)
        covariance = np.linalg.inv(normal)
        step = covariance @ np.einsum("nai,nab,nb->i", slopes, weights, points - arms - pose[:3, 3])
        pose[:3, :3] = matrix_from_vector(step[:3]) @ pose[:3, :3]
        pose[:3, 3] += step[3:]
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    return pose, covariance


def _ball_covariances(target: TargetTable, scene: Scene, matched: Ints, pose: Floats) -> Floats:
    """Of every ball's residual, shape (k, 3, 3); those of unseen balls mean nothing."""
    turn = pose[:3, :3]
    own = np.einsum("ia,ka,ja->kij", turn, target.variances, turn)
    return np.asarray(scene.covariances[matched] + own + EXACT**2 * np.eye(3))


def _deviations(target: TargetTable, scene: Scene, matched: Ints, pose: Floats, rules: Rules) -> Floats:
    """Distance of every ball from its point in standard deviations, the floor added."""
    spread = _ball_covariances(target, scene, matched, pose) + rules.floor**2 * np.eye(3)
    away = scene.points[matched] - target.points @ pose[:3, :3].T - pose[:3, 3]
    return np.asarray(np.sqrt(np.einsum("ki,kij,kj->k", away, np.linalg.inv(spread), away)))


def _take_up(
    target: TargetTable, scene: Scene, matched: Ints, free: Bools, rules: Rules, pose: Floats, covariance: Floats
) -> bool:
    """Match unseen balls to free points where the pose expects them; return whether there was any."""
    taken = False
    for ball in np.flatnonzero(matched < 0):
        arm = pose[:3, :3] @ target.points[ball]
        slope = np.concatenate([-cross_matrix(arm), np.eye(3)], axis=1)
        expected = slope @ covariance @ slope.T + rules.floor**2 * np.eye(3)
        best, least = -1, rules.gate
        for point in np.flatnonzero(free):
            used = matched[matched >= 0]
            if np.isinf(scene.spans[used, point]).any():
                continue
            one = np.full_like(matched, point)
            spread = _ball_covariances(target, scene, one, pose)[ball] + expected
            away = scene.points[point] - arm - pose[:3, 3]
            deviation = np.sqrt(away @ np.linalg.solve(spread, away))
            if deviation <= least and np.linalg.norm(away) <= rules.max_distance:
                best, least = int(point), float(deviation)
        if best >= 0:
            matched[ball] = best
            taken = True
    return taken
