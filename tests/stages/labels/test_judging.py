"""Which of two ways to label a take explains it better."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.simulation import simulate
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import better_labels, explains_more, has_too_many
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing


@pytest.fixture(scope="module")
def person() -> tuple[FollowedCloud, np.ndarray, np.ndarray]:
    """A cloud, its true labels, and labels by which every marker is another one in the second half."""
    case = simulate("human", n_frames=800, seed=0, noise=0.5, soft_tissue=3.0, labelled=False)
    tracks, _ = follow_points(case.take, LabelParameters())
    take = FollowedCloud(case.take, tracks, 100.0, typical_spacing(case.take))
    true = case.truth.marker_of_point
    is_late = take.frame_of_point() >= 400
    return take, true, np.where(is_late & (true >= 0), true + true.max() + 1, true)


def test_markers_that_are_each_two_explain_less(person):
    take, true, split = person
    assert explains_more(take, split, true, counts_markers=True)
    assert not explains_more(take, true, split, counts_markers=True)
    assert better_labels(take, split, true) is true
    assert better_labels(take, true, split) is true


def test_twice_the_markers_that_are_seen_at_once_are_too_many(person):
    take, true, split = person
    assert has_too_many(take, split)
    assert not has_too_many(take, true)


def test_too_few_markers_are_no_better(person):
    take, true, split = person
    assert not explains_more(take, split, np.where(true < 10, true, -1), counts_markers=True)


def test_no_fewer_markers_are_no_better_where_these_count(person):
    take, _, split = person
    assert not explains_more(take, np.where(np.arange(len(split)) % 2, split, -1), split, counts_markers=True)
