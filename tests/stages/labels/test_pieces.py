"""A piece of a track that went to a wrong marker is moved to the one whose distances it keeps."""

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.leftovers import move_pieces

RATE, N_FRAMES, SPACING = 40.0, 400, 60.0
PLACES = np.array([[0, 0, 0], [70, 0, 0], [10, 60, 0], [65, 75, 20], [20, 30, 70], [-40, 35, 25]], dtype=float)  # mm
WRONG = slice(101, 125)  # frames in which marker 0 goes on as marker 1, which is hidden from then to the end of them


@pytest.fixture(scope="module")
def case(turning_limb) -> tuple[PointCloud, np.ndarray, np.ndarray]:
    """A limb that turns: cloud, true markers, tracks. Marker 1 is hidden when marker 0 comes back with a new track."""
    positions = turning_limb(PLACES, N_FRAMES)
    seen = np.ones(positions.shape[:2], dtype=bool)
    seen[WRONG, 1] = False
    frame, marker = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[frame, marker], starts, np.arange(N_FRAMES) / RATE)
    in_piece = (marker == 0) & (frame >= WRONG.start) & (frame < WRONG.stop)
    return cloud, marker, np.where(in_piece, len(PLACES), marker)


def moved(case: tuple[PointCloud, np.ndarray, np.ndarray], labels: np.ndarray, fixed: np.ndarray) -> np.ndarray:
    cloud, _, track = case
    return move_pieces(FollowedCloud(cloud, track, RATE, SPACING, fixed), labels)


def wrong_labels(case: tuple[PointCloud, np.ndarray, np.ndarray]) -> np.ndarray:
    _, marker, track = case
    return np.where(track == len(PLACES), 1, marker)


def test_a_piece_is_moved_to_the_marker_whose_distances_it_keeps(case) -> None:
    _, marker, _ = case
    np.testing.assert_array_equal(moved(case, wrong_labels(case), np.zeros(len(marker), dtype=bool)), marker)


def test_a_marker_that_was_only_a_piece_is_no_more(case) -> None:
    _, marker, track = case
    np.testing.assert_array_equal(moved(case, track, np.zeros(len(marker), dtype=bool)), marker)


def test_what_the_user_states_stays(case) -> None:
    _, _, track = case
    labels = wrong_labels(case)
    assert moved(case, labels, track == len(PLACES)) is labels


def test_right_labels_stay(case) -> None:
    _, marker, _ = case
    assert moved(case, marker, np.zeros(len(marker), dtype=bool)) is marker


def test_a_piece_is_not_given_to_a_marker_that_is_seen_in_any_of_its_frames(case) -> None:
    cloud, marker, track = case
    labels = wrong_labels(case)
    frame = np.repeat(np.arange(N_FRAMES), cloud.points_per_frame)
    labels[(marker == 4) & (frame == WRONG.start + 1)] = 0  # between the moments that are compared
    found = moved(case, labels, np.zeros(len(marker), dtype=bool))
    assert (found[track == len(PLACES)] == 1).all()


def test_a_cloud_without_any_label_is_left_alone(case) -> None:
    _, marker, _ = case
    labels = np.full(len(marker), -1)
    assert moved(case, labels, np.zeros(len(marker), dtype=bool)) is labels
