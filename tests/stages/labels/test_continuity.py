"""Tracklets, and parts of markers, that go on where others ended."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels.merging.continuity import MOST_SPOKEN, Continuity
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.leftovers import label_rest
from skelgen.stages.labels.merging.windows import continuity_evidence
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import find_tracklets, follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing


@pytest.fixture(scope="module")
def found():
    case = simulate("human", n_frames=800, seed=0, dropouts=0.15, noise=0.5, labelled=False)
    track_of_point, _ = follow_points(case.take, LabelParameters())
    sets = find_tracklets(case.take, track_of_point, 100.0, LabelParameters())
    pairs = continuity_evidence(case.take.points, sets, 100.0, typical_spacing(case.take))
    marker = case.truth.marker_of_point[sets.points[sets.starts[:-1]]]
    return sets, marker, pairs


def test_true_successors_have_more_evidence_than_false_ones(found):
    _, marker, (before, after, evidence) = found
    same = marker[before] == marker[after]
    assert same.sum() > 20
    assert np.median(evidence[same]) > 1.0
    assert np.quantile(evidence[~same], 0.98) < np.median(evidence[same])


def test_pairs_follow_each_other_within_half_a_second(found):
    sets, _, (before, after, _) = found
    gap = sets.first[after] - sets.last[before]
    assert ((gap > 0) & (gap <= 50)).all()


def test_two_sets_without_neighbours_say_nothing(found):
    sets, _, _ = found
    few = sets.chosen(np.arange(len(sets)) < 2)
    case = simulate("human", n_frames=800, seed=0, dropouts=0.15, noise=0.5, labelled=False)
    _, _, evidence = continuity_evidence(case.take.points, few, 100.0, 100.0)
    assert not evidence.any()


RATE, N_FRAMES, SPACING = 40.0, 400, 60.0
CARRIED = np.array([[0, 0, 0], [70, 0, 0], [10, 60, 0], [65, 75, 20], [20, 30, 70]], dtype=float)  # mm, on one limb
LOST, FOUND = 100, 110  # frames between which the first marker is not seen


@pytest.fixture(scope="module")
def limb(turning_limb) -> tuple[PointCloud, np.ndarray]:
    """A limb whose first marker has one gap: the cloud and true markers."""
    frame, marker = np.indices((N_FRAMES, len(CARRIED))).reshape(2, -1)
    seen = (marker > 0) | (frame < LOST) | (frame >= FOUND)
    counts = np.bincount(frame[seen], minlength=N_FRAMES)
    points = turning_limb(CARRIED, N_FRAMES).reshape(-1, 3)[seen]
    return PointCloud(points, np.append(0, counts.cumsum()), np.arange(N_FRAMES) / RATE), marker[seen]


def continuity(cloud: PointCloud, marker: np.ndarray) -> Continuity:
    return Continuity(FollowedCloud(cloud, marker, RATE, SPACING), marker)


def after_the_gap(cloud: PointCloud) -> np.ndarray:
    return np.repeat(np.arange(N_FRAMES), cloud.points_per_frame) >= FOUND


def test_a_limb_carries_its_marker_over_a_gap(limb):
    assert continuity(*limb).total() > MOST_SPOKEN


def test_a_gap_that_ends_at_another_marker_speaks_against_the_labels(limb):
    cloud, marker = limb
    swapped = np.where(after_the_gap(cloud) & (marker < 2), 1 - marker, marker)
    assert continuity(cloud, swapped).total() < 0.0 < continuity(cloud, marker).total()


def test_points_of_a_track_that_are_left_out_leave_no_gap_to_explain(limb):
    cloud, marker = limb
    frame = np.repeat(np.arange(N_FRAMES), cloud.points_per_frame)
    left_out = np.where((marker == 1) & (frame % 20 == 7), -1, marker)
    take = FollowedCloud(cloud, marker, RATE, SPACING)
    assert Continuity(take, left_out).total() == pytest.approx(continuity(cloud, marker).total(), rel=0.01)


def test_both_parts_of_a_marker_are_said_to_be_one(limb):
    cloud, marker = limb
    parts = np.where(after_the_gap(cloud) & (marker == 0), len(CARRIED), marker)
    said = continuity(cloud, parts).between(np.zeros((len(CARRIED) + 1,) * 2, dtype=bool))
    assert said[0, -1] == said[-1, 0] == MOST_SPOKEN
    assert not said[1:-1].any()


def test_markers_that_cannot_be_one_are_not_compared(limb):
    cloud, marker = limb
    parts = np.where(after_the_gap(cloud) & (marker == 0), len(CARRIED), marker)
    assert not continuity(cloud, parts).between(np.ones((len(CARRIED) + 1,) * 2, dtype=bool)).any()


def test_a_piece_of_a_marker_that_keeps_no_distance_is_told_by_its_gaps(turning_limb):
    loose = np.array([0.0, 0.0, 150.0]) + 40.0 * np.sin(np.linspace(0.0, 9.0, N_FRAMES))[:, np.newaxis]
    positions = np.concatenate([turning_limb(CARRIED, N_FRAMES), loose[:, np.newaxis]], axis=1)
    frame, marker = np.indices(positions.shape[:2]).reshape(2, -1)
    cloud = PointCloud(
        positions.reshape(-1, 3), np.arange(N_FRAMES + 1) * positions.shape[1], np.arange(N_FRAMES) / RATE
    )
    piece = (marker == len(CARRIED)) & (frame >= LOST) & (frame < FOUND)
    take = FollowedCloud(cloud, np.where(piece, -1, marker), RATE, SPACING)
    np.testing.assert_array_equal(label_rest(take, np.where(piece, -1, marker)), marker)


def test_a_cloud_without_labels_has_no_gaps(limb):
    cloud, marker = limb
    assert continuity(cloud, np.full(len(marker), -1)).total() == 0.0
