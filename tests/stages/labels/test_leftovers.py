"""Short tracks that have no marker get the one whose distances they keep, and no other."""

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.leftovers import LASTING, label_leftovers, label_rest

RATE, N_FRAMES, SPACING = 40.0, 400, 60.0
PLACES = np.array([[0, 0, 0], [70, 0, 0], [10, 60, 0], [65, 75, 20], [20, 30, 70]], dtype=float)  # mm, on one limb
PIECES = (slice(101, 110), slice(203, 213))  # of the first two markers, between the moments that are sampled or not
AWAY, SLID = 500.0, 15.0  # mm


@pytest.fixture(scope="module")
def case(turning_limb) -> tuple[PointCloud, np.ndarray, np.ndarray]:
    """A limb that turns: the cloud, true markers, and tracks; the first two markers have a short track of their own."""
    positions = turning_limb(PLACES, N_FRAMES)
    frame, marker = np.indices((N_FRAMES, len(PLACES))).reshape(2, -1)
    cloud = PointCloud(positions.reshape(-1, 3), np.arange(N_FRAMES + 1) * len(PLACES), np.arange(N_FRAMES) / RATE)
    track = marker.copy()
    for number, piece in enumerate(PIECES):
        track[(marker == number) & (frame >= piece.start) & (frame < piece.stop)] = len(PLACES) + number
    return cloud, marker, track


def test_short_tracks_get_the_marker_whose_distances_they_keep(case) -> None:
    cloud, marker, track = case
    labels = np.where(track < len(PLACES), marker, -1)
    take = FollowedCloud(cloud, track, RATE, SPACING)
    np.testing.assert_array_equal(label_leftovers(take, labels), marker)


def test_single_points_get_a_marker_at_the_end_only(case) -> None:
    cloud, marker, track = case
    alone = np.isin(np.arange(len(marker)), np.flatnonzero(marker == 3)[[50, 51, 220]])
    labels, track = np.where(alone, -1, marker), np.where(alone, -1, track)
    take = FollowedCloud(cloud, track, RATE, SPACING)
    assert label_leftovers(take, labels) is labels
    np.testing.assert_array_equal(label_rest(take, labels), marker)


def test_single_false_points_get_no_marker(case) -> None:
    cloud, marker, track = case
    alone = np.isin(np.arange(len(marker)), np.flatnonzero(marker == 3)[[50, 51, 220]])
    points = np.where(alone[:, np.newaxis], cloud.points + AWAY, cloud.points)
    moved = PointCloud(points, cloud.frame_starts, cloud.times)
    labels, track = np.where(alone, -1, marker), np.where(alone, -1, track)
    assert label_rest(FollowedCloud(moved, track, RATE, SPACING), labels) is labels


def test_a_marker_without_any_label_is_found_by_its_distances_in_another_take(case) -> None:
    cloud, marker, _ = case
    frame = np.repeat(np.arange(N_FRAMES), cloud.points_per_frame)
    labels = np.where((marker == len(PLACES) - 1) & (frame >= N_FRAMES // 2), -1, marker)
    track = np.where(frame < N_FRAMES // 2, marker, marker + len(PLACES))
    take = FollowedCloud(cloud, track, RATE, SPACING, n_known=N_FRAMES // 2)
    np.testing.assert_array_equal(label_leftovers(take, labels), marker)


def test_a_marker_that_is_seen_meanwhile_is_not_given_twice(case) -> None:
    cloud, marker, track = case
    labels = np.where(track < len(PLACES), marker, -1)
    points = cloud.points.copy()
    twin, other = track == len(PLACES), (marker == 2) & (np.isin(np.arange(len(track)) // 5, np.arange(101, 110)))
    points[twin] = points[other] + 1.0
    moved = PointCloud(points, cloud.frame_starts, cloud.times)
    take = FollowedCloud(moved, track, RATE, SPACING)
    found = label_leftovers(take, labels)
    assert (found[twin] != 2).all()


def test_false_points_away_from_all_places_get_no_marker(case) -> None:
    cloud, marker, track = case
    labels = np.where(track < len(PLACES), marker, -1)
    points = cloud.points.copy()
    points[track >= len(PLACES)] += AWAY
    moved = PointCloud(points, cloud.frame_starts, cloud.times)
    take = FollowedCloud(moved, track, RATE, SPACING)
    assert label_leftovers(take, labels) is labels


@pytest.mark.parametrize(("another", "is_labelled"), [(0.0, False), (12.0, True)])
def test_what_lasts_in_a_new_pose_is_a_known_marker_where_another_one_is_unlikely(case, another, is_labelled) -> None:
    cloud, marker, _ = case
    frame = np.repeat(np.arange(N_FRAMES), cloud.points_per_frame)
    lasts = (marker == 0) & (frame >= PIECES[0].start) & (frame < PIECES[0].start + LASTING)
    points = cloud.points.copy()
    points[lasts, 2] += SLID
    slid = PointCloud(points, cloud.frame_starts, cloud.times)
    labels, track = np.where(lasts, -1, marker), np.where(lasts, len(PLACES), marker)
    take = FollowedCloud(slid, track, RATE, SPACING)
    found = label_leftovers(take, labels, another)
    np.testing.assert_array_equal(found, marker if is_labelled else labels)


def test_labels_without_leftovers_stay(case) -> None:
    cloud, marker, track = case
    take = FollowedCloud(cloud, track, RATE, SPACING)
    assert label_leftovers(take, marker) is marker
