"""Lanes say of every marker and frame what the project says."""

from __future__ import annotations

import numpy as np
from skelgen_gui.model.lanes import doubt_at, lane_picture, next_doubt, point_counts

from skelgen.app.drawing.lanes import State, find_lanes
from skelgen.model import PointCloud, Project

SEEN_ALWAYS = np.eye(5)[State.SEEN]


def states(lanes, marker):
    lane = lanes.markers.tolist().index(marker)
    return [lanes.state(lane, frame) for frame in range(lanes.n_frames)]


def test_frames_are_seen_filled_doubtful_or_left_out(doubted):
    lanes = find_lanes(doubted)
    assert states(lanes, 0) == [State.FILLED if frame % 7 == 0 else State.SEEN for frame in range(12)]
    assert states(lanes, 1) == [State.DOUBTFUL if 3 <= frame <= 5 else State.SEEN for frame in range(12)]
    assert set(states(lanes, 9)) == {State.LEFT_OUT}


def test_gaps_are_not_filled_before_there_is_a_skeleton(small_project):
    labelled = Project(small_project.take).with_trajectories(small_project.take, small_project.reports["labels"])
    assert states(find_lanes(labelled), 0)[7] == State.UNSEEN


def test_lanes_are_ordered_by_limb_with_markers_on_none_last(doubted):
    lanes = find_lanes(doubted)
    assert sorted(lanes.markers.tolist()) == list(range(10))
    assert lanes.limbs[-1] == -1
    assert (np.diff(np.flatnonzero(np.diff(lanes.limbs))) == 3).all()


def test_shares_of_whole_frames_are_their_states(doubted):
    lanes = find_lanes(doubted)
    shares = lanes.shares(np.arange(lanes.n_lanes), np.arange(13.0))
    wanted = [[lanes.state(lane, frame) for frame in range(12)] for lane in range(lanes.n_lanes)]
    assert np.array_equal(shares.argmax(axis=2), wanted)
    assert np.allclose(shares.max(axis=2), 1.0)


def test_shares_of_any_stretches_add_up_to_the_frames_of_each_state(doubted):
    lanes = find_lanes(doubted)
    edges = np.sort(np.random.default_rng(0).uniform(0, 12, 40))
    edges[0], edges[-1] = 0, 12
    shares = lanes.shares(np.arange(lanes.n_lanes), edges)
    frames = np.einsum("lcs,c->ls", shares, np.diff(edges))
    whole = lanes.shares(np.arange(lanes.n_lanes), np.array([0.0, 12.0]))[:, 0] * 12
    assert np.allclose(frames, whole)
    assert np.allclose(shares.sum(axis=2), 1.0)


def test_a_gap_and_a_doubt_of_one_frame_can_be_seen_in_an_hour():
    shares = np.tile(SEEN_ALWAYS, (1, 3, 1))
    shares[0, 1] = [1 - 1e-5, 1e-5, 0, 0, 0]
    shares[0, 2] = [1 - 1e-5, 0, 1e-5, 0, 0]
    colours = np.array([[10, 20, 30]], dtype=np.uint8)
    picture = lane_picture(shares, colours, np.array([200, 0, 0], dtype=np.uint8), 16)
    assert picture[4, 1, 3] < 200 < picture[4, 0, 3]
    assert picture[12, 2, 0] == 200
    assert picture[12, 0, 0] == 10


def test_a_project_without_labels_has_no_lanes(small_project):
    lanes = find_lanes(Project(small_project.take))
    assert lanes.n_lanes == 0
    assert lanes.shares(np.arange(0), np.arange(5.0)).shape == (0, 4, 5)


def test_doubts_are_found_by_place_and_one_after_the_other(doubted):
    assert doubt_at(doubted, 1, 4).reason == "it is off its place"
    assert doubt_at(doubted, 1, 6) is None
    assert next_doubt(doubted, 3, 1).marker == 2
    assert next_doubt(doubted, 8, -1).marker == 1
    assert next_doubt(doubted, 8, 1) is None


def test_before_the_labels_all_points_of_a_cloud_are_counted():
    cloud = PointCloud(np.zeros((3, 3)), np.array([0, 2, 2, 3]), np.arange(3.0))
    assert point_counts(Project(cloud)).tolist() == [2, 0, 1]


def test_takes_with_labels_have_no_spare_points(small_project):
    assert point_counts(small_project) is None
