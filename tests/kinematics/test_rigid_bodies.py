"""Rigid shapes from markers with gaps; rigid bodies in one normal form, with deviations that hold."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.errors import InputError
from skelgen.geometry.orientation import ROTATORS
from skelgen.kinematics.rigid_bodies import calibrate_rigid_body, determines_pose, distinct_rows, fit_shape, normal_form

MARKERS = np.array([[0.0, 0, 0], [120, 10, 0], [30, 90, -20], [60, 40, 70], [-30, 60, 50]])
EXACT = 1e-6  # mm


@pytest.fixture
def poses(random_poses):
    return random_poses(120, 9)


@pytest.fixture
def positions(poses):
    return np.einsum("fij,nj->fni", poses[:, :3, :3], MARKERS) + poses[:, None, :3, 3]


def gaps(positions):
    """One point in five unseen, but never more than one in the first frame."""
    unseen = np.random.default_rng(2).random(positions.shape[:2]) < 0.2
    unseen[0] = False
    return np.where(unseen[..., None], np.nan, positions)


def distances(points):
    return np.linalg.norm(points[:, None] - points, axis=2)


@pytest.mark.parametrize("rotator", ROTATORS.values(), ids=ROTATORS)
def test_exact_markers_with_gaps_give_the_exact_shape(positions, rotator):
    shape = fit_shape(gaps(positions), np.arange(len(positions)), rotator)
    np.testing.assert_allclose(distances(shape.points), distances(MARKERS), atol=EXACT)
    np.testing.assert_allclose(shape.points.mean(axis=0), 0, atol=EXACT)


def test_poses_carry_the_shape_to_the_markers(positions):
    measured = gaps(positions)
    shape = fit_shape(measured, np.arange(len(positions)))
    carried = np.einsum("fij,nj->fni", shape.world_from_limb[:, :3, :3], shape.points)
    carried += shape.world_from_limb[:, None, :3, 3]
    np.testing.assert_allclose(carried[shape.posed], positions[shape.posed], atol=EXACT)


def test_frames_have_a_pose_if_three_points_are_seen(positions):
    measured = gaps(positions)
    shape = fit_shape(measured, np.arange(len(positions)))
    np.testing.assert_array_equal(shape.posed, (~np.isnan(measured[:, :, 0])).sum(axis=1) >= 3)


def test_points_that_never_meet_are_placed_by_those_that_both_meet(positions):
    measured = positions.copy()
    measured[:60, 3], measured[60:, 0] = np.nan, np.nan
    shape = fit_shape(measured, np.arange(len(positions)))
    np.testing.assert_allclose(distances(shape.points), distances(MARKERS), atol=EXACT)


def test_shape_rests_on_the_given_frames_only(positions):
    spoilt = positions.copy()
    spoilt[50:, 0] += 40.0
    shape = fit_shape(spoilt, np.arange(50))
    np.testing.assert_allclose(distances(shape.points), distances(MARKERS), atol=EXACT)


@pytest.mark.parametrize("n_points", [1, 2])
def test_fewer_than_three_points_have_no_pose(positions, n_points):
    shape = fit_shape(positions[:, :n_points], np.arange(120))
    assert not shape.has_pose
    assert shape.points.shape == (n_points, 3)


def test_points_on_one_line_have_no_pose(poses):
    line = np.array([[0.0, 0, 0], [50, 0, 0], [100, 0, 0]])
    positions = np.einsum("fij,nj->fni", poses[:, :3, :3], line) + poses[:, None, :3, 3]
    assert not fit_shape(positions, np.arange(120)).has_pose


def test_unseen_limb_has_no_pose(positions):
    assert not fit_shape(np.full_like(positions, np.nan), np.arange(120)).has_pose


def test_which_frames_determine_a_pose():
    points = np.array([[0.0, 0, 0], [100, 0, 0], [200, 0, 0], [0, 100, 0]])
    seen = np.array([[1, 1, 1, 1], [1, 1, 1, 0], [1, 1, 0, 1], [0, 0, 1, 1], [0, 0, 0, 0]], dtype=bool)
    np.testing.assert_array_equal(determines_pose(points, seen), [True, False, True, False, False])


@pytest.mark.parametrize("n_points", [1, 4, 16, 20])
def test_distinct_rows_are_those_of_numpy(n_points):
    seen = np.random.default_rng(0).random((300, n_points)) < 0.8
    rows, which = distinct_rows(seen)
    np.testing.assert_array_equal(rows, np.unique(seen, axis=0))
    np.testing.assert_array_equal(rows[which], seen)


POINTS = np.array([[10.0, -20, 5], [120, 10, 0], [30, 90, -20], [60, 40, 70], [-30, 60, 50]])
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
