"""Candidates that share a ball, decided by what is rigid: known targets, and distances that hold over time."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.markers.correspondences import (
    accept_best_first,
    evidence_over_time,
    find_markers,
    markers_of_pairs,
)
from skelgen.capture.markers.rigidity import NO_PAIR, learned_triangles, triangles_of_targets
from skelgen.model.rig import BodyTarget

SEEDS = (0, 1, 2)


def by_time(recording):
    pairs = recording.pairs
    accepted = accept_best_first(pairs, evidence_over_time(recording.candidates, pairs, recording.settings.rig.noise))
    return pairs, accepted


def judged(recording, targets):
    rig, bodies = recording.settings.rig, recording.settings.bodies if targets else ()
    kept = find_markers(recording.candidates, recording.pairs, rig.noise, recording.step, bodies)
    return recording.wrong_part(kept)


@pytest.fixture(scope="module")
def slow(projected):
    """Ten pairs of images a second, and a camera that was touched: neither time nor the epipolar line tells much."""
    return [projected("arm", seed, n_frames=100, rate=10.0, turned=0.3) for seed in SEEDS]


def test_known_targets_decide_nearly_all_ambiguous_pairs(slow):
    time_alone = np.mean(
        [recording.wrong_part(by_time(recording)[1][by_time(recording)[0].of_candidate]) for recording in slow]
    )
    assert time_alone > 0.1
    assert np.mean([judged(recording, targets=True) for recording in slow]) < 0.03


def test_distances_that_hold_decide_most_of_them_without_targets(slow):
    assert np.mean([judged(recording, targets=False) for recording in slow]) < 0.1


def test_what_time_tells_well_is_not_spoiled(projected):
    for seed in SEEDS:
        recording = projected("rods", seed, n_frames=120, rate=60.0)
        pairs, accepted = by_time(recording)
        assert judged(recording, targets=True) <= recording.wrong_part(accepted[pairs.of_candidate])


def test_learned_sides_are_those_of_the_bodies(projected):
    recording = projected("arm", 0, n_frames=120, rate=60.0)
    pairs, accepted = by_time(recording)
    kept = accepted[pairs.of_candidate]
    marker = markers_of_pairs(pairs, accepted).marker[pairs.of_candidate]
    learned, known = (
        learned_triangles(recording.candidates, kept, marker),
        triangles_of_targets(recording.settings.bodies),
    )
    gaps = np.abs(learned.sides[:, np.newaxis] - known.sides).max(axis=2).min(axis=1)
    assert len(learned) >= len(known) / 2
    assert np.median(gaps) < 0.5  # mm: the noise of a distance, averaged over its frames


def test_a_target_of_four_balls_has_four_triangles_seen_from_each_ball():
    target = BodyTarget("plate", np.array([[0, 0, 0], [30, 0, 0], [0, 40, 0], [0, 0, 50.0]]), np.full((4, 3), 0.1))
    triangles = triangles_of_targets([target])
    assert len(triangles) == 12 and (triangles.learned_from == NO_PAIR).all()
    assert (np.abs(triangles.sides - [30, 40, 50]).max(axis=1) < 1e-9).sum() == 1
    assert len(triangles_of_targets([])) == 0


def test_a_body_does_not_bear_witness_for_itself(projected):
    """Of one piece each, learned triangles say nothing of the pieces that they were learned from."""
    recording = projected("arm", 1, n_frames=60, rate=60.0)
    pairs, accepted = by_time(recording)
    markers = markers_of_pairs(pairs, accepted)
    counts = np.bincount(pairs.of_candidate)
    sole = accepted & (
        np.bincount(markers.marker[accepted], counts[accepted], markers.marker.max() + 1)[markers.marker] == counts
    )
    assert sole.any() and (markers.own[sole] == markers.marker[sole]).all()
    assert (markers.own[~accepted] < 0).all()
