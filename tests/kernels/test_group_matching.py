"""Groups of hidden markers: gains by the formula written with NumPy, the best matching by trying all."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from skelgen._kernels.group_matching import Choices, Gains, Side, best_matching, gains_of_goals
from skelgen._kernels.marker_exchanges import explained

N, SPACING, EVERY = 4, 60.0, 5**4  # members and goals; mm; no beam is wider
ROUNDING = 1e-9  # nats


@pytest.fixture(params=range(4))
def rng(request) -> np.random.Generator:
    return np.random.default_rng(request.param)


def random_gains(rng) -> Gains:
    pairs = rng.normal(0.0, 5.0, (N, N, N, N))
    return Gains(rng.normal(0.0, 5.0, (N, N)), pairs + pairs.transpose(2, 3, 0, 1))


def score(goals, gains, unmatched) -> float:
    having = [(i, k) for i, k in enumerate(goals) if k >= 0]
    total = sum(gains.alone[pair] for pair in having) + sum(unmatched[i] for i, k in enumerate(goals) if k < 0)
    return total + sum(gains.pairs[one + other] for one, other in itertools.combinations(having, 2))


def is_allowed(goals, clash) -> bool:
    return not any(clash[i, j] and goals[i] == goals[j] >= 0 for i, j in itertools.combinations(range(len(goals)), 2))


def test_a_wide_beam_finds_the_best_of_all_matchings(rng) -> None:
    gains, unmatched = random_gains(rng), rng.normal(0.0, 3.0, N)
    clash = np.triu(rng.random((N, N)) < 0.7, 1)
    clash |= clash.T
    found, gained = best_matching(gains, Choices(clash, unmatched, rng.permutation(N)), EVERY)
    every = [goals for goals in itertools.product(range(-1, N), repeat=N) if is_allowed(goals, clash)]
    best = max(every, key=lambda goals: score(goals, gains, unmatched))
    assert tuple(found) == best
    assert gained == pytest.approx(score(best, gains, unmatched), abs=ROUNDING)


def test_of_equal_matchings_the_first_goals_are_kept() -> None:
    clash = ~np.eye(N, dtype=bool)
    gains = Gains(np.zeros((N, N)), np.zeros((N, N, N, N)))
    found, _ = best_matching(gains, Choices(clash, np.full(N, -1.0), np.arange(N)), 3)
    assert found.tolist() == list(range(N))


def sums_of(rng, n_markers: int) -> np.ndarray:
    """Number, sum and sum of squares of some distances of each two markers, none of every fifth pair."""
    count = np.triu(rng.integers(1, 9, (n_markers, n_markers)) * (rng.random((n_markers, n_markers)) > 0.2), 1)
    mean, deviation = rng.uniform(40, 300, count.shape), rng.uniform(0, 90, count.shape)
    upper = np.stack([count, count * mean, count * (mean**2 + deviation**2)]).astype(float)
    return upper + upper.transpose(0, 2, 1)


def test_gains_are_what_both_sides_explain_together_less_what_each_does(rng) -> None:
    n_markers = 2 * N
    inside, outside = sums_of(rng, n_markers), sums_of(rng, n_markers)
    told, steady = (
        (explained(inside, SPACING), explained(outside, SPACING)),
        rng.random((2, n_markers, n_markers)) < 0.5,
    )
    members, goals, others = np.arange(N), np.arange(2, N + 2), np.arange(N + 2, n_markers)
    sides = Side(members, inside, told[0], steady[0]), Side(goals, outside, told[1], steady[1])
    gains = gains_of_goals(*sides, others, SPACING)

    def gained(i, j, k, m) -> float:
        if not inside[0, i, j] or not (steady[0][i, j] or steady[1][k, m]):
            return 0.0
        together = explained((inside[:, i, j] + outside[:, k, m])[:, np.newaxis], SPACING)[0]
        return together - told[0][i, j] - told[1][k, m]

    alone = [[sum(gained(i, o, k, o) for o in others) for k in goals] for i in members]
    np.testing.assert_allclose(gains.alone, alone, atol=ROUNDING)
    for i, j in itertools.combinations(range(N), 2):
        table = [[gained(members[i], members[j], k, m) for m in goals] for k in goals]
        np.testing.assert_allclose(gains.pairs[i, :, j], table, atol=ROUNDING)
        np.testing.assert_array_equal(gains.pairs[j, :, i], gains.pairs[i, :, j].T)
