"""Moments in which the posture hardly changes count little in the evidence, if that is asked for."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels.merging.followed import WEIGHT_STEP, FollowedCloud

RATE, STILL, N_FRAMES, SPACING = 100.0, 300, 900, 100.0
TWICE, SHIFT = 4, 5.0  # the marker that is found twice, and how far skin moves as the body begins to [mm]


@pytest.fixture(scope="module")
def case() -> tuple[FollowedCloud, np.ndarray]:
    """A human who stands still for 3 s and moves for 6 s, every marker one track: the take, and true markers."""
    moving = simulate("human", n_frames=N_FRAMES - STILL, seed=1).take.positions
    positions = np.concatenate([np.repeat(moving[:1], STILL, axis=0), moving])
    positions[:STILL, TWICE, 2] += SHIFT
    positions = positions + np.random.default_rng(0).normal(0.0, 0.3, positions.shape)
    n_markers = positions.shape[1]
    cloud = PointCloud(positions.reshape(-1, 3), np.arange(N_FRAMES + 1) * n_markers, np.arange(N_FRAMES) / RATE)
    marker = np.tile(np.arange(n_markers, dtype=np.int32), N_FRAMES)
    return FollowedCloud(cloud, marker, RATE, SPACING), marker


def test_moments_of_a_still_posture_count_little_and_others_nearly_fully(case) -> None:
    take, _ = case
    moments = take.moments(take.cloud.points_per_frame[0])
    weights = replace(take, by_posture=True).weights(moments)
    still = (moments > moments[0]) & (moments < STILL)
    assert weights[still].max() < 0.1
    assert weights[moments > STILL + RATE].min() > 0.3
    assert weights[0] == 1.0  # there is no moment before
    assert (weights % WEIGHT_STEP == 0.0).all()
    assert (take.weights(moments) == 1.0).all()


def test_tracks_that_all_end_tell_nothing_of_the_posture(case) -> None:
    take, marker = case
    frame = take.frame_of_point()
    broken = replace(take, track_of_point=marker + 1000 * (frame // 10).astype(np.int32), by_posture=True)
    assert (broken.weights(take.moments(marker.max() + 1)) == 1.0).all()


def test_a_marker_that_is_seen_in_one_posture_only_explains_itself_once(case) -> None:
    take, marker = case
    twice = np.where((marker == TWICE) & (take.frame_of_point() < STILL), marker.max() + 1, marker)
    assert take.evidence(twice)[0] > take.evidence(marker)[0]
    by_posture = replace(take, by_posture=True)
    assert by_posture.evidence(twice)[0] < by_posture.evidence(marker)[0]


def test_distances_are_those_of_all_moments(case) -> None:
    take, marker = case
    np.testing.assert_array_equal(replace(take, by_posture=True).distances(marker), take.distances(marker))
