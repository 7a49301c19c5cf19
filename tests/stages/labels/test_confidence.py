"""Confidence in identities, against a simulated truth: errors are where it is low, and it is low where errors are."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from skelgen.model import PointCloud, Trajectories
from skelgen.simulation import simulate
from skelgen.stages.labels import LabelParameters, label_markers, labelling_of_markers
from skelgen.stages.labels.confidence.identity import LABELS_FOUND, LABELS_GIVEN, identity_confidence
from skelgen.stages.labels.confidence.label_quality import PointLabels, history_of, labelling_of_cloud
from skelgen.stages.labels.point_labels import find_points

SURE = 0.9  # the threshold of doubt


@pytest.fixture(scope="module")
def human():
    """A labelled human with soft tissue and dropouts: every label is right."""
    return simulate("human", seed=3, n_frames=500, soft_tissue=2.0, noise=0.3, dropouts=0.1).take


def renamed(take, first, second, frames):
    """The take with two labels exchanged in some frames."""
    positions = take.positions.copy()
    positions[frames, first], positions[frames, second] = (
        take.positions[frames, second],
        take.positions[frames, first],
    )
    return dataclasses.replace(take, positions=positions)


def limb_mate(take, marker):
    """The marker that stays at the steadiest distance from one."""
    lengths = np.linalg.norm(take.positions - take.positions[:, [marker]], axis=2)
    spread = np.nanstd(lengths, axis=0)
    spread[marker] = np.inf
    return int(spread.argmin())


def test_right_labels_are_trusted(human):
    confidence = identity_confidence(human).confidence
    assert np.array_equal(np.isnan(confidence), ~human.seen)
    assert (confidence[human.seen] > SURE).mean() > 0.99  # some come back beside too few others


def test_wrong_labels_are_doubted_where_they_are_wrong(human):
    wrong = slice(200, 300)
    confidence = identity_confidence(renamed(human, 5, 30, wrong)).confidence
    during, before = confidence[wrong][:, [5, 30]], confidence[:180][:, [5, 30]]
    assert (during[~np.isnan(during)] < SURE).mean() > 0.95
    assert (before[~np.isnan(before)] > SURE).mean() > 0.95


def test_doubt_names_marker_frames_and_reason(human):
    spans = labelling_of_markers(renamed(human, 5, 30, slice(200, 300)), human).doubts
    found = [doubt for doubt in spans if doubt.marker == 5 and doubt.kind in {"rival", "misfit"}]
    assert any(abs(doubt.first_frame - 200) < 10 and abs(doubt.last_frame - 299) < 10 for doubt in found)
    assert all(human.names[5] in doubt.reason for doubt in found)


def test_piece_of_a_marker_is_recognised(human):
    mates = [marker for marker in range(human.n_markers) if marker != 7]
    positions = np.concatenate([human.positions, np.full((500, 1, 3), np.nan)], axis=1)
    positions[300:420, -1], positions[300:420, 7] = positions[300:420, 7], np.nan
    split = Trajectories(positions, (*human.names, "piece"), human.rate)
    certainty = identity_confidence(split)
    assert certainty.original[-1] == 7
    assert (certainty.original[mates] < 0).all()
    assert np.nanmax(certainty.confidence[:, -1]) < 0.2


def test_corners_of_a_square_are_not_told_apart():
    corners = np.array([[0.0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]])
    noise = np.random.default_rng(0).normal(size=(300, 4, 3))
    square = Trajectories(corners + noise, tuple("abcd"), 100.0)
    assert (0, 2) in identity_confidence(square).twins  # what the other two see is the same


def test_a_rigid_distance_and_a_loose_one_tell_two_markers_apart():
    """Of the corners of a square, a and c are alike, but only a keeps its distance to e, which turns about it."""
    corners = np.array([[0.0, 0, 0], [100, 0, 0], [100, 100, 0], [0, 100, 0]])
    rng = np.random.default_rng(0)
    directions = rng.normal(size=(300, 1, 3))
    stick = 80.0 * directions / np.linalg.norm(directions, axis=2, keepdims=True)
    places = np.concatenate([np.tile(corners, (300, 1, 1)), corners[0] + stick], axis=1)
    square = Trajectories(places + rng.normal(size=places.shape), tuple("abcde"), 100.0)
    assert (0, 2) not in identity_confidence(square).twins


def test_repaired_labels_are_listed(human):
    doubts = labelling_of_markers(human, renamed(human, 5, 30, slice(200, 300))).doubts
    repaired = [doubt for doubt in doubts if doubt.kind == "repaired"]
    assert {(doubt.marker, doubt.rival) for doubt in repaired} == {(5, 30), (30, 5)}
    assert min(doubt.first_frame for doubt in repaired) >= 200
    assert max(doubt.last_frame for doubt in repaired) <= 299


def test_unlabelled_take_is_judged_whole():
    case = simulate("human", seed=1, n_frames=300, n_cameras=5, soft_tissue=2.0, ghosts=0.5, labelled=False)
    markers, labelling = label_markers(case.take, LabelParameters(compare=True))
    assert labelling.confidence.shape == markers.seen.shape
    assert labelling.left_out.sum() == case.take.n_points - markers.seen.sum()
    assert labelling.tracklets.n_points[labelling.tracklets.marker >= 0].sum() <= markers.seen.sum()
    assert 0.5 < labelling.classic.share <= 1.0


@pytest.mark.parametrize("options", [{}, {"method": "sets"}, {"method": "sets", "compare": True}])
def test_the_classic_method_runs_beside_another_one_only_where_it_is_asked_for(options):
    case = simulate("rods", seed=0, n_frames=200, labelled=False)
    assert label_markers(case.take, LabelParameters(**options))[1].classic is None


def test_points_of_markers_are_found_again():
    rng = np.random.default_rng(0)
    positions = rng.normal(size=(20, 5, 3))
    positions[rng.random((20, 5)) < 0.3] = np.nan
    positions[3, 1] = positions[3, 0] = 7.0  # two points in one place
    seen = ~np.isnan(positions[:, :, 0])
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    cloud = PointCloud(positions[seen], starts, np.arange(20.0))
    assert find_points(cloud, positions).tolist() == np.nonzero(seen)[1].tolist()


def test_tracks_are_cut_where_they_change_their_marker():
    cloud = PointCloud(np.zeros((6, 3)), np.arange(7), np.arange(6.0))
    points = PointLabels(cloud, np.array([4, 4, 4, -1, 9, 9]), np.array([0, 0, 1, 1, -1, -1]))
    tracklets = history_of(points, 2).tracklets
    assert tracklets.track.tolist() == [0, 0, 1]
    assert tracklets.marker.tolist() == [0, 1, -1]
    assert np.transpose([tracklets.first, tracklets.last, tracklets.n_points]).tolist() == [
        [0, 1, 2],
        [2, 2, 1],
        [4, 5, 2],
    ]


def test_a_track_knows_its_first_point():
    """Two points in each of four frames; the second one of frame 0 is the first one of the others."""
    cloud = PointCloud(np.arange(24.0).reshape(8, 3), np.arange(5) * 2, np.arange(4.0))
    points = PointLabels(cloud, np.array([0, 1, 1, 0, 1, 0, 1, 2]), np.array([0, -1, -1, 0, -1, 0, -1, -1]))
    tracklets = history_of(points, 1).tracklets
    assert tracklets.first_point.tolist() == [0, 1, 1]
    assert np.array_equal(tracklets.first_position, cloud.points[[0, 1, 7]])


@pytest.mark.parametrize("n_markers", [1, 2, 3])
def test_few_markers_are_judged_without_error(n_markers):
    positions = np.random.default_rng(1).normal(size=(40, n_markers, 3))
    markers = Trajectories(positions, tuple("abc"[:n_markers]), 100.0)
    assert identity_confidence(markers).confidence.shape == (40, n_markers)


def test_markers_that_coincide_and_markers_never_seen_are_judged_without_error():
    positions = np.zeros((30, 4, 3))
    positions[:, 3] = np.nan
    markers = Trajectories(positions, tuple("abcd"), 100.0)
    cloud = PointCloud(np.zeros((90, 3)), np.arange(31) * 3, np.arange(30.0))
    points = PointLabels(cloud, np.tile([0, 1, 2], 30), np.tile([0, 1, 2], 30))
    labelling = labelling_of_cloud(markers, history_of(points, 4))
    assert np.isnan(labelling.confidence[:, 3]).all()
    assert labelling.left_out.sum() == 0


def test_take_of_one_frame_is_judged_without_error():
    markers = Trajectories(np.eye(3)[np.newaxis], tuple("abc"), 100.0)
    assert identity_confidence(markers).confidence.shape == (1, 3)


def test_what_the_user_states_is_believed(human):
    wrong = renamed(human, 5, 30, slice(200, 300))
    stated = np.zeros(human.seen.shape, dtype=bool)
    stated[250, 5] = human.seen[250, 5]
    confidence = identity_confidence(wrong, stated=stated).confidence
    assert confidence[250, 5] > SURE
    assert np.nanmax(confidence[240:260, 30]) < SURE


def test_marker_that_is_seldom_seen_is_doubted_only_where_labels_were_found(human):
    positions = human.positions.copy()
    positions[50:, 12] = np.nan
    seldom = dataclasses.replace(human, positions=positions)
    found, given = (identity_confidence(seldom, prior=prior) for prior in (LABELS_FOUND, LABELS_GIVEN))
    assert found.rare.nonzero()[0].tolist() == [12]
    assert np.nanmax(found.confidence[:, 12]) < SURE < np.nanmin(given.confidence[:30, 12])
    assert not given.rare.any()
