"""A marker that is not seen, against where it is: on a rigid body that was seen before in other poses."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen._kernels.marker_history import SeenNeighbours, place_marker, room_for_poses, write_moments
from skelgen.geometry.orientation import rotation_by_quaternion
from skelgen.geometry.rotations import matrix_from_vector

N_POSES, MARKER, NEIGHBOURS = 7, 2, np.array([0, 4, 3, 1])
NOISE = 0.5  # mm
EXACT = 1e-9  # mm


def seen_now(body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Remembered poses of a rigid body, and all its markers now."""
    rng = np.random.default_rng(1)
    turns = matrix_from_vector(rng.normal(size=(N_POSES + 1, 3)))
    placed = body @ turns.swapaxes(1, 2) + 1000.0 * rng.normal(size=(N_POSES + 1, 1, 3))
    return placed[:-1].copy(), placed[-1]


@pytest.fixture
def poses_and_now() -> tuple[np.ndarray, np.ndarray]:
    return seen_now(100.0 * np.random.default_rng(0).normal(size=(5, 3)))


def predicted(poses: np.ndarray, now: np.ndarray) -> tuple[np.ndarray, float, list[int]]:
    """Place and variance of the marker, and the poses that were used."""
    weights = np.array([1.0, 0.5, 2.0, 1.0])
    neighbours = SeenNeighbours(np.concatenate([[MARKER], NEIGHBOURS]), now[NEIGHBOURS], weights)
    aligned, places = room_for_poses(len(poses)), np.empty((1 + len(poses), 4))
    count = write_moments(poses, neighbours, aligned)
    rotations = rotation_by_quaternion(aligned.moments[:count])
    variance = place_marker(poses, neighbours, aligned, rotations, NOISE, places)
    return places[0, :3], variance, aligned.rows[:count].tolist()


def test_a_marker_of_a_rigid_body_is_where_every_pose_puts_it(poses_and_now):
    poses, now = poses_and_now
    place, variance, used = predicted(poses, now)
    np.testing.assert_allclose(place, now[MARKER], atol=EXACT)
    assert variance == pytest.approx(NOISE**2)
    assert used == list(range(N_POSES))


def test_poses_without_the_marker_or_with_too_few_neighbours_are_left_out(poses_and_now):
    poses, now = poses_and_now
    poses[1, MARKER] = np.nan
    poses[3, NEIGHBOURS[0]] = np.nan
    poses[4, NEIGHBOURS[:2]] = np.nan
    place, _, used = predicted(poses, now)
    assert used == [0, 2, 3, 5, 6]
    np.testing.assert_allclose(place, now[MARKER], atol=EXACT)


def test_a_pose_that_does_not_fit_the_neighbours_counts_nothing(poses_and_now):
    poses, now = poses_and_now
    poses[5] *= 1.5
    np.testing.assert_allclose(predicted(poses, now)[0], now[MARKER], atol=EXACT)


def test_the_variance_is_how_far_apart_poses_put_the_marker(poses_and_now):
    poses, now = poses_and_now
    away = np.random.default_rng(2).normal(size=(N_POSES, 3))
    poses[:, MARKER] += away
    place, variance, _ = predicted(poses, now)
    assert np.linalg.norm(place - now[MARKER]) < np.linalg.norm(away, axis=1).max()
    spread = (away**2).sum() / N_POSES - (place - now[MARKER]) @ (place - now[MARKER])
    assert variance == pytest.approx(NOISE**2 + spread / 3)
