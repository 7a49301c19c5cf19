"""Invariants of rotations; Euler angles give back the rotation and do not jump while a body turns smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry import rotations as rot
from skelgen.geometry.rotations import (
    euler_angles,
    gimbal_distance,
    matrix_from_euler,
    matrix_from_vector,
    unit_vectors,
)

ROUNDING = 1e-12  # a few double roundings on numbers of size one
EULER_ROUNDING = 3e-13  # sines of up to 150 radians, in products of three matrices
AT_GIMBAL = 1e-13  # a few roundings in products of three matrices
ORDERS = ("XYZ", "ZXY")


@pytest.fixture
def matrices():
    vectors = np.random.default_rng(0).normal(size=(500, 3)) * np.linspace(0, 2, 500)[:, None]
    return rot.matrix_from_vector(vectors)


def test_matrices_from_vectors_are_proper_rotations(matrices):
    np.testing.assert_allclose(matrices @ matrices.swapaxes(1, 2), np.tile(np.eye(3), (500, 1, 1)), atol=ROUNDING)
    np.testing.assert_allclose(np.linalg.det(matrices), 1, atol=ROUNDING)


def test_quaternions_round_trip(matrices):
    again = rot.matrix_from_quaternion(rot.quaternion_from_matrix(matrices))
    np.testing.assert_allclose(again, matrices, atol=ROUNDING)


def test_vectors_round_trip_below_half_a_turn():
    vectors = np.random.default_rng(1).normal(size=(200, 3))
    vectors *= (np.linspace(0, np.pi - 1e-3, 200) / np.linalg.norm(vectors, axis=1))[:, None]
    np.testing.assert_allclose(rot.vector_from_matrix(rot.matrix_from_vector(vectors)), vectors, atol=1e-9)


@pytest.mark.parametrize("axis", np.eye(3))
def test_half_turns_keep_their_axis(axis):
    vector = rot.vector_from_matrix(rot.matrix_from_vector(axis * np.pi))
    np.testing.assert_allclose(np.abs(vector), axis * np.pi, atol=1e-7)


def test_scipy_agrees(matrices):
    from scipy.spatial.transform import Rotation

    np.testing.assert_allclose(rot.vector_from_matrix(matrices), Rotation.from_matrix(matrices).as_rotvec(), atol=1e-9)


def test_a_gap_in_uniform_rotation_is_filled_exactly():
    turn = np.linspace(0, 1, 11)[:, None] * np.array([0.3, -0.8, 0.5])
    whole = rot.matrix_from_vector(turn)
    known = np.ones(11, dtype=bool)
    known[3:8] = False
    broken = np.where(known[:, None, None], whole, np.nan)
    np.testing.assert_allclose(rot.fill_rotations(broken, known), whole, atol=ROUNDING)


def test_gaps_at_the_ends_are_held():
    known = np.array([False, True, True, False])
    filled = rot.fill_vectors(np.array([[np.nan], [1.0], [2.0], [np.nan]]), known)
    np.testing.assert_array_equal(filled[:, 0], [1, 1, 2, 2])


def test_nearest_rotation_of_a_reflection_is_proper():
    matrix = rot.nearest_rotation(np.diag([1.0, 1.0, -1.0]))
    assert np.linalg.det(matrix) == pytest.approx(1)


@pytest.mark.parametrize("axes", ORDERS)
def test_angles_of_any_rotation_give_it_back(axes):
    rotations = matrix_from_vector(np.random.default_rng(0).normal(size=(2000, 3)) * 2)
    assert np.abs(matrix_from_euler(axes, euler_angles(axes, rotations)) - rotations).max() < EULER_ROUNDING


@pytest.mark.parametrize("axes", ORDERS)
@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-12, 1e-8, 1e-6, 1e-4])
@pytest.mark.parametrize("sign", [1, -1])
def test_angles_give_the_rotation_back_near_the_gimbal_position(axes, off, sign):
    angles = np.array([[0.7, sign * (np.pi / 2 - off), -0.4]])
    rotations = matrix_from_euler(axes, angles)
    assert np.abs(matrix_from_euler(axes, euler_angles(axes, rotations)) - rotations).max() < AT_GIMBAL
    assert abs(gimbal_distance(angles)[0] - off) < AT_GIMBAL


@pytest.mark.parametrize("axes", ORDERS)
def test_angles_run_on_through_quarter_and_full_turns(axes):
    wanted = np.stack([np.linspace(0.1, 9, 300), np.linspace(0.2, 7, 300), np.linspace(-0.1, -8, 300)], axis=1)
    assert np.abs(euler_angles(axes, matrix_from_euler(axes, wanted)) - wanted).max() < 1e-9


@pytest.mark.parametrize("axes", ORDERS)
def test_angles_do_not_jump_while_a_body_turns_over(axes):
    steps = np.linspace(0, 3 * np.pi, 400)
    angles = np.stack([0.3 * np.sin(steps), 2 * steps, 0.2 * np.cos(steps)], axis=-1)
    found = euler_angles(axes, matrix_from_euler(axes, angles))
    assert np.abs(np.diff(found, axis=0)).max() < 2 * np.abs(np.diff(angles, axis=0)).max()


def test_rotations_are_multiplied_from_the_left():
    about_z, about_x = matrix_from_euler("Z", np.array([[0.3]])), matrix_from_euler("X", np.array([[0.5]]))
    both = matrix_from_euler("ZX", np.array([[0.3, 0.5]]))
    assert np.allclose(both, about_z @ about_x, rtol=0, atol=EULER_ROUNDING)
    assert np.array_equal(matrix_from_euler("", np.zeros((2, 0))), np.tile(np.eye(3), (2, 1, 1)))


def test_no_frames_have_no_angles():
    assert euler_angles("XYZ", np.zeros((0, 3, 3))).shape == (0, 3)


def test_vectors_without_length_have_no_direction():
    assert unit_vectors([[0.0, 3.0, 4.0], [0.0, 0.0, 0.0]]).tolist() == [[0.0, 0.6, 0.8], [0.0, 0.0, 0.0]]
