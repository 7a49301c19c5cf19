"""Angles in turn give back the rotation, also where two axes meet, and do not jump while the body turns smoothly."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.euler import euler_angles, gimbal_distance, matrix_from_euler
from skelgen.geometry.rotations import matrix_from_vector

ROUNDING = 3e-13  # sines of up to 150 radians, in products of three matrices
GIMBAL = 2e-7  # rad: scipy takes what is so near to the gimbal position for it

ORDERS = ("XYZ", "ZXY")


@pytest.mark.parametrize("axes", ORDERS)
def test_angles_of_any_rotation_give_it_back(axes):
    rotations = matrix_from_vector(np.random.default_rng(0).normal(size=(2000, 3)) * 2)
    assert np.abs(matrix_from_euler(axes, euler_angles(axes, rotations)) - rotations).max() < ROUNDING


@pytest.mark.parametrize("axes", ORDERS)
@pytest.mark.parametrize("off", [0.0, 1e-17, 1e-12, 1e-8, 1e-6, 1e-4])
@pytest.mark.parametrize("sign", [1, -1])
def test_angles_give_the_rotation_back_near_the_gimbal_position(axes, off, sign):
    angles = np.array([[0.7, sign * (np.pi / 2 - off), -0.4]])
    rotations = matrix_from_euler(axes, angles)
    assert np.abs(matrix_from_euler(axes, euler_angles(axes, rotations)) - rotations).max() < GIMBAL
    assert abs(gimbal_distance(angles)[0] - off) < GIMBAL


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
    assert np.allclose(both, about_z @ about_x, rtol=0, atol=ROUNDING)
    assert np.array_equal(matrix_from_euler("", np.zeros((2, 0))), np.tile(np.eye(3), (2, 1, 1)))


def test_no_frames_have_no_angles():
    assert euler_angles("XYZ", np.zeros((0, 3, 3))).shape == (0, 3)
