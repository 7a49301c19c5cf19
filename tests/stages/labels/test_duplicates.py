"""Markers that were found twice are joined, those that are two are not."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import existence
from skelgen.stages.labels.merging.markers import join_duplicates

N_FRAMES, STILL, RATE, SPACING = 900, 150, 100.0, 100.0
TWICE = (4, 20, 33)  # markers that get another number when the body begins to move
SHIFT = 50.0  # mm that skin moves as it does


@pytest.fixture(scope="module")
def still_then_moving():
    """A human who stands still for 1.5 s and then moves; each marker is hidden now and then. Cloud and true markers."""
    moving = simulate("human", n_frames=N_FRAMES - STILL, soft_tissue=2.0, seed=1).take.positions
    rng = np.random.default_rng(0)
    positions = np.concatenate([np.repeat(moving[:1], STILL, axis=0), moving])
    positions = positions + rng.normal(0.0, 0.3, positions.shape)
    seen = np.ones(positions.shape[:2], dtype=bool)
    for marker in range(positions.shape[1]):
        for start in rng.integers(0, N_FRAMES, 6):
            seen[start : start + 20, marker] = False
    seen[STILL - 10 : STILL + 10, list(TWICE)] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    return PointCloud(positions[frame, marker], starts, np.arange(N_FRAMES) / RATE), marker, frame


def test_markers_found_once_for_a_still_pose_and_once_for_the_rest_are_joined(still_then_moving):
    cloud, true, frame = still_then_moving
    found = true.copy()
    for number, marker in enumerate(TWICE):
        found[(true == marker) & (frame >= STILL)] = true.max() + 1 + number
    assert np.array_equal(join_duplicates(FollowedCloud(cloud, found, RATE, SPACING), found), true)


def test_markers_are_joined_across_a_change_of_shape_that_nothing_else_explains(still_then_moving):
    cloud, true, frame = still_then_moving
    found, points = true.copy(), cloud.points.copy()
    for number, marker in enumerate(TWICE):
        found[(true == marker) & (frame >= STILL)] = true.max() + 1 + number
    points[np.isin(true, TWICE) & (frame < STILL), 2] += SHIFT
    shifted = PointCloud(points, cloud.frame_starts, cloud.times)
    assert np.array_equal(join_duplicates(FollowedCloud(shifted, found, RATE, SPACING), found), true)


def test_markers_that_are_seen_together_stay_two(still_then_moving):
    cloud, true, _ = still_then_moving
    assert np.array_equal(join_duplicates(FollowedCloud(cloud, true, RATE, SPACING), true), true)


def test_a_marker_at_another_place_stays_another_one(still_then_moving):
    cloud, true, frame = still_then_moving
    of_first, of_other = (true == 4) & (frame >= STILL), (true == 30) & (frame < STILL)
    found = np.where(of_first | of_other, -1, true)
    assert np.array_equal(join_duplicates(FollowedCloud(cloud, found, RATE, SPACING), found), found)


def test_where_markers_are_hidden_for_long_another_one_is_less_unlikely():
    seen = np.arange(N_FRAMES) // 100 % 2 == 0
    cloud = PointCloud(np.zeros((seen.sum(), 3)), np.concatenate([[0], np.cumsum(seen)]), np.arange(N_FRAMES) / RATE)
    assert existence(cloud, np.zeros(cloud.n_points, dtype=np.intp)) == pytest.approx(N_FRAMES / 100)


def _taking_turns(first: int, second: int) -> tuple[FollowedCloud, np.ndarray]:
    """1.2 s of a walk in which a marker is seen no more when another one appears: the take, and true markers."""
    positions = simulate("human", n_frames=120, seed=0, motion="walk").take.positions
    positions = positions + np.random.default_rng(0).normal(0.0, 0.3, positions.shape)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[40:, first] = seen[:60, second] = False
    rng = np.random.default_rng(1)
    for marker in range(positions.shape[1]):
        for start in rng.integers(0, len(positions), 2):
            seen[start : start + 15, marker] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[frame, marker], starts, np.arange(len(positions)) / RATE)
    return FollowedCloud(cloud, marker.astype(np.int32), RATE, SPACING), marker.astype(np.int32)


def test_a_join_that_the_whole_of_a_short_take_contradicts_is_spared():
    take, true = _taking_turns(0, 1)
    joined = join_duplicates(take, true)
    assert take.has_few_moments
    assert joined.max() < true.max()
    assert take.evidence(joined)[0] < take.evidence(true)[0] - existence(take.cloud, true)
    assert np.array_equal(join_duplicates(replace(take, joins_sparingly=True), true), true)


def test_parts_of_one_marker_are_joined_sparingly_too():
    take, true = _taking_turns(0, 1)
    kept = np.where(true < 2, -1, true - 2).astype(np.int32)
    later = (kept == 20) & (take.frame_of_point() >= 60)
    parts = np.where(later, kept.max() + 1, kept).astype(np.int32)
    assert np.array_equal(join_duplicates(replace(take, joins_sparingly=True), parts), kept)
