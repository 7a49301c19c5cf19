"""Tracks that go on over short gaps."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.model import PointCloud
from skelgen.simulation import simulate
from skelgen.stages.labels.merging.bridges import with_bridges
from skelgen.stages.labels.merging.followed import MOST_POINTS, FollowedCloud
from skelgen.stages.labels.parameters import LabelParameters
from skelgen.stages.labels.tracking.follow import follow_points
from skelgen.stages.labels.tracking.statistics import typical_spacing

RATE, N_FRAMES = 100.0, 600
AT_ONCE, EVERY, HIDDEN = 10, 25, 15  # markers that are hidden at once, every so many frames, for so many frames


@pytest.fixture(scope="module")
def hidden_together() -> tuple[FollowedCloud, np.ndarray]:
    """A person of whom neighbours are hidden at once again and again; and the true marker of each point."""
    case = simulate("human", n_frames=N_FRAMES, seed=0, noise=0.3)
    positions, random = case.take.positions, np.random.default_rng(0)
    seen = np.ones(positions.shape[:2], dtype=bool)
    for frame in range(EVERY, N_FRAMES - EVERY, EVERY):
        away = np.linalg.norm(positions[frame] - positions[frame, random.integers(positions.shape[1])], axis=1)
        seen[frame : frame + HIDDEN, np.argsort(away)[:AT_ONCE]] = False
    frames, markers = np.nonzero(seen)
    starts = np.concatenate([[0], np.cumsum(seen.sum(axis=1))])
    return followed(PointCloud(positions[frames, markers], starts, case.take.times)), markers


def followed(cloud: PointCloud) -> FollowedCloud:
    tracks, _ = follow_points(cloud, LabelParameters())
    return FollowedCloud(cloud, tracks, RATE, typical_spacing(cloud))


def n_tracks(take: FollowedCloud) -> int:
    return len(np.unique(take.track_of_point[take.track_of_point >= 0]))


def test_who_is_hidden_with_all_around_goes_on_as_himself(hidden_together):
    take, markers = hidden_together
    bridged = with_bridges(take)
    of_tracks = bridged.track_of_point
    true = [np.unique(markers[of_tracks == track]) for track in range(of_tracks.max() + 1)]
    assert [len(each) for each in true] == [1] * len(true)
    assert n_tracks(take) > 200
    assert n_tracks(bridged) < 70


def test_the_same_tracks_are_linked_again(hidden_together):
    take, _ = hidden_together
    assert (with_bridges(take).track_of_point == with_bridges(take).track_of_point).all()


def test_points_without_a_track_stay_without_one(hidden_together):
    take, _ = hidden_together
    none = take.track_of_point.copy()
    none[::7] = -1
    assert (with_bridges(replace(take, track_of_point=none)).track_of_point[::7] == -1).all()


def test_tracks_of_stated_points_are_not_linked(hidden_together):
    take, _ = hidden_together
    stated = np.zeros(take.cloud.n_points, dtype=bool)
    stated[take.track_of_point == take.track_of_point[0]] = True
    bridged = with_bridges(replace(take, stated=stated)).track_of_point
    assert (bridged == bridged[0]).sum() == stated.sum()


def test_a_take_too_short_to_measure_speeds_stays_as_it_is(hidden_together):
    take, _ = hidden_together
    few = followed(PointCloud(take.cloud.points[:90], take.cloud.frame_starts[:3], take.cloud.times[:2]))
    assert with_bridges(few).track_of_point is few.track_of_point


def test_very_long_takes_stay_as_they_are(hidden_together):
    take, _ = hidden_together
    few = len(take.cloud.times)
    times = np.arange(few + MOST_POINTS) / RATE
    starts = np.concatenate([take.cloud.frame_starts, take.cloud.n_points + np.arange(1, MOST_POINTS + 1)])
    points = np.concatenate([take.cloud.points, np.zeros((MOST_POINTS, 3))])
    tracks = np.concatenate([take.track_of_point, np.full(MOST_POINTS, -1, dtype=take.track_of_point.dtype)])
    long = FollowedCloud(PointCloud(points, starts, times), tracks, RATE, take.spacing)
    assert with_bridges(long) is long
