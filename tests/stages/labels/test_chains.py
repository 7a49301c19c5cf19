"""A piece goes to the marker that it is and pushes out what is there, if the whole take says so."""

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.chains import push_pieces
from skelgen.stages.labels.merging.followed import FollowedCloud

RATE, N_FRAMES, SPACING = 40.0, 800, 60.0
PLACES = np.array(  # mm, on one limb
    [[0, 0, 0], [70, 0, 0], [10, 60, 0], [65, 75, 20], [20, 30, 60], [-30, 20, 35], [45, -40, 30]], dtype=float
)
PAUSE, WRONG, N = slice(380, 400), slice(400, 480), len(PLACES)


@pytest.fixture(scope="module")
def case(turning_limb) -> tuple[PointCloud, np.ndarray, np.ndarray]:
    """Seven markers of a limb that turns; three pause at once, and again 80 frames later: cloud, markers and tracks."""
    positions = turning_limb(PLACES, N_FRAMES)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[PAUSE, :3] = seen[WRONG.stop : WRONG.stop + 20, :3] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(N_FRAMES) / RATE)
    n_pauses = (frame >= PAUSE.stop).astype(int) + (frame >= WRONG.stop)
    return cloud, marker, marker + N * np.where(marker < 3, n_pauses, 0)


def between(track: np.ndarray) -> np.ndarray:
    """Points of the three markers between their pauses."""
    return (track >= N) & (track < 2 * N)


def pushed(case, labels: np.ndarray, fixed: np.ndarray | None = None) -> np.ndarray:
    cloud, _, track = case
    return push_pieces(FollowedCloud(cloud, track, RATE, SPACING, fixed), labels)


def test_three_pieces_in_a_ring_all_go_back(case) -> None:
    _, marker, track = case
    np.testing.assert_array_equal(pushed(case, np.where(between(track), (marker + 1) % 3, marker)), marker)


def test_a_piece_without_a_marker_pushes_out_what_has_its_place(case) -> None:
    _, marker, track = case
    wrong = marker.copy()
    wrong[between(track) & (marker == 0)] = -1
    wrong[between(track) & (marker == 1)] = 0
    np.testing.assert_array_equal(pushed(case, wrong), marker)


def test_what_was_pushed_out_of_a_marker_too_many_leaves_none(case) -> None:
    _, marker, track = case
    wrong = marker.copy()
    wrong[between(track) & (marker == 0)] = N  # one marker too many
    wrong[between(track) & (marker == 1)] = 0
    np.testing.assert_array_equal(pushed(case, wrong), marker)


def test_right_labels_stay(case) -> None:
    _, marker, _ = case
    assert pushed(case, marker) is marker


def test_what_the_user_states_stays(case) -> None:
    _, marker, track = case
    wrong = np.where(between(track), (marker + 1) % 3, marker)
    found = pushed(case, wrong, between(track))
    np.testing.assert_array_equal(found[between(track)], wrong[between(track)])


def test_points_of_no_track_make_way_for_a_piece(case) -> None:
    cloud, marker, track = case
    loose = between(track) & (marker == 0)
    wrong = np.where(loose, 1, np.where(between(track) & (marker == 1), -1, marker))
    found = push_pieces(FollowedCloud(cloud, np.where(loose, -1, track), RATE, SPACING), wrong)
    np.testing.assert_array_equal(found, np.where(loose, -1, marker))
