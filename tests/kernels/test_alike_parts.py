"""Parts that are alike: correspondences of a mirrored body, and exchanges weighed as if distances were measured so."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.alike_parts import MomentsOfPairs, Room, UsualDistances, grow_part, weigh_spans
from skelgen._kernels.marker_exchanges import explained

SPACING, WITNESSES = 60.0, 3
ROUNDING = 1e-9  # nats


def distances_of(places: np.ndarray) -> np.ndarray:
    return np.linalg.norm(places[..., :, np.newaxis, :] - places[..., np.newaxis, :, :], axis=-1)


def test_markers_of_a_mirrored_body_correspond() -> None:
    rng = np.random.default_rng(0)
    left = rng.uniform((-200.0, -200.0, 200.0), (200.0, 200.0, 600.0), (6, 3))
    places = np.concatenate([left, left * (1.0, 1.0, -1.0) + rng.normal(0.0, 2.0, left.shape)])
    usual = distances_of(places)
    steady = usual > 0.0
    steady[:6, 6:] = steady[6:, :6] = False
    free, pairs = np.ones(12, dtype=bool), np.full((6, 2), -1)
    free[3] = free[9] = False  # known not to correspond
    pairs[0] = 2, 8
    distances = UsualDistances(usual, np.ones((12, 12)), steady, SPACING)
    told = grow_part(distances, free, np.empty((12, 12)), pairs)
    assert told > 0.0
    assert pairs[-1].tolist() == [-1, -1]
    assert sorted(map(tuple, pairs[:-1].tolist())) == [(one, one + 6) for one in (0, 1, 2, 4, 5)]


def evidence_of(lengths: np.ndarray) -> float:
    """What the best witnesses of each marker tell of distances, shape (n_moments, n_markers, n_markers)."""
    gains = explained(np.stack([(lengths > 0).sum(axis=0), lengths.sum(axis=0), (lengths**2).sum(axis=0)]), SPACING)
    return float(np.sort(gains, axis=1)[:, -WITNESSES:].sum())


@pytest.mark.parametrize("seed", range(3))
def test_exchanges_are_weighed_as_if_markers_had_been_the_others(seed) -> None:
    rng, pairs = np.random.default_rng(seed), np.array([[0, 3], [1, 4], [2, 5]])
    n_moments, n_markers = 8, 7
    places = rng.uniform(-150.0, 150.0, (n_markers, 3)) + rng.normal(0.0, 4.0, (n_moments, n_markers, 3))
    lengths = distances_of(places)
    sums = np.cumsum(np.stack([lengths > 0, lengths, lengths**2], axis=1), axis=0)
    before = np.concatenate([np.zeros((1, *sums.shape[1:])), sums])
    hidden = np.zeros((n_moments + 1, 3), dtype=bool)
    hidden[2], hidden[5], hidden[6, 0], hidden[-1] = True, (True, False, True), True, True
    gains = explained(before[-1], SPACING)
    told = np.sort(gains, axis=1)[:, -WITNESSES:].sum(axis=1)
    moments = MomentsOfPairs(before, gains, told, pairs, hidden, SPACING)
    room = Room(
        np.empty((n_markers, n_markers)), np.empty(n_markers), np.empty(n_markers, dtype=np.intp), np.empty(WITNESSES)
    )
    found = np.empty((n_moments + 1, n_moments + 1))
    weigh_spans(moments, -np.inf, room, found)
    spans = {(2, 5): pairs[[0, 2]], (2, 8): pairs, (5, 8): pairs[[0, 2]]}
    assert {tuple(span) for span in np.argwhere(np.isfinite(found)).tolist()} == set(spans)
    for (first, end), exchanged in spans.items():
        tried = places.copy()
        tried[first:end, exchanged] = places[first:end, exchanged[:, ::-1]]
        assert found[first, end] == pytest.approx(evidence_of(distances_of(tried)), abs=ROUNDING)
    best = max(map(float, found[np.isfinite(found)]))
    weigh_spans(moments, best - ROUNDING, room, found)
    assert found[np.isfinite(found)].tolist() == [best]
