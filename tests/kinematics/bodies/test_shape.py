"""Rigid shapes from markers with gaps."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.orientation import ROTATORS
from skelgen.kinematics.bodies.shape import determines_pose, distinct_rows, fit_shape

POINTS = np.array([[0.0, 0, 0], [120, 10, 0], [30, 90, -20], [60, 40, 70], [-30, 60, 50]])
EXACT = 1e-6  # mm


@pytest.fixture
def poses(random_poses):
    return random_poses(120, 9)


@pytest.fixture
def positions(poses):
    return np.einsum("fij,nj->fni", poses[:, :3, :3], POINTS) + poses[:, None, :3, 3]


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
    np.testing.assert_allclose(distances(shape.points), distances(POINTS), atol=EXACT)
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
    np.testing.assert_allclose(distances(shape.points), distances(POINTS), atol=EXACT)


def test_shape_rests_on_the_given_frames_only(positions):
    spoilt = positions.copy()
    spoilt[50:, 0] += 40.0
    shape = fit_shape(spoilt, np.arange(50))
    np.testing.assert_allclose(distances(shape.points), distances(POINTS), atol=EXACT)


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
