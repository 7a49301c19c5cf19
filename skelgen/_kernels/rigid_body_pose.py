r"""The pose of a matched rigid body with its covariance.

From Umeyama's closed form on, Gauss-Newton steps minimise

.. math::
    \sum_i r_i^T (\Sigma_i + R V_i R^T)^{-1} r_i, \qquad r_i = y_i - R x_i - t,

with the covariance of each triangulated point, which is long in depth, and of each calibrated ball. The inverse of the
normal matrix is the covariance of the pose: of a small rotation about the world's axes and a shift.

Each ball must fit, and all of them together: a wrong matching may leave no ball far off, but hardly all of them near.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel, kernel_part
from skelgen._kernels.absolute_orientation import N_ROOM, write_rotations
from skelgen._kernels.least_squares import factorise, solve
from skelgen._kernels.rigid_body_tables import PointTable, PosedBody, SearchRules, TargetTable
from skelgen._kernels.rotations import move_pose
from skelgen._kernels.small_matrices import (
    Symmetric,
    Vector,
    block,
    by_symmetric,
    column,
    cross,
    dot,
    inverse,
    minus,
    turned,
    upper_half,
    vector,
)
from skelgen.model.arrays import Bools, Floats, Ints

EXACT = 1e-6
"""mm; what at least is taken as the standard deviation of a point, so that exact ones can be weighted."""

MAX_STEPS = 10
STEP_TOLERANCE = 1e-10
"""rad and mm; steps below change nothing that anyone could measure."""


@array_kernel
def fit_body(target: TargetTable, scene: PointTable, matched: Ints, free: Bools, rules: SearchRules) -> PosedBody:
    """Fit the pose of a matched body, drop balls that do not belong to it and add those that do.

    Parameters
    ----------
    target : TargetTable
        k balls.
    scene : PointTable
        n points.
    matched : ndarray of intp, shape (k,)
        From the search.
    free : ndarray of bool, shape (n,)
        Points that may be added.
    rules : SearchRules
        Limits.
    """
    matched = matched.copy()
    n_matched = 0
    for ball in range(len(matched)):
        n_matched += matched[ball] >= 0
    pose, covariance = _fit_pose(target, scene, matched)
    while True:
        worst, most, total = -1, 0.0, 0.0
        for ball in range(len(matched)):
            if matched[ball] >= 0:
                squared = _squared_deviation(target, scene, matched[ball], ball, pose, rules.floor)
                total += squared
                if squared > most:
                    worst, most = ball, squared
        if most <= rules.gate**2 and total <= chi_squared_limit(3 * n_matched - 6, rules.gate):
            break
        if n_matched <= rules.min_points:
            return PosedBody(pose, covariance, matched, math.inf, math.inf, False)
        matched[worst] = -1
        n_matched -= 1
        pose, covariance = _fit_pose(target, scene, matched)
    if _add_unseen_balls(target, scene, matched, free, rules, (pose, covariance)):
        pose, covariance = _fit_pose(target, scene, matched)
    total, misfit, n_matched = 0.0, 0.0, 0
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            away = _away(target, scene, matched[ball], ball, pose)
            total += dot(away, away)
            misfit += _squared_deviation(target, scene, matched[ball], ball, pose, rules.floor)
            n_matched += 1
    rms = math.sqrt(total / n_matched)
    return PosedBody(pose, covariance, matched, rms, misfit, rms <= rules.max_distance)


class WeighedPose(NamedTuple):
    """A pose by the noise of its points.

    Attributes
    ----------
    pose : ndarray, shape (4, 4), mm
        World from body.
    covariance : ndarray, shape (6, 6)
        Of a small rotation about the world's axes [rad] and a shift [mm]; larger where the balls are off by more than
        their points' covariances explain, as of balls that are half hidden.
    noise : float
        Root mean square distance of the balls in the standard deviations that this says, the pose's freedoms taken off.
    """

    pose: Floats
    covariance: Floats
    noise: float


LIKELY = 2.0
"""Standard deviations of a normal variable up to which the balls' distances are noise: 98 of 100 poses."""


@array_kernel
def weigh_pose(target: TargetTable, scene: PointTable, matched: Ints) -> WeighedPose:
    """Fit the pose of a matched body once more.

    Parameters
    ----------
    target : TargetTable
        k balls.
    scene : PointTable
        n points.
    matched : ndarray of intp, shape (k,)
        The point that each ball is; -1 where none is, three at least.
    """
    pose, covariance = _fit_pose(target, scene, matched)
    squares, n_matched = 0.0, 0
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            squares += _squared_deviation(target, scene, matched[ball], ball, pose, 0.0)
            n_matched += 1
    n_free = max(3 * n_matched - 6, 1)
    excess = max(1.0, squares / chi_squared_limit(n_free, LIKELY))
    for row in range(6):
        for other in range(6):
            covariance[row, other] *= excess
    return WeighedPose(pose, covariance, math.sqrt(squares / excess / n_free))


@kernel
def chi_squared_limit(n_free: int, gate: float) -> float:
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


@array_part
def _fit_pose(target: TargetTable, scene: PointTable, matched: Ints) -> tuple[Floats, Floats]:
    """Return the most likely pose, shape (4, 4), and its covariance, shape (6, 6)."""
    pose = _first_pose(target.points, scene.points, matched)
    normal, gradient, covariance, step = np.empty((6, 6)), np.empty(6), np.zeros((6, 6)), np.empty(6)
    for _ in range(MAX_STEPS):
        for i in range(6):
            gradient[i] = 0.0
            for j in range(6):
                normal[i, j] = 0.0
        for ball in range(len(matched)):
            if matched[ball] >= 0:
                weight = inverse(_spread(target, scene, matched[ball], ball, pose), EXACT**2)
                away = _away(target, scene, matched[ball], ball, pose)
                _add_ball(normal, gradient, _arm(pose, target.points, ball), weight, away)
        _invert(normal, covariance)
        longest = 0.0
        for i in range(6):
            step[i] = 0.0
            for j in range(6):
                step[i] += covariance[i, j] * gradient[j]
            longest = max(longest, abs(step[i]))
        move_pose(pose, step)
        if longest < STEP_TOLERANCE:
            break
    return pose, covariance


@array_part
def _first_pose(balls: Floats, points: Floats, matched: Ints) -> Floats:
    """Return the best rigid motion in the plain least squares sense (Umeyama 1991)."""
    centre, middle, n = np.zeros(3), np.zeros(3), 0
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            n += 1
            for axis in range(3):
                centre[axis] += balls[ball, axis]
                middle[axis] += points[matched[ball], axis]
    moments, rotations = np.zeros((1, 3, 3)), np.empty((1, 3, 3))
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            for i in range(3):
                for j in range(3):
                    moments[0, i, j] += (points[matched[ball], i] - middle[i] / n) * (balls[ball, j] - centre[j] / n)
    write_rotations(moments, np.empty((N_ROOM, 4, 4)), rotations, np.empty(1, dtype=np.bool_))
    pose = np.eye(4)
    for i in range(3):
        pose[i, 3] = middle[i] / n
        for j in range(3):
            pose[i, j] = rotations[0, i, j]
            pose[i, 3] -= rotations[0, i, j] * centre[j] / n
    return pose


@kernel_part
def _arm(pose: Floats, balls: Floats, ball: int) -> Vector:
    """Return the way [mm] from the body's origin to a ball, in the world."""
    return turned(block(pose, 0, 0), vector(balls, ball, 0))


@kernel_part
def _away(target: TargetTable, scene: PointTable, point: int, ball: int, pose: Floats) -> Vector:
    """Return the way [mm] from a posed ball to a point."""
    return minus(minus(vector(scene.points, point, 0), column(pose, 3)), _arm(pose, target.points, ball))


@kernel_part
def _spread(target: TargetTable, scene: PointTable, point: int, ball: int, pose: Floats) -> Symmetric:
    """Return the covariance [mm^2] of that way."""
    xx, xy, xz, yy, yz, zz = upper_half(block(scene.covariances[point], 0, 0))
    for axis in range(3):
        variance, (x, y, z) = target.variances[ball, axis], column(pose, axis)
        xx, xy, xz = xx + variance * x * x, xy + variance * x * y, xz + variance * x * z
        yy, yz, zz = yy + variance * y * y, yz + variance * y * z, zz + variance * z * z
    return xx, xy, xz, yy, yz, zz


@kernel_part
def _squared_deviation(
    target: TargetTable, scene: PointTable, point: int, ball: int, pose: Floats, floor: float
) -> float:
    """Return the squared distance of a posed ball from a point in standard deviations, a floor [mm] added to them."""
    away = _away(target, scene, point, ball, pose)
    weight = inverse(_spread(target, scene, point, ball, pose), floor**2 + EXACT**2)
    return dot(away, by_symmetric(weight, away))


@kernel_part
def _add_ball(normal: Floats, gradient: Floats, arm: Vector, weight: Symmetric, away: Vector) -> None:
    """Add what one ball says of the pose: how it moves with a small rotation about the world's axes and a shift."""
    force = by_symmetric(weight, away)
    torque = cross(arm, force)
    for axis in range(3):
        gradient[axis] += torque[axis]
        gradient[3 + axis] += force[axis]
    for freedom in range(6):
        force = by_symmetric(weight, _slope(arm, freedom))
        torque = cross(arm, force)
        for axis in range(3):
            normal[axis, freedom] += torque[axis]
            normal[3 + axis, freedom] += force[axis]


@kernel_part
def _slope(arm: Vector, freedom: int) -> Vector:
    """Return how a point of the body moves with one of the pose's six freedoms."""
    x, y, z = arm
    if freedom == 0:
        return 0.0, -z, y
    if freedom == 1:
        return z, 0.0, -x
    if freedom == 2:
        return -y, x, 0.0
    return 1.0 if freedom == 3 else 0.0, 1.0 if freedom == 4 else 0.0, 1.0 if freedom == 5 else 0.0


@kernel_part
def _invert(normal: Floats, inverted: Floats) -> None:
    """Fill the inverse of a positive matrix, which is lost; NaN if it is not positive."""
    is_positive = factorise(normal)
    for i in range(len(normal)):
        for j in range(len(normal)):
            inverted[i, j] = 0.0 if is_positive else math.nan
        inverted[i, i] += 1.0
        solve(normal, inverted[i])


@kernel_part
def _add_unseen_balls(
    target: TargetTable, scene: PointTable, matched: Ints, free: Bools, rules: SearchRules, posed: tuple[Floats, Floats]
) -> bool:
    """Match unseen balls to free points where the pose expects them; return whether there was any."""
    pose, covariance = posed
    is_added = False
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            continue
        expected = _spread_by_pose(_arm(pose, target.points, ball), covariance)
        best, least = -1, rules.gate
        for point in range(len(scene.points)):
            away = _away(target, scene, point, ball, pose)
            if not free[point] or dot(away, away) > rules.max_distance**2 or _is_excluded(point, matched, scene):
                continue
            a, b, c, d, e, f = _spread(target, scene, point, ball, pose)
            k, m, n, o, p, q = expected
            spread = a + k, b + m, c + n, d + o, e + p, f + q
            weight = inverse(spread, rules.floor**2 + EXACT**2)
            deviation = math.sqrt(dot(away, by_symmetric(weight, away)))
            if deviation <= least:
                best, least = point, deviation
        if best >= 0:
            matched[ball] = best
            is_added = True
    return is_added


@kernel_part
def _spread_by_pose(arm: Vector, covariance: Floats) -> Symmetric:
    """Return the covariance [mm^2] that the pose's gives a ball in the world."""
    xx = xy = xz = yy = yz = zz = 0.0
    for i in range(6):
        a, b, c = _slope(arm, i)
        for j in range(6):
            u, v, w = _slope(arm, j)
            u, v, w = covariance[i, j] * u, covariance[i, j] * v, covariance[i, j] * w
            xx, xy, xz, yy, yz, zz = xx + a * u, xy + a * v, xz + a * w, yy + b * v, yz + b * w, zz + c * w
    return xx, xy, xz, yy, yz, zz


@kernel_part
def _is_excluded(point: int, matched: Ints, scene: PointTable) -> bool:
    """Return whether a point is matched already or shares a ball of an image with one that is."""
    is_excluded = False
    for ball in range(len(matched)):
        is_excluded |= matched[ball] >= 0 and math.isinf(scene.distances[matched[ball], point])
    return is_excluded
