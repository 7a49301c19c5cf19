"""Places of three marks, against all triples of places that are as far apart as the marks."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from skelgen._kernels.triple_matching import MarkPattern, matching_triples

LIMIT = 3.0  # mm


@pytest.fixture
def pattern() -> MarkPattern:
    offsets = 100.0 * np.random.default_rng(0).normal(size=(4, 3))
    distances = np.linalg.norm(offsets[:, np.newaxis] - offsets, axis=2)
    return MarkPattern(distances, np.full((4, 4), LIMIT), np.array([[0, 1, 2], [1, 2, 3]], dtype=np.intp))


def test_all_triples_of_places_with_the_distances_of_the_marks_are_found(pattern):
    places = np.random.default_rng(1).uniform(-150.0, 150.0, (150, 3))
    parts = np.array([[0, 150], [0, 150], [0, 150], [50, 150]])
    apart = np.linalg.norm(places[:, np.newaxis] - places, axis=2)
    expected = [
        (row, *match)
        for row, marks in enumerate(pattern.triples.tolist())
        for match in itertools.product(*(range(*parts[mark]) for mark in marks))
        if all(
            apart[match[one], match[two]] > 0
            and abs(apart[match[one], match[two]] - pattern.distances[marks[one], marks[two]]) < LIMIT
            for one, two in ((0, 1), (0, 2), (1, 2))
        )
    ]
    triples, matches = matching_triples(pattern, places, parts, 1000)
    assert [(int(row), *match) for row, match in zip(triples, matches.tolist(), strict=True)] == expected
    assert {row for row, *_ in expected} == {0, 1}


def test_the_first_matches_are_kept_where_there_are_too_many(pattern):
    places = np.random.default_rng(1).uniform(-150.0, 150.0, (150, 3))
    parts = np.tile((0, 150), (4, 1))
    triples, matches = matching_triples(pattern, places, parts, 1000)
    some, first = matching_triples(pattern, places, parts, 2)
    assert np.bincount(some).tolist() == [2, 2]
    for triple in (0, 1):
        np.testing.assert_array_equal(first[some == triple], matches[triples == triple][:2])


def test_nothing_matches_without_places(pattern):
    triples, matches = matching_triples(pattern, np.empty((0, 3)), np.zeros((4, 2), dtype=np.intp), 10)
    assert (len(triples), matches.shape) == (0, (0, 3))
