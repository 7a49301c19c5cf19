"""Exchanges, moves, chains and groups work together: what one of them opens, the next one finishes."""

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.turns import put_right

RATE, N_FRAMES, SPACING = 40.0, 800, 60.0
PLACES = np.array([[0, 0, 0], [70, 0, 0], [10, 60, 0], [65, 75, 20], [20, 30, 60], [-30, 20, 35]], dtype=float)  # mm
PAUSES, N = (slice(200, 220), slice(500, 520)), len(PLACES)


@pytest.fixture(scope="module")
def case(turning_limb) -> tuple[PointCloud, np.ndarray, np.ndarray]:
    """Six markers of a limb that turns; two pause at once, twice. The cloud, true markers and tracks."""
    positions = turning_limb(PLACES, N_FRAMES)
    seen = np.ones(positions.shape[:2], dtype=bool)
    for pause in PAUSES:
        seen[pause, :2] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(N_FRAMES) / RATE)
    part = sum((frame >= pause.stop).astype(int) for pause in PAUSES)
    return cloud, marker, marker + N * np.where(marker < 2, part, 0)


def test_a_marker_under_three_numbers_of_which_one_is_anothers_becomes_one(case) -> None:
    cloud, marker, track = case
    wrong = np.where((track >= N) & (track < 2 * N), 1 - marker, marker)
    wrong = np.where(track == 2 * N, 1, np.where(track == 2 * N + 1, N, wrong))
    found = put_right(FollowedCloud(cloud, track, RATE, SPACING), wrong)
    pairs = np.unique(np.stack([found, marker]), axis=1)
    assert pairs.shape[1] == N


def test_right_labels_stay(case) -> None:
    cloud, marker, track = case
    assert put_right(FollowedCloud(cloud, track, RATE, SPACING), marker) is marker


class VeryLong(FollowedCloud):
    """A take that counts as very long."""

    is_very_long = True


def test_very_long_takes_are_put_right_without_the_moves_that_need_much_memory(case) -> None:
    cloud, marker, track = case
    wrong = np.where((track >= N) & (marker < 2), 1 - marker, marker)
    np.testing.assert_array_equal(put_right(VeryLong(cloud, track, RATE, SPACING), wrong), marker)
    apart = np.unique(track, return_inverse=True)[1]
    n_found = [put_right(take(cloud, track, RATE, SPACING), apart).max() + 1 for take in (FollowedCloud, VeryLong)]
    assert n_found[0] == N < n_found[1]  # chains and groups of what was hidden at once join the parts
