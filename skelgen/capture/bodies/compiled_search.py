"""The search for one target among points, compiled; `plain` says what it does and why that is right.

Importing this module imports numba, and raises `RuntimeError` where numba finds no folder to write its cache to.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from skelgen.capture.bodies.tables import Rules
from skelgen.compiling import compile_function
from skelgen.model.arrays import Bools, Floats, Ints

ROOT_TOLERANCE = 1e-13  # of the largest eigenvalue: the sum of squares is right to 1e-12 of the body's size squared
MAX_STEPS = 50
EDGE = 4  # columns of an edge match: two balls, two points


class Distances(NamedTuple):
    """Distances between balls and between points, and their variances; see `TargetTable` and `Scene`."""

    edges: Floats
    edge_variances: Floats
    spans: Floats
    span_variances: Floats


@compile_function
def span_tables(points: Floats, covariances: Floats, left: Ints, right: Ints) -> tuple[Floats, Floats]:
    """Distances of all pairs of points [mm] and their variances; infinite where two rest on one ball."""
    n = len(points)
    spans, variances = np.full((n, n), np.inf), np.zeros((n, n))
    for a in range(n):
        for b in range(a + 1, n):
            if left[a] == left[b] or right[a] == right[b]:
                continue
            x, y, z = points[a, 0] - points[b, 0], points[a, 1] - points[b, 1], points[a, 2] - points[b, 2]
            square = x * x + y * y + z * z
            spans[a, b] = spans[b, a] = math.sqrt(square)
            spread = 0.0
            for c in (a, b):
                s = covariances[c]
                spread += x * x * s[0, 0] + y * y * s[1, 1] + z * z * s[2, 2]
                spread += 2 * (x * y * s[0, 1] + x * z * s[0, 2] + y * z * s[1, 2])
            variances[a, b] = variances[b, a] = spread / square if square > 0 else 0.0
    return spans, variances


@compile_function
def search(
    balls: Floats,
    points: Floats,
    distances: Distances,
    allowed: Bools,
    rules: Rules,
    known: Ints,
) -> tuple[Ints, float]:
    """Return the best matching and its cost; arguments are the plain twin's, unpacked."""
    n_balls = len(balls)
    best, best_cost = np.full(n_balls, -1, dtype=np.intp), np.inf
    keys, matches = edge_matches(distances, allowed, rules)
    heap = heap_of(keys)
    size = len(heap)
    for _ in range(min(rules.queue, size)):
        first = heap[0]
        size -= 1
        heap[0] = heap[size]
        sink(heap, keys, 0, size)
        if cost_of(keys[first] ** 2 / 2, n_balls, n_balls, rules) >= best_cost:
            break
        best_cost = extend(
            matches[first], keys[first], balls, points, distances, allowed, rules, known, best, best_cost
        )
    return best, best_cost


@compile_function
def cost_of(squares: float, n_matched: int, n_balls: int, rules: Rules) -> float:
    """Cost of a matching with a sum of squared distances [mm^2]."""
    return rules.penalty ** (n_balls - n_matched) / n_matched * math.sqrt(squares + n_matched * rules.floor**2)


@compile_function
def is_near(difference: float, variance: float, n_balls: int, rules: Rules) -> bool:
    """Whether two distances may differ so."""
    beyond = max(difference - rules.floor, 0.0)
    if beyond * beyond > rules.gate * rules.gate * variance:  # nearly all: no root is drawn for them
        return False
    return difference <= math.sqrt(2.0 * n_balls) * rules.max_distance


@compile_function
def edge_matches(distances: Distances, allowed: Bools, rules: Rules) -> tuple[Floats, Ints]:
    """Differences of all pairs of distances within tolerance, and their balls and points."""
    n_balls, n_points = allowed.shape
    edges, edge_variances, spans, span_variances = distances
    keys, matches, n = np.empty(256), np.empty((256, EDGE), dtype=np.intp), 0
    for i in range(n_balls):
        for j in range(i + 1, n_balls):
            for a in range(n_points):
                for b in range(a + 1, n_points):
                    difference = abs(spans[a, b] - edges[i, j])
                    if not is_near(difference, span_variances[a, b] + edge_variances[i, j], n_balls, rules):
                        continue
                    if n + 2 > len(keys):
                        keys, matches = doubled(keys, matches)
                    for first, second in ((a, b), (b, a)):
                        if allowed[i, first] and allowed[j, second]:
                            keys[n] = difference
                            matches[n, 0], matches[n, 1], matches[n, 2], matches[n, 3] = i, j, first, second
                            n += 1
    return keys[:n], matches[:n]


@compile_function
def doubled(keys: Floats, matches: Ints) -> tuple[Floats, Ints]:
    """Both tables with twice the room."""
    n = len(keys)
    more_keys, more_matches = np.empty(2 * n), np.empty((2 * n, EDGE), dtype=np.intp)
    for row in range(n):
        more_keys[row] = keys[row]
        for column in range(EDGE):
            more_matches[row, column] = matches[row, column]
    return more_keys, more_matches


@compile_function
def heap_of(keys: Floats) -> Ints:
    """Indices of the keys as a binary heap, the smallest first."""
    heap = np.arange(len(keys))
    for place in range(len(keys) // 2 - 1, -1, -1):
        sink(heap, keys, place, len(keys))
    return heap


@compile_function
def sink(heap: Ints, keys: Floats, place: int, size: int) -> None:
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


@compile_function
def extend(
    edge: Ints,
    first: float,
    balls: Floats,
    points: Floats,
    distances: Distances,
    allowed: Bools,
    rules: Rules,
    known: Ints,
    best: Ints,
    best_cost: float,
) -> float:
    """Depth-first through all matchings whose best edge is the given one; `best` is filled, its cost returned."""
    n_balls, n_points = allowed.shape
    matched = np.full(n_balls, -1, dtype=np.intp)
    matched[edge[0]], matched[edge[1]] = edge[2], edge[3]
    others = others_of(n_balls, edge[0], edge[1])
    n_others = len(others)
    tried = np.full(n_others + 1, -1, dtype=np.intp)  # per level: the point that was tried last, n_points = none
    squares = np.empty(n_others + 1)
    squares[0] = first**2 / 2
    level, n_matched = 0, 2
    while level >= 0:
        if level == n_others:
            cost = cost_of(squares[level], n_matched, n_balls, rules)
            if cost < best_cost and not is_part(matched, known):
                best_cost = cost
                best[:] = matched
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
            elif allowed[ball, point] and fits(ball, point, matched, first, distances, rules):
                matched[ball] = point
                squares[level + 1] = squares_of(balls, points, matched)
            else:
                continue
            deeper = (
                most >= rules.min_points
                and squares[level + 1] <= most * rules.max_distance**2
                and cost_of(squares[level + 1], most, n_balls, rules) < best_cost
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


@compile_function
def is_part(matched: Ints, known: Ints) -> bool:
    """Whether all of a matching's matches are those of a known one."""
    is_known = True
    for ball in range(len(matched)):
        is_known &= matched[ball] < 0 or matched[ball] == known[ball]
    return bool(is_known)


@compile_function
def others_of(n_balls: int, i: int, j: int) -> Ints:
    """All balls but two."""
    others, n_others = np.empty(n_balls - 2, dtype=np.intp), 0
    for ball in range(n_balls):
        if ball not in (i, j):
            others[n_others] = ball
            n_others += 1
    return others


@compile_function
def fits(ball: int, point: int, matched: Ints, first: float, distances: Distances, rules: Rules) -> bool:
    """Whether one more match agrees with the distances of all others, none of which may be better than the first."""
    n_balls = len(matched)
    edges, edge_variances, spans, span_variances = distances
    for other in range(n_balls):
        taken = matched[other]
        if taken < 0:
            continue
        difference = abs(spans[taken, point] - edges[other, ball])
        if difference < first:
            return False
        if not is_near(difference, span_variances[taken, point] + edge_variances[other, ball], n_balls, rules):
            return False
    return True


@compile_function
def squares_of(balls: Floats, points: Floats, matched: Ints) -> float:
    """Sum of squared distances [mm^2] after the best proper rigid motion, without that motion.

    It is the sum of both sets' squares about their centroids less twice the largest eigenvalue of Horn's matrix, the
    root of a quartic that Newton's method finds from above (Theobald 2005).
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
    return max(total - 2 * largest_root(moments, total / 2), 0.0)


@compile_function
def largest_root(m: Floats, above: float) -> float:
    """Largest eigenvalue of Horn's matrix of some moments; `above` is a bound on it."""
    if above <= 0:
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
        if value <= 0 or slope <= 0:
            break
        step = value / slope
        root -= step
        if step < ROOT_TOLERANCE:
            break
    return root * above
