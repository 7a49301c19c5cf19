"""Points through time: a crossing of two rays does not last, a marker does."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from skelgen.capture.room.points import PointMatcher, RoomPoints
from skelgen.capture.room.simulated import person_scene, room_rig, wand_scene
from skelgen.capture.room.tracks import PointTracks
from tests.benchmarks.unrendered import blobs_of

N_FRAMES = 30


def points_at(places, n_cameras):
    n = len(places)
    balls = np.where(np.arange(4) < np.asarray(n_cameras)[:, np.newaxis], 0, -1)
    return RoomPoints(np.asarray(places, dtype=float), np.tile(np.eye(3), (n, 1, 1)), balls, np.ones(n), np.ones(n))


def test_a_ghost_of_two_cameras_goes_and_a_marker_stays():
    tracks, seen = PointTracks(), []
    for frame in range(N_FRAMES):
        places, cameras = [[10.0 * frame, 0, 0], [0, 500.0 + 5 * frame, 0]], [2, 3]
        if 10 <= frame < 13:
            places, cameras = [*places, [0.0, 0, 900]], [*cameras, 2]
        seen.append(tracks.follow(points_at(places, cameras), frame / 100))
    assert [len(set(column)) for column in zip(*[row[:2] for row in seen], strict=True)] == [1, 1]
    assert tracks.are_markers(seen[11]).tolist() == [True, True, False]


def test_a_marker_that_was_hidden_comes_back_as_the_same():
    tracks, seen = PointTracks(), []
    for frame in range(N_FRAMES):
        there = [] if 10 <= frame < 14 else [[20.0 * frame, 0, 0]]
        seen.append(tracks.follow(points_at(np.reshape(there, (-1, 3)), [3] * len(there)), frame / 100))
    assert seen[0] == seen[-1]


def test_markers_of_a_person_in_a_room_are_found():
    rig = room_rig(8)
    scene, rng = person_scene(rig, N_FRAMES), np.random.default_rng(0)
    matcher, tracks, frames = PointMatcher(rig), PointTracks(), []
    for frame in range(N_FRAMES):
        views, numbers = blobs_of(scene, frame, rig, rng)
        points = matcher.find(views, tracks.expected(frame / scene.rate))
        frames.append((points, tracks.follow(points, frame / scene.rate), numbers))
    n_seen = n_found = n_wrong = 0
    for frame, (points, own, numbers) in enumerate(frames):
        seen = np.bincount(np.concatenate([one[one >= 0] for one in numbers]), minlength=45) >= 2
        gaps = np.linalg.norm(points.points[tracks.are_markers(own)][:, np.newaxis] - scene.positions[frame], axis=2)
        is_right = gaps.min(axis=1) < 5.0
        n_seen, n_wrong = n_seen + seen.sum(), n_wrong + (~is_right).sum()
        n_found += np.isin(np.flatnonzero(seen), gaps.argmin(axis=1)[is_right]).sum()
    assert n_found >= 0.995 * n_seen
    assert n_wrong <= 0.0005 * n_seen


@pytest.mark.parametrize("n_cameras", [2, 3, 16])
def test_rooms_have_as_many_cameras_as_are_wanted(n_cameras):
    rig = room_rig(n_cameras)
    scene = wand_scene(rig, 20)
    lengths = np.linalg.norm(scene.positions[:, 2] - scene.positions[:, 0], axis=1)
    np.testing.assert_allclose(lengths, 500.0)
    shown = [len(view) for view in blobs_of(scene, 0, rig, np.random.default_rng(0))[0]]
    assert len(shown) == n_cameras
    assert set(shown) <= {0, 1, 2, 3}


def jumping(jumps):
    """Frames of a marker that three cameras see, and of one that two see, off its way [mm] in some frames."""
    tracks, found = PointTracks(), []
    for frame in range(N_FRAMES):
        wiggle = np.sin(frame / 3.0)
        places = [[10.0 * frame, wiggle, 0], [0, 500.0 + 5 * frame, wiggle + jumps.get(frame, 0.0)]]
        points = points_at(places, [3, 2])
        points = replace(points, covariance=0.01 * points.covariance)
        wrong = tracks.contradicted(points, frame / 100)
        tracks.follow(points.of(~wrong), frame / 100)
        found.append(wrong.tolist())
    return np.array(found)


def test_a_point_of_two_cameras_that_leaves_its_way_is_not_the_marker():
    found = jumping({20: 8.0})
    assert np.argwhere(found).tolist() == [[20, 1]]


def test_a_marker_that_goes_on_elsewhere_is_believed_again():
    found = jumping(dict.fromkeys(range(20, N_FRAMES), 8.0))
    assert np.argwhere(found)[:, 0].max() <= 22
    assert not found[:, 0].any()
