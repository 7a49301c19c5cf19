"""The search for a rigid body against all matchings, and its pose against truth."""

from __future__ import annotations

from itertools import combinations, permutations

import numpy as np
import pytest
from scipy.stats import chi2, norm

from skelgen._kernels.rigid_body_pose import chi_squared_limit, fit_body
from skelgen._kernels.rigid_body_search import Search, find_matching, matching_cost, point_distances, sum_of_squares
from skelgen._kernels.rigid_body_tables import PointTable, TargetTable
from skelgen.capture.bodies import search_rules, table_of_points, table_of_target
from skelgen.capture.parameters import BodyParameters
from skelgen.capture.values import StereoPoints
from skelgen.geometry.orientation import fit_transform
from skelgen.geometry.rotations import matrix_from_vector, transform_from
from skelgen.model.rig import BodyTarget

HAND = np.array([[0.0, 0, 0], [61, 0, 0], [17, 72, 0], [-33, 25, 40], [40, 38, -52]])
OPEN = search_rules(BodyParameters(max_distance=100.0, gate=100.0, floor=10.0, queue=100_000))
"""Rules under which nothing is cut but by cost."""

NONE = np.full(5, -1, dtype=np.intp)


@pytest.fixture
def target() -> TargetTable:
    return table_of_target(BodyTarget("hand", HAND))


def scene_of(points, covariance=None) -> PointTable:
    n = len(points)
    covariance = np.tile(np.eye(3), (n, 1, 1)) if covariance is None else covariance
    return table_of_points(
        StereoPoints(points, covariance, np.arange(n), np.arange(n), np.zeros(n), np.zeros(n, dtype=bool))
    )


def squares_after_umeyama(balls, points, matched):
    seen = matched >= 0
    source, aim = balls[seen], points[matched[seen]]
    pose = fit_transform(source, aim, np.ones(len(source), dtype=bool))
    return ((source @ pose[:3, :3].T + pose[:3, 3] - aim) ** 2).sum()


def best_by_trying_all(target, points, rules):
    """Cost of the best of all matchings of four or five balls."""
    costs = []
    for size in range(rules.min_points, 6):
        for balls in combinations(range(5), size):
            for taken in permutations(range(len(points)), size):
                matched = NONE.copy()
                matched[list(balls)] = taken
                costs.append(matching_cost(sum_of_squares(target.points, points, matched), size, 5, rules))
    return min(costs)


@pytest.mark.parametrize("seed", range(2))
def test_pruning_never_loses_the_best_matching(seed, target):
    rng = np.random.default_rng(seed)
    points = np.concatenate([HAND[1:] + rng.normal(size=(4, 3)) * 9, rng.uniform(-80, 80, (1, 3))])
    matched, cost = find_matching(Search(target, scene_of(points), np.ones((5, 5), dtype=bool), NONE, OPEN))
    assert cost == pytest.approx(best_by_trying_all(target, points, OPEN), rel=1e-12)
    squares = squares_after_umeyama(HAND, points, matched)
    assert matching_cost(squares, int((matched >= 0).sum()), 5, OPEN) == pytest.approx(cost)


def test_the_next_best_matching_is_no_part_of_the_best(target):
    rng = np.random.default_rng(0)
    points = np.concatenate([HAND + rng.normal(size=(5, 3)) * 5, rng.uniform(-80, 80, (1, 3))])
    search = Search(target, scene_of(points), np.ones((5, 6), dtype=bool), NONE, OPEN)
    best, cost = find_matching(search)
    second, more = find_matching(search._replace(known=best))
    assert ((second >= 0) & (second != best)).any()
    assert more > cost


def test_only_allowed_points_are_matched(target):
    allowed = np.ones((5, 5), dtype=bool)
    allowed[2, 2] = False
    matched, _ = find_matching(Search(target, scene_of(HAND.copy()), allowed, NONE, OPEN))
    assert matched.tolist() == [0, 1, -1, 3, 4]


def test_sum_of_squares_never_falls_when_a_match_is_added():
    points = HAND + np.random.default_rng(0).normal(size=(5, 3)) * 20
    for size in range(2, 5):
        for balls in combinations(range(5), size):
            few = NONE.copy()
            few[list(balls)] = balls
            for more in set(range(5)) - set(balls):
                grown = few.copy()
                grown[more] = more
                assert sum_of_squares(HAND, points, grown) >= sum_of_squares(HAND, points, few) - 1e-9


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("size", [3, 4, 5])
def test_sum_of_squares_is_that_of_umeyamas_motion(flat, size):
    rng = np.random.default_rng(1)
    balls, points = HAND * ([1, 1, 0] if flat else [1, 1, 1]), rng.normal(size=(5, 3)) * 30 + [0, 0, 1000]
    matched = np.arange(5)
    matched[size:] = -1
    assert sum_of_squares(balls, points, matched) == pytest.approx(
        squares_after_umeyama(balls, points, matched), rel=1e-8
    )


def test_two_balls_share_the_difference_of_their_distances(target):
    points = np.array([[0.0, 0, 0], [target.distances[0, 1] + 3.0, 0, 0]])
    assert sum_of_squares(HAND, points, np.array([0, 1, -1, -1, -1])) == pytest.approx(3.0**2 / 2, rel=1e-5)


def test_missing_balls_are_punished():
    rules = search_rules(BodyParameters(floor=1e-4))
    five, four = matching_cost(5.0, 5, 5, rules), matching_cost(4.0, 4, 5, rules)  # both 1 mm rms
    assert four / five == pytest.approx(1.5 * np.sqrt(5 / 4), rel=1e-6)


def test_distances_have_the_variance_along_their_line():
    rng = np.random.default_rng(0)
    points, roots = rng.normal(size=(7, 3)) * 50, rng.normal(size=(7, 3, 3))
    covariance = roots @ roots.swapaxes(1, 2)
    left, right = np.array([0, 0, 1, 2, 3, 4, 5]), np.array([0, 1, 2, 3, 4, 5, 5])
    distances, variances = point_distances(points, covariance, left, right)
    for a, b in permutations(range(7), 2):
        if {a, b} in ({0, 1}, {5, 6}):  # they share a ball
            assert np.isinf(distances[a, b])
            continue
        along = (points[a] - points[b]) / np.linalg.norm(points[a] - points[b])
        assert distances[a, b] == pytest.approx(np.linalg.norm(points[a] - points[b]), rel=1e-12)
        assert variances[a, b] == pytest.approx(along @ (covariance[a] + covariance[b]) @ along, rel=1e-9)


def posed(noise, seed=0):
    """A pose, its points with noise, and their covariances."""
    rng = np.random.default_rng(seed)
    pose = transform_from(matrix_from_vector(rng.normal(size=3)), np.array([10.0, -20.0, 1200.0]))
    points = HAND @ pose[:3, :3].T + pose[:3, 3] + noise * rng.normal(size=(5, 3))
    return pose, points, np.tile(np.diag(np.maximum(noise, 1e-6) ** 2 * np.ones(3)), (5, 1, 1))


def test_exact_points_give_their_pose(target):
    pose, points, covariance = posed(0.0)
    rules = search_rules(BodyParameters())
    found = fit_body(target, scene_of(points, covariance), np.arange(5), np.ones(5, dtype=bool), rules)
    np.testing.assert_allclose(found.pose, pose, atol=1e-9)
    assert found.is_sound
    assert found.rms < 1e-9


def test_the_covariance_is_the_inverse_of_the_information(target):
    noise = np.array([0.1, 0.1, 0.4])
    _, points, covariance = posed(noise, 1)
    found = fit_body(
        target, scene_of(points, covariance), np.arange(5), np.ones(5, dtype=bool), search_rules(BodyParameters())
    )
    information = np.zeros((6, 6))
    for ball in range(5):
        x, y, z = found.pose[:3, :3] @ HAND[ball]
        slope = np.hstack([[[0, z, -y], [-z, 0, x], [y, -x, 0]], np.eye(3)])
        information += slope.T @ np.linalg.inv(covariance[ball]) @ slope
    np.testing.assert_allclose(found.covariance, np.linalg.inv(information), rtol=1e-5, atol=1e-12)


def test_a_wrong_match_is_dropped_and_a_missing_ball_added(target):
    pose, points, covariance = posed(0.05)
    points = np.concatenate([points, points[4:] + 30.0])
    covariance = np.concatenate([covariance, covariance[4:]])
    found = fit_body(
        target,
        scene_of(points, covariance),
        np.array([0, 1, 2, 3, 5]),
        np.ones(6, dtype=bool),
        search_rules(BodyParameters()),
    )
    assert found.matched.tolist() == [0, 1, 2, 3, 4]
    np.testing.assert_allclose(found.pose[:3, 3], pose[:3, 3], atol=0.5)


def test_too_few_balls_within_the_gate_are_unsound(target):
    _, points, covariance = posed(0.05)
    matched = np.array([1, 0, 2, 3, 4])
    found = fit_body(
        target, scene_of(points, covariance), matched, np.zeros(5, dtype=bool), search_rules(BodyParameters())
    )
    assert not found.is_sound


def test_balls_with_one_place_have_no_direction_and_no_variance():
    table = table_of_target(BodyTarget("two", np.zeros((2, 3)), np.ones((2, 3))))
    assert table.distances[0, 1] == 0
    assert np.isfinite(table.distance_variances).all()


@pytest.mark.parametrize("n_free", [6, 9, 15, 30])
@pytest.mark.parametrize("gate", [2.0, 5.0])
def test_the_limit_of_a_whole_fit_is_the_quantile_of_chi_squared(n_free, gate):
    assert chi_squared_limit(n_free, gate) == pytest.approx(chi2.isf(norm.sf(gate), n_free), rel=0.05)
