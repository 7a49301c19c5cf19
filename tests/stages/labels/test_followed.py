"""How much moments count: little where the posture hardly changes, as a part of one where a take is short."""

from dataclasses import replace

import numpy as np
import pytest

from skelgen._kernels.marker_exchanges import LEAST_GAIN
from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels.merging.followed import WEIGHT_STEP, FollowedCloud
from skelgen.stages.labels.merging.likelihood import SAMPLE_SECONDS, sample_frames

RATE, STILL, N_FRAMES, N_SHORT, SPACING = 100.0, 300, 900, 200, 100.0
TWICE, SHIFT = 4, 5.0  # the marker that is found twice, and how far skin moves as the body begins to [mm]


def _take(positions: np.ndarray) -> tuple[FollowedCloud, np.ndarray]:
    """Every marker one track, with noise: the take, and true markers."""
    n_frames, n_markers, _ = positions.shape
    positions = positions + np.random.default_rng(0).normal(0.0, 0.3, positions.shape)
    cloud = PointCloud(positions.reshape(-1, 3), np.arange(n_frames + 1) * n_markers, np.arange(n_frames) / RATE)
    marker = np.tile(np.arange(n_markers, dtype=np.int32), n_frames)
    return FollowedCloud(cloud, marker, RATE, SPACING), marker


@pytest.fixture(scope="module")
def case() -> tuple[FollowedCloud, np.ndarray]:
    """A human who stands still for 3 s and moves for 6 s, every marker one track: the take, and true markers."""
    moving = simulate("human", n_frames=N_FRAMES - STILL, seed=1).take.positions
    positions = np.concatenate([np.repeat(moving[:1], STILL, axis=0), moving])
    positions[:STILL, TWICE, 2] += SHIFT
    return _take(positions)


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


def test_distances_are_those_of_independent_moments_whatever_these_count(case) -> None:
    take, marker = case
    np.testing.assert_array_equal(replace(take, by_posture=True).distances(marker), take.distances(marker))


@pytest.fixture(scope="module")
def short() -> tuple[FollowedCloud, np.ndarray]:
    """A human who moves for 2 s, every marker one track: the take, and true markers."""
    return _take(simulate("human", n_frames=N_SHORT, seed=1).take.positions)


@pytest.mark.parametrize("by_posture", [False, True])
def test_short_takes_are_looked_at_more_often_without_more_evidence(short, by_posture: bool) -> None:
    take = replace(short[0], by_posture=by_posture)
    moments = take.moments(take.cloud.points_per_frame[0])
    n_independent = int(N_SHORT / RATE / SAMPLE_SECONDS)
    assert len(moments) > 2 * n_independent
    assert take.weights(moments).sum() <= 1.1 * n_independent


def test_what_is_wrong_between_two_independent_moments_speaks_in_a_short_take(short) -> None:
    take, marker = short
    before, behind = sample_frames(RATE, 0, N_SHORT)[2:4]
    between = (take.frame_of_point() > before) & (take.frame_of_point() < behind)
    exchanged = marker.copy()
    for one, other in ((2, 9), (9, 2)):
        exchanged[between & (marker == one)] = other
    np.testing.assert_array_equal(take.distances(exchanged), take.distances(marker))
    assert take.evidence(exchanged)[0] < take.evidence(marker)[0] - LEAST_GAIN


@pytest.mark.parametrize("n_frames", [1, 2, 5, 30])
def test_there_is_a_moment_in_any_take(short, n_frames: int) -> None:
    take, marker = _take(short[0].cloud.points.reshape(N_SHORT, -1, 3)[:n_frames])
    weights = take.weights(take.moments(marker.max() + 1))
    assert len(weights) > 0
    assert (weights > 0.0).all()
