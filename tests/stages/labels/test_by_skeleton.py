"""Labels found again by the skeleton that they imply, of which each part is kept that explains the take better."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.progress import SILENT
from skelgen.simulation import simulate
from skelgen.stages.labels.by_skeleton.again import label_again
from skelgen.stages.labels.by_skeleton.matching import with_whole_tracks
from skelgen.stages.labels.by_skeleton.points import FollowedPoints
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.judging import fused_labels
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing

RATE = 100.0


@pytest.fixture(scope="module")
def person() -> tuple[FollowedCloud, np.ndarray]:
    """A cloud of which a tenth is hidden, and its true labels."""
    case = simulate("human", n_frames=600, seed=0, noise=0.5, dropouts=0.1, dropout_seconds=0.3, labelled=False)
    tracks, _ = follow_points(case.take, LabelParameters())
    true = case.truth.marker_of_point.astype(np.int32)
    return FollowedCloud(case.take, tracks, RATE, typical_spacing(case.take)), true


def _exchanged(take: FollowedCloud, true: np.ndarray, markers: list[int], frames: range) -> np.ndarray:
    """Labels by which each of some markers is the next one in some frames."""
    wrong, within = true.copy(), np.isin(take.frame_of_point(), frames)
    for one, other in zip(markers, markers[1:] + markers[:1], strict=True):
        wrong[within & (true == one)] = other
    return wrong


def test_each_part_is_that_of_the_labels_that_are_right_there(person):
    take, true = person
    one, other = _exchanged(take, true, [3, 30], range(50, 250)), _exchanged(take, true, [5, 20, 40], range(300, 550))
    np.testing.assert_array_equal(fused_labels(take, one, other), true)
    np.testing.assert_array_equal(fused_labels(take, true, other), true)


def test_parts_at_one_time_are_apart_if_no_marker_is_in_both(person):
    take, true = person
    one, other = _exchanged(take, true, [3, 30], range(50, 250)), _exchanged(take, true, [5, 40], range(100, 300))
    np.testing.assert_array_equal(fused_labels(take, one, other), true)


def test_points_that_are_stated_keep_their_marker(person):
    take, true = person
    wrong = _exchanged(take, true, [3, 30], range(50, 250))
    stated = replace(take, stated=(take.frame_of_point() == 100) & (true == 3))
    fused = fused_labels(stated, wrong, true)
    assert (fused[stated.is_fixed] == wrong[stated.is_fixed]).all()


def test_an_arm_whose_markers_were_mistaken_for_each_other_is_told_by_the_skeleton(person):
    take, true = person
    wrong = _exchanged(take, true, list(range(18, 27)), range(400, 600))
    found = label_again(take, wrong, 0, SILENT)
    assert (wrong != true).mean() > 0.06
    assert (found != true).mean() < 0.001


def test_an_arm_that_is_followed_without_markers_is_told_by_the_skeleton(person):
    take, true = person
    lost = (true >= 18) & (true < 27) & (take.frame_of_point() >= 400)
    assert (label_again(take, np.where(lost, -1, true).astype(np.int32), 0, SILENT) != true).mean() < 0.001


def test_labels_that_are_not_doubtful_stay(person):
    take, true = person
    assert label_again(take, true, 0, SILENT) is true


def test_a_track_that_a_pose_leaves_out_or_mistakes_in_some_frames_is_one_marker(person):
    take, true = person
    frames, tracks = take.frame_of_point().astype(np.intp), take.track_of_point.astype(np.intp)
    points = FollowedPoints(take.cloud, frames, tracks, ())
    wrong = _exchanged(take, true, [3, 30], range(50, 53))
    wrong[(true == 5) & (take.frame_of_point() % 9 == 0)] = -1
    assert (wrong != true).mean() > 0.002
    assert (with_whole_tracks(points, wrong, int(true.max()) + 1) != true).mean() < 0.0005


def test_a_take_without_labels_stays_without(person):
    take, true = person
    nothing = np.full_like(true, -1)
    assert label_again(take, nothing, 0, SILENT) is nothing


def test_two_markers_that_bear_no_evidence_stay():
    rng = np.random.default_rng(0)
    points = np.cumsum(rng.normal(0.0, 5.0, (80, 2, 3)), axis=0) + np.array([[0.0, 0.0, 0.0], [60.0, 0.0, 0.0]])
    cloud = PointCloud(points.reshape(-1, 3), np.arange(0, 161, 2), np.arange(80) / RATE)
    marker = np.tile(np.arange(2, dtype=np.int32), 80)
    marker[100:] = 1 - marker[100:]
    assert (label_again(FollowedCloud(cloud, marker, RATE, 60.0), marker, 0, SILENT) >= 0).all()
