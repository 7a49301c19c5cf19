from __future__ import annotations

import numpy as np

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.geometry.xyz_angles import gimbal_distance, xyz_angles

ROUNDING = 1e-12


def rebuilt(angles):
    turns = (matrix_from_vector(angle[:, np.newaxis] * axis) for angle, axis in zip(angles.T, np.eye(3), strict=True))
    first, second, third = turns
    return first @ second @ third


def test_angles_give_any_rotation_back():
    rotations = matrix_from_vector(np.random.default_rng(0).normal(size=(500, 3)) * 2)
    assert np.abs(rebuilt(xyz_angles(rotations)) - rotations).max() < ROUNDING


def test_angles_give_the_gimbal_position_back():
    angles = np.array([[0.3, np.pi / 2, 0.4], [0.3, -np.pi / 2, 0.4]])
    rotations = rebuilt(angles)
    assert np.abs(rebuilt(xyz_angles(rotations)) - rotations).max() < ROUNDING
    assert np.abs(gimbal_distance(angles)).max() < 1e-7  # arccos near 1 halves the digits


def test_angles_run_on_through_quarter_and_full_turns():
    wanted = np.stack([np.linspace(0.1, 9, 300), np.linspace(0.2, 7, 300), np.linspace(-0.1, -8, 300)], axis=1)
    assert np.abs(xyz_angles(rebuilt(wanted)) - wanted).max() < 1e-9
