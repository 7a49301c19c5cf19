"""Tracklets merged by the likelihood of their distances, at once and window by window."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels import label_markers
from skelgen.stages.labels.merging.likelihood import DistanceRecord, distance_sums, merge_likely
from skelgen.stages.labels.merging.windows import WindowSize, merge_tracklets
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import find_tracklets, follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing

OCCLUDED = {"n_cameras": 6, "soft_tissue": 2.0, "ghosts": 0.2, "noise": 0.3, "labelled": False}


def moving_points(rng, n_moments, places):
    """A rigid body that turns and moves at random, shape (n_moments, n, 3)."""
    turns = np.linalg.qr(rng.normal(size=(n_moments, 3, 3)))[0]
    return np.einsum("fij,nj->fni", turns, places) + rng.normal(size=(n_moments, 1, 3)) * 500


def record_of(positions, spacing=80.0):
    sums = distance_sums(positions)
    return DistanceRecord(np.stack(sums), sums[0] > 0, spacing)


def halves(rng, places):
    """The last marker is seen under one name in the first half and under another in the second."""
    whole = moving_points(rng, 60, places) + rng.normal(size=(60, len(places), 3))
    split = np.concatenate([whole, whole[:, -1:]], axis=1)
    split[:30, -1] = split[30:, -2] = np.nan
    return split


@pytest.mark.parametrize("seed", range(3))
def test_two_halves_of_a_marker_on_a_rigid_body_are_joined(seed):
    rng = np.random.default_rng(seed)
    group = merge_likely(record_of(halves(rng, rng.normal(size=(6, 3)) * 100)))
    np.testing.assert_array_equal(group, [0, 1, 2, 3, 4, 5, 5])


@pytest.mark.parametrize("seed", range(3))
def test_two_markers_that_take_turns_are_not_joined(seed):
    rng = np.random.default_rng(seed)
    places = rng.normal(size=(7, 3)) * 100
    positions = moving_points(rng, 60, places) + rng.normal(size=(60, 7, 3))
    positions[:30, 5] = positions[30:, 6] = np.nan
    np.testing.assert_array_equal(merge_likely(record_of(positions)), np.arange(7))


def test_sets_that_are_seen_together_are_never_joined():
    positions = moving_points(np.random.default_rng(0), 40, np.zeros((5, 3)))
    assert len(np.unique(merge_likely(record_of(positions)))) == 5


def test_exact_distances_and_too_few_of_them_are_no_error():
    places = np.eye(3) * 100
    for n_moments in (0, 1, 2, 20):
        assert len(merge_likely(record_of(moving_points(np.random.default_rng(0), n_moments, places)))) == 3


def joined(case, sets_per_window):
    parameters = LabelParameters()
    track_of_point, _ = follow_points(case.take, parameters)
    sets = find_tracklets(case.take, track_of_point, 100.0, parameters)
    group = merge_tracklets(
        case.take.points, sets, 100.0, typical_spacing(case.take), window=WindowSize(sets_per_window, 1.0)
    )
    return sets, group


@pytest.mark.parametrize("sets_per_window", [1000, 30])
def test_joined_sets_are_pure_and_few_in_one_window_as_in_many(sets_per_window):
    case = simulate("human", n_frames=1000, seed=0, **OCCLUDED)
    sets, group = joined(case, sets_per_window)
    table = np.zeros((group.max() + 1, case.truth.marker_of_point.max() + 2))
    np.add.at(table, (group[sets.tracklet_of_point], case.truth.marker_of_point[sets.points]), 1)
    assert table.max(axis=1).sum() >= 0.995 * table.sum()
    assert len(table) <= 60 < len(sets)


def test_sets_of_one_group_never_overlap_in_time():
    sets, group = joined(simulate("human", n_frames=600, seed=1, **OCCLUDED), 20)
    same = (group[:, np.newaxis] == group) & ~np.eye(len(group), dtype=bool)
    assert not (same & sets.overlaps).any()


@pytest.mark.parametrize("structure", ["classic-human", "tree:8"])
def test_markers_are_found_again_after_a_pause_in_which_nothing_was_seen(structure):
    case = simulate(structure, n_frames=900, seed=0, noise=0.3, dropouts=0.02, labelled=False)
    cloud, truth = case.take, case.truth.marker_of_point
    frames = np.repeat(np.arange(cloud.n_frames), cloud.points_per_frame)
    kept = (frames < 400) | (frames >= 480)
    starts = np.concatenate([[0], np.cumsum(np.bincount(frames[kept], minlength=cloud.n_frames))])
    paused = PointCloud(cloud.points[kept], starts, cloud.times)
    labels = label_markers(paused, LabelParameters())[0]
    assert labels.n_markers == len(np.unique(truth[truth >= 0]))
    assert labels.seen[:400].any(axis=0).all()
    assert labels.seen[480:].any(axis=0).all()
