"""Kinds of joints from relative rotations."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.kind import KindLimits, find_kind

AXIS = np.array([0.0, 0.6, 0.8])
LIMITS = KindLimits(noise_factor=1.3, hinge_wobble=0.08, least_turn=1e-4)


def turned(vectors, noise=0.0, seed=0):
    """Relative rotations with some noise [rad] about every axis."""
    shaken = matrix_from_vector(np.random.default_rng(seed).normal(size=vectors.shape) * noise)
    return matrix_from_vector(vectors) @ shaken


@pytest.fixture
def bend():
    """Half a turn about one axis, 500 frames."""
    return np.linspace(-1.5, 1.5, 500)[:, None] * AXIS


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.03])
def test_turn_about_one_axis_is_a_hinge(bend, noise):
    found = find_kind(turned(bend, noise), noise, LIMITS)
    assert found.kind == "hinge"
    for axis in (found.axis_in_parent, found.axis_in_child):
        assert abs(axis @ AXIS) == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.03])
def test_turn_about_all_axes_is_a_ball(noise):
    vectors = np.random.default_rng(3).normal(size=(500, 3)) * 0.5
    assert find_kind(turned(vectors, noise), noise, LIMITS).kind == "ball"


@pytest.mark.parametrize("noise", [0.0, 0.005, 0.03])
def test_no_turn_beyond_the_noise_is_rigid(noise):
    still = np.tile([0.3, -0.2, 0.5], (500, 1))
    assert find_kind(turned(still, noise), noise, LIMITS).kind == "rigid"


def test_small_turn_about_a_second_axis_makes_no_hinge(bend):
    second = np.sin(np.linspace(0, 40, 500))[:, None] * np.array([1.0, 0, 0]) * 0.3
    relative = matrix_from_vector(bend) @ matrix_from_vector(second)
    assert find_kind(relative, 0.0, LIMITS).kind == "ball"


def test_wobble_within_the_limit_stays_a_hinge(bend):
    second = np.sin(np.linspace(0, 40, 500))[:, None] * np.array([1.0, 0, 0]) * 0.05
    relative = matrix_from_vector(bend) @ matrix_from_vector(second)
    assert find_kind(relative, 0.0, LIMITS).kind == "hinge"


def test_frames_of_parent_and_child_do_not_matter(bend):
    left, right = (matrix_from_vector(np.array(vector)) for vector in ([1.0, 2.0, 0.5], [-0.4, 0.3, 2.0]))
    found = find_kind(left @ turned(bend) @ right, 0.0, LIMITS)
    assert found.kind == "hinge"
    np.testing.assert_allclose(abs(found.axis_in_parent @ (left @ AXIS)), 1, atol=1e-9)
    np.testing.assert_allclose(abs(found.axis_in_child @ (right.T @ AXIS)), 1, atol=1e-9)


def test_main_turn_is_the_spread_about_the_axis():
    angles = np.random.default_rng(5).normal(size=4000) * 0.2
    found = find_kind(matrix_from_vector(angles[:, None] * AXIS), 0.0, LIMITS)
    assert found.main_turn == pytest.approx(0.2, rel=0.05)
    assert found.wobble == pytest.approx(0, abs=1e-6)
