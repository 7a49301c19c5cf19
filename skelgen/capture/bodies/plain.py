r"""The search for one target among points, in plain Python: the twin that the compiled one is tested against.

A matching of m of the k balls costs (Gaschler 2011, eq. 3.13 and 3.14; d are the distances after the best rigid motion)

.. math::
    \frac{C(m)}{m} \sqrt{\sum_i d_i^2 + m \epsilon^2}, \qquad C(m) = 1.5^{k-m}, \quad m \ge 4 .

:math:`\epsilon` is the distance that means nothing (`floor`): without it, chance would choose between small distances.

*Pruning.* The best motion for some points is at least as good on fewer of them, so that the sum of squares never falls
when a match is added, in whatever order; and the cost falls with m. What a branch can still reach costs at least
(its present sum of squares, the most balls that it can still match): the branch is cut if that is no better than the
best matching so far. This is the seed's lemma for sums instead of averages, for which it holds on every path.

*Queue.* Matches of two balls with two points, best first. A matching is built from the best of its own edges, so that
none is visited twice, and the search ends when the next edge alone costs more than the best matching.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterator

import numpy as np

from skelgen.capture.bodies.tables import Rules, Scene, TargetTable
from skelgen.geometry.orientation import fit_transform, rotation_by_svd
from skelgen.model.arrays import Bools, Floats, Ints


def search(target: TargetTable, scene: Scene, allowed: Bools, rules: Rules, known: Ints) -> tuple[Ints, float]:
    """Return the best matching of a target and its cost.

    Parameters
    ----------
    target : TargetTable
        k balls.
    scene : Scene
        n points.
    allowed : ndarray of bool, shape (k, n)
        Which point may be which ball.
    rules : Rules
        See `BodyParameters`.
    known : ndarray of intp, shape (k,)
        A matching of which the result shall be no part; -1 everywhere allows all.

    Returns
    -------
    tuple of ndarray of intp, shape (k,), and float
        The point that is each ball, -1 for balls that are not seen; infinite cost and no matches if there is none.
    """
    best = _Best(len(target.points))
    queue = list(_edge_matches(target, scene, allowed, rules))
    heapq.heapify(queue)
    for _ in range(min(rules.queue, len(queue))):
        difference, i, j, a, b = heapq.heappop(queue)
        squares = difference**2 / 2  # both ends share the difference
        if cost_of(squares, len(target.points), len(target.points), rules) >= best.cost:
            break
        others = [ball for ball in range(len(target.points)) if ball not in (i, j)]
        _extend(_Search(target, scene, allowed, rules, known, best, difference), {i: a, j: b}, squares, others)
    return best.points, best.cost


def cost_of(squares: float, n_matched: int, n_balls: int, rules: Rules) -> float:
    """Cost of a matching with a sum of squared distances [mm^2]."""
    penalty = rules.penalty ** (n_balls - n_matched)
    return float(penalty / n_matched * np.sqrt(squares + n_matched * rules.floor**2))


def tolerance(variance: float, n_balls: int, rules: Rules) -> float:
    """Largest difference [mm] of two distances of a matching that is within the rules.

    Two residuals whose squares are below k t^2 together differ by at most sqrt(2 k) t.
    """
    return min(math.sqrt(2 * n_balls) * rules.max_distance, rules.floor + rules.gate * math.sqrt(variance))


class _Best:
    """The best matching so far."""

    def __init__(self, n_balls: int) -> None:
        self.points: Ints = np.full(n_balls, -1, dtype=np.intp)
        self.cost = np.inf


class _Search:
    """What stays the same while one edge is extended."""

    def __init__(
        self,
        target: TargetTable,
        scene: Scene,
        allowed: Bools,
        rules: Rules,
        known: Ints,
        best: _Best,
        first: float,
    ) -> None:
        self.target, self.scene, self.allowed, self.rules = target, scene, allowed, rules
        self.known, self.best, self.first = known, best, first

    def fits(self, matched: dict[int, int], ball: int, point: int) -> bool:
        """Whether one more match agrees with the distances of all others; none may be better than the first."""
        for other, taken in matched.items():
            difference = abs(self.scene.spans[taken, point] - self.target.edges[other, ball])
            variance = self.scene.span_variances[taken, point] + self.target.edge_variances[other, ball]
            if difference > tolerance(variance, len(self.target.points), self.rules) or difference < self.first:
                return False
        return True


def _edge_matches(
    target: TargetTable, scene: Scene, allowed: Bools, rules: Rules
) -> Iterator[tuple[float, int, int, int, int]]:
    n_balls = len(target.points)
    for i in range(n_balls):
        for j in range(i + 1, n_balls):
            for a in np.flatnonzero(allowed[i]):
                for b in np.flatnonzero(allowed[j]):
                    difference = abs(scene.spans[a, b] - target.edges[i, j])
                    variance = scene.span_variances[a, b] + target.edge_variances[i, j]
                    if a != b and difference <= tolerance(variance, n_balls, rules):
                        yield float(difference), i, j, int(a), int(b)


def _extend(search: _Search, matched: dict[int, int], squares: float, others: list[int]) -> None:
    """Try every point for the next ball, then the matchings without it."""
    n_balls, rules, best = len(search.target.points), search.rules, search.best
    most = len(matched) + len(others)
    if most < rules.min_points or cost_of(squares, most, n_balls, rules) >= best.cost:
        return
    if squares > most * rules.max_distance**2:
        return
    if not others:
        points = np.array([matched.get(ball, -1) for ball in range(n_balls)])
        if ((points >= 0) & (points != search.known)).any():
            best.cost, best.points = cost_of(squares, most, n_balls, rules), points
        return
    ball, rest = others[0], others[1:]
    for point in np.flatnonzero(search.allowed[ball]):
        if search.fits(matched, ball, int(point)):
            more = matched | {ball: int(point)}
            _extend(search, more, squares_of(search.target.points, search.scene.points, more), rest)
    _extend(search, matched, squares, rest)


def squares_of(balls: Floats, points: Floats, matched: dict[int, int]) -> float:
    """Sum of squared distances [mm^2] after the best proper rigid motion (Umeyama 1991)."""
    source, aim = balls[list(matched)], points[list(matched.values())]
    pose = fit_transform(source, aim, np.ones(len(source), dtype=bool), rotation_by_svd)
    return float(((source @ pose[:3, :3].T + pose[:3, 3] - aim) ** 2).sum())
