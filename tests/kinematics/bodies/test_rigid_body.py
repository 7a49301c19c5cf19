"""Rigid bodies from many frames: exact points, one normal form, deviations that hold."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.kinematics.bodies.rigid_body import calibrate_rigid_body, normal_form

POINTS = np.array([[10.0, -20, 5], [120, 10, 0], [30, 90, -20], [60, 40, 70], [-30, 60, 50]])
EXACT = 1e-6  # mm
COVERAGE = (0.90, 0.98)  # of 95 % intervals


@pytest.fixture
def measured(random_poses):
    """`measured(seed, noise [mm], dropouts)`: positions of the body in 40 frames."""

    def make(seed: int = 0, noise: float = 0.0, dropouts: float = 0.0) -> np.ndarray:
        random, poses = np.random.default_rng(seed), random_poses(40, seed + 1000)
        positions = np.einsum("fij,nj->fni", poses[:, :3, :3], POINTS) + poses[:, None, :3, 3]
        positions += noise * random.normal(size=positions.shape)
        return np.where((random.random(positions.shape[:2]) < dropouts)[..., None], np.nan, positions)

    return make


def test_exact_frames_give_the_exact_normal_form(measured):
    body = calibrate_rigid_body(measured())
    np.testing.assert_allclose(body.points, normal_form(POINTS)[0], atol=EXACT)
    assert body.noise < EXACT


def test_normal_form_does_not_depend_on_the_frame_of_the_points(random_poses):
    expected, _ = normal_form(POINTS)
    for pose in random_poses(5, 3):
        np.testing.assert_allclose(normal_form(POINTS @ pose[:3, :3].T + pose[:3, 3])[0], expected, atol=EXACT)


def test_normal_form_is_a_proper_motion_to_the_stated_zeros():
    points, transform = normal_form(POINTS)
    np.testing.assert_allclose(POINTS @ transform[:3, :3].T + transform[:3, 3], points, atol=EXACT)
    assert np.linalg.det(transform[:3, :3]) == pytest.approx(1)
    assert [*points[0], *points[1, 1:], points[2, 2]] == [0] * 6
    assert points[1, 0] > 0
    assert points[2, 1] > 0


def test_mirrored_points_have_another_normal_form():
    assert np.abs(normal_form(POINTS * [1, 1, -1])[0] - normal_form(POINTS)[0]).max() > 10


def test_poses_carry_the_body_to_its_points(measured):
    positions = measured()
    body = calibrate_rigid_body(positions)
    carried = np.einsum("fij,nj->fni", body.world_from_body[:, :3, :3], body.points)
    np.testing.assert_allclose(carried + body.world_from_body[:, None, :3, 3], positions, atol=EXACT)


@pytest.mark.parametrize("dropouts", [0.0, 0.2])
def test_stated_deviations_hold(measured, dropouts):
    truth = normal_form(POINTS)[0]
    bodies = [calibrate_rigid_body(measured(seed, 0.5, dropouts)) for seed in range(150)]
    free = truth != 0
    inside = [np.abs(body.points - truth)[free] < 1.96 * body.std[free] for body in bodies]
    assert COVERAGE[0] <= np.mean(inside) <= COVERAGE[1]
    assert np.mean([body.noise for body in bodies]) == pytest.approx(0.5, rel=0.02)


def test_more_frames_make_the_points_surer(measured):
    positions = measured(noise=0.5)
    few, many = calibrate_rigid_body(positions[:10]), calibrate_rigid_body(positions)
    assert few.std.sum() / few.noise == pytest.approx(2 * many.std.sum() / many.noise, rel=1e-2)


def test_points_on_one_line_are_refused(measured):
    with pytest.raises(InputError, match="off a line"):
        calibrate_rigid_body(measured()[:, [0, 0, 0]])


def test_first_three_on_one_line_are_refused():
    with pytest.raises(InputError, match="list three others first"):
        normal_form(np.array([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]]))


def test_two_points_are_refused(measured):
    with pytest.raises(InputError, match="2 points"):
        calibrate_rigid_body(measured()[:, :2])
