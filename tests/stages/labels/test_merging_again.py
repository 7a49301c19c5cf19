"""Tracks without a marker are merged into the markers that they are, by their distances."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.followed import FollowedCloud
from skelgen.stages.labels.merging.markers import LEAST_POINTS, merge_again, with_leftovers
from skelgen.stages.labels.point_labels import seen_together

N_FRAMES, RATE, SPACING = 400, 100.0, 80.0


@pytest.fixture
def body(rng):
    """Six markers of a rigid body that turns, each one track; the points go frame by frame."""
    places = rng.normal(size=(6, 3)) * 100
    turns = np.linalg.qr(rng.normal(size=(N_FRAMES, 3, 3)))[0]
    points = np.einsum("fij,nj->fni", turns, places) + rng.normal(size=(N_FRAMES, 6, 3)) * 0.3
    starts = np.arange(N_FRAMES + 1) * 6
    cloud = PointCloud(points.reshape(-1, 3), starts, np.arange(N_FRAMES) / RATE)
    return cloud, np.tile(np.arange(6, dtype=np.int32), N_FRAMES)


@pytest.fixture
def rng():
    return np.random.default_rng(0)


def test_a_track_that_was_left_out_comes_back_to_its_marker(body):
    cloud, truth = body
    late = np.repeat(np.arange(N_FRAMES) >= 300, 6) & (truth == 5)
    track_of_point = np.where(late, 6, truth)
    found = merge_again(FollowedCloud(cloud, track_of_point, RATE, SPACING), np.where(late, -1, truth).astype(np.int32))
    np.testing.assert_array_equal(found, truth)


def test_a_track_beside_a_marker_that_is_seen_meanwhile_stays_without_one(body):
    cloud, truth = body
    known = np.where(truth == 5, -1, truth).astype(np.int32)
    np.testing.assert_array_equal(merge_again(FollowedCloud(cloud, truth, RATE, SPACING), known), known)


def test_only_tracks_that_last_are_merged(body):
    _, truth = body
    frames = np.repeat(np.arange(N_FRAMES), 6)
    for n_frames, n_markers in ((LEAST_POINTS, 7), (LEAST_POINTS - 1, 6)):
        free = (truth == 5) & (frames < n_frames)
        known = np.where(free, -1, truth).astype(np.int32)
        assert with_leftovers(np.where(free, 6, truth), known).max() + 1 == n_markers


def test_markers_that_are_seen_at_once_are_known(body):
    cloud, truth = body
    frames = np.repeat(np.arange(N_FRAMES), 6)
    marker = np.where((truth == 0) & (frames >= 200), -1, truth)
    marker[(truth == 1) & (frames < 200)] = -1
    together = seen_together(cloud, marker, 6) > 0
    assert not together[0, 1]
    assert together[2:, 2:].all()
