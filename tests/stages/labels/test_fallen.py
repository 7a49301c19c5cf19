"""Points of a marker that falls off are followed no longer."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.stages.labels.merging.fallen import without_fallen
from skelgen.stages.labels.merging.followed import FollowedCloud
from tests.stages.conftest import FALL_FRAME


def test_a_marker_that_is_first_seen_as_it_falls_is_followed_nowhere(fallen):
    take = fallen("head 1")
    (n_frames, n_markers, _), marker = take.positions.shape, take.names.index("head 1")
    cloud = PointCloud(take.positions.reshape(-1, 3), np.arange(n_frames + 1) * n_markers, take.times)
    tracks = np.tile(np.arange(n_markers), (n_frames, 1))
    tracks[: FALL_FRAME + 4, marker] = -1
    found, _ = without_fallen(FollowedCloud(cloud, tracks.ravel(), take.rate, 100.0))
    assert (found.track_of_point.reshape(tracks.shape)[:, marker] == -1).all()


@pytest.mark.parametrize("lost", [0, 20])
def test_no_point_is_followed_that_falls_or_lies_on_the_floor(fallen, lost):
    take = fallen("head 1")
    (n_frames, n_markers, _), marker = take.positions.shape, take.names.index("head 1")
    cloud = PointCloud(take.positions.reshape(-1, 3), np.arange(n_frames + 1) * n_markers, take.times)
    tracks = np.tile(np.arange(n_markers), (n_frames, 1))
    tracks[FALL_FRAME + 30 :, marker] = n_markers if lost else marker
    tracks[FALL_FRAME + 30 : FALL_FRAME + 30 + lost, marker] = -1
    found, (notice,) = without_fallen(FollowedCloud(cloud, tracks.ravel(), take.rate, 100.0))
    after = found.track_of_point.reshape(tracks.shape)
    assert (after[FALL_FRAME:, marker] == -1).all()
    assert np.array_equal(np.delete(after, marker, axis=1), np.delete(tracks, marker, axis=1))
    assert "falls off" in notice


def test_what_has_lain_there_before_has_not_fallen(fallen):
    take = fallen("head 1")
    (n_frames, n_markers, _), marker = take.positions.shape, take.names.index("head 1")
    positions, tracks = take.positions.copy(), np.tile(np.arange(n_markers), (n_frames, 1))
    positions[:50, 0] = positions[-1, marker]
    tracks[FALL_FRAME + 30 :, marker], tracks[:50, 0] = n_markers, n_markers + 1
    cloud = PointCloud(positions.reshape(-1, 3), np.arange(n_frames + 1) * n_markers, take.times)
    found, notices = without_fallen(FollowedCloud(cloud, tracks.ravel(), take.rate, 100.0))
    assert not notices and np.array_equal(found.track_of_point, tracks.ravel())
