"""Kinds of joints from relative rotations."""

from __future__ import annotations

import numpy as np
import pytest

from skelgen.geometry.rotations import matrix_from_vector
from skelgen.kinematics.joints.joint_type import TypeLimits, find_joint_type

N_FRAMES = 500
AXIS, SECOND = np.array([0.0, 0.6, 0.8]), np.array([1.0, 0.0, 0.0])
ROUNDING = 1e-9  # rad: noise of rotations that are exact
FREEDOMS = 6.0  # per frame: two limbs with three markers

NOISES = pytest.mark.parametrize("noise", [ROUNDING, 0.005, 0.03])


def found(vectors, noise=ROUNDING, seed=0, limits=None, wanted=None):
    """The kind of rotations, shape (n_frames, 3) or (n_frames, 3, 3), with noise [rad] about every axis."""
    exact = matrix_from_vector(vectors) if vectors.ndim == 2 else vectors
    shaken = matrix_from_vector(np.random.default_rng(seed).normal(size=(len(exact), 3)) * noise)
    covariances = np.tile(np.eye(3) * noise**2, (len(exact), 1, 1))
    return find_joint_type(exact @ shaken, covariances, FREEDOMS, limits, wanted)


def wave(size, speed):
    """A swing of some size [rad]."""
    return size * np.sin(np.linspace(0, speed, N_FRAMES))[:, np.newaxis]


@pytest.fixture
def bend():
    """Half a turn about one axis."""
    return np.linspace(-1.5, 1.5, N_FRAMES)[:, np.newaxis] * AXIS


@pytest.fixture
def cross():
    """Turns about an axis fixed in the parent and one fixed in the child."""
    return matrix_from_vector(wave(0.5, 20) * AXIS) @ matrix_from_vector(wave(0.4, 33) * SECOND)


@NOISES
def test_turn_about_one_axis_is_a_hinge(bend, noise):
    kind = found(bend, noise)
    assert kind.kind == "hinge"
    for axis in (kind.axis_in_parent, kind.axis_in_child):
        assert abs(axis @ AXIS) == pytest.approx(1, abs=0.01)


@NOISES
def test_turn_about_two_axes_is_a_universal_joint(cross, noise):
    kind = found(cross, noise)
    assert kind.kind == "universal"
    assert abs(kind.axis_in_parent @ AXIS) == pytest.approx(1, abs=0.01)
    assert abs(kind.axis_in_child @ SECOND) == pytest.approx(1, abs=0.01)


@NOISES
def test_turn_about_all_axes_is_a_ball(noise):
    assert found(np.random.default_rng(3).normal(size=(N_FRAMES, 3)) * 0.5, noise).kind == "ball"


@pytest.mark.parametrize(("vectors", "kind"), [(wave(0.5, 20) * AXIS, "hinge"), (np.zeros((N_FRAMES, 3)), "rigid")])
def test_exact_rotations_with_no_stated_noise_are_told(vectors, kind):
    assert find_joint_type(matrix_from_vector(vectors), np.zeros((N_FRAMES, 3, 3)), FREEDOMS).kind == kind


@NOISES
def test_no_turn_beyond_the_noise_is_rigid(noise):
    assert found(np.tile([0.3, -0.2, 0.5], (N_FRAMES, 1)), noise).kind == "rigid"


def test_noise_that_hides_any_turn_leaves_the_kind_undetermined():
    assert found(np.zeros((20, 3)), 0.2).kind == "undetermined"


def test_noise_as_large_as_the_turn_leaves_the_kind_undetermined(bend):
    assert found(bend[240:270], 0.15).kind == "undetermined"


def test_errors_that_last_count_as_few(bend):
    lasting = np.repeat(np.random.default_rng(1).normal(size=(N_FRAMES // 25, 3)) * 0.03, 25, axis=0)
    rotations = matrix_from_vector(bend) @ matrix_from_vector(lasting)
    kind = find_joint_type(rotations, np.tile(np.eye(3) * 0.02**2, (N_FRAMES, 1, 1)), FREEDOMS)
    assert kind.type_fits["hinge"].limit > 1.8  # as of some twenty frames
    assert kind.kind == "hinge"


def test_small_turn_about_a_second_axis_makes_no_hinge(bend):
    assert found(matrix_from_vector(bend) @ matrix_from_vector(wave(0.3, 40) * SECOND)).kind == "universal"


def test_wobble_within_the_limit_stays_a_hinge(bend):
    assert found(matrix_from_vector(bend) @ matrix_from_vector(wave(0.05, 40) * SECOND)).kind == "hinge"


def test_wobble_beyond_a_stricter_limit_is_no_hinge(bend):
    rotations = matrix_from_vector(bend) @ matrix_from_vector(wave(0.05, 40) * SECOND)
    assert found(rotations, limits=TypeLimits(wobble_share=0.01)).kind == "universal"


@pytest.mark.parametrize("wanted", ["rigid", "hinge", "universal", "ball"])
def test_the_users_kind_is_obeyed(bend, wanted):
    assert found(bend, 0.01, wanted=wanted).kind == wanted


def test_frames_of_parent_and_child_do_not_matter(cross):
    left, right = (matrix_from_vector(np.array(vector)) for vector in ([1.0, 2.0, 0.5], [-0.4, 0.3, 2.0]))
    kind = found(left @ cross @ right)
    assert kind.kind == "universal"
    assert abs(kind.axis_in_parent @ (left @ AXIS)) == pytest.approx(1, abs=1e-6)
    assert abs(kind.axis_in_child @ (right.T @ SECOND)) == pytest.approx(1, abs=1e-6)


def test_axes_follow_frames_that_are_turned_later(bend):
    turn = matrix_from_vector(np.array([1.0, 2.0, 0.5]))
    kind = found(bend)
    np.testing.assert_allclose(kind.with_frames(turn, np.eye(3)).axis_in_parent, turn @ kind.axis_in_parent)


def test_main_turn_is_the_spread_about_the_axis():
    angles = np.random.default_rng(5).normal(size=4000) * 0.2
    kind = found(angles[:, np.newaxis] * AXIS)
    assert kind.main_turn == pytest.approx(0.2, rel=0.05)
    assert kind.true_wobble == pytest.approx(0, abs=1e-6)


def test_noise_alone_seldom_makes_another_kind(bend):
    assert [found(bend, 0.02, seed).kind for seed in range(30)] == ["hinge"] * 30
