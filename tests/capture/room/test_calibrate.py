"""Wand calibration of three cameras against the truth; what is wrong with recordings is told in words."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.capture.optics import project
from skelgen.capture.room.calibrate import calibrate_wand, on_ground, point_covariances, room_grid
from skelgen.capture.room.points import balls_at
from skelgen.capture.room.simulated import FRAME, WAND, frame_scene, room_rig, wand_scene
from skelgen.capture.room.wand_and_ground import check_wand, find_ground, find_wand
from skelgen.errors import InputError
from tests.benchmarks.unrendered import views_of_scene

N_FRAMES = 300
NAMES = ("a", "b", "c")
TWO = (0.0, 500.0)
SIZES = [(1280, 1024)] * 3
EMPTY = balls_at(np.empty((0, 2)), 0.05)


@pytest.fixture(scope="module")
def rig():
    return room_rig(3)


@pytest.fixture(scope="module")
def frames(rig):
    return views_of_scene(wand_scene(rig, N_FRAMES, rate=30.0), rig)


@pytest.fixture(scope="module")
def calibration(frames):
    return calibrate_wand(frames, WAND, SIZES, NAMES)


@pytest.fixture(scope="module")
def on_floor(rig, calibration):
    lying = views_of_scene(frame_scene(rig), rig, seed=1)
    return on_ground(calibration, find_ground(lying, calibration.rig, FRAME))


def changed(frames, camera, change):
    return [[change(balls) if index == camera else balls for index, balls in enumerate(views)] for views in frames]


def mirrored(balls):
    return balls_at(balls.centres * [-1, 1] + [1279, 0], 0.05)


def test_cameras_are_found_within_what_is_stated(rig, calibration):
    assert calibration.rig.noise == pytest.approx(0.05, rel=0.05)
    assert calibration.rig.names == NAMES
    found = np.array([camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] for camera in calibration.rig.cameras])
    true = np.array([camera.matrix[[0, 1, 0, 1], [0, 1, 2, 2]] for camera in rig.cameras])
    off = (found - true) / calibration.rig.std[:, :4]
    assert np.sqrt((off**2).mean()) < 2.0  # one on average, over twelve numbers


def test_distances_between_cameras_are_found_within_what_is_stated(rig, calibration):
    found, true = (np.linalg.norm(one.places[1:] - one.places[0], axis=1) for one in (calibration.rig, rig))
    assert np.abs(found / true - 1).max() < 4 * calibration.scale_std
    assert calibration.scale_std < 0.0005


def test_ground_and_origin_are_those_of_the_frame(rig, on_floor):
    np.testing.assert_allclose(on_floor.rig.places, rig.places, atol=3.0)
    for found, true in zip(on_floor.rig.cameras, rig.cameras, strict=True):
        np.testing.assert_allclose(found.camera_from_world[:3, :3], true.camera_from_world[:3, :3], atol=2e-3)
    assert on_floor.room[:, 2].min() > -500


def test_stated_deviation_of_points_holds_what_they_are_off(rig, on_floor):
    grid = room_grid(on_floor.room)
    calibrated, noisy = point_covariances(on_floor.rig, on_floor.covariance, grid)
    assert np.sqrt(3 * np.diag(calibrated).mean()) == pytest.approx(
        on_floor.point_std, rel=0.01
    )  # the grid lies along the axes
    assert 0.05 < np.sqrt(np.trace(noisy, axis1=1, axis2=2).mean()) < 0.5  # px at 4 m is 4 mm, and the noise 0.05


def test_verdict_names_grade_and_what_is_missing(calibration):
    assert calibration.verdict.grade == "usable"
    assert "balls lie 0.05 px from where they are expected" in str(calibration.verdict)
    assert "wave it where it looks" in str(calibration.verdict)


def test_other_bright_things_are_left_out(rig, frames, calibration):
    rng = np.random.default_rng(5)
    more = [
        [balls_at(np.concatenate([balls.centres, rng.uniform((0, 0), (1280, 1024), (1, 2))]), 0.05) for balls in views]
        for views in frames
    ]
    found = calibrate_wand(more, WAND, SIZES, NAMES)
    assert found.rig.noise == pytest.approx(0.05, rel=0.1)


def test_false_wands_in_one_camera_spoil_nothing(frames):
    rng, spoilt = np.random.default_rng(4), [list(views) for views in frames]
    for number in range(0, N_FRAMES, 15):
        start, along = rng.uniform((100, 100), (1100, 900)), rng.normal(size=2)
        places = start + np.outer([0, 0.36, 1], 60 * along / np.linalg.norm(along))
        spoilt[number][0] = balls_at(places, 0.05)
    assert calibrate_wand(spoilt, WAND, SIZES, NAMES).rig.noise == pytest.approx(0.05, rel=0.1)


@pytest.fixture(scope="module")
def two_balls(rig):
    """Frames of a wand whose two balls look alike."""
    return views_of_scene(wand_scene(rig, N_FRAMES, TWO, rate=30.0), rig)


def test_two_balls_that_look_alike_calibrate_as_three_do(rig, two_balls, calibration):
    found = calibrate_wand(two_balls, TWO, SIZES, NAMES)
    assert found.rig.noise == pytest.approx(0.05, rel=0.1)
    assert found.n_views.min() > 0.9 * calibration.n_views.min()
    gaps, true = (np.linalg.norm(one.places[1:] - one.places[0], axis=1) for one in (found.rig, rig))
    assert np.abs(gaps / true - 1).max() < 4 * found.scale_std < 0.002


def test_mirrored_images_of_a_wand_of_two_balls_are_recognised(two_balls):
    with pytest.raises(InputError, match="mirrored"):
        calibrate_wand(changed(two_balls, 2, mirrored), TWO, SIZES, NAMES)


def test_ground_is_where_three_balls_lie_that_are_no_l_frame(rig):
    balls, rng = np.array([[0.0, 0, 0], [700, 0, 0], [300, 350, 0]]), np.random.default_rng(1)
    places = balls + np.array([100.0, 50, 0])
    views = [balls_at(project(eye, places) + rng.normal(scale=0.05, size=(3, 2)), 0.05) for eye in rig.cameras]
    sides = [np.linalg.norm(balls[one] - balls[two]) for one, two in ((0, 1), (0, 2), (1, 2))]
    np.testing.assert_allclose(find_ground([views], rig, sides)[:3, 3], [100, 50, 0], atol=1.0)
    with pytest.raises(InputError, match="differ by a tenth"):
        find_ground([views], rig, (700, 461, 690))


@pytest.mark.parametrize("camera", range(3))
def test_mirrored_images_are_recognised(frames, camera):
    with pytest.raises(InputError, match="mirrored"):
        calibrate_wand(changed(frames, camera, mirrored), WAND, SIZES, NAMES)


def test_camera_that_sees_nothing_is_named(frames):
    with pytest.raises(InputError, match="b shows the wand in 0 images"):
        calibrate_wand(changed(frames, 1, lambda balls: EMPTY), WAND, SIZES, NAMES)


def test_camera_that_sees_what_no_other_sees_is_named(frames):
    parted = [
        [balls if (index == 2) == (number >= N_FRAMES // 2) else EMPTY for index, balls in enumerate(views)]
        for number, views in enumerate(frames)
    ]
    with pytest.raises(InputError, match="c shares 0 views of the wand with a, b"):
        calibrate_wand(parted, WAND, SIZES, NAMES)


def test_other_distances_of_the_wand_are_told(frames):
    with pytest.raises(InputError, match="seen at 36 % of its length, and said to be at 30 %"):
        calibrate_wand(frames, (0, 150, 500), SIZES, NAMES)


def test_another_length_of_the_wand_shows_in_the_frame(rig, frames):
    long = calibrate_wand(frames, tuple(1.1 * place for place in WAND), SIZES, NAMES)
    lying = views_of_scene(frame_scene(rig, 2), rig, seed=1)
    with pytest.raises(InputError, match="the wand's distances are not"):
        find_ground(lying[:1], long.rig, FRAME)


def test_late_images_of_one_camera_are_told_with_their_frames(frames):
    late = [[views[0], frames[max(number - 6, 0)][1], views[2]] for number, views in enumerate(frames)]
    with pytest.raises(InputError, match=r"late|early|other times"):
        calibrate_wand(late, WAND, SIZES, NAMES)


@pytest.mark.parametrize(
    ("distances", "sentence"),
    [((0, 250, 500), "50 % of its length"), ((500,), "two or three places"), ((0, 300, 200), "in order")],
)
def test_wands_whose_ends_look_alike_are_refused(distances, sentence):
    with pytest.raises(InputError, match=sentence):
        check_wand(distances)


def test_a_wand_is_found_in_either_direction_and_among_others():
    wand = check_wand((0, 320, 500))  # counted from the other end
    balls = np.array([[100.0, 100], [136, 100], [200, 100], [400, 300]])
    for order in ([0, 1, 2, 3], [2, 3, 0, 1]):
        np.testing.assert_allclose(find_wand(balls[order], wand), balls[:3])
    assert np.isnan(find_wand(balls[[0, 1, 3]], wand)).all()


def test_exchanged_arms_of_the_frame_are_told(rig):
    lying = views_of_scene(frame_scene(rig, 2, (400.0, 600.0)), rig, seed=1)
    with pytest.raises(InputError, match="below the floor"):
        find_ground(lying[:1], rig, (600.0, 400.0))
