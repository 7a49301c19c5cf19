"""Balls of many images at once: which are one marker, where it is, and which cameras see it.

Every two balls that lie in one plane with their cameras are a hypothesis. It is carried into all other images, where
the ball nearest to where the marker must be joins it, if it lies within the noise. A hypothesis of k balls explains
2 k numbers by 3; each number more that it explains is evidence, as chance would spread it over the image. The best
hypothesis takes its balls; the others go on with what is left of theirs. So a crossing of two rays, which has no third
ball, comes last, when the markers have taken the balls that made it.

See `skelgen._kernels.room_points` for how cameras and balls are given.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part, kernel_part
from skelgen._kernels.room_points import Room, drop_misfits, is_in_view, nearest_ball, point_of_two, refine
from skelgen._kernels.small_matrices import block, dot, minus, set_block, set_vector, transposed, turned, vector, whole
from skelgen.model.arrays import Bools, Floats, Ints

SURE = 4
"""Cameras from which on a hypothesis is no chance: no other is begun with two of its balls."""

NOWHERE = -1e300


class Rules(NamedTuple):
    """What counts as one marker.

    Attributes
    ----------
    gate : float
        Standard deviations within which balls belong together.
    evidence : float
        Nats that each explained number is worth; its misfit is taken off.
    unseen : float
        Nats that each camera costs that ought to see the marker and has no ball there.
    expected : float
        Nats that it is worth to be where a marker is expected.
    reach : float, mm
        How far from there it may be.
    max_std : float, mm
        Largest deviation of a point.
    """

    gate: float
    evidence: float
    unseen: float
    expected: float
    reach: float
    max_std: float


class RoomMatches(NamedTuple):
    """Markers that were found.

    Attributes
    ----------
    points : ndarray, shape (n, 3), mm
        In the world.
    covariances : ndarray, shape (n, 3, 3), mm^2
        From the noise in all images.
    balls : ndarray of intp, shape (n, n_cameras)
        The ball of each camera, -1 where it has none.
    squares : ndarray, shape (n,)
        Chi-squared of the misfit, with twice the number of balls less three degrees of freedom.
    scores : ndarray, shape (n,)
        Evidence [nats].
    """

    points: Floats
    covariances: Floats
    balls: Ints
    squares: Floats
    scores: Floats


@array_kernel
def match_room(room: Room, expected: Floats, rules: Rules) -> RoomMatches:
    """Return the markers that the balls of one moment show, the surest first; no ball belongs to two.

    Parameters
    ----------
    room : Room
        Cameras and balls.
    expected : ndarray, shape (n_expected, 3), mm
        Where markers are expected by the time before.
    rules : Rules
        What counts as one marker.
    """
    n_cameras, n_balls = len(room.poses), len(room.rays)
    balls, hypotheses, scores = _hypotheses(room, expected, rules)
    is_free = np.ones(n_balls, dtype=np.bool_)
    most = n_balls // 2 + 1
    found = np.full((most, n_cameras), -1, dtype=np.intp)
    points, covariances = np.empty((most, 3)), np.empty((most, 3, 3))
    squares, evidence, n_found = np.empty(most), np.empty(most), 0
    numbers, n_hypotheses = np.empty(8), len(scores)
    while n_hypotheses > 0:
        best = 0
        for other in range(1, n_hypotheses):
            if scores[other] > scores[best]:
                best = other
        if scores[best] <= 0.0:
            break
        if _drop_taken(balls[best], is_free):
            # Its balls have changed: it waits for its turn with what is left of it.
            scores[best] = _rebuilt(room, balls[best], hypotheses[best], numbers, expected, rules)
            continue
        refine(room, balls[best], hypotheses[best], numbers)
        for camera in range(n_cameras):
            found[n_found, camera] = balls[best, camera] - room.starts[camera] if balls[best, camera] >= 0 else -1
            if balls[best, camera] >= 0:
                is_free[balls[best, camera]] = False
        for axis in range(3):
            points[n_found, axis] = hypotheses[best, axis]
        upper = numbers[0], numbers[1], numbers[2], numbers[3], numbers[4], numbers[5]
        set_block(covariances[n_found], 0, 0, whole(upper))
        squares[n_found], evidence[n_found] = numbers[6], scores[best]
        n_found += 1
        n_hypotheses -= 1
        scores[best] = scores[n_hypotheses]
        for camera in range(n_cameras):
            balls[best, camera] = balls[n_hypotheses, camera]
        for axis in range(3):
            hypotheses[best, axis] = hypotheses[n_hypotheses, axis]
    return RoomMatches(
        points[:n_found].copy(),
        covariances[:n_found].copy(),
        found[:n_found].copy(),
        squares[:n_found].copy(),
        evidence[:n_found].copy(),
    )


@array_part
def _hypotheses(room: Room, expected: Floats, rules: Rules) -> tuple[Ints, Floats, Floats]:
    """Return the balls, points and scores of all hypotheses."""
    n_cameras, n_balls = len(room.poses), len(room.rays)
    balls = np.full((8 * n_balls + 8, n_cameras), -1, dtype=np.intp)
    points, scores = np.empty((len(balls), 3)), np.empty(len(balls))
    together = np.zeros((n_balls, n_balls), dtype=np.bool_)
    numbers, lines, n = np.empty(8), np.empty((n_balls, 3)), 0
    for one in range(n_cameras):
        for two in range(one + 1, n_cameras):
            _fill_lines(lines, room, one, two)
            for i in range(room.starts[one], room.starts[one + 1]):
                for j in range(room.starts[two], room.starts[two + 1]):
                    if together[i, j] or not _are_in_plane(room, lines, i, j, rules.gate):
                        continue
                    if n == len(balls):
                        balls, points, scores = _longer(balls, points, scores)
                    for camera in range(n_cameras):
                        balls[n, camera] = -1
                    balls[n, one], balls[n, two] = i, j
                    if not point_of_two(room, balls[n], points[n]):
                        continue
                    scores[n] = _grown(room, balls[n], points[n], numbers, expected, rules)
                    if scores[n] <= 0.0:
                        continue
                    _remember(balls[n], together)
                    n += 1
    return balls[:n], points[:n], scores[:n]


@array_part
def _longer(balls: Ints, points: Floats, scores: Floats) -> tuple[Ints, Floats, Floats]:
    """Return tables of twice the length."""
    n, n_cameras = balls.shape
    more, places, values = np.empty((2 * n, n_cameras), dtype=np.intp), np.empty((2 * n, 3)), np.empty(2 * n)
    for row in range(n):
        values[row] = scores[row]
        for camera in range(n_cameras):
            more[row, camera] = balls[row, camera]
        for axis in range(3):
            places[row, axis] = points[row, axis]
    return more, places, values


@kernel_part
def _fill_lines(lines: Floats, room: Room, one: int, two: int) -> None:
    """Fill the epipolar lines of the balls of two cameras, each in the other's image."""
    essential = block(room.essential[one, two], 0, 0)
    for i in range(room.starts[one], room.starts[one + 1]):
        set_vector(lines, i, 0, turned(essential, (room.rays[i, 0], room.rays[i, 1], 1.0)))
    for j in range(room.starts[two], room.starts[two + 1]):
        set_vector(lines, j, 0, turned(transposed(essential), (room.rays[j, 0], room.rays[j, 1], 1.0)))


@kernel_part
def _are_in_plane(room: Room, lines: Floats, i: int, j: int, gate: float) -> bool:
    """Return whether two balls lie in one plane with their cameras, within their noise (Sampson)."""
    residual = lines[i, 0] * room.rays[j, 0] + lines[i, 1] * room.rays[j, 1] + lines[i, 2]
    u = room.spread[i, 0, 0] * lines[j, 0] + room.spread[i, 1, 0] * lines[j, 1]
    v = room.spread[i, 0, 1] * lines[j, 0] + room.spread[i, 1, 1] * lines[j, 1]
    w = room.spread[j, 0, 0] * lines[i, 0] + room.spread[j, 1, 0] * lines[i, 1]
    z = room.spread[j, 0, 1] * lines[i, 0] + room.spread[j, 1, 1] * lines[i, 1]
    return bool(residual * residual <= gate * gate * (u * u + v * v + w * w + z * z))


@kernel_part
def _remember(balls: Ints, together: Bools) -> None:
    """Mark the balls of a sure hypothesis as together."""
    count = 0
    for ball in balls:
        count += ball >= 0
    if count < SURE:
        return
    for one in balls:
        for two in balls:
            if one >= 0 and two >= 0:
                together[one, two] = True


@kernel_part
def _grown(room: Room, balls: Ints, point: Floats, numbers: Floats, expected: Floats, rules: Rules) -> float:
    """Let the balls of other cameras join a hypothesis; return its score."""
    if not refine(room, balls, point, numbers):
        return NOWHERE
    if numbers[6] > rules.gate * rules.gate:
        return NOWHERE
    for camera in range(len(balls)):
        if balls[camera] >= 0:
            continue
        ball = nearest_ball(room, camera, point, numbers, rules.gate)
        if ball < 0:
            continue
        balls[camera] = ball
        if not refine(room, balls, point, numbers):
            return NOWHERE
    drop_misfits(room, balls, point, numbers, rules.gate)
    return _score(room, balls, point, numbers, expected, rules)


@kernel_part
def _rebuilt(room: Room, balls: Ints, point: Floats, numbers: Floats, expected: Floats, rules: Rules) -> float:
    """Return the score of a hypothesis that has lost balls."""
    count = 0
    for ball in balls:
        count += ball >= 0
    if count < 2 or not refine(room, balls, point, numbers):
        return NOWHERE
    drop_misfits(room, balls, point, numbers, rules.gate)
    return _score(room, balls, point, numbers, expected, rules)


@kernel_part
def _score(room: Room, balls: Ints, point: Floats, numbers: Floats, expected: Floats, rules: Rules) -> float:
    """Return the evidence of a hypothesis."""
    explained = 2.0 * numbers[7] - 3.0
    limit = rules.gate + math.sqrt(2.0 * explained)
    if not numbers[6] <= limit * limit or numbers[0] + numbers[3] + numbers[5] > rules.max_std * rules.max_std:
        return NOWHERE
    score = rules.evidence * explained - numbers[6] / 2.0
    for camera in range(len(balls)):
        if balls[camera] < 0 and is_in_view(room, camera, point):
            score -= rules.unseen
    for other in range(len(expected)):
        away = minus(vector(expected, other, 0), (point[0], point[1], point[2]))
        if dot(away, away) <= rules.reach * rules.reach:
            return float(score + rules.expected)
    return float(score)


@kernel_part
def _drop_taken(balls: Ints, is_free: Bools) -> bool:
    """Take away the balls that others have; return whether there were any."""
    any_taken = False
    for camera in range(len(balls)):
        if balls[camera] >= 0 and not is_free[balls[camera]]:
            balls[camera] = -1
            any_taken = True
    return any_taken
