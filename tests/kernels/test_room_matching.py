"""Balls of many images at once, against the truth: small rooms whose every ball is known."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.optics import project
from skelgen.capture.room.points import PointMatcher, balls_at
from skelgen.capture.room.simulated import room_rig
from skelgen.errors import InputError

PLACES = np.array([[0.0, 0, 900], [400, -300, 1200], [-600, 200, 500], [30, 500, 1600]])
NOISE = 0.05  # px


@pytest.fixture(scope="module")
def rig():
    return room_rig(4)


def views_of(rig, places, noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    return [
        balls_at(project(camera, places) + noise * rng.normal(size=(len(places), 2)), NOISE) for camera in rig.cameras
    ]


def in_order(points):
    return points[np.argsort(points[:, 0])]


def test_points_without_noise_are_exact(rig):
    found = PointMatcher(rig).find(views_of(rig, PLACES))
    np.testing.assert_allclose(in_order(found.points), in_order(PLACES), atol=1e-6)
    assert (found.n_cameras == 4).all()
    assert found.misfit.max() < 1e-6


def test_stated_covariance_is_that_of_the_errors(rig):
    off, stated = [], []
    for seed in range(100):
        found = PointMatcher(rig).find(views_of(rig, PLACES[:1], NOISE, seed))
        off.append(found.points[0] - PLACES[0])
        stated.append(found.covariance[0])
    squares = [error @ np.linalg.solve(covariance, error) for error, covariance in zip(off, stated, strict=True)]
    assert np.mean(squares) == pytest.approx(3.0, abs=4 * np.sqrt(6 / 100))  # chi-squared of three, four deviations


def test_a_marker_hidden_from_some_cameras_is_found_by_the_others(rig):
    views = views_of(rig, PLACES)
    views[1] = balls_at(views[1].centres[1:], NOISE)  # the first marker is hidden from the second camera
    found = PointMatcher(rig).find(views)
    first = np.linalg.norm(found.points - PLACES[0], axis=1).argmin()
    assert found.balls[first].tolist()[1] == -1
    assert found.n_cameras[first] == 3
    assert len(found) == len(PLACES)


def test_no_ball_belongs_to_two_points(rig):
    rng = np.random.default_rng(0)
    crowd = rng.uniform((-500, -500, 200), (500, 500, 1700), size=(40, 3))
    found = PointMatcher(rig).find(views_of(rig, crowd, NOISE))
    for balls in found.balls.T:
        assert len(np.unique(balls[balls >= 0])) == (balls >= 0).sum()
    off = np.linalg.norm(found.points[:, np.newaxis] - crowd, axis=2).min(axis=1)
    assert len(found) == len(crowd)
    assert off.max() < 1.0


def test_balls_that_lie_anywhere_make_hardly_any_point(rig):
    rng = np.random.default_rng(1)
    found = PointMatcher(rig).find([balls_at(rng.uniform((0, 0), (1280, 1024), (5, 2)), NOISE) for _ in rig.cameras])
    assert (found.n_cameras == 2).all()
    assert len(found) <= 2


def test_an_expected_place_decides_between_two_partners(rig):
    # The ball of the second camera that is nearer to the epipolar plane is the wrong one; the time before knows.
    pair = PointMatcher(rig)
    place = PLACES[0]
    sees = [project(camera, place[np.newaxis]) for camera in rig.cameras[:2]]
    other = place + 300 * (place - np.linalg.inv(rig.cameras[0].camera_from_world)[:3, 3]) / 3000
    wrong = project(rig.cameras[1], other[np.newaxis])
    off_plane = sees[1] + [[0.0, 0.05]]
    views = [balls_at(sees[0], NOISE), balls_at(np.concatenate([off_plane, wrong]), NOISE)]
    views += [balls_at(np.empty((0, 2)), NOISE)] * 2
    alone, known = pair.find(views), pair.find(views, place[np.newaxis])
    assert np.linalg.norm(alone.points[0] - place) > 100
    assert np.linalg.norm(known.points[0] - place) < 5


def test_order_of_balls_changes_no_point(rig):
    views = views_of(rig, PLACES, NOISE)
    turned = [balls_at(view.centres[::-1].copy(), NOISE) for view in views]
    np.testing.assert_allclose(
        in_order(PointMatcher(rig).find(turned).points), in_order(PointMatcher(rig).find(views).points), atol=1e-9
    )


def test_missing_views_are_refused(rig):
    with pytest.raises(InputError, match="3 views of 4 cameras"):
        PointMatcher(rig).find(views_of(rig, PLACES)[:3])


def test_empty_images_have_no_points(rig):
    assert len(PointMatcher(rig).find([balls_at(np.empty((0, 2)), NOISE)] * 4)) == 0
