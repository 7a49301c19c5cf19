"""The pose of a matched target with its covariance, compiled; `plain_pose` says what it does.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math

import numpy as np

from skelgen.capture.bodies import plain_pose
from skelgen.capture.bodies.plain_pose import EXACT, MAX_STEPS, STEP_TOLERANCE
from skelgen.capture.bodies.tables import Rules
from skelgen.compiling import compile_function
from skelgen.model.arrays import Bools, Floats, Ints

fit_limit = compile_function(plain_pose.fit_limit)


@compile_function
def settle(
    balls: Floats,
    variances: Floats,
    points: Floats,
    covariances: Floats,
    spans: Floats,
    matched: Ints,
    free: Bools,
    rules: Rules,
) -> tuple[Floats, Floats, Ints, float, float, bool]:
    """Return pose, covariance, matches, rms, misfit and whether all is sound; arguments are the plain twin's."""
    matched = matched.copy()
    n_matched = 0
    for ball in range(len(matched)):
        n_matched += matched[ball] >= 0
    pose, covariance = fit_pose(balls, variances, points, covariances, matched)
    while True:
        worst, most, total = -1, 0.0, 0.0
        for ball in range(len(matched)):
            if matched[ball] >= 0:
                away = points[matched[ball]] - carried(pose, balls[ball])
                spread = spread_of(covariances[matched[ball]], pose, variances[ball], rules.floor)
                squared = weighed(away, inverse(spread))
                total += squared
                if squared > most:
                    worst, most = ball, squared
        if most <= rules.gate**2 and total <= fit_limit(3 * n_matched - 6, rules.gate):
            break
        if n_matched <= rules.min_points:
            return pose, covariance, matched, np.inf, np.inf, False
        matched[worst] = -1
        n_matched -= 1
        pose, covariance = fit_pose(balls, variances, points, covariances, matched)
    if take_up(balls, variances, points, covariances, spans, matched, free, rules, pose, covariance):
        pose, covariance = fit_pose(balls, variances, points, covariances, matched)
    total, misfit, n_matched = 0.0, 0.0, 0
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            away = points[matched[ball]] - carried(pose, balls[ball])
            spread = spread_of(covariances[matched[ball]], pose, variances[ball], rules.floor)
            total += away[0] ** 2 + away[1] ** 2 + away[2] ** 2
            misfit += weighed(away, inverse(spread))
            n_matched += 1
    rms = math.sqrt(total / n_matched)
    return pose, covariance, matched, rms, misfit, rms <= rules.max_distance


@compile_function
def fit_pose(
    balls: Floats, variances: Floats, points: Floats, covariances: Floats, matched: Ints
) -> tuple[Floats, Floats]:
    """Return the most likely pose and its covariance."""
    pose = first_pose(balls, points, matched)
    covariance = np.zeros((6, 6))
    for _ in range(MAX_STEPS):
        normal, pull = np.zeros((6, 6)), np.zeros(6)
        for ball in range(len(matched)):
            if matched[ball] >= 0:
                spread = spread_of(covariances[matched[ball]], pose, variances[ball], 0.0)
                away = points[matched[ball]] - carried(pose, balls[ball])
                add_ball(normal, pull, carried(pose, balls[ball]) - pose[:3, 3], inverse(spread), away)
        covariance = np.asarray(np.linalg.inv(normal))
        step = np.zeros(6)
        for i in range(6):
            for j in range(6):
                step[i] += covariance[i, j] * pull[j]
        turn(pose, step)
        if np.abs(step).max() < STEP_TOLERANCE:
            break
    return pose, covariance


@compile_function
def first_pose(balls: Floats, points: Floats, matched: Ints) -> Floats:
    """Best rigid motion in the plain least squares sense (Umeyama 1991)."""
    centre, middle, n = np.zeros(3), np.zeros(3), 0
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            n += 1
            centre += balls[ball]
            middle += points[matched[ball]]
    centre /= n
    middle /= n
    moments = np.zeros((3, 3))
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            for i in range(3):
                for j in range(3):
                    moments[i, j] += (points[matched[ball], i] - middle[i]) * (balls[ball, j] - centre[j])
    u, _, vt = np.linalg.svd(moments)
    if np.linalg.det(u) * np.linalg.det(vt) < 0:
        u[:, 2] *= -1
    pose = np.eye(4)
    for i in range(3):
        pose[i, 3] = middle[i]
        for j in range(3):
            pose[i, j] = u[i, 0] * vt[0, j] + u[i, 1] * vt[1, j] + u[i, 2] * vt[2, j]
        for j in range(3):
            pose[i, 3] -= pose[i, j] * centre[j]
    return pose


@compile_function
def carried(pose: Floats, point: Floats) -> Floats:
    """A point of the body in the world."""
    out = np.empty(3)
    for i in range(3):
        out[i] = pose[i, 0] * point[0] + pose[i, 1] * point[1] + pose[i, 2] * point[2] + pose[i, 3]
    return out


@compile_function
def spread_of(covariance: Floats, pose: Floats, variance: Floats, floor: float) -> Floats:
    """Covariance of a ball's distance from its point, a floor added."""
    out = covariance.copy()
    for i in range(3):
        for j in range(3):
            for axis in range(3):
                out[i, j] += pose[i, axis] * variance[axis] * pose[j, axis]
        out[i, i] += floor**2 + EXACT**2
    return out


@compile_function
def inverse(a: Floats) -> Floats:
    """Inverse of a symmetric matrix of shape (3, 3)."""
    out = np.empty((3, 3))
    out[0, 0] = a[1, 1] * a[2, 2] - a[1, 2] * a[1, 2]
    out[0, 1] = out[1, 0] = a[0, 2] * a[1, 2] - a[0, 1] * a[2, 2]
    out[0, 2] = out[2, 0] = a[0, 1] * a[1, 2] - a[0, 2] * a[1, 1]
    out[1, 1] = a[0, 0] * a[2, 2] - a[0, 2] * a[0, 2]
    out[1, 2] = out[2, 1] = a[0, 1] * a[0, 2] - a[0, 0] * a[1, 2]
    out[2, 2] = a[0, 0] * a[1, 1] - a[0, 1] * a[0, 1]
    out /= a[0, 0] * out[0, 0] + a[0, 1] * out[0, 1] + a[0, 2] * out[0, 2]
    return out


@compile_function
def weighed(away: Floats, weight: Floats) -> float:
    """Return away^T weight away."""
    total = 0.0
    for i in range(3):
        for j in range(3):
            total += away[i] * weight[i, j] * away[j]
    return total


@compile_function
def slope_of(arm: Floats) -> Floats:
    """How a point of the body moves with a small turn about the world's axes and a shift, shape (3, 6)."""
    slope = np.zeros((3, 6))
    slope[0, 1], slope[0, 2] = arm[2], -arm[1]
    slope[1, 0], slope[1, 2] = -arm[2], arm[0]
    slope[2, 0], slope[2, 1] = arm[1], -arm[0]
    slope[0, 3] = slope[1, 4] = slope[2, 5] = 1.0
    return slope


@compile_function
def add_ball(normal: Floats, pull: Floats, arm: Floats, weight: Floats, away: Floats) -> None:
    """Add what one ball says of the pose."""
    slope = slope_of(arm)
    for i in range(6):
        for a in range(3):
            pushed = slope[0, i] * weight[0, a] + slope[1, i] * weight[1, a] + slope[2, i] * weight[2, a]
            pull[i] += pushed * away[a]
            for j in range(6):
                normal[i, j] += pushed * slope[a, j]


@compile_function
def turn(pose: Floats, step: Floats) -> None:
    """Turn and shift a pose in place (Rodrigues)."""
    x, y, z = step[0], step[1], step[2]
    angle = math.sqrt(x * x + y * y + z * z)
    sine = math.sin(angle) / angle if angle > 0 else 1.0
    half = 2 * (math.sin(angle / 2) / angle) ** 2 if angle > 0 else 0.5
    for column in range(3):
        a, b, c = pose[0, column], pose[1, column], pose[2, column]
        u, v, w = y * c - z * b, z * a - x * c, x * b - y * a
        pose[0, column] = a + sine * u + half * (y * w - z * v)
        pose[1, column] = b + sine * v + half * (z * u - x * w)
        pose[2, column] = c + sine * w + half * (x * v - y * u)
    for axis in range(3):
        pose[axis, 3] += step[3 + axis]


@compile_function
def take_up(
    balls: Floats,
    variances: Floats,
    points: Floats,
    covariances: Floats,
    spans: Floats,
    matched: Ints,
    free: Bools,
    rules: Rules,
    pose: Floats,
    covariance: Floats,
) -> bool:
    """Match unseen balls to free points where the pose expects them; return whether there was any."""
    taken = False
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            continue
        place = carried(pose, balls[ball])
        slope = slope_of(place - pose[:3, 3])
        expected = np.zeros((3, 3))
        for i in range(3):
            for j in range(3):
                for a in range(6):
                    for b in range(6):
                        expected[i, j] += slope[i, a] * covariance[a, b] * slope[j, b]
        best, least = -1, rules.gate
        for point in range(len(points)):
            away = points[point] - place
            if not free[point] or weighed(away, np.eye(3)) > rules.max_distance**2:
                continue
            if is_excluded(point, matched, spans):
                continue
            spread = spread_of(covariances[point], pose, variances[ball], rules.floor) + expected
            deviation = math.sqrt(weighed(away, inverse(spread)))
            if deviation <= least:
                best, least = point, deviation
        if best >= 0:
            matched[ball] = best
            taken = True
    return taken


@compile_function
def is_excluded(point: int, matched: Ints, spans: Floats) -> bool:
    """Whether a point is matched already or shares a ball of an image with one that is."""
    excluded = False
    for ball in range(len(matched)):
        excluded |= matched[ball] >= 0 and math.isinf(spans[matched[ball], point])
    return excluded
