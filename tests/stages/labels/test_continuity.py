"""Tracklets that go on where others ended."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.simulation import simulate
from skelgen.stages.labels.merging.windows import continuity_evidence
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import find_tracklets, follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing


@pytest.fixture(scope="module")
def found():
    case = simulate("human", n_frames=800, seed=0, dropouts=0.15, noise=0.5, labelled=False)
    track_of_point, _ = follow_points(case.take, LabelParameters())
    sets = find_tracklets(case.take, track_of_point, 100.0, LabelParameters())
    pairs = continuity_evidence(case.take.points, sets, 100.0, typical_spacing(case.take))
    marker = case.truth.marker_of_point[sets.points[sets.starts[:-1]]]
    return sets, marker, pairs


def test_true_successors_have_more_evidence_than_false_ones(found):
    _, marker, (before, after, evidence) = found
    same = marker[before] == marker[after]
    assert same.sum() > 20
    assert np.median(evidence[same]) > 1.0
    assert np.quantile(evidence[~same], 0.98) < np.median(evidence[same])


def test_pairs_follow_each_other_within_half_a_second(found):
    sets, _, (before, after, _) = found
    gap = sets.first[after] - sets.last[before]
    assert ((gap > 0) & (gap <= 50)).all()


def test_two_sets_without_neighbours_say_nothing(found):
    sets, _, _ = found
    few = sets.chosen(np.arange(len(sets)) < 2)
    case = simulate("human", n_frames=800, seed=0, dropouts=0.15, noise=0.5, labelled=False)
    _, _, evidence = continuity_evidence(case.take.points, few, 100.0, 100.0)
    assert not evidence.any()
