"""Angles in turn give back the rotation, also where two axes meet, and do not jump while the body turns smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.euler import matrix_from_turns, zxy_from_matrix
from skelgen.geometry.rotations import matrix_from_vector

ROUNDING = 1e-13  # sines of up to fifty radians, in products of three matrices


def test_angles_of_any_rotation_give_it_back():
    turns = matrix_from_vector(np.random.default_rng(0).normal(size=(500, 4, 3)) * 2)
    assert np.abs(matrix_from_turns("zxy", zxy_from_matrix(turns)) - turns).max() < ROUNDING


@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-12, 1e-8, 1e-4])
@pytest.mark.parametrize("sign", [1, -1])
def test_angles_give_the_rotation_back_where_z_and_y_turn_about_one_axis(off, sign):
    angles = np.array([[0.7, sign * (np.pi / 2 - off), -0.4]])
    turns = matrix_from_turns("zxy", angles)
    assert np.abs(matrix_from_turns("zxy", zxy_from_matrix(turns)) - turns).max() < ROUNDING


def test_angles_do_not_jump_while_a_body_turns_over():
    steps = np.linspace(0, 3 * np.pi, 400)
    angles = np.stack([0.3 * np.sin(steps), 2 * steps, 0.2 * np.cos(steps)], axis=-1)[:, np.newaxis]
    found = zxy_from_matrix(matrix_from_turns("zxy", angles))
    assert np.abs(np.diff(found, axis=0)).max() < 2 * np.abs(np.diff(angles, axis=0)).max()


def test_turns_are_multiplied_from_the_left():
    about_z, about_x = matrix_from_turns("z", np.array([0.3])), matrix_from_turns("x", np.array([0.5]))
    assert np.allclose(matrix_from_turns("zx", np.array([0.3, 0.5])), about_z @ about_x, rtol=0, atol=ROUNDING)
    assert np.array_equal(matrix_from_turns("", np.zeros((2, 0))), np.tile(np.eye(3), (2, 1, 1)))
