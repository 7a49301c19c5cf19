r"""The search for one rigid body among points.

A matching of m of the k balls costs (Gaschler 2011, eq. 3.13 and 3.14; d are the distances after the best rigid motion)

.. math::
    \frac{C(m)}{m} \sqrt{\sum_i d_i^2 + m \epsilon^2}, \qquad C(m) = 1.5^{k-m}, \quad m \ge 4 .

:math:`\epsilon` is the distance that means nothing (`floor`): without it, chance would choose between small distances.

*Pruning.* The best motion for some points is at least as good on fewer of them, so that the sum of squares never falls
when a match is added, in whatever order; and the cost falls with m. What a branch can still reach costs at least
(its present sum of squares, the most balls that it can still match): the branch is cut if that is no better than the
best matching so far. This is the lemma of Gaschler (2011) for sums instead of averages: for these it always holds.

*Queue.* Matches of two balls with two points, best first. A matching is built from the best of its own edges, so that
none is visited twice, and the search ends when the next edge alone costs more than the best matching.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen._kernels import array_kernel, array_part, fixed, kernel, kernel_part
from skelgen._kernels.rigid_body_tables import PointTable, SearchRules, TargetTable
from skelgen._kernels.small_matrices import block, dot, minus, turned, vector
from skelgen.model.arrays import Bools, Floats, Ints

ROOT_TOLERANCE = 1e-13  # of the largest eigenvalue: the sum of squares is right to 1e-12 of the body's size squared
MAX_STEPS = 50
_TOP = fixed(0)  # of a heap
FIRST_ROOM = 256  # edge matches: more are rare


class Search(NamedTuple):
    """What stays the same during a search.

    Attributes
    ----------
    target, scene : TargetTable, PointTable
        k balls and n points.
    allowed : ndarray of bool, shape (k, n)
        Which point may be which ball.
    known : ndarray of intp, shape (k,)
        A matching of which the result shall be no part; -1 everywhere allows all.
    rules : SearchRules
        Limits.
    """

    target: TargetTable
    scene: PointTable
    allowed: Bools
    known: Ints
    rules: SearchRules


class _Tables(NamedTuple):
    """The arrays of a `Search`, flat: numba counts references to all arrays of nested tuples at each call."""

    balls: Floats
    points: Floats
    of_balls: Floats
    ball_variances: Floats
    of_points: Floats
    point_variances: Floats
    allowed: Bools
    known: Ints


@array_kernel
def point_distances(points: Floats, covariances: Floats, left: Ints, right: Ints) -> tuple[Floats, Floats]:
    """Return the distances of all pairs of points and their variances.

    Parameters
    ----------
    points : ndarray, shape (n, 3), mm
        In the world.
    covariances : ndarray, shape (n, 3, 3), mm^2
        Of each point.
    left, right : ndarray of intp, shape (n,)
        The balls of both images that each point comes from.

    Returns
    -------
    ndarray, shape (n, n), mm
        Infinite where two points share a ball.
    ndarray, shape (n, n), mm^2
        Variances.
    """
    n = len(points)
    distances, variances = np.full((n, n), np.inf), np.zeros((n, n))
    for a in range(n):
        for b in range(a + 1, n):
            if left[a] == left[b] or right[a] == right[b]:
                continue
            away = minus(vector(points, a, 0), vector(points, b, 0))
            square = dot(away, away)
            distances[a, b] = distances[b, a] = math.sqrt(square)
            spread = 0.0
            for c in (a, b):
                spread += dot(away, turned(block(covariances[c], 0, 0), away))
            variances[a, b] = variances[b, a] = spread / square if square > 0.0 else 0.0
    return distances, variances


@array_kernel
def find_matching(search: Search) -> tuple[Ints, float]:
    """Return the best matching of a body and its cost.

    Parameters
    ----------
    search : Search
        Body, points and limits.

    Returns
    -------
    matched : ndarray of intp, shape (k,)
        The point that each ball is, -1 for balls that are not seen.
    cost : float, mm
        Infinite if there is no matching.
    """
    n_balls, rules = len(search.target.points), search.rules
    best, best_cost = np.full(n_balls, -1, dtype=np.intp), np.inf
    differences, edges = _edge_matches(search)
    heap = _heap_of(differences)
    target, scene, size = search.target, search.scene, len(heap)
    tables = _Tables(
        target.points,
        scene.points,
        target.distances,
        target.distance_variances,
        scene.distances,
        scene.distance_variances,
        search.allowed,
        search.known,
    )
    (top,) = _TOP
    for _ in range(min(rules.queue, size)):
        first = heap[0]
        size -= 1
        heap[0] = heap[size]
        _sink(heap, differences, top, size)
        if matching_cost(differences[first] ** 2 / 2, n_balls, n_balls, rules) >= best_cost:  # both ends share it
            break
        best_cost = _extend(tables, rules, edges[first], differences[first], best, best_cost)
    return best, best_cost


@kernel
def matching_cost(squares: float, n_matched: int, n_balls: int, rules: SearchRules) -> float:
    """Return the cost [mm] of a matching.

    Parameters
    ----------
    squares : float, mm^2
        Sum of its squared distances.
    n_matched, n_balls : int
        Balls that are matched, and all balls of the body.
    rules : SearchRules
        Penalty and floor.
    """
    return rules.penalty ** (n_balls - n_matched) / n_matched * math.sqrt(squares + n_matched * rules.floor**2)


@kernel_part
def _is_near(difference: float, variance: float, n_balls: int, rules: SearchRules) -> bool:
    """Return whether two distances may differ so.

    Two residuals whose squares are below k t^2 together differ by at most sqrt(2 k) t.
    """
    beyond = max(difference - rules.floor, 0.0)
    if beyond * beyond > rules.gate * rules.gate * variance:  # nearly all: no root is drawn for them
        return False
    return difference <= math.sqrt(2.0 * n_balls) * rules.max_distance


@array_part
def _edge_matches(search: Search) -> tuple[Floats, Ints]:
    """Return the differences of all pairs of distances within tolerance, and their two balls and two points."""
    target, scene, allowed, rules = search.target, search.scene, search.allowed, search.rules
    n_balls, n_points = allowed.shape
    differences, edges, n = np.empty(FIRST_ROOM), np.empty((FIRST_ROOM, 4), dtype=np.intp), 0
    for i in range(n_balls):
        for j in range(i + 1, n_balls):
            for a in range(n_points):
                for b in range(a + 1, n_points):
                    difference = abs(scene.distances[a, b] - target.distances[i, j])
                    variance = scene.distance_variances[a, b] + target.distance_variances[i, j]
                    if not _is_near(difference, variance, n_balls, rules):
                        continue
                    if n + 2 > len(differences):
                        differences, edges = _doubled(differences, edges)
                    for first, second in ((a, b), (b, a)):
                        if allowed[i, first] and allowed[j, second]:
                            differences[n] = difference
                            edges[n, 0], edges[n, 1], edges[n, 2], edges[n, 3] = i, j, first, second
                            n += 1
    return differences[:n], edges[:n]


@array_part
def _doubled(differences: Floats, edges: Ints) -> tuple[Floats, Ints]:
    """Return both tables with twice the room."""
    n = len(differences)
    more_differences, more_edges = np.empty(2 * n), np.empty((2 * n, 4), dtype=np.intp)
    for row in range(n):
        more_differences[row] = differences[row]
        for column in range(4):
            more_edges[row, column] = edges[row, column]
    return more_differences, more_edges


@array_part
def _heap_of(keys: Floats) -> Ints:
    """Return the indices of the keys as a binary heap, the smallest first."""
    heap = np.arange(len(keys))
    for place in range(len(keys) // 2 - 1, -1, -1):
        _sink(heap, keys, place, len(keys))
    return heap


@kernel_part
def _sink(heap: Ints, keys: Floats, place: int, size: int) -> None:
    """Let one entry of a heap sink to where it belongs; of equal keys the smaller index is first."""
    while True:
        least = place
        for child in (2 * place + 1, 2 * place + 2):
            if child < size:
                one, other = heap[child], heap[least]
                if keys[one] < keys[other] or (keys[one] == keys[other] and one < other):
                    least = child
        if least == place:
            return
        heap[place], heap[least] = heap[least], heap[place]
        place = least


@array_part
def _extend(  # noqa: PLR0912 - one loop instead of recursion
    tables: _Tables, rules: SearchRules, edge: Ints, first: float, best: Ints, best_cost: float
) -> float:
    """Try all matchings whose best edge is the given one, depth-first; fill the best and return its cost."""
    n_balls, n_points = tables.allowed.shape
    matched = np.full(n_balls, -1, dtype=np.intp)
    matched[edge[0]], matched[edge[1]] = edge[2], edge[3]
    others = _others(n_balls, edge[0], edge[1])
    n_others = len(others)
    tried = np.full(n_others + 1, -1, dtype=np.intp)  # per level: the point that was tried last, n_points = none
    squares = np.empty(n_others + 1)
    squares[0] = first**2 / 2
    level, n_matched = 0, 2
    while level >= 0:
        if level == n_others:
            cost = matching_cost(squares[level], n_matched, n_balls, rules)
            if cost < best_cost and not _is_part(matched, tables.known):
                best_cost = cost
                for ball in range(n_balls):
                    best[ball] = matched[ball]
            level -= 1
            continue
        ball = others[level]
        if matched[ball] >= 0:
            matched[ball] = -1
            n_matched -= 1
        deeper = False
        while tried[level] < n_points and not deeper:
            tried[level] += 1
            point = tried[level]
            most = n_matched + n_others - level
            if point == n_points:
                most -= 1
                squares[level + 1] = squares[level]
            elif tables.allowed[ball, point] and _fits(tables, rules, ball, point, matched, first):
                matched[ball] = point
                squares[level + 1] = sum_of_squares(tables.balls, tables.points, matched)
            else:
                continue
            deeper = (
                most >= rules.min_points
                and squares[level + 1] <= most * rules.max_distance**2
                and matching_cost(squares[level + 1], most, n_balls, rules) < best_cost
            )
            if not deeper:
                matched[ball] = -1
        if deeper:
            if matched[ball] >= 0:
                n_matched += 1
            level += 1
            tried[level] = -1
        else:
            level -= 1
    return best_cost


@kernel_part
def _is_part(matched: Ints, known: Ints) -> bool:
    """Return whether all of a matching's matches are those of a known one."""
    is_known = True
    for ball in range(len(matched)):
        is_known &= matched[ball] < 0 or matched[ball] == known[ball]
    return bool(is_known)


@array_part
def _others(n_balls: int, i: int, j: int) -> Ints:
    """Return all balls but two."""
    others, n_others = np.empty(n_balls - 2, dtype=np.intp), 0
    for ball in range(n_balls):
        if ball not in (i, j):
            others[n_others] = ball
            n_others += 1
    return others


@kernel_part
def _fits(tables: _Tables, rules: SearchRules, ball: int, point: int, matched: Ints, first: float) -> bool:
    """Return whether one more match agrees with the distances of all others; none may be better than the first."""
    n_balls = len(matched)
    for other in range(n_balls):
        taken = matched[other]
        if taken < 0:
            continue
        difference = abs(tables.of_points[taken, point] - tables.of_balls[other, ball])
        if difference < first:
            return False
        variance = tables.point_variances[taken, point] + tables.ball_variances[other, ball]
        if not _is_near(difference, variance, n_balls, rules):
            return False
    return True


@array_kernel
def sum_of_squares(balls: Floats, points: Floats, matched: Ints) -> float:
    """Return the sum of squared distances [mm^2] after the best proper rigid motion, without that motion.

    It is the sum of both sets' squares about their centroids less twice the largest eigenvalue of Horn's matrix, the
    root of a quartic that Newton's method finds from above (Theobald 2005).

    Parameters
    ----------
    balls : ndarray, shape (k, 3), mm
        In the body's frame.
    points : ndarray, shape (n, 3), mm
        In the world.
    matched : ndarray of intp, shape (k,)
        The point that each ball is; -1 for none.
    """
    centre, middle, n = np.zeros(3), np.zeros(3), 0
    for ball in range(len(matched)):
        if matched[ball] >= 0:
            n += 1
            for axis in range(3):
                centre[axis] += balls[ball, axis]
                middle[axis] += points[matched[ball], axis]
    moments, total = np.zeros((3, 3)), 0.0
    for ball in range(len(matched)):
        if matched[ball] < 0:
            continue
        for i in range(3):
            outer = points[matched[ball], i] - middle[i] / n
            inner = balls[ball, i] - centre[i] / n
            total += outer * outer + inner * inner
            for j in range(3):
                moments[i, j] += outer * (balls[ball, j] - centre[j] / n)
    return max(total - 2 * _largest_eigenvalue(moments, total / 2), 0.0)


@kernel_part
def _largest_eigenvalue(m: Floats, above: float) -> float:
    """Return the largest eigenvalue of Horn's matrix of some moments; `above` is a bound on it."""
    if above <= 0.0:
        return 0.0
    norm, fourth = 0.0, 0.0
    for i in range(3):
        for j in range(3):
            norm += m[i, j] * m[i, j]
            product = m[0, i] * m[0, j] + m[1, i] * m[1, j] + m[2, i] * m[2, j]
            fourth += product * product
    determinant = (
        m[0, 0] * (m[1, 1] * m[2, 2] - m[1, 2] * m[2, 1])
        - m[0, 1] * (m[1, 0] * m[2, 2] - m[1, 2] * m[2, 0])
        + m[0, 2] * (m[1, 0] * m[2, 1] - m[1, 1] * m[2, 0])
    )
    square, cube, last = norm / above**2, determinant / above**3, (2 * fourth - norm * norm) / above**4
    root = 1.0
    for _ in range(MAX_STEPS):
        value = ((root * root - 2 * square) * root - 8 * cube) * root + last
        slope = 4 * (root * root - square) * root - 8 * cube
        if value <= 0.0 or slope <= 0.0:
            break
        step = value / slope
        root -= step
        if step < ROOT_TOLERANCE:
            break
    return root * above
