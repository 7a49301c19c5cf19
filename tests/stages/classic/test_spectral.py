"""k-means by local search: clear clusters from bad starts, and heuristics that differ."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.stages.classic.spectral import HEURISTICS, local_kmeans


@pytest.fixture
def clouds():
    """Twelve clouds of five points in twelve dimensions, and the cloud of each point."""
    truth = np.repeat(np.arange(12), 5)
    return np.eye(12)[truth] + np.random.default_rng(0).normal(scale=0.05, size=(60, 12)), truth


def distortion(rows, labels):
    return sum(((rows[labels == one] - rows[labels == one].mean(axis=0)) ** 2).sum() for one in np.unique(labels))


@pytest.mark.parametrize("heuristic", HEURISTICS)
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_clear_clusters_are_found(clouds, heuristic, seed):
    rows, truth = clouds
    labels = local_kmeans(rows, 12, heuristic, seed)
    assert np.array_equal(labels[:, np.newaxis] == labels, truth[:, np.newaxis] == truth)


def test_steps_of_lloyd_lower_what_swaps_reach():
    rows = np.random.default_rng(1).normal(size=(80, 3))
    swapped, moved = (distortion(rows, local_kmeans(rows, 7, heuristic, 0)) for heuristic in ("swap", "local-hybrid"))
    assert moved < swapped


def test_the_hybrid_walks_its_own_way():
    rows = np.random.default_rng(2).uniform(size=(200, 2))
    labels = [local_kmeans(rows, 9, heuristic, 0) for heuristic in ("hybrid", "local-hybrid")]
    assert not np.array_equal(*labels)
    assert distortion(rows, labels[0]) < 1.1 * distortion(rows, labels[1])
