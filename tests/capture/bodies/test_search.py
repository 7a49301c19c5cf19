from __future__ import annotations

from itertools import combinations, permutations

import numpy as np
import pytest

from skelgen.capture.bodies import BodyParameters, compiled_search, plain
from skelgen.capture.bodies.tables import rules_of, scene_plain, target_table
from skelgen.capture.values import StereoPoints
from skelgen.geometry.orientation import fit_transform
from skelgen.model.rig import BodyTarget

OPEN = rules_of(BodyParameters(max_distance=100.0, gate=100.0, floor=10.0, queue=100_000))
"""Rules under which nothing is cut but by cost."""

NONE = np.full(5, -1, dtype=np.intp)


@pytest.fixture
def table(targets):
    return target_table(targets[0])


def best_by_trying_all(table, points, rules):
    """Cost of the best of all matchings of four or five balls."""
    n_balls, costs = len(table.points), []
    for size in range(rules.min_points, n_balls + 1):
        for balls in combinations(range(n_balls), size):
            for taken in permutations(range(len(points)), size):
                squares = plain.squares_of(table.points, points, dict(zip(balls, taken, strict=True)))
                costs.append(plain.cost_of(squares, size, n_balls, rules))
    return min(costs)


@pytest.mark.parametrize("seed", range(3))
def test_pruning_never_loses_the_best_matching(seed, table):
    rng = np.random.default_rng(seed)
    points = np.concatenate([table.points[1:] + rng.normal(size=(4, 3)) * 9, rng.uniform(-80, 80, (2, 3))])
    scene = scene_of(points)
    matched, cost = plain.search(table, scene, np.ones((5, len(points)), dtype=bool), OPEN, NONE)
    assert cost == pytest.approx(best_by_trying_all(table, points, OPEN), rel=1e-12)
    held = {ball: int(point) for ball, point in enumerate(matched) if point >= 0}
    squares = plain.squares_of(table.points, points, held)
    assert plain.cost_of(squares, len(held), 5, OPEN) == pytest.approx(cost)


@pytest.mark.parametrize("seed", range(6))
def test_compiled_search_costs_what_the_plain_one_does(seed, table):
    rng = np.random.default_rng(seed)
    points = np.concatenate([table.points + rng.normal(size=(5, 3)) * 5, rng.uniform(-80, 80, (4, 3))])
    scene, allowed = scene_of(points), rng.uniform(size=(5, 9)) < 0.9
    _, cost = plain.search(table, scene, allowed, OPEN, NONE)
    known = (table.edges, table.edge_variances, scene.spans, scene.span_variances)
    _, same = compiled_search.search(table.points, points, compiled_search.Distances(*known), allowed, OPEN, NONE)
    assert same == pytest.approx(cost, rel=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_the_next_best_matching_is_no_part_of_the_best(seed, table):
    rng = np.random.default_rng(seed)
    points = np.concatenate([table.points + rng.normal(size=(5, 3)) * 5, rng.uniform(-80, 80, (3, 3))])
    scene, allowed = scene_of(points), np.ones((5, 8), dtype=bool)
    best, cost = plain.search(table, scene, allowed, OPEN, NONE)
    second, more = plain.search(table, scene, allowed, OPEN, best)
    assert ((second >= 0) & (second != best)).any()
    assert more > cost
    distances = compiled_search.Distances(table.edges, table.edge_variances, scene.spans, scene.span_variances)
    same, as_much = compiled_search.search(table.points, points, distances, allowed, OPEN, best)
    assert np.array_equal(same, second)
    assert as_much == pytest.approx(more, rel=1e-9)


def test_sum_of_squares_never_falls_when_a_match_is_added(table):
    rng = np.random.default_rng(0)
    points = table.points + rng.normal(size=(5, 3)) * 20
    for size in range(2, 5):
        for balls in combinations(range(5), size):
            few = {ball: ball for ball in balls}
            for more in set(range(5)) - set(balls):
                grown = plain.squares_of(table.points, points, few | {more: more})
                assert grown >= plain.squares_of(table.points, points, few) - 1e-9


def test_two_balls_share_the_difference_of_their_distances(table):
    points = np.array([[0.0, 0, 0], [table.edges[0, 1] + 3.0, 0, 0]])
    assert plain.squares_of(table.points, points, {0: 0, 1: 1}) == pytest.approx(3.0**2 / 2)


@pytest.mark.parametrize("flat", [False, True])
def test_compiled_sum_of_squares_needs_no_rotation(flat, table):
    rng = np.random.default_rng(1)
    for size in (3, 4, 5):
        balls = table.points * ([1, 1, 0] if flat else [1, 1, 1])
        points = rng.normal(size=(5, 3)) * 30 + [0, 0, 1000]
        matched = np.array([0, 1, 2, 3, 4])
        matched[size:] = -1
        pose = fit_transform(balls[:size], points[:size], np.ones(size, dtype=bool))
        away = balls[:size] @ pose[:3, :3].T + pose[:3, 3] - points[:size]
        assert compiled_search.squares_of(balls, points, matched) == pytest.approx((away**2).sum(), rel=1e-8)


def test_missing_balls_are_punished():
    rules = rules_of(BodyParameters(floor=1e-4))
    five, four = plain.cost_of(5.0, 5, 5, rules), plain.cost_of(4.0, 4, 5, rules)  # both 1 mm rms
    assert four / five == pytest.approx(1.5 * np.sqrt(5 / 4), rel=1e-6)


def scene_of(points):
    n = len(points)
    covariance = np.tile(np.eye(3), (n, 1, 1))
    return scene_plain(StereoPoints(points, covariance, np.arange(n), np.arange(n), np.zeros(n), np.zeros(n, bool)))


def test_compiled_distances_are_those_of_the_plain_twin():
    rng = np.random.default_rng(0)
    points, roots = rng.normal(size=(7, 3)) * 50, rng.normal(size=(7, 3, 3))
    covariance = roots @ roots.swapaxes(1, 2)
    left, right = np.array([0, 0, 1, 2, 3, 4, 5]), np.array([0, 1, 2, 3, 4, 5, 5])
    one = scene_plain(StereoPoints(points, covariance, left, right, np.zeros(7), np.zeros(7, bool)))
    spans, variances = compiled_search.span_tables(points, covariance, left, right)
    np.testing.assert_allclose(spans, one.spans, rtol=1e-12)
    apart = np.isfinite(spans)
    np.testing.assert_allclose(variances[apart], one.span_variances[apart], rtol=1e-9)
    assert np.isinf(spans[0, 1])
    assert np.isinf(spans[5, 6])


def test_balls_with_one_place_have_no_direction_and_no_variance():
    table = target_table(BodyTarget("two", np.zeros((2, 3)), np.ones((2, 3))))
    assert table.edges[0, 1] == 0
    assert np.isfinite(table.edge_variances).all()
