"""Invariants of rotations."""

import numpy as np
import pytest

from skelgen.geometry import rotations as rot

ROUNDING = 1e-12  # a few double roundings on numbers of size one


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
