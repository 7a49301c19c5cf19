"""Markers that come back under each other's numbers are exchanged again, and nothing else is."""

import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.exchanges import GainsThatGrow, exchange_markers
from skelgen.stages.labels.merging.followed import FollowedCloud

RATE, N_FRAMES, SPACING = 40.0, 800, 60.0
PLACES = np.array([[0, 0, 0], [70, 0, 0], [10, 60, 0], [65, 70, 20], [20, 30, 60]], dtype=float)  # mm, on one limb
PAUSE, SECOND = slice(380, 400), slice(460, 480)


@pytest.fixture(scope="module")
def case(turning_limb) -> tuple[PointCloud, np.ndarray, np.ndarray]:
    """Five markers of a limb that turns; two of them pause at once, twice. The cloud, true markers and tracks."""
    positions = turning_limb(PLACES, N_FRAMES)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[PAUSE, :2] = seen[SECOND, :2] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(N_FRAMES) / RATE)
    n_pauses = (frame >= PAUSE.stop).astype(int) + (frame >= SECOND.stop)
    return cloud, marker, marker + len(PLACES) * np.where(marker < 2, n_pauses, 0)


def exchanged(marker: np.ndarray, track: np.ndarray) -> np.ndarray:
    """The first two markers under each other's numbers after their pause."""
    return np.where(track >= len(PLACES), 1 - marker, marker)


def test_markers_that_come_back_as_each_other_are_exchanged(case) -> None:
    cloud, marker, track = case
    found = exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), exchanged(marker, track))
    np.testing.assert_array_equal(found, marker)


def test_markers_that_are_each_other_between_two_pauses_are_exchanged(case) -> None:
    cloud, marker, track = case
    between = (track >= len(PLACES)) & (track < 2 * len(PLACES))
    found = exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), np.where(between, 1 - marker, marker))
    np.testing.assert_array_equal(found, marker)


def test_a_piece_of_one_marker_goes_back_to_the_one_that_is_not_seen_meanwhile(case) -> None:
    cloud, marker, track = case
    is_piece = (marker == 1) & (track >= len(PLACES)) & (track < 2 * len(PLACES))
    hidden = (marker == 0) & (track >= len(PLACES)) & (track < 2 * len(PLACES))
    truth = np.where(hidden, -1, marker)
    found = exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), np.where(is_piece, 0, truth))
    np.testing.assert_array_equal(found, truth)


def test_an_exchange_is_made_again_only_if_that_gains_more() -> None:
    made, exchange = GainsThatGrow(), (3, 5, 24, 27)
    assert [made.grows(exchange, gain) for gain in (15.0, 40.0, 15.0, 40.0)] == [True, True, False, False]
    assert made.grows((3, 5, 10, 27), 15.0)


def test_right_labels_stay(case) -> None:
    cloud, marker, track = case
    assert exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), marker) is marker


def test_what_the_user_states_stays(case) -> None:
    cloud, marker, track = case
    wrong = exchanged(marker, track)
    assert exchange_markers(FollowedCloud(cloud, track, RATE, SPACING, track == len(PLACES)), wrong) is wrong


def test_markers_that_do_not_pause_at_once_are_never_exchanged(case) -> None:
    cloud, marker, _ = case
    wrong = np.where(np.arange(len(marker)) > len(marker) // 2, np.array([0, 1, 2, 4, 3])[marker], marker)
    assert exchange_markers(FollowedCloud(cloud, wrong, RATE, SPACING), wrong) is wrong


def test_a_take_without_markers_has_nothing_to_exchange(case) -> None:
    cloud, marker, track = case
    nothing = np.full(len(marker), -1)
    assert exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), nothing) is nothing


def test_of_thousands_of_common_pauses_the_longest_are_looked_at() -> None:
    n_frames, n_markers, longest = 20_000, len(PLACES), slice(9_000, 9_030)
    positions = np.random.default_rng(1).normal(PLACES, 0.3, (n_frames, *PLACES.shape))
    seen = np.ones((n_frames, n_markers), dtype=bool)
    seen[::10, :2] = seen[longest, :2] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(n_frames) / RATE)
    track = np.where(marker < 2, n_markers + 2 * (frame // 10) + marker, marker)
    wrong = np.where((marker < 2) & (frame >= longest.stop), 1 - marker, marker)
    tracemalloc.start()
    found = exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), wrong)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    np.testing.assert_array_equal(found, marker)
    assert peak < 60e6, f"{peak / 1e6:.0f} MB"  # bytes; all spans between two pauses would take twice as many


def test_toes_that_are_as_far_from_all_others_are_exchanged_by_their_sides(turning_limb) -> None:
    """Distances cannot tell which is which: the limb would be its mirror image."""
    places = np.array([[35, 0, 0], [-35, 0, 0], [0, -150, 0], [0, -120, 80], [0, -60, 50], [0, -30, 60]], dtype=float)
    positions = turning_limb(places, N_FRAMES)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[PAUSE, :2] = seen[SECOND, :2] = False
    frame, marker = np.nonzero(seen)
    cloud = PointCloud(positions[seen], np.concatenate([[0], np.cumsum(seen.sum(axis=1))]), np.arange(N_FRAMES) / RATE)
    track = marker + len(places) * np.where(marker < 2, (frame >= PAUSE.stop).astype(int) + (frame >= SECOND.stop), 0)
    for is_wrong in ((frame >= SECOND.stop), (frame >= PAUSE.stop) & (frame < SECOND.stop)):
        wrong = np.where((marker < 2) & is_wrong, 1 - marker, marker)
        np.testing.assert_array_equal(exchange_markers(FollowedCloud(cloud, track, RATE, SPACING), wrong), marker)


def test_markers_that_keep_no_distance_are_exchanged_by_their_gaps(turning_limb) -> None:
    """They wander on a limb, so distances say nothing; but they go on where the limb carries them meanwhile."""
    time = np.linspace(0.0, 30.0, N_FRAMES)[:, np.newaxis]
    loose = [
        np.concatenate([45.0 * np.sin(time + phase), 45.0 * np.cos(0.7 * time + phase)], axis=1) for phase in (0.0, 2.0)
    ]
    positions = turning_limb(PLACES, N_FRAMES)
    wandering = np.stack([positions[:, 2] + np.pad(away, ((0, 0), (0, 1))) for away in loose], axis=1)
    positions = np.concatenate([wandering, positions], axis=1)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[400:403, :2] = False
    frame, marker = np.nonzero(seen)
    cloud = PointCloud(positions[seen], np.concatenate([[0], np.cumsum(seen.sum(axis=1))]), np.arange(N_FRAMES) / RATE)
    track = marker + positions.shape[1] * ((marker < 2) & (frame >= 403))
    wrong = np.where((marker < 2) & (frame >= 403), 1 - marker, marker)
    take = FollowedCloud(cloud, track, RATE, SPACING)
    assert exchange_markers(take, wrong) is wrong
    np.testing.assert_array_equal(exchange_markers(replace(take, exchanges_over_gaps=True), wrong), marker)
