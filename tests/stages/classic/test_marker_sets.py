"""Marker Sets, their distances over aligned poses, and their grouping into markers."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.classic.aligned_distances import Alignment, find_distances
from skelgen.stages.classic.marker_sets import SPECTRAL, SetMethod, cut_spectrally, join_nearest
from skelgen.stages.labels import LabelParameters
from skelgen.stages.labels.tracking.follow import find_tracklets

RATE = 100.0
# Distances of rigid bodies are 0 up to the rounding of coordinates of some 1000 mm.
ROUNDING = 1e-9


def cloud_of(positions):
    """A cloud and the column of each point from positions (n_frames, n, 3) with NaN."""
    seen = ~np.isnan(positions[..., 0])
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(len(positions)) / RATE)
    return cloud, np.nonzero(seen)[1]


@pytest.fixture
def rigid():
    """Six markers on one tumbling rigid body over 200 frames; every shape-preserving distance is 0."""
    random = np.random.default_rng(0)
    body = random.normal(scale=100.0, size=(6, 3))
    angles = np.linspace(0, 3, 200)
    turns = np.array([[[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]] for a in angles])
    return body, (turns @ body.T).swapaxes(1, 2) + np.linspace(0, 1000, 200)[:, np.newaxis, np.newaxis]


@pytest.fixture
def broken(rigid):
    """The rigid body with markers 0 and 1 lost halfway, and found again as columns 6 and 7."""
    _, positions = rigid
    both = np.concatenate([positions, positions[:, :2]], axis=1)
    both[90:, :2] = np.nan
    both[:110, 6:] = np.nan
    return both


def distances_of(positions, trim_range=2, n_neighbours=5, misfit_weight=1.0, sampling=10):
    cloud, track_of_point = cloud_of(positions)
    sets = find_tracklets(cloud, track_of_point, RATE, LabelParameters(trim_range=trim_range))
    return find_distances(cloud.points, sets, sets.overlaps, Alignment(n_neighbours, misfit_weight, sampling))


def spectral_method(clustering, limit, sigma=0.0):
    return SetMethod(Alignment(None, 0.0, 10), clustering, limit, least_length=1, stand_alone=1, seed=0, sigma=sigma)


def test_short_sets_are_removed_and_the_rest_trimmed_inside_the_take(rigid):
    positions = rigid[1].copy()
    positions[100:, 0] = np.nan  # ends inside the take: trimmed there
    positions[49:, 1] = np.nan  # 49 frames where half a second is 50: removed
    cloud, track_of_point = cloud_of(positions)
    sets = find_tracklets(cloud, track_of_point, RATE, LabelParameters(trim_range=7))
    assert sets.lengths.tolist() == [93, 200, 200, 200, 200]
    assert sets.first.tolist() == [0] * 5
    assert sets.last.tolist() == [92, 199, 199, 199, 199]


def test_markers_are_counted_where_most_are_seen_at_once(broken):
    cloud, track_of_point = cloud_of(broken)
    sets = find_tracklets(cloud, track_of_point, RATE, LabelParameters())
    assert sets.most_at_once(50) == 6


@pytest.mark.parametrize("n_neighbours", [None, 5])
def test_sets_of_one_rigid_marker_meet_exactly(broken, n_neighbours):
    distance = distances_of(broken, n_neighbours=n_neighbours)
    assert distance[0, 6] < ROUNDING
    assert distance[1, 7] < ROUNDING


def test_sets_of_different_rigid_markers_are_as_far_apart_as_the_markers(broken, rigid):
    apart = np.linalg.norm(rigid[0][0] - rigid[0][1])
    distance = distances_of(broken)
    assert np.allclose([distance[0, 7], distance[1, 6]], apart, atol=ROUNDING)


def test_distances_are_symmetric_and_infinite_for_sets_that_overlap(broken):
    distance = distances_of(broken)
    assert np.array_equal(distance, distance.T)
    assert np.isinf(distance[2, 3])
    assert np.isinf(distance[0, 1])


@pytest.mark.parametrize("n_shared", [2, 3])
def test_three_shared_sets_are_needed(broken, n_shared):
    kept = [0, 6, *range(2, 2 + n_shared)]
    distance = distances_of(broken[:, kept])
    assert np.isfinite(distance[0, 1]) == (n_shared == 3)


def test_shared_sets_on_a_line_align_nothing(broken):
    line = broken.copy()
    line[:, 4] = 2 * line[:, 3] - line[:, 2]
    line[:, 5] = 3 * line[:, 3] - 2 * line[:, 2]
    assert np.isinf(distances_of(line)[0, 6])


def test_refinement_finds_the_pose_between_the_samples():
    """A marker that moves on its body meets itself only where it was lost, between two samples of a wide interval."""
    random = np.random.default_rng(1)
    positions = np.tile(random.normal(scale=100.0, size=(6, 3)), (200, 1, 1))
    positions[:, 0, 0] += np.abs(np.arange(200) - 93.0)
    positions = np.concatenate([positions, positions[:, :1]], axis=1)
    positions[98:, 0] = np.nan
    positions[:99, 6] = np.nan
    options = {"sampling": 20, "trim_range": 0}
    assert distances_of(positions, **options)[0, 6] <= 2.0  # samples 80 and 100 alone give 6


def test_misfit_of_the_poses_counts(broken):
    bent = broken.copy()
    bent[100:, 2] += 30.0  # the pose after the gap is another one
    without = distances_of(bent, misfit_weight=0.0, n_neighbours=None)[0, 6]
    assert distances_of(bent, n_neighbours=None)[0, 6] > without


def test_joining_never_joins_sets_that_overlap():
    random = np.random.default_rng(2)
    distance = random.uniform(1, 100, size=(30, 30))
    distance = np.minimum(distance, distance.T)
    overlaps = random.uniform(size=(30, 30)) < 0.2
    overlaps |= overlaps.T | np.eye(30, dtype=bool)
    distance[overlaps] = np.inf
    for group in (
        join_nearest(distance, overlaps, 5, 1000.0, "average"),
        join_nearest(distance, overlaps, 5, 1000.0, "complete"),
        *(cut_spectrally(distance, overlaps, 5, spectral_method(one, 1000.0)) for one in SPECTRAL),
    ):
        together = (group[:, np.newaxis] == group) & ~np.eye(30, dtype=bool)
        assert not (together & overlaps).any()
        assert np.array_equal(np.unique(group), np.arange(group.max() + 1))


@pytest.mark.parametrize("clustering", ["average", "complete", *SPECTRAL])
def test_clear_groups_are_found(clustering):
    truth = np.repeat(np.arange(6), 5)
    gap = np.abs(truth[:, np.newaxis] - truth) * 50.0
    distance = gap + np.random.default_rng(3).uniform(0, 5, size=(30, 30))
    distance = np.minimum(distance, distance.T)
    np.fill_diagonal(distance, 0.0)
    overlaps = np.eye(30, dtype=bool)
    if clustering in SPECTRAL:
        group = cut_spectrally(distance, overlaps, 6, spectral_method(clustering, 100.0))
    else:
        group = join_nearest(distance, overlaps, 6, 100.0, clustering)
    assert np.array_equal(group[:, np.newaxis] == group, truth[:, np.newaxis] == truth)


def test_farther_than_the_limit_is_not_joined():
    distance = np.array([[0.0, 5.0, 50.0], [5.0, 0.0, 50.0], [50.0, 50.0, 0.0]])
    group = join_nearest(distance, np.eye(3, dtype=bool), 1, 20.0, "average")
    assert group.tolist() == [0, 0, 1]


def test_average_linkage_is_the_mean_of_known_distances():
    distance = np.array([[0, 1, 10, np.inf], [1, 0, 20, 12.0], [10, 20, 0, 14.5], [np.inf, 12, 14.5, 0]])
    # After 0 and 1 are joined, 3 is 12 from them (one distance is unknown), 2 is 15 from them and 14.5 from 3.
    group = join_nearest(distance, np.eye(4, dtype=bool), 2, 100.0, "average")
    assert group.tolist() == [0, 0, 1, 0]


def test_sampling_that_is_asked_for_is_obeyed_in_long_takes():
    assert Alignment(5, 1.0, 3).step(10_000) == 3
    assert Alignment(5, 1.0, 0).step(10_000) == 100


@pytest.mark.parametrize("clustering", SPECTRAL)
def test_sets_beyond_the_limit_share_no_cluster(clustering):
    truth = np.repeat(np.arange(4), 3)
    distance = np.where(truth[:, np.newaxis] == truth, 2.0, 80.0)
    np.fill_diagonal(distance, 0.0)
    group = cut_spectrally(distance, np.eye(12, dtype=bool), 3, spectral_method(clustering, 20.0))
    together = group[:, np.newaxis] == group
    assert not (together & (truth[:, np.newaxis] != truth)).any()


def test_a_wrong_global_sigma_is_worse_than_the_scan():
    truth = np.repeat(np.arange(6), 4)
    random = np.random.default_rng(4)
    distance = np.where(truth[:, np.newaxis] == truth, random.uniform(0, 4, (24, 24)), random.uniform(10, 90, (24, 24)))
    distance = np.minimum(distance, distance.T)
    np.fill_diagonal(distance, 0.0)
    groups = {
        sigma: cut_spectrally(distance, np.eye(24, dtype=bool), 6, spectral_method("global-spectral", 100.0, sigma))
        for sigma in (0.0, 1000.0)
    }
    right = {sigma: (group[:, None] == group) == (truth[:, None] == truth) for sigma, group in groups.items()}
    assert right[0.0].all()
    assert not right[1000.0].all()
