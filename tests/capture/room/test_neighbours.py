"""A marker that only one camera sees is placed by those beside it; a ghost that takes its ball goes."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.optics import project
from skelgen.capture.room.points import balls_at
from skelgen.capture.room.simulated import room_rig
from skelgen.capture.room.tracks import RoomTracker
from skelgen.geometry.rotations import matrix_from_vector

LIMB = np.array([[0.0, 0, 0], [120, 0, 0], [0, 90, 0], [30, 40, 70]])
LEARNED, HIDDEN = 150, 20  # frames that all cameras see, and that one of them sees of marker 0
NOISE = 0.05  # px


@pytest.fixture(scope="module")
def rig():
    return room_rig(3)


def places_at(frame):
    """The limb, which turns and goes through the room."""
    turn = matrix_from_vector(np.array([0.02, 0.01, 0.03]) * frame)
    return LIMB @ turn.T + [4.0 * frame - 300, 100, 1000 + 2.0 * frame]


def views_of(rig, frame, rng, also=None):
    """Balls of all cameras; in the end marker 0 only of the first one, and balls that `also` gives by camera."""
    views = []
    for index, camera in enumerate(rig.cameras):
        there = places_at(frame)[1 if index and frame >= LEARNED else 0 :]
        centres = project(camera, there)
        if also is not None and index == 1 and frame >= LEARNED:
            centres = np.concatenate([centres, project(camera, also(frame)[np.newaxis])])
        views.append(balls_at(centres + rng.normal(scale=NOISE, size=centres.shape), NOISE))
    return views


def followed(rig, also=None):
    tracker, rng = RoomTracker(rig), np.random.default_rng(0)
    return [tracker.see(views_of(rig, frame, rng, also), frame / 100) for frame in range(LEARNED + HIDDEN)]


def own_track(frames):
    points, tracks = frames[0]
    return tracks[np.linalg.norm(points.points - places_at(0)[0], axis=1).argmin()]


def test_a_marker_that_one_camera_sees_is_placed_by_its_limb(rig):
    frames = followed(rig)
    for frame in range(LEARNED, LEARNED + HIDDEN):
        points, tracks = frames[frame]
        (alone,) = np.flatnonzero(points.n_cameras == 1)
        assert tracks[alone] == own_track(frames)
        off = points.points[alone] - places_at(frame)[0]
        assert np.linalg.norm(off) < 3.0
        assert off @ np.linalg.solve(points.covariance[alone], off) < 16.0


def test_a_crossing_of_two_rays_that_takes_its_ball_goes(rig):
    eye = rig.places[0]

    def behind(frame):
        """A place 500 mm behind marker 0 on its ray, where the second camera sees a ball of something else."""
        ray = places_at(frame)[0] - eye
        return eye + ray * (1 + 500 / np.linalg.norm(ray))

    frames = followed(rig, behind)
    n_ghosts = 0
    for frame in range(LEARNED, LEARNED + HIDDEN):
        points, tracks = frames[frame]
        n_ghosts += (np.linalg.norm(points.points - behind(frame), axis=1) < 50).sum()
        assert own_track(frames) in tracks
    assert n_ghosts == 0


def test_a_marker_without_neighbours_is_not_guessed(rig):
    tracker, rng = RoomTracker(rig), np.random.default_rng(0)
    for frame in range(LEARNED + HIDDEN):
        views = views_of(rig, frame, rng)
        counts = [1 if index == 0 or frame < LEARNED else 0 for index in range(3)]
        few = [balls_at(balls.centres[:count], NOISE) for balls, count in zip(views, counts, strict=True)]
        points, _ = tracker.see(few, frame / 100)
        assert (points.n_cameras > 1).all()


def test_a_joint_that_begins_to_turn_deceives_for_no_long(rig):
    def bent(frame):
        """The limb, of which the other markers turn about marker 1 as soon as it is hidden."""
        places = places_at(frame)
        turn = matrix_from_vector(np.array([0.002, 0.002, 0.0]) * max(frame - LEARNED, 0))
        return np.concatenate([places[:1], (places[1:] - places[1]) @ turn.T + places[1]])

    tracker, rng = RoomTracker(rig), np.random.default_rng(0)
    off = []
    for frame in range(LEARNED + 3 * HIDDEN):
        views = []
        for index, camera in enumerate(rig.cameras):
            centres = project(camera, bent(frame)[1 if index and frame >= LEARNED else 0 :])
            views.append(balls_at(centres + rng.normal(scale=NOISE, size=centres.shape), NOISE))
        points, _ = tracker.see(views, frame / 100)
        alone = points.points[points.n_cameras == 1]
        off += np.linalg.norm(alone - bent(frame)[0], axis=1).tolist()
    assert len(off) > 20
    assert max(off) < 2.5  # mm
